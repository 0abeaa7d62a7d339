"""The scripts of benchmarks/: their arithmetic, and that each runs to its end over little."""

from __future__ import annotations

import argparse
import ast
import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from browsers import NAMES, WITHOUT_WINDOWS, missing

from pyvista_vdi.measure.harness import Case
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.reference import build_vdi

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
pytest.importorskip("tqdm")
sys.path.insert(0, str(BENCHMARKS))

import floor  # noqa: E402
import scaling  # noqa: E402
import shared  # noqa: E402
from floors import machine, work  # noqa: E402

#: The least that reaches each script's end.
RUNS = {
    "accuracy": "--volumes brain",
    "baselines": "--size 64x36 --repeats 1",
    "files": "--volumes brain --repeats 1",
    "floor": "--volumes brain --repeats 1",
    "frames": "--volumes brain --repeats 1",
    "generation": "--volumes brain --repeats 1",
    "large": "--volumes brain --large kingsnake_like@8 --repeats 1",
    "scaling": "--volume brain --repeats 1",
    "series": "--series plume",
    "sets": "--volumes brain --directions 2 --target-ssim .8 --repeats 1",
    "trees": "--other .. --volumes brain --repeats 1",
    "web": "--volumes brain --seconds 6 --repeats 1",
}


SIZE = (24, 18)


def test_every_script_is_run_and_listed_with_the_question_that_it_answers():
    scripts = {path.stem for path in BENCHMARKS.glob("*.py")}
    assert scripts == set(RUNS)
    assert len(scripts) <= 12
    about = (BENCHMARKS / "README.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| `(\w+)\.py` \| .*\?", about, re.MULTILINE))
    assert listed == scripts


def test_results_are_small_and_of_one_format():
    files = list((BENCHMARKS / "results").glob("*.*"))
    assert sum(file.stat().st_size for file in files) <= 2**20
    for file in files:
        if file.suffix == ".json":
            assert json.loads(file.read_text())["format"] == "pyvista-vdi results"


@pytest.mark.parametrize(
    "path", sorted(BENCHMARKS.rglob("*.py")), ids=lambda path: path.relative_to(BENCHMARKS).stem
)
def test_what_a_script_imports_of_the_package_is_there(path):
    """Scripts run in the nightly alone: a name that has moved is found here."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module.startswith("pyvista_vdi"):
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):  # a module in it
                    importlib.import_module(f"{node.module}.{alias.name}")


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("name", RUNS)
def test_a_script_runs_to_its_end(name, tmp_path, default_runtime):
    if name == "web" and not any(map(shutil.which, (WITHOUT_WINDOWS, *NAMES))):
        missing("no Chromium is in the path: install the system's package 'chromium'")
    size = "" if "--size" in RUNS[name] else "--size 48x27 "
    done = subprocess.run(
        [sys.executable, f"{name}.py", *shlex.split(f"{size}{RUNS[name]} --out {tmp_path}")],
        cwd=BENCHMARKS,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    found = json.loads((tmp_path / f"{name}_sample.json").read_text())
    assert found["extent"] == "sample"
    assert found["rows"]
    assert not [row for row in found["rows"] if "refused" in row]
    assert "Measured from" in (tmp_path / f"{name}_sample.md").read_text()


# What all scripts share


def options(folder, **chosen):
    parser = shared.parser_of("What is asked.\n", volumes=("brain",))
    given = parser.parse_args(["--out", str(folder), "--size", "4x3"])
    return argparse.Namespace(**{**vars(given), **chosen})


def run(folder, measured, **chosen):
    cases = [Case("brain", look, what=f"case {k}") for k in range(6) for look in ("soft", "steep")]
    cases.append(Case("aneurism", "soft"))

    def measure(case):
        measured.append(case.name)
        return {"value": float(case.what[-1])}

    def report(results, every):
        yield str(shared.mean_of(results, every, lambda row: row["value"], look="soft"))

    return shared.execute("asked", options(folder, **chosen), cases, measure, report, count=5)


@pytest.fixture
def no_data(monkeypatch):
    monkeypatch.delenv("PYVISTA_VDI_DATA", raising=False)


def test_a_sample_is_measured_once_and_the_whole_is_another_file(no_data, tmp_path, capsys):
    measured = []
    assert run(tmp_path, measured).data["extent"] == "sample"
    assert len(measured) == 5
    run(tmp_path, measured)
    assert len(measured) == 5  # nothing anew
    run(tmp_path, measured, redo=True)
    assert measured[5:] == measured[:5]
    assert run(tmp_path, measured, whole=True).data["extent"] == "whole"
    assert len(measured) == 10 + 12
    assert {path.name for path in tmp_path.iterdir()} == {
        *("asked.json", "asked.md", "asked_sample.json", "asked_sample.md"),
    }
    told = capsys.readouterr().out
    assert "Left out, not in PYVISTA_VDI_DATA: aneurism" in told
    assert "± " in (tmp_path / "asked_sample.md").read_text()  # of a sample's mean
    assert (tmp_path / "asked.md").read_text().startswith("# asked\n\n12 of 12 cases.\n\n2.5\n")


def test_a_sample_of_scenes_has_all_cases_of_each(no_data, tmp_path):
    cases = [Case("brain", look, what=f"case {k}") for k in range(3) for look in "abcdef"]
    found = shared.execute(
        "asked", options(tmp_path), cases, lambda _: {}, lambda *_: [], count=2, key=None
    )
    looks = [row["case"]["look"] for row in found.rows()]
    assert len(looks) == 6
    assert {looks.count(look) for look in looks} == {3}


# Counts and floors


def soft_volume():
    """Return noise with an empty half, so that lists and samples are empty as well."""
    array = np.random.default_rng(3).integers(60, 256, (19, 22, 21), dtype=np.uint8)
    array[:, :, :10] = 0
    return Volume(array, spacing=(1.0, 1.2, 0.9))


def soft_function(opacity=0.3, interpolation="nearest"):
    """Return a table that makes scalars below a fifth of the range transparent."""
    opacities = np.interp(np.linspace(0, 1, 32), [0.2, 1.0], [0.0, opacity])
    opacities[:6] = 0
    colors = np.linspace((0.1, 0.2, 0.3), (0.9, 0.7, 0.5), 32)
    return TransferFunction(colors, opacities, (0.0, 255.0), interpolation=interpolation)


def row_of_lists(n, optical_depth):
    """Return V_O in parallel projection with a row of lists, each of one whole supersegment."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)
    bounds = (-n, n, -1, 1, -1, 1)
    ones = np.ones(n, np.float32)
    colors = np.ones((n, 3), np.float32)
    depths = optical_depth * ones
    return camera, VDI(camera, (n, 1), range(n + 1), 4 * ones, 6 * ones, colors, depths, bounds)


