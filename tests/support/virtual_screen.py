"""An X server without a screen, for programs that draw only through one."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator


@contextlib.contextmanager
def virtual_screen() -> Iterator[str]:
    """Run Xvfb, which Debian and Ubuntu have in the package 'xvfb'; give its display's name."""
    reader, writer = os.pipe()
    # Without -noreset it begins anew when its last client leaves, and refuses others meanwhile:
    # ParaView looks whether there is a screen, leaves, and comes back
    options = ["-screen", "0", "1024x768x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writer), *options],
        pass_fds=[writer],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        os.close(writer)
        with open(reader, encoding="utf-8") as file:  # noqa: PTH123 - a pipe
            number = file.readline().strip()  # written when the server is ready
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()
