"""Frames first, background work in turns between them: order, fairness, cancelling, no deadlock."""

from __future__ import annotations

import re
import threading
from importlib import resources

import numpy as np
import pytest

from pyvista_vdi.device import scheduling as turns
from pyvista_vdi.device.scheduling import Turns
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.model.host_memory import aligned_empty

#: Seconds after which a test that waits for another thread gives up: it would wait for ever.
PATIENCE = 120


class InThread(threading.Thread):
    """A function in a thread, whose error and result ``value`` brings back."""

    def __init__(self, function, *args):
        super().__init__(daemon=True)
        self._function, self._args = function, args
        self._value, self._error = None, None
        self.start()

    def run(self):
        try:
            self._value = self._function(*self._args)
        except BaseException as error:
            self._error = error

    def value(self):
        self.join(PATIENCE)
        assert not self.is_alive(), "the threads wait for each other"
        if self._error is not None:
            raise self._error
        return self._value


def never():
    return False


def wait(event):
    assert event.wait(PATIENCE)


def assert_free(each):
    """A frame and background work can both be begun, and each has an end."""

    def frame():
        with each.foreground():
            return "frame"

    def work():
        with each.background(never):
            return "work"

    assert [InThread(function).value() for function in (work, frame, work)] == [
        "work", "frame", "work",
    ]  # fmt: skip
    assert each.thread.worker is None


def test_a_frame_waits_for_the_piece_in_progress_and_no_longer():
    order, each = [], Turns()
    piece, arrived = threading.Event(), threading.Event()

    def work():
        with each.background(never):
            piece.set()
            wait(arrived)
            threading.Event().wait(3 * turns.POLL)  # the frame would be drawn by now
            order.append("piece")
            while order == ["piece"]:
                each.give_way()
            order.append("work")

    thread = InThread(work)
    wait(piece)
    arrived.set()
    with each.foreground():
        order.append("frame")
    thread.value()
    assert order == ["piece", "frame", "work"]


def test_blocks_inside_blocks():
    each = Turns()

    def frame():
        with each.foreground():
            with each.foreground():
                pass  # its end is not that of the frame
            with inside, each.background(never):
                pass

    inside = pytest.raises(RuntimeError, match="inside a frame")
    InThread(frame).value()
    with each.background(never):
        with each.foreground():  # part of the background work
            assert each.thread.worker is not None
        assert each.thread.worker is not None
        with pytest.raises(RuntimeError, match="background work"), each.background(never):
            pass
    assert_free(each)


def test_cancelled_work_ends_while_a_frame_waits_for_it():
    each, cancelled = Turns(), threading.Event()

    def work():
        with each.background(cancelled.is_set):
            pytest.fail("no turn was free")

    with each.foreground():
        thread = InThread(work)
        cancelled.set()
        with pytest.raises(Cancelled):
            thread.value()
    assert_free(each)
    # And else at its next give_way
    with pytest.raises(Cancelled), each.background(lambda: True):
        each.give_way()
    assert_free(each)


def test_a_lock_is_handed_over_between_frame_and_work():
    """Each waits for what the other has: the frame for the lock, the work for the frame's end."""
    each, lock, held = Turns(), threading.Lock(), threading.Event()
    in_frame, order = threading.Event(), []

    def work():
        with each.background(never), each.holding(lock):
            held.set()
            while not in_frame.is_set():
                each.give_way()
            order.append("work")

    def frame():
        wait(held)
        with each.foreground():
            in_frame.set()
            with each.holding(lock):
                order.append("frame")

    for thread in [InThread(work), InThread(frame)]:
        thread.value()
    assert order == ["work", "frame"]
    assert not lock.locked()


KERNELS = """\
__kernel void index(__global uint *x, const uint wide)
{
    const uint i = get_global_id(1) * wide + get_global_id(0);
    x[i] += 1 + i;
}
"""


@pytest.fixture
def kernels(tmp_path):
    path = tmp_path / "kernels.cl"
    path.write_text(KERNELS)
    return path


@pytest.mark.parametrize(
    ("size", "group"),
    [((40960,), (64,)), ((64, 96), (8, 4)), ((64,), (64,))],
)
def test_launches_in_pieces_cover_everything_once(runtime, kernels, monkeypatch, size, group):
    pieces = []
    monkeypatch.setattr(turns.Worker, "piece", lambda *_: 2048)
    monkeypatch.setattr(turns.Worker, "took", lambda self, kind, items, _: pieces.append(items))
    n = int(np.prod(size))
    with runtime.buffer((n,), np.uint32) as x:
        with runtime.background():
            runtime.fill(x, 0)
            runtime.bind(kernels, "index", x=x, wide=size[0])(size, group)
        np.testing.assert_array_equal(runtime.download(x), np.arange(1, n + 1))
    assert sum(pieces) == n
    assert n <= 4096 or len(pieces) > 1


def test_no_kernel_asks_for_its_groups_number():
    """In a piece of a launch it would be another."""
    folder = resources.files("pyvista_vdi.opencl")
    rooms = [list(room.iterdir()) for room in folder.iterdir() if room.is_dir()]
    files = [path for room in rooms for path in room if path.name.endswith(".cl")]
    asks = re.compile(r"\bget_(group_id|num_groups|global_size|global_offset)\b")
    assert [path.name for path in files if asks.search(path.read_text())] == []


def test_copies_in_pieces(runtime):
    rng = np.random.default_rng(3)
    array = rng.integers(0, 2**32, (11, 70, 3001), dtype=np.uint32)  # 9 MB: three pieces
    unaligned = aligned_empty(array.size + 1, np.uint32)[1:].reshape(array.shape)
    unaligned[...] = array
    before = runtime.allocated
    with (
        runtime.background(),
        runtime.upload(unaligned) as uploaded,
        runtime.buffer(array.shape, np.uint32) as written,
    ):
        assert runtime.allocated - before == 2 * array.nbytes
        np.testing.assert_array_equal(runtime.download(uploaded), array)
        part = runtime.download(uploaded, np.empty(1_500_000, np.uint32))
        np.testing.assert_array_equal(part, array.ravel()[: len(part)])
        runtime.write(written, array)
        np.testing.assert_array_equal(runtime.download(written), array)
    assert runtime.allocated == before
