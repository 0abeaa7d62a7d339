"""The public functions and their options, written by tests/api/test_stubs.py."""
# fmt: off
# ruff: noqa: I001

import numpy as np
import os
from collections.abc import (Sequence)
from numpy.typing import (ArrayLike, NDArray)
from pyvista_vdi.model.collection import (VDICollection)
from pyvista_vdi.model.transfer_function import (TransferFunction)
from pyvista_vdi.model.types import (
    CameraLike, ClientLike, ColorMapLike, Coverage, Criterion, CroppingLike, DeviceLike,
    Interpolation, LightsLike, OcclusionLike, OpacityLike, PlanesLike, Precision, Preference,
    Progress, PropertyLike, Quality, RangeLike, ScalarsLike, ShownLike, VolumeLike, WindowSize,
)
from pyvista_vdi.model.vdi import (DeferredVDI, VDI)
from pyvista_vdi.raycasting.picking import (Pick)
from typing import (Any, Literal, overload)

@overload
def generate(
    volume: VolumeLike, camera: CameraLike, window_size: WindowSize, *, scalars: ScalarsLike | None
    = None, preference: Preference = 'point', blending: str | int = 'composite', clim: RangeLike |
    None = None, n_colors: int = 256, opacity: OpacityLike = 'linear', cmap: ColorMapLike | None =
    None, flip_scalars: bool = False, opacity_unit_distance: float | None = None, log_scale: bool =
    False, shade: bool = False, ambient: float | None = None, diffuse: float | None = 0.7, specular:
    float | None = 0.2, specular_power: float | None = 10.0, interpolation: Interpolation =
    'nearest', volume_property: PropertyLike | None = None, transfer_function: TransferFunction |
    None = None, classification: Literal['baked'] = 'baked', value_range: RangeLike | None = None,
    quality: Quality | None = None, target_ssim: float | None = None, full_fps: float | None = None,
    max_bytes: int | None = None, lights: LightsLike | None = None, ambient_occlusion: OcclusionLike
    | None = None, max_supersegments: int = 20, precision: Precision = 'exact', settings: Settings |
    None = None, client: ClientLike | None = None, device: DeviceLike | None = None, progress:
    Progress | None = None,
) -> VDI: ...
@overload
def generate(
    volume: VolumeLike, camera: CameraLike, window_size: WindowSize, *, scalars: ScalarsLike | None
    = None, preference: Preference = 'point', blending: str | int = 'composite', clim: RangeLike |
    None = None, n_colors: int = 256, opacity: OpacityLike = 'linear', cmap: ColorMapLike | None =
    None, flip_scalars: bool = False, opacity_unit_distance: float | None = None, log_scale: bool =
    False, shade: bool = False, ambient: float | None = None, diffuse: float | None = 0.7, specular:
    float | None = 0.2, specular_power: float | None = 10.0, interpolation: Interpolation =
    'nearest', volume_property: PropertyLike | None = None, transfer_function: TransferFunction |
    None = None, classification: Literal['deferred'], value_range: RangeLike | None = None, quality:
    Quality | None = None, target_ssim: float | None = None, full_fps: float | None = None,
    max_bytes: int | None = None, lights: LightsLike | None = None, ambient_occlusion: OcclusionLike
    | None = None, max_supersegments: int = 20, precision: Precision = 'exact', settings: Settings |
    None = None, client: ClientLike | None = None, device: DeviceLike | None = None, progress:
    Progress | None = None,
) -> DeferredVDI: ...
def pick(
    vdi: ShownLike, camera: CameraLike, pixel: Sequence[float], window_size: WindowSize | None =
    None, *, clipping_planes: PlanesLike | None = None, cropping: CroppingLike | None = None,
    opacity_multiplier: float = 1.0, opacity_threshold: float = 0.05, accumulated: bool = True,
    opaque_depth: float | None = None, **look: Any,
) -> Pick | None: ...
def read(path: str | os.PathLike[str], **options: Any) -> VDI | DeferredVDI | VDICollection: ...
def render(
    vdi: ShownLike | Sequence[ShownLike], camera: CameraLike, window_size: WindowSize | None = None,
    *, preview_samples: int | None = None, settings: Settings | None = None, clipping_planes:
    ArrayLike | Sequence[ArrayLike | None] | None = None, cropping: CroppingLike | None = None,
    opacity_multiplier: float | Sequence[float] = 1.0, opaque_depth: ArrayLike | None = None,
    model_transforms: Sequence[ArrayLike] | None = None, device: DeviceLike | None = None, **look:
    Any,
) -> NDArray[np.float32]: ...
def render_depth(
    vdi: ShownLike, camera: CameraLike, window_size: WindowSize | None = None, *, clipping_planes:
    PlanesLike | None = None, cropping: CroppingLike | None = None, opacity_multiplier: float = 1.0,
    opacity_threshold: float = 0.05, accumulated: bool = True, opaque_depth: ArrayLike | None =
    None, device: DeviceLike | None = None, **look: Any,
) -> NDArray[np.float32]: ...
def render_volume(
    volume: VolumeLike, camera: CameraLike, window_size: WindowSize, *, scalars: ScalarsLike | None
    = None, preference: Preference = 'point', blending: str | int = 'composite', clim: RangeLike |
    None = None, n_colors: int = 256, opacity: OpacityLike = 'linear', cmap: ColorMapLike | None =
    None, flip_scalars: bool = False, opacity_unit_distance: float | None = None, log_scale: bool =
    False, shade: bool = False, ambient: float | None = None, diffuse: float | None = 0.7, specular:
    float | None = 0.2, specular_power: float | None = 10.0, interpolation: Interpolation =
    'nearest', volume_property: PropertyLike | None = None, transfer_function: TransferFunction |
    None = None, lights: LightsLike | None = None, ambient_occlusion: OcclusionLike | None = None,
    clipping_planes: PlanesLike | None = None, cropping: CroppingLike | None = None,
    opacity_multiplier: float = 1.0, settings: Settings | None = None, opaque_depth: ArrayLike |
    None = None, early_termination: bool = True, device: DeviceLike | None = None,
) -> NDArray[np.float32]: ...
class Settings:
    given: dict[str, Any]
    sample_distance: float | None
    memory_limit: int | None
    criterion: Criterion
    tolerance: float
    view_cone: float
    transmittance_cutoff: float
    regenerate_below: float | None
    coverage: Coverage
    def __init__(
        self, *, sample_distance: float | None = None, memory_limit: int | None = None, criterion:
        Criterion = 'least-error', tolerance: float = 0.0, view_cone: float = 60.0,
        transmittance_cutoff: float = 1e-06, regenerate_below: float | None = None, coverage:
        Coverage = 'bounds',
    ) -> None: ...
