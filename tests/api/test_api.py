"""The public functions: what they take, what they refuse, and how the refusal reads."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import api
from pyvista_vdi.errors import MissingDependencyError
from pyvista_vdi.model import classification
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (24, 16)


def small_volume(**options):
    z, y, x = np.mgrid[:9, :8, :7]
    return pvdi.Volume((x * y + z).astype(np.float32), (1.0, 1.0, 0.5), **options)


def ramp(volume, **options):
    shades = np.linspace(0, 1, 16)
    colors = np.stack([shades, shades**2, 1 - shades], axis=1)
    return pvdi.TransferFunction(colors, shades * 0.7, volume.finite_range(), **options)


@pytest.fixture(scope="module")
def volume():
    return small_volume()


@pytest.fixture(scope="module")
def camera(volume):
    return filling_camera(volume.bounds, SIZE)


def test_a_volume_becomes_a_vdi_a_file_and_a_picture(volume, camera, default_runtime, tmp_path):
    table = ramp(volume)
    heard = []
    vdi = api.generate(
        volume, camera, SIZE, transfer_function=table, max_supersegments=64, progress=heard.append
    )
    assert vdi.window_size == SIZE
    assert heard[-1] == 1
    assert vdi.metadata["scalars"] == "values"
    read = api.read(vdi.save(tmp_path / "a.vdi"))
    assert read.equals(vdi)
    image = api.render(read, camera)
    direct = api.render_volume(volume, camera, SIZE, transfer_function=table)
    assert image.shape == direct.shape == (SIZE[1], SIZE[0], 4)
    assert image.dtype == direct.dtype == np.float32
    assert direct.max() > 0.1
    # Unlimited lists, same step, same rays: only merging and float32 differ (issue 2: 2/255)
    assert np.abs(image - direct).max() < 2 / 255
    assert api.render(vdi, camera, (12, 8)).shape == (8, 12, 4)


def test_vtk_objects_give_the_same_as_ours(volume, camera, default_runtime):
    pv = pytest.importorskip("pyvista")
    from pyvista_vdi.vtk_pipeline import vdi_to_image

    grid = pv.ImageData(dimensions=volume.dimensions, spacing=volume.spacing)
    grid["values"] = volume.array.ravel()
    view = pv.Camera()
    view.position, view.focal_point, view.up = camera.position, camera.focal_point, (0, 0, 1)
    view.view_angle = camera.view_angle
    arguments = {"cmap": "viridis", "opacity": "sigmoid_5", "clim": (0, 40)}
    ours = api.generate(volume, camera, SIZE, **arguments)
    theirs = api.generate(grid, view, SIZE, **arguments)
    assert theirs.equals(ours)
    assert ours.metadata["classification"]["cmap"] == "viridis"
    picture = api.render_volume(grid, view, SIZE, **arguments)
    assert np.array_equal(picture, api.render_volume(volume, camera, SIZE, **arguments))
    # The VTK form of a VDI is rendered
    assert np.array_equal(api.render(vdi_to_image(ours), camera), api.render(ours, camera))


def test_names_need_the_plot_extra(volume, camera, monkeypatch):
    monkeypatch.setattr(classification, "find_spec", lambda name: None)
    message = r'not installed: install it by pip install "pyvista-vdi\[plot\]", or pass transfer_fu'
    with pytest.raises(MissingDependencyError, match=message):
        api.generate(volume, camera, SIZE, cmap="bone")


def test_add_vdi_begins_as_add_volume():
    pv = pytest.importorskip("pyvista")
    from pyvista_vdi.plotting.component import AddVDI

    theirs = inspect.signature(pv.Plotter.add_volume).parameters
    ours = inspect.signature(AddVDI.__call__).parameters
    known = [each.name for each in theirs.values() if each.kind is each.POSITIONAL_OR_KEYWORD]
    assert [*ours][: len(known)] == known
    assert {n: ours[n].default for n in known} == {n: theirs[n].default for n in known}
