"""On what something was measured."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from pyvista_vdi.device import get_runtime

#: What a figure may depend on, where it is installed.
_PACKAGES = ("pyvista-vdi", "numpy", "pyopencl", "scikit-image", "vtk", "pyvista")


def describe_system(device: Any = None) -> dict[str, str]:
    """Return the device, its driver and the versions that a measured figure depends on.

    Parameters
    ----------
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    """
    info = get_runtime(device).info
    described = {
        "device": info.full_name,
        "driver": info.driver,
        "compute units": str(info.compute_units),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }
    for name in _PACKAGES:
        try:
            described[name] = version(name)
        except PackageNotFoundError:
            continue
    return described
