"""A renderer's scene as the viewer shows it: VDIs, plain meshes, and pictures that VTK draws.

Plain is what has a colour for each point or cell and is opaque: triangles, lines and points. Texts,
scalar bars and axes are drawn by VTK into pictures that lie over the scene. All else is named.
"""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.extensions.web.camera import MOST_PLANES, viewer_camera
from pyvista_vdi.extensions.web.placing import array_of, encoded, look_of, planes_of, thinned
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods

#: The numbers of a scene's arrays in JavaScript: their names there, by NumPy's.
_KINDS = {"float32": "Float32Array", "uint8": "Uint8Array"}

#: What is drawn flat where the view says: right in one view alone.
_OF_A_VIEW = (
    *("vtkCubeAxesActor", "vtkAxisActor2D"),
    *("vtkLabelPlacementMapper", "vtkLabeledDataMapper"),
)

#: The methods of a plotter that add what is not drawn, by VTK's class.
_METHODS = {
    "vtkCamera3DRepresentation": "add_camera3d_widget",
    "vtkContextActor": "add_chart",
    "vtkAxesActor": "add_axes_at_origin",
    "vtkLightActor": "add_light(Light(show_actor=True))",
    "vtkVolume": "add_volume",
}

#: How gradients begin in CSS, by vtkViewport's modes.
_GRADIENTS = (
    "linear-gradient(to top",
    "linear-gradient(to right",
    "radial-gradient(farthest-side",
    "radial-gradient(farthest-corner",
)

#: Adds an array to those that are sent, and returns its number.
Keep = Callable[[NDArray[Any]], int]


@dataclass
class Scene:
    """What is shown of a renderer."""

    vdi: VDI | None  # the first one, if there is one
    actors: list[Any]  # those that show VDIs, the first one's first
    state: Any  # of :func:`state_of`, where the viewer goes on to follow the renderer
    data: bytes  # all the rest, as scene.js takes it
    background: str  # as CSS has it
    left_out: list[str]  # what is not shown, by name

    @property
    def actor(self) -> Any:
        """The actor of the first VDI, or ``None``."""
        return next(iter(self.actors), None)


def scene_of(
    renderer: Any,
    names: dict[str, Any] | None = None,
    *,
    camera: bool = True,
    needs_vdi: bool = True,
) -> Scene:
    """Return what a renderer that has been drawn shows, for the viewer.

    ``names``: what its props are called. ``camera``: the viewer begins with its view, of which
    VDIs are made where their volumes are at hand.
    ``needs_vdi``: one without VDIs is refused by UnsupportedError.
    """
    called = {prop: name for name, prop in (names or {}).items() if "(Addr" not in name}
    arrays: list[NDArray[Any]] = []

    def keep(array: NDArray[Any]) -> int:
        arrays.append(np.ascontiguousarray(array))
        return len(arrays) - 1

    left_out: list[str] = []
    meshes: list[dict[str, Any]] = []
    bodies: list[tuple[VDI, dict[str, Any]]] = []
    actors: list[Any] = []
    flat: list[Any] = []
    of_this_view: list[Any] = []

    # Sort what is drawn into VDIs, meshes and what is flat
    for prop in filter(lambda prop: prop.GetVisibility(), renderer.GetViewProps()):
        missing: list[str] = []
        for part, matrix in _parts_of(prop):
            if isinstance(part, VDIActorMethods):
                vdi = _vdi_of(part, renderer if camera else None, matrix)
                if vdi is not None:
                    bodies.append((vdi, _limits(part, matrix, missing)))
                    actors.append(part)
            elif any(
                thing.IsA(kind)
                for thing in (part, getattr(part, "GetMapper", lambda: None)() or part)
                for kind in _OF_A_VIEW
            ):
                of_this_view.append(part)
                missing.append("its place in other views than the first")
            elif part.IsA("vtkActor2D"):
                flat.append(part)
            elif isinstance(part, vtk.vtkActor):
                meshes += _meshes(part, matrix, keep, missing)
            else:
                missing.append("all of it")
        kind = next((name for kind, name in _METHODS.items() if prop.IsA(kind)), None)
        kind = "add_vdi" if isinstance(prop, VDIActorMethods) else kind
        name = called.get(prop) or kind or type(prop).__name__
        left_out += [f"{what} ({name})" for what in missing]
    if not bodies and needs_vdi:
        raise UnsupportedError("the renderer shows no VDI, so there is nothing for the viewer")

    # The viewer plays the first one's series, and follows its set
    several = [actor.series is not None or actor.vdi_set is not None for actor in actors]
    if any(several):
        for those in (bodies, actors):
            those.insert(0, those.pop(several.index(True)))
    if any(_overlap(one.GetBounds(), other.GetBounds()) for one, other in combinations(actors, 2)):
        left_out.append("the mixing of VDIs that overlap")
    described = [{**more, "file": None} for _, more in bodies]
    for (vdi, _), entry in zip(bodies[1:], described[1:], strict=True):
        entry["file"] = keep(np.frombuffer(encoded(vdi, coarse=True), np.uint8))

    # Have VTK draw what is flat: that of all views, and that of this one
    others = _around(renderer)
    left_out += ["axes in other views than the first"] * bool(others)
    pictures = [
        _picture(renderer, flat, [], keep) if flat else None,
        _picture(renderer, of_this_view, others, keep) if of_this_view or others else None,
    ]
    background = _background(renderer, left_out)
    left_out += _effects(renderer)
    head = {
        "camera": viewer_camera(renderer.GetActiveCamera(), renderer.GetSize()) if camera else None,
        "view": viewer_camera(renderer.GetActiveCamera(), renderer.GetSize()),
        "size": list(renderer.GetSize()),
        "meshes": meshes,
        "pictures": pictures,
        "vdis": described,
    }
    return Scene(
        vdi=bodies[0][0] if bodies else None,
        actors=actors,
        state=None if camera else state_of(renderer),
        data=_packed(head, arrays),
        background=background,
        left_out=list(dict.fromkeys(left_out)),
    )


