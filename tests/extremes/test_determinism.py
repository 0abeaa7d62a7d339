"""The same bytes of a VDI and of an image, however the work is dealt out."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawing import generate_vdi, render_vdi
from extreme_scenes import transfer, turned, view

from pyvista_vdi import Volume
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.volume.render import raycast_volume

pytestmark = pytest.mark.extremes

SIZE = (45, 37)

#: Modules that launch kernels by groups of :data:`pyvista_vdi.device.constants.GROUP`.
LAUNCHING = (
    "volume.rays",
    "device.constants",
    "raycasting.prepared",
    "raycasting.choose",
    "volume.classified_volume",
    "volume.upload",
)


def digest(runtime, **options):
    """Of a VDI, of the volume's image, and of images of the VDI from four views."""
    # Enough detail that lists are full and records have to make room
    scene = Volume(np.random.default_rng(4).random((24, 25, 26)).astype(np.float32))
    camera, function = view(scene), transfer()
    vdi = generate_vdi(
        scene, camera, SIZE, function, max_supersegments=5, device=runtime, **options
    )
    frame = FrameRequest(camera, SIZE, device=runtime)
    parts = [vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth]
    parts.append(raycast_volume(scene, function, frame))
    for new in turned(camera, scene):
        for shown in ({}, {"skip_empty": False}):
            parts.append(render_vdi(vdi, new, SIZE, device=runtime, **shown))
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


@pytest.fixture
def expected(runtime):
    return digest(runtime)


@pytest.mark.parametrize("group", [16, 128])
def test_across_work_group_sizes(runtime, monkeypatch, group, expected):
    for module in LAUNCHING:
        monkeypatch.setattr(f"pyvista_vdi.{module}.GROUP", group)
    assert digest(runtime) == expected


def test_across_slices(runtime, expected):
    """However many rows of lists are made at a time, and in the background or not."""
    assert digest(runtime, memory_limit="3 MiB") == expected  # slices of four rows
    with runtime.background():
        assert digest(runtime) == expected


CODE = """
import os, sys
threads, wanted = sys.argv[1:]
if threads != "all":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: int(threads)])
import as_gpu, test_determinism
from pyvista_vdi.device import get_runtime, list_devices
if os.environ.get("PYVISTA_VDI_TEST_AS_GPU") == "1":
    as_gpu.pretend()
info = next(info for info in list_devices() if info.full_name == wanted)
print(test_determinism.digest(get_runtime(info)))
"""


@pytest.mark.parametrize("threads", [pytest.param("all", marks=pytest.mark.slow), "1"])
def test_across_processes_and_thread_counts(runtime, threads, expected):
    """CPU drivers start a thread per processor that they may run on."""
    here = Path(__file__).resolve().parent
    paths = [here.parent / "support", here.parent, here, os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
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
    assert run.stdout.strip() == expected
