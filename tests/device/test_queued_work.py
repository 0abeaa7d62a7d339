"""What a host does while a device with memory of its own works: nothing makes it wait."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_vdi, render_vdi
from faulty_driver import CAMERA, TRANSFER, TURNED, WINDOW, Driver, fresh_volume

import pyvista_vdi as pvdi


@pytest.fixture
def driver(monkeypatch, runtime):
    """The driver of a device that passes for a GPU."""
    monkeypatch.setattr(runtime, "is_cpu", False)
    return Driver(monkeypatch)


@pytest.mark.parametrize("opaque", [False, True])
def test_a_frame_of_an_unchanged_vdi_is_queued(runtime, driver, opaque):
    """Until its picture is read nothing waits, and no memory is made of a host's or given back."""
    vdi = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    depth = np.full(WINDOW[::-1], 30, np.float32) if opaque else None
    first = render_vdi(vdi, TURNED, opaque_depth=depth, device=runtime)
    with driver.noting() as noted:
        again = render_vdi(vdi, TURNED, opaque_depth=depth, device=runtime)
    assert np.array_equal(first, again)
    *queued, read = noted
    assert read == ("read, blocking", again.nbytes)
    assert [what for what, _ in queued] == ["written"] * (1 + opaque)


def test_generated_lists_stay_where_they_are_drawn(runtime, driver):
    """None comes to the host before it is asked for, nor where it begins, so that none is passed.

    Read is the number of supersegments, which nothing is enqueued behind. What is released while
    the last kernel packs is memory of that kernel alone.
    """
    volume, size = fresh_volume(), (64, 48)

    def generate():
        return pvdi.generate(
            volume, CAMERA, size, transfer_function=TRANSFER, max_supersegments=3, device=runtime
        )

    kept = generate()
    with driver.noting() as noted:
        made = generate()
    copied = [each for each in noted if each[0] != "release in use"]
    assert [what for what, _ in copied] == ["written", "read", "wait"]
    assert sum(nbytes for _, nbytes in copied) < 1000
    with driver.noting() as noted:
        picture = render_vdi(made, TURNED, device=runtime)
    # The rays, and those through the lists' centres
    written = [each for each in noted if each[0].startswith(("written", "buffer"))]
    assert [what for what, _ in written] == ["written"] * 2
    assert sum(nbytes for _, nbytes in written) < 1000
    assert np.array_equal(picture, render_vdi(kept, TURNED, device=runtime))
    assert made.equals(kept)
