"""Work in the background: VDIs of the same bytes, nothing mixed, nothing left behind."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume, request
from fresh_python import run_python

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.device import scheduling as turns
from pyvista_vdi.quality.background import BackgroundThread, Job, vdi_job
from pyvista_vdi.volume.upload import uploads_of

#: Seconds after which a test that waits for the thread gives up: it would wait for ever.
PATIENCE = 120

NAME = "pyvista-vdi generation"
WINDOW = (45, 34)
TRANSFER = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 100), interpolation="linear")
CAMERA = Camera((9.5, 9.5, 60), (9.5, 9.5, 9.5), (0, 1, 0))


def volume(dtype="f4"):
    values = np.random.default_rng(11).random((20, 20, 20)) * 100
    return Volume(values.astype(dtype))


def threads():
    return [thread for thread in threading.enumerate() if thread.name == NAME]


@pytest.fixture
def background():
    made = BackgroundThread(NAME)
    yield made
    made.close()
    made.join()
    assert not threads()


def taken(background):
    """What ``take`` gives or raises when the job is done."""
    deadline = time.monotonic() + PATIENCE
    while background.running:
        assert time.monotonic() < deadline, "the job does not end"
        time.sleep(0.001)
    return background.take()


class Held:
    """A job that waits in its middle until it is let go; it makes its key."""

    def __init__(self, runtime, key):
        self.begun, self.go_on = threading.Event(), threading.Event()
        self.job = Job(self._work, runtime, key)

    def _work(self, runtime, report):
        report(0.4)
        self.begun.set()
        assert self.go_on.wait(PATIENCE)
        return self.job.key


@pytest.mark.parametrize(("dtype", "parallel"), [("f4", False), ("f8", True)])
def test_the_same_bytes(runtime, background, dtype, parallel):
    """As generate_vdi, which does not work in pieces; of a volume that is not there yet, too."""
    camera = CAMERA.replace(parallel_projection=parallel, parallel_scale=15.0)
    # Little enough that a slice of a VDI is four rows of lists
    options = {"max_supersegments": 6, "memory_limit": 2**22, "device": runtime}
    background.put(vdi_job(request(volume(dtype), camera, WINDOW, TRANSFER, **options)))
    made = taken(background)
    expected = generate_vdi(
        volume(dtype), camera, WINDOW, TRANSFER, max_supersegments=6, device=runtime
    )
    assert made.equals(expected)
    assert made.n_supersegments > np.prod(WINDOW)
    assert not threads(), "it ends by itself"


def test_an_error_is_raised_once(runtime, background):
    background.put(Job(lambda *_: [][0], runtime))
    with pytest.raises(IndexError):
        taken(background)
    assert (background.running, background.job, background.take()) == (False, None, None)


def test_closing_waits_for_what_is_being_done(runtime):
    background, held = BackgroundThread(NAME), Held(runtime, "a")
    background.put(held.job)
    assert held.begun.wait(PATIENCE)
    background.close()
    closing = threading.Thread(target=background.join)
    closing.start()
    assert threads()
    assert closing.is_alive()
    held.go_on.set()
    closing.join(PATIENCE)
    assert not threads()
    assert background.take() is None
    with pytest.raises(RuntimeError, match="closed"):
        background.put(held.job)


def test_the_interpreter_ends_in_the_middle(runtime):
    code = f"""
import numpy as np
from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.quality.background import BackgroundThread, vdi_job
background = BackgroundThread("pyvista-vdi generation")
volume = Volume(np.random.default_rng(0).random((100, 100, 100)).astype("f4"))
transfer = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 1))
camera = Camera((50, 50, 300), (50, 50, 50), (0, 1, 0))
request = GenerationRequest(volume, transfer, camera, (1280, 720), device={runtime.info.selector!r})
background.put(vdi_job(request))
while background.running and not background.progress:
    pass
assert background.running
"""
    done = run_python(code)
    heard = done.stderr.removeprefix("SYCL CPU RT Warning: Unknown host CPU.\n")  # an old driver's
    assert (done.returncode, done.stdout, heard) == (0, "", "")


def test_a_volume_that_both_threads_need_first(runtime, background, monkeypatch):
    """One uploads it, and neither waits for the other's frame or turn for ever."""
    for limit in ("SHORTEST_TURN", "SHARE"):
        monkeypatch.setattr(turns, limit, 1e-9)  # a turn is over within any piece of work
    scene = Volume(np.random.default_rng(0).random((100, 100, 100)))
    seen = Camera((50, 50, 300), (50, 50, 50), (0, 1, 0)), WINDOW
    transfer = TRANSFER.replace(scalar_range=(0, 1))
    background.put(vdi_job(request(scene, *seen, transfer, device=runtime)))
    while background.running and not uploads_of(scene).lock.locked():
        pass  # the worker comes first, or not at all
    image = None
    while background.running or image is None:
        with runtime.foreground():
            image = raycast_volume(scene, *seen, transfer, device=runtime)
    assert background.take().equals(generate_vdi(scene, *seen, transfer, device=runtime))
    np.testing.assert_array_equal(image, raycast_volume(scene, *seen, transfer, device=runtime))
