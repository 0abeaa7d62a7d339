"""Run code in a new interpreter, where nothing is imported and no driver is loaded yet."""

from __future__ import annotations

import os
import subprocess
import sys

#: Seconds after which an interpreter that does not end is given up.
PATIENCE = 600


def run_python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, **environment}
    if "PYVISTA_VDI_DEVICE" not in environment:
        env.pop("PYVISTA_VDI_DEVICE", None)
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *arguments],
        env=env,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
