"""The benchmark: tiny runs end to end, going on, comparing, refusing, and the paper's figures."""

from __future__ import annotations

import copy
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fresh_python import run_bare
from json_schema import read_checked

from pyvista_vdi import cli, examples
from pyvista_vdi.cli import parser
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError, InvalidVolumeError
from pyvista_vdi.io.volumes import read_file
from pyvista_vdi.measure.clock import rank_sum_chance
from pyvista_vdi.measure.compare.bounds import SSIM_TO_VTK
from pyvista_vdi.measure.paper import (
    PROFILES,
    Plan,
    Results,
    compare_results,
    describe,
    describe_changes,
    find_dataset,
    paper_cell,
    read_results,
    session,
)
from pyvista_vdi.measure.paper.procedural import PROCEDURAL, make
from pyvista_vdi.measure.paper.published import paper_tables, paper_targets

SCHEMA = Path(__file__).parents[2] / "docs" / "benchmark_schema.json"

#: 32 x 32 x 25 voxels, uint8.
TINY = "kingsnake_like@32"
TINY_RUN = ("--datasets", TINY, "--sizes", "16x12", "--max-supersegments", "4", "--repeats", "2")


def checked(path):
    """Read results after holding them to the schema."""
    return read_checked(path, SCHEMA)


def benchmark(*arguments):
    return cli.main(["benchmark", *(str(a) for a in arguments)])


# -- a run -----------------------------------------------------------------------------------------


def test_a_tiny_run_writes_what_the_schema_says(runtime, tmp_path):
    out = tmp_path / "tiny.json"
    device = ("--device", runtime.info.selector)
    assert benchmark(*TINY_RUN, "--angles", "0,30", "--no-vtk", "--out", out, *device) == 0
    data = checked(out)
    (cell,) = data["cells"]
    assert cell["name"] == f"{TINY}/16x12/4"
    assert cell["refused"] is None
    assert cell["vdi"]["lists"] == 16 * 12
    assert 0 < cell["vdi"]["longest_list"] <= 4
    assert [row["angle"] for row in cell["angles"]] == [0, 30]
    for row in cell["angles"]:
        assert set(row["seconds"]) == {"vdi", "vdi_skipping", "volume", "volume_skipping"}
        for taken in row["seconds"].values():
            # Both are seconds, and kernels run within the frame that the clock is taken of.
            # Clocks of device and host may tick a little differently
            assert len(taken["clock"]) == len(taken["device"]) == 2
            assert all(
                0 < d <= 1.01 * c + 1e-4
                for d, c in zip(taken["device"], taken["clock"], strict=True)
            )
    # From V_O, four supersegments of 25 voxels are not exact, but close
    assert cell["angles"][0]["vdi_to_volume"]["ssim"] > 0.9
    (preview,) = data["previews"]
    assert len(preview["rows"]) == 2 * len(paper_targets())
    text = out.with_suffix(".md").read_text()
    assert f"| {TINY} | 16x12 | 4 | 30 |" in text
    assert "Not measured" not in text


def test_either_table_can_be_left_out(default_runtime, tmp_path):
    for tables, cells, previews in (("1", 1, 0), ("2", 0, 1)):
        out = tmp_path / f"{tables}.json"
        run = (*TINY_RUN, "--angles", "5", "--no-vtk", "--tables", tables)
        assert benchmark(*run, "--out", out) == 0
        data = checked(out)
        assert (len(data["cells"]), len(data["previews"])) == (cells, previews)
        assert list(data["datasets"]) == [TINY]


