"""Writes a step's lists by themselves or by what they were: the encoder of the space-time form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.series.codes import (
    ENTRIES,
    Codes,
    Floats,
    Integers,
    Tables,
    strides_for,
    tau_values,
)
from pyvista_vdi.extensions.series.differences import (
    END,
    FARTHEST,
    HOW,
    KEPT,
    OWN,
    PLACED,
    SAME,
    Arrays,
    Stepped,
    There,
    View,
    codes_at,
    guessed_fronts,
    guessed_media,
    moved,
    pitches_of,
    rounded,
    there_of,
)
from pyvista_vdi.io.vdi_file.chunks import smallest
from pyvista_vdi.model.packing import TAU_CODES

#: A supersegment that is kept saves about this many bits, and each of the old and the new list
#: takes one to say whether it is.
_SAVED_BITS = 4
#: With a tolerance, what is lost is judged for crossings up to so many times as long as V_O's.
_LONGEST = 4
#: Opacities as low as 1 / 16 of the whole let colours differ by so many times the tolerance.
_COARSER = (16, 8, 4, 2, 1, 0)
#: Codes of optical depth that are rounded to, where the tolerance lets them.
_TAU_UNITS = (1 << 12, 64, 32, 16, 8, 4, 2)


def encoded(
    step: Stepped, before: Stepped | None, tolerance: float = 0.0
) -> tuple[Stepped, Arrays]:
    """Return what a reader will have of a step, and the arrays to be written for it.

    ``step`` has the tables and samples of ``before``, another step of the same window, camera
    and depth grid. Colours and opacities may differ by the tolerance, 0 to 1; with 0 the step
    itself is read.
    """
    codes, n_lists = step.codes, len(step.codes.counts)
    same = np.zeros(n_lists, bool)
    if before is not None:
        same = _same_lists(codes, before.codes, tolerance)
    how = np.where(same, SAME, OWN).astype(np.uint8)
    view = View(codes, np.flatnonzero(~same & (codes.counts > 0)))
    pitches = pitches_of(step, view.lists)
    there = there_of(before, view.lists)
    unit = view.strides if pitches is None else pitches
    front, back = view.samples(codes.front, unit), view.samples(codes.back, unit)

    arrays: Arrays = {}
    shift = np.zeros(len(view.lists), np.int64)
    kept = np.zeros(len(view.rows), bool)
    if before is not None:
        old, moved_by = before.codes, unit if pitches is not None else there.strides
        shift[there.has] = rounded((view.origins - there.origins)[there.has], moved_by[there.has])
        there.has &= np.abs(shift) < FARTHEST
        shift[~there.has] = 0
        how[view.lists[there.has]] = PLACED
        rows, old_rows = _matches(view, front, back, shift, old, there, moved_by)
        n_kept = np.bincount(view.own[rows], minlength=len(view.lists))
        pays = n_kept * _SAVED_BITS > view.counts + there.counts
        how[view.lists[pays]] = KEPT
        chosen = pays[view.own[rows]]
        rows, old_rows = rows[chosen], old_rows[chosen]
        kept[rows] = True
        old_view = View(old, view.lists[pays])
        kept_there = np.zeros(len(old.front), bool)
        kept_there[old_rows] = True
        arrays["kept"] = np.packbits(kept[pays[view.own]])
        arrays["kept_there"] = np.packbits(kept_there[old_view.rows])
        arrays["shift"] = _folded(shift[there.has])
    else:
        old_rows = np.empty(0, np.int64)

    origin = view.origins - _guessed_origins(view.origins, there, shift, unit, pitches is None)
    arrays["origin"] = _folded(origin)
    gap = front.copy()
    gap[1:] -= back[:-1]
    gap[view.first] = front[view.first]
    length = back - front
    arrays["gap"], arrays["length"] = smallest(gap[~kept]), smallest(length[~kept])

    # The last face: at a whole sample, or where it was
    guessed = codes_at(back, unit, view)
    f, b = codes.front[view.rows], codes.back[view.rows]
    end = guessed[view.last]
    was = rounded(there.ends - view.origins, view.strides)
    as_it_was = there.has & (np.abs(b[view.last] - was) < np.abs(b[view.last] - end))
    how[view.lists[as_it_was]] += END
    guessed_end = np.where(as_it_was, was, end)
    span = np.where(as_it_was, (there.ends - view.origins).astype(float), back[view.last] * unit)
    arrays["stride"] = _folded(
        view.strides - _guessed_strides(view.strides, span, there, pitches is None)
    )
    arrays["end"] = _folded(b[view.last] - guessed_end)
    beyond = b - guessed
    left = beyond.copy()
    left[view.last] = 0
    arrays["back"] = _folded(left)
    arrays["front"] = _folded(f - guessed_fronts(b, front, gap, unit, view))

    lengths = length + beyond * (view.strides / unit)[view.own]
    media = _Media(codes, view, step.tables)
    if tolerance:
        media.near(tolerance, lengths, before, kept, old_rows)
    guess = np.zeros(len(kept), np.uint8)
    if before is not None:
        guess[kept] = before.codes.entries[old_rows]
    arrays["entry"] = media.entries - guess
    colors, tau = guessed_media(media.entries, guess, kept, old_rows, lengths, step.tables, before)
    color = media.color - colors
    for k, name in enumerate(("red", "green", "blue")):
        arrays[name] = np.ascontiguousarray(color[:, k])
    arrays["optical_depth"] = _folded(media.tau - tau)

    coded = ~same
    base = np.zeros(n_lists, np.int64)
    if before is not None:
        by_it = (how & HOW) >= PLACED
        base[by_it] = before.codes.counts[by_it]
    difference = codes.counts - base
    written = difference[coded]
    arrays["counts"] = smallest(np.where(how[coded] & 2, _folded(written), written))
    arrays["how"] = how
    read = media.put_into(codes, view, same, None if before is None else before.codes)
    return Stepped(read, step.tables, step.samples, step.window_size), arrays


class _Media:
    """Colours and optical depths of the supersegments in some lists, and their entries."""

    def __init__(self, codes: Codes, view: View, tables: Tables) -> None:
        self._tables = tables
        self.color, self.tau = codes.color[view.rows], codes.tau[view.rows]
        self.entries = tables.nearest(self.color)

    def near(
        self,
        tolerance: float,
        lengths: Floats,
        before: Stepped | None,
        kept: NDArray[np.bool_],
        old_rows: Integers,
    ) -> None:
        """Take what is within the tolerance and is guessed, or takes fewer bytes."""
        color, tau = self.color.copy(), self.tau
        stay = np.zeros(len(tau), bool)
        if before is not None and len(old_rows):
            rows, old = np.flatnonzero(kept), before.codes
            good = _colors_near(color[rows], old.color[old_rows], tau[rows], tolerance)
            good &= _opacities_near(tau[rows], old.tau[old_rows], tolerance)
            rows, was = rows[good], old_rows[good]
            stay[rows] = True
            self.entries[rows] = old.entries[was]
            self.color[rows], self.tau[rows] = old.color[was], old.tau[was]
        table, fresh = self._tables.colors, ~stay
        for coarse in _COARSER:
            middle = _middles(table, tolerance * coarse)[self.entries]
            good = fresh & _colors_near(color, table[middle], tau, tolerance)
            self.entries[good], self.color[good] = middle[good], table[middle[good]]
            fresh &= ~good
        guess = self._tables.tau(self.entries, lengths)
        left, fresh = tau - guess, ~stay
        for unit in _TAU_UNITS:
            rounded = np.clip(guess + (left + unit // 2) // unit * unit, 0, TAU_CODES)
            good = fresh & _opacities_near(tau, rounded, tolerance)
            self.tau = np.where(good, rounded, self.tau)
            fresh &= ~good

    def put_into(
        self, codes: Codes, view: View, same: NDArray[np.bool_], old: Codes | None
    ) -> Codes:
        """Return the codes that a reader will have."""
        read = replace(codes)
        read.color, read.tau = codes.color.copy(), codes.tau.copy()
        read.entries = np.empty(len(codes.tau), np.uint8)
        if old is not None:
            lists = np.flatnonzero(same)
            rows, was = View(codes, lists).rows, View(old, lists).rows
            read.color[rows], read.tau[rows] = old.color[was], old.tau[was]
            read.entries[rows] = old.entries[was]
        read.color[view.rows], read.tau[view.rows] = self.color, self.tau
        read.entries[view.rows] = self.entries
        return read


def _guessed_origins(
    origins: Integers, there: There, shift: Integers, unit: Floats | Integers, plain: bool
) -> Integers:
    """Return origins as they were, moved, or that of the list before."""
    guessed = moved(there, shift, there.strides if plain else unit)
    guessed[~there.has] = _each_before(origins[~there.has])
    return guessed


def _guessed_strides(strides: Integers, spans: Floats, there: There, plain: bool) -> Integers:
    """Return strides that spans of steps imply; without samples, those of before."""
    if not plain:
        return strides_for(spans)
    guessed = there.strides.copy()
    guessed[~there.has] = _each_before(strides[~there.has])
    return guessed


def _each_before(values: Integers) -> Integers:
    """Return the value before each, 0 before the first."""
    return np.concatenate([[0], values[:-1]])[: len(values)]


def _same_lists(codes: Codes, old: Codes, tolerance: float) -> NDArray[np.bool_]:
    """Return which lists are what they were, their colours and opacities within the tolerance."""
    same = (
        (codes.counts == old.counts)
        & (codes.origins == old.origins)
        & (codes.strides == old.strides)
    )
    lists = np.flatnonzero(same & (codes.counts > 0))
    new, was = View(codes, lists), View(old, lists)
    color, tau = codes.color[new.rows], codes.tau[new.rows]
    old_color, old_tau = old.color[was.rows], old.tau[was.rows]
    if tolerance:
        differ = ~_colors_near(color, old_color, tau, tolerance)
        differ |= ~_opacities_near(tau, old_tau, tolerance)
    else:
        differ = (color != old_color).any(axis=1) | (tau != old_tau)
    for name in ("front", "back"):
        differ |= getattr(codes, name)[new.rows] != getattr(old, name)[was.rows]
    same[lists[np.unique(new.own[differ])]] = False
    return same


def _matches(
    view: View,
    front: Integers,
    back: Integers,
    shift: Integers,
    old: Codes,
    there: There,
    moved_by: Floats | Integers,
) -> tuple[Integers, Integers]:
    """Return supersegments that lie between the same faces as before, and their old rows.

    Both ascend, and none is in two pairs.
    """
    lists = np.flatnonzero(there.has)
    was = View(old, view.lists[lists])
    of = moved_by[lists]
    old_front, old_back = was.samples(old.front, of), was.samples(old.back, of)
    span = 1 << 24
    keys = lists[was.own] * span + old_front + (span >> 2)
    new_keys = view.own * span + (front + shift[view.own]) + (span >> 2)
    # Supersegments thinner than a sample may begin at the same one: the first counts
    alone = np.ones(len(keys), bool)
    alone[1:] = keys[1:] > keys[:-1]
    candidates = np.flatnonzero(alone)
    fresh = np.ones(len(new_keys), bool)
    fresh[1:] = new_keys[1:] > new_keys[:-1]
    fresh &= there.has[view.own]
    rows = np.flatnonzero(fresh)
    if len(candidates) == 0 or len(rows) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    place = np.minimum(np.searchsorted(keys[candidates], new_keys[rows]), len(candidates) - 1)
    found = candidates[place]
    equal = keys[found] == new_keys[rows]
    equal &= old_back[found] == (back + shift[view.own])[rows]
    return rows[equal], was.rows[found[equal]]


def _middles(table: NDArray[np.uint8], tolerance: float) -> NDArray[np.uint8]:
    """Return for each entry one that stands for it and its neighbours of colours as near."""
    middles, wide, first = np.arange(ENTRIES, dtype=np.uint8), table.astype(int), 0
    while first < ENTRIES:
        last = middle = first
        while middle + 1 < ENTRIES and _apart(wide[first], wide[middle + 1]) <= 255 * tolerance:
            middle += 1
        last = middle
        while last + 1 < ENTRIES and _apart(wide[middle], wide[last + 1]) <= 255 * tolerance:
            last += 1
        middles[first : last + 1] = middle
        first = last + 1
    return middles


def _apart(one: NDArray[Any], other: NDArray[Any]) -> float:
    return float(np.abs(one - other).max())


def _colors_near(
    one: NDArray[np.uint8], other: NDArray[np.uint8], tau: Integers, tolerance: float
) -> NDArray[np.bool_]:
    """Return where colours times opacity differ by no more than the tolerance."""
    apart = np.abs(one.astype(np.int64) - other).max(axis=1)
    opacity = -np.expm1(-_LONGEST * tau_values(tau))
    return np.asarray(apart * opacity <= 255 * tolerance)


def _opacities_near(one: Integers, other: Integers, tolerance: float) -> NDArray[np.bool_]:
    """Return where opacities differ by no more than the tolerance, for each length of crossing."""
    near = (one > 0) == (other > 0)
    a, b = tau_values(one), tau_values(other)
    for length in (1, _LONGEST):
        near &= np.abs(np.exp(-length * a) - np.exp(-length * b)) <= tolerance
    return near


def _folded(values: Integers) -> NDArray[Any]:
    """Return 0, -1, 1, -2, 2 … as 0, 1, 2, 3, 4 …, in the shortest type."""
    return smallest(values << 1 ^ values >> 63)
