"""Which build of VTK is used, by PyVista's rules, and that no objects of another one get in."""

from __future__ import annotations

import pytest
import pyvista as pv
from fresh_python import run_python

import pyvista_vdi as pvdi
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.vtk_pipeline import (
    VDIWriter,
    transfer_function_from_property,
    vdi_from_image,
    volume_from_vtk,
    vtk,
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
        ("vtkmodules", "", "0.49.0", "cvista"),
        ("vtkmodules", "cvista", "0.48.4", ""),
        ("vtkmodules", "vtk", "0.49.0", ""),
        ("another", "another", "0.49.0", ""),
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
        lambda data: pv.Plotter().add_vdi(data),
        lambda data: pvdi.VDISource().SetInputConnection(data),
        lambda data: pvdi.VDISource().SetCamera(data),
        lambda data: VDIWriter().SetInputData(data),
        lambda data: pvdi.VDIMapper().SetInputData(data),
    ],
)
@pytest.mark.gl
def test_objects_of_another_build_are_refused_by_name(take):
    message = f"vtkImageData is an object of elsewhere.*{vtk.BACKEND}.*_BACKEND=elsewhere before"
    with pytest.raises(UnsupportedError, match=message):
        take(vtkImageData())
