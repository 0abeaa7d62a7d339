"""Steps of a series decoded by a kernel: what :func:`differences.decoded` does, and faster."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pyvista_vdi.device import (
    DeviceBuffer,
    Runtime,
    aligned_empty,
    get_runtime,
    kept_together,
    padded,
)
from pyvista_vdi.errors import DeviceError, InvalidVDIError, MissingDependencyError, NoDeviceError
from pyvista_vdi.extensions.series.codes import Codes, Integers, Samples, Tables
from pyvista_vdi.extensions.series.differences import KEPT, Arrays, Lists, Stepped, unfolded
from pyvista_vdi.extensions.series.kernels import DECODE_LISTS
from pyvista_vdi.model.packing import GRID, TAU_BASE, TAU_CODES, Packed8, check_grid

#: The arrays that are read by supersegment or by list, in the kernel's order.
_STREAMS = (
    *("gap", "length", "back", "front", "end"),
    *("entry", "red", "green", "blue", "optical_depth"),
)
#: What is stored of numbers below this is summed in 32 bits without overflow.
_TAME = 1 << 26
#: Numbers of a list's places, see ``series/decode.cl``.
_PLACES = 5
#: Work-items of a group.
_GROUP = 64


class PackedStep(Stepped):
    """A step in its 8-byte form; whole numbers are made of it when they are needed."""

    def __init__(
        self,
        offsets: NDArray[np.int32],
        packing: Packed8,
        entries: NDArray[np.uint8],
        tables: Tables,
        samples: Samples | None,
        window_size: tuple[int, int],
    ) -> None:
        self.offsets, self.packing, self.entries = offsets, packing, entries
        self.tables, self.samples, self.window_size = tables, samples, window_size

    @cached_property
    def codes(self) -> Codes:  # type: ignore[override]
        """The supersegments as whole numbers."""
        return Codes.of_packed(np.diff(self.offsets), self.packing, self.entries)

    def packed(self) -> tuple[NDArray[np.uint64], Packed8]:
        """Return offsets and the packed form."""
        return self.offsets.astype(np.uint64), self.packing

    @classmethod
    def of(cls, step: Stepped) -> PackedStep:
        """Return a step in this form."""
        if isinstance(step, cls):
            return step
        offsets, packing = step.packed()
        words = aligned_empty(packing.words.shape, np.uint32)
        words[...] = packing.words
        packing = Packed8(packing.step, packing.origins, packing.strides, words)
        return cls(
            offsets.astype(np.int32),
            packing,
            step.codes.entries,
            step.tables,
            step.samples,
            step.window_size,
        )


def runtime_for_decoding() -> Runtime | None:
    """Return the default device if it can decode; None where there is none that can."""
    try:
        runtime = get_runtime()
    except (NoDeviceError, MissingDependencyError, DeviceError):
        return None
    return runtime if runtime.info.has_fp64 else None


def decoded_on(
    runtime: Runtime,
    arrays: Arrays,
    step: float,
    samples: Samples | None,
    tables: Tables,
    window_size: tuple[int, int],
    before: Stepped | None,
) -> PackedStep | None:
    """Return a step, or None where its numbers are not as those that are written.

    The parameters are those of :func:`differences.decoded`, which says what is wrong with them.
    """
    how = arrays["how"]
    if how.dtype != np.uint8:
        return None
    for name in _STREAMS:
        if arrays[name].dtype.kind != "u" or arrays[name].itemsize > 4:
            return None
        if arrays[name].itemsize == 4 and arrays[name].max(initial=0) >= _TAME:
            return None
    try:
        old = None if before is None else PackedStep.of(before)
    except InvalidVDIError:  # it was not looked at, and may still do
        return None
    old_counts = None if old is None else np.diff(old.offsets).astype(np.int64)
    lists = Lists.of(arrays, window_size, old_counts)
    pitches = None if samples is None else samples.pitches(window_size, step)
    left = _left(arrays, lists, plain=pitches is None)
    places = _places(arrays, lists, old_counts)
    if left is None or places is None:
        return None
    n_lists, starts = len(how), _sums(lists.counts)
    n = int(starts[-1])
    check_grid(step, *(np.empty(0, np.int64),) * 3)  # of the step alone: the kernel looks at lists
    base, streams = _together(arrays)
    defines = {"GRID": GRID, "TAU_BASE": TAU_BASE, "TAU_CODES": TAU_CODES}
    if pitches is None:
        defines["PLAIN"] = 1
    was: dict[str, NDArray[Any]] = {}
    if old is not None:
        packing = old.packing
        was = {"starts": old.offsets, "origins": packing.origins, "strides": packing.strides}
        was |= {"words": packing.words, "entries": old.entries}
    with kept_together() as keep:

        def up(array: NDArray[Any] | None, dtype: DTypeLike, name: str) -> DeviceBuffer:
            """Bring an array to the device, or something in the place of none."""
            if array is None or not array.size:
                array = np.zeros(2, dtype)
            return keep(runtime.upload(array, name))

        origins = keep(runtime.result((n_lists,), np.int32, "origins of lists"))
        strides = keep(runtime.result((n_lists,), np.uint16, "strides of lists"))
        words = keep(runtime.result((max(n, 1), 2), np.uint32, "supersegments", lasting=True))
        entries = keep(runtime.result((max(n, 1),), np.uint8, "entries"))
        trouble = keep(runtime.buffer((1,), np.int32, "trouble"))
        runtime.fill(trouble, np.int32(0))
        decode = runtime.bind(
            DECODE_LISTS,
            defines,
            n_lists=n_lists,
            how=up(how, "u1", "how lists are written"),
            starts=up(starts, "i4", "list offsets"),
            places=up(places, "i4", "places"),
            pitches=up(pitches, "f8", "pitches"),
            data=up(base, "u1", "arrays of a step"),
            streams=up(streams, "u4", "places of arrays"),
            kept=up(arrays.get("kept"), "u1", "kept supersegments"),
            kept_there=up(arrays.get("kept_there"), "u1", "supersegments that were kept"),
            old_starts=up(was.get("starts"), "i4", "list offsets before"),
            old_origins=up(was.get("origins"), "i4", "origins before"),
            old_strides=up(was.get("strides"), "u2", "strides before"),
            old_words=up(was.get("words"), "u4", "supersegments before"),
            old_entries=up(was.get("entries"), "u1", "entries before"),
            colors=up(tables.colors, "u1", "colours of entries"),
            extinctions=up(tables.extinctions, "f4", "extinctions of entries"),
            origins=origins,
            strides=strides,
            words=words,
            entries=entries,
            trouble=trouble,
        )
        for name, values in zip(("origins_left", "strides_left", "shifts"), left, strict=True):
            decode.set(**{name: up(values, "i4", "what is left of lists")})
        decode(padded(n_lists, _GROUP), _GROUP)
        if runtime.download(trouble)[0]:
            return None
        packing = Packed8(
            step, runtime.download(origins), runtime.download(strides), runtime.download(words)[:n]
        )
        return PackedStep(
            starts, packing, runtime.download(entries)[:n], tables, samples, window_size
        )


def _places(arrays: Arrays, lists: Lists, old: Integers | None) -> NDArray[np.int32] | None:
    """Return where lists begin in a frame's arrays; None where these are not as many."""
    counts, coded = lists.counts, lists.coded
    if counts.sum() >= 1 << 28:  # offsets are of 32 bits
        return None
    rows, occupied = _sums(np.where(coded, counts, 0)), _sums(coded & (counts > 0))
    n_rows = n_new = int(rows[-1])
    if any(len(arrays[name]) != n_rows for name in _STREAMS[2:4] + _STREAMS[5:]):
        return None
    if len(arrays["end"]) != occupied[-1]:
        return None
    table = aligned_empty((len(counts), _PLACES), np.int32)
    table[:, 0], table[:, 1], table[:, 2], table[:, 3:] = rows[:-1], rows[:-1], occupied[:-1], 0
    if old is not None:
        keeps = (lists.way == KEPT) & (counts > 0)
        bits, there = _sums(np.where(keeps, counts, 0)), _sums(np.where(keeps, old, 0))
        before_it = _sums(lists.kept)
        table[:, 1] -= before_it[bits[:-1]]
        table[:, 3], table[:, 4] = bits[:-1], there[:-1]
        n_new -= int(before_it[-1])
    return table if len(arrays["gap"]) == len(arrays["length"]) == n_new else None


