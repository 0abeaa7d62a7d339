"""A ``vtkScalarBarActor`` as the viewer's annotations.js draws it: laid out by VTK's rules.

Sizes and places are pixels from the lower left corner of the bar's frame until they are described.
``t`` is the axis of the bar's thickness and ``along`` that of its length.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.web.scenes.texts import constrained, described_text, size_of
from pyvista_vdi.vtk_pipeline.vtk import vtkScalarBarActor, vtkTextActor, vtkTextProperty

Pair = NDArray[np.float64]


@dataclass
class _Note:
    """A text beside the bar, with a line to it."""

    at: float  # along the bar
    text: str
    color: list[float]


def scalar_bar(bar: Any, renderer: Any) -> Iterator[dict[str, Any]]:
    """Return what a scalar bar draws, as :func:`~.annotations.annotations_of` describes it."""
    table = bar.GetLookupTable()
    if table is None:
        return
    window = np.array(renderer.GetSize(), dtype=float)
    start = np.array(bar.GetPositionCoordinate().GetComputedViewportValue(renderer))
    end = np.array(bar.GetPosition2Coordinate().GetComputedViewportValue(renderer))
    most = (bar.GetMaximumWidthInPixels(), bar.GetMaximumHeightInPixels())
    frame = np.minimum(end - start, most)
    indexed = bool(table.GetIndexedLookup())
    upright = bar.GetOrientation() == 1
    precede = bar.GetTextPosition() == vtkScalarBarActor.PrecedeScalarBar
    pad = bar.GetTextPad()
    t, along = (0, 1) if upright else (1, 0)

    # The bar itself
    thick = int(np.ceil(frame[t] * bar.GetBarRatio()))
    low = np.zeros(2)
    if precede:
        low[t] = frame[t] - thick
    nudge = min(thick / 8, pad)
    thick = int(thick - nudge)
    low[t] = int(low[t] - nudge if precede else low[t] + nudge)
    gap = 4.0
    notes = table.GetNumberOfAnnotatedValues()
    if notes and frame[along] / notes <= 16:
        gap = frame[along] / notes / 4

    # The boxes for NaN and for what is below and above: their room and their lengths
    room = min(thick, frame[along] / 4)
    if room < 4 and frame[along] > 16:
        room = 4.0
    drawn = (
        bar.GetDrawNanAnnotation(),
        bar.GetDrawBelowRangeSwatch(),
        bar.GetDrawAboveRangeSwatch(),
    )
    rooms = [room * bool(each) for each in drawn]
    lengths = [int(r) - pad * (int(r) > 2 * pad) for r in rooms]
    begins = [float(pad)] * 3 if upright else [low[along]] * 3
    if upright:
        low[1] = int(low[1] + rooms[0] + gap)
        begins[1] += int(lengths[0] + gap) * bool(drawn[0])
        low[1] = int(low[1] + rooms[1])
    else:
        begins[0] = int(begins[0] + frame[0] - rooms[0])

    # The title
    title = " ".join(filter(None, (bar.GetTitle(), bar.GetComponentTitle())))
    title_look, free = vtkTextProperty(), bar.GetUnconstrainedFontSize()
    title_look.ShallowCopy(bar.GetTitleTextProperty())
    title_size = np.zeros(2)
    if title:
        if upright or indexed:
            high = np.ceil(frame[1] / 2 - pad)
        else:
            high = (frame[t] - thick - (0 if precede else low[t]) - pad) * bar.GetTitleRatio()
        if not free:
            room_of_title = (int(frame[0]) - 2 * pad, int(high))
            title_look.SetFontSize(constrained([title], title_look, room_of_title, renderer))
        title_size = size_of(title, title_look, renderer)
    line = int(bar.GetFrameProperty().GetLineWidth())
    if upright or not precede:
        title_low = frame[1] - (title_size[1] + pad + line)
    else:
        title_low = pad - line
    long = frame[along]
    if upright:
        long -= title_size[1] + bar.GetVerticalTitleSeparation()
    long = int(long - (rooms[0] + gap))
    if rooms[1]:
        long = int(long - (rooms[1] + gap))
    if rooms[2]:
        long = int(long - rooms[2] - gap * bool(rooms[0]))
    if upright:
        begins[2] = pad + long + gap
        for k in (0, 1):
            begins[2] += int(gap + lengths[k]) * bool(drawn[k])
    else:
        begins[2] = int(begins[2] + frame[0] - rooms[2]) - int(thick + gap) * bool(drawn[0])

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
            tick_long -= sum(
                int(gap + length) for length, on in zip(lengths, drawn, strict=True) if on
            )
            tick_low[0] = pad if precede else tick_low[0] + thick + 2 * pad
            space = (tick_thick, int((tick_long - pad * (len(labels) - 1)) / len(labels)))
        else:
            tick_thick = frame[1] - thick - 4 * pad - title_size[1]
            tick_low[1] = title_size[1] + 2 * pad + title_low if precede else tick_low[1] + thick
            space = (int((tick_long - pad * (len(labels) - 1)) / len(labels)), tick_thick)
        sizes = [size_of(text, label_look, renderer) for text in texts]
        if not free:
            label_look.SetFontSize(constrained(texts, label_look, space, renderer))
            sizes = [size_of(text, label_look, renderer) for text in texts]
            label_size = np.max(sizes, axis=0)
        low[along] += label_size[along] / 2
        long -= label_size[along]
        tick_low[along] = int(tick_low[along] + label_size[along] / 2)
        tick_long -= label_size[along]
        if not upright:
            low[0] += rooms[1]
            tick_low[0] += rooms[1]
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

    def across(begin: float, length: float) -> tuple[Pair, Pair]:
        """Return corner and size of a part of the bar."""
        corner, size = low.copy(), np.array([thick, thick], dtype=float)
        corner[along], size[along] = begin, length
        return corner, size

    if bar.GetDrawBackground():
        look = bar.GetBackgroundProperty()
        yield box(np.zeros(2), frame - 0.5, color=[*look.GetColor(), look.GetOpacity()])
    if bar.GetDrawColorBar():
        if indexed:
            step = long / max(notes, 1)
            # VTK makes the boxes with their notes
            for k, color in enumerate(_indexed_colors(table) if bar.GetDrawAnnotations() else ()):
                begin = low[along] + (notes - 1 - k if upright else k) * step + gap
                yield box(*across(begin, step - 2 * gap), color=color)
        else:
            colors = _bar_colors(bar, table)
            yield box(*across(low[along], long), colors=colors, upright=upright)
    beside = list(_notes(bar, table, low[along], long)) if bar.GetDrawAnnotations() else []
    marks = (bar.GetNanAnnotation(), bar.GetBelowRangeAnnotation(), bar.GetAboveRangeAnnotation())
    for k, color in enumerate(_colors_outside(table)):
        if drawn[k]:
            yield box(*across(begins[k], lengths[k]), color=color)
            if marks[k] and bar.GetDrawAnnotations():
                beside.append(_Note(begins[k] + lengths[k] / 2, marks[k], _nan(table)))
    if bar.GetDrawFrame():
        look = bar.GetFrameProperty()
        color = [*look.GetColor(), look.GetOpacity()]
        yield box(np.zeros(2), frame - 0.5, outline=color, line=look.GetLineWidth())
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
            sideways = ("right" if precede else "left") if upright else "center"
            vertical = "middle" if upright else ("top" if precede else "bottom")
            yield described_text(text, place, label_look, renderer, across=sideways, along=vertical)
    if title:
        place = start + np.array([frame[0] / 2, title_low + title_size[1]])
        yield described_text(title, place, title_look, renderer, across="center", along="top")

    # Notes on the side that labels are not on
    look = _look_of_notes(bar, renderer)
    edge = low[t] + (thick if precede else 0)
    sense, leader = (1 if precede else -1), bar.GetAnnotationLeaderPadding()
    measured = [(note, size_of(note.text, look, renderer)) for note in beside]
    placed = _stacked(measured, low[1], long, gap) if upright else _lapped(measured, gap)
    for note, at, row, ends in placed:
        near, far = edge + sense * gap / 2, edge + sense * (gap / 2 + leader + row)
        corner = np.array([note.at, note.at]) - 0.5
        corner[t] = min(near, far)
        size = np.ones(2)
        size[t] = abs(far - near)
        yield box(corner, size, color=[*note.color, 1.0])
        place = np.array([at, at])
        place[t] = edge + sense * (gap + leader + row)
        # As from the second frame on: in its first, VTK does not heed it
        sideways = ends if not upright else ("left" if precede else "right")
        vertical = "middle" if upright else ("bottom" if precede else "top")
        place = start + place
        yield described_text(note.text, place, look, renderer, across=sideways, along=vertical)


def _look_of_notes(bar: Any, renderer: Any) -> Any:
    """Return how notes are written: as large as VTK scales them with the viewport."""
    look = bar.GetAnnotationTextProperty()
    if not bar.GetAnnotationTextScaling():
        return look
    actor = vtkTextActor()
    actor.SetTextScaleModeToViewport()
    actor.ComputeScaledFont(renderer)
    actor.GetTextProperty().ShallowCopy(look)
    actor.ComputeScaledFont(renderer)
    return actor.GetScaledTextProperty()


def _stacked(
    measured: list[tuple[_Note, Pair]], low: float, long: float, gap: float
) -> Iterator[tuple[_Note, float, float, str]]:
    """Return where notes beside an upright bar stand: from the middle one on, none over another."""
    measured = sorted(measured, key=lambda each: each[0].at)
    middle = len(measured) // 2
    downwards, upwards = low + long, low
    order = [(middle, 0)] if len(measured) % 2 else []
    for k in range(middle):
        order += [(middle - 1 - k, -1), (middle + len(measured) % 2 + k, 1)]
    for k, sense in order:
        note, size = measured[k]
        at, half = note.at, (size[1] + gap) / 2
        if sense < 0 and at + half > downwards:
            at = downwards - half
        elif sense > 0 and at - half < upwards:
            at = upwards + half
        upwards, downwards = max(upwards, at + half), min(downwards, at - half)
        yield note, at, 0.0, ""


def _lapped(
    measured: list[tuple[_Note, Pair]], gap: float
) -> Iterator[tuple[_Note, float, float, str]]:
    """Return where notes along a lying bar stand, and how far off: from the middle one outwards."""
    measured = sorted(measured, key=lambda each: each[0].at)
    middle = (len(measured) - 1) / 2
    taken: list[tuple[float, float, float]] = []  # left, right, far side
    for k in sorted(range(len(measured)), key=lambda k: abs(k - middle)):
        note, (wide, high) = measured[k]
        across = "center" if k == middle else "right" if k > middle else "left"
        begin = note.at - wide * {"left": 0.0, "center": 0.5, "right": 1.0}[across]
        over = [far for left, right, far in taken if begin < right and left < begin + wide]
        row = max(over, default=0.0)
        taken.append((begin, begin + wide, row + high + gap))
        yield note, note.at, row, across


def _notes(bar: Any, table: Any, begin: float, long: float) -> Iterator[_Note]:
    """Return a table's annotations; of categories, one for each box."""
    count, upright = table.GetNumberOfAnnotatedValues(), bar.GetOrientation() == 1
    low, high = table.GetRange()
    for k in range(count):
        text, value = table.GetAnnotation(k), table.GetAnnotatedValue(k)
        color = [0.0, 0.0, 0.0, 0.0]
        table.GetAnnotationColor(value, color)
        if table.GetIndexedLookup():
            share = ((count - 1 - k if upright else k) + 0.5) / count
        else:
            try:
                share = (float(value.ToString()) - low) / (high - low)
            except (ValueError, ZeroDivisionError):
                continue
        if text and 0 <= share <= 1:
            yield _Note(begin + share * long, text, color[:3])


