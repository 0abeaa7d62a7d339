"""The subcommand ``paraview``: where its plugin is, and what ParaView's Python must see."""

from __future__ import annotations

import argparse
import shlex
import sysconfig
from pathlib import Path

from pyvista_vdi.errors import UnsupportedError

#: The package, and the plugin in it.
_PACKAGE = Path(__file__).resolve().parents[2]
PLUGIN = Path(__file__).resolve().parent / "plugin" / "vdi_plugin.py"

OPTIONS = "environment  -  print the variables by which ParaView finds plugin and package"


def paraview(options: argparse.Namespace) -> int:
    """Print the plugin's path, or the variables that make ParaView find it and this package."""
    if not options.environment:
        print(PLUGIN)
        return 0
    # What to put in front of ParaView's search paths
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
    for variable, paths in (("PYTHONPATH", folders), ("PV_PLUGIN_PATH", [PLUGIN.parent])):
        value = shlex.quote(":".join(map(str, paths)))
        print(f'export {variable}={value}"${{{variable}:+:${variable}}}"')
    return 0
