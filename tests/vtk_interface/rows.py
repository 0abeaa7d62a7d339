# ruff: noqa: E501 (a row of a table is a line)
"""What becomes of each method of VTK's volume mapper, property and volume, and of an image's parts.

``python tests/vtk_interface/rows.py`` writes ``docs/vtk_interface.md``.
"""

import os
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
if __name__ == "__main__":
    sys.path[:0] = [str(TESTS), str(TESTS / "support")]

import numpy as np  # noqa: E402
from vtk_interface.stage import (  # noqa: E402
    REFUSED,
    SAME,
    WITHOUT,
    N,
    Row,
    another_property,
    colors,
    function,
    image_of,
    values,
)

from pyvista_vdi.vtk_pipeline.vtk import (  # noqa: E402
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
    vtkUniformGrid,
)

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or TESTS.parent)
PAGE = CHECKOUT / "docs" / "vtk_interface.md"

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


def twice(first, then):
    """Return a change that draws in between, and what is said afterwards."""

    def change(s):
        first(s)
        s.picture()
        return then(s)

    return change


def cropped(s):
    s.mapper.CroppingOn()
    s.mapper.SetCroppingRegionPlanes(4, 9, 4, 9, 4, 9)


def chosen(s, array="w"):
    by_name = isinstance(array, str)
    s.mapper.SetScalarModeToUsePointFieldData()
    if hasattr(s.mapper, "SetArrayName"):
        (s.mapper.SetArrayName if by_name else s.mapper.SetArrayId)(array)
    else:  # older VTKs
        s.mapper.SelectScalarArray(array)
    s.mapper.SetArrayAccessMode(int(by_name))


def color_image(s):
    """Have the picture drawn into an image, and return it, RGB over black."""
    s.mapper.RenderToImageOn()
    s.window.Render()
    image = vtkImageData()
    s.mapper.GetColorImage(image)
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 4)[..., :3] / 255


_OF_PROXY = "they are of the box that VTK draws in the VDI's stead"
_OF_REFUSED = "of what is refused: "

