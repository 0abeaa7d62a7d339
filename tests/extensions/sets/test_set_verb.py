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
def volume(tmp_path_factory):
    path = tmp_path_factory.mktemp("volume") / "v.npy"
    z, y, x = np.mgrid[:9, :9, :9] - 4
    np.save(path, (250 * np.exp(-(x**2 + 2 * y**2 + z**2) / 9)).astype(np.uint8))
    return path


@pytest.fixture(scope="module")
def saved(volume, tmp_path_factory, default_runtime):
    pytest.importorskip("pyvista")
    path = tmp_path_factory.mktemp("sets") / "a.vdiset"
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


@pytest.mark.gl
def test_it_is_viewed(saved, capsys, tmp_path):
    assert "written" in run(capsys, "view", saved, "--screenshot", tmp_path / "v.png")


def test_it_is_converted(saved, capsys, tmp_path):
    vdis = pvdi.read(saved)
    again = tmp_path / "b.vdiset"
    run(capsys, "convert", saved, "-o", again, "--compression", "deflate")
    assert all(one.equals(two) for one, two in zip(pvdi.read(again), vdis, strict=True))
    run(capsys, "convert", saved, "-o", tmp_path / "a.html")
    assert len(pvdi.read(tmp_path / "a.html")) == len(vdis)
