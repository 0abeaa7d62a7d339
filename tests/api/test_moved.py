"""Every path that docs/api.md of 0.1.0 named leads to the same object, with a warning."""

from __future__ import annotations

import importlib
import sys

import pytest

#: The former module, the module of today, and names that were documented under the former.
MOVED = """
ambient_occlusion model.ambient_occlusion AmbientOcclusion
background quality.background BackgroundGeneration
benchmark measure.paper run describe compare_results describe_changes find_dataset paper_cell
benchmark measure.paper read_results Plan Results Dataset Change PaperCell
camera model.camera Camera
compare measure.compare measure table contact_sheet judge_vdi judge_vtk judge_times Settings
compare measure.compare Report AngleResult Timing Check
cropping model.cropping Cropping
dial quality.dial Dial Choice Prediction Setting
dial_measurement quality.probe choose forget
frame_rate quality.frame_rate FrameRateController
lighting model.lighting Light Lights Shading
metrics model.metrics Comparison
opencl_runtime device DeviceInfo
picking raycasting.picking pick_vdi
standard_cases model.standard_cases filling_camera TRANSFER_FUNCTIONS ANGLES ELEVATION
standard_cases model.standard_cases VIEW_ANGLE WINDOW_SIZE
tradeoff measure.tradeoff measure_tradeoff sweep Setting Tradeoff Point Figure dominates
tradeoff measure.tradeoff find_dominated front
transfer_function model.transfer_function TransferFunction
vdi model.vdi VDI
view_error quality.view_error ViewErrorEstimator ViewError angle_from_generating_view
view_error quality.view_error magnification
vtk_pipeline.actor vtk_pipeline.drawing.actor VDIActor
vtk_pipeline.convert vtk_pipeline.filters.convert volume_from_vtk transfer_function_from_property
vtk_pipeline.convert vtk_pipeline.filters.convert vdi_to_image vdi_from_image
vtk_pipeline.dense vtk_pipeline.filters.dense vdi_to_dense_image vdi_from_dense_image
vtk_pipeline.dense vtk_pipeline.filters.dense VDIToDenseImage
vtk_pipeline.files vtk_pipeline.filters.files VDIReader VDIWriter
vtk_pipeline.image vtk_pipeline.filters.image VDIToImage
vtk_pipeline.mapper vtk_pipeline.drawing.mapper VDIMapper
vtk_pipeline.properties vtk_pipeline.filters.properties transfer_function_from_property
vtk_pipeline.source vtk_pipeline.filters.source VDISource
vtk_pipeline.status vtk_pipeline.interaction.status VDIStatus
"""

#: The same of names in packages that were modules, and of what lies where it did.
NAMES = """
generation           generation.estimate  Estimate
generation           generation.generate  generate_vdi
volume               model.volume         Volume
"""
UNMOVED = """
plotting.component   AddVDI
plotting.accessor    VDIAccessor
plotting.reader      read_vdi
plotting.writer      write_vdi
plotting.actor       PlotterVDIActor
reference            RaySamples ambient_transmittance build_vdi render render_joint samples
reference            render_joint_range render_pixels render_range volume_image
examples             available load_brain load_ct load_data path VOLUMES WHOLE ExampleVolume
errors               VDIError
"""


def rows(table):
    return [line.split(maxsplit=2) for line in table.strip().splitlines()]


def module(name):
    if name.startswith(("vtk_pipeline", "plotting")):
        pytest.importorskip("pyvista")
    return importlib.import_module(f"pyvista_vdi.{name}")


@pytest.mark.parametrize(("old", "new", "names"), rows(MOVED), ids=lambda text: text.split()[0])
def test_documented_names_are_found_where_they_were(old, new, names, monkeypatch):
    package, _, attribute = f"pyvista_vdi.{old}".rpartition(".")
    # Forgotten now and after the test: it warns when it is first imported
    monkeypatch.setitem(sys.modules, f"pyvista_vdi.{old}", None)
    del sys.modules[f"pyvista_vdi.{old}"]
    today = module(new)
    monkeypatch.setattr(importlib.import_module(package), attribute, None, raising=False)
    said = rf"pyvista_vdi\.{old} has moved to pyvista_vdi\.{new}; .*goes with the next release"
    with pytest.warns(DeprecationWarning, match=said):
        found = module(old)
    for name in names.split():
        assert getattr(found, name) is getattr(today, name)
    assert set(names.split()) <= set(dir(found))
    with pytest.raises(AttributeError):
        _ = found.there_is_no_such_name


@pytest.mark.parametrize(("package", "home", "name"), rows(NAMES))
def test_names_of_modules_that_are_packages_today(package, home, name):
    with pytest.warns(DeprecationWarning, match=f"{package}.{name} has moved"):
        old = getattr(module(package), name)
    assert old is getattr(module(home), name)
    with pytest.raises(AttributeError, match=f"{package}' has no attribute 'nothing'"):
        _ = module(package).nothing


def test_what_has_not_moved_is_there():
    for name, *names in map(str.split, UNMOVED.strip().splitlines()):
        assert all(hasattr(module(name), each) for each in names), name
    with pytest.raises(ModuleNotFoundError, match="pyvista_vdi.nothing"):
        importlib.import_module("pyvista_vdi.nothing")