MAPPER = (
    Row("ClippingPlane", SAME, "act on the next frame", lambda s: s.mapper.SetClippingPlanes(planes())),
    Row("RemoveClippingPlane AllClippingPlanes", SAME, "", twice(
        lambda s: s.mapper.AddClippingPlane(plane()), lambda s: s.mapper.RemoveAllClippingPlanes())),
    Row("Cropping CroppingRegionPlanes", SAME, "act on the next frame; VTK's planes lie up to half a voxel further out", cropped),
    Row("CroppingRegionFlags", SAME, "", lambda s: (cropped(s), s.mapper.SetCroppingRegionFlagsToFence())[:0]),
    Row("VoxelCroppingRegionPlanes", WITHOUT, _OF_PROXY),
    Row("FinalColorWindow FinalColorLevel", SAME, "", lambda s: (
        s.mapper.SetFinalColorWindow(0.6), s.mapper.SetFinalColorLevel(0.3))[:0]),
    Row("ScalarMode ScalarModeToUsePointFieldData ArrayName ArrayAccessMode", SAME,
        "arrays of points and cells alike; the VDI is regenerated", chosen),
    Row("ArrayId", SAME, "", lambda s: chosen(s, 1)),
    Row("SelectScalarArray", SAME, "", lambda s: (
        s.mapper.SelectScalarArray("w"), s.mapper.SetScalarModeToUsePointFieldData())[:0]),
    Row("ScalarModeToUseCellData ScalarModeToUseCellFieldData", REFUSED,
        "values of cells are averaged at the points: choose the array by `SelectScalarArray`",
        lambda s: s.mapper.SetScalarModeToUseCellFieldData(), "values at points.*SelectScalarArray"),
    Row("BlendModeToComposite", SAME, "", lambda s: s.mapper.SetBlendModeToComposite()),
    Row("BlendMode", REFUSED, "others than composite: `render_volume(blending=)` has some",
        lambda s: s.mapper.SetBlendModeToAdditive()),
    Row("SampleDistance", SAME, "the VDI is regenerated", lambda s: s.mapper.SetSampleDistance(2.0)),
    Row("ImageSampleDistance", SAME, "", lambda s: s.mapper.SetImageSampleDistance(2.0)),
    Row("AutoAdjustSampleDistances MaximumImageSampleDistance", SAME,
        "previews in windows, while a hand moves", lambda s: s.mapper.AutoAdjustSampleDistancesOn()),
    Row("MinimumImageSampleDistance", WITHOUT, "previews have as many rays as time allows",
        lambda s: s.mapper.SetMinimumImageSampleDistance(3.0)),
    Row("LockSampleDistanceToInputSpacing", REFUSED, "`SetSampleDistance` says the step",
        lambda s: s.mapper.LockSampleDistanceToInputSpacingOn()),
    Row("UseJittering", WITHOUT, "noise that hides VTK's steps; a VDI's list has none to hide",
        lambda s: s.mapper.UseJitteringOn()),
    Row("Bounds Center Length BoundsFromPort", SAME, "the volume's",
        lambda s: [*s.mapper.GetBounds(), *s.mapper.GetCenter(), s.mapper.GetLength()]),
    Row("Input DataObjectInput DataSetInput", SAME, "the volume at the source's input",
        lambda s: s.mapper.GetInput().GetDimensions()),
    Row("InputData InputDataObject InputConnection", SAME,
        "a VDI, its canonical image or a `VDISource`'s port in the volume's place; port 0"),
    Row("GetInputDataObject", WITHOUT, "returns the box that VTK draws in the VDI's stead, and warns"),
    Row("RemoveInputConnection AllInputConnections AllInputs", SAME, "nothing is drawn any more"),
    Row("AddInputConnection AddInputDataObject", REFUSED, "one VDI for each mapper",
        lambda s: s.mapper.AddInputConnection(0, s.source.GetOutputPort())),
    Row("InputCount Ports TransformedInput GetInputConnection InputAlgorithm InputExecutive "
        "InputInformation InputPortInformation InputPort NumberOfInputPorts InputConnections "
        "TotalNumberOfInputConnections ConvertTotalInputToPortConnection", WITHOUT, _OF_PROXY),
    Row("InputArrayToProcess InputArrayInformation InputArraySpecification ResetInputArraySpecifications",
        WITHOUT, "VTK's mapper does not ask for them, either"),
    Row("RenderToImage ColorImage ColorTexture", SAME, "", color_image),
    Row("DepthImage", REFUSED, "`VDIActor.pick(x, y)` says what is seen where",
        lambda s: s.mapper.GetDepthImage(vtkImageData())),
    Row("DepthTexture", REFUSED, "likewise", lambda s: s.mapper.GetDepthTexture()),
    Row("DepthImageScalarType", WITHOUT, f"{_OF_REFUSED}depth images"),
    Row("ClampDepthToBackface", REFUSED, "it is of depth images", lambda s: s.mapper.ClampDepthToBackfaceOn()),
    Row("UseDepthPass", REFUSED, "a VDI has no isosurfaces", lambda s: s.mapper.UseDepthPassOn()),
    Row("DepthPassContourValues", WITHOUT, f"{_OF_REFUSED}`UseDepthPass`"),
    Row("MaskInput", REFUSED, "hide points or cells, or write transparent values",
        lambda s: s.mapper.SetMaskInput(image_of(values().ravel().astype(np.uint8)))),
    Row("MaskType MaskBlendFactor", WITHOUT, f"{_OF_REFUSED}masks",
        lambda s: s.mapper.SetMaskTypeToLabelMap()),
    Row("GlobalIlluminationReach", REFUSED, "a VDI is lit when it is generated, by `shade` and lights",
        lambda s: s.mapper.SetGlobalIlluminationReach(0.5)),
    Row("VolumetricScatteringBlending", REFUSED, "likewise",
        lambda s: s.mapper.SetVolumetricScatteringBlending(0.5)),
    Row("ComputeNormalFromOpacity", REFUSED, "a VDI is shaded by its scalars' gradient",
        lambda s: s.mapper.ComputeNormalFromOpacityOn()),
    Row("ColorRangeType ScalarOpacityRangeType GradientOpacityRangeType", WITHOUT,
        "over what scalars VTK samples the functions; here they have as many entries as they need",
        lambda s: (s.mapper.SetColorRangeType(1), s.mapper.SetScalarOpacityRangeType(1))[:0]),
    Row("Transfer2DYAxisArray", WITHOUT, f"{_OF_REFUSED}2D transfer functions",
        lambda s: s.mapper.SetTransfer2DYAxisArray("w")),
    Row("AverageIPScalarRange", WITHOUT, f"{_OF_REFUSED}average blending",
        lambda s: s.mapper.SetAverageIPScalarRange(0, 1)),
    Row("GradientMagnitudeScale GradientMagnitudeBias", WITHOUT, "of VTK's CPU mappers"),
    Row("MaxMemoryInBytes MaxMemoryFraction ReductionRatio ReportProgress TimeToDraw", WITHOUT,
        "`VDISource.SetMemoryLimit` and `ProgressEvent` are in their place",
        lambda s: s.mapper.SetMaxMemoryInBytes(1000)),
    Row("CreateCanonicalView", REFUSED, "take a picture by vtkWindowToImageFilter",
        lambda s: s.mapper.CreateCanonicalView(
            s.renderer, s.actor, vtkImageData(), 0, (0, 0, 1), (0, 1, 0))),
    Row("ShallowCopy", SAME, "copies the clipping planes, as of every mapper"),
    Row("RenderSupported IsARayCastMapper IsARenderIntoImageMapper Scalars AbstractScalars GhostArray",
        SAME, "VTK's own"),
    Row("Partitions PreLoadData SharedDepthTexture CurrentPass", WITHOUT, "how VTK's ray caster is fed with voxels and depth",
        lambda s: s.mapper.SetPartitions(2, 1, 1)),
    Row("Render GPURender ReleaseGraphicsResources", SAME, "VTK's own, called by its renderer"),
)  # fmt: skip


