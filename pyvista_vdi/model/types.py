"""What the public functions take, by name: the types of their arguments.

VTK's and PyVista's objects are told by the methods that they have, so that this module needs
neither.
"""

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol, TypeAlias

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


#: Width and height, pixels.
WindowSize: TypeAlias = Sequence[int]
#: Called with the finished fraction, 0 to 1; work stops if it returns ``False``.
Progress: TypeAlias = Callable[[float], object]

#: A path is a file that ``read_volume`` reads.
VolumeLike: TypeAlias = Volume | VTKObject | str | os.PathLike[str]
CameraLike: TypeAlias = Camera | VTKObject | Sequence[ArrayLike]
#: What is shown for one VDI: of a set that which is nearest to the view.
ShownLike: TypeAlias = VDI | VTKObject | VDICollection | DeferredVDI
#: What a plotter shows: a volume, or what is made of one already.
AnyVolume: TypeAlias = VolumeLike | NDArray[Any] | ShownLike
LightsLike: TypeAlias = Lights | VTKObject | Sequence[Light | VTKObject]
CroppingLike: TypeAlias = Cropping | VTKObject | Sequence[float] | Sequence[object]
OcclusionLike: TypeAlias = bool | float | AmbientOcclusion
#: A name or an index of the list of devices, or a device in use.
DeviceLike: TypeAlias = str | int | Any
#: A client of a Dask cluster, or the address of its scheduler.
ClientLike: TypeAlias = str | Any

#: A name of an array, or the values.
ScalarsLike: TypeAlias = ArrayLike
#: A name, one colour, a list of colours, a colour map or a lookup table.
ColorMapLike: TypeAlias = str | Sequence[str] | VTKObject | Any
#: A name, one opacity, or opacities.
OpacityLike: TypeAlias = ArrayLike
#: The range of a colour map, or its end, which is symmetric then.
RangeLike: TypeAlias = ArrayLike
MatrixLike: TypeAlias = ArrayLike | VTKObject

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
