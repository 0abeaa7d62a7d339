"""PyVista and VTK, or how to get them; imports neither by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pyvista_vdi.errors import MissingDependencyError

#: Debian's packages of the libraries that VTK's wheels link to and do not bring.
_PACKAGES = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXt.so.6": "libxt6",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
}


def explain_import_error(error: ImportError) -> MissingDependencyError:
    """Return the error that tells how to make VTK importable: which Debian package it lacks."""
    text = str(error)
    for library, package in _PACKAGES.items():
        if library in text:
            return MissingDependencyError(
                f"VTK cannot be loaded, because the system library {library} is missing: on "
                f"Debian and Ubuntu install '{package}' (and 'libegl1 libgl1-mesa-dri' to render "
                "off-screen)"
            )
    return MissingDependencyError(
        f'VTK cannot be loaded ({text}): install it by pip install "pyvista-vdi[plot]"'
    )


def import_pyvista() -> Any:
    """Return the module; MissingDependencyError says how to get it, or what VTK lacks."""
    try:
        import pyvista as pv
    except ImportError as error:
        if error.name == "pyvista":
            raise MissingDependencyError(
                'PyVista is not installed: install it by pip install "pyvista-vdi[plot]"'
            ) from error
        raise explain_import_error(error) from error
    return pv


def read_volume(file: Path) -> Any:
    """Read a volume by PyVista's readers; MissingDependencyError says how to get them."""
    import_pyvista()
    from pyvista_vdi.plotting import volume_files

    return volume_files.read_volume(file)
