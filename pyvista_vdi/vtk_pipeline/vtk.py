"""VTK's names, from the build of VTK that PyVista uses; nothing else here imports VTK by its name.

There are two: VTK's own, ``vtkmodules``, and ``cvista``, which PyVista takes from 0.49 on where it
is installed. Objects of one mean nothing to the other. A name, such as ``vtkImageData``, or a
module, such as ``vtkCommonDataModel``, is loaded when it is imported from here, and no more of VTK
than that takes. ParaView has a VTK of its own: its plugin imports ``vtkmodules``.
"""

from __future__ import annotations

import locale
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from packaging.version import Version

from pyvista_vdi.errors import MissingDependencyError, UnsupportedError

if TYPE_CHECKING:  # what editors show; with mypy every name is Any, by __getattr__
    from vtkmodules.all import *
    from vtkmodules.util.misc import *
    from vtkmodules.util.numpy_support import *
    from vtkmodules.util.vtkAlgorithm import *

#: The names that this package, its tests and its examples use, by module.
_NAMES = {
    "util.misc": "calldata_type",
    "util.numpy_support": "numpy_to_vtk vtk_to_numpy",
    "util.vtkAlgorithm": "VTKPythonAlgorithmBase",
    "vtkChartsCore": "vtkCompositeControlPointsItem vtkCompositeTransferFunctionItem",
    "vtkCommonCore": (
        "VTK_FLOAT VTK_INT VTK_UNSIGNED_CHAR VTK_UNSIGNED_INT mutable reference vtkCollection "
        "vtkDataArray vtkErrorCode vtkFloatArray vtkInformation vtkMath vtkObject vtkObjectBase "
        "vtkOutputWindow vtkStringArray vtkStringOutputWindow vtkUnsignedCharArray vtkVersion "
        "vtkWeakReference"
    ),
    "vtkCommonDataModel": (
        "vtkCellArray vtkCompositeDataSet vtkDataObject vtkDataSetAttributes vtkImageData "
        "vtkMultiBlockDataSet vtkPiecewiseFunction vtkPlane vtkPlaneCollection vtkPolyData "
        "vtkRectilinearGrid "
        "vtkSelectionNode vtkUniformGrid"
    ),
    "vtkCommonExecutionModel": "vtkAlgorithm vtkStreamingDemandDrivenPipeline vtkTrivialProducer",
    "vtkCommonMath": "vtkMatrix4x4",
    "vtkCommonTransforms": "vtkTransform",
    "vtkFiltersCore": (
        "vtkCellDataToPointData vtkContourFilter "
        "vtkImageAppend vtkResampleToImage vtkTriangleFilter"
    ),
    "vtkFiltersGeneral": "vtkMultiBlockDataGroupFilter vtkTransformFilter",
    "vtkFiltersGeometry": "vtkDataSetSurfaceFilter",
    "vtkFiltersHybrid": "vtkImplicitModeller vtkTemporalInterpolator",
    "vtkFiltersSources": "vtkPlaneSource vtkSphereSource",
    "vtkIOImage": (
        "vtkDICOMImageReader vtkMetaImageReader vtkMetaImageWriter vtkNIFTIImageReader "
        "vtkNIFTIImageWriter vtkNrrdReader vtkPNGWriter"
    ),
    "vtkIOXML": "vtkXMLImageDataReader vtkXMLImageDataWriter",
    "vtkIOXdmf2": "vtkXdmfReader",
    "vtkImagingCore": (
        "vtkExtractVOI vtkImageCast vtkImageChangeInformation vtkImageConstantPad "
        "vtkImageFlip vtkImageMagnify vtkImageMirrorPad vtkImagePermute vtkImageResample "
        "vtkImageReslice vtkImageResize vtkImageShiftScale vtkImageShrink3D vtkImageThreshold "
        "vtkImageTranslateExtent vtkRTAnalyticSource"
    ),
    "vtkImagingGeneral": "vtkImageGaussianSmooth vtkImageMedian3D",
    "vtkImagingHybrid": "vtkGaussianSplatter",
    "vtkImagingSources": "vtkImageGaussianSource vtkImageSinusoidSource",
    "vtkInteractionStyle": "vtkInteractorStyleTrackballCamera",
    "vtkRenderingAnnotation": (
        "vtkAnnotatedCubeActor vtkAxesActor vtkCaptionActor2D vtkCornerAnnotation vtkScalarBarActor"
    ),
    "vtkRenderingCore": (
        "vtkActor vtkActor2D vtkAssembly vtkBillboardTextActor3D vtkCamera vtkCameraInterpolator "
        "vtkColorTransferFunction vtkFollower vtkHardwarePicker vtkHardwareSelector vtkImageActor "
        "vtkImageSlice vtkLight vtkLightKit vtkMapper vtkPolyDataMapper vtkPolyDataMapper2D "
        "vtkProp3D vtkPropAssembly vtkPropCollection vtkPropPicker vtkRenderWindow "
        "vtkRenderWindowInteractor vtkRenderer vtkSelectVisiblePoints vtkTextActor vtkTextMapper "
        "vtkTextProperty vtkTexture vtkTexturedActor2D vtkVolume vtkVolumeProperty "
        "vtkWindowToImageFilter"
    ),
    "vtkRenderingImage": "vtkImageResliceMapper",
    "vtkRenderingLOD": "vtkLODActor",
    "vtkRenderingLabel": "vtkLabelPlacementMapper vtkPointSetToLabelHierarchy",
    "vtkRenderingOpenGL2": (
        "vtkOpenGLActor vtkOpenGLGL2PSHelper vtkOpenGLShaderProperty vtkPixelBufferObject "
        "vtkTextureObject"
    ),
    "vtkRenderingUI": "vtkGenericRenderWindowInteractor",
    "vtkRenderingVolume": (
        "vtkFixedPointVolumeRayCastMapper vtkGPUVolumeRayCastMapper vtkMultiVolume"
    ),
    "vtkRenderingVolumeOpenGL2": "vtkOpenGLGPUVolumeRayCastMapper",
    "vtkViewsContext2D": "vtkContextInteractorStyle",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}


