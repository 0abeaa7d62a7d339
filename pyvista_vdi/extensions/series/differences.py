"""Reads the space-time form: a step's lists, each by itself or by what it was in another step.

Exact whatever is guessed: a guess changes how small the numbers are that are left to be written,
and not what is read. All guesses are computed from what a reader has, in operations that every
machine rounds alike. ``docs/decisions/series.md`` says what follows Fernandes et al. (2014), and
what does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.extensions.series.codes import (
    Codes,
    Floats,
    Integers,
    Samples,
    Tables,
    strides_for,
)
from pyvista_vdi.model.packing import Packed8

#: How a list is written: by itself; as it was; placed as it was; with supersegments kept.
OWN, SAME, PLACED, KEPT = range(4)
HOW = 3
#: Added where a list's last face is guessed to be where it was.
END = 4


#: More samples than this between two steps' first faces are no move.
FARTHEST = 1 << 20


Arrays = dict[str, NDArray[Any]]


@dataclass
class Stepped:
    """A step as a reader has it, from which another may be guessed."""

    codes: Codes  # its supersegments, their entries known
    tables: Tables  # those that it was written with
    #: Where its faces were taken to be; None where nothing is known of samples
    samples: Samples | None
    window_size: tuple[int, int]  # lists along each edge

    def packed(self) -> tuple[NDArray[np.uint64], Packed8]:
        """Return offsets and the packed form, checked."""
        return self.codes.packed()


@dataclass
class Lists:
    """How the lists of a frame are written, and their lengths: what both decoders begin with."""

    way: NDArray[Any]
    coded: NDArray[np.bool_]  # lists that are not as they were
    placed: NDArray[np.bool_]  # lists that are written by what they were
    counts: Integers
    occupied: Integers  # the lists that are written and not empty
    shift: Integers  # of these, the samples by which they have moved
    kept: NDArray[np.bool_]  # of the supersegments in lists that are KEPT
    kept_there: NDArray[np.bool_]  # of those that these had

    @classmethod
    def of(cls, arrays: Arrays, window_size: tuple[int, int], before: Integers | None) -> Lists:
        """Return them from a frame's arrays, and from the lengths of the lists before."""
        kinds = {array.dtype.kind for name, array in arrays.items() if name != "extinctions"}
        _require(kinds == {"u"}, "all arrays")
        way = arrays["how"] & HOW
        right = len(way) == window_size[0] * window_size[1]
        _require(right and (before is not None or not way.any()), "how lists are written")
        coded, placed = way != SAME, way >= PLACED
        counts = np.zeros(len(way), np.int64)
        counts[coded] = _long(arrays, "counts", np.count_nonzero(coded))
        counts[placed] = unfolded(counts[placed])
        if before is not None:
            counts[placed] += before[placed]
            counts[~coded] = before[~coded]
            _require((before[placed] > 0).all(), "lists placed as they were")
        _require(counts.min() >= 0 and counts.max() <= 1 << 16, "counts")
        _require(int(counts[coded].sum()) == len(arrays["entry"]), "counts")
        occupied = np.flatnonzero(coded & (counts > 0))
        shift, bits = np.zeros(len(occupied), np.int64), np.zeros(0, bool)
        lists = cls(way, coded, placed, counts, occupied, shift, bits, bits)
        if before is not None:
            moving, keeps = placed[occupied], occupied[way[occupied] == KEPT]
            shift[moving] = unfolded(_long(arrays, "shift", np.count_nonzero(moving)))
            _require((np.abs(shift) < FARTHEST).all(), "shift")
            lists.kept = _bits(arrays, "kept", counts[keeps].sum())
            lists.kept_there = _bits(arrays, "kept_there", before[keeps].sum())
        return lists


def decoded(
    arrays: Arrays,
    step: float,
    samples: Samples | None,
    tables: Tables,
    window_size: tuple[int, int],
    before: Stepped | None,
) -> Stepped:
    """Return the step that the encoder made arrays of; its codes are still to be checked."""
    lists = Lists.of(arrays, window_size, None if before is None else before.codes.counts)
    coded, counts, shift, n_coded = lists.coded, lists.counts, lists.shift, len(arrays["entry"])
    codes = Codes(step, counts, *(np.empty(0, np.int64),) * 5, np.empty((0, 3), np.uint8))
    view = View.placed(codes, lists.occupied)
    there = there_of(before, view.lists)
    there.has = lists.placed[view.lists]
    there.restrict()
    unit_step = Stepped(codes, tables, samples, window_size)
    pitches = pitches_of(unit_step, view.lists)
    pays = lists.way[view.lists] == KEPT
    kept = np.zeros(len(view.own), bool)
    old_rows = np.empty(0, np.int64)
    old_front = old_back = old_rows
    moved_by = there.strides.astype(float) if pitches is None else pitches
    if before is not None:
        old_view = View(before.codes, view.lists[pays])
        kept[pays[view.own]] = lists.kept
        kept_there = lists.kept_there
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
    as_it_was = (arrays["how"][view.lists] & END) > 0
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
    guessed = codes_at(back, unit, view)
    b = guessed + unfolded(_long(arrays, "back", n_coded))
    end = np.where(as_it_was, rounded(there.ends - origins, strides), guessed[view.last])
    b[view.last] = end + unfolded(_long(arrays, "end", n_occupied))
    f = guessed_fronts(b, front, gap, unit, view) + unfolded(_long(arrays, "front", n_coded))
    lengths = length + (b - guessed) * (strides / unit)[view.own]

    guess = np.zeros(n_coded, np.uint8)
    if len(old_rows):
        guess[kept] = before.codes.entries[old_rows]  # type: ignore[union-attr]
    entries = _long(arrays, "entry", n_coded).astype(np.uint8) + guess
    color, tau_guess = guessed_media(entries, guess, kept, old_rows, lengths, tables, before)
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
        still = View(before.codes, np.flatnonzero(~coded))
        for name, values in fields.items():
            whole = np.empty((len(new), *values.shape[1:]), values.dtype)
            whole[new] = values
            whole[~new] = getattr(before.codes, name)[still.rows]
            setattr(found, name, whole)
    return Stepped(found, tables, samples, window_size)


