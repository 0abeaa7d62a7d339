"""The verb ``paraview``: where the plugin is, and what ParaView's Python must see."""

from __future__ import annotations

import importlib.util
import sys
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.paraview import cli as verb
from pyvista_vdi.extensions.paraview.parts.client import require_one_process
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.vtk_pipeline import vdi_from_image, volume_from_vtk
from pyvista_vdi.vtk_pipeline.vtk import BACKEND, vtk_to_numpy


def test_a_server_of_several_ranks_is_refused_when_the_plugin_is_loaded():
    with pytest.raises(ImportError, match=r"has 4 ranks, .* without mpirun, or .*InSitu"):
        require_one_process(SimpleNamespace(GetNumberOfProcesses=lambda: 4))
    require_one_process(SimpleNamespace(GetNumberOfProcesses=lambda: 1))
    require_one_process(None)


@pytest.fixture
def plugin(monkeypatch):
    """The plugin as ParaView loads it, by decorators that note the XML, and no client."""

    def decorator(*args, **named):
        def decorated(cls):
            cls.told = [*vars(cls).get("told", ()), *args]
            return cls

        return decorated

    kinds = ("filter", "reader", "writer", "xml", "input", "datatype")
    noting = SimpleNamespace(**dict.fromkeys(kinds, decorator))
    server = SimpleNamespace(vtkSMProxyManager=SimpleNamespace(IsInitialized=lambda: False))
    parts = dict.fromkeys(("smdomain", "smhint", "smproperty", "smproxy"), noting)
    for name, module in (
        *((name, SimpleNamespace()) for name in ("paraview", "paraview.util", "paraview.modules")),
        ("paraview.util.vtkAlgorithm", SimpleNamespace(**parts)),
        ("paraview.modules.vtkRemotingServerManager", server),
    ):
        monkeypatch.setitem(sys.modules, name, module)
    specification = importlib.util.spec_from_file_location("vdi_plugin", verb.PLUGIN)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


CLASSES = ("VDISourceFilter", "VDIToImageFilter", "VDIFileReader", "VDIFileWriter")


@pytest.mark.skipif(BACKEND != "vtkmodules", reason="ParaView has VTK's own build")
def test_the_plugin_makes_a_vdi_and_its_picture(plugin, tmp_path, default_runtime):
    for cls in (getattr(plugin, name) for name in CLASSES):
        xml = "".join(cls.told)
        for prop in ET.fromstring(f"<a>{xml}</a>").iter():
            if (command := prop.get("command")) is not None:
                assert callable(getattr(cls, command)), command
    source, picture, reader, writer = (getattr(plugin, name)() for name in CLASSES)
    ball = soft_ball(12)
    source.SetInputDataObject(ball)
    source.SetSize(40, 30)
    source.SetAzimuth(20.0)
    source.SetInterpolation(1)
    picture.SetInputConnection(source.GetOutputPort())
    picture.SetElevation(5.0)
    shown = picture.GetImage().GetPointData().GetArray("premultiplied")
    shown = vtk_to_numpy(shown).reshape(30, 40, 4)[::-1]
    camera = filling_camera(ball.bounds, (40, 30), 20.0)
    ramp = pvdi.TransferFunction([(0, 0, 0), (1, 1, 1)], [0, 1], ball.get_data_range("v"))
    unit_distance = volume_from_vtk(ball).default_unit_distance
    ramp = ramp.replace(interpolation="linear", unit_distance=unit_distance)
    expected = pvdi.generate(ball, camera, (40, 30), transfer_function=ramp)
    assert shown[..., 3].max() > 0.1
    np.testing.assert_allclose(shown, pvdi.render(expected, camera.elevation(5)), atol=1e-5)
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(str(tmp_path / "a.vdi"))
    writer.SetPrecisionName("8-byte")
    writer.Write()
    reader.SetFileName(str(tmp_path / "a.vdi"))
    reader.Update()
    read = vdi_from_image(reader.GetOutputDataObject(0))
    assert read.equals(source.GetVDI().with_precision("8-byte"))
    source.SetCameraPosition(0, -9, 0.5)
    source.SetView(1)
    source.SetAzimuth(0.0)
    assert source.GetVDI().camera.position == (0, -9, 0.5)
    picture.SetInputConnection(source.GetOutputPort())
    assert picture.GetImage().GetNumberOfPoints() == 40 * 30
