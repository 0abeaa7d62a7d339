"""Texts and scalar bars of a renderer as a list of what is drawn, for the viewer's annotations.js.

Sizes are pixels of the window that the scene was made in, and places are fractions of it from its
lower left corner; the viewer scales both with its own window. Layouts are VTK's, measured by VTK's
own text renderer: of ``vtkCornerAnnotation``, and in scalar_bar.py of ``vtkScalarBarActor``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pyvista_vdi.extensions.web.scenes.scalar_bar import scalar_bar
from pyvista_vdi.extensions.web.scenes.texts import HORIZONTAL, VERTICAL, described_text, mapper_of
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkActor2D,
    vtkCaptionActor2D,
    vtkCornerAnnotation,
    vtkLabelPlacementMapper,
    vtkPointSetToLabelHierarchy,
    vtkScalarBarActor,
    vtkSelectVisiblePoints,
    vtkTextActor,
)

_WORLD = 5  # vtkCoordinate's VTK_WORLD

#: Where vtkCornerAnnotation's eight texts are: parts of the window's width and height.
_CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0), (1, 0.5), (0, 0.5), (0.5, 1))
_FROM_EDGE = 5  # pixels

#: The largest font that vtkCornerAnnotation tries.
_LARGEST_FONT = 100


def annotations_of(prop: Any, renderer: Any) -> list[dict[str, Any]] | None:
    """Return what a visible 2D prop that was drawn draws; ``None`` if it is none that is known."""
    if isinstance(prop, vtkScalarBarActor):
        return list(scalar_bar(prop, renderer))
    if isinstance(prop, vtkCaptionActor2D):
        return [_caption(prop, renderer)]
    if isinstance(prop, vtkCornerAnnotation):
        return list(_corner_texts(prop, renderer))
    if isinstance(prop, vtkTextActor):
        return [_text_actor(prop, renderer)]
    if isinstance(prop, vtkActor2D) and isinstance(prop.GetMapper(), vtkLabelPlacementMapper):
        return list(_labels_of_points(prop.GetMapper(), renderer))
    return None


def _text_actor(actor: Any, renderer: Any) -> dict[str, Any]:
    coordinate = actor.GetActualPositionCoordinate()
    place = coordinate.GetComputedDoubleViewportValue(renderer)
    scaled = actor.GetTextScaleMode() != vtkTextActor.TEXT_SCALE_MODE_NONE
    look = actor.GetScaledTextProperty() if scaled else actor.GetTextProperty()
    described = described_text(actor.GetInput() or "", place, look, renderer)
    if coordinate.GetCoordinateSystem() == _WORLD:
        described["at"] = list(coordinate.GetComputedWorldValue(renderer))
    return described


def _caption(caption: Any, renderer: Any) -> dict[str, Any]:
    look = caption.GetTextActor().GetScaledTextProperty()
    text = described_text(caption.GetCaption(), (0, 0), look, renderer)
    place = {"at": list(caption.GetAttachmentPoint()), "shift": [caption.GetPadding(), 2]}
    return {**text, **place, "across": "left", "along": "bottom"}


def _labels_of_points(mapper: Any, renderer: Any) -> Iterator[dict[str, Any]]:
    """Yield the labels at points; the viewer leaves out those that overlap nearer ones."""
    hierarchy = mapper.GetInputAlgorithm(0, 0)
    if not isinstance(hierarchy, vtkPointSetToLabelHierarchy):
        return
    above = hierarchy.GetInputAlgorithm(0, 0)
    if isinstance(above, vtkSelectVisiblePoints):  # of one view
        points = above.GetInputDataObject(0, 0)
    else:
        points = hierarchy.GetInputDataObject(0, 0)
    texts = points.GetPointData().GetAbstractArray(hierarchy.GetLabelArrayName())
    look, more = hierarchy.GetTextProperty(), {}
    if mapper.GetShape() != vtkLabelPlacementMapper.NONE:
        more["round"] = mapper.GetShape() == vtkLabelPlacementMapper.ROUNDED_RECT
        if mapper.GetStyle() == vtkLabelPlacementMapper.FILLED:
            more["background"] = [*mapper.GetBackgroundColor(), mapper.GetBackgroundOpacity()]
        else:
            more["frame"] = [*mapper.GetBackgroundColor(), 1]
    for k in range(0 if texts is None else texts.GetNumberOfValues()):
        text = texts.GetVariantValue(k).ToString()
        at = {"at": list(points.GetPoint(k)), "alone": True, "margin": mapper.GetMargin()}
        yield described_text(text, (0, 0), look, renderer, **at, **more)


def _corner_texts(annotation: Any, renderer: Any) -> Iterator[dict[str, Any]]:
    look = annotation.GetTextProperty()
    texts = [annotation.GetText(k) or "" for k in range(len(_CORNERS))]
    size = _corner_font(annotation, texts, renderer)
    if size < annotation.GetMinimumFontSize():
        return
    extent = renderer.GetSize()
    for text, part in zip(texts, _CORNERS, strict=True):
        if text.strip():
            place = [
                edge * share + _FROM_EDGE * (share == 0) - _FROM_EDGE * (share == 1)
                for edge, share in zip(extent, part, strict=True)
            ]
            yield described_text(
                text,
                place,
                look,
                renderer,
                size,
                across=HORIZONTAL[int(2 * part[0])],
                along=VERTICAL[int(2 * part[1])],
            )


def _corner_font(annotation: Any, texts: list[str], renderer: Any) -> int:
    """Return the size of the font that vtkCornerAnnotation takes for a viewport."""
    extent = np.array(renderer.GetSize())
    mappers = [mapper_of(text, annotation.GetTextProperty()) for text in texts]
    rows = [text.count("\n") + 1 if text else 0 for text in texts]
    columns = ((0, 2), (1, 3), (4, 7))  # whose texts stand one above the other
    line = int(extent[1] * annotation.GetMaximumLineHeight())
    allowed = [line * max(rows[a] + rows[b], 1) for a, b in columns]

    def fits(size: int) -> bool:
        sizes = []
        for mapper in mappers:
            mapper.GetTextProperty().SetFontSize(size)
            held = [0, 0]
            mapper.GetSize(renderer, held)
            sizes.append(held)
        heights = [sizes[a][1] + sizes[b][1] for a, b in columns]
        width = max(sizes[a][0] + sizes[b][0] for a, b in ((0, 1), (2, 3), (5, 6)))
        high, wide = int(0.9 * extent[1]), int(0.9 * extent[0])
        return width <= wide and all(
            h <= min(high, most) for h, most in zip(heights, allowed, strict=True)
        )

    size = next((s for s in range(_LARGEST_FONT, 0, -1) if fits(s)), 0)
    scaled = size ** annotation.GetNonlinearFontScaleFactor()
    scaled *= annotation.GetLinearFontScaleFactor()
    return min(int(scaled), annotation.GetMaximumFontSize())
