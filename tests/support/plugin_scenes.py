"""Scenes drawn twice: with ``add_vdi``, and with VTK's own volume mapper as the judge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyvista as pv
from settings import with_settings

import pyvista_vdi as pvdi

#: Everything both sides need: soft, so that the step along the ray decides nothing.
LOOKS: dict[str, Any] = {
    "cmap": "viridis",
    "opacity": "linear",
    "clim": (0.0, 255.0),
    "opacity_unit_distance": 0.2,
    "show_scalar_bar": False,
}
#: The same for ``generate``, which shows nothing.
CLASSIFICATION = {name: value for name, value in LOOKS.items() if name != "show_scalar_bar"}
#: The issue's bound for a scene, in steps of 255. With V_N = V_O, seen are 1 to 5.
TOLERANCE = 8
WINDOW = (120, 100)


def soft_ball(n: int = 24, *, direction: Any = None) -> pv.ImageData:
    """A ball whose value falls linearly from 255 at the centre to 0 at its rim; bounds ±1."""
    x = np.linspace(-1, 1, n)
    r = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    step = 2 / (n - 1)
    grid = pv.ImageData(dimensions=(n, n, n), spacing=(step,) * 3)
    if direction is not None:
        grid.direction_matrix = direction
    grid.origin = -np.asarray(grid.direction_matrix) @ (1.0, 1.0, 1.0)
    # no symmetry: a flipped or transposed picture must not pass
    grid["v"] = np.clip(255 * (1 - r) * (0.8 + 0.2 * x[None, None, :]), 0, None).ravel()
    return grid


def soft_volume(n: int = 24, scale: float = 1.0) -> pvdi.Volume:
    """A ball that is denser towards its middle, bounds ±1, bytes of 0 to 255 times a scale."""
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    values = 255 * scale * np.clip(1 - radius, 0, 1)
    return pvdi.Volume(values.astype(np.uint8), (2 / (n - 1),) * 3, (-1,) * 3)


def vdi_of_one_list() -> pvdi.VDI:
    """A VDI without metadata: one supersegment in one list."""
    camera = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    return pvdi.VDI(
        camera, (1, 1), [0, 1], [4.0], [6.0], [[1.0, 0.5, 0.0]], [2.0], (-1, 1, -1, 1, -1, 1)
    )


def add_judge(
    plotter: pv.Plotter, volume: pv.ImageData, *, sample_distance: float = 0.02, **more: Any
) -> Any:
    """VTK's GPU mapper, linear interpolation, at converged steps."""
    actor = plotter.add_volume(volume, mapper="gpu", **{**LOOKS, **more})
    actor.mapper.SetAutoAdjustSampleDistances(0)
    actor.mapper.SetSampleDistance(sample_distance)
    actor.prop.interpolation_type = "linear"
    return actor


def add_ours(plotter: pv.Plotter, volume: pv.ImageData, **more: Any) -> Any:
    """``add_vdi`` with the same looks."""
    how = {"interpolation": "linear", "sample_distance": 0.02, "max_supersegments": 64}
    how["draw"] = "vdi"  # what is tested here; tests/drop_in has both
    return plotter.add_vdi(volume, **with_settings(**{**how, **LOOKS, **more}))


def add_nothing(plotter: pv.Plotter, volume: pv.ImageData, **more: Any) -> Any:
    """For the picture without a volume: the same bounds, transparent."""
    more = {k: v for k, v in more.items() if k == "user_matrix"}
    return plotter.add_mesh(volume.outline(), opacity=0.0, **more)


def opaque_sphere(plotter: pv.Plotter) -> None:
    """A sphere half inside the ball."""
    plotter.add_mesh(pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)), color="w", reset_camera=False)


def shown(plotter: pv.Plotter) -> np.ndarray:
    """What a plotter shows now: a screenshot alone draws the first frame only."""
    plotter.show(auto_close=False)
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(int)


def draw(
    add: Callable[..., Any],
    scene: Callable[[pv.Plotter, Callable[..., Any]], Any],
    shot: Callable[[pv.Plotter], Any] | None = None,
    **options: Any,
) -> np.ndarray:
    """The picture of a scene, int (H, W, 3)."""
    options = {"window_size": WINDOW, **options}
    plotter = pv.Plotter(**options)
    plotter.set_background("lightsteelblue")
    scene(plotter, add)
    image = plotter.screenshot(return_img=True) if shot is None else shot(plotter)
    plotter.close()
    return np.asarray(image)[..., :3].astype(int)


def assert_as_vtk(
    scene: Callable[[pv.Plotter, Callable[..., Any]], Any],
    shot: Callable[[pv.Plotter], Any] | None = None,
    *,
    strays: int = 0,
    **options: Any,
) -> None:
    """Our picture of a scene is VTK's, within ``TOLERANCE`` of 255, and shows the volume.

    ``strays`` pixels may be further off, where the opaque scene itself differs.
    """
    judge = draw(add_judge, scene, shot, **options)
    empty = draw(add_nothing, scene, shot, **options)
    assert np.abs(judge - empty).max() > 40, "VTK's own picture does not show the volume"
    ours = draw(add_ours, scene, shot, **options)
    assert ours.shape == judge.shape
    difference = np.abs(ours - judge).max(axis=-1)
    y, x = np.unravel_index(difference.argmax(), difference.shape)
    assert np.count_nonzero(difference > TOLERANCE) <= strays, (
        f"pixel x={x}, y={y} (top row first): ours {ours[y, x]}, VTK's {judge[y, x]}; "
        f"{np.count_nonzero(difference > TOLERANCE)} pixels beyond {TOLERANCE}"
    )
