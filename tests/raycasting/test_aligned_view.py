"""Rays that stay in a list of their own: each pixel from that list (raycasting/aligned_view.cl).

These are views from V_O whose pixels are those of the VDI's window, more, or some of them. Against
the float64 oracle, as in ``test_raycast_oracle.py``, and against rays that are followed one by one:
with what else ends a ray, the forms of the supersegments, windows whose edges cut packets and
tiles, lists of none and of thousands.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import draw, render_vdi
from oracle import explain

from pyvista_vdi.device import Runtime
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Most that a channel of these random VDIs may differ from rays that are followed one by one, whose
#: lengths have more roundings. Measured: 2e-6.
TOLERANCE = 1e-5

#: Windows of VDIs: a list, a tile, a packet of 8 x 2, and one more or less along each edge.
WINDOWS = [(1, 1), (2, 2), (8, 2), (7, 3), (9, 1), (16, 5), (17, 4), (1, 40), (130, 3)]

#: A slab, and a parallel view that sees nothing beside it in a window of up to 10 by 1.
SLAB = (-10.0, 10.0, -2.0, 2.0, -1.0, 1.0)
FACING = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)


def kernels_used(runtime, monkeypatch):
    """Names of the kernels that are asked for from now on."""
    names = []
    original = Runtime.kernel

    def kernel(self, path, name, defines=None):
        names.append(name)
        return original(self, path, name, defines)

    monkeypatch.setattr(Runtime, "kernel", kernel)
    return names


def both_ways(runtime, vdi, monkeypatch, camera=None, size=None, **options):
    """The picture, by default from V_O: from the aligned view, and with rays one by one."""
    camera = vdi.camera if camera is None else camera
    image = render_vdi(vdi, camera, size, device=runtime, **options)
    with monkeypatch.context() as patch:
        strategies.deal_rays(patch, "one by one")
        return image, render_vdi(vdi, camera, size, device=runtime, **options)


def random_ends(rng, vdi, planes):
    """Opaque depths, some infinite and some before everything, and clipping planes."""
    near, far = strategies.view_depths(vdi.camera, vdi.bounds)
    depth = rng.uniform(near - 0.1 * (far - near), far, size=vdi.window_size[::-1])
    depth[rng.random(depth.shape) < 0.3] = np.inf
    corners = strategies.world_corners(vdi.bounds, vdi.camera.model_transform)
    points = rng.uniform(corners.min(axis=0), corners.max(axis=0), size=(2, 3))
    return {
        "opaque_depth": depth.astype(np.float32),
        "clipping_planes": np.hstack([points, rng.normal(size=(2, 3))])[:planes],
    }


def test_which_frames_are_drawn_as_the_aligned_view(runtime, monkeypatch):
    vdi = strategies.random_vdi(np.random.default_rng(0), window=(20, 10))
    wide, high = vdi.window_size
    names = kernels_used(runtime, monkeypatch)

    def drawn_by(camera=vdi.camera, size=vdi.window_size, precision="exact", **options):
        prepared = PreparedVDI(runtime, vdi.with_precision(precision))
        names.clear()
        with runtime.buffer((size[1], size[0], 4), name="image") as image:
            draw(prepared, camera, size, image, **options)
        return names[-1]

    own, others = ("raycast_aligned_view", "raycast_blocks") if runtime.is_cpu else ("raycast",) * 2
    assert drawn_by() == own
    assert drawn_by(precision="16-byte") == own
    assert drawn_by(precision="8-byte") == own
    assert drawn_by(skip_empty=False) == own
    assert drawn_by(opaque_depth=np.full((high, wide), np.inf)) == own
    assert drawn_by(camera=vdi.camera.replace(model_transform=vdi.camera.model_transform)) == own
    assert drawn_by(camera=vdi.camera.azimuth(1e-4)) == own  # which no ray leaves its list by
    assert drawn_by(size=(2 * wide, 2 * high)) == "raycast"
    assert drawn_by(camera=vdi.camera.azimuth(1)) == others
    assert drawn_by(camera=vdi.camera.replace(window_center=(0.5 / wide, 0))) == others
    assert drawn_by(camera=vdi.camera.replace(view_up=np.negative(vdi.camera.view_up))) == others
    assert drawn_by(first_hit=FirstHit.of(0.5, True)) == "raycast"


@pytest.mark.every(8)
@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("window", WINDOWS, ids=lambda window: f"{window[0]}x{window[1]}")
def test_every_pixel_is_its_own_list(runtime, window, precision, monkeypatch):
    """By the oracle and by rays one by one; with what ends rays early, and without."""
    for case in range(4):
        rng = np.random.default_rng([case, *window])
        vdi = strategies.random_vdi(rng, window=window, max_supersegments=6).with_precision(
            precision
        )
        ends = random_ends(rng, vdi, planes=case - 1) if case else {}
        image, one_by_one = both_ways(runtime, vdi, monkeypatch, **ends)
        result = explain(vdi, vdi.camera, window, image, name=f"seed {[case, *window]}", **ends)
        assert not result.failures, "\n".join(result.failures)
        np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("kind", ["outside", "far", "parallel", "inside"])
def test_every_projection(runtime, kind, monkeypatch):
    """Also a long lens, whose depth is kept relative, and an eye between the supersegments."""
    drawn = 0
    how = set()
    for case in range(6):
        rng = np.random.default_rng([case, 500])
        bounds = strategies.random_bounds(rng)
        transform = strategies.random_transform(rng)
        if kind == "inside":
            camera = strategies.camera_inside(rng, bounds, transform)
        else:
            camera = strategies.camera_around(
                rng,
                bounds,
                transform,
                distance={"outside": 2.0, "far": 200.0, "parallel": 2.0}[kind],
                parallel=kind == "parallel",
            )
        vdi = strategies.random_vdi(rng, window=(19, 7), camera=camera, bounds=bounds)
        vdi = vdi.with_precision(PRECISIONS[case % 3])
        ends = random_ends(rng, vdi, planes=1) if case % 2 else {}
        image, one_by_one = both_ways(runtime, vdi, monkeypatch, **ends)
        result = explain(vdi, camera, (19, 7), image, name=f"seed {[case, 500]}", **ends)
        assert not result.failures, "\n".join(result.failures)
        np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)
        drawn += result.drawn
        how |= PreparedVDI(runtime, vdi).defines.keys()
    assert drawn
    assert how >= {"far": {"SHIFTED"}, "parallel": {"PARALLEL"}}.get(kind, set())


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
        ((0, 0), (27, 19)),
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
    names = kernels_used(runtime, monkeypatch)
    for case, precision in enumerate(PRECISIONS):
        rng = np.random.default_rng([case, 600, *window])
        bounds = strategies.random_bounds(rng)
        transform = strategies.random_transform(rng)
        if kind == "inside":
            camera = strategies.camera_inside(rng, bounds, transform)
        else:
            camera = strategies.camera_around(
                rng, bounds, transform, distance=2.0, parallel=kind == "parallel"
            )
        own = camera.tile(size, corner, window)
        vdi = strategies.random_vdi(rng, window=window, camera=own, bounds=bounds)
        vdi = vdi.with_precision(precision)
        view = in_another_world(rng, camera)
        depth = rng.uniform(*strategies.view_depths(view, bounds), size=size[::-1])
        ends = {"opaque_depth": depth.astype(np.float32)} if case == 1 else {}
        names.clear()
        image, one_by_one = both_ways(runtime, vdi, monkeypatch, view, size, **ends)
        assert ("raycast_aligned_view" in names) == runtime.is_cpu
        result = explain(vdi, view, size, image, name=f"seed {[case, 600, *window]}", **ends)
        assert not result.failures, "\n".join(result.failures)
        np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)


def test_a_box_and_a_multiplier(runtime, monkeypatch):
    rng = np.random.default_rng(7)
    vdi = strategies.random_vdi(rng, window=(21, 9))
    low, high = np.reshape(vdi.bounds, (3, 2)).T
    box = np.column_stack([0.8 * low + 0.2 * high, 0.3 * low + 0.7 * high]).ravel()
    plain, _ = both_ways(runtime, vdi, monkeypatch)
    image, one_by_one = both_ways(runtime, vdi, monkeypatch, cropping=box, opacity_multiplier=0.25)
    assert image.any()
    assert np.abs(image - plain).max() > 0.1
    np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)


def test_rays_end_where_little_light_is_left(runtime, monkeypatch):
    rng = np.random.default_rng(8)
    vdi = strategies.random_vdi(rng, window=(21, 9))
    exact, _ = both_ways(runtime, vdi, monkeypatch)
    image, one_by_one = both_ways(runtime, vdi, monkeypatch, transmittance_cutoff=0.3)
    ends = np.abs(image - exact).max(axis=-1) > 0.01
    assert ends.any()
    assert np.abs(image - exact).max() <= 0.3
    np.testing.assert_allclose(image, one_by_one, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("compensated", [False, True])
def test_lists_of_none_and_of_thousands(runtime, compensated, monkeypatch):
    """Thin media of one optical depth: 1 - exp(-count tau) whatever the list's length."""
    most = 3000 if compensated else 900  # beyond 1024, sums are made otherwise
    counts = np.array([[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 5], [0, 1, most, 0, 7, 0, 0, 0, 0, 0, 300]])
    faces = np.concatenate([np.linspace(4.5, 5.5, n + 1) for n in counts.ravel()])
    back = np.delete(faces, np.cumsum(counts.ravel() + 1) - counts.ravel() - 1)
    front = np.delete(faces, np.cumsum(counts.ravel() + 1) - 1)
    n = counts.sum()
    vdi = VDI(
        FACING,
        counts.shape[::-1],
        np.concatenate([[0], np.cumsum(counts)]),
        front,
        back,
        np.full((n, 3), 0.5),
        np.full(n, 1e-3),
        SLAB,
    )
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
    n = counts.sum()
    vdi = VDI(
        FACING,
        counts.shape[::-1],
        np.concatenate([[0], np.cumsum(counts)]),
        depth[::2],
        depth[1::2],
        np.full((n, 3), 0.5),
        np.full(n, 0.7),
        SLAB,
    ).with_precision(precision)
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
        if long_offsets and precision == "8-byte":  # whose headers are offsets
            headers = runtime.download(prepared.headers).astype(np.int64)
            prepared.headers = runtime.upload(headers, "list headers")
        with runtime.buffer((9, 21, 4), name="image") as image:
            draw(prepared, vdi.camera, vdi.window_size, image)
            images.append(runtime.download(image).copy())
    assert images[0].any()
    np.testing.assert_array_equal(*images)
