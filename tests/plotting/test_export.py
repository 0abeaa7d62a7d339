"""Scenes that are written for another renderer: that the VDI is missing there is said by name."""

from __future__ import annotations

import warnings

import pytest
import pyvista as pv
from plugin_scenes import soft_ball, vdi_of_one_list

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIWarning

pytestmark = pytest.mark.gl

MESSAGE = (
    "exported without its VDI: trame's export_html, export_vtksz and views .* empty box.*"
    "plotter.export_html, screenshots"
)


@pytest.fixture
def plotter():
    plotter = pv.Plotter(window_size=(60, 50), off_screen=True)
    plotter.add_vdi(soft_ball(8), show_scalar_bar=False)
    plotter.add_mesh(pv.Sphere())
    plotter.show(auto_close=False)
    yield plotter
    plotter.close()


def serialized(mapper):
    """What the serialisers of trame-vtk and of vtkmodules.web ask a volume mapper for."""
    mapper.GetInputAlgorithm().Update()
    return mapper.GetInputDataObject(0, 0)


def test_asking_for_the_data_to_be_exported_warns_once(plotter):
    mapper = plotter.mapper if hasattr(plotter.mapper, "painter") else plotter.volume.mapper
    with pytest.warns(VDIWarning, match=MESSAGE):
        proxy = serialized(mapper)
    assert proxy.GetDimensions() == (2, 2, 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        serialized(mapper)


def test_vtks_own_mapper_warns_too():
    mapper = pvdi.VDIMapper()
    mapper.SetVDI(vdi_of_one_list())
    with pytest.warns(VDIWarning, match=MESSAGE):
        serialized(mapper)


def test_what_draws_and_what_looks_at_the_scene_does_not_warn(plotter):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plotter.render()
        plotter.screenshot(return_img=True)
        plotter.reset_camera()
        assert len(plotter.meshes) == 2
        plotter.volume.mapper.dataset  # noqa: B018
        assert plotter.volume.mapper.GetInput() is not None


@pytest.mark.parametrize("what", ["export_html", "export_vtksz"])
def test_exports_of_trame_warn(plotter, what):
    pytest.importorskip("trame_pyvista")
    with pytest.warns(VDIWarning, match=MESSAGE):
        getattr(plotter.trame, what)(None)
