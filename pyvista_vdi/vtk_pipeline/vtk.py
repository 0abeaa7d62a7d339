"""VTK's names, from the build of VTK that PyVista uses; nothing else here imports VTK by its name.

There are two: VTK's own, ``vtkmodules``, and ``cvista``, which PyVista takes from 0.49 on where it
is installed. Objects of one mean nothing to the other. A name, such as ``vtkImageData``, or a
module, such as ``vtkCommonDataModel``, is loaded when it is imported from here, and no more of VTK
than that takes. ParaView has a VTK of its own: its plugin imports ``vtkmodules``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from packaging.version import Version

from pyvista_vdi.errors import MissingDependencyError

if TYPE_CHECKING:  # what editors show; with mypy every name is Any, by __getattr__
    from vtkmodules.all import *
    from vtkmodules.util.misc import *
    from vtkmodules.util.numpy_support import *
    from vtkmodules.util.vtkAlgorithm import *

#: The modules that names are looked for in, one after the other: what loads least comes first.
_MODULES = """
vtkCommonCore vtkCommonDataModel vtkCommonExecutionModel vtkCommonMath vtkCommonTransforms
util.misc util.numpy_support util.vtkAlgorithm
vtkFiltersCore vtkRenderingCore vtkRenderingVolume vtkRenderingOpenGL2 vtkRenderingVolumeOpenGL2
vtkRenderingUI vtkInteractionStyle vtkRenderingAnnotation vtkRenderingImage vtkRenderingLOD
vtkRenderingLabel vtkFiltersGeneral vtkFiltersGeometry vtkFiltersHybrid vtkFiltersSources
vtkImagingCore vtkImagingGeneral vtkImagingHybrid vtkImagingSources vtkIOImage vtkIOXML vtkIOXdmf2
vtkViewsContext2D vtkChartsCore
"""


def _chosen() -> str:
    """Return the package that VTK's modules are in, as PyVista chooses it."""
    ask_pyvista = getattr(sys.modules.get("pyvista"), "vtk_backend", None)
    if ask_pyvista is not None:
        name = ask_pyvista()
    else:
        both = find_spec("pyvista") is not None and find_spec("cvista") is not None
        name = os.environ.get("PYVISTA_VTK_BACKEND") or ("cvista" if both else "vtk")
        if name != "vtk" and both:  # PyVista before 0.49 has no choice, nor has ParaView
            old = Version(metadata.version("pyvista")).release < (0, 49)
            name = "vtk" if old or sys.modules.get("paraview") else name
    return "vtkmodules" if name == "vtk" else name


#: The package of the build that this process uses: "vtkmodules" or "cvista".
BACKEND = _chosen()

#: Debian's packages of what VTK's wheels link to and do not bring, and of drawing off-screen.
_DEBIAN = "libgl1 libegl1 libgl1-mesa-dri libx11-6 libxrender1 libxcursor1 libxft2 libxt6 libsm6"


def __getattr__(name: str) -> Any:
    if not name.startswith(("vtk", "VTK", "numpy_to", "mutable", "reference", "calldata")):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = None
    for home in _MODULES.split() if name not in _MODULES else ():
        with suppress(ImportError):  # a build may lack some
            value = getattr(import_module(f"{BACKEND}.{home}"), name, None)
        if value is not None:
            break
    else:  # it is a module's name
        try:
            value = import_module(f"{BACKEND}.{name}")
        except ImportError as error:
            raise explain_import_error(error) from error
    globals()[name] = value
    return value


def weakly(thing: Any) -> Callable[[], Any]:
    """Return what gives a VTK object as long as others keep it, and ``None`` afterwards."""
    held = (globals().get("vtkWeakReference") or __getattr__("vtkWeakReference"))()
    held.Set(thing)
    return held.Get  # type: ignore[no-any-return]


def explain_import_error(error: ImportError) -> MissingDependencyError:
    """Return the error that tells how to make VTK importable."""
    return MissingDependencyError(
        f'VTK cannot be loaded from {BACKEND} ({error}): install it by pip install "pyvista-vdi'
        '[plot]", or all of cvista by pip install "cvista[all]"; a system library that is missing '
        f"comes, on Debian and Ubuntu, with apt install {_DEBIAN}"
    )
