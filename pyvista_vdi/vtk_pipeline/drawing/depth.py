"""The depth of what is opaque: read where it can hide a VDI, and when it may have changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyvista_vdi.vtk_pipeline.drawing.frame import (
    Area,
    Frame,
    Image,
    Matrix,
    consumers,
    depths_of,
)
from pyvista_vdi.vtk_pipeline.drawing.images import Recent
from pyvista_vdi.vtk_pipeline.vtk import vtkActor2D, vtkMapper, vtkVolume

#: Pixels around a rectangle that are read as well: a pixel is drawn where its centre is inside.
_MARGIN = 2

#: Actors and mappers that draw nothing but their input's cells, each where it is: what they draw
#: changes with their modification times, and lies in their bounds but for the width of points and
#: lines.
_PLAIN_ACTORS = ("vtkActor", "vtkOpenGLActor")
_PLAIN_MAPPERS = ("vtkDataSetMapper", "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper")


@dataclass
class _Reading:
    """What was read of a renderer's depth buffer."""

    view: Any  # viewport, matrices and area that it belongs to
    state: Any  # all that it depends on; None if that is not known
    z: Image  # window depth in the area, (h, w), bottom row first
    depth: Image | None  # the result


class OpaqueDepths:
    """Depths of a window's renderers: ``window.shared(OpaqueDepths)``."""

    def __init__(self) -> None:
        self._known: Recent[_Reading] = Recent()

    def read(self, frames: Sequence[Frame]) -> Image | None:
        """Return where rays end in the frame that is being drawn; ``None`` if none ends early.

        View depth, float32 (H, W), top row first, world units; inf where nothing is; the same
        object as long as it has not changed. Nothing is read where nothing opaque is before the
        VDIs, outside the VDIs' rectangles on the screen, outside what can hide them where that is
        known, and if all that it depends on is as it was.
        """
        frame = frames[0]
        renderer = frame.renderer  # it has drawn what is opaque
        opaque = _opaque_before(frames)
        if opaque is None:
            return None
        if renderer.GetPass() is not None or not all(_is_plain(prop) for prop in opaque):
            opaque = []
        area = _area(frames, opaque)
        if area is None:
            return None
        view = (frame.size, frame.origin, frame.to_view.tobytes(), frame.projection.tobytes(), area)
        state = _state(renderer, view, opaque)
        place = (renderer.GetAddressAsString(""), *view[:3])  # two eyes have two views
        known = self._known.get(place)
        if known is None or state is None or known.state != state:
            z = frame.opaque_z(area)
            if known is None or known.view != view or not np.array_equal(known.z, z):
                known = _Reading(view, state, z, frame.depth_image(z, area))
            known.state = state
        self._known.keep(place, known)
        return known.depth


def _opaque_before(frames: Sequence[Frame]) -> list[Any] | None:
    """Return the opaque props of a renderer that reach before the end of VDIs; ``None`` if none do.

    Conservative: what has no bounds counts, and so do the assemblies that are being drawn: they
    must not be asked, for an answer would end their walk through their parts. An empty list stands
    for what a lower layer drew, if its depth was kept.
    """
    renderer = frames[0].renderer
    found: list[Any] = []
    if renderer.GetPreserveDepthBuffer():
        return found
    props, drawing, farthest = renderer.GetViewProps(), None, 0.0
    for i in range(props.GetNumberOfItems()):
        prop = props.GetItemAsObject(i)
        if not prop.GetVisibility() or isinstance(prop, vtkActor2D | vtkVolume):
            continue
        if drawing is None:  # there is something else than volumes
            drawing = [thing for own in frames for thing in consumers(own.actor)]
            farthest = max(own.depths_of(own.bounds)[1] for own in frames)
        if prop in drawing:
            found.append(prop)
        elif prop.HasOpaqueGeometry():
            box = prop.GetBounds()
            if not _is_box(box) or depths_of(frames[0].to_view, box)[0] < farthest:
                found.append(prop)
    return found or None


def _area(frames: Sequence[Frame], plain: Sequence[Any]) -> Area | None:
    """Return the pixels in which something opaque may hide a VDI; ``None`` if there are none.

    ``plain`` are the props that may, if all of them are plain; otherwise it is empty.
    """
    frame = frames[0]
    area = _around([own.rectangle(own.bounds) for own in frames])
    if area is not None and plain:
        world = replace(frame, camera=frame.camera.replace(model_transform=frame.to_view))
        hiding = _around([_rectangle_of(prop, world) for prop in plain])
        if hiding is None:
            return None
        area = np.stack([np.maximum(area[0], hiding[0]), np.minimum(area[1], hiding[1])])
    if area is None:
        return None
    low = np.maximum(np.floor(area[0]).astype(int) - _MARGIN, 0)
    high = np.minimum(np.ceil(area[1]).astype(int) + _MARGIN, frame.size)
    if (low >= high).any():
        return None
    (left, bottom), (right, top) = low.tolist(), high.tolist()
    return left, bottom, right, top


def _rectangle_of(prop: Any, world: Frame) -> Matrix | None:
    look = prop.GetProperty()
    return world.rectangle(prop.GetBounds(), max(look.GetPointSize(), look.GetLineWidth()))


def _around(rectangles: Sequence[Matrix | None]) -> Matrix | None:
    """Return the rectangle around others; ``None`` if there are none."""
    there = [r for r in rectangles if r is not None]
    if not there:
        return None
    return np.stack([np.min([r[0] for r in there], axis=0), np.max([r[1] for r in there], axis=0)])


def _is_box(bounds: Any) -> bool:
    return bounds is not None and bounds[0] <= bounds[1]


def _is_plain(prop: Any) -> bool:
    """Whether it is known what a prop draws depends on, and where it is."""
    if prop.GetClassName() not in _PLAIN_ACTORS or not _is_box(prop.GetBounds()):
        return False
    mapper, shader = prop.GetMapper(), prop.GetShaderProperty()
    return (
        mapper is not None
        and mapper.GetClassName() in _PLAIN_MAPPERS
        and prop.GetTexture() is None
        and shader.GetNumberOfShaderReplacements() == 0
        and not (shader.HasVertexShaderCode() or shader.HasGeometryShaderCode())
        and not shader.HasFragmentShaderCode()
    )


def _state(renderer: Any, view: Any, plain: Sequence[Any]) -> Any:
    """Return all that the depth in an area depends on, ``None`` if that is not known."""
    if not plain:
        return None
    return (
        view,
        [(prop.GetAddressAsString(""), *_times(prop)) for prop in plain],
        renderer.GetRenderWindow().GetMultiSamples(),
        renderer.GetUseHiddenLineRemoval(),
        vtkMapper.GetResolveCoincidentTopology(),
    )


def _times(prop: Any) -> list[int]:
    """Return when an actor, and the planes that its mapper clips to, were modified."""
    planes = prop.GetMapper().GetClippingPlanes()
    items = [] if planes is None else [planes.GetItem(i) for i in range(planes.GetNumberOfItems())]
    return [prop.GetRedrawMTime(), *(plane.GetMTime() for plane in items)]