@pytest.mark.gl
def test_vtk_takes_part_and_draws_the_same(default_runtime, tmp_path):
    out = tmp_path / "vtk.json"
    run = ("--datasets", "kingsnake_like@16", "--sizes", "96x64", "--repeats", "1")
    # Linear: steps of half a voxel find the nearest point at other places than VTK's do
    looks = ("--interpolation", "linear", "--angles", "30", "--tables", "1")
    assert benchmark(*run, *looks, "--out", out) == 0
    data = checked(out)
    for cell in data["cells"]:
        assert cell["left_out"] == {}
        (row,) = cell["angles"]
        for name in ("vtk_gpu", "vtk_fixed_point"):
            assert len(row["seconds"][name]["clock"]) == 1
            assert row["seconds"][name]["device"] == []
        # The same volume and transfer function in other hands
        assert row["volume_to_vtk_gpu"]["ssim"] >= SSIM_TO_VTK
    assert data["system"]["opengl"]


def test_vtk_gets_the_same_transfer_function():
    pytest.importorskip("vtkmodules")
    from pyvista_vdi.measure.vtk_baselines import property_from_transfer_function
    from pyvista_vdi.vtk_pipeline.filters.convert import transfer_function_from_property

    dataset = find_dataset(TINY)
    volume = dataset.load(None)
    table = dataset.transfer_function(volume, "linear")
    back = transfer_function_from_property(property_from_transfer_function(volume, table))
    low, high = table.scalar_range
    assert back.scalar_range == table.scalar_range
    assert back.interpolation == "linear"
    assert back.unit_distance == pytest.approx(volume.default_unit_distance)
    # VTK keeps doubles; the converter samples between the nodes
    for name in ("colors", "opacities"):
        ours, theirs = getattr(table, name), getattr(back, name)
        nodes = np.linspace(low, high, len(ours))
        at = np.linspace(low, high, len(theirs))
        for channel in np.atleast_2d(ours.T):
            assert len(nodes) == len(channel)
        resampled = np.stack([np.interp(at, nodes, c) for c in np.atleast_2d(ours.T)], axis=-1)
        np.testing.assert_allclose(resampled.squeeze(), theirs, atol=1e-6)


def test_the_engine_alone_can_run_it(default_runtime, tmp_path):
    out = tmp_path / "bare.json"
    arguments = ["benchmark", *TINY_RUN, "--angles", "5", "--out", str(out)]
    result = run_bare(arguments)
    assert result.returncode == 0, result.stderr
    assert "VTK is not installed: its mappers are left out" in result.stderr
    data = checked(out)
    assert data["plan"]["vtk"] is False
    assert not out.with_suffix(".png").exists()


# -- stopping, going on, refusing ------------------------------------------------------------------


def test_an_interrupted_run_can_be_gone_on_with(default_runtime, tmp_path, monkeypatch, capsys):
    out = tmp_path / "a.json"
    run = (*TINY_RUN, "--angles", "0,5,30", "--no-vtk", "--tables", "1", "--out", out)
    whole = session._Run._row

    def interrupted(self, angle, *others):
        if angle == 30:
            raise KeyboardInterrupt
        return whole(self, angle, *others)

    monkeypatch.setattr(session._Run, "_row", interrupted)
    assert benchmark(*run) == 130
    assert "--resume goes on" in capsys.readouterr().err
    first = checked(out)
    assert [row["angle"] for row in first["cells"][0]["angles"]] == [0, 5]

    monkeypatch.setattr(session._Run, "_row", whole)
    assert benchmark(*run) == 1
    assert "--resume goes on with it, or choose another --out" in capsys.readouterr().err
    assert benchmark(*run, "--resume") == 0
    second = checked(out)
    assert [row["angle"] for row in second["cells"][0]["angles"]] == [0, 5, 30]
    assert second["cells"][0]["angles"][:2] == first["cells"][0]["angles"]
    assert second["cells"][0]["vdi"] == first["cells"][0]["vdi"]

    # Nothing is left to do: nothing is measured
    monkeypatch.setattr(session._Run, "_row", None)
    assert benchmark(*run, "--resume") == 0
    assert checked(out)["cells"] == second["cells"]

    assert benchmark(*run, "--resume", "--angles", "0") == 1
    assert "holds results for angles = [0.0, 5.0, 30.0], not [0.0]" in capsys.readouterr().err