def test_rays_from_the_side_cross_every_list_until_their_light_ends():
    camera, thin = row_of_lists(8, 0.01)
    side = camera.replace(position=(20, 0, 0))
    assert work.walked(thin, camera, (8, 1)) == (1, 1, 1, 1)
    found = work.walked(thin, side, (1, 1))
    assert (found.lists, found.filled, found.met) == (8, 8, 8)
    assert found.tiles == -(-8 // work.STACK)
    # Each of 1/1000: behind the second one less than the cutoff is left
    _, opaque = row_of_lists(8, 2 * -np.log(1e-3))
    found = work.walked(opaque, side, (1, 1))
    assert found.lists < 8
    assert found.met < 8


def test_at_the_generating_view_a_ray_meets_its_list():
    volume = soft_volume()
    view = filling_camera(volume.bounds, SIZE)
    vdi = build_vdi(volume, view, SIZE, soft_function(0.05), max_supersegments=6)
    found = work.walked(vdi, view, SIZE)
    rays = SIZE[0] * SIZE[1]
    assert found.met == pytest.approx(vdi.n_supersegments / rays)
    assert found.filled == pytest.approx(np.count_nonzero(vdi.counts) / rays)
    assert found.filled < found.lists <= 1  # where the bounds are not, no list is entered
    turned = work.walked(vdi, view.azimuth(30), SIZE)
    assert turned.lists > 2 * found.lists


def test_a_march_that_stops_takes_no_more_samples_than_one_that_does_not():
    volume = soft_volume()
    view = filling_camera(volume.bounds, SIZE)
    given = volume, view, SIZE, soft_function(1.0), 0.45
    whole, stopped = (work.marched(*given, stops=stops) for stops in (False, True))
    assert stopped.steps < whole.steps
    assert 0 < stopped.visible < whole.visible < whole.steps
    clear = TransferFunction(np.zeros((2, 3)), np.zeros(2), (0.0, 255.0))
    nothing = work.marched(*given[:3], clear, 0.45, stops=True)
    assert nothing == (pytest.approx(whole.steps), 0)


#: A machine with round figures: 10 and 5 GB/s, 10^9 gathers of 4 bytes from a cache, a tenth of
#: that from memory and a quarter where each is waited for.
MACHINE = {
    "streams": {"read": 10e9, "write": 5e9},
    "arithmetic": {"multiply_add": 100e9, "divide": 10e9, "exponential": 1e9},
    "launches": {"waited": 1e-5},
    "gathers": {
        "near": {"4": [[2**14, 1e9], [2**28, 1e8]], "16": [[2**14, 5e8], [2**28, 5e7]]},
        "near, chained": {"4": [[2**14, 2.5e8], [2**28, 2.5e7]], "16": [[2**14, 1e8]]},
    },
}


@pytest.mark.parametrize(
    ("size", "working_set", "rate"),
    [
        (4, 2**14, 1e9),
        (4, 2**21, 1e8 * 10**0.5),  # half way by logarithms
        (4, 1, 1e9),
        (4, 2**40, 1e8),
        (8, 2**14, 5e8),  # the next larger element
        (32, 2**14, 5e8),
    ],
)
def test_rates_are_interpolated_between_working_sets(size, working_set, rate):
    assert machine.Rates(MACHINE).gather(size, working_set) == pytest.approx(rate)


@pytest.mark.parametrize(
    ("changed", "seconds", "bound"),
    [
        ({}, 0.5, "gathers"),
        ({"gathers": ()}, 0.3, "memory"),
        ({"gathers": (), "read": 0.0}, 0.21, "arithmetic"),
    ],
)
def test_the_floor_is_the_slowest_resource_and_a_launch(changed, seconds, bound):
    done = {
        "read": 1e9,
        "write": 1e9,
        "gathers": (work.Gathers(5e8, 4, 2**14),),
        "operations": work.operations(1e9, 1e9, 1e8),
    }
    if changed.get("read") == 0:
        done["write"] = 0.0
    found = work.floor_of(work.Work(**{**done, **changed}), machine.Rates(MACHINE))
    assert found.seconds == pytest.approx(seconds + 1e-5)
    assert found.bound == bound
    assert found.waiting == pytest.approx((2.0 if not changed else seconds) + 1e-5)


def test_the_work_of_a_frame_is_what_its_rays_meet():
    each = work.Walked(lists=3.0, filled=1.0, met=2.0, tiles=0.5)
    plain, skipping = (work.raycast_work(each, 100, 1e9, skips=skips) for skips in (False, True))
    assert [g.elements for g in plain.gathers] == [300, 300, 200, 0]
    assert [g.elements for g in skipping.gathers] == [100, 300, 200, 50]
    assert plain.write == 16 * 100
    assert plain.operations[2] == 200  # an exponential for each that is met
    assert plain.read == 300 * 8 + 300 * 8 + 200 * 16
    assert work.raycast_work(each, 100, 64.0, skips=False).read == 64


@pytest.mark.parametrize(
    ("interpolation", "voxels", "entries"), [("nearest", 1, 1), ("linear", 8, 2)]
)
def test_the_work_of_a_march_is_a_voxel_and_an_entry_a_sample(interpolation, voxels, entries):
    volume, function = soft_volume(), soft_function(interpolation=interpolation)
    each = work.Marched(steps=9.0, visible=2.0)
    found = work.march_work(each, 100, volume, function, records=False)
    assert [g.elements for g in found.gathers] == [200 * voxels, 200 * entries]
    assert found.operations[2] == 200 * entries
    assert found.read == min(volume.array.nbytes, 200 * voxels)
    recorded = work.march_work(each, 100, volume, function, records=True)
    assert recorded.write == 0
    assert recorded.operations[1] > found.operations[1]
    assert work.shorten_work(500, 200).operations[0] == 60 * 300


def test_stages_are_known_by_their_kernels_names():
    kernels = {
        "march": ("longest_marches", "march_lists"),
        "shorten": ("shorten_lists",),
        "pack": ("sum_lengths", "list_offsets", "pack_lists"),
        "": ("",),
    }
    for stage, names in kernels.items():
        assert [floor.stage_of(name) for name in names] == [stage] * len(names)


# Fits


def test_the_interval_of_a_power_law_is_that_of_a_textbook():
    # Logarithms 0 to 4 and 0.1, 0.9, 2.2, 2.9, 4.1: a standard error of 0.0489898, and the t
    # quantile of three degrees of freedom is 3.182446
    x, y = np.exp([0.0, 1.0, 2.0, 3.0, 4.0]), np.exp([0.1, 0.9, 2.2, 2.9, 4.1])
    found = scaling.fitted(x, y)
    assert found.exponent == pytest.approx(1.0)
    assert found.margin == pytest.approx(3.182446 * 0.0489898, rel=1e-5)
    assert scaling.fitted([1.0, 2.0], [1.0, 4.0]) == (pytest.approx(2.0), np.inf)


def test_of_the_angle_what_comes_on_top_is_fitted_without_the_first_cost():
    class Found:
        def rows(self, what):
            costs = {0.0: 2.0, 1.0: 2.5, 2.0: 3.0, 8.0: 6.0}
            return [{"value": v, "seconds": {"VDI frame": c}} for v, c in costs.items()]

    points = scaling.points_of(Found(), "angle", "VDI frame")
    assert points == [(1.0, 0.5), (2.0, 1.0), (8.0, 4.0)]
    assert scaling.points_of(Found(), "pixels", "VDI frame")[0] == (0.0, 2.0)
