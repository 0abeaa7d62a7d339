"""VDIs made in the background: the same bytes, nothing mixed, nothing left behind."""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume, render_vdi, request
from fresh_python import run_python

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.device import scheduling as turns
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.generation import generate
from pyvista_vdi.quality import background
from pyvista_vdi.quality.background import BackgroundThread, vdi_job
from pyvista_vdi.volume.upload import uploads_of

#: Seconds after which a test that waits for the thread gives up: it would wait for ever.
PATIENCE = 120

WINDOW = (45, 34)
THREAD_NAME = "pyvista-vdi generation"


def scene(dtype="f4", points=20):
    rng = np.random.default_rng(11)
    volume = Volume((rng.random((points,) * 3) * 100).astype(dtype))
    centre = (points - 1) / 2
    camera = Camera((centre, centre, 3 * points), (centre,) * 3, (0, 1, 0))
    return volume, camera


VOLUME, CAMERA = scene()
TRANSFER = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 100), interpolation="linear")
OPTIONS = {"max_supersegments": 6}
#: Little enough that a slice of a VDI is four rows of lists, enough for the volume in one piece.
IN_SLICES = {**OPTIONS, "memory_limit": "4 MiB"}


def make(runtime, camera=CAMERA, **options):
    return generate_vdi(VOLUME, camera, WINDOW, TRANSFER, device=runtime, **OPTIONS, **options)


def start(generator, camera=CAMERA, key=None, **options):
    asked = request(VOLUME, camera, WINDOW, TRANSFER, **IN_SLICES, **options)
    begin(generator, asked, key)


def begin(generator, asked, key=None):
    generator.put(vdi_job(asked.replace(device=generator.device), key=key))


def key_of(generator):
    return None if generator.job is None else generator.job.key


def cancel(generator):
    """Cancel, and wait for the thread."""
    generator.clear()
    generator.join()


def new_generator(runtime):
    generator = BackgroundThread(THREAD_NAME)
    generator.device = runtime
    return generator


def finish(generator):
    deadline = time.monotonic() + PATIENCE
    while generator.running:
        assert time.monotonic() < deadline, "the generation does not end"
        time.sleep(0.001)


def taken(generator):
    """What ``take`` gives or raises when the generation has ended."""
    finish(generator)
    return generator.take()


def threads():
    return [thread for thread in threading.enumerate() if thread.name == THREAD_NAME]


@pytest.fixture
def generator(runtime):
    made = new_generator(runtime)
    yield made
    made.close()
    made.join()
    assert not threads()


def memory_in_use(runtime):
    gc.collect()
    return runtime.allocated


@pytest.fixture
def before(runtime):
    """Bytes on the device when the volume is there and nothing is made of it."""
    make(runtime)
    return memory_in_use(runtime)


class Gate:
    """Holds a generation in its middle until it is opened; ``cancelled`` are those given up."""

    def __init__(self, monkeypatch):
        self.reached, self._open = threading.Event(), threading.Event()
        self.cancelled = []
        monkeypatch.setattr(background, "generate_vdi", self._gated)

    def _gated(self, asked):
        def report(fraction):
            asked.progress(fraction)
            if fraction >= 0.4 and not self.reached.is_set():
                self.reached.set()
                self._open.wait(PATIENCE)

        try:
            return generate.generate_vdi(asked.replace(progress=report))
        except Cancelled as reason:
            self.cancelled.append(str(reason))
            raise

    def wait(self):
        assert self.reached.wait(PATIENCE)

    def open(self):
        self._open.set()


@pytest.fixture
def gate(monkeypatch):
    made = Gate(monkeypatch)
    yield made
    made.open()


@pytest.mark.parametrize(
    ("dtype", "parallel"),
    [("f4", False), ("f8", True), pytest.param("u1", False, marks=pytest.mark.slow)],
)
def test_the_same_bytes(runtime, generator, dtype, parallel):
    """As generate_vdi, which does not work in pieces; of a volume that is not there yet, too."""
    volume, camera = scene(dtype)
    camera = camera.replace(parallel_projection=parallel, parallel_scale=15.0)
    begin(generator, request(volume, camera, WINDOW, TRANSFER, **IN_SLICES, metadata={"a": 1}))
    made = taken(generator)
    expected = generate_vdi(
        scene(dtype)[0], camera, WINDOW, TRANSFER, device=runtime, **OPTIONS, metadata={"a": 1}
    )
    assert made.equals(expected)
    assert made.metadata == expected.metadata
    assert made.n_supersegments > np.prod(WINDOW)
    images = [render_vdi(vdi, camera.azimuth(20), device=runtime) for vdi in (made, expected)]
    np.testing.assert_array_equal(*images)


def test_cancelling_in_the_middle(runtime, generator, before, gate):
    start(generator)
    gate.wait()
    assert runtime.allocated > before
    generator.clear()
    assert (generator.running, key_of(generator), generator.progress) == (False, None, None)
    gate.open()
    cancel(generator)
    assert not threads()
    assert memory_in_use(runtime) == before
    assert generator.take() is None
    start(generator)
    assert taken(generator).equals(make(runtime))


def test_closing_in_the_middle(runtime, gate):
    generator = new_generator(runtime)
    start(generator)
    gate.wait()
    closing = threading.Thread(target=lambda: (generator.close(), generator.join()))
    closing.start()
    finish(generator)  # it is cancelled, and waited for
    assert closing.is_alive()
    gate.open()
    closing.join(PATIENCE)
    assert len(gate.cancelled) == 1
    assert not threads()
    generator.close()
    with pytest.raises(RuntimeError, match="closed"):
        start(generator)
    assert generator.take() is None


def test_the_interpreter_ends_in_the_middle(runtime):
    code = f"""
import numpy as np
from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.generation import generate
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.quality.background import BackgroundThread, vdi_job
generator = BackgroundThread("pyvista-vdi generation")
volume = Volume(np.random.default_rng(0).random((100, 100, 100)).astype("f4"))
transfer = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 1))
camera = Camera((50, 50, 300), (50, 50, 50), (0, 1, 0))
request = GenerationRequest(volume, transfer, camera, (1280, 720), device={runtime.info.selector!r})
generator.put(vdi_job(request))
while generator.running and not generator.progress:
    pass
assert generator.running
"""
    done = run_python(code)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_volume_that_both_threads_need_first(runtime, generator, monkeypatch):
    """One uploads it, and neither waits for the other's frame or turn for ever."""
    for limit in ("FIRST_TURN", "SHORTEST_TURN", "SHARE"):
        monkeypatch.setattr(turns, limit, 1e-9)  # a turn is over within any piece of work
    for seed in range(2):
        volume = Volume(np.random.default_rng(seed).random((100, 100, 100)))
        transfer = TRANSFER.replace(scalar_range=(0, 1))
        camera = Camera((50, 50, 300), (50, 50, 50), (0, 1, 0))
        begin(generator, request(volume, camera, WINDOW, transfer))
        while generator.running and not uploads_of(volume).lock.locked():
            pass  # the worker comes first, or not at all
        image = None
        while generator.running or image is None:
            with runtime.foreground():
                image = raycast_volume(volume, camera, WINDOW, transfer, device=runtime)
        vdi = generator.take()
        assert vdi.equals(generate_vdi(volume, camera, WINDOW, transfer, device=runtime))
        np.testing.assert_array_equal(
            image, raycast_volume(volume, camera, WINDOW, transfer, device=runtime)
        )
