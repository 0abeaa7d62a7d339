"""Which build of VTK is used, by PyVista's rules, and that no objects of another one get in."""

from __future__ import annotations

import ast
from importlib.util import find_spec
from pathlib import Path

import pytest
import pyvista as pv
from fresh_python import run_python
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import MissingDependencyError, UnsupportedError
from pyvista_vdi.vtk_pipeline import (
    VDIWriter,
    transfer_function_from_property,
    vdi_from_image,
    volume_from_vtk,
    vtk,
)

needs_cvista = pytest.mark.skipif(find_spec("cvista") is None, reason="cvista is not installed")
needs_choice = pytest.mark.skipif(
    not hasattr(pv, "vtk_backend"), reason="PyVista before 0.49 has no choice of VTK's build"
)

ASK = "from pyvista_vdi.vtk_pipeline.vtk import BACKEND; print(BACKEND)"


def output_of(code, **environment):
    result = run_python(code, **environment)
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


@pytest.mark.parametrize(
    ("expected", "chosen", "pyvista", "absent"),
    [
        ("cvista", "", "0.49.0", ""),
        ("cvista", "", "0.50.0.dev0", ""),
        ("vtkmodules", "", "0.49.0", "cvista"),
        ("vtkmodules", "", "0.49.0", "pyvista"),
        ("vtkmodules", "", "0.48.4", ""),
        ("vtkmodules", "cvista", "0.48.4", ""),
        ("vtkmodules", "vtk", "0.49.0", ""),
        ("vtkmodules", "vtkmodules", "0.49.0", ""),
        ("another", "another", "0.49.0", ""),
        ("cvista", "cvista", "0.49.0", ""),
    ],
)
def test_the_build_is_what_pyvista_would_choose(tmp_path, expected, chosen, pyvista, absent):
    for name in ("pyvista", "cvista"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    about = tmp_path / f"pyvista-{pyvista}.dist-info" / "METADATA"
    about.parent.mkdir()
    about.write_text(f"Metadata-Version: 2.1\nName: pyvista\nVersion: {pyvista}\n")
    head = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
    head += f"sys.modules[{absent!r}] = None\n" if absent else ""
    assert output_of(head + ASK, PYVISTA_VTK_BACKEND=chosen) == [expected]
    head += "sys.modules['paraview'] = sys\n"
    assert output_of(head + ASK, PYVISTA_VTK_BACKEND=chosen) == ["vtkmodules"]


@needs_choice
@pytest.mark.parametrize("first", [ASK, "import pyvista"])
@pytest.mark.parametrize("chosen", ["", "vtk", pytest.param("cvista", marks=needs_cvista)])
def test_pyvista_and_this_package_choose_the_same(first, chosen):
    last = "import pyvista as pv; print(pv.vtk_backend().replace('vtk', 'vtkmodules'))"
    found = output_of(f"{first}\n{ASK}\n{last}", PYVISTA_VTK_BACKEND=chosen)
    assert len(set(found)) == 1
    if chosen == "cvista":
        assert found[0] == "cvista"


def test_the_build_has_every_name_that_the_package_takes_from_it():
    package = Path(pvdi.__file__).parent
    names = {
        alias.name
        for path in package.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module == "pyvista_vdi.vtk_pipeline.vtk"
        for alias in node.names
    }
    assert {"vtkImageData", "numpy_to_vtk"} < names
    # The first is done without; the editor of transfer functions says that cvista lacks the others
    lacking = {"vtkErrorCode"}
    if vtk.BACKEND == "cvista":
        lacking |= {"vtkCompositeControlPointsItem", "vtkCompositeTransferFunctionItem"}
    for name in names - lacking:
        assert getattr(vtk, name) is not None


def test_what_a_build_lacks_is_named():
    with pytest.raises(ImportError, match=f"{vtk.BACKEND}.*vtkNoSuchClass.*: install"):
        from pyvista_vdi.vtk_pipeline.vtk import vtkNoSuchClass  # noqa: F401
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = vtk.no_such_name


@pytest.mark.parametrize(
    ("build", "text", "message"),
    [
        (
            "vtkmodules",
            "libGL.so.1: cannot open shared object file",
            "the system library libGL.so.1 is missing: on Debian and Ubuntu apt install libgl1",
        ),
        ("cvista", "libXrender.so.1: cannot open", "libXrender.so.1 is missing.*libxrender1"),
        ("vtkmodules", "No module named 'vtkmodules'", r'pip install "pyvista-vdi\[plot\]"'),
        (
            "cvista",
            "No module named 'cvista.vtkIOXML'",
            r'"cvista\[all\]".* PYVISTA_VTK_BACKEND=vtk',
        ),
    ],
)
def test_a_vtk_that_cannot_be_loaded_names_the_package(build, text, message, monkeypatch):
    monkeypatch.setattr(vtk, "BACKEND", build)
    error = vtk.explain_import_error(ImportError(text))
    assert isinstance(error, MissingDependencyError)
    with pytest.raises(MissingDependencyError, match=message):
        raise error


class vtkObjectBase:  # noqa: N801 - what stands for the base class of another build
    __module__ = "elsewhere.vtkCommonCore"

    def GetClassName(self):
        return type(self).__name__

    def GetIndependentComponents(self):
        return 1

    def GetTwoSidedLighting(self):
        return 1


class vtkImageData(vtkObjectBase):  # noqa: N801
    pass


@pytest.mark.parametrize(
    "take",
    [
        volume_from_vtk,
        vdi_from_image,
        transfer_function_from_property,
        lambda data: pvdi.generate(data, pv.Camera(), (8, 8)),
        lambda data: pvdi.generate(soft_ball(4), pv.Camera(), (8, 8), volume_property=data),
        lambda data: pvdi.render(data, pv.Camera(), (8, 8)),
        lambda data: pv.Plotter().add_vdi(data),
        lambda data: pvdi.VDISource().SetInputData(data),
        lambda data: pvdi.VDISource().SetInputConnection(data),
        lambda data: pvdi.VDISource().SetVolumeProperty(data),
        lambda data: pvdi.VDISource().SetCamera(data),
        lambda data: pvdi.VDISource().SetLights(data),
        lambda data: VDIWriter().SetInputData(data),
        lambda data: VDIWriter().SetInputConnection(0, data),
        lambda data: pvdi.VDIMapper().SetInputData(data),
        lambda data: pvdi.VDIMapper().SetInputConnection(data),
    ],
)
@pytest.mark.gl
def test_objects_of_another_build_are_refused_by_name(take):
    message = f"vtkImageData is an object of elsewhere.*{vtk.BACKEND}.*_BACKEND=elsewhere before"
    with pytest.raises(UnsupportedError, match=message):
        take(vtkImageData())


SCENE = """
import importlib
import numpy as np, pytest, pyvista as pv, pyvista_vdi as pvdi
from plugin_scenes import CLASSIFICATION, LOOKS, soft_ball
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.vtk_pipeline import vtk

other = {"vtkmodules": "cvista", "cvista": "vtkmodules"}[vtk.BACKEND]
pictures = []
for add in ("add_vdi", "add_volume"):
    plotter = pv.Plotter(window_size=(160, 90))
    getattr(plotter, add)(soft_ball(24), **LOOKS)
    pictures.append(plotter.screenshot(return_img=True) / 255)
    plotter.close()
print(vtk.BACKEND, pvdi.compare_images(*pictures).ssim)

camera = importlib.import_module(f"{other}.vtkRenderingCore").vtkCamera()
camera.SetPosition(5, 4, 3)
grid = soft_ball(12)
for generate in (grid.vdi.generate, lambda *args, **looks: pvdi.generate(grid, *args, **looks)):
    # Of a camera there are only numbers to read
    vdi = generate(camera, (40, 30), **CLASSIFICATION)
    print(len(vdi.front), pvdi.render(vdi, camera, (40, 30))[..., 3].sum())

image = importlib.import_module(f"{other}.vtkCommonDataModel").vtkImageData()
image.SetDimensions(4, 4, 4)
image.AllocateScalars(10, 1)
with pytest.raises(UnsupportedError, match=f"ImageData is an object of {other}.*{vtk.BACKEND}"):
    pvdi.generate(image, camera, (40, 30))
"""


@needs_cvista
@needs_choice
@pytest.mark.gl
def test_both_builds_draw_and_generate_the_same():
    support = Path(__file__).parents[1] / "support"
    head = f"import sys; sys.path.insert(0, {str(support)!r})\n"
    found = {
        build: output_of(head + SCENE, PYVISTA_VTK_BACKEND=build) for build in ("vtk", "cvista")
    }
    (ours, ssim, *made), theirs = found["vtk"], found["cvista"]
    assert (ours, theirs[0]) == ("vtkmodules", "cvista")
    assert float(ssim) >= 0.98
    assert float(theirs[1]) >= 0.98
    assert theirs[2:] == made
    assert made[:2] == made[2:]


@needs_cvista
@needs_choice
def test_a_choice_that_changes_before_pyvista_is_imported_is_refused():
    code = (
        "import os, pyvista_vdi.vtk_pipeline.vtk\n"
        "os.environ['PYVISTA_VTK_BACKEND'] = 'cvista'\n"
        "import pyvista\n"
        "pyvista.Plotter().add_vdi\n"
    )
    result = run_python(code, PYVISTA_VTK_BACKEND="vtk")
    assert "UnsupportedError: the Volume is an object of cvista" in result.stderr
