"""Slices of lists go into the VDI's arrays one behind the other, whatever memory there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drawing import generate_vdi
from faulty_driver import CAMERA, TRANSFER, WINDOW, fresh_volume

from pyvista_vdi import Camera, render
from pyvista_vdi.device import Runtime
from pyvista_vdi.generation import list_arrays
from pyvista_vdi.model.host_memory import with_room

#: Looks past the volume, so that first all and then no lists have something in them.
HALF_BESIDE = Camera((3.5, -4.0, 30), (3.5, -4.0, 3.5), (0, 1, 0))

#: What slices of four rows need, and more rows do not fit into.
FOUR_ROWS = {"memory_limit": 2**21}


@pytest.fixture
def make(runtime):
    volume = fresh_volume()
    return lambda camera, **options: generate_vdi(
        volume, camera, WINDOW, TRANSFER, max_supersegments=3, device=runtime, **options
    )


@pytest.mark.parametrize("camera", [CAMERA, HALF_BESIDE], ids=["inside", "half beside"])
@pytest.mark.parametrize("memory", ["copied", "little", "least"])
def test_slices_make_the_same_vdi_however_memory_is_had(monkeypatch, runtime, make, camera, memory):
    whole = make(camera)
    assert whole.n_supersegments > 100
    grown = set()
    if memory == "copied":  # as by a device with memory of its own
        monkeypatch.setattr(Runtime, "in_place_alignment", None)
    else:  # no room for all that there may be: arrays grow, and move

        def limited(array, n, most):
            grown.add(len(array))
            return with_room(array, n, (2 if memory == "little" else 1) * n)

        monkeypatch.setattr(list_arrays, "with_room", limited)
    assert make(camera, **FOUR_ROWS).equals(whole)
    assert len(grown) >= 3 or runtime.in_place_alignment is None


@pytest.mark.parametrize("camera", [CAMERA, HALF_BESIDE], ids=["inside", "half beside"])
def test_lists_stay_in_a_devices_own_memory_until_somebody_wants_them(
    monkeypatch, runtime, make, camera
):
    wanted = make(camera)
    monkeypatch.setattr(runtime, "is_cpu", False)  # so that it has memory of its own
    picture = render(wanted, camera, WINDOW, device=runtime)
    vdi = make(camera)
    assert np.array_equal(render(vdi, camera, WINDOW, device=runtime), picture)
    assert vdi.nbytes == wanted.nbytes
    # A sixteenth of the memory is for lists: those made first make room
    info = replace(runtime.info, global_memory=2**23 + runtime.allocated)
    monkeypatch.setattr(runtime, "info", info)
    before = runtime.allocated
    others = [make(camera) for _ in range(30)]
    assert before < runtime.allocated <= before + info.global_memory / 16
    assert all(other.counts.sum() == vdi.n_supersegments for other in others)
    before = runtime.allocated
    assert all(other.equals(wanted) for other in others)
    assert runtime.allocated < before
    assert vdi.equals(wanted)
    assert vdi.with_precision("8-byte").equals(wanted.with_precision("8-byte"))
