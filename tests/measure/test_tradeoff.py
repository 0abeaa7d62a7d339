"""The tradeoff: sweeps, tiny runs, and what is made of their figures."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.measure.tradeoff import (
    COSTS,
    Point,
    dominates,
    measure_tradeoff,
    sweep,
)

TINY = {"window_size": (32, 24), "angles": (0, 30), "repeats": 3, "generations": 1, "vtk": False}


@pytest.fixture(scope="module")
def shell():
    """A hollow ball in a block, and how it looks."""
    z, y, x = np.mgrid[-1:1:14j, -1:1:18j, -1:1:20j]
    radius = np.sqrt(x * x + y * y + z * z)
    values = np.rint(255 * np.exp(-(((radius - 0.7) / 0.15) ** 2))).astype(np.uint8)
    ramp = np.linspace(0, 1, 16)
    return pvdi.Volume(values), pvdi.TransferFunction(np.stack([ramp] * 3, 1), ramp, (0, 255))


def point(cost, ssim, **setting):
    costs = dict.fromkeys(COSTS, 1.0) | {"frame": cost}
    return Point(setting, costs, {0: cost}, {0: ssim})


def test_a_tiny_run_measures_what_each_setting_costs_and_gives(shell, default_runtime):
    volume, look = shell
    settings = sweep({"max_supersegments": (2,), "precision": ("8-byte",)})
    found = measure_tradeoff(volume, settings, transfer_function=look, **TINY)
    whole, short, packed = found.points
    assert [one.name for one in found.points[:2]] == ["default", "max_supersegments 2"]
    assert min(whole.ssims[0], packed.ssims[0]) > 0.999  # from V_O nothing is lost
    assert short.ssims[30] < whole.ssims[30] + 0.001
    assert short.costs["memory"] < whole.costs["memory"]
    assert packed.costs["memory"] < 0.6 * whole.costs["memory"]
    assert packed.costs["file"] < whole.costs["file"]
    assert all(cost > 0 for one in found.points for cost in one.costs.values())
    assert found.front("memory")[0] in ("max_supersegments 2", "precision 8-byte")
    table = found.table()
    assert all(f"| {one.name} |" in table for one in found.points)


def test_the_command_writes_figures_and_a_table(shell, tmp_path, capsys, default_runtime):
    np.save(tmp_path / "ball.npy", shell[0].array)
    run = ["tradeoff", str(tmp_path / "ball.npy"), "--size", "32x24", "--angles", "0,30"]
    run += ["--repeats", "1", "--generations", "1", "--no-vtk", "--out", str(tmp_path / "out")]
    assert cli.main([*run, "--sweep", "max-supersegments=2,3", "lists=0.5"]) == 0
    found = json.loads((tmp_path / "out" / "tradeoff-ball.json").read_text(encoding="utf-8"))
    settings = [{}, *({"max_supersegments": n} for n in (2, 3)), {"lists": 0.5}]
    assert [one["setting"] for one in found["points"]] == settings
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {f"tradeoff-ball.{kind}" for kind in ("json", "md", "png")}
    assert "memory against SSIM: " in capsys.readouterr().out
    assert cli.main([*run, "--sweep", "sides=2"]) == 1
    assert "--sweep knows no 'sides'" in capsys.readouterr().err
    assert cli.main([*run, "--sweep", "lists=many"]) == 1
    assert "--sweep lists takes numbers; got 'many'" in capsys.readouterr().err


def test_a_setting_dominates_that_is_better_and_nowhere_worse():
    slow, fast = point(1.0, 0.98), point(0.8, 0.98)
    assert dominates(fast, slow)
    assert not dominates(slow, fast)
    # Faster, and worse by more than what does not count
    assert not dominates(point(0.8, 0.979), slow)
