"""A plotter's scene as viewers show it, in a page: VDIs, plain meshes, pictures that VTK draws.

Plain is what has a colour for each point or cell and is opaque: triangles, lines and points. Texts,
scalar bars and axes are drawn by VTK into pictures that lie over the scene. All else is named.
"""

from __future__ import annotations

import io
import json
import os
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import warn_external
from pyvista_vdi.extensions.web.camera import MOST_PLANES, viewer_camera
from pyvista_vdi.extensions.web.page import CONTROLS, POLICY, html_page, viewer
from pyvista_vdi.extensions.web.shown import Shown, bare_file, file_of
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.cropping import PRESETS, Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import whole_file
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.filters.view import as_array

#: The numbers of a scene's arrays in JavaScript: their names there, by NumPy's.
_KINDS = {"float32": "Float32Array", "uint8": "Uint8Array"}

#: What is drawn flat in the same place whatever the view.
_FLAT = ("vtkTextActor", "vtkCornerAnnotation", "vtkScalarBarActor", "vtkLegendBoxActor")


@dataclass
class Scene:
    """What is shown of a renderer."""

    shown: Shown | None  # by the viewer itself: the first actor's VDI, series or set
    actor: Any  # that one
    planes: list[list[float]]  # that it is clipped to
    data: bytes  # all the rest, as scene.js takes it
    background: str  # as CSS has it
    left_out: list[str]  # what is not shown, by name


def is_vdi(prop: Any) -> bool:
    """Whether a prop shows a VDI."""
    return isinstance(prop, VDIActorMethods)


def scenes_of(plotter: Any, where: str, *, follow: bool = False) -> list[Scene]:
    """Return what each renderer of a plotter that has been drawn shows; warn of what is left out.

    ``where``: what the warning calls it. ``follow``: as for :func:`scene_of`.
    """
    scenes = [scene_of(renderer, follow=follow) for renderer in plotter.renderers]
    left_out = dict.fromkeys(what for scene in scenes for what in scene.left_out)
    if left_out:
        more = ': see all by jupyter_backend="server"' if follow else ""
        warn_external(f"{where} shows the scene without {', '.join(left_out)}{more}")
    return scenes


def scene_of(renderer: Any, *, follow: bool = False) -> Scene:
    """Return what a renderer that has been drawn shows, for the viewer.

    ``follow``: the viewer takes the renderer's view, and its VDIs as they are; otherwise it begins
    with that view, of which VDIs are made where their volumes are at hand.
    """
    names = {prop: name for name, prop in getattr(renderer, "actors", {}).items()}
    left_out = _effects(renderer)
    meshes: list[dict[str, Any]] = []
    vdis: list[Any] = []  # tuples of the actor, the series or set, the VDI, and where it is seen
    flat: list[Any] = []
    of_this_view: list[Any] = []

    # Sort what is drawn into VDIs, meshes and what is flat
    for prop in filter(lambda prop: prop.GetVisibility(), renderer.GetViewProps()):
        missing: list[str] = []
        if is_vdi(prop):
            matrix, several = as_array(prop.GetMatrix()), prop.series or prop.vdi_set
            vdi = prop.vdi if follow else prop.GetMapper().driver.vdi_of_view(renderer, matrix)
            if vdi is not None:
                limits = {"planes": _planes(prop, missing), "matrix": matrix.tolist()}
                vdis.append((prop, several, _thinned(vdi, prop.opacity_multiplier), limits))
                # The viewer plays the first series, or follows the first set
                if several is not None and sum(each[1] is not None for each in vdis) > 1:
                    missing.append(f"all but one of {len(several)} VDIs")
        elif any(prop.IsA(kind) for kind in _FLAT):
            flat.append(prop)
        elif prop.IsA("vtkActor2D") or prop.IsA("vtkCubeAxesActor"):
            of_this_view.append(prop)
            missing.append("its place in other views than the first")
        elif isinstance(prop, vtk.vtkActor):
            meshes += _meshes(prop, missing)
        else:
            missing.append("all of it")
        # By the name that it was given, or else its class
        name = re.split(r"\((?:Addr|0x)", names.get(prop, ""))[0] or type(prop).__name__
        left_out += [f"{what} ({name})" for what in missing]
    vdis.sort(key=lambda each: each[1] is None)
    boxes = [np.reshape(actor.GetBounds(), (3, 2)).T for actor, *_ in vdis]
    if any((a[0] < b[1]).all() and (b[0] < a[1]).all() for a, b in combinations(boxes, 2)):
        left_out.append("the mixing of VDIs that overlap")

    # Have VTK draw what is flat: that of all views, and that of this one
    others = _around(renderer)
    left_out += ["axes in other views than the first"] * bool(others)
    camera = viewer_camera(renderer.GetActiveCamera(), renderer.GetSize())
    head = {
        "camera": None if follow else camera,
        "view": camera,
        "size": list(renderer.GetSize()),
        "meshes": meshes,
        "pictures": [_picture(renderer, flat), _picture(renderer, of_this_view, others)],
        "vdis": [  # the first one is the viewer's own
            {**limits, "file": np.frombuffer(bare_file(vdi), np.uint8) if k else None}
            for k, (_, _, vdi, limits) in enumerate(vdis)
        ],
    }
    first: Any = vdis[0] if vdis else (None, None, None, {"planes": []})
    actor, several, shown, limits = first
    if several is not None:
        if several.value_range is not None:  # pages show colours
            several = several.classified(volume_property=actor.GetProperty())
        factor = actor.opacity_multiplier
        shown = several if factor == 1 else several._mapped(lambda vdi: _thinned(vdi, factor))
    return Scene(shown, actor, limits["planes"], _packed(head), _background(renderer), left_out)


