"""The space-time form: a step's lists, each by itself or by what it was in another step.

Exact whatever is guessed: a guess changes how small the numbers are that are left to be written,
and not what is read. All guesses are computed from what a reader has, in operations that every
machine rounds alike. ``docs/decisions/series.md`` says what follows Fernandes et al. (2014), and
what does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.extensions.series.codes import (
    ENTRIES,
    Codes,
    Floats,
    Integers,
    Samples,
    Tables,
    strides_for,
    tau_values,
)
from pyvista_vdi.io.vdi_file.chunks import smallest
from pyvista_vdi.model.packing import TAU_CODES, Packed8

#: How a list is written: by itself; as it was; placed as it was; with supersegments kept.
OWN, SAME, PLACED, KEPT = range(4)
HOW = 3
#: Added where a list's last face is guessed to be where it was.
_END = 4

#: A supersegment that is kept saves about this many bits, and each of the old and the new list
#: takes one to say whether it is.
_SAVED_BITS = 4

#: More samples than this between two steps' first faces are no move.
_FARTHEST = 1 << 20

#: With a tolerance, what is lost is judged for crossings up to so many times as long as V_O's.
_LONGEST = 4
#: Opacities as low as 1 / 16 of the whole let colours differ by so many times the tolerance.
_COARSER = (16, 8, 4, 2, 1, 0)
#: Codes of optical depth that are rounded to, where the tolerance lets them.
_TAU_UNITS = (1 << 12, 64, 32, 16, 8, 4, 2)

Arrays = dict[str, NDArray[Any]]


@dataclass
class Stepped:
    """A step as a reader has it, from which another may be guessed.

    Parameters
    ----------
    codes : Codes
        Its supersegments, their entries known.
    tables : Tables
        Those that it was written with.
    samples : Samples or None
        Where its faces were taken to be; None where nothing is known of samples.
    window_size : (int, int)
        Lists along each edge.
    """

    codes: Codes
    tables: Tables
    samples: Samples | None
    window_size: tuple[int, int]

    def packed(self) -> tuple[NDArray[np.uint64], Packed8]:
        """Return offsets and the packed form, checked."""
        return self.codes.packed()


def encoded(
    step: Stepped, before: Stepped | None, tolerance: float = 0.0
) -> tuple[Stepped, Arrays]:
    """Return what a reader will have of a step, and the arrays to be written for it.

    Parameters
    ----------
    step : Stepped
        With the tables and samples of ``before``.
    before : Stepped, optional
        Another step of the same window, camera and depth grid.
    tolerance : float
        Colours and opacities may differ by so much, 0 to 1; with 0 the step itself is read.
    """
    codes, n_lists = step.codes, len(step.codes.counts)
    same = np.zeros(n_lists, bool)
    if before is not None:
        same = _same_lists(codes, before.codes, tolerance)
    how = np.where(same, SAME, OWN).astype(np.uint8)
    view = _View(codes, np.flatnonzero(~same & (codes.counts > 0)))
    pitches = _pitches(step, view.lists)
    there = _there(before, view.lists)
    unit = view.strides if pitches is None else pitches
    front, back = view.samples(codes.front, unit), view.samples(codes.back, unit)

    arrays: Arrays = {}
    shift = np.zeros(len(view.lists), np.int64)
    kept = np.zeros(len(view.rows), bool)
    if before is not None:
        old, moved_by = before.codes, unit if pitches is not None else there.strides
        shift[there.has] = _rounded((view.origins - there.origins)[there.has], moved_by[there.has])
        there.has &= np.abs(shift) < _FARTHEST
        shift[~there.has] = 0
        how[view.lists[there.has]] = PLACED
        rows, old_rows = _matches(view, front, back, shift, old, there, moved_by)
        n_kept = np.bincount(view.own[rows], minlength=len(view.lists))
        pays = n_kept * _SAVED_BITS > view.counts + there.counts
        how[view.lists[pays]] = KEPT
        chosen = pays[view.own[rows]]
        rows, old_rows = rows[chosen], old_rows[chosen]
        kept[rows] = True
        old_view = _View(old, view.lists[pays])
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
    guessed = _codes_at(back, unit, view)
    f, b = codes.front[view.rows], codes.back[view.rows]
    end = guessed[view.last]
    was = _rounded(there.ends - view.origins, view.strides)
    as_it_was = there.has & (np.abs(b[view.last] - was) < np.abs(b[view.last] - end))
    how[view.lists[as_it_was]] += _END
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
    arrays["front"] = _folded(f - _guessed_fronts(b, front, gap, unit, view))

    lengths = length + beyond * (view.strides / unit)[view.own]
    media = _Media(codes, view, step.tables)
    if tolerance:
        media.near(tolerance, lengths, before, kept, old_rows)
    guess = np.zeros(len(kept), np.uint8)
    if before is not None:
        guess[kept] = before.codes.entries[old_rows]
    arrays["entry"] = media.entries - guess
    colors, tau = _guessed_media(media.entries, guess, kept, old_rows, lengths, step.tables, before)
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


def decoded(
    arrays: Arrays,
    step: float,
    samples: Samples | None,
    tables: Tables,
    window_size: tuple[int, int],
    before: Stepped | None,
) -> Stepped:
    """Return the step that :func:`encoded` made arrays of.

    Raises
    ------
    InvalidVDIError
        If no step gives such arrays; what is returned is still to be checked.
    """
    n_lists = window_size[0] * window_size[1]
    kinds = {array.dtype.kind for name, array in arrays.items() if name != "extinctions"}
    _require(kinds == {"u"}, "all arrays")
    how_and_end = arrays["how"]
    how = how_and_end & HOW
    _require(len(how) == n_lists and (before is not None or not how.any()), "how lists are written")
    coded = how != SAME
    counts = np.zeros(n_lists, np.int64)
    given = arrays["counts"].astype(np.int64)
    _require(len(given) == np.count_nonzero(coded), "counts")
    by_it = how >= PLACED
    counts[coded] = given
    counts[by_it] = unfolded(counts[by_it])
    if before is not None:
        counts[by_it] += before.codes.counts[by_it]
        counts[~coded] = before.codes.counts[~coded]
        _require((before.codes.counts[by_it] > 0).all(), "lists placed as they were")
    n_coded = len(arrays["entry"])
    _require(counts.min() >= 0 and counts.max() <= 1 << 16, "counts")
    _require(int(counts[coded].sum()) == n_coded, "counts")

    codes = Codes(step, counts, *(np.empty(0, np.int64),) * 5, np.empty((0, 3), np.uint8))
    view = _View.placed(codes, np.flatnonzero(coded & (counts > 0)))
    there = _there(before, view.lists)
    there.has = by_it[view.lists]
    there.restrict()
    unit_step = Stepped(codes, tables, samples, window_size)
    pitches = _pitches(unit_step, view.lists)
    shift = np.zeros(len(view.lists), np.int64)
    pays = how[view.lists] == KEPT
    kept = np.zeros(len(view.own), bool)
    old_rows = np.empty(0, np.int64)
    old_front = old_back = old_rows
    moved_by = there.strides.astype(float) if pitches is None else pitches
    if before is not None:
        shift[there.has] = unfolded(_long(arrays, "shift", np.count_nonzero(there.has)))
        _require(bool((np.abs(shift) < _FARTHEST).all()), "shift")
        old_view = _View(before.codes, view.lists[pays])
        kept[pays[view.own]] = _bits(arrays, "kept", np.count_nonzero(pays[view.own]))
        kept_there = _bits(arrays, "kept_there", len(old_view.rows))
        old_rows = old_view.rows[kept_there]
        _require(
            np.array_equal(
                np.bincount(view.own[kept], minlength=len(pays))[pays],
                np.bincount(old_view.own[kept_there], minlength=len(old_view.lists)),
            ),
            "what is kept",
        )
        of = moved_by[pays]
        moved = shift[pays][old_view.own]
        old_front = (old_view.samples(before.codes.front, of) - moved)[kept_there]
        old_back = (old_view.samples(before.codes.back, of) - moved)[kept_there]

    n_new = np.count_nonzero(~kept)
    gap, length = np.zeros(n_coded, np.int64), np.zeros(n_coded, np.int64)
    gap[~kept], length[~kept] = _long(arrays, "gap", n_new), _long(arrays, "length", n_new)
    length[kept] = old_back - old_front
    back = _running(gap, length, kept, old_back, view)
    front = back - length
    gap = front.copy()
    gap[1:] -= back[:-1]
    gap[view.first] = front[view.first]

    n_occupied = len(view.lists)
    origins = _origins(
        unfolded(_long(arrays, "origin", n_occupied)), there, shift, moved_by, pitches is None
    )
    as_it_was = (how_and_end[view.lists] & _END) > 0
    _require(not (as_it_was & ~there.has).any(), "ends")
    if pitches is None:
        spans = np.zeros(n_occupied)
    else:
        spans = np.where(as_it_was, (there.ends - origins).astype(float), back[view.last] * pitches)
    strides = _strides(unfolded(_long(arrays, "stride", n_occupied)), spans, there, pitches is None)
    _require(n_occupied == 0 or (strides.min() > 0 and strides.max() < 1 << 16), "strides")
    _require(n_occupied == 0 or int(np.abs(origins).max()) < 1 << 31, "origins")
    view.origins, view.strides = origins, strides
    unit = strides.astype(float) if pitches is None else pitches
    guessed = _codes_at(back, unit, view)
    b = guessed + unfolded(_long(arrays, "back", n_coded))
    end = np.where(as_it_was, _rounded(there.ends - origins, strides), guessed[view.last])
    b[view.last] = end + unfolded(_long(arrays, "end", n_occupied))
    f = _guessed_fronts(b, front, gap, unit, view) + unfolded(_long(arrays, "front", n_coded))
    lengths = length + (b - guessed) * (strides / unit)[view.own]

    guess = np.zeros(n_coded, np.uint8)
    if len(old_rows):
        guess[kept] = before.codes.entries[old_rows]  # type: ignore[union-attr]
    entries = _long(arrays, "entry", n_coded).astype(np.uint8) + guess
    color, tau_guess = _guessed_media(entries, guess, kept, old_rows, lengths, tables, before)
    for k, name in enumerate(("red", "green", "blue")):
        color[:, k] += _long(arrays, name, n_coded).astype(np.uint8)
    tau = tau_guess + unfolded(_long(arrays, "optical_depth", n_coded))

    found = _merged(step, before, coded, counts, view, origins, strides)
    fields: dict[str, NDArray[Any]] = {"front": f, "back": b, "tau": tau, "color": color}
    fields["entries"] = entries
    if coded.all():
        for name, values in fields.items():
            setattr(found, name, values)
    else:
        assert before is not None
        new = np.repeat(coded, counts)
        still = _View(before.codes, np.flatnonzero(~coded))
        for name, values in fields.items():
            whole = np.empty((len(new), *values.shape[1:]), values.dtype)
            whole[new] = values
            whole[~new] = getattr(before.codes, name)[still.rows]
            setattr(found, name, whole)
    return Stepped(found, tables, samples, window_size)


def lengths_of(codes: Codes, samples: Samples | None, window_size: tuple[int, int]) -> Floats:
    """Return the supersegments' lengths in samples, or in codes where nothing is known of those."""
    view = _View(codes, np.flatnonzero(codes.counts > 0))
    pitches = None if samples is None else samples.pitches(window_size, codes.step)
    unit = view.strides if pitches is None else pitches[view.lists]
    return (view.samples(codes.back, unit) - view.samples(codes.front, unit)).astype(np.float64)


