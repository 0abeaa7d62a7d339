"""Rays that stay in a list of their own: each pixel from that list (raycasting/aligned_view.cl).

These are views from V_O whose pixels are those of the VDI's window, more, or some of them. Against
the float64 oracle, and against rays that are followed one by one: with what else ends a ray, the
forms of the supersegments, windows whose edges cut packets and tiles, lists of none and of
thousands.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import draw, render_vdi
from oracle import assert_explained
from ray_scenes import generating_view, random_ends

from pyvista_vdi import VDI, Camera
from pyvista_vdi.device import Runtime
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Most that a channel of these random VDIs may differ from rays that are followed one by one, whose
#: lengths have more roundings. Measured: 2e-6.
TOLERANCE = 1e-5

#: A slab, and a parallel view that sees nothing beside it in a window of up to 10 by 1.
SLAB = (-10.0, 10.0, -2.0, 2.0, -1.0, 1.0)
FACING = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)


def both_ways(runtime, vdi, monkeypatch, camera=None, size=None, **options):
    """The picture, by default from V_O: from the aligned view, and with rays one by one."""
    camera = vdi.camera if camera is None else camera
    image = render_vdi(vdi, camera, size, device=runtime, **options)
    with monkeypatch.context() as patch:
        strategies.deal_rays(patch, runtime, "one by one")
        return image, render_vdi(vdi, camera, size, device=runtime, **options)


def check(runtime, vdi, monkeypatch, camera, size, name, **ends):
    """Compare with the oracle and with rays one by one; how many pixels see something."""
    image, one_by_one = both_ways(runtime, vdi, monkeypatch, camera, size, **ends)
    np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE, err_msg=name)
    return assert_explained(vdi, camera, size, image, name=name, **ends).drawn


@pytest.mark.every(4)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("kind", ["perspective", "long lens", "parallel", "inside"])
def test_every_pixel_is_its_own_list(runtime, kind, precision, monkeypatch):
    """Windows of a list, a tile, a packet of 8 x 2, and one more or less along each edge; also a
    long lens, whose depth is kept relative, and an eye between the supersegments."""
    drawn = 0
    for case, window in enumerate([(1, 1), (8, 2), (7, 3), (17, 5), (1, 40), (130, 3)]):
        rng = np.random.default_rng([case, 501])
        bounds, camera = generating_view(rng, kind)
        vdi = strategies.random_vdi(
            rng, window=window, camera=camera, bounds=bounds, max_supersegments=6
        ).with_precision(precision)
        ends = random_ends(rng, vdi, camera, window, planes=case % 3) if case % 3 else {}
        drawn += check(runtime, vdi, monkeypatch, camera, window, f"{window}", **ends)
        form = {"long lens": "SHIFTED", "parallel": "PARALLEL"}.get(kind)
        assert form in (PreparedVDI(runtime, vdi).switches["DEPTH"], None)
    assert drawn


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


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("corner", "window"),
    [
        ((5, 3), (13, 9)),
        ((-3, -5), (40, 30)),
        ((-11, 8), (20, 20)),
        ((20, -4), (20, 9)),
        ((-17, -16), (18, 17)),
    ],
)
@pytest.mark.parametrize("kind", ["perspective", "parallel", "inside"])
def test_a_vdi_of_another_part_of_the_picture(runtime, kind, corner, window, monkeypatch):
    """As a plotter makes it, of what the bounds cover; its camera is that of another world."""
    size = (27, 19)
    for case, precision in enumerate(PRECISIONS):
        rng = np.random.default_rng([case, 600, *window])
        bounds, camera = generating_view(rng, kind)
        own = camera.tile(size, corner, window)
        vdi = strategies.random_vdi(rng, window=window, camera=own, bounds=bounds)
        view = in_another_world(rng, camera)
        ends = random_ends(rng, vdi, view, size, planes=0) if case == 1 else {}
        check(runtime, vdi.with_precision(precision), monkeypatch, view, size, precision, **ends)


@pytest.mark.parametrize(
    ("shown", "least", "most"),
    [({"opacity_multiplier": 0.25}, 0.1, 1), ({"transmittance_cutoff": 0.3}, 0.01, 0.3)],
    ids=["a box and a multiplier", "a cutoff"],
)
def test_what_else_changes_a_picture(runtime, shown, least, most, monkeypatch):
    vdi = strategies.random_vdi(np.random.default_rng(8), window=(21, 9))
    if "opacity_multiplier" in shown:
        low, high = np.reshape(vdi.bounds, (3, 2)).T
        box = np.column_stack([0.8 * low + 0.2 * high, 0.3 * low + 0.7 * high]).ravel()
        shown = {**shown, "cropping": box}
    plain, _ = both_ways(runtime, vdi, monkeypatch)
    image, one_by_one = both_ways(runtime, vdi, monkeypatch, **shown)
    assert image.any()
    assert least < np.abs(image - plain).max() <= most
    np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)


def grey_lists(counts, front, back, optical_depth):
    """A grey VDI seen by :data:`FACING`, of lists of so many supersegments, bottom row first."""
    n = counts.sum()
    offsets = np.concatenate([[0], np.cumsum(counts)])
    media = np.full((n, 3), 0.5), np.full(n, optical_depth)
    return VDI(FACING, counts.shape[::-1], offsets, front, back, *media, SLAB)


@pytest.mark.parametrize("compensated", [False, True])
def test_lists_of_none_and_of_thousands(runtime, compensated, monkeypatch):
    """Thin media of one optical depth: 1 - exp(-count tau) whatever the list's length."""
    most = 3000 if compensated else 900  # beyond 1024, sums are made otherwise
    counts = np.array([[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5], [0, 1, most, 0, 7, 0, 0, 0, 0, 0, 300]])
    faces = np.concatenate([np.linspace(4.5, 5.5, n + 1) for n in counts.ravel()])
    back = np.delete(faces, np.cumsum(counts.ravel() + 1) - counts.ravel() - 1)
    front = np.delete(faces, np.cumsum(counts.ravel() + 1) - 1)
    vdi = grey_lists(counts, front, back, 1e-3)
    image, one_by_one = both_ways(runtime, vdi, monkeypatch)
    alpha = -np.expm1(-1e-3 * counts[::-1])
    # An extinction times a length has the roundings of its faces: 1e-3 of a list 3000 thin
    np.testing.assert_allclose(image[..., 3], alpha, rtol=0, atol=2e-5)
    np.testing.assert_allclose(image[..., 0], 0.5 * alpha, rtol=0, atol=2e-5)
    np.testing.assert_allclose(image, one_by_one, rtol=0, atol=5e-5)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_what_is_beside_the_lists_is_not_drawn(runtime, precision, monkeypatch):
    """A tile at the window's edge has room for lists beside it, which nothing is written to."""
    original = Runtime.buffer

    def poisoned(self, *args, **options):
        buffer = original(self, *args, **options)
        self.fill(buffer, np.uint32(0x7FC00000))  # NaN
        return buffer

    monkeypatch.setattr(Runtime, "buffer", poisoned)
    # Tiles of no entries, and of fewer than the one at the edge
    counts = np.array([[0, 0, 1, 0, 0, 0, 4], [0, 0, 0, 1, 0, 0, 0], [2, 0, 0, 0, 0, 0, 3]])
    depth = np.concatenate([np.linspace(4.5, 5.5, 2 * n) for n in counts.ravel()])
    vdi = grey_lists(counts, depth[::2], depth[1::2], 0.7).with_precision(precision)
    expected = -np.expm1(-0.7 * counts[::-1])
    image = render_vdi(vdi, FACING, device=runtime)
    np.testing.assert_allclose(image[..., 3], expected, rtol=0, atol=1e-3)
    around = render_vdi(vdi, FACING.tile((7, 3), (-3, -2), (12, 8)), (12, 8), device=runtime)
    np.testing.assert_allclose(around[2:5, 3:10, 3], expected, rtol=0, atol=1e-3)
    around[2:5, 3:10] = 0
    assert not around.any()


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
        if long_offsets and precision == "8-byte":  # whose headers are offsets
            headers = runtime.download(prepared.headers).astype(np.int64)
            prepared.headers = runtime.upload(headers, "list headers")
        with runtime.buffer((9, 21, 4), name="image") as image:
            draw(prepared, vdi.camera, vdi.window_size, image)
            images.append(runtime.download(image).copy())
    assert images[0].any()
    np.testing.assert_array_equal(*images)
