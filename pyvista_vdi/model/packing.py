"""Packed supersegments: 8 bytes each in place of 24, in integers alone.

``docs/conventions.md`` ("Packed supersegments") has the bits and what they lose.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.host_memory import aligned_empty

#: What a supersegment takes: 24 bytes as it was made, or less.
Precision: TypeAlias = Literal["exact", "8-byte"]
PRECISIONS: tuple[Precision, ...] = get_args(Precision)

#: Largest code of a depth in a list, 14 bits: those of ``opencl/raycasting/supersegments.cl``, as
#: are the colours' steps and the optical depths' base.
DEPTH_CODES = (1 << 14) - 1

#: Whole steps of a VDI's depth grid that a depth is away from its origin at most. float32 holds
#: every whole number to 2^24, and codes may be pushed by as many steps as there are codes.
GRID = (1 << 24) - (1 << 15)

#: No step is shorter: devices may take what is nearer to 0 than float32's normal numbers for 0.
_LEAST_STEP_EXPONENT = -126

#: Supersegments that are packed or unpacked at a time: what this takes is small beside a VDI.
_PIECE = 2**16

#: Codes of optical depth: 0 is 0; from 1 on the upper half of a float32's bits, from 2^-18.
TAU_CODES = (1 << 12) - 1
TAU_BASE = (127 - 18) << 7
_LEAST_TAU = np.float32(2.0**-19)

#: Steps of red, green and blue, and where the bits of each begin.
_COLOR_STEPS, _COLOR_BITS = 255, (8, 16, 24)


class Lists(Protocol):
    """The parts of a :class:`~pyvista_vdi.model.vdi.VDI` that packing reads."""

    camera: Camera
    depth_origin: float
    front: NDArray[np.float32]
    back: NDArray[np.float32]
    color: NDArray[np.float32]
    optical_depth: NDArray[np.float32]

    @property
    def counts(self) -> NDArray[np.int64]:
        """Supersegments per list, int64 (H, W)."""

    @property
    def n_supersegments(self) -> int:
        """Number of supersegments in all lists."""


@dataclass(frozen=True)
class Packed8:
    """The 8-byte form: codes of depth on a grid of the list's own, all else in 36 bits.

    A depth is ``step * (origins[i] + code * strides[i])`` in list i, in whole numbers below 2^24
    that float32 holds, times a power of two: exact on every device.

    ``step``: step of the VDI's depth grid, world units; a power of two. ``origins``: int32 (W *
    H,): where each list's codes begin, steps; 0 for an empty list. ``strides``: uint16 (W * H,):
    steps per code; 0 for an empty list. ``words``: uint32 (n, 2): front in bits 0 to 13, back in 14
    to 27, optical depth in 28 to 39, red, green and blue from 40, 48 and 56 on.
    """

    step: float
    origins: NDArray[np.int32]
    strides: NDArray[np.uint16]
    words: NDArray[np.uint32]
    precision = "8-byte"

    @property
    def nbytes(self) -> int:
        """Bytes beside the VDI's own arrays."""
        return self.origins.nbytes + self.strides.nbytes + self.words.nbytes

    def depth_codes(
        self, first: int = 0, last: int | None = None
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Return the codes of fronts and backs, uint32."""
        low, mask = self.words[first:last, 0], np.uint32(DEPTH_CODES)
        return np.bitwise_and(low, mask), np.bitwise_and(low >> np.uint32(14), mask)

    def tau_codes(self, first: int = 0, last: int | None = None) -> NDArray[np.uint32]:
        """Return the codes of optical depths, uint32."""
        low, high = self.words[first:last].T
        return np.bitwise_or(low >> np.uint32(28), (high & np.uint32(0xFF)) << np.uint32(4))

    def colors(self, first: int = 0, last: int | None = None) -> NDArray[np.uint8]:
        """Return red, green and blue, uint8 (n, 3)."""
        words = np.ascontiguousarray(self.words[first:last, 1], "<u4")
        return np.ascontiguousarray(words.view(np.uint8).reshape(-1, 4)[:, 1:])

    def media(self, counts: NDArray[np.int64]) -> dict[str, NDArray[np.float32]]:
        """Return front, back, color and optical_depth; ``counts`` are the lists' lengths."""
        n = len(self.words)
        media = {name: aligned_empty(n, np.float32) for name in ("front", "back", "optical_depth")}
        media["color"] = aligned_empty((n, 3), np.float32)
        for lists, part in _pieces(counts):
            own = np.repeat(np.arange(lists.start, lists.stop), counts[lists])
            for name, values in self.media_at(part, own, *media).items():
                media[name][part] = values
        return media

    def media_at(
        self, rows: slice | NDArray[np.int64], lists: NDArray[np.int64], *names: str
    ) -> dict[str, NDArray[np.float32]]:
        """Return the named ones of some supersegments, in these lists."""
        low, high = self.words[rows, 0], self.words[rows, 1]
        media = {}
        if "color" in names:
            media["color"] = unpacked_color(high)
        for name, first_bit in (("front", 0), ("back", 14)):
            if name in names:
                codes = (low >> np.uint32(first_bit) & np.uint32(DEPTH_CODES)).view(np.int32)
                whole = self.origins[lists] + codes * self.strides[lists].astype(np.int32)
                media[name] = whole.astype(np.float32) * np.float32(self.step)
        if "optical_depth" in names:
            tau = low >> np.uint32(28) | (high & np.uint32(0xFF)) << np.uint32(4)
            bits = np.where(tau > 0, tau + np.uint32(TAU_BASE - 1) << np.uint32(16), 0)
            media["optical_depth"] = bits.astype(np.uint32).view(np.float32)
        return media


def check_precision(precision: object) -> str:
    """Return one of :data:`PRECISIONS`, or raise InvalidArgumentError."""
    return one_of(precision, "precision", PRECISIONS)


def packing_of(vdi: Lists) -> Packed8:
    """Return a VDI's supersegments in 8 bytes each.

    Raises InvalidArgumentError if a list is too long for that.
    """
    counts = vdi.counts.reshape(-1)
    if counts.max() > DEPTH_CODES:
        raise InvalidArgumentError(
            f"a list of {counts.max()} supersegments cannot be packed into 8 bytes each: at most "
            f"{DEPTH_CODES} have depths of their own; use the precision 'exact'"
        )
    origins, strides = np.zeros(len(counts), np.int32), np.zeros(len(counts), np.uint16)
    words = np.empty((vdi.n_supersegments, 2), np.uint32)
    # Find the shortest power of two of which at most GRID reach every depth
    step = 1.0
    if vdi.n_supersegments:
        farthest = max(-float(vdi.front.min()), float(vdi.back.max()))
        exponent = math.frexp(farthest / GRID)[1]  # farthest / GRID < 2^exponent
        if farthest / 2.0 ** (exponent - 1) <= GRID:
            exponent -= 1
        step = 2.0 ** max(exponent, _LEAST_STEP_EXPONENT)
    for lists, part in _pieces(counts):
        origins[lists], strides[lists], front, back = _depths(vdi, step, counts[lists], part)
        tau, color = _tau_codes(vdi.optical_depth[part]), packed_color(vdi.color[part])
        words[part] = _words(front, back, tau, color)
    return Packed8(step, origins, strides, words)


def _pieces(counts: NDArray[np.int64]) -> Iterator[tuple[slice, slice]]:
    """Lists one after the other and their supersegments, in pieces of about :data:`_PIECE`."""
    ends = np.cumsum(counts)
    first_list = first = 0
    while first_list < len(counts):
        last_list = max(int(np.searchsorted(ends, first + _PIECE, side="right")), first_list + 1)
        last = int(ends[last_list - 1])
        yield slice(first_list, last_list), slice(first, last)
        first_list, first = last_list, last


def _words(
    front: NDArray[np.uint32],
    back: NDArray[np.uint32],
    tau: NDArray[np.uint32],
    color: NDArray[np.uint32],
) -> NDArray[np.uint32]:
    """Return the two words of each supersegment, colours in bits 8 to 31: see :class:`Packed8`."""
    words = np.empty((len(front), 2), np.uint32)
    words[:, 0] = front | back << np.uint32(14) | tau << np.uint32(28)
    words[:, 1] = tau >> np.uint32(4) | color
    return words


def packed_color(color: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return straight RGB, float32 (n, 3), in whole steps; uint32 (n,)."""
    packed = aligned_empty(len(color), np.uint32)
    packed[...] = 0
    for channel, first_bit in enumerate(_COLOR_BITS):
        code = np.rint(color[:, channel] * np.float32(_COLOR_STEPS)).astype(np.uint32)
        packed |= code << np.uint32(first_bit)
    return packed


def unpacked_color(packed: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Return straight RGB, float32 (n, 3); one multiplication, which every device rounds alike."""
    color = aligned_empty((len(packed), 3), np.float32)
    for channel, first_bit in enumerate(_COLOR_BITS):
        code = packed >> np.uint32(first_bit) & np.uint32(_COLOR_STEPS)
        color[:, channel] = code.astype(np.float32) * (np.float32(1) / np.float32(_COLOR_STEPS))
    return color


def _tau_codes(tau: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Round optical depths to eight significant bits, ties to even, between 2^-18 and 16256."""
    bits = tau.view(np.uint32).astype(np.int64)
    upper = (bits + 0x7FFF + (bits >> 16 & 1)) >> 16
    codes = np.clip(upper - TAU_BASE + 1, 1, TAU_CODES)
    return np.where(tau < _LEAST_TAU, 0, codes).astype(np.uint32)


def _depths(
    vdi: Lists, step: float, counts: NDArray[np.int64], part: slice
) -> tuple[NDArray[np.int32], NDArray[np.uint16], NDArray[np.uint32], NDArray[np.uint32]]:
    """Return some lists' origins, strides and codes of fronts and backs.

    ``counts`` are their lengths, and ``part`` their supersegments.
    """
    origins, strides = np.zeros(len(counts), np.int32), np.zeros(len(counts), np.uint16)
    occupied = np.flatnonzero(counts)
    lengths = counts[occupied]
    first = np.cumsum(lengths) - lengths
    # Whole steps, exactly: a division by a power of two
    faces = np.stack([vdi.front[part], vdi.back[part]], axis=1).astype(np.float64) / step
    if not vdi.camera.parallel_projection:
        # What is in front of the eye stays there
        np.maximum(faces, np.ceil(max(-vdi.depth_origin / step, -(2.0**30))), out=faces)
    origin = np.rint(faces[first, 0])
    span = np.rint(faces[first + lengths - 1, 1]) - origin
    stride = np.maximum(1, np.ceil(span / DEPTH_CODES))
    origins[occupied], strides[occupied] = origin, stride
    own = np.repeat(np.arange(len(occupied)), lengths)
    codes = np.rint((faces - origin[own, np.newaxis]) / stride[own, np.newaxis]).astype(np.int64)
    # Keep every back at least 1 behind its front. Rounding keeps faces in order; what it made equal
    # is moved behind, and where no codes are left behind, before. Less the thicknesses that must
    # lie before it, a face may equal the one before it
    within = np.arange(len(codes)) - first[own]
    needed = np.stack([within, within + 1], axis=1)
    slack = np.maximum(codes, 0) - needed
    apart = own[:, np.newaxis] << 20  # no list's maximum reaches the next list
    running = np.maximum.accumulate((slack + apart).reshape(-1)).reshape(-1, 2) - apart
    most = DEPTH_CODES - lengths[own]
    codes = np.minimum(running, most[:, np.newaxis]) + needed
    front, back = codes.astype(np.uint32).T
    return origins, strides, front, back


def gaps_and_thicknesses(
    packed: Packed8, offsets: NDArray[np.uint64], first: int, last: int
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Return how far each front is behind the back before it, and each back behind its front.

    In codes, of the supersegments ``first:last``. The first gap of a list is 0, as its code is;
    that of ``first`` is its front's code.
    """
    front, back = packed.depth_codes(first, last)
    gaps = front.copy()
    gaps[1:] -= back[:-1]
    begin, end = np.searchsorted(offsets, [first, last])
    gaps[offsets[begin:end].astype(np.int64) - first] = 0
    return gaps.astype(np.uint16), (back - front).astype(np.uint16)


def channel_differences(colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return (blue, green - blue, red - blue) of (red, green, blue), uint8 (n, 3), modulo 256.

    Most colour maps' channels rise and fall together: the differences are small or repeat.
    """
    red, green, blue = colors.T
    return np.stack([blue, green - blue, red - blue], axis=1)


def colors_of_differences(differences: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return what :func:`channel_differences` was given."""
    blue, green, red = differences.T
    return np.stack([red + blue, green + blue, blue], axis=1)


def packed_8(
    step: float,
    offsets: NDArray[np.uint64],
    stored: Mapping[str, NDArray[Any]],
    chunk_rows: int,
) -> Packed8:
    """Return the 8-byte form of what a file holds, checked.

    ``step``: of the depth grid. ``offsets``: the lists'. ``stored``: ``origin``, ``stride``,
    ``front`` and ``back`` as :func:`gaps_and_thicknesses` gives them for every ``chunk_rows``
    supersegments, ``color`` and ``optical_depth``. ``chunk_rows``: see above. Raises
    InvalidVDIError if packing gives no such codes.
    """
    if (offsets[1:] < offsets[:-1]).any():
        raise InvalidVDIError("offsets must not decrease")
    counts = np.diff(offsets).astype(np.int64)
    check_grid(step, stored["origin"], stored["stride"], counts)
    gaps, thicknesses = stored["front"].astype(np.int64), stored["back"].astype(np.int64)
    tau = stored["optical_depth"].astype(np.uint32)
    # Codes begin anew with every list and every chunk
    n = len(gaps)
    begins = np.zeros(n, bool)
    begins[offsets[:-1][counts > 0].astype(np.int64)] = True
    begins[::chunk_rows] = True
    runs = np.cumsum(gaps + thicknesses)
    starts = np.flatnonzero(begins)
    before = runs[starts] - gaps[starts] - thicknesses[starts]
    back = runs - np.repeat(before, np.diff(np.append(starts, n)))
    if n and not (thicknesses.min() > 0 and back.max() <= DEPTH_CODES and tau.max() <= TAU_CODES):
        raise InvalidVDIError("a supersegment has no thickness, or a code beyond its largest")
    color = np.zeros((n, 4), np.uint8)
    color[:, 1:] = stored["color"]
    colors = color.view("<u4").reshape(-1).astype(np.uint32, copy=False)
    front = (back - thicknesses).astype(np.uint32)
    return Packed8(
        step,
        stored["origin"].astype(np.int32, copy=False),
        stored["stride"].astype(np.uint16, copy=False),
        _words(front, back.astype(np.uint32), tau, colors),
    )


def check_grid(
    step: float, origins: NDArray[Any], strides: NDArray[Any], counts: NDArray[Any]
) -> None:
    """Raise InvalidVDIError where lists' depths are on no grid that packing makes."""
    mantissa, exponent = math.frexp(step)
    if not (mantissa == 0.5 and _LEAST_STEP_EXPONENT < exponent <= 105):
        raise InvalidVDIError(f"the step of depths must be a power of two; got {step}")
    first = origins.astype(np.int64)
    last = first + strides.astype(np.int64) * DEPTH_CODES
    if (np.abs(first) > GRID).any() or (last > GRID + DEPTH_CODES + 1).any():
        raise InvalidVDIError("a list's depths lie beyond the VDI's grid")
    occupied = counts > 0
    if ((strides > 0) != occupied).any() or origins[~occupied].any():
        raise InvalidVDIError("the lists with a stride are not those with supersegments")
