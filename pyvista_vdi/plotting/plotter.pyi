"""A plotter with what this package adds, written by tests/api/test_stubs.py."""
# fmt: off
# ruff: noqa: I001

import pyvista as pv
from collections.abc import (Callable, Sequence)
from numpy.typing import (NDArray)
from pyvista_vdi.api import (Settings)
from pyvista_vdi.model.types import (
    AnyVolume, Blending, CameraLike, ColorMapLike, DeviceLike, Draw, Interpolation, MatrixLike,
    OpacityLike, Policy, Precision, Preference, Quality, RangeLike, ScalarsLike, VolumeLike, When,
)
from pyvista_vdi.plotting.actor import (PlotterVDIActor)
from pyvista_vdi.plotting.add_transfer_function_editor import (AddTransferFunctionEditor)
from pyvista_vdi.plotting.clip_plane import (AddVDIClipPlane)
from pyvista_vdi.plotting.pages import (PlotterVDIs)
from typing import (Any)

class Plotter(pv.Plotter):
    add_vdi_clip_plane: AddVDIClipPlane
    add_transfer_function_editor: AddTransferFunctionEditor
    vdi: PlotterVDIs
    def add_vdi(
        self, volume: AnyVolume, scalars: ScalarsLike | None = None, clim: RangeLike | None = None,
        resolution: Sequence[float] | None = None, opacity: OpacityLike = 'linear', n_colors: int =
        256, cmap: ColorMapLike | None = None, flip_scalars: bool = False, reset_camera: bool | None
        = None, name: str | None = None, ambient: float | None = None, categories: bool | int =
        False, culling: bool | str = False, multi_colors: bool = False, blending: Blending | str |
        int = 'composite', mapper: str | None = None, scalar_bar_args: dict[str, Any] | None = None,
        show_scalar_bar: bool | None = None, annotations: dict[float, str] | None = None, pickable:
        bool = True, preference: Preference = 'point', opacity_unit_distance: float | None = None,
        shade: bool = False, diffuse: float | None = 0.7, specular: float | None = 0.2,
        specular_power: float | None = 10.0, render: bool | None = True, user_matrix: MatrixLike |
        None = None, log_scale: bool = False, *, interpolation: Interpolation = 'nearest', resample:
        str | Sequence[int] | None = None, mask: VolumeLike | NDArray[Any] | None = None, camera:
        CameraLike | None = None, device: DeviceLike | None = None, progress_bar: bool |
        Callable[[float], object] | None = None, max_supersegments: int = 20, precision: Precision =
        'exact', quality: Quality | None = None, target_ssim: float | None = None, full_fps: float |
        None = None, max_bytes: float | None = None, classification: When = 'baked', value_range:
        RangeLike | None = None, target_fps: float | None = 30.0, regenerate: Policy = 'auto', draw:
        Draw = 'auto', settings: Settings | None = None,
    ) -> PlotterVDIActor | list[Any]: ...