def state_of(renderer: Any) -> Any:
    """Return what a scene depends on, but for its camera; another value asks for another scene."""
    states: list[Any] = []
    for prop in renderer.GetViewProps():
        own = prop.GetRedrawMTime()
        if is_vdi(prop):  # its mapper is modified in each frame
            own = (look_of(prop), as_array(prop.GetMatrix()).tolist(), _planes(prop, []))
        states.append((prop.GetAddressAsString(""), bool(prop.GetVisibility()), own))
    others = [(other.GetAddressAsString(""), other.GetViewport()) for other in _around(renderer)]
    return states, renderer.GetSize(), _background(renderer), others


def look_of(actor: Any) -> Any:
    """Return what decides which VDIs an actor shows."""
    several = actor.series or actor.vdi_set
    if several is None:
        return actor.vdi, actor.opacity_multiplier
    classified_at = None if several.value_range is None else actor.GetProperty().GetMTime()
    return several, len(several), actor.opacity_multiplier, classified_at  # sets may grow


def _thinned(vdi: VDI, multiplier: float) -> VDI:
    """Return a VDI with its optical depths multiplied."""
    if multiplier == 1:
        return vdi
    names = ("camera", "window_size", "offsets", "front", "back", "color", "bounds")
    same = {name: getattr(vdi, name) for name in (*names, "depth_origin", "metadata")}
    return VDI(**same, optical_depth=vdi.optical_depth * np.float32(multiplier))