def shaded(**how):
    """Return a change of a shaded property's coefficients."""

    def change(s):
        s.prop.ShadeOn()
        for name, value in how.items():
            getattr(s.prop, f"Set{name}")(value)

    return change


_OF_BLENDING = f"{_OF_REFUSED}another blend mode"

PROPERTY = (
    Row("Color RGBTransferFunction ColorChannels", SAME, "",
        lambda s: s.prop.SetColor(colors((0, 1, 0, 0), (200, 0, 0, 1)))),
    Row("GrayTransferFunction", SAME, "grey; VTK's GPU mapper takes the colours in its place, its CPU mapper does not"),
    Row("ScalarOpacity ScalarOpacityFunction", SAME, "",
        lambda s: s.prop.SetScalarOpacity(function((50, 0), (60, 0.8), (200, 0.1)))),
    Row("ScalarOpacityUnitDistance", SAME, "", lambda s: s.prop.SetScalarOpacityUnitDistance(3.0)),
    Row("GradientOpacity GradientOpacityFunction StoredGradientOpacity", SAME, "",
        lambda s: s.prop.SetGradientOpacity(function((0, 0), (30, 1)))),
    Row("DisableGradientOpacity", SAME, "", lambda s: (
        s.prop.SetGradientOpacity(function((0, 0), (30, 1))), s.prop.DisableGradientOpacityOn())[:0]),
    Row("InterpolationType", SAME, "nearest and linear; VTK makes linear of cubic",
        lambda s: s.prop.SetInterpolationTypeToNearest()),
    Row("Shade", SAME, "", shaded()),
    Row("Ambient Diffuse", SAME, "", shaded(Ambient=0.4, Diffuse=0.5)),
    Row("Specular SpecularPower", SAME, "", shaded(Specular=0.8, SpecularPower=6.0)),
    Row("IndependentComponents", SAME, "off for RGBA, on for one scalar; otherwise refused",
        lambda s: s.prop.IndependentComponentsOn()),
    Row("ComponentWeight", WITHOUT, "of one scalar, in VTK's mapper as well",
        lambda s: s.prop.SetComponentWeight(0, 0.3)),
    Row("TransferFunctionMode TransferFunction2D", REFUSED, "when the VDI is made",
        lambda s: s.prop.SetTransferFunctionModeTo2D(), "2D transfer function"),
    Row("Label LabelColor LabelScalarOpacity LabelGradientOpacity", REFUSED, "when the VDI is made",
        lambda s: s.prop.SetLabelScalarOpacity(1, function((0, 0), (9, 1))), "label"),
    Row("UseClippedVoxelIntensity", REFUSED, "when the VDI is made",
        lambda s: s.prop.UseClippedVoxelIntensityOn(), "clipped voxels"),
    Row("ClippedVoxelIntensity", WITHOUT, f"{_OF_REFUSED}`UseClippedVoxelIntensity`",
        lambda s: s.prop.SetClippedVoxelIntensity(9.0)),
    Row("IsoSurfaceValues", WITHOUT, _OF_BLENDING),
    Row("SliceFunction", WITHOUT, _OF_BLENDING, lambda s: s.prop.SetSliceFunction(plane())),
    Row("ScatteringAnisotropy", WITHOUT, f"{_OF_REFUSED}volumetric scattering",
        lambda s: s.prop.SetScatteringAnisotropy(0.5)),
    Row("DeepCopy", SAME, "", lambda s: s.prop.DeepCopy(another_property())),
    Row("RGBTransferFunctions GrayTransferFunctions ScalarOpacityFunctions GradientOpacityFunctions "
        "TransferFunction2Ds UpdateMTimes", SAME, "VTK's own"),
)  # fmt: skip