def _left(arrays: Arrays, lists: Lists, *, plain: bool) -> list[NDArray[np.int32]] | None:
    """Return what is left of the origins and strides of lists, or all of them; and shifts."""
    alone, n = ~lists.placed[lists.occupied], len(lists.occupied)
    origins, strides = (arrays[name].astype(np.int64) for name in ("origin", "stride"))
    if not len(origins) == len(strides) == n:
        return None
    origins, strides = unfolded(origins), unfolded(strides)
    origins[alone] = np.cumsum(origins[alone])
    if plain:
        strides[alone] = np.cumsum(strides[alone])
    if max(np.abs(origins).max(initial=0), np.abs(strides).max(initial=0)) >= 1 << 28:
        return None
    left = [aligned_empty(n, np.int32) for _ in range(3)]
    for values, given in zip(left, (origins, strides, lists.shift), strict=True):
        values[...] = given
    return left


def _together(arrays: Arrays) -> tuple[NDArray[np.uint8], NDArray[np.uint32]]:
    """Return bytes that hold all streams, and for each where it is in them, and its element's."""
    memory = getattr(arrays, "memory", None)
    if memory is None:
        sizes = [-(-arrays[name].nbytes // 8) * 8 for name in _STREAMS]
        begins = np.cumsum([0, *sizes])
        memory = aligned_empty(int(begins[-1]), np.uint8)
        for name, begin in zip(_STREAMS, begins[:-1], strict=True):
            memory[begin : begin + arrays[name].nbytes] = arrays[name].view(np.uint8)
    else:
        begins = np.array([arrays[name].ctypes.data for name in _STREAMS]) - memory.ctypes.data
    streams = [(begins[k], arrays[name].itemsize) for k, name in enumerate(_STREAMS)]
    return memory, np.array(streams, np.uint32)


def _sums(values: NDArray[Any]) -> NDArray[np.int32]:
    """Return the sums of the values before each, and of all."""
    sums = aligned_empty(len(values) + 1, np.int32)
    sums[0] = 0
    np.cumsum(values, out=sums[1:], dtype=np.int32)
    return sums
