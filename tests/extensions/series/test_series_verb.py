"""The verb ``series``, and ``info`` and ``convert`` of what it writes."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import run

import pyvista_vdi as pvdi
from pyvista_vdi import cli


@pytest.fixture(scope="module")
def volumes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("volumes")
    z, y, x = np.mgrid[:8, :9, :10]
    for k in range(3):
        np.save(folder / f"step_{k}.npy", (x + y * z + 5 * k).astype(np.uint8))
    return sorted(folder.glob("*.npy"))


@pytest.fixture(scope="module")
def series(volumes, tmp_path_factory, default_runtime):
    pytest.importorskip("pyvista")
    path = tmp_path_factory.mktemp("series") / "run.vdis"
    looks = ("--size", "24x16", "--cmap", "bone", "--clim", "0", "80", "--spacing", "1", "1", "2")
    arguments = ["series", *volumes, "-o", path, "--times", "0,0.5,2", *looks]
    assert cli.main([str(argument) for argument in arguments]) == 0
    return path


#: Values of three steps, which rise.
VALUES = (60, 120, 180)
STEPS = np.stack([np.full((6, 7, 8), value, np.uint8) for value in VALUES])


def _store(folder):
    zarr = pytest.importorskip("zarr")
    array = zarr.open(
        str(folder / "t.zarr"), mode="w", shape=STEPS.shape, chunks=(1, 4, 4, 4), dtype="u1"
    )
    array.attrs["_ARRAY_DIMENSIONS"] = list("tzyx")
    array[:] = STEPS
    return ["t.zarr"]


def _arrays(folder):
    names = [f"Step{number}.npy" for number in (8, 9, 10)]
    for name, values in zip(names, STEPS, strict=True):
        np.save(folder / name, values)
    return sorted(names)


KINDS = {
    "a store of named axes": (_store, [0, 1, 2]),
    "numbers in names": (_arrays, [0, 1, 2]),
}
LOOK = ("--size", "12x9", "--cmap", "gray", "--opacity", "linear", "--clim", "0", "255")


@pytest.mark.filterwarnings("ignore:.*axes with coordinates, which are not read")
@pytest.mark.parametrize(("make", "times"), KINDS.values(), ids=KINDS)
def test_all_time_steps_come_in_their_order(make, times, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = make(tmp_path)
    run(capsys, "series", *files, "-o", "run.vdis", *LOOK)
    steps = pvdi.read("run.vdis")
    assert list(steps.times) == times
    assert [round(255 * float(vdi.color.mean())) for vdi in steps] == pytest.approx(VALUES, abs=2)


def test_a_step_is_shown_by_its_time(series, capsys, tmp_path):
    pytest.importorskip("pyvista")
    steps = pvdi.read(series)
    for k, time in enumerate(("0.1", "0.4", "9")):
        drawn, single = tmp_path / f"{k}.png", tmp_path / f"{k}s.png"
        steps[k].save(tmp_path / "step.vdi")
        run(capsys, "render", series, "-o", drawn, "--time", time)
        run(capsys, "render", tmp_path / "step.vdi", "-o", single)
        assert drawn.read_bytes() == single.read_bytes()
    drawn = tmp_path / "viewed.png"
    run(capsys, "view", series, "--screenshot", drawn, "--time", "0.4", "--size", "80x60")
    assert drawn.stat().st_size > 200


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("series {0} {vdi} -o x.vdis", "not some of each"),
        ("series {0} {1} -o x.vdis --times 1", "2 steps and 1 times"),
        ("render {vdi} -o x.png --time 1", "--time=1.0 is for series"),
    ],
)
def test_mistakes(arguments, message, series, volumes, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    vdi = pvdi.read(series)[0].save(series.with_name("step.vdi"))
    names = [a.format(*volumes, series=series, vdi=vdi) for a in arguments.split()]
    assert message in run(capsys, *names, status=1)
    assert not list(tmp_path.iterdir())
