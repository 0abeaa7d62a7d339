"""What the public functions take, by name: the types of their arguments, and documentation's words.

VTK's and PyVista's objects are told by the methods that they have, so that this module needs
neither.
"""

import os
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, Protocol, TypeAlias

from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.lighting import Light, Lights
from pyvista_vdi.model.packing import Precision as Precision
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.volume import Volume


class VTKObject(Protocol):
    """An object of VTK, or of PyVista, whose classes derive from VTK's."""

    def GetClassName(self) -> str:  # noqa: N802 - VTK's
        """Return the name of its class."""


WindowSize: TypeAlias = Annotated[Sequence[int], "(int, int)"]
Progress: TypeAlias = Annotated[Callable[[float], object], "callable"]

#: A path is a file that ``read_volume`` reads.
VolumeLike: TypeAlias = Annotated[
    Volume | VTKObject | str | os.PathLike[str], "pyvista.ImageData or vtkImageData or Volume"
]
CameraLike: TypeAlias = Annotated[
    Camera | VTKObject | Sequence[ArrayLike],
    "pyvista.Camera or vtkCamera or Camera, or (position, focal point, view up)",
]
#: What is shown for one VDI: of a set that which is nearest to the view.
ShownLike: TypeAlias = VDI | VTKObject | VDICollection | DeferredVDI
#: What a plotter shows: a volume, or what is made of one already.
AnyVolume: TypeAlias = VolumeLike | NDArray[Any] | ShownLike
LightsLike: TypeAlias = Annotated[
    Lights | VTKObject | Sequence[Light | VTKObject],
    "renderer, or sequence of Light, vtkLight or pyvista.Light",
]
CroppingLike: TypeAlias = Annotated[
    Cropping | VTKObject | Sequence[float] | Sequence[object],
    "Cropping or vtkVolumeMapper or sequence of six numbers or pair",
]
OcclusionLike: TypeAlias = Annotated[
    bool | float | AmbientOcclusion, "bool, float or AmbientOcclusion"
]
PlanesLike: TypeAlias = Annotated[ArrayLike, "array_like of float, shape (k, 6)"]
DepthLike: TypeAlias = Annotated[ArrayLike, "array_like of float32, shape (H, W)"]
DeviceLike: TypeAlias = Annotated[str | Any, "str, DeviceInfo or Runtime"]
#: A client of a Dask cluster, or the address of its scheduler.
ClientLike: TypeAlias = str | Any

ScalarsLike: TypeAlias = Annotated[ArrayLike, "str or numpy.ndarray"]
ColorMapLike: TypeAlias = Annotated[
    str | Sequence[str] | VTKObject | Any, "str, list, matplotlib colour map or pyvista.LookupTable"
]
OpacityLike: TypeAlias = Annotated[ArrayLike, "str or float or array_like"]
#: The range of a colour map, or its end, which is symmetric then.
RangeLike: TypeAlias = Annotated[ArrayLike, "float or (float, float)"]
MatrixLike: TypeAlias = Annotated[ArrayLike | VTKObject, "array_like, shape (4, 4)"]
PropertyLike: TypeAlias = Annotated[VTKObject, "vtkVolumeProperty"]

Criterion: TypeAlias = Literal["least-error", "homogeneity"]
Quality: TypeAlias = Literal["reference", "high", "balanced", "fast"]
Preference: TypeAlias = Literal["point", "cell"]
Interpolation: TypeAlias = Literal["nearest", "linear"]
Coverage: TypeAlias = Literal["bounds", "view"]
Draw: TypeAlias = Literal["auto", "vdi", "volume"]
#: When scalars are classified.
When: TypeAlias = Literal["baked", "deferred"]
#: When a view gets a VDI of its own.
Policy: TypeAlias = Literal["auto", "never"]