class _View:
    """Some lists that are not empty, and their supersegments one behind the other."""

    def __init__(self, codes: Codes, lists: Integers) -> None:
        self._take(codes, lists)
        self.origins, self.strides = codes.origins[lists], codes.strides[lists]

    @classmethod
    def placed(cls, codes: Codes, lists: Integers) -> _View:
        """Return the view of lists of which the lengths alone are known."""
        view = cls.__new__(cls)
        view._take(codes, lists)
        return view

    def _take(self, codes: Codes, lists: Integers) -> None:
        self.lists, self.counts = lists, codes.counts[lists]
        self.own = np.repeat(np.arange(len(lists)), self.counts)
        ends = np.cumsum(self.counts)
        #: Where each list begins, and its last, among the lists' supersegments
        self.first, self.last = ends - self.counts, ends - 1
        self.rows = np.arange(len(self.own)) + (codes.starts[:-1][lists] - self.first)[self.own]

    def samples(self, faces: Integers, unit: Floats | Integers) -> Integers:
        """Return the whole samples that faces of all supersegments are nearest to."""
        return _rounded(faces[self.rows] * self.strides[self.own], unit[self.own])


@dataclass
class _There:
    """Where lists were in the other step; zeros where they were empty."""

    has: NDArray[np.bool_]
    origins: Integers
    strides: Integers
    ends: Integers
    counts: Integers

    def restrict(self) -> None:
        """Forget lists that are written by themselves."""
        for values in (self.origins, self.strides, self.ends, self.counts):
            values[~self.has] = 0