def test_results_of_another_device_are_not_gone_on_with(tmp_path):
    plan = Plan("quick", (TINY,))
    system = {"device": "a", "driver": "1", "pyvista-vdi": "0"}
    Results.begun(tmp_path / "a.json", plan, system).save()
    with pytest.raises(InvalidArgumentError, match="measured on device a, and this is b"):
        Results.resumed(tmp_path / "a.json", plan, {**system, "device": "b"})


def test_a_volume_beyond_the_device_is_a_refused_row(default_runtime, tmp_path, monkeypatch):
    # 32 TiB: no device allows that in one buffer. It is refused before anything is made
    huge = replace(PROCEDURAL["kingsnake_like"], dimensions=(2**15,) * 3)
    monkeypatch.setitem(PROCEDURAL, "kingsnake_like", huge)
    out = tmp_path / "huge.json"
    run = ("--datasets", "kingsnake_like", "brain", "--sizes", "16x12", "--angles", "5")
    assert benchmark(*run, "--repeats", "1", "--no-vtk", "--out", out) == 0
    data = checked(out)
    states = {cell["name"]: cell["refused"] for cell in data["cells"]}
    assert re.match(
        "DeviceMemoryError: .*volume 'kingsnake_like'", states["kingsnake_like/16x12/15"]
    )
    assert states["brain/16x12/15"] is None
    assert data["previews"][0]["refused"].startswith("DeviceMemoryError")
    text = out.with_suffix(".md").read_text()
    assert "- `kingsnake_like/16x12/15`: DeviceMemoryError" in text


def test_a_volume_beyond_the_host_is_refused_by_name(monkeypatch):
    monkeypatch.setattr("pyvista_vdi.model.host_memory.physical_memory", lambda: 2**30)
    with pytest.raises(
        DeviceMemoryError,
        match=r"the volume 'beechnut_like', 1024 x 1024 x 1546 of uint16, needs 4.02 GiB on the "
        r"host, which has 1.00 GiB: take 'beechnut_like@2'",
    ):
        find_dataset("beechnut_like").load(None)
    monkeypatch.setattr("pyvista_vdi.model.host_memory.physical_memory", lambda: 2**40)
    monkeypatch.setattr("pyvista_vdi.model.host_memory.free_memory", lambda: 2**30)
    with pytest.raises(DeviceMemoryError, match="of which 1.00 GiB are free: close other programs"):
        find_dataset("beechnut_like").load(None)


