"""Texts and scalar bars of a renderer as a list of what is drawn, for the viewer's annotations.js.

Sizes are pixels of the window that the scene was made in, and places are fractions of it from its
lower left corner; the viewer scales both with its own window. Layouts are VTK's:
``vtkScalarBarActor`` and ``vtkCornerAnnotation``, measured by VTK's own text renderer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkActor2D,
    vtkCornerAnnotation,
    vtkLabelPlacementMapper,
    vtkPointSetToLabelHierarchy,
    vtkScalarBarActor,
    vtkSelectVisiblePoints,
    vtkTextActor,
    vtkTextMapper,
    vtkTextProperty,
)

_HORIZONTAL = ("left", "center", "right")  # vtkTextProperty's justifications
_VERTICAL = ("bottom", "middle", "top")
_WORLD = 5  # vtkCoordinate's VTK_WORLD

#: Where vtkCornerAnnotation's eight texts are: parts of the window's width and height.
_CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0), (1, 0.5), (0, 0.5), (0.5, 1))
_FROM_EDGE = 5  # pixels

#: The largest font that vtkCornerAnnotation tries.
_LARGEST_FONT = 100


def annotations_of(prop: Any, renderer: Any, left_out: list[str]) -> list[dict[str, Any]] | None:
    """Return what a 2D prop draws; ``None`` if it is none that is known.

    Parameters
    ----------
    prop : vtkProp
        Visible; drawn before.
    renderer : vtkRenderer
        Which shows it.
    left_out : list of str
        What cannot be drawn is said here.
    """
    if isinstance(prop, vtkScalarBarActor):
        return list(_scalar_bar(prop, renderer, left_out))
    if isinstance(prop, vtkCornerAnnotation):
        return list(_corner_texts(prop, renderer))
    if isinstance(prop, vtkTextActor):
        return [_text_actor(prop, renderer)]
    if isinstance(prop, vtkActor2D) and isinstance(prop.GetMapper(), vtkLabelPlacementMapper):
        return list(_labels_of_points(prop.GetMapper(), renderer))
    return None


def described_text(
    text: str, place: Any, look: Any, renderer: Any, size: float | None = None, **changes: Any
) -> dict[str, Any]:
    """Describe a text; ``place`` in pixels from the lower left corner."""
    width, height = renderer.GetSize()
    described: dict[str, Any] = {
        "kind": "text",
        "text": text,
        "place": [place[0] / width, place[1] / height],
        "size": look.GetFontSize() if size is None else size,
        "color": [*look.GetColor(), look.GetOpacity()],
        "family": look.GetFontFamilyAsString(),
        "bold": bool(look.GetBold()),
        "italic": bool(look.GetItalic()),
        "shadow": list(look.GetShadowOffset()) if look.GetShadow() else None,
        "angle": look.GetOrientation(),
        "spacing": look.GetLineSpacing(),
        "across": _HORIZONTAL[look.GetJustification()],
        "along": _VERTICAL[look.GetVerticalJustification()],
    }
    if look.GetBackgroundOpacity() > 0:
        described["background"] = [*look.GetBackgroundColor(), look.GetBackgroundOpacity()]
    if look.GetFrame():
        described["frame"] = [*look.GetFrameColor(), look.GetFrameWidth()]
    return {**described, **changes}


def _text_actor(actor: Any, renderer: Any) -> dict[str, Any]:
    coordinate = actor.GetActualPositionCoordinate()
    place = coordinate.GetComputedDoubleViewportValue(renderer)
    scaled = actor.GetTextScaleMode() != vtkTextActor.TEXT_SCALE_MODE_NONE
    look = actor.GetScaledTextProperty() if scaled else actor.GetTextProperty()
    described = described_text(actor.GetInput() or "", place, look, renderer)
    if coordinate.GetCoordinateSystem() == _WORLD:
        described["at"] = list(coordinate.GetComputedWorldValue(renderer))
    return described


def _labels_of_points(mapper: Any, renderer: Any) -> Iterator[dict[str, Any]]:
    """Give the labels at points; the viewer leaves out those that overlap nearer ones."""
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
        more["background"] = [*mapper.GetBackgroundColor(), mapper.GetBackgroundOpacity()]
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
                across=_HORIZONTAL[int(2 * part[0])],
                along=_VERTICAL[int(2 * part[1])],
            )


def _corner_font(annotation: Any, texts: list[str], renderer: Any) -> int:
    """Return the size of the font that vtkCornerAnnotation takes for a viewport."""
    extent = np.array(renderer.GetSize())
    mappers = []
    for text in texts:
        mapper = vtkTextMapper()
        mapper.SetInput(text)
        mapper.GetTextProperty().ShallowCopy(annotation.GetTextProperty())
        mappers.append(mapper)
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


def _scalar_bar(bar: Any, renderer: Any, left_out: list[str]) -> Iterator[dict[str, Any]]:
    table = bar.GetLookupTable()
    if table is None:
        return
    for shown, what in (
        (table.GetIndexedLookup(), "the boxes of a scalar bar's categories"),
        (bar.GetDrawNanAnnotation(), "a scalar bar's box for NaN"),
        (bar.GetDrawBelowRangeSwatch(), "a scalar bar's box for what is below"),
        (bar.GetDrawAboveRangeSwatch(), "a scalar bar's box for what is above"),
        (bar.GetDrawAnnotations() and table.GetNumberOfAnnotatedValues(), "its annotations"),
    ):
        if shown:
            left_out.append(what)
    window = np.array(renderer.GetSize(), dtype=float)
    start = np.array(bar.GetPositionCoordinate().GetComputedViewportValue(renderer))
    end = np.array(bar.GetPosition2Coordinate().GetComputedViewportValue(renderer))
    most = (bar.GetMaximumWidthInPixels(), bar.GetMaximumHeightInPixels())
    frame = np.minimum(end - start, most)
    upright = bar.GetOrientation() == 1
    precede = bar.GetTextPosition() == vtkScalarBarActor.PrecedeScalarBar
    pad = bar.GetTextPad()
    t, along = (0, 1) if upright else (1, 0)  # axes of thickness and of length

    # The bar itself
    thick = int(np.ceil(frame[t] * bar.GetBarRatio()))
    low = np.zeros(2)
    if precede:
        low[t] = frame[t] - thick
    nudge = min(thick / 8, pad)
    thick = int(thick - nudge)
    low[t] = int(low[t] - nudge if precede else low[t] + nudge)
    swatch = 4.0
    notes = table.GetNumberOfAnnotatedValues()
    if notes and frame[along] / notes <= 16:
        swatch = frame[along] / notes / 4

    # The title
    title = " ".join(filter(None, (bar.GetTitle(), bar.GetComponentTitle())))
    title_look, free = vtkTextProperty(), bar.GetUnconstrainedFontSize()
    title_look.ShallowCopy(bar.GetTitleTextProperty())
    title_size = np.zeros(2)
    if title:
        if upright or table.GetIndexedLookup():
            high = np.ceil(frame[1] / 2 - pad)
        else:
            high = (frame[t] - thick - (0 if precede else low[t]) - pad) * bar.GetTitleRatio()
        if not free:
            room = (int(frame[0]) - 2 * pad, int(high))
            title_look.SetFontSize(_constrained([title], title_look, room, renderer))
        title_size = _size(title, title_look, renderer)
    line = int(bar.GetFrameProperty().GetLineWidth())
    if upright or not precede:
        title_low = frame[1] - (title_size[1] + pad + line)
    else:
        title_low = pad - line
    long = frame[along]
    if upright:
        long -= title_size[1] + bar.GetVerticalTitleSeparation()
        low[1] += swatch
    long = int(long - swatch)

    # Its labels
    label_look = vtkTextProperty()
    label_look.ShallowCopy(bar.GetLabelTextProperty())
    labels = list(_labels(bar, table))
    texts = [text for _, text in labels]
    tick_low, tick_long, tick_thick = low.copy(), float(long), 0.0
    label_size = np.zeros(2)
    if labels:
        if upright:
            tick_thick = frame[0] - thick - 3 * pad
            tick_long = frame[1] - title_size[1] - 3 * pad - bar.GetVerticalTitleSeparation()
            tick_low[0] = pad if precede else tick_low[0] + thick + 2 * pad
            room = (tick_thick, int((tick_long - pad * (len(labels) - 1)) / len(labels)))
        else:
            tick_thick = frame[1] - thick - 4 * pad - title_size[1]
            tick_low[1] = title_size[1] + 2 * pad + title_low if precede else tick_low[1] + thick
            room = (int((tick_long - pad * (len(labels) - 1)) / len(labels)), tick_thick)
        sizes = [_size(text, label_look, renderer) for text in texts]
        if not free:
            label_look.SetFontSize(_constrained(texts, label_look, room, renderer))
            sizes = [_size(text, label_look, renderer) for text in texts]
            label_size = np.max(sizes, axis=0)
        low[along] += label_size[along] / 2
        long -= label_size[along]
        tick_low[along] = int(tick_low[along] + label_size[along] / 2)
        tick_long -= label_size[along]
        if not upright:
            tick_low[1] += -pad if precede else pad
            tick_long -= pad
        if free:
            wide, high = np.max(sizes, axis=0)
            if upright:
                title_low += int(high * 0.75)
                tick_thick = wide
                if precede:
                    tick_low[0] = -wide + frame[0] - thick - wide * 0.05
            elif precede:
                title_low = low[1] - title_size[1] - high
            else:
                title_low = thick + high

    def box(corner: Any, size: Any, **look: Any) -> dict[str, Any]:
        place = [*((start + corner) / window), *((start + corner + size) / window)]
        return {"kind": "box", "place": place, **look}

    if bar.GetDrawBackground():
        look = bar.GetBackgroundProperty()
        yield box(np.zeros(2), frame, color=[*look.GetColor(), look.GetOpacity()])
    if bar.GetDrawColorBar():
        size = np.array([thick, long] if upright else [long, thick], dtype=float)
        colors = _bar_colors(bar, table)
        yield box(low, size, colors=colors, upright=upright)
    if bar.GetDrawFrame():
        look = bar.GetFrameProperty()
        color = [*look.GetColor(), look.GetOpacity()]
        yield box(np.zeros(2), frame, outline=color, line=look.GetLineWidth())
    if bar.GetDrawTickLabels():
        for anchor, text in labels:
            if not -1e-6 < anchor < 1 + 1e-6:
                continue
            place = start + tick_low
            place[along] += anchor * tick_long
            if upright and precede:
                place[0] += tick_thick
            elif not upright and precede:
                place[1] += tick_thick
            across = ("right" if precede else "left") if upright else "center"
            vertical = "middle" if upright else ("top" if precede else "bottom")
            yield described_text(text, place, label_look, renderer, across=across, along=vertical)
    if title:
        place = start + np.array([frame[0] / 2, title_low + title_size[1]])
        yield described_text(title, place, title_look, renderer, across="center", along="top")


def _labels(bar: Any, table: Any) -> Iterator[tuple[float, str]]:
    """Give where each label stands along the bar, 0 to 1, and its text."""
    if table.GetIndexedLookup():
        return
    low, high = table.GetRange()
    log = bool(table.UsingLogScale())
    if log:
        low, high = np.log10(low), np.log10(high)
    if bar.GetUseCustomLabels() and bar.GetCustomLabels() is not None:
        custom = bar.GetCustomLabels()
        values = [custom.GetValue(i) for i in range(custom.GetNumberOfTuples())]
        for value in values:
            place = np.log10(value) if log and value > 0 else value
            anchor = (place - low) / (high - low) if high > low else 0.5
            yield float(anchor), _formatted(bar.GetLabelFormat(), value)
        return
    count = bar.GetNumberOfLabels()
    for k in range(count):
        anchor = k / (count - 1) if count > 1 else 0.5
        value = low + anchor * (high - low)
        yield anchor, _formatted(bar.GetLabelFormat(), 10.0**value if log else value)


def _formatted(form: str, value: float) -> str:
    """Write a number as printf, or as C++'s format, does."""
    try:
        return form.format(value) if "{" in form else form % value
    except (TypeError, ValueError):
        return f"{value:g}"


