"""Slices of lists go into the VDI's arrays one behind the other, whatever memory there is."""

from __future__ import annotations

from dataclasses import replace

import pytest
from faulty_driver import CAMERA, TRANSFER, WINDOW, fresh_volume

from pyvista_vdi import Camera
from pyvista_vdi.device import GrowingArray, Runtime
from pyvista_vdi.generation import list_arrays as growing_lists
from pyvista_vdi.generation import slices
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.generation.march import March

#: Looks past the volume, so that first all and then no lists have something in them.
HALF_BESIDE = Camera((3.5, -4.0, 30), (3.5, -4.0, 3.5), (0, 1, 0))


@pytest.fixture
def make(runtime):
    volume = fresh_volume()
    return lambda camera: generate_vdi(
        volume, camera, WINDOW, TRANSFER, max_supersegments=3, device=runtime
    )


@pytest.mark.parametrize("camera", [CAMERA, HALF_BESIDE], ids=["inside", "half beside"])
@pytest.mark.parametrize("memory", ["as it is", "copied", "small buffers", "little", "least"])
def test_slices_make_the_same_vdi_however_memory_is_had(monkeypatch, make, camera, memory):
    whole = make(camera)
    assert whole.n_supersegments > 100
    monkeypatch.setattr(slices, "_SLICE_BYTES", 1)  # four rows each
    moved = []
    if memory == "copied":  # as by a device with memory of its own
        monkeypatch.setattr(Runtime, "in_place_alignment", None)
    elif memory == "small buffers":  # a slice is all that one may hold
        monkeypatch.setattr(growing_lists, "_LARGEST_ELEMENT", 2**62)
    elif memory != "as it is":
        most = whole.n_supersegments * (2 if memory == "little" else 1)
        move = GrowingArray._move

        def limited(self, room):
            if room > most:
                raise MemoryError
            moved.append(room)
            move(self, room)

        monkeypatch.setattr(GrowingArray, "_move", limited)
    assert make(camera).equals(whole)
    assert (len(moved) >= 4) == (memory in ("little", "least"))


@pytest.mark.parametrize("copied", [False, True], ids=["in place", "copied"])
def test_a_slice_is_marched_before_the_sum_of_the_one_before_is_waited_for(
    monkeypatch, runtime, make, copied
):
    monkeypatch.setattr(slices, "_SLICE_BYTES", 1)
    if copied:
        monkeypatch.setattr(Runtime, "in_place_alignment", None)
    elif runtime.in_place_alignment is None:
        pytest.skip("the device copies")
    done = []
    chunks, later = March.chunks, Runtime.download_later

    def noted_chunks(self, part):
        done.append("march")
        return chunks(self, part)

    def noted_later(self, buffer, out, *, first=0):
        wait = later(self, buffer, out, first=first)

        def noted_wait():
            done.append("wait")
            wait()

        return noted_wait

    monkeypatch.setattr(March, "chunks", noted_chunks)
    monkeypatch.setattr(Runtime, "download_later", noted_later)
    make(CAMERA)
    n = -(-WINDOW[1] // 4)
    assert done == ["march", *["march", "wait"] * (n - 1), "wait"]


def test_offsets_that_no_buffer_holds_are_copied(monkeypatch, runtime):
    kinds = []
    for most in (80007, 80008):
        monkeypatch.setattr(runtime, "info", replace(runtime.info, max_allocation=most))
        with growing_lists.growing_lists(runtime, (1000, 10), 2, 16) as lists:
            kinds.append(type(lists).__name__)
    in_place = runtime.in_place_alignment is not None
    assert kinds == ["_CopiedLists", "_ListsInPlace" if in_place else "_CopiedLists"]
