"""Volumes in stores of chunks on the command line."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main

VALUES = np.add.outer(np.add.outer(np.arange(16), np.arange(24)), np.arange(32)).astype(np.uint8)
LOOK = ("--cmap", "bone", "--opacity", "linear", "--clim", "0", "80")


@pytest.fixture
def image(tmp_path):
    """An image of OME-Zarr 0.4 at two levels, its metadata by hand, and two channels."""
    zarr = pytest.importorskip("zarr")
    path = tmp_path / "x.ome.zarr"
    new = {"zarr_format": 2} if int(zarr.__version__.split(".")[0]) > 2 else {}
    group = zarr.open_group(str(path), mode="w", **new)
    datasets = []
    for level in (0, 1):
        values = VALUES[:: 2**level, :: 2**level, :: 2**level]
        how = {"shape": (2, *values.shape), "chunks": (1, 8, 8, 8), "dtype": "u1", **new}
        array = zarr.open(str(path / str(level)), mode="w", **how)
        array[0], array[1] = values, values // 2
        scale = {"type": "scale", "scale": [1] + [0.5 * 2**level] * 3}
        datasets.append({"path": str(level), "coordinateTransformations": [scale]})
    axes = [{"name": "c", "type": "channel"}]
    axes += [{"name": n, "type": "space", "unit": "micrometer"} for n in "zyx"]
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": datasets}]
    group.attrs["omero"] = {"channels": [{"label": "dapi"}, {"label": "gfp"}]}
    return path


@pytest.mark.extension("large")
def test_generate_says_the_level(image, tmp_path, capsys, default_runtime):
    target = tmp_path / "x.vdi"
    files = (str(image), "-o", str(target), "--size", "8x4", "--channel", "gfp", *LOOK)
    assert main(["generate", *files]) == 0
    assert "level 1 of 2: 16 x 12 x 8 points" in capsys.readouterr().err
    assert pvdi.read(target).metadata["volume"]["dimensions"] == [16, 12, 8]
    assert main(["generate", *files, "--level", "0"]) == 0
    assert "level 0 of 2: 32 x 24 x 16 points" in capsys.readouterr().err