def _there(before: Stepped | None, lists: Integers) -> _There:
    if before is None:
        return _There(np.zeros(len(lists), bool), *(np.zeros(len(lists), np.int64) for _ in "osec"))
    old = before.codes
    has = old.counts[lists] > 0
    origins, strides, counts = old.origins[lists], old.strides[lists], old.counts[lists]
    last = np.where(has, old.starts[1:][lists] - 1, 0)
    ends = origins + old.back[last] * strides if len(old.back) else origins
    return _There(has, origins, strides, np.where(has, ends, 0), counts)


def _pitches(step: Stepped, lists: Integers) -> Floats | None:
    if step.samples is None:
        return None
    pitches = step.samples.pitches(step.window_size, step.codes.step)
    return None if pitches is None else pitches[lists]


def _rounded(values: Any, unit: Any) -> Integers:
    with np.errstate(all="ignore"):
        quotients = np.rint(values / unit)
        return np.asarray(np.clip(np.nan_to_num(quotients), -(2.0**40), 2.0**40)).astype(np.int64)


def _codes_at(samples: Integers, unit: Floats | Integers, view: _View) -> Integers:
    """Return the codes of faces at whole samples."""
    return _rounded(samples * unit[view.own], view.strides[view.own])


def _guessed_fronts(
    back: Integers, front: Integers, gap: Integers, unit: Floats | Integers, view: _View
) -> Integers:
    """Return the codes of fronts: of the back before where they are at the same sample."""
    before = np.zeros_like(back)
    before[1:] = back[:-1]
    before[view.first] = 0
    return np.where(gap == 0, before, _codes_at(front, unit, view))


