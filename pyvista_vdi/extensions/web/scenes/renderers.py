"""What is drawn about a renderer's scene: by other renderers of its window, and flat on the screen.

Each is a picture in a part of the window with a camera of its own: axes in a corner, which turn
with the scene, an image behind it, and a logo or a slider, which stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.web.camera import viewer_camera
from pyvista_vdi.extensions.web.placing import array_of
from pyvista_vdi.extensions.web.scenes.annotations import annotations_of
from pyvista_vdi.extensions.web.scenes.meshes import Keep, shapes_of
from pyvista_vdi.extensions.web.scenes.props import (
    bounds_of,
    collected,
    image_quad,
    lights_of,
    parts_of,
    unlit,
)
from pyvista_vdi.extensions.web.scenes.texts import described_text
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkActor,
    vtkImageActor,
    vtkPolyData,
    vtkPolyDataMapper2D,
    vtkTextMapper,
    vtkTexturedActor2D,
)

#: The widget with balls on its axes: they face the viewer, however the view is turned.
_BALLS = "vtkCameraOrientationRepresentation"

#: Of the balls' points: 1/30 of a pixel where the widget is as large as VTK makes it.
_FINENESS = 2.0**-11


def others_of(
    renderer: Any, keep: Keep, texts: list[dict[str, Any]], left_out: list[str]
) -> Iterator[dict[str, Any]]:
    """Describe what other renderers of a plotter's window draw within one's viewport.

    ``place`` (parts of the viewport: left, bottom, right, top), ``camera``, ``bounds``, ``lights``,
    ``shapes``; whether it ``turns`` with the scene, and is ``behind`` it. Texts, and what cannot be
    drawn, are added to the lists.
    """
    low, high = np.reshape(renderer.GetViewport(), (2, 2))
    for number, other in enumerate(around(renderer)):
        method = "add_background_image" if _is_image(other) else "add_orientation_widget"
        missing: list[str] = []
        shapes: list[dict[str, Any]] = []
        for prop in filter(_is_visible, other.GetViewProps()):
            if prop.IsA(_BALLS):
                view = array_of(renderer.GetActiveCamera().GetViewTransformMatrix())
                shapes += _balls(prop, view, keep, missing)
                continue
            for part, matrix in parts_of(prop):
                if (solid := image_quad(part) if _is_image(other) else part) is None:
                    left_out.append(method)
                elif isinstance(solid, vtkActor):
                    shapes += shapes_of(solid, matrix, keep, missing)
                elif (written := annotations_of(part, other)) is not None:
                    texts += [{**text, "renderer": number} for text in written]
                else:
                    left_out.append(f"{method} ({type(prop).__name__})")
        left_out += [f"{what} ({method})" for what in missing]
        camera = other.GetActiveCamera()
        seen = np.clip(other.GetViewport(), 0, 1).reshape(2, 2)  # as VTK does
        place = (seen - low) / (high - low)
        yield {
            "place": place.ravel().tolist(),
            "camera": {**viewer_camera(camera, other.GetSize()), "distance": camera.GetDistance()},
            "bounds": bounds_of(other),
            "lights": list(lights_of(other)),
            "shapes": shapes,
            "turns": not _is_image(other),
            "behind": other.GetLayer() < renderer.GetLayer(),
        }


def around(renderer: Any) -> list[Any]:
    """Return the other renderers of a plotter's window that draw within a renderer's viewport."""
    own, window = (
        getattr(getattr(renderer, "parent", None), "renderers", None),
        renderer.GetRenderWindow(),
    )
    if own is None or window is None:
        return []
    known = {*own, getattr(own, "border_overlay_renderer", None)}
    found, layers = [], window.GetRenderers()
    low, high = np.reshape(renderer.GetViewport(), (2, 2))
    for k in range(layers.GetNumberOfItems()):
        other = layers.GetItemAsObject(k)
        if other in known or not other.GetDraw() or not other.GetViewProps().GetNumberOfItems():
            continue
        start, end = np.reshape(other.GetViewport(), (2, 2))
        if not _is_image(other):  # of one view; an image may be behind several
            start = end = (start + end) / 2
        if (start < high).all() and (end > low).all():
            found.append(other)
    return found


def _is_visible(prop: Any) -> bool:
    return bool(prop.GetVisibility())


def _is_image(renderer: Any) -> bool:
    return all(isinstance(prop, vtkImageActor) for prop in renderer.GetViewProps())


def _balls(
    widget: Any, view: NDArray[np.float64], keep: Keep, missing: list[str]
) -> Iterator[dict[str, Any]]:
    """Describe the widget with balls, without the view's turn, which the viewer does."""
    back = np.eye(4)
    back[:3, :3] = view[:3, :3].T
    for actor in filter(_is_visible, collected(widget.GetActors)):
        if actor.GetTexture() is None:  # the axes
            yield from shapes_of(actor, back, keep, missing)
            continue
        actor.GetMapper().Update()
        ball = vtkPolyData()
        ball.DeepCopy(actor.GetMapper().GetInput())
        points, places = ball.GetPoints().GetData(), ball.GetPointData().GetTCoords()
        x0, x1, y0, y1, back_side, _ = actor.GetBounds()
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, back_side])
        # About the origin, and no finer than can be seen: six balls that are nearly alike
        for numbers, zero in ((vtk_to_numpy(points), middle), (vtk_to_numpy(places), 0)):
            numbers[:] = np.rint((numbers - zero) / _FINENESS) * _FINENESS
        points.Modified()
        moved = np.eye(4)
        moved[:3, 3] = back[:3, :3] @ middle
        disc = unlit(ball, actor.GetProperty(), actor.GetTexture())
        yield from ({**shape, "facing": True} for shape in shapes_of(disc, moved, keep, missing))