def _planes(actor: Any, missing: list[str]) -> list[list[float]]:
    """Return the planes that an actor is clipped and cropped to, origin and normal, world."""
    mapper, matrix = actor.GetMapper(), as_array(actor.GetMatrix())
    clipping, cropping = mapper.GetClippingPlanes() or (), Cropping.from_any(mapper)
    planes = [[*plane.GetOrigin(), *plane.GetNormal()] for plane in clipping]
    if cropping is not None and cropping.regions != PRESETS["subvolume"]:
        missing.append("cropping to other than a box")
    elif cropping is not None:
        for number, place in enumerate(cropping.planes):
            normal = np.asarray(cropping.normals[number // 2])
            point = matrix @ np.append(place * normal / (normal @ normal), 1.0)
            inwards = (1 - 2 * (number % 2)) * normal @ np.linalg.inv(matrix[:3, :3])
            planes.append([*point[:3].tolist(), *inwards.tolist()])
    if len(planes) > MOST_PLANES:
        missing.append(f"{len(planes) - MOST_PLANES} of its clipping planes")
    return planes[:MOST_PLANES]


def _meshes(actor: Any, missing: list[str]) -> Iterator[dict[str, Any]]:
    """Describe the triangles, lines and points that an actor draws, in the world."""
    mapper, look = actor.GetMapper(), actor.GetProperty()
    kind = None if mapper is None else mapper.GetClassName()
    if kind not in ("vtkDataSetMapper", "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper"):
        missing.append(f"what {kind} draws")
        return
    if actor.HasTranslucentPolygonalGeometry():
        missing.append("what is translucent")
        return
    looks = {
        "edges": look.GetEdgeVisibility(),
        "vertices": look.GetVertexVisibility(),
        "a texture": actor.GetTexture() is not None,
        "physically based shading": look.GetInterpolation() == 3,
        "highlights and ambient light": look.GetSpecular() > 0 or look.GetAmbient() > 0,
        "culling": look.GetFrontfaceCulling() or look.GetBackfaceCulling(),
        "tubes and spheres": look.GetRenderLinesAsTubes() or look.GetRenderPointsAsSpheres(),
    }
    missing += [what for what, is_used in looks.items() if is_used]

    # Take the surface to the world, clip it, and divide it into triangles, lines and points
    mapper.Update()
    transform, placed = vtk.vtkTransform(), vtk.vtkTransformFilter()
    transform.SetMatrix(actor.GetMatrix())
    placed.SetTransform(transform)
    poly = mapper.GetInputDataObject(0, 0)
    steps = [] if isinstance(poly, vtk.vtkPolyData) else [vtk.vtkDataSetSurfaceFilter()]
    steps.append(placed)
    for plane in mapper.GetClippingPlanes() or ():
        steps.append(vtk.vtkClipPolyData())
        steps[-1].SetClipFunction(plane)
    steps += [vtk.vtkExtractEdges()] if look.GetRepresentation() == 1 else []  # a wireframe
    for step in [*steps, vtk.vtkTriangleFilter()]:
        step.SetInputData(poly)
        step.Update()
        poly = step.GetOutput()
    if poly.GetNumberOfPoints() == 0:
        return

    # Have VTK colour points or cells
    points = vtk.vtk_to_numpy(poly.GetPoints().GetData()).astype(np.float64)
    twin, of_cells = vtk.vtkPolyDataMapper(), vtk.mutable(0)
    twin.ShallowCopy(mapper)
    twin.SetInputData(poly)
    twin.InterpolateScalarsBeforeMappingOff()
    mapped = twin.MapScalars(poly, 1.0, of_cells)
    colors = np.tile(np.rint(255 * np.array(look.GetDiffuseColor())), (len(points), 1))
    if mapped is not None:
        colors = vtk.vtk_to_numpy(mapped).reshape(mapped.GetNumberOfTuples(), -1)[:, :3]
    colors = np.insert(colors.astype(np.uint8), 3, 255, axis=1)
    of_each_cell = mapped is not None and bool(int(of_cells))
    normals = poly.GetPointData().GetNormals() if look.GetInterpolation() > 0 else None
    normals = None if normals is None else vtk.vtk_to_numpy(normals).astype(np.float32)

    # Send the points of each kind of cell about their middle, as browsers compute in float32
    low, high, first = points.min(axis=0), points.max(axis=0), 0
    middle = (low + high) / 2
    kinds = {"points": poly.GetVerts(), "lines": poly.GetLines(), "triangles": poly.GetPolys()}
    for corners, (kind, cells) in enumerate(kinds.items(), 1):
        used = vtk.vtk_to_numpy(cells.GetConnectivityArray())
        owner = first + np.arange(len(used)) // corners
        first += cells.GetNumberOfCells()
        if len(used) == 0:
            continue
        shown = "points" if look.GetRepresentation() == 0 else kind
        lit = shown == "triangles" and bool(look.GetLighting())
        if shown == "lines" and look.GetLineWidth() > 1:
            missing.append("the width of lines")
        yield {
            "kind": shown,
            "half": ((high - low) / 2).tolist(),
            "origin": middle.tolist(),
            "points": (points[used] - middle).astype(np.float32),
            "colors": colors[owner if of_each_cell else used],
            "normals": normals[used] if lit and normals is not None else None,
            "lit": lit,
            "size": look.GetPointSize(),
        }


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


def _picture(renderer: Any, props: list[Any], others: Sequence[Any] = ()) -> Any:
    """Draw props, and what other renderers draw, alone; return the bytes of a PNG file."""
    from PIL import Image

    if not props and not others:
        return None
    # Lend them to a window of its own
    window = vtk.vtkRenderWindow()
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
    window.Render()
    pixels = vtk.vtkUnsignedCharArray()
    width, height = window.GetSize()
    window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, pixels)
    for twin in window.GetRenderers():
        for prop in twin.GetViewProps():
            prop.ReleaseGraphicsResources(window)
        twin.RemoveAllViewProps()
    window.Finalize()
    # Of premultiplied colours, the lowest row first
    stream, data = io.BytesIO(), bytes(pixels)
    image = Image.frombytes("RGBa", (width, height), data, "raw", "RGBa", 0, -1)
    image.convert("RGBA").save(stream, format="png")
    return np.frombuffer(stream.getvalue(), np.uint8)


def _effects(renderer: Any) -> list[str]:
    """Name what changes a renderer's picture as a whole, and cannot be shown."""
    window = renderer.GetRenderWindow()
    behind = [other for other in window.GetRenderers() if other.GetLayer() < renderer.GetLayer()]
    gradient = renderer.GetGradientBackground() and renderer.GetGradientMode() != 0
    effects = {
        "its render pass": renderer.GetPass() is not None,
        "enable_hidden_line_removal": renderer.GetUseHiddenLineRemoval(),
        "enable_stereo_render": window.GetStereoRender(),
        "enable_shadows": renderer.GetUseShadows(),
        "add_background_image": any(other.VisibleActorCount() for other in behind),
        "the background's texture (set_environment_texture)": renderer.GetTexturedBackground(),
        "a background's gradient other than from the bottom to the top": gradient,
    }
    return [name for name, is_used in effects.items() if is_used]


def _background(renderer: Any) -> str:
    """Return a renderer's background as CSS."""
    colors = (renderer.GetBackground(), renderer.GetBackground2())
    low, high = ("rgb({:%} {:%} {:%})".format(*color) for color in colors)
    return f"linear-gradient(to top, {low}, {high})" if renderer.GetGradientBackground() else low


def _packed(head: dict[str, Any]) -> bytes:
    """Return the length of a JSON text, the text, and arrays one behind the other; deflated.

    In the text arrays stand by their numbers.
    """
    arrays: list[list[Any]] = []  # of each its kind, where it begins, and its size
    parts: list[bytes] = []

    def kept(array: NDArray[Any]) -> int:
        arrays.append([_KINDS[array.dtype.name], sum(map(len, parts)), array.size])
        parts.append(array.tobytes() + b"\0" * (-array.nbytes % 4))
        return len(parts) - 1

    text = json.dumps(head, default=kept)[:-1] + f',"arrays":{json.dumps(arrays)}}}'
    text += " " * (-len(text) % 4)
    return zlib.compress(len(text).to_bytes(4, "little") + text.encode() + b"".join(parts), 6)


def export_html(
    plotter: Any, filename: str | os.PathLike[str] | None, *, controls: str = "all"
) -> io.StringIO | None:
    """Write a page of a plotter's scene: see ``plotting.pages.PlotterVDIs.export_html``.

    All of its renderers are shown; it is drawn, and VDIs that are missing are made.
    """
    one_of(controls, "controls", CONTROLS)

    # Draw it, off-screen where it has not been shown
    window = plotter.render_window
    if plotter._first_time:  # as Plotter.show begins
        plotter._on_first_render_request()
    off_screen = window.GetOffScreenRendering()
    window.SetOffScreenRendering(off_screen or not window.GetMapped())
    try:
        plotter.render()
        picture = plotter.screenshot(return_img=True)[..., :3]
    finally:
        window.SetOffScreenRendering(off_screen)

    # Put a viewer where each renderer is in the window; linked ones turn together
    target = None if filename is None else Path(filename).with_suffix(".html")
    title = plotter.title if target is None else target.stem
    # Which cameras they are, not how they look: PyVista's that are alike are equal
    cameras = [r.GetActiveCamera().GetAddressAsString("") for r in plotter.renderers]
    shown = list(zip(plotter.renderers, scenes_of(plotter, "the page"), cameras, strict=True))
    shown.sort(key=lambda each: each[1].shown is None)  # the first can be read again
    body = ""
    for number, (renderer, scene, camera) in enumerate(shown):
        attributes = {}
        if len(shown) > 1:
            left, bottom, right, top = renderer.GetViewport()
            place = f"position: absolute; left: {left:%}; bottom: {bottom:%}"
            size = f"width: {right - left:%}; height: {top - bottom:%}"
            attributes = {"style": f"{place}; {size}", "data-link": str(cameras.index(camera))}
        body += viewer(
            None if scene.shown is None else file_of(scene.shown),
            part_of(picture, renderer),
            renderer.GetSize(),
            title=title,
            background=scene.background,
            attributes=attributes,
            controls=controls,
            scene=scene.data,
            number=number,
        )
    page = html_page(title, body, shown[0][1].background, POLICY)
    if target is None:
        return io.StringIO(page)
    with whole_file(target) as stream:
        stream.write(page.encode())
    return None


def part_of(picture: Any, renderer: Any) -> Any:
    """Return the part of a window's picture that a renderer has drawn."""
    left, bottom, right, top = renderer.GetViewport()
    height, width = picture.shape[:2]
    rows = slice(round(height * (1 - top)), round(height * (1 - bottom)))
    return picture[rows, round(width * left) : round(width * right)]
