"""Every path that docs/api.md of 0.1.0 named leads to the same object, with a warning."""

from __future__ import annotations

import importlib
import sys

import pytest

from pyvista_vdi import _moved

#: Names that were documented under the module's former path, and the module of today.
DOCUMENTED = {
    "opencl_runtime": ("device", "DeviceInfo"),
    "vtk_pipeline.image": ("vtk_pipeline.filters.image", "VDIToImage"),
    "vtk_pipeline.files": ("vtk_pipeline.filters.files", "VDIReader VDIWriter"),
    "vtk_pipeline.status": ("vtk_pipeline.interaction.status", "VDIStatus"),
    "vtk_pipeline.convert": (
        "vtk_pipeline.filters.convert",
        "volume_from_vtk transfer_function_from_property vdi_to_image vdi_from_image",
    ),
    "vtk_pipeline.dense": (
        "vtk_pipeline.filters.dense",
        "vdi_to_dense_image vdi_from_dense_image VDIToDenseImage",
    ),
    "frame_rate": ("quality.frame_rate", "FrameRateController"),
    "background": ("quality.background", "BackgroundGeneration"),
    "view_error": (
        "quality.view_error",
        "ViewErrorEstimator ViewError angle_from_generating_view magnification",
    ),
    "dial": ("quality.dial", "Dial Choice Prediction Setting"),
    "dial_measurement": ("quality.probe", "choose forget"),
    "compare": (
        "measure.compare",
        (
            "measure table contact_sheet judge_vdi judge_vtk judge_times Settings Report "
            "AngleResult Timing Check"
        ),
    ),
    "benchmark": (
        "measure.paper",
        (
            "run describe compare_results describe_changes find_dataset paper_cell read_results "
            "Plan Results Dataset Change PaperCell"
        ),
    ),
    "tradeoff": (
        "measure.tradeoff",
        "measure_tradeoff sweep Setting Tradeoff Point Figure dominates find_dominated front",
    ),
    "standard_cases": (
        "model.standard_cases",
        "filling_camera TRANSFER_FUNCTIONS ANGLES ELEVATION VIEW_ANGLE WINDOW_SIZE",
    ),
    "metrics": ("model.metrics", "Comparison"),
}

#: Documented paths that are what they were.
UNMOVED = {
    "plotting.component": "AddVDI",
    "plotting.accessor": "VDIAccessor",
    "plotting.reader": "read_vdi",
    "plotting.writer": "write_vdi",
    "plotting.actor": "PlotterVDIActor",
    "reference": (
        "RaySamples ambient_transmittance build_vdi render render_joint render_joint_range "
        "render_pixels render_range samples volume_image"
    ),
    "examples": (
        "available load_brain load_ct load_data load_rayleigh_taylor path VOLUMES WHOLE "
        "ExampleVolume"
    ),
    "errors": "VDIError",
}


def in_package(name):
    return f"pyvista_vdi.{name}"


@pytest.fixture
def unimported(monkeypatch):
    """Forgets a module, now and after the test: it warns when it is first imported."""

    def forget(name):
        package, _, attribute = in_package(name).rpartition(".")
        monkeypatch.setitem(sys.modules, in_package(name), None)
        del sys.modules[in_package(name)]
        monkeypatch.setattr(importlib.import_module(package), attribute, None, raising=False)

    return forget


@pytest.mark.parametrize("old", DOCUMENTED)
def test_documented_names_are_found_where_they_were(old, unimported):
    new, names = DOCUMENTED[old]
    if old.startswith("vtk_pipeline"):
        pytest.importorskip("pyvista")
    unimported(old)
    with pytest.warns(DeprecationWarning, match=f"{in_package(old)} has moved to.*{new}"):
        module = importlib.import_module(in_package(old))
    today = importlib.import_module(in_package(new))
    for name in names.split():
        assert getattr(module, name) is getattr(today, name)
    assert set(names.split()) <= set(dir(module))
    with pytest.raises(AttributeError):
        _ = module.there_is_no_such_name


@pytest.mark.parametrize("old", sorted(_moved.MODULES))
def test_every_former_module_leads_somewhere(old, unimported):
    if old.startswith("vtk_pipeline"):
        pytest.importorskip("pyvista")
    unimported(old)
    with pytest.warns(DeprecationWarning, match="goes with the next release"):
        importlib.import_module(in_package(old))
    assert importlib.import_module(in_package(_moved.MODULES[old]))


@pytest.mark.parametrize(
    ("package", "name"), [(p, n) for p, names in _moved.NAMES.items() for n in names]
)
def test_names_of_modules_that_are_packages_today(package, name):
    module = importlib.import_module(in_package(package))
    with pytest.warns(DeprecationWarning, match=f"{package}.{name} has moved"):
        old = getattr(module, name)
    home = importlib.import_module(in_package(_moved.NAMES[package][name]))
    assert old is getattr(home, name)


@pytest.mark.parametrize("module", UNMOVED)
def test_what_has_not_moved_is_there(module):
    if module.startswith("plotting"):
        pytest.importorskip("pyvista")
    found = importlib.import_module(in_package(module))
    for name in UNMOVED[module].split():
        assert hasattr(found, name), name


def test_what_never_was_is_no_module():
    with pytest.raises(ModuleNotFoundError, match="pyvista_vdi.nothing"):
        importlib.import_module("pyvista_vdi.nothing")