def _bar_colors(bar: Any, table: Any) -> list[int]:
    """Return the bar's colours, RGBA bytes one behind the other."""
    count = bar.GetMaximumNumberOfColors()
    low, high = table.GetRange()
    if table.UsingLogScale():
        values = 10 ** np.linspace(np.log10(low), np.log10(high), count, endpoint=False)
    else:
        values = np.linspace(low, high, count, endpoint=False)
    colors = []
    rgb = [0.0, 0.0, 0.0]
    for value in values:
        table.GetColor(value, rgb)
        alpha = table.GetOpacity(value) if bar.GetUseOpacity() else 1.0
        colors += [int(255 * channel) for channel in (*rgb, alpha)]
    return colors


def _size(text: str, look: Any, renderer: Any) -> Any:
    """Return the width and height of a text, pixels."""
    mapper = vtkTextMapper()
    mapper.SetInput(text)
    mapper.GetTextProperty().ShallowCopy(look)
    held = [0, 0]
    mapper.GetSize(renderer, held)
    return np.array(held, dtype=float)


def _constrained(texts: list[str], look: Any, room: Any, renderer: Any) -> int:
    """Return the largest font by which all texts have room."""
    sizes = []
    for text in texts:
        mapper = vtkTextMapper()
        mapper.SetInput(text)
        mapper.GetTextProperty().ShallowCopy(look)
        sizes.append(mapper.SetConstrainedFontSize(renderer, int(room[0]), int(room[1])))
    return max(min(sizes), 1)
