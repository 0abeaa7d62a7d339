"""Methods of VTK's volume mapper, property, volume and image: the same, refused or without effect.

``docs/vtk_interface.md`` has a row for each of them.
"""

import numpy as np
import pytest
from vtk_interface.stage import (
    LEAST_SSIM,
    N,
    Scene,
    another_property,
    as_rgba,
    blanked,
    colors,
    function,
    image_of,
    image_with,
    values,
    with_scalars,
)

from pyvista_vdi import compare_images
from pyvista_vdi.errors import VDIError
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkCommonCore,
    vtkDataSetAttributes,
    vtkFloatArray,
    vtkImageData,
    vtkMatrix4x4,
    vtkOpenGLShaderProperty,
    vtkPlane,
    vtkPlaneCollection,
    vtkRectilinearGrid,
)

pytestmark = pytest.mark.gl

MIDDLE = (N - 1) / 2


def plane():
    """Return a plane through the middle."""
    made = vtkPlane()
    made.SetOrigin(MIDDLE, MIDDLE, MIDDLE)
    made.SetNormal(1, 0.3, 0)
    return made


def planes():
    """Return a collection of one plane."""
    made = vtkPlaneCollection()
    made.AddItem(plane())
    return made


def matrix():
    """Return a matrix that moves, turns and stretches."""
    made = vtkMatrix4x4()
    made.DeepCopy((0.8, -0.3, 0, 3, 0.4, 0.9, 0, -2, 0, 0, 0.7, 1, 0, 0, 0, 1))
    return made


def cropped(s):
    s.mapper.CroppingOn()
    s.mapper.SetCroppingRegionPlanes(4, 9, 4, 9, 4, 9)


def color_image(s):
    """Have the picture drawn into an image, and return it, RGB over black."""
    s.mapper.RenderToImageOn()
    s.window.Render()
    image = vtkImageData()
    s.mapper.GetColorImage(image)
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 4)[..., :3] / 255


def shaded(**how):
    """Return a change of a shaded property's coefficients."""

    def change(s):
        s.prop.ShadeOn()
        for name, value in how.items():
            getattr(s.prop, f"Set{name}")(value)

    return change


def ghosts(kind, mark, where):
    """Return a change that marks points or cells."""

    def change(image):
        getattr(image, f"Allocate{kind}GhostArray")()
        n = N if kind == "Point" else N - 1
        marks = vtk_to_numpy(getattr(image, f"Get{kind}GhostArray")()).reshape(n, n, n)
        marks[where] = getattr(vtkDataSetAttributes, mark)

    return image_with(change)


def of_cells(image):
    """Return an image whose only scalars are those of cells."""
    made = vtkImageData()
    made.SetDimensions(N + 1, N + 1, N + 1)
    array = image.GetPointData().GetArray("v")
    made.GetCellData().SetScalars(array)
    return made


def by_components(numbers):
    array = vtkCommonCore.vtkSOATypeFloat32Array()
    array.SetNumberOfTuples(len(numbers))
    for i, number in enumerate(numbers):
        array.SetTuple1(i, number)
    return array


def rectilinear(image):
    grid = vtkRectilinearGrid()
    grid.SetDimensions(N, N, N)
    for axis in "XYZ":
        places = vtkFloatArray()
        for i in range(N):
            places.InsertNextValue(i**1.2)
        getattr(grid, f"Set{axis}Coordinates")(places)
    grid.GetPointData().SetScalars(image.GetPointData().GetArray("v"))
    return grid


def moved(image):
    image.SetExtent(5, 4 + N, -3, N - 4, 0, N - 1)


