"""Frames first, background work in turns between them: order, fairness, cancelling, no deadlock."""

from __future__ import annotations

import contextlib
import threading

import numpy as np
import pytest

from pyvista_vdi import device as ocl
from pyvista_vdi.device import runtime as runtime_module
from pyvista_vdi.device import scheduling as turns
from pyvista_vdi.device.scheduling import Turns
from pyvista_vdi.errors import Cancelled

#: Seconds after which a test that waits for another thread gives up: it would wait for ever.
PATIENCE = 600


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


# -- turns -----------------------------------------------------------------------------------------


def test_background_work_waits_for_the_end_of_a_frame():
    order, each = [], Turns()
    begun = threading.Event()

    def work():
        begun.set()
        with each.background(never):
            order.append("work")

    with each.foreground():
        thread = InThread(work)
        wait(begun)
        thread.join(3 * turns.POLL)
        order.append("frame")
    thread.value()
    assert order == ["frame", "work"]


def test_a_workers_clock_stands_still_while_a_frame_goes_first():
    each, held = Turns(), threading.Event()

    def work():
        with each.background(never):
            began = each.clock()
            held.set()
            while not each._arriving:  # the frame knocks
                pass
            before = each.clock() - began
            each._end_turn(each.worker)
            each._take_turn(each.worker)
            return before, each.clock() - began

    thread = InThread(work)
    wait(held)
    with each.foreground():
        began = each.clock()  # of no worker: seconds
        while each.clock() < began + 0.2:
            pass
    before, after = thread.value()
    # A frame of .2 s lies between the two: a tenth of it is for a busy machine
    assert 0 < before <= after < before + 0.02


def test_a_frame_waits_for_the_piece_in_progress_and_no_longer():
    order, each = [], Turns()
    piece, arrived = threading.Event(), threading.Event()

    def work():
        with each.background(never):
            piece.set()
            wait(arrived)
            while not each._arriving:  # the frame knocks
                pass
            order.append("piece")
            while order == ["piece"]:
                each.checkpoint()
            order.append("work")

    thread = InThread(work)
    wait(piece)
    arrived.set()
    with each.foreground():
        order.append("frame")
    thread.value()
    assert order == ["piece", "frame", "work"]


def test_frames_without_pause_leave_a_turn_each(monkeypatch):
    each, frames_before = Turns(), []
    monkeypatch.setattr(each, "_turn", lambda: 0.0)  # over at every checkpoint
    begun, done = threading.Event(), threading.Event()

    def work():
        with each.background(never):
            begun.set()
            for _ in range(20):
                while not each._arriving:  # a frame knocks
                    pass
                each.checkpoint()
                frames_before.append(frames)
        done.set()

    frames = 0
    thread = InThread(work)
    wait(begun)
    while not done.is_set() and frames < 10_000:
        with each.foreground():
            frames += 1
    assert done.is_set(), "background work does not get on"
    thread.value()
    assert frames_before == list(range(1, 21))


def test_a_turn_is_a_share_of_a_recent_frame_within_limits():
    each = Turns()
    assert each.checkpoint() == np.inf  # no background work
    with each.background(never):
        assert 0 < each.checkpoint() <= turns.FIRST_TURN
        for frame, longest in (
            (0.0001, turns.SHORTEST_TURN),
            (0.05, 0.05 * turns.SHARE),
            (10.0, turns.LONGEST_PIECE),
        ):
            each._recent.extend([frame] * turns.RECENT_FRAMES)
            assert 0 < each.checkpoint() <= longest


def test_pieces_follow_the_slowest_of_the_last():
    worker = turns.Worker(never)
    assert worker.piece("march", 0.01) is None
    worker.took("march", 1000, 0.001)
    worker.took("march", 1000, 0.01)
    assert worker.piece("march", 0.01) == int(1000 * turns.CAUTION)
    assert worker.piece("pack", 0.01) is None
    assert worker.piece("march", 1e-9) == 1
    for _ in range(turns.RECENT_PIECES):
        worker.took("march", 1000, 0.001)
    assert worker.piece("march", 0.01) == int(10000 * turns.CAUTION)


def test_frames_of_two_threads_are_side_by_side():
    each = Turns()
    both = threading.Barrier(2, timeout=PATIENCE)

    def frame():
        with each.foreground():
            both.wait()

    first, second = InThread(frame), InThread(frame)
    first.value()
    second.value()


def test_workers_take_turns_with_each_other():
    each = Turns()
    begun = threading.Barrier(3, timeout=PATIENCE)
    seen = []

    def work(name):
        begun.wait()
        with each.background(never):
            while len(set(seen)) < 2:  # without turns, the first would go on for ever
                seen.append(name)
                each.checkpoint()

    threads = [InThread(work, name) for name in "ab"]
    begun.wait()
    for thread in threads:
        thread.value()


