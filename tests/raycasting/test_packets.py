"""Which kernel follows a frame's rays; how packets lie in the window, and that none is left out.

That they meet what rays that are followed one by one meet is tested where those are:
``test_raycast_oracle.py`` and ``test_skipping.py``.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest
import strategies
from drawing import draw, frame
from extreme_scenes import slabs_vdi

from pyvista_vdi import VDI, Camera
from pyvista_vdi.device import Launch
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.raycasting import packets
from pyvista_vdi.raycasting.choose import choose
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import PreparedVDI, prepared_vdi
from pyvista_vdi.raycasting.scene import Scene

BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
CAMERA = Camera((0, 0, 6), (0, 0, 0), (0, 1, 0), view_angle=30)
SIZE = (320, 240)
WINDOW = (480, 360)
DEPTHS = rays.depth_range(CAMERA, BOUNDS)


@functools.cache
def slab_vdi(optical_depth=0.1, window=WINDOW, precision="exact"):
    """Each list has one supersegment, in the front half of the bounds."""
    faces = np.interp([0.1, 0.3], [0, 1], DEPTHS)
    vdi = slabs_vdi(CAMERA, faces, optical_depth, window=window, bounds=BOUNDS)
    return vdi.with_precision(precision)


def scene_of(runtime, vdi, camera, size=SIZE, first_hit=None, prepared=None, **options):
    request = frame(vdi, camera, size, **{"skip_empty": False, **options})
    return Scene.of(prepared or prepared_vdi(runtime, vdi), request, first_hit)


@pytest.fixture
def cpu(runtime):
    if not runtime.is_cpu:
        pytest.skip("packets and blocks are for CPU devices")
    return runtime


def drawn(runtime, prepared, camera, size, unwritten=np.nan):
    """A frame, `unwritten` where nothing was."""
    with runtime.buffer((size[1], size[0], 4), name="image") as image:
        runtime.fill(image, np.float32(unwritten))
        draw(prepared, camera, size, image, skip_empty=False)  # which fills the rest by itself
        return runtime.download(image).copy()


def test_which_rays_are_in_packets(runtime):
    """Not those that cross few lists, of a small picture, or whose light ends soon."""
    turned = CAMERA.azimuth(75)
    away = CAMERA.replace(focal_point=(0, 0, 12))  # no ray meets anything
    for camera, size, tau, in_packets in (
        (turned, SIZE, 0.1, True),
        (CAMERA, SIZE, 0.1, False),
        (CAMERA.azimuth(1), SIZE, 0.1, False),
        (turned, (64, 48), 0.1, False),
        (away, SIZE, 0.1, False),
        (turned, SIZE, 100.0, False),
    ):
        found = scene_of(runtime, slab_vdi(tau), camera, size).packets
        assert (found is not None) == in_packets


OWN, TURNED = "raycast_aligned_view 16", CAMERA.replace(view_up=(0, -1, 0))
BLOCKS, PACKETS = "raycast 16", "raycast_packets 16"
REGIONS = {"cropping": ((-0.5, 0.5, -0.5, 0.5, -0.5, 0.5), "fence")}


def drawn_by(runtime, scene):
    """Which kernel draws a scene, and how many rays a work-item of it follows."""
    variant = choose(runtime, scene)
    assert len(variant.switches) <= 8
    return f"{variant.kernel.name} {variant.rays}"


@pytest.mark.parametrize(
    ("camera", "size", "options", "kernel"),
    [
        (CAMERA, WINDOW, {}, OWN),
        (CAMERA, WINDOW, {"skip_empty": True}, OWN),
        (CAMERA, WINDOW, {"opaque_depth": np.full(WINDOW[::-1], np.inf)}, OWN),
        (CAMERA.replace(model_transform=np.eye(4)), WINDOW, {}, OWN),
        (CAMERA.azimuth(1e-4), WINDOW, {}, OWN),  # which no ray leaves its list by
        (CAMERA, SIZE, {}, "raycast 1"),
        (CAMERA, WINDOW, {"first_hit": FirstHit.of(0.5, True)}, "first_hits 1"),
        (TURNED, WINDOW, {}, BLOCKS),
        (CAMERA.azimuth(1), SIZE, {}, BLOCKS),
        (CAMERA.replace(window_center=(1e-3, 0)), WINDOW, {}, BLOCKS),
        (CAMERA.azimuth(20), SIZE, {}, BLOCKS),
        (CAMERA.azimuth(75), SIZE, {}, PACKETS),
        (CAMERA, SIZE, REGIONS, BLOCKS),
        (CAMERA.azimuth(75), SIZE, REGIONS, BLOCKS),
    ],
)
def test_which_kernel_follows_rays(cpu, camera, size, options, kernel):
    """Blocks near V_O, packets far from it."""
    for precision in ("exact", "8-byte"):
        scene = scene_of(cpu, slab_vdi(precision=precision), camera, size, **options)
        assert drawn_by(cpu, scene) == kernel


def test_short_vectors_follow_packets_from_farther_on(cpu, monkeypatch):
    view = CAMERA.azimuth(50)  # of 6.8 lists in common
    for floats, kernel in ((4, BLOCKS), (8, BLOCKS), (16, PACKETS)):
        monkeypatch.setattr(cpu, "vector_floats", floats)
        assert drawn_by(cpu, scene_of(cpu, slab_vdi(), view)) == kernel


def test_how_far_light_gets():
    # A slab from .1 to .3 of the depths, of whose optical depth light gets through 13.8
    assert packets.share_lit(slab_vdi(), *DEPTHS) == 1  # and on, behind the supersegments
    assert packets.share_lit(slab_vdi(138.0), *DEPTHS) == pytest.approx(0.12, abs=1e-6)
    faces = np.interp([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0, 1], DEPTHS).astype(np.float32)
    color = np.full((3, 3), 0.5)
    dark = VDI(CAMERA, (1, 2), [0, 3, 3], faces[::2], faces[1::2], color, [1, 128, 1], BOUNDS)
    assert packets.share_lit(dark, *DEPTHS) == pytest.approx(0.31, abs=1e-6)
    for tau in ([0.0], []):
        clear = slabs_vdi(CAMERA, faces[: 2 * len(tau)], tau, bounds=BOUNDS)
        assert packets.share_lit(clear, *DEPTHS) == 1


@pytest.mark.parametrize(
    ("camera", "upright", "sweep_v"),
    [
        (CAMERA.azimuth(30), 0, 0),
        (CAMERA.azimuth(-60), 0, 0),
        (CAMERA.elevation(30), 1, 1),
        (CAMERA.azimuth(30).replace(view_up=(1, 0, 0)), 1, 0),
        (CAMERA.elevation(30).replace(view_up=(1, 0, 0)), 0, 1),
    ],
    ids=["to the right", "to the left", "up", "to the right and rolled", "up and rolled"],
)
def test_packets_lie_along_the_lines_that_rays_share(cpu, camera, upright, sweep_v, monkeypatch):
    strategies.deal_rays(monkeypatch, cpu, "packets")
    switches = choose(cpu, scene_of(cpu, slab_vdi(), camera)).switches
    assert (switches["UPRIGHT"], switches["SWEEP_V"]) == (upright, sweep_v)


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
@pytest.mark.parametrize("dealt", ["blocks", "packets"], indirect=True)
def test_no_pixel_is_left_out(runtime, kind, size, dealt):
    """Lines draw together towards the epipole: between them is nothing, wherever it lies."""
    for case in range(8):
        rng = np.random.default_rng([case, *size])
        vdi = strategies.random_vdi(rng, max_window=(6, 5), max_supersegments=2)
        camera, _ = strategies.random_view(rng, vdi, kind)
        image = drawn(runtime, PreparedVDI(runtime, vdi), camera, size)
        assert not np.isnan(image).any(), f"seed {[case, *size]}, view {kind!r}"


@pytest.mark.parametrize("kind", ["near", "around", "inside", "axis"])
def test_each_pixel_is_drawn_by_one_packet(cpu, kind, monkeypatch):
    """When a ray ends depends on its packet, in the last bits: two that draw a pixel would race."""
    strategies.deal_rays(monkeypatch, cpu, "packets")
    launch, size = Launch.__call__, (96, 80)

    def written(prepared, camera, numbers):
        """Where packets of some numbers draw."""
        chosen = choose(cpu, scene_of(cpu, None, camera, size, prepared=prepared))
        first, strips, number, _ = chosen.arguments["part"]

        def some(self, items, group, **arguments):
            if "raycast_packets" not in repr(self):
                launch(self, items, group, **arguments)
                return
            for n in range(number, number + items // strips)[numbers]:
                for strip in range(first, first + strips):
                    launch(self, 1, 1, **arguments, part=(strip, 1, n, 0))

        with monkeypatch.context() as patch:
            patch.setattr(Launch, "__call__", some)
            return drawn(cpu, prepared, camera, size, unwritten=-1)[..., 3] >= 0

    for case in range(3):
        rng = np.random.default_rng([case, 5])
        vdi = strategies.random_vdi(rng, max_window=(24, 20), max_supersegments=2)
        camera, _ = strategies.random_view(rng, vdi, kind)
        prepared = PreparedVDI(cpu, vdi)
        cleared = written(prepared, camera, slice(0))  # what no packet draws
        even, odd = (
            written(prepared, camera, slice(first, None, 2)) & ~cleared for first in (0, 1)
        )
        assert even.any(), case
        assert odd.any(), case
        assert not (even & odd).any(), case  # lines that draw together have numbers side by side


@pytest.mark.parametrize("offset", [(0.0, 0.0), (3.0, 1.0), (20.0, -2.0), (70.0, 50.0), (400, 30)])
def test_an_epipole_in_the_window_and_beside_it(runtime, offset, monkeypatch):
    """The eye of V_O before that of V_N: lists are crossed on lines that spread from a point."""
    # From where that eye is a unit in front, to be seen at this pixel offset
    to_eye = np.array([*np.array(offset) / (SIZE[1] / 2) * np.tan(np.radians(15)), -1.0])
    position = CAMERA.position - to_eye
    camera = CAMERA.replace(position=position, focal_point=position - [0, 0, 1])
    seen = packets.epipole_of(CAMERA, camera, SIZE)
    assert seen[:2] / seen[2] == pytest.approx(offset, abs=1e-6)
    prepared = PreparedVDI(runtime, slab_vdi(window=(40, 30)))
    images = []
    for how in strategies.DEALT:
        with monkeypatch.context() as patch:
            strategies.deal_rays(patch, runtime, how)
            images.append(drawn(runtime, prepared, camera, SIZE))
    assert images[0].any()
    # Rays are the same; their lengths are computed by other roundings
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], rtol=0, atol=2e-6)
