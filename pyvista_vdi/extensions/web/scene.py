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
from base64 import b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv

from pyvista_vdi.errors import InvalidArgumentError, warn_external
from pyvista_vdi.extensions.web.page import page_of
from pyvista_vdi.extensions.web.shown import (
    MOST_PLANES,
    Shown,
    bare_file,
    file_of,
    png,
    viewer_camera,
)
from pyvista_vdi.model.whole_file import whole_file
from pyvista_vdi.quality.plan import TOO_COARSE
from pyvista_vdi.quality.view_error import magnification
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.drawing.frame import planes_of
from pyvista_vdi.vtk_pipeline.filters.view import View, as_array, camera_of, size_of

#: What VTK draws in the same place whatever the view.
_FIXED = ("vtkTextActor", "vtkCornerAnnotation", "vtkScalarBarActor", "vtkLegendBoxActor")


@dataclass
class ShownScene:
    """What is shown of a renderer."""

    shown: Shown | None  # by the viewer itself: the first actor's VDI, series or set
    actor: Any  # that one
    planes: list[list[float]]  # that it is clipped to
    data: bytes  # all the rest, for scene.js: deflated JSON, in which arrays are base64
    background: str  # as CSS has it


def is_vdi(prop: Any) -> bool:
    """Whether a prop shows a VDI."""
    return isinstance(prop, VDIActorMethods)


def scene_of(plotter: Any, where: str | None, *, follow: bool = False) -> ShownScene:
    """Return what a plotter that has been drawn shows, for the viewer; warn of what is left out.

    ``where``: what the warning calls it; ``None``: it has been said. ``follow``: the viewer takes
    the plotter's view, and its VDIs as they are; otherwise it begins with that view, of which VDIs
    are made where their volumes are at hand.
    """
    renderer = plotter.renderer
    names = {prop: name for name, prop in getattr(renderer, "actors", {}).items()}
    left_out = _effects(renderer)
    meshes: list[dict[str, Any]] = []
    vdis: list[dict[str, Any]] = []  # the first one is the viewer's own: a series or set if any is
    boxes: list[Any] = []
    flat, bound = list[Any](), list[Any]()  # in all views, and in the first alone
    actor: Any = None
    shown: Any = None

    # Sort what is drawn into VDIs, meshes and what VTK draws into the picture
    visible = [prop for prop in renderer.GetViewProps() if prop.GetVisibility()]
    visible.sort(key=lambda p: is_vdi(p) and not p.collection)
    for prop in visible:
        missing: list[str] = []
        if is_vdi(prop):
            matrix, several, mapper = as_array(prop.GetMatrix()), prop.collection, prop.GetMapper()
            own = None if follow or mapper.GetRegenerate() == "never" else mapper.GetSource()
            seen = View(camera_of(renderer.GetActiveCamera(), matrix), size_of(renderer))
            vdi = own.MakeVDI(own.MakeRequest(seen)) if own else prop.vdi
            if vdi is None:
                continue
            wide = magnification(vdi, seen.camera, seen.size)
            coarse = wide > TOO_COARSE and "dial" not in vdi.metadata  # which chooses fewer lists
            missing += [f"detail finer than {wide:.1f} pixels of this view"] * coarse
            file = None if actor is None else bare_file(vdi)
            placed: dict[str, Any] = {"planes": _planes(prop, missing), "matrix": matrix.tolist()}
            vdis.append({**placed, "opacity": prop.opacity_multiplier, "file": file})
            boxes.append(np.reshape(prop.GetBounds(), (3, 2)).T)
            if actor is None:
                actor, shown = prop, vdi if several is None else several
                if several is not None and several.value_range is not None:  # pages show colours
                    shown = several.classified(volume_property=prop.GetProperty())
            elif several is not None:
                missing.append(f"all but one of {len(several)} VDIs")
        elif prop.IsA("vtkActor2D") or prop.IsA("vtkCubeAxesActor"):
            fixed = any(prop.IsA(kind) for kind in _FIXED)
            (flat if fixed else bound).append(prop)
            missing += ["its place in other views than the first"] * (not fixed)
        elif isinstance(prop, vtk.vtkActor):
            meshes += _meshes(prop, missing)
        else:
            missing.append("all of it")
        # By the name that it was given, or else its class
        name = re.split(r"\((?:Addr|0x)", names.get(prop, ""))[0] or type(prop).__name__
        left_out += [f"{what} ({name})" for what in missing]
    if any((a[0] < b[1]).all() and (b[0] < a[1]).all() for a, b in combinations(boxes, 2)):
        left_out.append("the mixing of VDIs that overlap")
    left_out += ["axes in other views than the first"] * bool(_axes(renderer))

    view = viewer_camera(renderer.GetActiveCamera(), renderer.GetSize())
    head: Any = {"camera": None if follow else view, "view": view, "meshes": meshes, "vdis": vdis}
    head["pictures"] = [_picture(renderer, flat, []), _picture(renderer, bound, _axes(renderer))]
    text = json.dumps(head, default=lambda numbers: b64encode(numbers).decode())
    data, planes = zlib.compress(text.encode(), 6), vdis[0]["planes"] if vdis else []
    if left_out and where is not None:
        more = ': see all by jupyter_backend="server"' if follow else ""
        named = ", ".join(dict.fromkeys(left_out))
        warn_external(f"{where} shows the scene without {named}{more}")
    return ShownScene(shown, actor, planes, data, _background(renderer))