def test_blocks_inside_blocks():
    each = Turns()
    with each.foreground(), each.foreground():
        assert each._frames == 1
        with pytest.raises(RuntimeError, match="inside a frame"), each.background(never):
            pass
    assert each._frames == 0
    with each.background(never):
        with each.foreground():  # part of the background work
            assert each._frames == 0
        with pytest.raises(RuntimeError, match="background work"), each.background(never):
            pass
    assert each.worker is None


def test_cancelled_work_ends_while_a_frame_waits_for_it():
    each = Turns()
    cancelled = threading.Event()

    def work():
        with each.background(cancelled.is_set):
            pytest.fail("no turn was free")

    with each.foreground():
        thread = InThread(work)
        cancelled.set()
        with pytest.raises(Cancelled):
            thread.value()
    assert not each._waiting
    with each.foreground():  # nothing is left that a frame would wait for
        pass


def test_cancelled_work_ends_at_its_next_checkpoint():
    each = Turns()
    with pytest.raises(Cancelled), each.background(lambda: True):
        each.checkpoint()
    assert each._holder is None


@pytest.mark.parametrize("error", [ValueError, Cancelled])
def test_errors_leave_nothing_behind(error):
    each = Turns()
    with pytest.raises(error), each.foreground(), each.aside():
        raise error
    with pytest.raises(error), each.background(never), each.aside():
        raise error
    assert (each._frames, each._arriving, len(each._waiting)) == (0, 0, 0)
    assert each._holder is None
    assert each.worker is None


def test_a_lock_is_handed_over_between_frame_and_work():
    """Each waits for what the other has: the frame for the lock, the work for the frame's end."""
    each, lock, held = Turns(), threading.Lock(), threading.Event()
    in_frame, order = threading.Event(), []

    def work():
        with each.background(never), each.holding(lock):
            held.set()
            each._end_turn(each.worker)
            wait(in_frame)
            each.checkpoint()
            order.append("work")

    def frame():
        wait(held)
        with each.foreground():
            in_frame.set()
            with each.holding(lock):
                order.append("frame")

    threads = [InThread(work), InThread(frame)]
    for thread in threads:
        thread.value()
    assert order == ["work", "frame"]
    assert not lock.locked()


# -- the runtime's launches and copies in turns ----------------------------------------------------

INDEX = """\
__kernel void index(__global uint *x, const uint wide)
{
    const uint i = get_global_id(1) * wide + get_global_id(0);
    x[i] += 1 + i;
}
"""
GROUP_SUM = """\
__kernel void group_numbers(__global uint *x)
{
    x[get_global_id(0)] = get_group_id(0) * 1000 + get_num_groups(0);
}
"""

CHASE = """\
__kernel void chase(__global const uint *next, __global uint *end, const uint steps)
{
    uint at = get_global_id(0);
    for (uint step = 0; step < steps; ++step)
        at = next[at];
    end[get_global_id(0)] = at;
}
"""


@pytest.fixture
def kernels(tmp_path):
    (tmp_path / "index.cl").write_text(INDEX)
    (tmp_path / "chase.cl").write_text(CHASE)
    (tmp_path / "group.cl").write_text(GROUP_SUM)
    return tmp_path


@pytest.mark.parametrize(
    ("size", "group"),
    [((40960,), (64,)), ((4097,), None), ((64, 96), (8, 4)), ((31, 50), None), ((64,), (64,))],
)
def test_launches_in_pieces_cover_everything_once(runtime, kernels, monkeypatch, size, group):
    monkeypatch.setattr(runtime_module, "_FIRST_GROUPS", 1)
    monkeypatch.setattr(turns.Worker, "piece", lambda *_: 2048)
    pieces = []
    monkeypatch.setattr(turns.Worker, "took", lambda self, kind, items, _: pieces.append(items))
    kernel = runtime.kernel(kernels / "index.cl", "index")
    assert kernel.divisible
    n = int(np.prod(size))
    with runtime.buffer((n,), np.uint32) as x:
        with runtime.background():
            runtime.fill(x, 0)
            runtime.launch(kernel, size, group, x, np.uint32(size[0]))
        np.testing.assert_array_equal(runtime.download(x), np.arange(1, n + 1))
    assert sum(pieces) == n
    assert n <= 4096 or len(pieces) > 1


def test_a_kernel_that_asks_for_its_groups_number_is_launched_whole(runtime, kernels, monkeypatch):
    monkeypatch.setattr(turns.Worker, "piece", lambda *_: 64)
    kernel = runtime.kernel(kernels / "group.cl", "group_numbers")
    with runtime.background(), runtime.buffer((640,), np.uint32) as x:
        runtime.launch(kernel, 640, 64, x)
        expected = np.repeat(np.arange(10), 64) * 1000 + 10
        np.testing.assert_array_equal(runtime.download(x), expected)


