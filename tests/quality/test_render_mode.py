"""The choice between VDI and volume, by what frames have taken before."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.render_options import checked_draw
from pyvista_vdi.quality import render_mode
from pyvista_vdi.quality.frame_state import Costs, FrameTook

pytestmark = pytest.mark.fast

PIXELS = 1e6
TARGET = 1 / 30  # seconds
#: Milliseconds of a frame: a VDI's at V_O, and a volume's from anywhere.
VDI, VOLUME = 20.0, 200.0


class Costing:
    """What frames have taken so far, and what is chosen by it."""

    def __init__(self):
        self.costs = Costs()

    def took(self, *frame):
        self.costs = render_mode.took(self.costs, FrameTook(*frame))

    def choose(self, *view, **options):
        self.costs, way = render_mode.choose(self.costs, *view, **options)
        return way

    def seconds_per_pixel(self, way, angle):
        return render_mode.seconds_per_pixel(self.costs, way, angle)


def used(vdi=VDI, volume=VOLUME):
    ways = Costing()
    ways.took("vdi", 0.0, PIXELS, vdi / 1e3)
    ways.took("volume", 0.0, PIXELS, volume / 1e3)
    return ways


def test_the_vdi_until_both_are_known():
    ways = Costing()
    assert ways.choose(90.0, PIXELS, TARGET) == "vdi"
    ways.took("volume", 0.0, PIXELS, 1e-3)
    assert ways.choose(90.0, PIXELS, TARGET) == "vdi"
    ways.took("vdi", 90.0, PIXELS, 1.0)
    assert ways.choose(90.0, PIXELS, TARGET) == "volume"


@pytest.mark.parametrize(
    ("times", "angle", "seconds", "options", "way"),
    [
        ({}, 0.0, TARGET, {}, "vdi"),
        ({}, 60.0, TARGET, {}, "volume"),
        # What missing pixels lose is weighed against what the VDI loses; 24 ms at 30 degrees: all
        # pixels within the target
        ({"vdi": 1.0}, 30.0, TARGET, {"ssim": 0.99}, "vdi"),
        ({"vdi": 1.0}, 30.0, TARGET, {"ssim": 0.90}, "volume"),
        # Both too slow: the faster
        ({"vdi": 1e4, "volume": 1e5}, 0.0, TARGET, {}, "vdi"),
        ({"vdi": 1e4, "volume": 1e5}, 90.0, TARGET, {}, "volume"),
        # At rest, what does and is there sooner
        ({}, 0.0, None, {"ssim": 0.99, "bound": 0.95}, "vdi"),
        ({}, 60.0, None, {"ssim": 0.99, "bound": 0.95}, "volume"),
        ({}, 0.0, None, {"ssim": 0.90, "bound": 0.95}, "volume"),
    ],
)
def test_what_is_drawn(times, angle, seconds, options, way):
    ways = used(**times)
    assert ways.choose(angle, PIXELS, seconds, **options) == way
    if not options:
        assert ways.choose(0.0, PIXELS, seconds) == "vdi"  # back there


def test_nothing_flickers_where_both_are_as_good():
    """Frames take a fifth more or less than expected, by chance: at most one change."""
    rng = np.random.default_rng(7)
    ways, seen = used(), []
    equal = next(a for a in range(91) if ways.choose(a, PIXELS, TARGET) == "volume")
    ways = used()
    true = {way: ways.seconds_per_pixel(way, equal) for way in ("vdi", "volume")}
    for _ in range(300):
        way = ways.choose(equal, PIXELS, TARGET)
        seen.append(way)
        each = true[way]
        ways.took(way, equal, PIXELS, PIXELS * each * rng.uniform(0.83, 1.2))
    assert sum(a != b for a, b in itertools.pairwise(seen)) <= 1


def test_frames_correct_what_was_expected():
    ways = used()
    for _ in range(12):
        ways.took("vdi", 30.0, PIXELS, 5e-3)
    assert ways.seconds_per_pixel("vdi", 30.0) * PIXELS == pytest.approx(5e-3, rel=0.01)
    # As measured where it was measured, and by the shape of the rise elsewhere
    assert ways.seconds_per_pixel("vdi", 0.0) * PIXELS == pytest.approx(VDI / 1e3)
    assert ways.seconds_per_pixel("vdi", 35.0) > ways.seconds_per_pixel("vdi", 30.0)
    ways.took("vdi", 30.0, 0, 5.0)
    ways.took("vdi", 30.0, PIXELS, 0.0)
    assert ways.seconds_per_pixel("vdi", 30.0) * PIXELS == pytest.approx(5e-3, rel=0.01)


@pytest.mark.parametrize("draw", ["VDI", None, 1])
def test_other_words_are_refused(draw):
    with pytest.raises(InvalidArgumentError, match="draw must be 'auto', 'vdi' or 'volume'"):
        checked_draw(draw)
