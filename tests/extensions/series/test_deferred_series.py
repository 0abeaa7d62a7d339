"""Series of deferred VDIs: their steps are those of ``generate``, their look is chosen later."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError

pytestmark = pytest.mark.filterwarnings("ignore:the transfer function shows values outside")

SIZE, RANGE = (24, 16), (20, 180)
TIMES = (0.0, 0.5, 2.0, 4.0)
KEPT = {
    "classification": "deferred",
    "value_range": RANGE,
}
LOOK = {"cmap": "bone", "opacity": [0, 0.2, 0.8], "clim": (40, 170)}


def volumes():
    """Of which the last is as the one before it, and half of all does not change."""
    still = np.random.default_rng(1).integers(0, 200, (8, 9, 10)).astype(np.uint8)
    for seed in (2, 3, 4, 4):
        moving = np.random.default_rng(seed).integers(0, 200, (8, 9, 10)).astype(np.uint8)
        yield pvdi.Volume(np.where(np.arange(10) < 5, still, moving), (1, 1, 2), name="a")


CAMERA = pvdi.Camera((4.5, -40, 20), (4.5, 4, 7), (0, 0, 1))


@pytest.fixture(scope="module")
def alone(default_runtime):
    return [pvdi.generate(volume, CAMERA, SIZE, precision="8-byte", **KEPT) for volume in volumes()]


@pytest.fixture(scope="module")
def saved(default_runtime, tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "run.vdis"
    with pvdi.SeriesWriter(path, CAMERA, SIZE, **KEPT) as out:
        for volume, time in zip(volumes(), TIMES, strict=True):
            out.append(volume, time)
    return path


def all_equal(series, others):
    return all(one.equals(other) for one, other in zip(series, others, strict=True))


def test_what_is_read_is_what_generate_makes_of_each_step(alone, saved, tmp_path):
    made = pvdi.generate_series(volumes(), CAMERA, SIZE, TIMES, **KEPT)
    for series in (made, pvdi.read(made.save(tmp_path / "made.vdis")), pvdi.read(saved)):
        assert (series.value_range, series.times) == (RANGE, TIMES)
        assert all_equal(series, alone)
        assert all(step.metadata == alone[k].metadata for k, step in enumerate(series))


def test_a_look_is_that_of_each_step_alone_and_of_one_range(alone, saved):
    shown = pvdi.read(saved).classified(**LOOK)
    assert shown.value_range is None
    assert shown.times == TIMES
    assert all_equal(shown, [step.classified(**LOOK) for step in alone])
    assert shown[1] is shown[1]  # made once
    shown = pvdi.read(saved).classified(cmap="bone")[2:]
    assert all_equal(shown, [step.classified(cmap="bone") for step in alone[2:]])
    with pytest.raises(InvalidVDIError, match="have colours already"):
        shown.classified(cmap="bone")
    with pytest.raises(TypeError, match="colourmap"):
        pvdi.read(saved).classified(colourmap="bone")
