"""The public functions, which take VTK's and PyVista's objects beside those of this package.

What converts an object is imported only where one needs it: for a :class:`Volume`, a
:class:`Camera` and a :class:`TransferFunction` neither VTK nor PyVista is loaded.
"""

from pyvista_vdi.api.pictures import pick, render, render_depth, render_volume
from pyvista_vdi.api.vdis import generate, read
from pyvista_vdi.model.arguments import Settings

__all__ = [
    "Settings",
    "generate",
    "pick",
    "read",
    "render",
    "render_depth",
    "render_volume",
]
