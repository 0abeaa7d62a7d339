"""VTK's interface, method by method: the table is whole, and each row is what it says."""

import numpy as np
import pytest
from vtk_interface.rows import IMAGE, LEAST_SSIM, MAPPER, PAGE, PROPERTY, SECTIONS, VOLUME, page
from vtk_interface.stage import REFUSED, SAME, WITHOUT, Scene, methods_of, row_of

from pyvista_vdi import compare_images
from pyvista_vdi.errors import VDIError
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAlgorithm,
    vtkDataObject,
    vtkObject,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkUniformGrid,
    vtkVolume,
    vtkVolumeProperty,
)

pytestmark = pytest.mark.gl


def of_inputs():
    return [name for name in methods_of(vtkAlgorithm, vtkObject) if "Input" in name]


def setters_of_images():
    begins = ("Set", "Allocate", "Blank", "UnBlank", "Copy", "Generate")
    return [n for n in methods_of(vtkUniformGrid, vtkDataObject) if n.startswith(begins)]


@pytest.mark.parametrize(
    ("methods", "rows"),
    [
        (methods_of(vtkOpenGLGPUVolumeRayCastMapper, vtkAlgorithm) + of_inputs(), MAPPER),
        (methods_of(vtkVolumeProperty, vtkObject), PROPERTY),
        (methods_of(vtkVolume, vtkObject), VOLUME),
        (setters_of_images(), IMAGE),
    ],
    ids=["mapper", "property", "volume", "image"],
)
def test_every_method_has_a_row(methods, rows):
    assert [name for name in methods if row_of(name, rows) is None] == []


@pytest.mark.skipif(not PAGE.is_file(), reason="needs the pages of a checkout")
def test_the_page_is_up_to_date():
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(), "run python tests/vtk_interface/rows.py"


def cases(verdict):
    return [
        pytest.param(row, id=f"{title.partition(',')[0]}-{row}")
        for title, rows in SECTIONS.items()
        for row in rows
        if row.verdict == verdict and row.change is not None
    ]


@pytest.mark.every(4)
@pytest.mark.parametrize("row", cases(SAME))
def test_same(off_screen, row):
    pictures, said = [], []
    for ours in (False, True):
        scene = Scene(ours)
        scene.picture()
        said.append(row.change(scene))
        pictures.append(scene.picture())
    assert compare_images(*pictures).ssim >= LEAST_SSIM
    if isinstance(said[0], np.ndarray):
        assert compare_images(*said).ssim >= LEAST_SSIM
    else:
        assert said[0] == pytest.approx(said[1])


@pytest.mark.parametrize("row", cases(REFUSED))
def test_refused(off_screen, row):
    scene = Scene(True)
    before = scene.picture()

    def change_and_make():
        row.change(scene)
        scene.source.MakeRequest()

    with pytest.raises(VDIError, match=row.words or str(row)):
        change_and_make()
    if row not in (*PROPERTY, *IMAGE):
        np.testing.assert_array_equal(scene.picture(), before)


@pytest.mark.every(4)
@pytest.mark.parametrize("row", cases(WITHOUT))
def test_without_effect(off_screen, row):
    scene = Scene(True)
    before = scene.picture()
    row.change(scene)
    np.testing.assert_array_equal(scene.picture(), before)


def test_what_turns_a_refused_thing_off_is_accepted(off_screen):
    scene = Scene(True)
    before = scene.picture()
    for setter in ("BlendMode", "GlobalIlluminationReach", "ScalarMode"):
        getattr(scene.mapper, f"Set{setter}")(0)
    scene.mapper.SetMaskInput(None)
    scene.actor.SetCoordinateSystemToWorld()
    np.testing.assert_array_equal(scene.picture(), before)