_PLACED = "acts on the next frame"
_INTERNAL = "VTK's own, called by its renderer"

VOLUME = (
    Row("Position AddPosition", SAME, _PLACED, lambda s: s.actor.SetPosition(3, -2, 1)),
    Row("Orientation AddOrientation OrientationWXYZ RotateWXYZ RotateX RotateY RotateZ", SAME, _PLACED,
        lambda s: (s.actor.SetOrientation(10, 20, 30), s.actor.RotateWXYZ(40, 1, 1, 0))[:0]),
    Row("Origin Scale", SAME, _PLACED, lambda s: (
        s.actor.SetOrigin(5, 5, 5), s.actor.SetScale(1, 0.5, 0.8))[:0]),
    Row("UserMatrix UserTransform UserTransformMatrix", SAME, _PLACED,
        lambda s: s.actor.SetUserMatrix(matrix())),
    Row("PropertiesFromModelToWorldMatrix ModelToWorldMatrix Matrix IsIdentity ComputeMatrix", SAME, _PLACED,
        lambda s: s.actor.SetPropertiesFromModelToWorldMatrix(matrix())),
    Row("PokeMatrix", SAME, "", lambda s: s.actor.PokeMatrix(matrix())),
    Row("CoordinateSystem", REFUSED, "others than the world",
        lambda s: s.actor.SetCoordinateSystemToPhysical()),
    Row("CoordinateSystemDevice", REFUSED, "", lambda s: s.actor.SetCoordinateSystemDevice(1)),
    Row("CoordinateSystemRenderer", WITHOUT, f"{_OF_REFUSED}other coordinate systems"),
    Row("Visibility", SAME, "", lambda s: s.actor.VisibilityOff()),
    Row("Pickable Dragable UseBounds SupportsSelection", SAME, "",
        lambda s: (s.actor.UseBoundsOff(), s.actor.PickableOff())[:0]),
    Row("Bounds Center Length XRange YRange ZRange MinXBound MaxXBound MinYBound MaxYBound MinZBound "
        "MaxZBound", SAME, "the volume's",
        lambda s: [*s.actor.GetBounds(), *s.actor.GetCenter(), s.actor.GetLength()]),
    Row("Mapper", SAME, "a `VDIMapper`"),
    Row("Property", WITHOUT, "colours and opacities are those of `VDISource.SetVolumeProperty`; another "
        "property than that is warned of"),
    Row("ShaderProperty", REFUSED, "its shader shows the VDI",
        lambda s: s.actor.SetShaderProperty(vtkOpenGLShaderProperty())),
    Row("GetShaderProperty", REFUSED, "and what is added to it by its methods",
        lambda s: s.actor.GetShaderProperty().AddFragmentShaderReplacement(
            "//VTK::Shading::Impl", True, "g_fragColor.g = 1.0;", False),
        "AddFragmentShaderReplacement"),
    Row("PropertyKeys Keys GeneralTextureTransform GeneralTextureUnit", SAME, "VTK's own"),
    Row("EstimatedRenderTime AllocatedRenderTime RenderTimeMultiplier RestoreEstimatedRenderTime", WITHOUT,
        "the window's desired update rate decides about previews",
        lambda s: s.actor.SetAllocatedRenderTime(1e-6, None)),
    Row("CorrectedScalarOpacityArray GradientOpacityArray GradientOpacityConstant GrayArray RGBArray "
        "ScalarOpacityArray ArraySize UpdateScalarOpacityforSampleSize UpdateTransferFunctions", WITHOUT,
        "tables of VTK's CPU mappers, of the actor's property"),
    Row("ShallowCopy", SAME, "what VTK's copies; a mapper belongs to one actor: `copy()` in PyVista"),
    Row("Actors Actors2D Volumes Consumer Path NextPath BuildPaths InitPathTraversal Pick RedrawMTime Redraw "
        "ProcessSelectorPixelBuffers RenderFilteredOpaqueGeometry RenderFilteredOverlay "
        "RenderFilteredTranslucentPolygonalGeometry RenderFilteredVolumetricGeometry RenderOpaqueGeometry "
        "RenderOverlay RenderTranslucentPolygonalGeometry RenderVolumetricGeometry OpaqueGeometry "
        "TranslucentPolygonalGeometry RenderingTranslucentPolygonalGeometry ReleaseGraphicsResources Update",
        SAME, _INTERNAL),
)  # fmt: skip


