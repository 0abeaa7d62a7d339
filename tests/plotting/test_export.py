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
WINDOW = (60, 50)


def added(plotter):
    actor = plotter.add_vdi(soft_ball(8), show_scalar_bar=False)
    plotter.add_mesh(pv.Sphere())
    plotter.show(auto_close=False)
    return actor.mapper


def serialized(mapper):
    """What the serialisers of trame-vtk and of vtkmodules.web ask a volume mapper for."""
    mapper.GetInputAlgorithm().Update()
    return mapper.GetInputDataObject(0, 0)


def test_asking_for_the_data_to_be_exported_warns_once_and_nothing_else_does(plotter):
    mapper = added(plotter)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plotter.render()
        plotter.screenshot(return_img=True)
        plotter.reset_camera()
        assert len(plotter.meshes) == 2
        mapper.dataset  # noqa: B018
        assert mapper.GetInput() is not None
    with pytest.warns(VDIWarning, match=MESSAGE):
        proxy = serialized(mapper)
    assert proxy.GetDimensions() == (2, 2, 2)
    serialized(mapper)  # warnings are errors: it is not said again
    alone = pvdi.VDIMapper()  # VTK's own
    alone.SetVDI(vdi_of_one_list())
    with pytest.warns(VDIWarning, match=MESSAGE):
        serialized(alone)


@pytest.mark.parametrize("what", ["export_html", "export_vtksz"])
def test_exports_of_trame_warn(plotter, what):
    pytest.importorskip("trame_pyvista")
    added(plotter)
    with pytest.warns(VDIWarning, match=MESSAGE):
        getattr(plotter.trame, what)(None)
