"""The same bytes of a VDI and of an image, however the work is dealt out."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from extreme_scenes import BOUND, TURNS, field_volume, transfer, turned, view
from oracle import explain, total

from pyvista_vdi.device import get_runtime, list_devices
from pyvista_vdi.generation import slices
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.volume import render as raycast_volume

pytestmark = pytest.mark.extremes

SIZE = (45, 37)

#: Modules that launch kernels by groups of :data:`pyvista_vdi.device.work_order.GROUP`.
LAUNCHING = (
    "device.steps",
    "device.work_order",
    "raycasting.occupancy",
    "raycasting.prepared",
    "raycasting.strategies",
    "volume.classified_volume",
    "volume.upload",
)


def volume():
    """Enough detail that lists are full and records have to make room."""
    from pyvista_vdi.model.volume import Volume

    return Volume(np.random.default_rng(4).random((24, 25, 26)).astype(np.float32))


def digest(runtime):
    """Of everything that the engine makes of a scene: VDI, images, previews, and the grid."""
    scene = volume()
    function = transfer(opacity=0.3, unit_distance=2.0)
    camera = view(scene)
    state = hashlib.sha256()
    vdi = generate_vdi(scene, camera, SIZE, function, max_supersegments=5, device=runtime)
    for name in ("offsets", "front", "back", "color", "optical_depth"):
        state.update(getattr(vdi, name).tobytes())
    frame = FrameRequest(camera, SIZE, device=runtime)
    state.update(raycast_volume.raycast_volume(scene, function, frame))
    # Without what was prepared before: made anew each time
    vdi = VDI(
        camera, SIZE, vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth, vdi.bounds,
        depth_origin=vdi.depth_origin,
    )  # fmt: skip
    for new in turned(camera, scene):
        for options in ({}, {"skip_empty": False}, {"preview_samples": 20}):
            state.update(render_vdi(vdi, new, SIZE, device=runtime, **options).tobytes())
    return state.hexdigest()


def test_across_runs(runtime):
    assert digest(runtime) == digest(runtime)


@pytest.mark.parametrize("group", [16, 128])
def test_across_work_group_sizes(runtime, monkeypatch, group):
    expected = digest(runtime)
    for module in LAUNCHING:
        monkeypatch.setattr(f"pyvista_vdi.{module}.GROUP", group)
    assert digest(runtime) == expected


def test_across_slices(runtime, monkeypatch):
    """However many rows of lists are made at a time, and in the background or not."""
    expected = digest(runtime)
    monkeypatch.setattr(slices, "_SLICE_BYTES", 1)
    assert digest(runtime) == expected
    monkeypatch.undo()
    with runtime.background():
        assert digest(runtime) == expected


CODE = """
import os, sys
threads, wanted = sys.argv[1:]
if threads != "all":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: int(threads)])
import test_determinism
from pyvista_vdi.device import get_runtime, list_devices
info = next(info for info in list_devices() if info.full_name == wanted)
print(test_determinism.digest(get_runtime(info)))
"""


@pytest.mark.every(3)
@pytest.mark.parametrize("threads", ["all", "1"])
def test_across_processes_and_thread_counts(runtime, threads):
    """CPU drivers start a thread per processor that they may run on."""
    tests = Path(__file__).resolve().parents[1] / "support"
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(
            [str(tests), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        ),
    }
    if threads != "all":
        environment |= {"POCL_MAX_PTHREAD_COUNT": threads, "OMP_NUM_THREADS": threads}
        environment |= {"DPCPP_CPU_NUM_CUS": threads, "CL_CONFIG_CPU_FORCE_MAX_THREADS": threads}
    run = subprocess.run(
        [sys.executable, "-c", CODE, threads, runtime.info.full_name],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == digest(runtime)


@pytest.mark.slow
def test_across_implementations(runtime, worst):
    """Each of two drivers' images is within the bound of the oracle's range; so are they of each
    other, but for pixels whose ray runs along a border.

    The elementary functions (expm1, log1p, pow) may differ in their last bits, OpenCL C allows it.
    """
    others = [info for info in list_devices() if info.usable]
    scene = field_volume()
    camera = view(scene)
    vdis = [
        generate_vdi(scene, camera, SIZE, transfer(), max_supersegments=8, device=device)
        for device in (runtime, *map(get_runtime, others))
    ]
    first = vdis[0]
    for vdi, info in zip(vdis[1:], others, strict=True):
        views = turned(camera, scene, TURNS)
        for new in views:
            mine, theirs = (
                render_vdi(first, new, SIZE, device=device) for device in (runtime, info)
            )
            off = np.abs(mine - theirs).max(axis=-1)
            worst("one VDI, typical pixel", np.quantile(off, 0.98))
            assert np.mean(off > BOUND) < 0.01
        # Each with the VDI that it made
        pictures = [
            render_vdi(made, camera, SIZE, device=device)
            for made, device in ((first, runtime), (vdi, info))
        ]
        worst("own VDIs at V_O", np.abs(pictures[0] - pictures[1]).max())
        assert np.abs(pictures[0] - pictures[1]).max() <= BOUND


def test_random_vdis_on_every_device(runtime, worst):
    """The bound itself: random VDIs from random views, each pixel explained by the oracle."""
    parts = []
    for case, kind in enumerate(("near", "around", "parallel")):
        rng = np.random.default_rng([case, 900])
        vdi = strategies.random_vdi(rng, max_window=(9, 7))
        camera, size = strategies.random_view(rng, vdi, kind)
        image = render_vdi(vdi, camera, size, device=runtime)
        parts.append(explain(vdi, camera, size, image, name=kind))
    worst("random VDI", total(parts).worst)
    assert not total(parts).failures
