"""Which build of VTK is used, by PyVista's rules."""

from __future__ import annotations

import pytest
from fresh_python import run_python

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