def test_copies_in_pieces(runtime, monkeypatch):
    monkeypatch.setattr(runtime_module, "_COPY_BYTES", 1024)
    rng = np.random.default_rng(3)
    array = rng.integers(0, 2**32, (11, 7, 13), dtype=np.uint32)
    unaligned = ocl.aligned_empty(array.size + 1, np.uint32)[1:].reshape(array.shape)
    unaligned[...] = array
    before = runtime.allocated
    with (
        runtime.background(),
        runtime.upload(unaligned) as uploaded,
        runtime.buffer(array.shape, np.uint32) as written,
    ):
        assert runtime.allocated - before == 2 * array.nbytes
        assert not uploaded.writable
        np.testing.assert_array_equal(runtime.download(uploaded), array)
        np.testing.assert_array_equal(runtime.download(uploaded, count=500), array.ravel()[:500])
        runtime.write(written, array)
        np.testing.assert_array_equal(runtime.download(written), array)
    assert runtime.allocated == before


def test_every_use_of_the_device_asks_whether_the_work_is_wanted(runtime, kernels):
    kernel = runtime.kernel(kernels / "index.cl", "index")
    array = np.zeros(2**21, np.uint32)
    unwanted = threading.Event()
    with runtime.background(unwanted.is_set), runtime.buffer(array.shape, np.uint32) as x:
        unaligned = ocl.aligned_empty(array.size + 1, np.uint32)[1:]
        before = runtime.allocated
        unwanted.set()
        errors = []  # kept, and with them what their frames hold
        for use in (
            lambda: runtime.launch(kernel, 64, 64, x, np.uint32(64)),
            lambda: runtime.write(x, array),
            lambda: runtime.download(x),
            lambda: runtime.upload(unaligned),
            runtime.give_way,
        ):
            with pytest.raises(Cancelled) as caught:
                use()
            errors.append(caught)
        assert runtime.allocated == before


def test_compiling_lets_frames_go_on(runtime, kernels, monkeypatch):
    compile_it = runtime._programs.kernel
    frames = []

    def compile_beside_a_frame(*args):
        frames.append(InThread(lambda: frame(runtime)).value())
        return compile_it(*args)

    monkeypatch.setattr(runtime._programs, "kernel", compile_beside_a_frame)
    with runtime.background():
        runtime.kernel(kernels / "index.cl", "index")
    assert frames == ["drawn"]


def frame(runtime):
    with runtime.foreground():
        return "drawn"


# -- queues ----------------------------------------------------------------------------------------


def ring():
    """Memory that a CPU uses in place: each element names the next of a ring of 64."""
    array = ocl.aligned_empty(64, np.uint32)
    array[...] = (np.arange(64) + 1) % 64
    return array


def test_memory_in_place_knows_the_queues_that_read_it(runtime, kernels, monkeypatch):
    kernel = runtime.kernel(kernels / "chase.cl", "chase")
    finish, finished = runtime._finish, []

    def noted(numbers):
        finished.append(set(numbers))
        finish(numbers)  # a kernel that still runs when its memory is freed corrupts the heap

    with runtime.upload(ring()) as shared, runtime.buffer((64,), np.uint32) as own:
        launch = (kernel, 64, 64, shared, own, np.uint32(1))
        assert own.readers is None
        assert shared.readers == (set() if runtime.is_cpu else None)
        if not runtime.is_cpu:
            return
        with runtime.queue_scope():
            inner = runtime._queue_number
            runtime.launch(*launch)
            assert shared.readers == {inner}
        runtime.launch(*launch)
        assert shared.readers == {runtime._main_queue}  # the other queue is gone
        monkeypatch.setattr(runtime, "_finish", noted)
        shared.release()
    assert finished == [{runtime._main_queue}]


@pytest.mark.parametrize("own_queue", [False, True])
def test_memory_in_place_is_free_when_its_buffer_is_released(runtime, kernels, own_queue):
    """Whatever thread releases it, and whichever queue reads it."""
    kernel = runtime.kernel(kernels / "chase.cl", "chase")
    array, steps = ring(), 2**20  # tens of milliseconds: the kernel runs when release() is called
    with (
        runtime.buffer((64,), np.uint32) as end,
        runtime.queue_scope() if own_queue else contextlib.nullcontext(),
    ):
        shared = runtime.upload(array)
        runtime.launch(kernel, 64, 64, shared, end, np.uint32(steps))
        InThread(shared.release).value()
        array[...] = 0  # in place of freeing it, which would crash some time later, or not
        np.testing.assert_array_equal(runtime.download(end), (np.arange(64) + steps) % 64)


def test_a_thread_waits_for_its_own_queue_only(runtime, monkeypatch):
    class Queue:
        def __init__(self):
            self.finished = 0

        def finish(self):
            self.finished += 1

    main, inner = Queue(), Queue()
    monkeypatch.setattr(runtime, "_queues", {runtime._main_queue: main, -1: inner})
    runtime.finish()
    assert (main.finished, inner.finished) == (1, 0)
    monkeypatch.setattr(runtime._local, "queue_number", -1, raising=False)
    runtime.finish()
    assert (main.finished, inner.finished) == (1, 1)
