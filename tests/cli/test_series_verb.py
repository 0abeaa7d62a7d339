"""The verb ``series``, and ``info`` and ``convert`` of what it writes."""

from __future__ import annotations

import json

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


def test_volumes_become_a_series(series, volumes):
    steps = pvdi.read(series)
    assert steps.times == (0.0, 0.5, 2.0)
    volume = pvdi.Volume(np.load(volumes[2]), (1, 1, 2))
    alone = pvdi.generate(
        volume, steps.camera, (24, 16), cmap="bone", clim=(0, 80), precision="8-byte"
    )
    assert steps[2].equals(alone)


def test_info(series, capsys):
    out = run(capsys, "info", series)
    assert "3, times 0 to 2" in out
    assert "24 x 16" in out
    state = json.loads(run(capsys, "info", series, "--json"))
    assert state["times"] == [0.0, 0.5, 2.0]
    assert state["closed"]


def test_to_single_files_and_back(series, capsys, tmp_path):
    assert "3 files" in run(capsys, "convert", series, "-o", tmp_path / "a.vdi")
    files = sorted(tmp_path.glob("a_*.vdi"))
    assert [file.name for file in files] == ["a_0000.vdi", "a_0001.vdi", "a_0002.vdi"]
    back = tmp_path / "back.vdis"
    run(capsys, "series", *files, "-o", back, "--times", "0,0.5,2")
    steps = pvdi.read(series)
    assert all(a.equals(b) for a, b in zip(pvdi.read(back), steps, strict=True))
    again = tmp_path / "again.vdis"
    run(capsys, "convert", back, "-o", again, "--compression", "lz4")
    assert pvdi.read(again)[2].equals(steps[2])
    twice = tmp_path / "one.vdis"
    run(capsys, "series", series, "-o", twice, "--tolerance", "0.05")
    assert pvdi.read(twice).times == steps.times


def test_a_step_is_shown_by_its_time(series, capsys, tmp_path):
    pv = pytest.importorskip("pyvista")
    steps = pvdi.read(series)
    for k, time in enumerate(("0.1", "0.4", "9")):
        drawn, single = tmp_path / f"{k}.png", tmp_path / f"{k}s.png"
        steps[k].save(tmp_path / "step.vdi")
        run(capsys, "render", series, "-o", drawn, "--time", time)
        run(capsys, "render", tmp_path / "step.vdi", "-o", single)
        assert drawn.read_bytes() == single.read_bytes()
        run(capsys, "view", series, "--screenshot", drawn, "--time", time, "--size", "80x60")
        run(capsys, "view", tmp_path / "step.vdi", "--screenshot", single, "--size", "80x60")
        one, other = (pv.read(name).active_scalars for name in (drawn, single))
        assert np.array_equal(one, other)


def test_times_of_what_has_none(series, volumes, capsys, tmp_path):
    pytest.importorskip("pyvista")
    pvdi.read(series)[0].save(tmp_path / "step.vdi")
    for file in (tmp_path / "step.vdi", volumes[0]):
        for option in (["--play"], ["--time", "1"], ["--rate", "5"]):
            target = tmp_path / "p.png"
            error = run(capsys, "view", file, "--screenshot", target, *option, status=1)
            assert f"{option[0]} is for series" in error
            assert not target.exists()
    arguments = ("render", tmp_path / "step.vdi", "-o", target, "--time", "1")
    assert "--time is for series" in run(capsys, *arguments, status=1)


def test_images_of_steps_are_written_as_asked_for(series, capsys, tmp_path):
    pytest.importorskip("OpenEXR")
    options = {"exact": ["--standard-channels"], "linear": ["--linear"]}
    for name, option in options.items():
        run(capsys, "convert", series, "-o", tmp_path / f"{name}.exr", *option)
        alone = pvdi.read(series)[1].save(tmp_path / "alone.exr", **{name: name == "linear"})
        assert (tmp_path / f"{name}_0001.exr").read_bytes() == alone.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("series {0} {series} -o x.vdis", "not some of each"),
        ("series {0} {1} -o x.vdis --times 1", "2 steps and 1 times"),
        ("series {series} -o x.vdis --times 1", "own times"),
        ("series {0} -o x.vdi", ".vdis"),
        ("series {0} -o x.vdis --tolerance 2", "tolerance"),
        ("series {series} -o x.vdis --cmap bone", "--cmap is for volumes"),
        (
            "convert {series} -o b.vdis --camera-json absent",
            "--camera-json is for deep images, .exr",
        ),
        ("convert {series} -o b.vdis --linear", "--linear is for writing .exr, and not .vdis"),
        (
            "convert {series} -o b.html --standard-channels",
            "--standard-channels is for writing .exr",
        ),
        ("convert {series} -o b.vdi --linear", "got linear"),
    ],
)
def test_mistakes(arguments, message, series, volumes, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [a.format(*volumes, series=series) for a in arguments.split()]
    assert message in run(capsys, *names, status=1)
    assert not list(tmp_path.iterdir())


def test_a_series_takes_the_place_of_one_that_it_is_made_of(series, capsys, tmp_path):
    path = tmp_path / "run.vdis"
    path.write_bytes(series.read_bytes())
    before = list(pvdi.read(path)[:2])
    pvdi.VDISeries.of(before, [5.0, 6.0]).save(tmp_path / "later.vdis")
    run(capsys, "series", path, tmp_path / "later.vdis", "-o", path)
    assert pvdi.read(path).times == (0.0, 0.5, 2.0, 5.0, 6.0)
    assert pvdi.read(path)[4].equals(before[1])


@pytest.mark.slow
def test_a_run_that_fails_leaves_what_was_there(series, volumes, capsys, tmp_path):
    path = tmp_path / "run.vdis"
    path.write_bytes(series.read_bytes())
    np.save(tmp_path / "flat.npy", np.zeros((3, 4)))
    run(capsys, "series", volumes[0], tmp_path / "flat.npy", "-o", path, status=1)
    assert path.read_bytes() == series.read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["flat.npy", "run.vdis"]