def image_with(change):
    """Return what gives a scene an image that was changed; it has no names for methods."""

    def changed(s):
        image = image_of()
        another = change(image)
        if s.ours:
            s.source.SetInputDataObject(image if another is None else another)
        else:
            s.mapper.SetInputDataObject(image if another is None else another)
        s.renderer.ResetCamera()

    return changed


def with_scalars(make):
    """Return a change to an image of other scalars, made of 0 to 255."""
    return image_with(lambda image: image_of(make(values().ravel())))


def ghosts(kind, mark, where):
    """Return a change that marks points or cells."""

    def change(image):
        getattr(image, f"Allocate{kind}GhostArray")()
        n = N if kind == "Point" else N - 1
        marks = vtk_to_numpy(getattr(image, f"Get{kind}GhostArray")()).reshape(n, n, n)
        marks[where] = getattr(vtkDataSetAttributes, mark)

    return image_with(change)


def blanked(image):
    grid = vtkUniformGrid()
    grid.DeepCopy(image)
    for number in range(0, N**3, 7):
        grid.BlankPoint(number)
    for number in range(0, (N - 1) ** 3, 31):
        grid.BlankCell(number)
    return grid


def of_cells(image):
    """Return an image whose only scalars are those of cells."""
    made = vtkImageData()
    made.SetDimensions(N + 1, N + 1, N + 1)
    array = image.GetPointData().GetArray("v")
    made.GetCellData().SetScalars(array)
    return made


def rgba(numbers):
    """Return four components of these."""
    return np.stack([numbers, 255 - numbers, numbers / 2, numbers], -1).astype(np.uint8)


def as_rgba(s):
    s.prop.IndependentComponentsOff()
    with_scalars(rgba)(s)


def affine(numbers):
    array = vtkCommonCore.vtkAffineTypeFloat32Array()
    array.SetNumberOfTuples(len(numbers))
    array.ConstructBackend(255 / len(numbers), 0)
    return array


def by_components(numbers):
    array = vtkCommonCore.vtkSOATypeFloat32Array()
    array.SetNumberOfTuples(len(numbers))
    for i, number in enumerate(numbers):
        array.SetTuple1(i, number)
    return array


def _wrapped(name, make):
    """Return a change to scalars of a class, if this VTK has it for Python."""
    return with_scalars(make) if hasattr(vtkCommonCore, name) else None


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


def without_active(image):
    """Leave the scalars as the only array, active no more."""
    image.GetPointData().RemoveArray("w")
    image.GetPointData().SetActiveScalars(None)


