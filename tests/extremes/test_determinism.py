"""The same bytes of a VDI and of an image, however the work is dealt out."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from drawing import generate_vdi, render_vdi
from extreme_scenes import transfer, turned, view

from pyvista_vdi import Volume
from pyvista_vdi.model.options import FrameRequest, MediumOptions
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
    parts.append(raycast_volume(scene, function, frame, MediumOptions()))
    for new in turned(camera, scene):
        for shown in ({}, {"skip_empty": False}, {"preview_samples": 20}):
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
    assert digest(runtime, memory_limit=3 * 2**20) == expected  # slices of four rows
    with runtime.background():
        assert digest(runtime) == expected