def state_of(renderer: Any) -> Any:
    """Return what a scene depends on, but for its camera; another value asks for another scene."""
    states: list[Any] = []
    for prop in renderer.GetViewProps():
        own = prop.GetRedrawMTime()
        if is_vdi(prop):  # its mapper is modified in each frame
            matrix = as_array(prop.GetMatrix()).tolist()
            own = (look_of(prop), prop.opacity_multiplier, matrix, _planes(prop, []))
        states.append((prop.GetAddressAsString(""), bool(prop.GetVisibility()), own))
    others = [(other.GetAddressAsString(""), other.GetViewport()) for other in _axes(renderer)]
    return states, renderer.GetSize(), _background(renderer), others


def look_of(actor: Any) -> Any:
    """Return what decides which VDIs an actor shows."""
    several = actor.collection
    if several is None:
        return actor.vdi
    classified_at = None if several.value_range is None else actor.GetProperty().GetMTime()
    return several, len(several), classified_at  # sets may grow


def _planes(actor: Any, missing: list[str]) -> list[list[float]]:
    """Return the planes that an actor is clipped to, origin and normal, world."""
    planes = planes_of(actor.GetMapper())
    if actor.GetMapper().GetCropping():
        missing.append("cropping")
    if len(planes) > MOST_PLANES:
        missing.append(f"{len(planes) - MOST_PLANES} of its clipping planes")
    return planes[:MOST_PLANES]


def _meshes(actor: Any, missing: list[str]) -> Iterator[dict[str, Any]]:
    """Describe the triangles, lines and points that an actor draws, in the world."""
    mapper, look = actor.GetMapper(), actor.GetProperty()
    kind = None if mapper is None else mapper.GetClassName()
    if kind not in ("vtkDataSetMapper", "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper"):
        missing.append(f"what {kind} draws")
    elif actor.HasTranslucentPolygonalGeometry():
        missing.append("what is translucent")
    elif look.GetRepresentation() == 1:
        missing.append("its wireframe")
    if missing:
        return

    # Take the surface to the world, and divide it into triangles, lines and points
    mapper.Update()
    transform, placed = vtk.vtkTransform(), vtk.vtkTransformFilter()
    transform.SetMatrix(actor.GetMatrix())
    placed.SetTransform(transform)
    poly = mapper.GetInputDataObject(0, 0)
    for step in (vtk.vtkDataSetSurfaceFilter(), placed, vtk.vtkTriangleFilter()):
        step.SetInputData(poly)
        step.Update()
        poly = step.GetOutput()
    if poly.GetNumberOfPoints() == 0:
        return
    looks = {
        "clipping planes": mapper.GetNumberOfClippingPlanes(),
        "edges and vertices": look.GetEdgeVisibility() or look.GetVertexVisibility(),
        "a texture": actor.GetTexture(),
        "physically based shading": look.GetInterpolation() == 3,
        "highlights and ambient light": look.GetSpecular() > 0 or look.GetAmbient() > 0,
        "culling": look.GetFrontfaceCulling() or look.GetBackfaceCulling(),
        "tubes and spheres": look.GetRenderLinesAsTubes() or look.GetRenderPointsAsSpheres(),
        "the width of lines": look.GetLineWidth() > 1 and poly.GetNumberOfLines(),
    }
    missing += [what for what, is_used in looks.items() if is_used]

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
    of_each_cell = mapped is not None and bool(int(of_cells))
    normals = poly.GetPointData().GetNormals() if look.GetInterpolation() > 0 else None

    # Send the points of each kind of cell about their middle, as browsers compute in float32
    first, middle = 0, poly.GetCenter()
    kinds = {"points": poly.GetVerts(), "lines": poly.GetLines(), "triangles": poly.GetPolys()}
    for corners, (kind, cells) in enumerate(kinds.items(), 1):
        used = vtk.vtk_to_numpy(cells.GetConnectivityArray())
        owner = first + np.arange(len(used)) // corners
        first += cells.GetNumberOfCells()
        if len(used) == 0:
            continue
        yield {
            "kind": kind if look.GetRepresentation() else "points",
            "origin": middle,
            "radius": poly.GetLength() / 2,
            "points": (points[used] - middle).astype(np.float32),
            "colors": colors[owner if of_each_cell else used].astype(np.uint8),
            "normals": None if normals is None else vtk.vtk_to_numpy(normals)[used].astype("f4"),
            "lit": bool(look.GetLighting()),
            "size": look.GetPointSize(),
        }