def flat_of(
    prop: Any, renderer: Any, keep: Keep, missing: list[str]
) -> tuple[dict[str, Any] | None, list[dict[str, Any]]] | None:
    """Describe what is flat on the screen, as :func:`others_of` does, and its texts.

    Returns ``None`` for what draws by means of its own.
    """
    width, height = renderer.GetSize()
    actors, texts = [], []
    for part in collected(prop.GetActors2D):
        mapper = part.GetMapper()
        if not part.GetVisibility():
            continue
        x, y = part.GetPositionCoordinate().GetComputedViewportValue(renderer)
        if isinstance(mapper, vtkTextMapper):
            text = mapper.GetInput() or ""
            texts.append(described_text(text, (x, y), mapper.GetTextProperty(), renderer))
        elif isinstance(mapper, vtkPolyDataMapper2D):
            texture = part.GetTexture() if isinstance(part, vtkTexturedActor2D) else None
            actors.append(unlit(_in_pixels(mapper, (x, y), renderer), part.GetProperty(), texture))
    shapes = [shape for a in actors for shape in shapes_of(a, np.eye(4), keep, missing)]
    if not shapes:
        return (None, texts) if texts else None
    bounds = np.array([actor.GetBounds() for actor in actors])
    low = np.floor(bounds[:, (0, 2)].min(axis=0)) - 1  # whole pixels
    high = np.ceil(bounds[:, (1, 3)].max(axis=0)) + 1
    middle = ((low + high) / 2).tolist()
    described = {
        "place": [*(low / (width, height)), *(high / (width, height))],
        "window": [width, height],
        "camera": {
            "position": [*middle, 1.0],
            "focal_point": [*middle, 0.0],
            "view_up": [0.0, 1.0, 0.0],
            "parallel_scale": (high - low)[1] / 2,
        },
        "bounds": [low[0], high[0], low[1], high[1], 0.0, 0.0],
        "lights": [],
        "shapes": shapes,
        "turns": False,
        "behind": False,
    }
    return described, texts


def _in_pixels(mapper: Any, position: tuple[int, int], renderer: Any) -> Any:
    """Return what a mapper draws in two dimensions, in pixels of the viewport."""
    mapper.Update()
    poly = vtkPolyData()
    poly.DeepCopy(mapper.GetInput())
    points, coordinate = vtk_to_numpy(poly.GetPoints().GetData()), mapper.GetTransformCoordinate()
    for point in points if coordinate is not None else ():
        coordinate.SetValue(*map(float, point))
        point[:2] = coordinate.GetComputedDoubleViewportValue(renderer)
    points[:, :2] += position
    points[:, 2] = 0
    return poly
