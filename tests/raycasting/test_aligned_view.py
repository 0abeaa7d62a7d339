"""Rays that stay in a list of their own: each pixel from that list (raycasting/aligned_view.cl).

These are views from V_O whose pixels are those of the VDI's window, more, or some of them. Those of
its own window are drawn in ``test_raycast_oracle``, too.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import draw, render_vdi
from oracle import assert_explained
from ray_scenes import generating_view, random_ends

from pyvista_vdi import VDI, Camera
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: A slab, and a parallel view that sees nothing beside it in a window of up to 10 by 1.
SLAB = (-10.0, 10.0, -2.0, 2.0, -1.0, 1.0)
FACING = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)


def in_another_world(rng, camera):
    """The same view, of a world that is turned, moved and three times as large."""
    world = strategies.random_transform(rng)
    world[:3, :3] = 3 * strategies.random_rotation(rng)
    points = np.stack([camera.position, camera.focal_point]) @ world[:3, :3].T + world[:3, 3]
    return camera.replace(
        position=points[0],
        focal_point=points[1],
        view_up=world[:3, :3] @ camera.view_up,
        parallel_scale=3 * camera.parallel_scale,
        model_transform=world @ camera.model_transform,
    )


@pytest.mark.parametrize(
    ("kind", "corner", "window"),
    [("perspective", (-3, -5), (40, 30)), ("parallel", (-11, 8), (20, 20))],
)
def test_a_vdi_of_another_part_of_the_picture(runtime, kind, corner, window):
    """As a plotter makes it, of what the bounds cover; its camera is that of another world."""
    size = (27, 19)
    for case, precision in enumerate(PRECISIONS):
        rng = np.random.default_rng([case, 600, *window])
        bounds, camera = generating_view(rng, kind)
        own = camera.tile(size, corner, window)
        vdi = strategies.random_vdi(rng, window=window, camera=own, bounds=bounds)
        view = in_another_world(rng, camera)
        ends = random_ends(rng, vdi, view, size, planes=0) if case == 1 else {}
        vdi = vdi.with_precision(precision)
        image = render_vdi(vdi, view, size, device=runtime, **ends)
        assert_explained(vdi, view, size, image, name=precision, **ends)


def grey_lists(counts, front, back, optical_depth):
    """A grey VDI seen by :data:`FACING`, of lists of so many supersegments, bottom row first."""
    n = counts.sum()
    offsets = np.concatenate([[0], np.cumsum(counts)])
    media = np.full((n, 3), 0.5), np.full(n, optical_depth)
    return VDI(FACING, counts.shape[::-1], offsets, front, back, *media, SLAB)


@pytest.mark.parametrize("compensated", [False, True])
def test_lists_of_none_and_of_thousands(runtime, compensated):
    """Thin media of one optical depth: 1 - exp(-count tau) whatever the list's length."""
    most = 3000 if compensated else 900  # beyond 1024, sums are made otherwise
    counts = np.array([[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5], [0, 1, most, 0, 7, 0, 0, 0, 0, 0, 300]])
    faces = np.concatenate([np.linspace(4.5, 5.5, n + 1) for n in counts.ravel()])
    back = np.delete(faces, np.cumsum(counts.ravel() + 1) - counts.ravel() - 1)
    front = np.delete(faces, np.cumsum(counts.ravel() + 1) - 1)
    vdi = grey_lists(counts, front, back, 1e-3)
    image = render_vdi(vdi, FACING, device=runtime)
    alpha = -np.expm1(-1e-3 * counts[::-1])
    # An extinction times a length has the roundings of its faces: 1e-3 of a list 3000 thin
    np.testing.assert_allclose(image[..., 3], alpha, rtol=0, atol=2e-5)
    np.testing.assert_allclose(image[..., 0], 0.5 * alpha, rtol=0, atol=2e-5)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_offsets_of_64_bits(runtime, precision):
    """As a VDI of more than 2^30 supersegments has them."""
    rng = np.random.default_rng(3)
    vdi = strategies.random_vdi(rng, window=(21, 9)).with_precision(precision)
    prepared = PreparedVDI(runtime, vdi)
    images = []
    for long_offsets in (False, True):
        prepared.long_offsets = long_offsets
        prepared.switches["OFFSET_T"] = "long" if long_offsets else "int"
        with runtime.buffer((9, 21, 4), name="image") as image:
            draw(prepared, vdi.camera, vdi.window_size, image)
            images.append(runtime.download(image).copy())
    assert images[0].any()
    np.testing.assert_array_equal(*images)
