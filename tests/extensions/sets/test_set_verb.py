"""The verb ``set``, and what others do with the file that it writes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import run

import pyvista_vdi as pvdi
from pyvista_vdi import cli

SIZE = (32, 24)


@pytest.fixture(scope="module")
def saved(tmp_path_factory, default_runtime):
    pytest.importorskip("pyvista")
    path = tmp_path_factory.mktemp("sets") / "a.vdiset"
    volume = path.with_name("v.npy")
    z, y, x = np.mgrid[:9, :9, :9] - 4
    np.save(volume, (250 * np.exp(-(x**2 + 2 * y**2 + z**2) / 9)).astype(np.uint8))
    options = "--size 32x24 --cmap bone --lists 1 --max-supersegments 3 --half-angle 120"
    assert cli.main(["set", str(volume), "-o", str(path), *options.split(), "--views", "9"]) == 0
    return path


def test_a_volume_becomes_a_set(saved, capsys):
    vdis = pvdi.read(saved)
    assert isinstance(vdis, pvdi.VDISet)
    assert len(vdis) == 9
    assert vdis.window_size == SIZE
    assert {vdi.metadata["max_supersegments"] for vdi in vdis} == {3}
    state = json.loads(run(capsys, "info", saved, "--json"))
    assert len(state["views"]) == len(vdis)


def test_it_is_viewed_and_converted(saved, capsys, tmp_path):
    vdis = pvdi.read(saved)
    run(capsys, "convert", saved, "-o", tmp_path / "a.html")
    assert len(pvdi.read(tmp_path / "a.html")) == len(vdis)
    assert "written" in run(capsys, "view", saved, "--screenshot", tmp_path / "v.png")
