"""Series of deferred VDIs: their steps are those of ``generate``, their look is chosen later."""

from __future__ import annotations

import json
import pickle
import shutil

import numpy as np
import pytest
from command_line import run

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVDIError,
    UnsupportedError,
    VDIFileError,
)

pytestmark = pytest.mark.filterwarnings("ignore:the transfer function shows values outside")

SIZE, RANGE = (24, 16), (20, 180)
TIMES = (0.0, 0.5, 2.0, 4.0)
KEPT = {
    "classification": "deferred",
    "value_range": RANGE,
    "settings": pvdi.Settings(importance=[1, 2]),
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


@pytest.mark.parametrize("precision", ["8-byte", "exact"])
def test_what_is_read_is_what_generate_makes_of_each_step(precision, alone, saved, tmp_path):
    made = pvdi.generate_series(volumes(), CAMERA, SIZE, TIMES, precision=precision, **KEPT)
    path = made.save(tmp_path / "made.vdis")
    for series in (made, pvdi.read(path), *((pvdi.read(saved),) * (precision == "8-byte"))):
        assert (series.value_range, series.times) == (RANGE, TIMES)
        assert all(isinstance(step, pvdi.DeferredVDI) for step in series)
        if precision == "8-byte":
            assert all_equal(series, alone)
            assert all(step.metadata == alone[k].metadata for k, step in enumerate(series))
        else:
            assert all_equal(series, made)
    assert "20 to 180" in repr(series)
    assert all_equal(pvdi.VDISeries(alone)[1:3], alone[1:3])


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


def test_it_is_pickled_by_the_name_of_its_file(alone, saved, tmp_path, monkeypatch):
    def again(series):
        return pickle.loads(pickle.dumps(series))

    with monkeypatch.context() as elsewhere:
        elsewhere.chdir(saved.parent)
        series = pvdi.read(saved.name)
    assert len(pickle.dumps(series)) < 1000
    assert again(series).times == TIMES
    assert all_equal(again(series), alone)
    assert all_equal(again(series[1:3]), alone[1:3])
    shown = [step.classified(**LOOK) for step in alone]
    assert all_equal(again(series.classified(**LOOK)), shown)
    assert all_equal(again(series.classified(**LOOK)[2:]), shown[2:])
    moved = pvdi.read(saved).save(tmp_path / "moved.vdis")
    pickled = pickle.dumps(pvdi.read(moved))
    moved.unlink()
    with pytest.raises(VDIFileError, match=r"moved\.vdis cannot be read"):
        pickle.loads(pickled)


def test_without_a_range_that_of_the_first_step_is_all_s(default_runtime):
    series = pvdi.generate_series(
        [pvdi.Volume(np.arange(64.0).reshape(4, 4, 4) * k) for k in (1, 2)],
        CAMERA,
        SIZE,
        classification="deferred",
    )
    assert [step.value_range for step in series] == [(0, 63), (0, 63)]


def test_a_run_goes_on_with_values_of_the_same_range_only(alone, saved, tmp_path):
    path = shutil.copytree(saved, tmp_path / "run.vdis")
    with pvdi.SeriesWriter(path, append=True) as out:
        out.append(alone[0], 5.0)
    assert all_equal(pvdi.read(path), [*alone, alone[0]])
    other = pvdi.generate(next(volumes()), CAMERA, SIZE, classification="deferred")
    colours = alone[0].classified(transfer_function=pvdi.TransferFunction([[1] * 3], [1], RANGE))
    with pvdi.SeriesWriter(path, append=True) as out:
        for step, has in ((other, r"\(0\.0, 199\.0\)"), (colours, "None")):
            with pytest.raises(
                InvalidArgumentError, match=rf"value_range is \(20\.0, 180\.0\).*step {has}"
            ):
                out.append(step, 6.0)
    with pvdi.SeriesWriter(tmp_path / "mixed.vdis") as out:
        out.append(colours)
        with pytest.raises(InvalidVDIError, match="keeps values from 20"):
            out.append(alone[0])
    with pytest.raises(InvalidVDIError, match="number 1 keeps values from 0"):
        pvdi.VDISeries([alone[0], other])


@pytest.mark.parametrize(
    ("kept", "says"),
    [
        ({"settings": pvdi.Settings(importance=[1, -1])}, "importance must be"),
        (
            {"value_range": RANGE, "settings": pvdi.Settings(importance=[(0, 0), (300, 0)])},
            "importance is 0 over all",
        ),
        ({"settings": pvdi.Settings(importance="much")}, "importance must be.*much"),
        ({"ambient_occlusion": pvdi.AmbientOcclusion()}, "ambient occlusion follows"),
    ],
)
def test_what_cannot_be_kept_is_refused_before_a_step_is_written(kept, says, tmp_path):
    path = tmp_path / "a.vdis"
    with (
        pvdi.SeriesWriter(path, CAMERA, SIZE, classification="deferred", **kept) as out,
        pytest.raises((InvalidArgumentError, UnsupportedError), match=says),
    ):
        out.append(next(volumes()))
    assert not list(path.glob("*.vdi"))
    with pytest.raises(InvalidArgumentError, match=r"value_range must be.*\(3, 1\)"):
        pvdi.SeriesWriter(path, CAMERA, SIZE, classification="deferred", value_range=(3, 1))


def test_a_run_goes_on_with_the_same_importance_only(alone, saved, tmp_path):
    path = shutil.copytree(saved, tmp_path / "run.vdis")
    with (
        pvdi.SeriesWriter(path, CAMERA, SIZE, append=True, **KEPT | {"settings": None}) as out,
        pytest.raises(InvalidArgumentError, match=r"importance is \(\(20\.0, 1\.0\), .*None"),
    ):
        out.append(next(volumes()), 9.0)
    assert len(pvdi.read(path)) == 4
    with pvdi.SeriesWriter(path, CAMERA, SIZE, append=True, **KEPT) as out:
        out.append(next(volumes()), 9.0)
    assert len(pvdi.read(path)) == 5


def test_what_needs_colours_is_refused_by_name(alone, tmp_path):
    series = pvdi.VDISeries(alone)
    with pytest.raises(InvalidVDIError, match="no colours yet"):
        series.save(tmp_path / "run.html")
    for vdis in (series, series.classified(**LOOK)):
        for name in ("run.vdis", "run.html"):
            with pytest.raises(InvalidArgumentError, match="cmap, opacity: .*classified"):
                vdis.save(tmp_path / name, cmap="bone", opacity="linear")
    with pytest.raises(InvalidArgumentError, match="cmap"):
        pvdi.generate_series(volumes(), CAMERA, SIZE, cmap="bone", **KEPT)
    with pytest.raises(UnsupportedError, match="quality"):
        pvdi.SeriesWriter(tmp_path / "run.vdis", CAMERA, SIZE, quality="high", **KEPT)
    assert not list(tmp_path.iterdir())
    assert set(series._repr_mimebundle_()) == {"text/plain"}


def test_verbs_write_show_and_convert_it(saved, alone, tmp_path, capsys):
    for k, volume in enumerate(volumes()):
        np.save(tmp_path / f"step_{k}.npy", volume.array)
    out = tmp_path / "out.vdis"
    files = sorted(tmp_path.glob("*.npy"))
    asked = ("--size", "24x16", "--classification", "deferred", "--value-range", *RANGE)
    run(capsys, "series", *files, "-o", out, "--spacing", 1, 1, 2, *asked)
    assert pvdi.read(out).value_range == RANGE
    run(capsys, "convert", saved, "-o", tmp_path / "again.vdis")
    assert all_equal(pvdi.read(tmp_path / "again.vdis"), alone)
    assert "values from 20 to 180, classified afterwards" in run(capsys, "info", saved)
    assert json.loads(run(capsys, "info", saved, "--json"))["deferred"]["value_range"] == list(
        RANGE
    )
    look = ("--cmap", "bone", "--opacity", "0,0.2,0.8", "--clim", 40, 170)
    run(capsys, "convert", saved, "-o", tmp_path / "bone.vdis", *look)
    shown = [step.classified(**LOOK) for step in alone]
    assert all_equal(pvdi.read(tmp_path / "bone.vdis"), shown)
    run(capsys, "convert", saved, "-o", tmp_path / "one.vdi")
    assert pvdi.read(tmp_path / "one_0003.vdi").equals(alone[3])
    run(capsys, "render", saved, "--time", 2, "-o", tmp_path / "two.png", *look)
    assert (tmp_path / "two.png").stat().st_size > 100
