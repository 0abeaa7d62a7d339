"""The verb ``paraview``: where its plugin is, and what ParaView's Python must see."""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sysconfig
from pathlib import Path

from pyvista_vdi.errors import MissingDependencyError, NoDeviceError, UnsupportedError

#: The package, and the plugin in it.
_PACKAGE = Path(__file__).resolve().parents[2]
PLUGIN = Path(__file__).resolve().parent / "plugin" / "vdi_plugin.py"

#: What ParaView's Python is asked: status 3 says that the plugin is there, and no device.
_QUESTIONS = """
import os, sys
from paraview import simple
import numpy, pyvista_vdi
simple.VDISource, simple.VDIToImage, simple.VDIReader
print("ParaView sees pyvista-vdi", pyvista_vdi.__version__, "and NumPy", numpy.__version__)
from pyvista_vdi.device import describe_devices, list_devices
print(describe_devices(), flush=True)
os._exit(0 if any(device.usable for device in list_devices()) else 3)
"""
_NO_DEVICE = 3


OPTIONS = """
environment    -         print the variables by which ParaView finds plugin and package
check=pvpython  [PVPYTHON]  start ParaView's Python, see that it loads the plugin and finds devices
"""


def paraview(options: argparse.Namespace) -> int:
    """Print the plugin's path, or the variables that make ParaView find it and this package.

    With ``--check``, start ParaView's Python with these and see whether it can make a VDI.
    """
    if options.check:
        _check(options.check)
        return 0
    if not options.environment:
        print(PLUGIN)
        return 0
    for variable, folders in _variables().items():
        value = shlex.quote(":".join(map(str, folders)))
        print(f'export {variable}={value}"${{{variable}:+:${variable}}}"')
    return 0


def _check(pvpython: str) -> None:
    """Print what ParaView's Python finds: this package, the plugin, the devices."""
    environment = dict(os.environ)
    for variable, folders in _variables().items():
        before = [environment[variable]] if environment.get(variable) else []
        environment[variable] = ":".join([*map(str, folders), *before])
    try:
        done = subprocess.run([pvpython, "-c", _QUESTIONS], env=environment, check=False)
    except OSError as error:
        raise MissingDependencyError(
            f"{pvpython} does not start ({error}): install ParaView, or name its pvpython"
        ) from error
    if done.returncode == _NO_DEVICE:
        raise NoDeviceError(f"{pvpython} loads the plugin, and finds no OpenCL device: see above")
    if done.returncode:
        raise MissingDependencyError(
            f"{pvpython} does not load the plugin (status {done.returncode}): see above, and "
            "docs/guide_paraview.md"
        )


def _variables() -> dict[str, list[Path]]:
    """Return what to put in front of ParaView's search paths."""
    installed = [Path(sysconfig.get_path(name)).resolve() for name in ("purelib", "platlib")]
    folders = list(dict.fromkeys([_PACKAGE.parent, *installed]))
    for folder in folders:
        if (folder / "vtkmodules").exists():
            raise UnsupportedError(
                f"{folder} holds a VTK of its own, which ParaView would load in place of its own: "
                'make an environment without it (pip install ".[cpu]", not the extra plot)'
            )
    if not (_PACKAGE / "opencl" / "__init__.py").exists():
        raise UnsupportedError(
            f"{_PACKAGE} is an editable installation, whose kernels lie elsewhere: ParaView's "
            'Python needs a plain one (pip install ".[cpu]")'
        )
    return {"PYTHONPATH": folders, "PV_PLUGIN_PATH": [PLUGIN.parent]}