FIRST_HALF = (slice(None), slice(None), slice(N // 2))
CORNER = (slice(4, 9),) * 3

#: Changes of a :class:`Scene` that are drawn both ways; what they return is compared, too.
SAME = {
    "ClippingPlanes": lambda s: s.mapper.SetClippingPlanes(planes()),
    "Cropping": cropped,
    "FinalColorWindow": lambda s: s.mapper.SetFinalColorWindow(0.6),
    "FinalColorLevel": lambda s: s.mapper.SetFinalColorLevel(0.3),
    "ImageSampleDistance": lambda s: s.mapper.SetImageSampleDistance(2.0),
    "Input": lambda s: s.mapper.GetInput().GetDimensions(),
    "RenderToImage": color_image,
    "Color": lambda s: s.prop.SetColor(colors((0, 1, 0, 0), (200, 0, 0, 1))),
    "ScalarOpacity": lambda s: s.prop.SetScalarOpacity(function((50, 0), (60, 0.8), (200, 0.1))),
    "ScalarOpacityUnitDistance": lambda s: s.prop.SetScalarOpacityUnitDistance(3.0),
    "GradientOpacity": lambda s: s.prop.SetGradientOpacity(function((0, 0), (30, 1))),
    "InterpolationType": lambda s: s.prop.SetInterpolationTypeToNearest(),
    "Specular": shaded(Specular=0.8, SpecularPower=6.0),
    "DeepCopy": lambda s: s.prop.DeepCopy(another_property()),
    "RotateWXYZ": lambda s: s.actor.RotateWXYZ(40, 1, 1, 0),
    "Scale": lambda s: s.actor.SetScale(1, 0.5, 0.8),
    "UserMatrix": lambda s: s.actor.SetUserMatrix(matrix()),
    "PokeMatrix": lambda s: s.actor.PokeMatrix(matrix()),
    "PropertiesFromModelToWorldMatrix": lambda s: s.actor.SetPropertiesFromModelToWorldMatrix(
        matrix()
    ),
    "Bounds": lambda s: [*s.actor.GetBounds(), *s.mapper.GetCenter(), s.actor.GetLength()],
    "Extent": image_with(moved),
    "DirectionMatrix": image_with(
        lambda image: image.SetDirectionMatrix(0.6, -0.8, 0, 0.8, 0.6, 0, 0, 0, 1)
    ),
    "int8": with_scalars(lambda v: (v / 2).astype(np.int8)),
    "float64": with_scalars(lambda v: v.astype(np.float64)),
    "NaN": with_scalars(lambda v: np.where(v > 200, np.nan, v)),
    "RGBA": as_rgba,
    "active scalars": image_with(lambda i: i.GetPointData().SetActiveScalars("w") and None),
    "values of cells": image_with(of_cells),
    "PointGhostArray": ghosts("Point", "HIDDENPOINT", FIRST_HALF),
    "CellGhostArray": ghosts("Cell", "REFINEDCELL", CORNER),
    "BlankPoint": image_with(blanked),
}
if hasattr(vtkCommonCore, "vtkSOATypeFloat32Array"):
    SAME["arrays by components"] = with_scalars(by_components)

#: Changes that are refused, and words of it where the name is not among them.
REFUSED = {
    "SelectScalarArray": (lambda s: s.mapper.SelectScalarArray("w"), "VDISource.SetScalars"),
    "BlendMode": (lambda s: s.mapper.SetBlendModeToAdditive(), ""),
    "AddInputConnection": (
        lambda s: s.mapper.AddInputConnection(0, s.source.GetOutputPort()),
        "",
    ),
    "ShallowCopy": (lambda s: s.actor.ShallowCopy(s.actor), ""),
    "MaskInput": (
        lambda s: s.mapper.SetMaskInput(image_of(values().ravel().astype(np.uint8))),
        "",
    ),
    "VolumetricScatteringBlending": (lambda s: s.mapper.SetVolumetricScatteringBlending(0.5), ""),
    "2D transfer function": (lambda s: s.prop.SetTransferFunctionModeTo2D(), ""),
    "label": (lambda s: s.prop.SetLabelScalarOpacity(1, function((0, 0), (9, 1))), ""),
    "clipped voxels": (lambda s: s.prop.UseClippedVoxelIntensityOn(), ""),
    "CoordinateSystem": (lambda s: s.actor.SetCoordinateSystemToPhysical(), ""),
    "ShaderProperty": (lambda s: s.actor.SetShaderProperty(vtkOpenGLShaderProperty()), ""),
    "FragmentShaderReplacement": (
        lambda s: s.actor.GetShaderProperty().AddFragmentShaderReplacement("a", True, "b", False),
        "",
    ),
    "have 2 components": (with_scalars(lambda v: np.stack([v, v], -1)), ""),
    "rectilinear": (image_with(rectilinear), "not a uniform grid.*resample"),
}

#: Of these, which are refused when a VDI is made: the volume or its property is another by then.
OF_WHAT_IS_MADE = {"2D transfer function", "label", "clipped voxels"}
OF_WHAT_IS_MADE |= {"have 2 components", "rectilinear"}

#: Changes of which nothing is to be seen.
WITHOUT_EFFECT = {
    "UseJittering": lambda s: s.mapper.UseJitteringOn(),
    "MaxMemoryInBytes": lambda s: s.mapper.SetMaxMemoryInBytes(1000),
    "ScatteringAnisotropy": lambda s: s.prop.SetScatteringAnisotropy(0.5),
    "AllocatedRenderTime": lambda s: s.actor.SetAllocatedRenderTime(1e-6, None),
}


@pytest.mark.parametrize("name", SAME)
def test_same(off_screen, name):
    pictures, said = [], []
    for ours in (False, True):
        scene = Scene(ours)
        scene.picture()
        said.append(SAME[name](scene))
        pictures.append(scene.picture())
    assert compare_images(*pictures).ssim >= LEAST_SSIM
    if isinstance(said[0], np.ndarray):
        assert compare_images(*said).ssim >= LEAST_SSIM
    else:
        assert said[0] == pytest.approx(said[1])


@pytest.mark.parametrize("name", REFUSED)
def test_refused(off_screen, name):
    change, words = REFUSED[name]
    scene = Scene(True)
    before = scene.picture()

    def change_and_make():
        change(scene)
        scene.source.MakeRequest()

    with pytest.raises(VDIError, match=words or name):
        change_and_make()
    if name not in OF_WHAT_IS_MADE:
        np.testing.assert_array_equal(scene.picture(), before)


@pytest.mark.parametrize("name", WITHOUT_EFFECT)
def test_without_effect(off_screen, name):
    scene = Scene(True)
    before = scene.picture()
    WITHOUT_EFFECT[name](scene)
    np.testing.assert_array_equal(scene.picture(), before)


def test_what_turns_a_refused_thing_off_is_accepted(off_screen):
    scene = Scene(True)
    before = scene.picture()
    for setter in ("BlendMode", "GlobalIlluminationReach", "ScalarMode"):
        getattr(scene.mapper, f"Set{setter}")(0)
    scene.mapper.SetMaskInput(None)
    scene.actor.SetCoordinateSystemToWorld()
    np.testing.assert_array_equal(scene.picture(), before)
