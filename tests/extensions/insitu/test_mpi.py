"""Blocks with four ranks of Open MPI, and a simulation that hands them in."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from drawing import generate_in_blocks, generate_vdi
from PIL import Image
from support.march_ways import VIEWS, WINDOW, ray_depths, transfer_for, volume_of

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIFileError
from pyvista_vdi.extensions.insitu import InSitu
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.quality.targets import turned

EXAMPLE = Path(__file__).parents[3] / "examples" / "insitu.py"
PROGRAM = Path(__file__).parents[2] / "support" / "mpi_program.py"

needs_mpi = pytest.mark.skipif(
    shutil.which("mpirun") is None or find_spec("mpi4py") is None,
    reason="needs mpirun (Debian: openmpi-bin) and mpi4py (extra: mpi)",
)


def run(ranks, program, *arguments):
    mpirun = ["mpirun", "--oversubscribe", "--allow-run-as-root", "-n", str(ranks)]
    done = subprocess.run(
        [*mpirun, sys.executable, program, *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_mpi
def test_four_ranks_make_the_vdi_of_the_same_blocks_and_all_say_what_fails(
    tmp_path, default_runtime
):
    volume = volume_of("float32")
    function = transfer_for(volume, "linear", gradient_opacities=[0.2, 1], gradient_range=(0, 30))
    camera = VIEWS["all of it"](volume)
    arguments = (volume, camera, WINDOW, function)
    options = {"max_supersegments": 8, "device": default_runtime}
    # Before, so that not each rank compiles the kernels
    expected = generate_in_blocks(*arguments, chunks=(24, 41, 27), **options)
    run(4, PROGRAM, "failing,same", tmp_path)
    (found,) = pvdi.read(tmp_path / "mpi.vdis")
    assert found.equals(expected)
    whole = generate_vdi(*arguments, **options)
    assert found.metadata["blocks"] == [2, 1, 2]
    assert found.n_supersegments > 1000
    # float32 sums of up to 200 steps, in another order: 200 x 2^-24, and as much for the other
    np.testing.assert_allclose(ray_depths(found), ray_depths(whole), rtol=2.4e-5, atol=1e-7)
    pictures = [pvdi.render(vdi, camera) for vdi in (found, whole)]
    assert np.abs(pictures[0] - pictures[1]).max() <= 1 / 255
    view = turned(camera, volume.bounds, 5)
    assert compare_images(*(pvdi.render(vdi, view) for vdi in (found, whole))).ssim > 0.99


@pytest.mark.slow
@needs_mpi
def test_a_simulation_writes_a_series(tmp_path):
    run(4, PROGRAM, "series", tmp_path)
    series = pvdi.read(tmp_path / "run.vdis")
    assert list(series.times) == [0.0, 1.0]
    assert all(vdi.n_supersegments > 1000 for vdi in series)


@needs_mpi
@pytest.mark.slow
def test_the_example_writes_a_picture_and_says_what_it_costs(tmp_path):
    said = run(2, EXAMPLE, tmp_path / "smoke.png")
    assert re.search(r"solver: \d+ ms a step; in situ: \d+ ms a VDI", said), said
    picture = np.asarray(Image.open(tmp_path / "smoke.png").convert("RGB")).astype(int)
    assert (picture[..., 0] - picture[..., 2] > 60).sum() > 200  # orange, in the spiral's middle
    assert len(pvdi.read(tmp_path / "smoke.vdis")) == 7


class OneRank:
    """A communicator of one."""

    rank, size = 0, 1

    def allgather(self, value):
        return [value]

    gather = allgather

    def alltoall(self, values):
        return values

    def scatter(self, values):
        return values[0]

    def bcast(self, value):
        return value


@pytest.fixture
def scene(default_runtime):
    pytest.importorskip("pyvista")  # its colour maps
    volume = volume_of("uint8")
    return volume, VIEWS["all of it"](volume), WINDOW


def simulate(path, scene, times, comm=None, **options):
    volume, camera, size = scene
    options = {"clim": (0, 200), "max_supersegments": 4, "comm": comm or OneRank(), **options}
    with InSitu(path, camera, size, volume.dimensions, **options) as show:
        for time in times:
            show(volume.array, (0, 0, 0), time)
    return show


def test_one_rank_keeps_the_values_of_one_piece(tmp_path, scene):
    options = {"classification": "deferred", "value_range": (20, 200), "interpolation": "linear"}
    options |= {"max_supersegments": 4, "precision": "exact"}
    path = tmp_path / "run.vdis"
    simulate(path, scene, [0.0, 1.5], clim=None, **options)
    simulate(path, scene, [2.0], clim=None, append=True, **options)
    found, expected = pvdi.read(path), pvdi.generate(*scene, **options)
    assert list(found.times) == [0.0, 1.5, 2.0]
    assert all(each.equals(expected) for each in found)
    assert found[1].metadata["time"] == 1.5
    for wrong, error, says in (
        ({"value_range": None}, InvalidArgumentError, "value_range=.* is missing"),
        ({"cmap": "bone"}, InvalidArgumentError, "cmap"),
        ({"ambient_occlusion": True}, UnsupportedError, "ambient occlusion"),
    ):
        with pytest.raises(error, match=says):
            simulate(tmp_path / "other.vdis", scene, [0.0], **{**options, "clim": None, **wrong})


def test_a_step_that_cannot_be_written_is_told_to_all_ranks(tmp_path, scene):
    told = []

    class Told(OneRank):
        def allgather(self, value):
            told.append(value)
            return [value]

    with pytest.raises(VDIFileError, match="No such file or directory"):
        simulate(tmp_path / "none" / "x.vdis", scene, [], Told())
    assert "No such file or directory" in str(told[-1])
    simulate(tmp_path / "x.vdis", scene, [])
    (tmp_path / "x.vdis" / "000000.vdi").mkdir()
    with pytest.raises(VDIFileError, match="is a folder"):
        simulate(tmp_path / "x.vdis", scene, [0.0], Told(), append=True)
    assert "is a folder" in str(told[-1])


def test_what_an_earlier_run_wrote_is_kept_or_continued(tmp_path, scene):
    volume, camera, size = scene
    path = tmp_path / "run.vdis"
    show = simulate(path, scene, [0.0, 1.0, 2.0])
    with pytest.raises(VDIFileError, match=r"is closed.*append=True"):
        show(volume.array, (0, 0, 0), 3.0)
    with pytest.raises(VDIFileError, match=r"is there already.*append=True.*overwrite=True"):
        simulate(path, scene, [0.0])
    simulate(path, scene, [3.0, 4.0], append=True)
    for wrong, message in (
        ({"times": [4.0]}, "times must ascend"),
        ({"scene": (volume, camera.azimuth(1), size)}, "its camera is"),
        ({"scene": (volume, camera, (9, 8))}, "its window_size is"),
        ({"clim": (0, 100)}, "classification"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            simulate(path, **{"scene": scene, "times": [9.0], "append": True, **wrong})
    assert list(pvdi.read(path).times) == [0.0, 1.0, 2.0, 3.0, 4.0]
    simulate(path, scene, [0.5], overwrite=True)
    assert list(pvdi.read(path).times) == [0.5]


@pytest.mark.parametrize(
    ("name", "dimensions", "options", "error", "message"),
    [
        ("x.vdis", (8, 8, 8), {}, InvalidArgumentError, "clim"),
        ("s{:02d}.vdi", (8, 8, 8), {"clim": (0, 1)}, VDIFileError, "must end in .vdis"),
        *(
            ("x.vdis", (8, 8, 8), {"clim": (0, 1), "every": every}, InvalidArgumentError, "every")
            for every in (0, "often")
        ),
        ("x.vdis", (8, 8), {"clim": (0, 1)}, InvalidArgumentError, "dimensions must be 3"),
        ("x.vdis", (8, 8, 8), {"clim": (0, 1), "colour": "red"}, TypeError, "colour"),
        (
            "x.vdis",
            (8, 8, 8),
            {"classification": "deferred", "value_range": (3, 1)},
            InvalidArgumentError,
            "value_range must be",
        ),
    ],
)
def test_what_is_missing_is_said(name, dimensions, options, error, message, tmp_path):
    camera = VIEWS["all of it"](volume_of("uint8"))
    with pytest.raises(error, match=message):
        InSitu(tmp_path / name, camera, WINDOW, dimensions, comm=OneRank(), **options)