def state_of(renderer: Any) -> tuple[Any, ...]:
    """Return what a scene depends on, but for its camera; another value asks for another scene."""
    states: list[Any] = []
    for prop in renderer.GetViewProps():
        state: list[Any] = [prop.GetAddressAsString(""), bool(prop.GetVisibility())]
        if isinstance(prop, VDIActorMethods):
            # The mapper is modified in each frame
            state += [*look_of(prop), *map(tuple, planes_of(prop))]
            state.append(Cropping.from_any(prop.GetMapper()))  # type: ignore[attr-defined]
        else:
            state.append(prop.GetRedrawMTime())
        states.append(tuple(state))
    others = [(other.GetAddressAsString(""), other.GetViewport()) for other in _around(renderer)]
    return tuple(states), tuple(renderer.GetSize()), _background(renderer, []), tuple(others)


def _parts_of(prop: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Yield the props that an assembly draws, or else the prop itself, and where each is."""
    if prop.GetNumberOfPaths() <= 1:
        yield prop, array_of(prop.GetMatrix() if hasattr(prop, "GetMatrix") else None)
        return
    prop.InitPathTraversal()
    while (path := prop.GetNextPath()) is not None:
        nodes = [path.GetItemAsObject(k) for k in range(path.GetNumberOfItems())]
        if all(node.GetViewProp().GetVisibility() for node in nodes):
            yield nodes[-1].GetViewProp(), array_of(nodes[-1].GetMatrix())


def _vdi_of(actor: Any, renderer: Any, matrix: NDArray[np.float64]) -> VDI | None:
    """Return an actor's VDI as it is shown: of the renderer's view, if one is given."""
    mapper = actor.GetMapper()
    begins = renderer is not None and mapper is not None
    vdi = mapper.driver.vdi_of_view(renderer, matrix) if begins else actor.vdi
    return None if vdi is None else thinned(vdi, actor.opacity_multiplier)


def _limits(actor: Any, matrix: NDArray[np.float64], missing: list[str]) -> dict[str, Any]:
    """Return where an actor is, and the planes that it is clipped and cropped to, world units."""
    planes = planes_of(actor)
    cropping = Cropping.from_any(actor.GetMapper())
    if cropping is not None:
        regions = [(i, j, k) for k in range(3) for j in range(3) for i in range(3)]
        if all(cropping.keeps(*region) == (region == (1, 1, 1)) for region in regions):
            for number, place in enumerate(cropping.planes):
                normal, sense = np.asarray(cropping.normals[number // 2]), 1 - 2 * (number % 2)
                point = np.append(place * normal / (normal @ normal), 1.0)
                normal = sense * normal @ np.linalg.inv(matrix[:3, :3])
                planes.append([*(matrix @ point)[:3].tolist(), *normal.tolist()])
        else:
            missing.append("cropping to other than a box")
    if len(planes) > MOST_PLANES:
        missing.append(f"{len(planes) - MOST_PLANES} of its clipping planes")
    return {"planes": planes[:MOST_PLANES], "matrix": matrix.tolist()}


def _meshes(
    actor: Any, matrix: NDArray[np.float64], keep: Keep, missing: list[str]
) -> Iterator[dict[str, Any]]:
    """Describe the triangles, lines and points that an actor draws, in the world."""
    mapper, look = actor.GetMapper(), actor.GetProperty()
    kind = None if mapper is None else mapper.GetClassName()
    if kind not in ("vtkDataSetMapper", "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper"):
        missing.append(f"what {kind} draws")
        return
    if actor.HasTranslucentPolygonalGeometry():
        missing.append("what is translucent")
        return
    for is_used, what in (
        (look.GetEdgeVisibility(), "edges"),
        (look.GetVertexVisibility(), "vertices"),
        (actor.GetTexture() is not None, "a texture"),
        (look.GetInterpolation() == 3, "physically based shading"),
        (look.GetSpecular() > 0 or look.GetAmbient() > 0, "highlights and ambient light"),
        (look.GetFrontfaceCulling() or look.GetBackfaceCulling(), "culling"),
        (look.GetRenderLinesAsTubes() or look.GetRenderPointsAsSpheres(), "tubes and spheres"),
    ):
        missing += [what] * bool(is_used)

    # Take the surface to the world, clip it, and divide it into triangles
    mapper.Update()
    transform, placed = vtk.vtkTransform(), vtk.vtkTransformFilter()
    transform.SetMatrix(matrix.ravel())
    placed.SetTransform(transform)
    poly = mapper.GetInputDataObject(0, 0)
    if not isinstance(poly, vtk.vtkPolyData):
        poly = _result(vtk.vtkDataSetSurfaceFilter(), poly)
    poly = _result(placed, poly)
    for plane in mapper.GetClippingPlanes() or ():
        clip = vtk.vtkClipPolyData()
        clip.SetClipFunction(plane)
        poly = _result(clip, poly)
    if look.GetRepresentation() == 1:  # a wireframe
        poly = _result(vtk.vtkExtractEdges(), poly)
    poly = _result(vtk.vtkTriangleFilter(), poly)
    if poly.GetNumberOfPoints() == 0:
        return

    # Have VTK colour points or cells
    points = vtk.vtk_to_numpy(poly.GetPoints().GetData()).astype(np.float64)
    twin, of_cells = vtk.vtkPolyDataMapper(), vtk.mutable(0)
    twin.ShallowCopy(mapper)
    twin.SetInputData(poly)
    twin.InterpolateScalarsBeforeMappingOff()
    mapped = twin.MapScalars(poly, 1.0, of_cells)
    if mapped is None:
        plain = np.rint(255 * np.array([*look.GetDiffuseColor(), 1])).astype(np.uint8)
        colors = np.tile(plain, (len(points), 1))
    else:
        colors = vtk.vtk_to_numpy(mapped).reshape(mapped.GetNumberOfTuples(), -1)
        colors = np.hstack([colors, np.full((len(colors), 4 - colors.shape[1]), 255, np.uint8)])
    of_each_cell = mapped is not None and bool(int(of_cells))
    smooth = look.GetInterpolation() > 0 and poly.GetPointData().GetNormals() is not None
    normals = vtk.vtk_to_numpy(poly.GetPointData().GetNormals()) if smooth else points

    # Send the points of each kind of cell about their middle, as browsers compute in float32
    middle, first = (points.min(axis=0) + points.max(axis=0)) / 2, 0
    kinds = {"points": poly.GetVerts(), "lines": poly.GetLines(), "triangles": poly.GetPolys()}
    for kind, cells in kinds.items():
        used = vtk.vtk_to_numpy(cells.GetConnectivityArray())
        counts = np.diff(vtk.vtk_to_numpy(cells.GetOffsetsArray()))
        owner = np.repeat(first + np.arange(len(counts)), counts)
        first += len(counts)
        shown = "points" if look.GetRepresentation() == 0 else kind
        if shown == "lines":  # each point of a line with the one behind it
            inner = np.flatnonzero(owner[1:] == owner[:-1])
            ends = np.stack([inner, inner + 1], axis=1).ravel()
            used, owner = used[ends], owner[ends]
        if len(used):
            lit = shown == "triangles" and bool(look.GetLighting())
            yield {
                "kind": shown,
                "half": ((points.max(axis=0) - points.min(axis=0)) / 2).tolist(),
                "origin": middle.tolist(),
                "points": keep((points[used] - middle).astype(np.float32)),
                "colors": keep(colors[owner if of_each_cell else used]),
                "normals": keep(normals[used].astype(np.float32)) if lit and smooth else None,
                "lit": lit,
                "size": look.GetPointSize(),
            }


def _result(algorithm: Any, data: Any) -> Any:
    """Return what one of VTK's filters makes of data."""
    algorithm.SetInputData(data)
    algorithm.Update()
    return algorithm.GetOutput()


def _overlap(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two boxes, (xmin, xmax, ymin, ymax, zmin, zmax), have space in common."""
    return all(one[k] < other[k + 1] and other[k] < one[k + 1] for k in (0, 2, 4))


def _around(renderer: Any) -> list[Any]:
    """Return the renderers that draw axes before a renderer, within its viewport."""
    own = getattr(getattr(renderer, "parent", None), "renderers", ())
    window = renderer.GetRenderWindow()
    if not own or window is None:
        return []
    known = {*own, getattr(own, "border_overlay_renderer", None)}
    low, high = np.reshape(renderer.GetViewport(), (2, 2))
    found = []
    for other in window.GetRenderers():
        middle = np.reshape(other.GetViewport(), (2, 2)).mean(axis=0)
        inside = (low < middle).all() and (middle < high).all()
        if other not in known and inside and other.GetLayer() > renderer.GetLayer():
            found += [other] if other.GetDraw() and other.VisibleActorCount() else []
    return found


def _picture(renderer: Any, props: list[Any], others: list[Any], keep: Keep) -> int:
    """Draw props, and what other renderers draw, alone; keep it as the bytes of a PNG file."""
    from PIL import Image

    window, layers = vtk.vtkRenderWindow(), []
    window.SetOffScreenRendering(1)
    window.AlphaBitPlanesOn()
    window.SetNumberOfLayers(1 + len(others))
    window.SetSize(*renderer.GetSize())
    low, high = np.reshape(renderer.GetViewport(), (2, 2))
    for layer, source in enumerate((renderer, *others)):
        twin, camera = vtk.vtkRenderer(), vtk.vtkCamera()
        camera.DeepCopy(source.GetActiveCamera())
        twin.SetActiveCamera(camera)
        twin.SetLayer(layer)
        twin.SetBackgroundAlpha(0)
        place = (np.reshape(source.GetViewport(), (2, 2)) - low) / (high - low)
        twin.SetViewport(*place.clip(0, 1).ravel())
        for prop in props if layer == 0 else source.GetViewProps():
            prop.ReleaseGraphicsResources(renderer.GetRenderWindow())
            twin.AddViewProp(prop)
        window.AddRenderer(twin)
        layers.append(twin)
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.SetInputBufferTypeToRGBA()
    grabbed.ReadFrontBufferOff()
    grabbed.ShouldRerenderOff()
    grabbed.Update()
    width, height, _ = grabbed.GetOutput().GetDimensions()
    pixels = vtk.vtk_to_numpy(grabbed.GetOutput().GetPointData().GetScalars())
    pixels = pixels.reshape(height, width, 4)[::-1].astype(np.float64)
    for twin in layers:
        for prop in twin.GetViewProps():
            prop.ReleaseGraphicsResources(window)
        twin.RemoveAllViewProps()
    window.Finalize()
    # VTK's colours are premultiplied, those of PNG are not
    pixels[..., :3] *= 255 / np.maximum(pixels[..., 3:], 1)
    stream = io.BytesIO()
    Image.fromarray(np.rint(pixels.clip(0, 255)).astype(np.uint8)).save(stream, format="png")
    return keep(np.frombuffer(stream.getvalue(), np.uint8))


def _effects(renderer: Any) -> list[str]:
    """Name what changes a renderer's picture as a whole, and cannot be shown."""
    window = renderer.GetRenderWindow()
    behind = [other for other in window.GetRenderers() if other.GetLayer() < renderer.GetLayer()]
    return [
        name
        for name, is_used in (
            ("its render pass", renderer.GetPass() is not None),
            ("enable_hidden_line_removal", renderer.GetUseHiddenLineRemoval()),
            ("enable_stereo_render", window.GetStereoRender()),
            ("enable_shadows", renderer.GetUseShadows()),
            ("add_background_image", any(other.VisibleActorCount() for other in behind)),
        )
        if is_used
    ]


def _background(renderer: Any, left_out: list[str]) -> str:
    """Return a renderer's background as CSS."""
    if renderer.GetTexturedBackground():
        left_out.append("the background's texture (set_environment_texture)")
    low, high = css(renderer.GetBackground()), css(renderer.GetBackground2())
    if not renderer.GetGradientBackground():
        return low
    return f"{_GRADIENTS[renderer.GetGradientMode()]}, {low}, {high})"


def css(color: Sequence[float]) -> str:
    """Return RGB from 0 to 1 as CSS."""
    return f"rgb({' '.join(f'{100 * channel:g}%' for channel in color)})"


def _packed(head: dict[str, Any], arrays: list[NDArray[Any]]) -> bytes:
    """Return the length of a JSON text, the text, and arrays one behind the other; deflated."""
    described, parts, at = [], [], 0
    for array in arrays:
        described.append([_KINDS[array.dtype.name], at, array.size])
        data = array.tobytes()
        parts.append(data + b"\0" * (-len(data) % 4))
        at += len(parts[-1])
    text = json.dumps({**head, "arrays": described}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return zlib.compress(len(text).to_bytes(4, "little") + text + b"".join(parts), 6)
