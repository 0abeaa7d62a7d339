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


def test_volumes_become_a_series(series, volumes):
    steps = pvdi.read(series)
    assert steps.times == (0.0, 0.5, 2.0)
    volume = pvdi.Volume(np.load(volumes[2]), (1, 1, 2))
    alone = pvdi.generate(
        volume, steps.camera, (24, 16), cmap="bone", clim=(0, 80), precision="8-byte"
    )
    assert steps[2].equals(alone)


#: Values of three steps, which rise; and their times, where a file says them.
VALUES, TIMES = (60, 120, 180), [0.5, 1.25, 3.0]
STEPS = np.stack([np.full((6, 7, 8), value, np.uint8) for value in VALUES])


def _store(folder, axes=None, scale=None):
    zarr = pytest.importorskip("zarr")
    if scale is None:
        array = zarr.open(
            str(folder / "t.zarr"), mode="w", shape=STEPS.shape, chunks=(1, 4, 4, 4), dtype="u1"
        )
        if axes:
            array.attrs["_ARRAY_DIMENSIONS"] = axes
    else:
        old = {"zarr_format": 2} if int(zarr.__version__.split(".")[0]) > 2 else {}
        group = zarr.open_group(str(folder / "t.zarr"), mode="w", **old)
        array = zarr.open(str(folder / "t.zarr/0"), mode="w", shape=STEPS.shape, dtype="u1", **old)
        transformations = [
            {"type": "scale", "scale": [scale, 1, 1, 1]},
            {"type": "translation", "translation": [1, 0, 0, 0]},
        ]
        kinds = {"t": "time"}
        group.attrs["multiscales"] = [
            {
                "version": "0.4",
                "axes": [{"name": n, "type": kinds.get(n, "space")} for n in "tzyx"],
                "datasets": [{"path": "0", "coordinateTransformations": transformations}],
            }
        ]
    array[:] = STEPS
    return ["t.zarr"]


def _images(folder, times=(None, None, None)):
    pv = pytest.importorskip("pyvista")
    names = [f"step_{number}.vti" for number in (2, 9, 10)]
    for name, values, time in zip(names, STEPS, times, strict=True):
        image = pv.ImageData(dimensions=values.shape[::-1])
        image["v"] = values.ravel()
        if time is not None:
            image.field_data["TimeValue"] = [time]
        image.save(folder / name)
    return sorted(names)  # as a shell has them: step_10 is the first


def _arrays(folder):
    names = [f"Step{number}.npy" for number in (8, 9, 10)]
    for name, values in zip(names, STEPS, strict=True):
        np.save(folder / name, values)
    return sorted(names)


KINDS = {
    "a store of named axes": (lambda folder: _store(folder, list("tzyx")), [0, 1, 2]),
    "OME-Zarr that says times": (lambda folder: _store(folder, scale=0.25), [1, 1.25, 1.5]),
    "numbers in names": (_arrays, [0, 1, 2]),
    "numbers and times": (lambda folder: _images(folder, TIMES), TIMES),
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


def test_what_is_done_with_names_and_times_is_said(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = _images(tmp_path, TIMES[::-1])
    assert cli.main(["series", *files, "-o", "run.vdis", *LOOK]) == 0
    said = capsys.readouterr().err
    assert "step_2.vti before step_10.vti" in said
    assert "do not ascend" in said


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("series {0} {vdi} -o x.vdis", "not some of each"),
        ("series {0} {1} -o x.vdis --times 1", "2 steps and 1 times"),
        ("render {vdi} -o x.png --time 1", "--time 1 is for series"),
        (
            "convert {series} -o b.vdis --camera-json absent",
            "--camera-json absent is for deep images, .exr",
        ),
    ],
)
def test_mistakes(arguments, message, series, volumes, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    vdi = pvdi.read(series)[0].save(series.with_name("step.vdi"))
    names = [a.format(*volumes, series=series, vdi=vdi) for a in arguments.split()]
    assert message in run(capsys, *names, status=1)
    assert not list(tmp_path.iterdir())