def _chosen() -> str:
    """Return the package that VTK's modules are in, as PyVista chooses it."""
    ask_pyvista = getattr(sys.modules.get("pyvista"), "vtk_backend", None)
    if ask_pyvista is not None:
        name = ask_pyvista()
    else:
        both = find_spec("pyvista") is not None and find_spec("cvista") is not None
        name = os.environ.get("PYVISTA_VTK_BACKEND") or ("cvista" if both else "vtk")
        if name != "vtk" and (sys.modules.get("paraview") or _pyvista_has_no_choice()):
            name = "vtk"
    return "vtkmodules" if name == "vtk" else name


def _pyvista_has_no_choice() -> bool:
    try:
        return Version(metadata.version("pyvista")).release < (0, 49)
    except metadata.PackageNotFoundError:
        return False


#: The package of the build that this process uses: "vtkmodules" or "cvista".
BACKEND = _chosen()

#: Of VTK's output window, while what is written to it is caught.
_window_lock = threading.RLock()

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


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name, name)
    if not home.startswith(("vtk", "util.")):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        module = import_module(f"{BACKEND}.{home}")
        value = module if home == name else getattr(module, name)
    except ImportError as error:
        raise explain_import_error(error) from error
    except AttributeError as error:
        raise explain_import_error(ImportError(f"{BACKEND} has no {name}")) from error
    globals()[name] = value
    return value


def weakly(thing: Any) -> Callable[[], Any]:
    """Return what gives a VTK object as long as others keep it, and ``None`` afterwards."""
    held = (globals().get("vtkWeakReference") or __getattr__("vtkWeakReference"))()
    held.Set(thing)
    return held.Get  # type: ignore[no-any-return]


@contextmanager
def caught_messages() -> Iterator[Any]:
    """Catch what VTK writes to its output window, which is the process's: one thread at a time.

    The locale, which is the process's, too, stays: VTK 9.4 reads legacy files in "C" and leaves it.
    """
    with _window_lock:
        spoken = locale.setlocale(locale.LC_ALL)
        window = globals().get("vtkOutputWindow") or __getattr__("vtkOutputWindow")
        before, messages = window.GetInstance(), __getattr__("vtkStringOutputWindow")()
        window.SetInstance(messages)
        try:
            yield messages
        finally:
            window.SetInstance(before)
            locale.setlocale(locale.LC_ALL, spoken)


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
    if BACKEND == "vtkmodules":
        return MissingDependencyError(
            f'VTK cannot be loaded ({text}): install it by pip install "pyvista-vdi[plot]"'
        )
    return MissingDependencyError(
        f"VTK cannot be loaded from {BACKEND} ({text}): install all of it, as by pip install "
        f'"{BACKEND}[all]", or choose another build by the environment variable '
        "PYVISTA_VTK_BACKEND=vtk"
    )


def require_this_build(kind: type) -> None:
    """Refuse a class of another build of VTK, by name; what is none of VTK's passes."""
    this = __getattr__("vtkObjectBase")
    base = next((each for each in kind.__mro__ if each.__name__ == "vtkObjectBase"), this)
    if base is not this:
        other = base.__module__.partition(".")[0]
        raise UnsupportedError(
            f"the {kind.__name__} is an object of {other}, which {BACKEND}, the VTK that this "
            f"process uses, cannot take: make it with {BACKEND}, of NumPy arrays for example, or "
            "set the environment variable PYVISTA_VTK_BACKEND="
            f"{'vtk' if other == 'vtkmodules' else other} before PyVista is imported"
        )