_FIRST_HALF = (slice(None), slice(None), slice(N // 2))
_CORNER = (slice(4, 9),) * 3

IMAGE = (
    Row("Extent Dimensions AxisUpdateExtent", SAME, "one that does not begin at 0 included", image_with(moved)),
    Row("Origin", SAME, "", image_with(lambda image: image.SetOrigin(9, -8, 7))),
    Row("Spacing", SAME, "negative ones are refused", image_with(lambda image: image.SetSpacing(1, 0.5, 2))),
    Row("DirectionMatrix", SAME, "", image_with(
        lambda image: image.SetDirectionMatrix(0.6, -0.8, 0, 0.8, 0.6, 0, 0, 0, 1))),
    *(Row(f"scalars:{dtype}", SAME, "", with_scalars(lambda v, t=dtype: v.astype(t))) for dtype in (
        "uint8", "uint16", "int16", "int32", "uint32", "float32", "float64")),
    *(Row(f"scalars:{dtype}", SAME, "made of half the range", with_scalars(
        lambda v, t=dtype: (v / 2).astype(t))) for dtype in ("int8", "int64")),
    Row("scalars:NaN", SAME, "transparent", with_scalars(lambda v: np.where(v > 200, np.nan, v))),
    Row("components:4", SAME, "unsigned chars, with dependent components: RGBA", as_rgba),
    Row("components:2", REFUSED, "pass one scalar per point", with_scalars(
        lambda v: np.stack([v, v], -1)), "have 2 components"),
    Row("components:3", REFUSED, "pass one component, or the vectors' length", with_scalars(
        lambda v: np.stack([v, v, v], -1)), "have 3 components"),
    Row("implicit arrays", SAME, "of every kind: copied", _wrapped("vtkAffineTypeFloat32Array", affine)),
    Row("arrays by components (SOA)", SAME, "copied", _wrapped("vtkSOATypeFloat32Array", by_components)),
    Row("an array without a name", SAME, "", image_with(lambda image: image_of(name=None))),
    Row("active scalars", SAME, "", image_with(lambda image: image.GetPointData().SetActiveScalars("w") and None)),
    Row("the only array, not active", SAME, "drawn all the same; VTK's mapper draws nothing"),
    Row("values of cells", SAME, "averaged at the points, as by `add_volume`; VTK's mapper puts them into the cells' middles", image_with(of_cells)),
    Row("PointGhostArray AllocatePointGhostArray", SAME, "what is marked, and what lies next to it, is not drawn",
        ghosts("Point", "HIDDENPOINT", _FIRST_HALF)),
    Row("CellGhostArray AllocateCellGhostArray GenerateGhostArray", SAME, "likewise",
        ghosts("Cell", "HIDDENCELL", _CORNER)),
    Row("duplicate points and cells", SAME, "hidden, too: VTK's mapper asks only whether a mark is there",
        ghosts("Point", "DUPLICATEPOINT", _CORNER)),
    Row("refined and exterior cells", SAME, "hidden, too", ghosts("Cell", "REFINEDCELL", _CORNER)),
    Row("BlankPoint BlankCell UnBlankPoint UnBlankCell", SAME, "of a vtkUniformGrid", image_with(blanked)),
    Row("other point and cell arrays, vectors, normals", WITHOUT, "in VTK's mapper as well"),
    Row("field data, information", WITHOUT, "in VTK's mapper as well"),
    Row("another grid (vtkRectilinearGrid ...)", REFUSED, "resample it", image_with(rectilinear), "not a uniform grid.*resample"),
    Row("AllocateScalars ScalarComponentFromDouble ScalarComponentFromFloat ScalarType NumberOfScalarComponents "
        "CopyAndCastFrom CopyStructure CopyAttributes CellOrderAndRationalWeights", SAME, "VTK's own"),
)  # fmt: skip

SECTIONS = {
    "vtkOpenGLGPUVolumeRayCastMapper, of a VDIMapper": MAPPER,
    "vtkVolumeProperty, of VDISource.SetVolumeProperty": PROPERTY,
    "vtkVolume, of a VDIActor": VOLUME,
    "vtkImageData, at the input of a VDISource": IMAGE,
}

HEAD = """# VTK's interface, method by method

<!-- made by tests/vtk_interface/rows.py -->

What becomes of each public method of VTK's volume mapper, volume property and volume where a VDI is
drawn by `VDISource`, `VDIMapper` and `VDIActor` ([In a VTK pipeline](guide_pipeline.md)), and of what an
image has:

- **same**: as with VTK's GPU mapper. Rows that change a picture are drawn both ways by
  `tests/vtk_interface/`, and the pictures' SSIM is at least {least}.
- **refused**: an `UnsupportedError` names the method, and what to do instead, when it is called (or,
  of a property, when the VDI is made). The VDI stays. What switches such a thing off is accepted.
- **without effect**: nothing changes, for the reason that is given.

`Cropping` stands for `SetCropping`, `GetCropping`, `CroppingOn`, `CroppingOff` and so on; each method that
VTK {version} has is in a row.
"""


def page(version="9.7"):
    """Return the page."""
    out = [HEAD.format(least=LEAST_SSIM, version=version)]
    for title, rows in SECTIONS.items():
        out.append(f"\n## {title}\n\n| | | |\n|---|---|---|\n")
        for row in rows:
            listed = (
                row.names.replace(":", " ")
                if row.names[0].islower()
                else ", ".join(f"`{name}`" for name in row.names.split())
            )
            out.append(f"| {listed} | {row.verdict} | {row.why} |\n")
    return "".join(out)


#: The issue's bound for a picture.
LEAST_SSIM = 0.98

if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