def _labels(bar: Any, table: Any) -> Iterator[tuple[float, str]]:
    """Return where each label stands along the bar, 0 to 1, and its text."""
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
    """Return the bar's colours, RGBA bytes one behind the other: of the middle of each box."""
    count = bar.GetMaximumNumberOfColors()
    low, high = table.GetRange()
    shares = (np.arange(count) + 0.5) / count
    if table.UsingLogScale():
        low, high = np.log10(low), np.log10(high)
    values = low + (high - low) * shares
    colors = []
    rgb = [0.0, 0.0, 0.0]
    for value in 10**values if table.UsingLogScale() else values:
        table.GetColor(value, rgb)
        alpha = table.GetOpacity(value) if bar.GetUseOpacity() else 1.0
        colors += [int(255 * channel + 1e-6) for channel in (*rgb, alpha)]
    return colors


def _indexed_colors(table: Any) -> Iterator[list[float]]:
    for k in range(table.GetNumberOfAnnotatedValues()):
        color = [0.0, 0.0, 0.0, 0.0]
        table.GetIndexedColor(k % max(table.GetNumberOfAvailableColors(), 1), color)
        yield color


def _nan(table: Any) -> list[float]:
    color = [0.0, 0.0, 0.0, 0.0]
    table.GetIndexedColor(-1, color)
    return color[:3]


def _colors_outside(table: Any) -> Iterator[list[float]]:
    """Return RGBA of NaN, of what is below and of what is above."""
    yield [*_nan(table), 1.0]
    for side in ("Below", "Above"):
        get = getattr(table, f"Get{side}RangeColor", None)
        color = [*get()] if get is not None else [*_nan(table), 1.0]
        yield [*color, 1.0][:4]
