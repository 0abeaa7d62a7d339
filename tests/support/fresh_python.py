"""Run code in a new interpreter, where nothing is imported and no driver is loaded yet."""

from __future__ import annotations

import os
import subprocess
import sys


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **environment}
    if "PYVISTA_VDI_DEVICE" not in environment:
        env.pop("PYVISTA_VDI_DEVICE", None)
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=env,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
