"""Volumes in VTK's files, and volumes of all formats through the subcommands."""

from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest
import pyvista as pv
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import registry
from pyvista_vdi.cli.inputs import read_volume
from pyvista_vdi.errors import InvalidVolumeError

SPACING, ORIGIN = np.array([1.0, 1.5, 2.5]), np.array([-10.0, 20.0, 30.0])
SCAN = (np.arange(210).reshape(5, 6, 7) * 7 % 211).astype(np.int16)


def turned():
    c, s = np.cos(0.5), np.sin(0.5)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def grid(direction=None):
    direction = np.eye(3) if direction is None else direction
    image = pv.ImageData(
        dimensions=(7, 6, 5), spacing=SPACING, origin=ORIGIN, direction_matrix=direction
    )
    image["ct"] = SCAN.ravel()
    return image


def rectilinear(step=0.0):
    x, y, z = (ORIGIN[i] + SPACING[i] * np.arange(SCAN.shape[2 - i]) for i in range(3))
    x[-1] += step
    uneven = pv.RectilinearGrid(x, y, z)
    uneven["ct"] = SCAN.ravel()
    return uneven


def read(path, **options):
    """Read as every subcommand does that takes a volume."""
    absent = ("example", "scalars", "preference", "spacing", "origin", "level", "channel")
    absent += ("time_index", "series")
    return read_volume(Namespace(**dict.fromkeys(absent) | {"file": str(path)} | options))


@pytest.mark.parametrize("name", ["a.vti", "a.vtk", "text.vtk", "a.vtr", "a.vtm"])
def test_vtks_files(name, tmp_path):
    data = rectilinear() if name == "a.vtr" else grid(turned() if name == "a.vti" else None)
    data = pv.MultiBlock([data]) if name == "a.vtm" else data
    data.save(tmp_path / name, binary=name != "text.vtk")
    volume = read(tmp_path / name)
    assert (volume.name, volume.array.dtype) == ("ct", SCAN.dtype)
    np.testing.assert_array_equal(volume.array, SCAN)
    assert (volume.spacing, volume.origin) == (tuple(SPACING), tuple(ORIGIN))
    np.testing.assert_allclose(volume.direction, turned() if name == "a.vti" else np.eye(3))


@pytest.mark.parametrize("name", ["a.vtk", "a.vti", "a.vtr"])
def test_what_is_cut_off_is_refused(name, tmp_path, capfd):
    (rectilinear() if name == "a.vtr" else grid()).save(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    for share in (0, 0.3, 0.6):
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InvalidVolumeError, match=name.replace(".", r"\.")):
            read(tmp_path / name)
    assert capfd.readouterr() == ("", "")


def test_a_vdi_is_no_volume(tmp_path):
    vdi = random_vdi(np.random.default_rng(1))
    for name in ("a.vdi", *["a.exr"] * ("deep_exr" in registry.extensions())):
        vdi.save(tmp_path / name)
        with pytest.raises(InvalidVolumeError, match=f"{name} is a VDI, not a volume"):
            read(tmp_path / name)
    pv.read(tmp_path / "a.vdi").save(tmp_path / "a.vti")
    with pytest.raises(InvalidVolumeError, match=r"a\.vti is a VDI in its VTK form"):
        read(tmp_path / "a.vti")


@pytest.mark.gl
@pytest.mark.parametrize(("distance", "points"), [(4000, 8), (60, 32)])
def test_a_store_is_shown_at_the_level_of_the_view(distance, points, tmp_path, default_runtime):
    zarr = pytest.importorskip("zarr")
    new = {"zarr_format": 2} if int(zarr.__version__.split(".")[0]) > 2 else {}
    group, values = zarr.open_group(tmp_path, mode="w", **new), np.ones((32,) * 3, "u1")
    levels = [(str(k), step) for k, step in enumerate((1, 2, 4))]
    for path, step in levels:
        zarr.save_array(str(tmp_path / path), values[::step, ::step, ::step], **new)
    scales = [{"type": "scale", "scale": [float(step)] * 3} for _, step in levels]
    sets = [
        {"path": path, "coordinateTransformations": [scale]}
        for (path, _), scale in zip(levels, scales, strict=True)
    ]
    axes = [{"name": name, "type": "space"} for name in "zyx"]
    group.attrs["multiscales"] = [{"version": "0.4", "datasets": sets, "axes": axes}]
    plotter = pv.Plotter(off_screen=True, window_size=(64, 48))
    plotter.camera_position = ((16, 16, distance), (16, 16, 16), (0, 1, 0))
    actor = plotter.add_vdi(pvdi.read_volume(tmp_path), clim=(0, 2))
    assert actor.mapper.dataset.dimensions == (points,) * 3
    # Opacities are of the finest level's voxels
    assert actor.prop.opacity_unit_distance == pytest.approx(3**0.5, rel=0.05)
    plotter.close()
