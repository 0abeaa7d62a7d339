"""What functions of series, sets and simulations take of ``generate``'s options, for type checkers.

Each is the type of a function's ``**options``: editors complete them, and checkers of types check
them. ``tests/extensions/series/test_keywords.py`` compares them with what ``generate`` writes out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, Union

from pyvista_vdi.model.types import VTKObject

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from pyvista_vdi.model.transfer_function import TransferFunction
    from pyvista_vdi.model.types import (
        ClientLike,
        ColorMapLike,
        LightsLike,
        MemoryLike,
        OcclusionLike,
        OpacityLike,
        RangeLike,
        ScalarsLike,
    )
    from pyvista_vdi.model.volume import Volume

#: The steps of a series: one by one, a function of their index, a source or a store.
VolumesLike: TypeAlias = Union[Iterable[Any], Callable[[int], Any], VTKObject, "Volume"]


class Look(TypedDict, total=False):
    """How a volume looks."""

    scalars: ScalarsLike | None
    preference: str
    clim: RangeLike | None
    n_colors: int
    opacity: OpacityLike
    cmap: ColorMapLike | None
    flip_scalars: bool
    opacity_unit_distance: float | None
    log_scale: bool
    shade: bool
    ambient: float | None
    diffuse: float | None
    specular: float | None
    specular_power: float | None
    blending: str
    interpolation: str
    volume_property: VTKObject | None
    transfer_function: TransferFunction | None


class Deferral(TypedDict, total=False):
    """What is kept, where scalars are classified afterwards."""

    classification: str
    value_range: RangeLike | None
    importance: ArrayLike | None


class SetOptions(Look, total=False):
    """What :func:`pyvista_vdi.generate_set` passes on."""

    max_supersegments: int
    criterion: str
    precision: str
    sample_distance: float | None
    tolerance: float
    view_cone: float
    lights: LightsLike | None
    ambient_occlusion: OcclusionLike | None
    memory_limit: MemoryLike | None


class InSituOptions(SetOptions, Deferral, total=False):
    """What :class:`pyvista_vdi.extensions.insitu.InSitu` passes on."""


class SeriesOptions(InSituOptions, total=False):
    """What :func:`pyvista_vdi.generate_series` passes on."""

    quality: str | None
    target_ssim: float | None
    target_fps: float | None
    max_bytes: float | None
    target_angle: float


class WriterOptions(SeriesOptions, total=False):
    """What :class:`pyvista_vdi.SeriesWriter`, which names ``precision`` itself, passes on."""

    client: ClientLike | None
    spacing: Sequence[float] | None
    origin: Sequence[float] | None