def _moved(there: _There, shift: Integers, unit: Floats | Integers) -> Integers:
    """Return the origins of lists that have moved by whole samples."""
    moved = there.origins.copy()
    moved[there.has] += _rounded((shift * unit)[there.has], 1)
    return moved


def _guessed_origins(
    origins: Integers, there: _There, shift: Integers, unit: Floats | Integers, plain: bool
) -> Integers:
    """Return origins as they were, moved, or that of the list before."""
    guessed = _moved(there, shift, there.strides if plain else unit)
    guessed[~there.has] = _each_before(origins[~there.has])
    return guessed


def _origins(
    left: Integers, there: _There, shift: Integers, unit: Floats | Integers, plain: bool
) -> Integers:
    origins = _moved(there, shift, there.strides if plain else unit) + left
    origins[~there.has] = np.cumsum(left[~there.has])
    return origins


def _guessed_strides(strides: Integers, spans: Floats, there: _There, plain: bool) -> Integers:
    """Return strides that spans of steps imply; without samples, those of before."""
    if not plain:
        return strides_for(spans)
    guessed = there.strides.copy()
    guessed[~there.has] = _each_before(strides[~there.has])
    return guessed


def _strides(left: Integers, spans: Floats, there: _There, plain: bool) -> Integers:
    if not plain:
        with np.errstate(all="ignore"):
            return strides_for(np.clip(spans, 0, 2.0**40)) + left
    strides = there.strides + left
    strides[~there.has] = np.cumsum(left[~there.has])
    return strides


def _each_before(values: Integers) -> Integers:
    """Return the value before each, 0 before the first."""
    return np.concatenate([[0], values[:-1]])[: len(values)]


def _guessed_media(
    entries: NDArray[np.uint8],
    guess: NDArray[np.uint8],
    kept: NDArray[np.bool_],
    old_rows: Integers,
    lengths: Floats,
    tables: Tables,
    before: Stepped | None,
) -> tuple[NDArray[np.uint8], Integers]:
    """Return colours and optical depths: as they were where the entry is, else the tables'."""
    colors, tau = tables.colors[entries], tables.tau(entries, lengths)
    if len(old_rows):
        assert before is not None
        stay = entries[kept] == guess[kept]
        rows = np.flatnonzero(kept)[stay]
        colors[rows] = before.codes.color[old_rows[stay]]
        tau[rows] = before.codes.tau[old_rows[stay]]
    return colors, tau


