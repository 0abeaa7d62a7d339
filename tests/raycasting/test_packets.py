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

from pyvista_vdi import Camera
from pyvista_vdi.device import Launch
from pyvista_vdi.model import ray_forms as rays
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
    return Scene.of(prepared or prepared_vdi(runtime, vdi), request, lambda kept: kept, first_hit)


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


OWN, TURNED = "raycast_aligned_view 16", CAMERA.replace(view_up=(0, -1, 0))
BLOCKS, PACKETS = "raycast 16", "raycast_packets 16"
REGIONS = {"cropping": ((-0.5, 0.5, -0.5, 0.5, -0.5, 0.5), "fence")}


@pytest.mark.parametrize(
    ("camera", "size", "options", "kernel"),
    [
        (CAMERA, WINDOW, {}, OWN),
        (CAMERA, WINDOW, {"skip_empty": True}, OWN),
        (CAMERA, WINDOW, {"opaque_depth": np.full(WINDOW[::-1], np.inf)}, OWN),
        (CAMERA.replace(model_transform=np.eye(4)), WINDOW, {}, OWN),
        (CAMERA.azimuth(1e-4), WINDOW, {}, OWN),  # which no ray leaves its list by
        (CAMERA, SIZE, {}, "raycast 1"),
        (CAMERA, WINDOW, {"first_hit": FirstHit(0.5)}, "first_hits 1"),
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
        chosen = choose(scene_of(cpu, slab_vdi(precision=precision), camera, size, **options))
        assert f"{chosen.kernel[1]} {chosen.rays}" == kernel  # and the rays of a work-item
        assert len(chosen.switches) <= 8


@pytest.mark.parametrize("kind", ["near", "around", "inside", "axis"])
def test_each_pixel_is_drawn_by_one_packet(cpu, kind, monkeypatch):
    """When a ray ends depends on its packet, in the last bits: two that draw a pixel would race."""
    strategies.deal_rays(monkeypatch, cpu, "packets")
    launch, size = Launch.__call__, (96, 80)

    def written(prepared, camera, numbers):
        """Where packets of some numbers draw."""
        chosen = choose(scene_of(cpu, None, camera, size, prepared=prepared))
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