def lengths_of(codes: Codes, samples: Samples | None, window_size: tuple[int, int]) -> Floats:
    """Return the supersegments' lengths in samples, or in codes where nothing is known of those."""
    view = View(codes, np.flatnonzero(codes.counts > 0))
    pitches = None if samples is None else samples.pitches(window_size, codes.step)
    unit = view.strides if pitches is None else pitches[view.lists]
    return (view.samples(codes.back, unit) - view.samples(codes.front, unit)).astype(np.float64)


class View:
    """Some lists that are not empty, and their supersegments one behind the other."""

    def __init__(self, codes: Codes, lists: Integers) -> None:
        self._take(codes, lists)
        self.origins, self.strides = codes.origins[lists], codes.strides[lists]

    @classmethod
    def placed(cls, codes: Codes, lists: Integers) -> View:
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
        return rounded(faces[self.rows] * self.strides[self.own], unit[self.own])


@dataclass
class There:
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


def there_of(before: Stepped | None, lists: Integers) -> There:
    """Return where lists were in another step."""
    if before is None:
        return There(np.zeros(len(lists), bool), *(np.zeros(len(lists), np.int64) for _ in "osec"))
    old = before.codes
    has = old.counts[lists] > 0
    origins, strides, counts = old.origins[lists], old.strides[lists], old.counts[lists]
    last = np.where(has, old.starts[1:][lists] - 1, 0)
    ends = origins + old.back[last] * strides if len(old.back) else origins
    return There(has, origins, strides, np.where(has, ends, 0), counts)


def pitches_of(step: Stepped, lists: Integers) -> Floats | None:
    """Return how far samples of lists are apart, in codes; ``None`` where that is not known."""
    if step.samples is None:
        return None
    pitches = step.samples.pitches(step.window_size, step.codes.step)
    return None if pitches is None else pitches[lists]


def rounded(values: Any, unit: Any) -> Integers:
    """Return the whole numbers of units that are nearest to values, within 40 bits."""
    with np.errstate(all="ignore"):
        quotients = np.rint(values / unit)
        return np.asarray(np.clip(np.nan_to_num(quotients), -(2.0**40), 2.0**40)).astype(np.int64)


def codes_at(samples: Integers, unit: Floats | Integers, view: View) -> Integers:
    """Return the codes of faces at whole samples."""
    return rounded(samples * unit[view.own], view.strides[view.own])


def guessed_fronts(
    back: Integers, front: Integers, gap: Integers, unit: Floats | Integers, view: View
) -> Integers:
    """Return the codes of fronts: of the back before where they are at the same sample."""
    before = np.zeros_like(back)
    before[1:] = back[:-1]
    before[view.first] = 0
    return np.where(gap == 0, before, codes_at(front, unit, view))


def moved(there: There, shift: Integers, unit: Floats | Integers) -> Integers:
    """Return the origins of lists that have moved by whole samples."""
    moved = there.origins.copy()
    moved[there.has] += rounded((shift * unit)[there.has], 1)
    return moved


def _origins(
    left: Integers, there: There, shift: Integers, unit: Floats | Integers, plain: bool
) -> Integers:
    origins = moved(there, shift, there.strides if plain else unit) + left
    origins[~there.has] = np.cumsum(left[~there.has])
    return origins


def _strides(left: Integers, spans: Floats, there: There, plain: bool) -> Integers:
    if not plain:
        with np.errstate(all="ignore"):
            return strides_for(np.clip(spans, 0, 2.0**40)) + left
    strides = there.strides + left
    strides[~there.has] = np.cumsum(left[~there.has])
    return strides


def guessed_media(
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
    gap: Integers, length: Integers, kept: NDArray[np.bool_], old_back: Integers, view: View
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
    view: View,
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