def _running(
    gap: Integers,
    length: Integers,
    kept: NDArray[np.bool_],
    old_back: Integers,
    view: _View,
) -> Integers:
    """Return backs in samples: gaps and lengths added up from the last one that is known."""
    n = len(gap)
    if n == 0:
        return np.empty(0, np.int64)
    total = np.cumsum(np.where(kept, 0, gap + length))
    known = np.zeros(n, np.int64)
    known[kept] = old_back
    # The row that sums begin behind: a list's own beginning, or a supersegment that is kept
    begins = np.zeros(n, np.int64)
    begins[view.first] = view.first
    begins[kept] = np.flatnonzero(kept)
    begins = np.maximum.accumulate(begins)
    at_kept = kept[begins]
    base = np.where(at_kept, total[begins], total[begins] - (gap + length)[begins])
    return total - base + np.where(at_kept, known[begins], 0)


def _same_lists(codes: Codes, old: Codes, tolerance: float) -> NDArray[np.bool_]:
    """Return which lists are what they were, their colours and opacities within the tolerance."""
    same = (
        (codes.counts == old.counts)
        & (codes.origins == old.origins)
        & (codes.strides == old.strides)
    )
    lists = np.flatnonzero(same & (codes.counts > 0))
    new, was = _View(codes, lists), _View(old, lists)
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
    view: _View,
    front: Integers,
    back: Integers,
    shift: Integers,
    old: Codes,
    there: _There,
    moved_by: Floats | Integers,
) -> tuple[Integers, Integers]:
    """Return supersegments that lie between the same faces as before, and their old rows.

    Both ascend, and none is in two pairs.
    """
    lists = np.flatnonzero(there.has)
    was = _View(old, view.lists[lists])
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


class _Media:
    """Colours and optical depths of the supersegments in some lists, and their entries."""

    def __init__(self, codes: Codes, view: _View, tables: Tables) -> None:
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
        self, codes: Codes, view: _View, same: NDArray[np.bool_], old: Codes | None
    ) -> Codes:
        """Return the codes that a reader will have."""
        read = replace(codes)
        read.color, read.tau = codes.color.copy(), codes.tau.copy()
        read.entries = np.empty(len(codes.tau), np.uint8)
        if old is not None:
            lists = np.flatnonzero(same)
            rows, was = _View(codes, lists).rows, _View(old, lists).rows
            read.color[rows], read.tau[rows] = old.color[was], old.tau[was]
            read.entries[rows] = old.entries[was]
        read.color[view.rows], read.tau[view.rows] = self.color, self.tau
        read.entries[view.rows] = self.entries
        return read


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


def unfolded(values: NDArray[Any]) -> NDArray[Any]:
    """Return 0, -1, 1, -2, 2 … of 0, 1, 2, 3, 4 …; of a signed type."""
    return values >> 1 ^ -(values & 1)


def _long(arrays: Arrays, name: str, n: Any) -> Integers:
    values = arrays[name]
    _require(len(values) == n, name)
    return values.astype(np.int64)


def _bits(arrays: Arrays, name: str, n: Any) -> NDArray[np.bool_]:
    packed = arrays[name]
    _require(packed.dtype == np.uint8 and len(packed) == -(-int(n) // 8), name)
    return np.unpackbits(packed, count=int(n)).astype(bool)


def _merged(
    step: float,
    before: Stepped | None,
    coded: NDArray[np.bool_],
    counts: Integers,
    view: _View,
    origins: Integers,
    strides: Integers,
) -> Codes:
    """Return codes with the lists' own numbers, supersegments still to come."""
    every_origin, every_stride = (np.zeros(len(counts), np.int64) for _ in range(2))
    for values, new, name in (
        (every_origin, origins, "origins"),
        (every_stride, strides, "strides"),
    ):
        if before is not None:
            values[~coded] = getattr(before.codes, name)[~coded]
        values[view.lists] = new
    nothing = np.empty(0, np.int64)
    colors = np.empty((0, 3), np.uint8)
    return Codes(step, counts, every_origin, every_stride, nothing, nothing, nothing, colors)


def _require(good: Any, what: str) -> None:
    if not good:
        raise InvalidVDIError(f"the numbers of {what} contradict each other")