def _axes(renderer: Any) -> list[Any]:
    """Return the renderers of axes in front of a renderer: VTK's own, within its viewport."""
    found = []
    for other in renderer.GetRenderWindow().GetRenderers():
        drawn = other.GetDraw() and other.VisibleActorCount() and not isinstance(other, pv.Renderer)
        inside = renderer.IsInViewport(*map(int, other.GetCenter()))
        if drawn and inside and other.GetLayer() > renderer.GetLayer():
            found.append(other)
    return found


def _picture(renderer: Any, flat: list[Any], axes: list[Any]) -> str | None:
    """Draw what lies over a renderer's scene, and its axes, alone; return it as base64 PNG."""
    from PIL import Image

    if not flat and not axes:
        return None
    # Lend them to a window of its own
    own, window = renderer.GetRenderWindow(), vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.AlphaBitPlanesOn()
    window.SetNumberOfLayers(1 + len(axes))
    window.SetSize(*own.GetSize())
    for layer, source in enumerate((renderer, *axes)):
        twin = vtk.vtkRenderer()
        twin.SetActiveCamera(source.GetActiveCamera())
        twin.SetLayer(layer)
        twin.SetBackgroundAlpha(0)
        twin.SetViewport(source.GetViewport())
        for prop in source.GetViewProps() if layer else flat:
            prop.ReleaseGraphicsResources(own)
            twin.AddViewProp(prop)
        window.AddRenderer(twin)
    window.Render()
    (left, bottom), (width, height) = renderer.GetOrigin(), renderer.GetSize()
    pixels = vtk.vtkUnsignedCharArray()
    window.GetRGBACharPixelData(left, bottom, left + width - 1, bottom + height - 1, 0, pixels)
    window.Finalize()  # which frees what the props have there
    # Of premultiplied colours, the lowest row first
    image = Image.frombytes("RGBa", (width, height), bytes(pixels), "raw", "RGBa", 0, -1)
    return png(np.asarray(image.convert("RGBA")))


def _effects(renderer: Any) -> list[str]:
    """Name what changes a renderer's picture as a whole, and cannot be shown."""
    effects = {
        "its render pass or shadows": renderer.GetPass() or renderer.GetUseShadows(),
        "enable_stereo_render": renderer.GetRenderWindow().GetStereoRender(),
        "add_background_image": renderer.GetLayer() > 0,  # its renderer is behind
        "the background's texture (set_environment_texture)": renderer.GetTexturedBackground(),
        "a background's gradient": renderer.GetGradientBackground() and renderer.GetGradientMode(),
    }
    return [name for name, is_used in effects.items() if is_used]


def _background(renderer: Any) -> str:
    """Return a renderer's background as CSS."""
    colors = (renderer.GetBackground(), renderer.GetBackground2())
    low, high = ("rgb({:%} {:%} {:%})".format(*color) for color in colors)
    return f"linear-gradient(to top, {low}, {high})" if renderer.GetGradientBackground() else low


def export_html(plotter: Any, filename: str | os.PathLike[str] | None) -> io.StringIO | None:
    """Write a page of a plotter's scene: see ``plotting.component.PlotterVDIs.export_html``.

    It is drawn, and VDIs that are missing are made.
    """
    renderer, *others = plotter.renderers
    if others:
        raise InvalidArgumentError(
            f"a page shows one renderer, and this plotter has {1 + len(others)}: export plotters "
            "of one, and put their pages beside each other"
        )

    # Draw it, off-screen where it has not been shown
    window = plotter.render_window
    plotter._on_first_render_request()  # as Plotter.show begins
    off_screen = window.GetOffScreenRendering()
    window.SetOffScreenRendering(off_screen or not window.GetMapped())
    try:
        plotter.render()
        picture = plotter.screenshot(return_img=True)[..., :3]
    finally:
        window.SetOffScreenRendering(off_screen)

    target = None if filename is None else Path(filename).with_suffix(".html")
    scene = scene_of(plotter, "the page")
    page = page_of(
        None if scene.shown is None else file_of(scene.shown),
        picture,
        renderer.GetSize(),
        title=plotter.title if target is None else target.stem,
        background=scene.background,
        scene=scene.data,
    )
    if target is None:
        return io.StringIO(page)
    with whole_file(target) as stream:
        stream.write(page.encode())
    return None
