"""Let CPUs pass for GPUs: what is decided by a device's kind runs where there is no GPU.

Each program is also compiled by clang for an NVIDIA GPU, pedantically: GPUs' compilers refuse what
those for CPUs let pass, macros with ``...`` for one.
"""

from __future__ import annotations

import functools
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pyvista_vdi.device import devices, programs
from pyvista_vdi.errors import DeviceError


def pretend() -> None:
    """Have each device be described as a GPU, and each program checked."""
    compilers = [shutil.which("clang"), *sorted(Path("/usr/bin").glob("clang-[0-9]*"))]
    clang = next((path for path in compilers if path), None)
    if clang is None:
        raise pytest.UsageError(
            "PYVISTA_VDI_TEST_AS_GPU=1 needs clang, which Debian's pocl-opencl-icd brings"
        )
    describe, build = devices._describe, programs.build

    @functools.cache
    def check(path: str, source: str, options: tuple[str, ...]) -> None:
        target = ["--target=nvptx64", "-Xclang", "-finclude-default-header", "-pedantic-errors"]
        command = [clang, "-x", "cl", *target, "-fsyntax-only", *options, "-"]
        done = subprocess.run(command, input=source, capture_output=True, text=True)
        if done.returncode:
            raise DeviceError(f"{path} is not for GPUs, with {options}:\n{done.stderr}")

    def build_and_check(
        context: Any, device: Any, path: str, source: str, options: tuple[str, ...]
    ) -> Any:
        program = build(context, device, path, source, options)
        check(path, source, tuple(each for each in options if each.startswith(("-D", "-cl-std"))))
        return program

    devices._describe = lambda *given: replace(describe(*given), kind="GPU")
    programs.build = build_and_check
