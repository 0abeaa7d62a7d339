"""Frames upon frames of a plotter that is left no peace: nothing of them stays."""

from __future__ import annotations

import gc
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi

pytestmark = [pytest.mark.gl, pytest.mark.slow]

SIZES = ((120, 100), (60, 80), (161, 91))


def held(runtime):
    """What is held: bytes on the device, threads and open files."""
    end = time.monotonic() + 60
    gc.collect()
    while any(t.name.startswith("pyvista-vdi") for t in threading.enumerate()):
        assert time.monotonic() < end, "a thread does not end"
        time.sleep(0.05)
    gc.collect()
    return runtime.allocated, threading.active_count(), len([*Path("/proc/self/fd").iterdir()])


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="reads /proc")
def test_a_thousand_frames_leave_nothing(default_runtime):
    rng, seen = np.random.default_rng(1), []
    for dtype in ("uint8", "float32", "uint8", "float32"):
        plotter = pv.Plotter(off_screen=True, window_size=SIZES[0])
        volume = soft_ball(16)
        volume["v"] = volume["v"].astype(dtype)
        few = pvdi.Settings(regenerate_below=0.9)
        actor = plotter.add_vdi(volume, draw="vdi", regenerate="auto", settings=few, **LOOKS)
        plotter.show(auto_close=False)
        for frame in range(250):
            # Half of them as for somebody who watches: previews, and VDIs made in the background
            actor.mapper.SetInteractiveOffScreen(frame % 100 >= 50)
            plotter.render_window.SetDesiredUpdateRate(rng.choice([15.0, 0.001]))
            plotter.camera.position = 4 * rng.normal(size=3)
            plotter.camera.view_angle = rng.uniform(15, 70)
            if frame % 20 == 10:
                plotter.window_size = SIZES[rng.integers(len(SIZES))]
            if frame % 50 == 25:
                actor.prop.GetScalarOpacity().AddPoint(rng.uniform(60, 140), rng.uniform(0, 0.5))
            if frame % 100 == 75:
                actor.regenerate()
            plotter.render()
        assert actor.status.generation > 2
        plotter.close()
        del plotter, actor, volume
        seen.append(held(default_runtime))
    # Each kind of volume has been drawn before: its programs and images are there
    assert all(late <= early for late, early in zip(seen[3], seen[1], strict=True)), seen
