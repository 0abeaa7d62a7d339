"""Runs of ``benchmark`` and ``tradeoff``: without VTK, stopped, gone on with, and refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from fresh_python import PATIENCE, run_bare
from measured import checked

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.measure import harness

#: Two VDIs of one volume each, of lists of 2 and of 3 supersegments, seen at 0 and 30 degrees.
RUNS = {
    "benchmark": (
        *("benchmark", "--datasets", "kingsnake_like@32", "--sizes", "16x12", "--repeats", "2"),
        *("--max-supersegments", "2", "3", "--tables", "1", "--angles", "0,30", "--out", "a.json"),
    ),
    "tradeoff": (
        *("tradeoff", "ball.npy", "--size", "32x24", "--repeats", "2", "--generations", "1"),
        *("--sweep", "max-supersegments=2,3", "--angles", "0,30", "--name", "a", "--out", "."),
    ),
}
OUT = {"benchmark": "a.json", "tradeoff": "tradeoff-a.json"}


@pytest.fixture(params=RUNS)
def verb(request, tmp_path, monkeypatch):
    """Name of a verb, in a folder with a small volume."""
    monkeypatch.chdir(tmp_path)
    np.save("ball.npy", np.arange(12 * 11 * 10, dtype=np.uint16).reshape(12, 11, 10))
    return request.param


@pytest.fixture
def generated(monkeypatch):
    """Lets generation of some VDIs fail; holds the budgets that were asked for."""
    whole, asked, errors = harness.generate_vdi, [], {}

    def generate(request):
        budget = request.options.max_supersegments
        asked.append(budget)
        if budget in errors:
            raise errors[budget]
        return whole(request)

    monkeypatch.setattr(harness, "generate_vdi", generate)
    return asked, errors


def test_a_volume_that_cannot_be_read_is_said(tmp_path, capsys, monkeypatch, default_runtime):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "no.nrrd").touch()
    command = "benchmark --datasets empty no.nrrd --no-vtk --out a.json"
    assert cli.main(command.split()) == 0  # the others would have been measured
    said = capsys.readouterr().err
    assert "left out: empty (InvalidVolumeError: the folder empty holds no slices" in said
    assert (
        "left out: no (InvalidVolumeError: no.nrrd cannot be read as a volume: it is empty" in said
    )


def test_the_engine_alone_can_run_it(verb, default_runtime, tmp_path):
    file = tmp_path / "other.npy"
    np.save(file, np.load("ball.npy"))
    places = {"ball.npy": file, ".": tmp_path, "a.json": tmp_path / "a.json"}
    result = run_bare([str(places.get(word, word)) for word in RUNS[verb]])
    assert result.returncode == 0, result.stderr
    assert "VTK is not installed: its mappers are left out" in result.stderr
    assert checked(tmp_path / OUT[verb]).plan["vtk"] is False
    assert not list(tmp_path.glob("*.png"))


def test_an_interrupted_run_can_be_gone_on_with(verb, generated, default_runtime, tmp_path, capsys):
    (asked, errors), run, out = generated, [*RUNS[verb], "--no-vtk"], tmp_path / OUT[verb]
    errors[3] = KeyboardInterrupt()
    assert cli.main(run) == 130
    assert "--resume goes on" in capsys.readouterr().err
    first = checked(out).data["rows"]
    assert len(first) == 4
    errors.clear()
    assert cli.main(run) == 1
    assert "--resume goes on with it, or choose another --out" in capsys.readouterr().err
    asked.clear()
    assert cli.main([*run, "--resume"]) == 0
    second = checked(out).data["rows"]
    assert second[: len(first)] == first
    assert set(asked) == {3}
    # Nothing is left to do: nothing is measured
    asked.clear()
    assert cli.main([*run, "--resume"]) == 0
    assert (asked, checked(out).data["rows"]) == ([], second)
    for option, value, message in (
        ("--angles", "0", "angles = [0.0, 30.0], not [0.0]"),
        ("--interpolation", "linear", "interpolation = nearest, not linear"),
    ):
        assert cli.main([*run, "--resume", option, value]) == 1
        assert f"holds results for {message}" in capsys.readouterr().err


def test_a_vdi_beyond_the_device_is_a_refused_row(verb, generated, default_runtime, tmp_path):
    generated[1][3] = DeviceMemoryError("the lists need 9 GiB; 'X' allows 1 GiB")
    assert cli.main([*RUNS[verb], "--no-vtk"]) == 0
    results = checked(tmp_path / OUT[verb])
    reasons = {row.get("refused") for row in results.rows(max_supersegments=3)}
    assert reasons == {"DeviceMemoryError: the lists need 9 GiB; 'X' allows 1 GiB"}
    assert not [row for row in results.rows(max_supersegments=2) if "refused" in row]
    text = (tmp_path / OUT[verb]).with_suffix(".md").read_text()
    name = {"benchmark": "`kingsnake_like@32/16x12/3`", "tradeoff": "N_S 3"}[verb]
    assert f"- {name}: DeviceMemoryError: the lists need 9 GiB" in text


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_leaves_no_half_file(default_runtime, tmp_path):
    """The interrupt comes while the results are written: those of the row before stay."""
    np.save(tmp_path / "ball.npy", np.arange(1000, dtype=np.uint16).reshape(10, 10, 10))
    code = (
        "import sys, time\n"
        "from pyvista_vdi.cli import main\n"
        "from pyvista_vdi.measure.results import Results\n"
        "save = Results.save\n"
        "def slow(self):\n"
        "    if len(self.data['rows']) > 2:\n"
        "        print('writing', flush=True); time.sleep(60)\n"
        "    save(self)\n"
        "Results.save = slow\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, *RUNS["tradeoff"], "--no-vtk"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    try:
        assert process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 130
    assert err.splitlines()[-1] == "pyvista-vdi: error: interrupted; nothing was left half done"
    assert "Traceback" not in err
    assert {path.name for path in tmp_path.iterdir()} == {"ball.npy", "tradeoff-a.json"}
    rows = checked(tmp_path / "tradeoff-a.json").data["rows"]
    assert [row["case"]["what"] for row in rows] == ["volume rendering"] * 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("benchmark --out a.txt", "--out must name a .json file"),
        ("benchmark --datasets nothing", "no volume is called 'nothing', and there is no such fi"),
        ("benchmark --datasets kingsnake_like@0", "a whole number from 1 to 128 behind the @"),
        ("benchmark --datasets brain brain", "'brain' is given twice"),
        (f"benchmark --datasets {'x' * 5000}", "and there is no such file"),
        ("benchmark --angles 5,30,5", "an angle is given twice: (5.0, 30.0, 5.0)"),
        ("tradeoff ball.npy --sweep size", "--sweep knows no 'size': known are max-supersegments,"),
        ("tradeoff ball.npy --sweep lists=a", "--sweep lists takes a number; got 'a'"),
        ("tradeoff ball.npy --sweep max-supersegments=1.5", "takes a whole number; got '1.5'"),
        ("tradeoff ball.npy --sweep skip-empty=no", "skip-empty takes on or off; got 'no'"),
        ("tradeoff ball.npy --sweep precision=4-byte", "precision must be one of exact, 8-byte"),
        ("tradeoff ball.npy --size 8x8", "a window of 8 x 8 has no SSIM: each edge must have 11"),
        ("tradeoff ball.npy --angles 5,5", "an angle is given twice"),
        ("tradeoff ball.npy --repeats 2000", "repeats must be a whole number from 1 to 1000; got"),
        ("tradeoff ball.npy --name a/b", "--name becomes a file's, without a folder; got 'a/b'"),
        ("tradeoff ball.npy --out ball.npy", "the folder ball.npy cannot be made"),
        ("tradeoff ball.npy --cmap bone --transfer-function none.json", "none.json cannot be read"),
        ("tradeoff ball.npy --name old --resume", "is of version 1; this program reads version 2"),
        ("tradeoff ball.npy --transfer-function blank.json", "nothing is to be seen: the transfer"),
    ],
)
def test_mistakes_are_one_line(words, message, tmp_path, capsys, monkeypatch, default_runtime):
    monkeypatch.chdir(tmp_path)
    np.save("ball.npy", np.zeros((6, 5, 4), np.uint8))
    blank = pvdi.TransferFunction([(1, 1, 1)] * 2, [0, 0], (0, 1))
    (tmp_path / "blank.json").write_text(json.dumps(blank.to_dict()))
    old = '{"format": "pyvista-vdi tradeoff", "version": 1}'
    (tmp_path / "tradeoff-old.json").write_text(old)
    there = {path.name for path in tmp_path.iterdir()}
    out = [] if "--out" in words or words.startswith("benchmark") else ["--out", "."]
    assert cli.main([*words.split(), "--no-vtk", *out]) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    # Nothing is written before all is checked; what cannot be seen is known when it is drawn
    left = {path.name for path in tmp_path.iterdir()} - there
    assert left == ({"tradeoff-ball.json"} if "blank.json" in words else set())
