"""A series that plays: which step is shown when, by a clock that stands still between looks."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Sequence

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.extensions.series.shown import SeriesInput

#: Seconds after which something that should have happened has not.
LONG = 600.0
N = 8


def _vdi(k):
    camera = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    color = [[k / N, 0.5, 0.0]]
    return pvdi.VDI(camera, (1, 1), [0, 1], [4.0], [6.0], color, [2.0], (-1, 1, -1, 1, -1, 1))


class Clock:
    """Seconds that pass when the test says so."""

    now = 100.0

    def __call__(self):
        return self.now


class Steps(Sequence):
    """Steps that count how often they are decoded, take their time, or are damaged.

    ``living`` are those that somebody holds: each is made anew when it is asked for.
    """

    def __init__(self, clock):
        self.vdis = [_vdi(k) for k in range(N)]
        self.asked, self.made = [], []
        self.seconds, self.damaged, self._clock = 0.0, (), clock

    def __len__(self):
        return N

    def __getitem__(self, k):
        self.asked.append(k)
        self._clock.now += self.seconds
        if k in self.damaged:
            raise VDIFileError(f"step {k} is damaged")
        vdi = _vdi(k)
        self.made.append(weakref.ref(vdi))
        return vdi

    def living(self):
        _settled()
        return sum(made() is not None for made in self.made)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def steps(clock):
    return Steps(clock)


@pytest.fixture
def player(steps, clock, default_runtime):
    player = SeriesInput(pvdi.VDISeries(steps, np.arange(N) * 0.5), clock)
    yield player
    player.rest()


def _settled():
    """Wait until the thread has decoded all that it wants now: then it ends."""
    end = time.monotonic() + LONG
    while any(thread.name == "pyvista-vdi series" for thread in threading.enumerate()):
        assert time.monotonic() < end, "it has not ended"
        time.sleep(0.001)


def look(player, clock, seconds=0.1001):
    """Go on by some seconds when all is ready; by default a little more than a tenth."""
    _settled()
    clock.now += seconds
    return player.advance()


def test_every_step_is_shown_when_it_is_due(player, steps, clock):
    player.time = 1.1
    assert player.step == 2
    player.step = -N
    player.play(rate=10)
    player.advance()
    shown = []
    for _ in range(2 * N):
        _settled()
        assert not player.advance()  # not yet
        assert look(player, clock)
        shown.append(player.step)
        assert player.vdi().equals(steps.vdis[player.step])
    assert shown == [(1 + k) % N for k in range(2 * N)]


def test_what_is_decoded_slowly_is_shown_in_its_time(player, steps, clock):
    steps.seconds = 0.25  # two and a half steps
    player.memory = 0
    player.play(rate=10)
    began = clock.now
    late = []
    for _ in range(12):
        player.advance()
        _settled()
        clock.now += 0.0001
        looked = clock.now  # the thread may go on when it has been shown
        if player.advance():
            late.append(((looked - began) * 10 - player.step) % N)
    # The first is decoded before it is known what one takes; then a step is shown while it is due,
    # which is for one step's time, and the look comes .001 of it later
    assert len(late) > 3
    assert max(late[1:]) < 1.001


def test_a_damaged_step_is_told_once_and_left_out(player, steps, clock):
    steps.damaged = (2,)
    player.play(rate=10)
    player.advance()
    told, shown = [], set()
    for _ in range(2 * N):
        try:
            look(player, clock)
        except VDIFileError as error:
            told.append(str(error))
        shown.add(player.step)
    assert told == ["step 2 is damaged"]
    assert shown == {0, 1, 3, 4, 5, 6, 7}


@pytest.mark.parametrize("kept", [N, 6])
def test_what_is_kept_is_not_decoded_in_the_next_round(player, steps, clock, kept):
    taken = steps.vdis[0].nbytes * 2.2
    player.play(rate=10, memory_limit=int(kept * taken))
    player.advance()
    for turn in range(3 * N):
        if turn == 2 * N:
            steps.asked.clear()
        assert look(player, clock)
        assert steps.living() <= kept + 1  # that which was shown
        assert player.vdi().equals(steps.vdis[player.step])
    # Of a round that does not fit, some are the same in each
    assert len(steps.asked) == 0 if kept == N else len(set(steps.asked)) < N
