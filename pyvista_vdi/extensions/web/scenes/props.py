"""A scene's lights and bounds, the parts of its props, and actors for what has none of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.web.placing import array_of
from pyvista_vdi.vtk_pipeline.vtk import (
    numpy_to_vtk,
    vtk_to_numpy,
    vtkActor,
    vtkAnnotatedCubeActor,
    vtkAxesActor,
    vtkImageData,
    vtkPlaneSource,
    vtkPolyDataMapper,
    vtkProp3D,
    vtkPropAssembly,
    vtkPropCollection,
    vtkTexture,
)

Matrix = NDArray[np.float64]


def parts_of(prop: Any) -> Iterator[tuple[Any, Matrix]]:
    """Yield what a prop is drawn by, which is itself where it has no parts, and where that is.

    Parts that are hidden are left out; whether the prop itself is visible is not asked.
    """
    if isinstance(prop, vtkPropAssembly):
        for part in prop.GetParts():
            if part.GetVisibility():
                yield from parts_of(part)
    elif isinstance(prop, vtkAnnotatedCubeActor):
        yield from parts_of(prop.GetAssembly())
    elif isinstance(prop, vtkAxesActor):
        actors = [actor for actor in collected(prop.GetActors) if actor.GetVisibility()]
        yield from ((actor, array_of(actor.GetMatrix())) for actor in actors)
        if prop.GetAxisLabels():
            captions = [getattr(prop, f"Get{axis}AxisCaptionActor2D")() for axis in "XYZ"]
            yield from ((caption, np.eye(4)) for caption in captions)
    elif isinstance(prop, vtkProp3D) and prop.GetNumberOfPaths() > 1:
        yield from _paths(prop)
    else:
        yield prop, array_of(prop.GetMatrix() if hasattr(prop, "GetMatrix") else None)


def collected(get: Callable[[Any], None]) -> list[Any]:
    """Return what a method of a prop adds to a collection, each once."""
    collection = vtkPropCollection()
    get(collection)
    return list(dict.fromkeys(collection))


def _paths(prop: Any) -> Iterator[tuple[Any, Matrix]]:
    paths = []
    prop.InitPathTraversal()
    while (path := prop.GetNextPath()) is not None:
        nodes = [path.GetItemAsObject(k) for k in range(path.GetNumberOfItems())]
        paths.append(([node.GetViewProp() for node in nodes], nodes[-1].GetMatrix()))
    for parts, matrix in paths:
        if all(part.GetVisibility() for part in parts):
            yield parts[-1], array_of(matrix)


def unlit(poly: Any, look: Any, texture: Any = None) -> Any:
    """Return an actor of flat geometry; ``look`` has its colour and opacity."""
    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetInputData(poly)
    actor.SetMapper(mapper)
    actor.SetTexture(texture)
    own = actor.GetProperty()
    own.LightingOff()
    own.SetOpacity(look.GetOpacity())
    if hasattr(look, "GetColor"):  # an image's has none
        own.SetColor(look.GetColor())
        own.SetLineWidth(look.GetLineWidth())
        own.SetPointSize(look.GetPointSize())
    return actor


def image_quad(actor: Any) -> Any:
    """Return an actor that shows a ``vtkImageActor``'s image; ``None`` if it has no layer, or more.

    From the middle of the first pixel to that of the last, as VTK does without a border.
    """
    image = actor.GetInput()
    scalars = None if image is None else image.GetPointData().GetScalars()
    if scalars is None or image.GetDimensions()[2] != 1:
        return None
    look, (width, height, _) = actor.GetProperty(), image.GetDimensions()
    shown = (vtk_to_numpy(scalars) - look.GetColorLevel()) / look.GetColorWindow() + 0.5
    pixels = np.rint(shown.clip(0, 1) * 255).astype(np.uint8)
    texels, texture, plane = vtkImageData(), vtkTexture(), vtkPlaneSource()
    texels.SetDimensions(width, height, 1)
    texels.GetPointData().SetScalars(numpy_to_vtk(pixels, deep=True))
    texture.SetInputData(texels)
    texture.SetInterpolate(look.GetInterpolationType() != 0)
    texture.RepeatOff()
    x0, x1, y0, y1, z, _ = actor.GetDisplayBounds()
    plane.SetOrigin(x0, y0, z)
    plane.SetPoint1(x1, y0, z)
    plane.SetPoint2(x0, y1, z)
    plane.Update()
    half = 0.5 / np.array([width, height])
    places = vtk_to_numpy(plane.GetOutput().GetPointData().GetTCoords())
    places[:] = half + places * (1 - 2 * half)
    return unlit(plane.GetOutput(), look, texture)


#: vtkLight's types.
_LIGHTS = {1: "head", 2: "camera", 3: "scene"}

#: Lights that the viewer looks at.
MOST_LIGHTS = 8


def bounds_of(renderer: Any) -> list[float] | None:
    """Return the box by which VTK sets its clipping range, which translucent layers depend on."""
    bounds = renderer.ComputeVisiblePropBounds()
    return list(bounds) if bounds[0] <= bounds[1] else None


def lights_of(renderer: Any) -> Iterator[dict[str, Any]]:
    """Yield the lights that are on, as scene.js takes them."""
    for light in renderer.GetLights():
        if not light.GetSwitch():
            continue
        kind = _LIGHTS[light.GetLightType()]
        # Lights of the camera are given where it stands at (0, 0, 1) and looks at the origin
        yield {
            "kind": kind,
            "color": [channel * light.GetIntensity() for channel in light.GetDiffuseColor()],
            "position": list(light.GetPosition()) if kind != "head" else [0, 0, 1],
            "focalPoint": list(light.GetFocalPoint()) if kind != "head" else [0, 0, 0],
            "positional": bool(light.GetPositional()),
            "cone": light.GetConeAngle(),
            "exponent": light.GetExponent(),
            "attenuation": list(light.GetAttenuationValues()),
        }
