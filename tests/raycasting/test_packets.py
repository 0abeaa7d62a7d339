"""Rays in packets and blocks: when they are, how those lie in the window, that none is left out.

That they meet what rays that are followed one by one meet is tested where those are:
``tests/raycasting/test_raycast_oracle.py`` and ``test_skipping.py``.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import draw, frame

from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting import packets
from pyvista_vdi.raycasting.prepared import PreparedVDI
from pyvista_vdi.raycasting.scene import Scene
from pyvista_vdi.raycasting.strategies import strategy_for

BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
CAMERA = Camera((0, 0, 6), (0, 0, 0), (0, 1, 0), view_angle=30)
SIZE = (320, 240)


def slab_vdi(camera=CAMERA, window=(480, 360), optical_depth=0.1):
    """Each list has one supersegment, in the front half of the bounds."""
    lists = window[0] * window[1]
    depth = rays.depth_range(camera, BOUNDS)
    front, back = np.interp([0.1, 0.3], [0, 1], depth)
    return VDI(
        camera,
        window,
        np.arange(lists + 1),
        np.full(lists, front),
        np.full(lists, back),
        np.full((lists, 3), 0.5),
        np.full(lists, optical_depth),
        BOUNDS,
    )


def scene_of(runtime, vdi, camera, size, **options):
    """A frame whose rays are cast through all of the window."""
    request = frame(vdi, camera, size, skip_empty=False, **options)
    return Scene.of(PreparedVDI(runtime, vdi), request)


def dealt(runtime, vdi, camera, size=SIZE):
    """The packets of a frame, None if its rays are followed one by one."""
    return scene_of(runtime, vdi, camera, size).packets


def kernel_of(runtime, vdi, camera, size=SIZE, **options):
    """The name of the kernel that draws a frame."""
    return strategy_for(scene_of(runtime, vdi, camera, size, **options)).kernel


def drawn(runtime, prepared, camera, size, unwritten=np.nan):
    """A frame, `unwritten` where nothing was."""
    with runtime.buffer((size[1], size[0], 4), name="image") as image:
        runtime.fill(image, np.float32(unwritten))
        draw(prepared, camera, size, image, skip_empty=False)  # which fills the rest by itself
        return runtime.download(image).copy()


def test_rays_that_cross_few_lists_are_followed_one_by_one(runtime):
    assert dealt(runtime, slab_vdi(), CAMERA) is None
    assert dealt(runtime, slab_vdi(), CAMERA.azimuth(1)) is None
    # Nor is a small picture worth it, whose rays have less in common
    assert dealt(runtime, slab_vdi(), CAMERA.azimuth(60), (64, 48)) is None
    away = CAMERA.replace(focal_point=(0, 0, 12))  # no ray meets anything
    assert dealt(runtime, slab_vdi(), away) is None


def test_rays_whose_light_ends_soon_are_followed_one_by_one(runtime):
    assert dealt(runtime, slab_vdi(optical_depth=100.0), CAMERA.azimuth(60)) is None


@pytest.mark.parametrize("precision", ["exact", "16-byte", "8-byte"])
def test_which_kernel_follows_rays(runtime, precision):
    """Blocks near V_O, packets far from it; where there are no blocks, packets from nearer on."""
    if not runtime.is_cpu:
        pytest.skip("packets and blocks are for CPU devices")
    vdi = slab_vdi().with_precision(precision)
    near = "raycast_blocks" if precision == "exact" else "raycast"
    between = "raycast_blocks" if precision == "exact" else "raycast_packets"
    assert kernel_of(runtime, vdi, CAMERA) == "raycast"  # V_O
    assert kernel_of(runtime, vdi, CAMERA.azimuth(1)) == near
    assert kernel_of(runtime, vdi, CAMERA.azimuth(20)) == between
    assert kernel_of(runtime, vdi, CAMERA.azimuth(60)) == "raycast_packets"
    planes = (-0.5, 0.5, -0.5, 0.5, -0.5, 0.5)
    cropping = Cropping(planes, regions="fence")
    for angle in (0, 60):
        assert kernel_of(runtime, vdi, CAMERA.azimuth(angle), cropping=cropping) == near


def test_how_far_light_gets():
    depths = rays.depth_range(CAMERA, BOUNDS)
    assert packets.share_lit(slab_vdi(), *depths) == 1  # and on, behind the supersegments
    # A slab from .1 to .3 of the depths, of whose optical depth light gets through 13.8
    assert packets.share_lit(slab_vdi(optical_depth=138.0), *depths) == pytest.approx(
        0.12, abs=1e-6
    )
    near, far = depths
    faces = np.interp([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0, 1], depths).astype(np.float32)
    dark = VDI(
        CAMERA,
        (1, 2),
        [0, 3, 3],
        faces[::2],
        faces[1::2],
        np.full((3, 3), 0.5),
        [1, 128, 1],
        BOUNDS,
    )
    assert packets.share_lit(dark, near, far) == pytest.approx(0.31, abs=1e-6)
    clear = VDI(CAMERA, (1, 1), [0, 1], [faces[0]], [faces[1]], [[0.5] * 3], [0.0], BOUNDS)
    assert packets.share_lit(clear, near, far) == 1
    none = VDI(CAMERA, (1, 1), [0, 0], [], [], [], [], BOUNDS)
    assert packets.share_lit(none, near, far) == 1


@pytest.mark.parametrize(
    ("turn", "defines"),
    [
        (lambda camera: camera.azimuth(30), {}),
        (lambda camera: camera.azimuth(-60), {}),
        (lambda camera: camera.elevation(30), {"UPRIGHT": 1, "SWEEP_V": 1}),
        (lambda camera: camera.azimuth(30).replace(view_up=(1, 0, 0)), {"UPRIGHT": 1}),
        (lambda camera: camera.elevation(30).replace(view_up=(1, 0, 0)), {"SWEEP_V": 1}),
    ],
    ids=["to the right", "to the left", "up", "to the right and rolled", "up and rolled"],
)
def test_packets_lie_along_the_lines_that_rays_share(runtime, turn, defines, monkeypatch):
    if not runtime.is_cpu:
        pytest.skip("packets are for CPU devices")
    strategies.deal_rays(monkeypatch, "packets")
    found = dealt(runtime, slab_vdi(), turn(CAMERA))
    assert found is not None
    assert found.defines == defines


def test_the_epipole_is_where_the_eye_of_the_generating_view_is_seen():
    u, v, w = packets.epipole_of(CAMERA, CAMERA.azimuth(45), SIZE)
    half_height = np.tan(np.radians(15))
    assert v == pytest.approx(0)
    assert u / w == pytest.approx(-np.tan(np.radians(67.5)) / half_height * SIZE[1] / 2)
    behind = CAMERA.replace(position=(0, 0, 9))
    assert packets.epipole_of(CAMERA, behind, SIZE)[:2] == pytest.approx([0, 0])
    parallel = CAMERA.replace(parallel_projection=True)
    u, v, w = packets.epipole_of(parallel, parallel.azimuth(30), SIZE)
    assert (v, w) == (pytest.approx(0), 0)  # at infinity, along the rows
    assert u != 0


@pytest.mark.every(5)
@pytest.mark.parametrize(
    "kind", ["near", "around", "inside", "beside", "behind", "axis", "parallel"]
)
@pytest.mark.parametrize("size", [(97, 71), (40, 130)])
@pytest.mark.parametrize("dealt", ["blocks", "packets"])
def test_no_pixel_is_left_out(runtime, kind, size, dealt, monkeypatch):
    """Lines draw together towards the epipole: between them is nothing, wherever it lies."""
    strategies.deal_rays(monkeypatch, dealt)
    for case in range(12):
        rng = np.random.default_rng([case, *size])
        vdi = strategies.random_vdi(rng, max_window=(6, 5), max_supersegments=2)
        camera, _ = strategies.random_view(rng, vdi, kind)
        image = drawn(runtime, PreparedVDI(runtime, vdi), camera, size)
        assert not np.isnan(image).any(), f"seed {[case, *size]}, view {kind!r}"


@pytest.mark.parametrize("kind", ["near", "around", "inside", "axis"])
def test_each_pixel_is_drawn_by_one_packet(runtime, kind, monkeypatch):
    """When a ray ends depends on its packet, in the last bits: two that draw a pixel would race."""
    strategies.deal_rays(monkeypatch, "packets")
    if not runtime.is_cpu:
        pytest.skip("packets are for CPU devices")
    enqueue = runtime._enqueue

    def written(prepared, camera, packets_wanted):
        def some(kernel, size, group):
            if kernel.name != "raycast_packets":
                return enqueue(kernel, size, group)
            for first in range(size[0])[packets_wanted]:
                enqueue(kernel, (1,), (1,), (first,))
            return None

        with monkeypatch.context() as patch:
            patch.setattr(runtime, "_enqueue", some)
            return drawn(runtime, prepared, camera, SIZE, unwritten=-1)[..., 3] >= 0

    for case in range(3):
        rng = np.random.default_rng([case, 5])
        vdi = strategies.random_vdi(rng, max_window=(24, 20), max_supersegments=2)
        camera, _ = strategies.random_view(rng, vdi, kind)
        prepared = PreparedVDI(runtime, vdi)
        cleared = written(prepared, camera, slice(0))  # what no packet draws
        even, odd = (
            written(prepared, camera, slice(first, None, 2)) & ~cleared for first in (0, 1)
        )
        assert even.any(), case
        assert odd.any(), case
        assert not (even & odd).any(), case  # lines that draw together have numbers side by side


@pytest.mark.parametrize(
    "offset", [(0.0, 0.0), (3.0, 1.0), (20.0, -2.0), (70.0, 50.0), (400.0, 30.0)]
)
def test_an_epipole_in_the_window_and_beside_it(runtime, offset, monkeypatch):
    """The eye of V_O before that of V_N: lists are crossed on lines that spread from a point."""
    vdi = slab_vdi(window=(40, 30))
    # From where that eye is a unit in front, to be seen at this pixel offset
    to_eye = np.array([*np.array(offset) / (SIZE[1] / 2) * np.tan(np.radians(15)), -1.0])
    position = CAMERA.position - to_eye
    camera = CAMERA.replace(position=position, focal_point=position - [0, 0, 1])
    seen = packets.epipole_of(CAMERA, camera, SIZE)
    assert seen[:2] / seen[2] == pytest.approx(offset, abs=1e-6)
    prepared = PreparedVDI(runtime, vdi)
    images = []
    for how in strategies.DEALT:
        strategies.deal_rays(monkeypatch, how)
        images.append(drawn(runtime, prepared, camera, SIZE))
    assert images[0].any()
    # Rays are the same; their lengths are computed by other roundings
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], rtol=0, atol=2e-6)
