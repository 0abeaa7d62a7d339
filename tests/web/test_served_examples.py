"""The examples that serve do so: a page is there, and Ctrl-C ends them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from web_client import PATIENCE

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="Ctrl-C of one process alone"),
]


@pytest.mark.parametrize(
    ("name", "arguments"),
    [("serve.py", ["0"]), ("trame_app.py", ["--port", "0", "--server", "--host", "127.0.0.1"])],
)
def test_an_example_serves_a_page(name, arguments, default_runtime):
    command = [sys.executable, "-u", str(EXAMPLES / name), *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            found = (re.search(r"http://127\.0\.0\.1:\d+/\S*", line) for line in process.stdout)
            url = next(match[0] for match in found if match)
            with urllib.request.urlopen(url) as response:
                assert "<!doctype html" in response.read().decode().lower()
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) in (0, -signal.SIGINT)
        finally:
            process.kill()