@pytest.mark.gl
def test_vtk_is_left_out_by_name_where_memory_is_short(default_runtime, tmp_path, monkeypatch):
    # Enough for the volume of 25 KiB and the working memory, and not for two copies of another
    free = iter([2**40] + [2**10] * 100)
    monkeypatch.setattr("pyvista_vdi.model.host_memory.free_memory", lambda: next(free))
    out = tmp_path / "a.json"
    assert benchmark(*TINY_RUN, "--angles", "5", "--tables", "1", "--out", out) == 0
    (cell,) = checked(out)["cells"]
    assert list(cell["left_out"]) == ["vtk_gpu"]
    assert "needs 0.00 GiB on the host" in cell["left_out"]["vtk_gpu"]
    assert "vtk_fixed_point" in cell["angles"][0]["seconds"]
    assert f"- VTK GPU with {TINY}: " in out.with_suffix(".md").read_text()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "is no JSON"),
        ("[]", "holds no results"),
        ('{"format": "pyvista-vdi benchmark", "version": 9}', "is of version 9"),
        ('{"format": "pyvista-vdi benchmark", "version": 1}', "lacks cells, datasets"),
    ],
)
def test_what_holds_no_results_is_refused(tmp_path, content, message):
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(InvalidArgumentError, match=message):
        read_results(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--out", "a.txt"], "--out must name a .json file"),
        (["--datasets", "nothing"], "no volume is called 'nothing', and there is no such file"),
        (["--datasets", "kingsnake_like@0"], "a whole number from 1 to 128 behind the @"),
        (["--datasets", "brain", "brain"], "'brain' is given twice"),
        (["--datasets", "x" * 5000], "and there is no such file"),
        (["--angles", "5,30,5"], "an angle is given twice: (5.0, 30.0, 5.0)"),
        (["--compare", "a.json", "b.json"], "a.json cannot be read"),
    ],
)
def test_mistakes_are_one_line(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert benchmark("--no-vtk", *arguments) == 1
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_the_parser_offers_the_profiles():
    options = parser.parse(["benchmark"])
    assert options.profile in PROFILES
    for name in PROFILES:
        assert parser.parse(["benchmark", "--profile", name]).profile == name
    with pytest.raises(parser.UsageError, match="quick"):
        parser.parse(["benchmark", "--profile", "other"])


# -- two runs --------------------------------------------------------------------------------------


def results(times, *, ssim=0.98, repeats=5, name="brain/16x12/15", refused=None):
    """Make up results of one cell; times of the VDI and of the volume, seconds."""
    vdi, volume = times
    accuracy = {"ssim": ssim, "psnr": 30.0, "worst_pixel": 9.0}
    taken = {n: {"clock": list(t), "device": []} for n, t in (("vdi", vdi), ("volume", volume))}
    sizes = {"supersegments": 1000, "bytes_raw": 30000, "bytes_saved": None}
    return {
        "plan": {"repeats": repeats, "interpolation": "nearest", "seed": 1},
        "system": {"device": "a", "driver": "1"},
        "cells": [
            {
                "name": name,
                "refused": refused,
                "vdi": {**sizes, "generation_seconds": {"clock": [1.0], "device": []}},
                "angles": [{"angle": 5.0, "vdi_to_volume": accuracy, "seconds": taken}],
            }
        ],
    }


STEADY = np.array([1.0, 1.01, 0.99, 1.02, 0.98])


def changed(before, after):
    return {change.figure for change in compare_results(before, after) if change.changed}


def test_equal_runs_have_not_changed():
    assert changed(results((STEADY, STEADY)), results((STEADY[::-1], STEADY))) == set()


def test_a_slower_frame_is_seen_in_both_ways():
    found = changed(results((STEADY, STEADY)), results((1.3 * STEADY, STEADY)))
    assert found == {"VDI, f, s", "VDI, f / render_volume"}


def test_a_slower_machine_changes_times_and_no_pairs():
    found = changed(results((STEADY, STEADY)), results((1.3 * STEADY, 1.3 * STEADY)))
    assert found == {"VDI, f, s", "render_volume, s"}


def test_a_machine_that_slows_down_meanwhile_changes_no_pairs():
    drift = np.array([1.0, 1.2, 1.5, 2.0, 3.0])
    assert changed(results((STEADY, STEADY)), results((drift, drift * STEADY))) <= {
        "VDI, f, s",
        "render_volume, s",
    }


def test_overlapping_times_and_small_changes_are_noise():
    noisy = np.array([1.0, 1.6, 0.9, 1.7, 0.95])
    assert changed(results((STEADY, STEADY)), results((noisy, STEADY))) == set()
    exact = np.linspace(1.0, 1.0001, 5)
    assert changed(results((exact, exact)), results((1.04 * exact, exact))) == set()


def test_too_few_repetitions_are_told():
    before, after = results(([1.0], [1.0]), repeats=1), results(([9.0], [1.0]), repeats=1)
    assert changed(before, after) == set()
    assert "too few repetitions" in describe_changes(before, after)


def test_accuracy_sizes_and_refusals_are_compared():
    before, after = results((STEADY, STEADY)), results((STEADY, STEADY), ssim=0.97)
    after["cells"][0]["vdi"]["supersegments"] = 1100
    assert changed(before, after) == {"SSIM", "supersegments"}
    text = describe_changes(before, after)
    assert "brain/16x12/15 at 5 degrees: SSIM 0.98 -> 0.97, 0.990 times" in text
    refused = copy.deepcopy(before)
    refused["cells"][0] |= {"refused": "too large", "vdi": None, "angles": []}
    assert "brain/16x12/15: measured -> refused (too large)" in describe_changes(before, refused)
    before["system"]["device"] = "b"
    assert "The device differs: b; a." in describe_changes(before, after)


def test_the_command_compares(tmp_path, capsys):
    for name in ("a", "b"):
        begun = Results.begun(tmp_path / f"{name}.json", Plan("quick", (TINY,)), {"device": "x"})
        begun.save()
    assert benchmark("--compare", tmp_path / "a.json", tmp_path / "b.json") == 0
    assert "Figures in both: 0; changed beyond noise: 0." in capsys.readouterr().out


def test_the_chance_is_scipys():
    stats = pytest.importorskip("scipy.stats")
    rng = np.random.default_rng(3)
    for n, m in [(5, 5), (3, 7), (1, 4), (6, 2)]:
        a, b = rng.standard_normal(n), rng.standard_normal(m) + 1
        theirs = stats.mannwhitneyu(a, b, method="exact").pvalue
        assert rank_sum_chance(a.tolist(), b.tolist()) == pytest.approx(theirs, abs=1e-12)


def test_as_many_repetitions_as_may_be_asked_for_have_a_chance():
    stats = pytest.importorskip("scipy.stats")
    a, b = np.arange(1000), np.arange(1000) + 70.5
    theirs = stats.mannwhitneyu(a, b, method="asymptotic").pvalue
    assert rank_sum_chance(a.tolist(), b.tolist()) == pytest.approx(theirs, rel=1e-3)
    # Where one run has few, it is exact still
    few = [-1.0, -2.0, -3.0]
    assert rank_sum_chance(few, a.tolist()) == pytest.approx(2 / math.comb(1003, 3))


# -- the paper's figures ---------------------------------------------------------------------------


def test_the_papers_figures():
    cells = [
        (row["dataset"], tuple(row["window_size"]), cell["max_supersegments"], cell["angle"])
        for row in paper_tables()["table1"]
        for cell in row["vdi"]
    ]
    assert len(cells) == len(set(cells)) == 3 * 2 * 2 * 2
    for cell in cells:
        found = paper_cell(*cell)
        # What the paper says of its table: skipping gains everywhere, and so does the VDI with it
        assert found.fps_skipping > max(found.fps, found.volume_fps)
        assert 0.94 < found.ssim < 1
    kingsnake = paper_cell("kingsnake", (1280, 720), 15, 5.0)
    assert kingsnake.speed_up_skipping == 277 / 31
    assert kingsnake.ssim == 0.982
    # The speed-ups that this project is to reach, 720p and N_S 15: kingsnake, beechnut, R.-M.
    reach = {5: (8.9, 13.3, 33), 30: (3.1, 4, 15)}
    for angle, wanted in reach.items():
        for name, ratio in zip(("kingsnake", "beechnut", "richtmyer_meshkov"), wanted, strict=True):
            cell = paper_cell(name, (1280, 720), 15, angle)
            assert cell.speed_up_skipping == pytest.approx(ratio, rel=0.04)
    assert paper_cell(None, (1280, 720), 15, 5.0) is None
    assert paper_cell("kingsnake", (1280, 720), 15, 60.0) is None
    assert [round(24 * ratio) for ratio, _ in paper_targets()] == [40, 50, 60, 70, 80]


def test_a_table_has_the_papers_figures_beside_ours():
    data = results((STEADY, STEADY))
    (cell,) = data["cells"]
    cell |= {"dataset": "k", "window_size": [1280, 720], "max_supersegments": 15}
    cell["vdi"] |= {"lists": 10, "occupied_lists": 5, "mean_length": 3.0, "longest_list": 4}
    cell["vdi"]["save_seconds"] = None
    (row,) = cell["angles"]
    row["seconds"]["vdi_skipping"] = {"clock": (STEADY / 4).tolist(), "device": []}
    row["volume_to_vtk_gpu"] = None
    data["plan"] |= {"profile": "quick"}
    data |= {"begun": "x", "changed": "y", "previews": []}
    described = {"source": "file", "paper": "kingsnake", "dimensions": [2, 2, 2]}
    data["datasets"] = {"k": {**described, "dtype": "uint8", "description": "k"}}
    line = next(li for li in describe(data).splitlines() if li.startswith("| k | 1280x720 |"))
    cells = [part.strip() for part in line.strip("|").split("|")]
    assert cells[10:14] == ["1.0", f"{231 / 31:.1f}", "4.0", f"{277 / 31:.1f}"]
    assert cells[15:17] == ["0.9800", "0.982"]


# -- volumes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(PROCEDURAL))
def test_made_volumes_depend_on_the_seed_alone(name):
    kind = PROCEDURAL[name]
    row = next(r for r in paper_tables()["table1"] if r["dataset"] == kind.paper)
    assert list(kind.dimensions) == row["dimensions"]
    assert kind.dtype == row["dtype"]
    a, b, other = (make(kind, 32, seed, name).array for seed in (1, 1, 2))
    assert a.dtype == kind.dtype
    assert np.array_equal(a, b)
    assert not np.array_equal(a, other)
    assert a.nbytes == kind.nbytes(32)


def test_made_volumes_are_as_empty_and_as_turbulent_as_the_papers():
    look = {
        name: find_dataset(f"{name}@16").transfer_function(make(kind, 16, 1, name), "nearest")
        for name, kind in PROCEDURAL.items()
    }

    def empty(name):
        volume = make(PROCEDURAL[name], 16, 1, name)
        _, high = look[name].scalar_range
        at = np.rint(volume.array / high * 255).astype(int)
        return float(np.mean(look[name].opacities[at] == 0))

    # A coil in an egg is mostly air; a nut has a hollow; a mixing layer is half of one fluid
    assert empty("kingsnake_like") > 0.8
    assert 0.3 < empty("beechnut_like") < 0.8
    assert 0.2 < empty("richtmyer_meshkov_like") < 0.8


def test_files_are_data_sets_too(tmp_path):
    array = np.arange(4 * 3 * 2, dtype="<u2").reshape(2, 3, 4)
    raw = tmp_path / "nut_4x3x2_uint16.raw"
    raw.write_bytes(array.tobytes())
    dataset = find_dataset(f"beechnut={raw}")
    assert (dataset.name, dataset.paper, dataset.source) == ("beechnut", "beechnut", "file")
    assert np.array_equal(dataset.load(None).array, array)
    assert find_dataset(str(raw)).paper is None
    (tmp_path / "run=3").mkdir()
    apart = raw.rename(tmp_path / "run=3" / raw.name)
    for name, label in ((str(apart), "nut_4x3x2_uint16"), (f"beechnut={apart}", "beechnut")):
        assert find_dataset(name).name == label
        assert np.array_equal(find_dataset(name).load(None).array, array)
    nrrd = find_dataset(str(examples.path("brain")))
    assert nrrd.load(None).dimensions == (181, 217, 181)
    # The results name no folder
    described = json.dumps(Plan("quick", (f"beechnut={raw}",)).to_dict())
    assert str(tmp_path) not in described


def test_raw_files_must_say_what_they_hold(tmp_path):
    for name, message in [
        ("nut.raw", "does not say what it holds"),
        ("nut_4x3x2_uint16.raw", "has 5 bytes; 4 x 3 x 2 of uint16 are 48"),
    ]:
        (tmp_path / name).write_bytes(b"12345")
        with pytest.raises(InvalidVolumeError, match=message):
            read_file(tmp_path / name)
