"""The arrays of a VDI's supersegments, and the same in 8 bytes each, by integers alone.

``docs/dev/conventions.md`` ("Packed supersegments") has the bits and what they lose.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
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
LEAST_STEP_EXPONENT = -126

#: Supersegments that are packed or unpacked at a time: what this takes is small beside a VDI.
_PIECE = 2**16

#: Codes of optical depth: 0 is 0; from 1 on the upper half of a float32's bits, from 2^-18.
TAU_CODES = (1 << 12) - 1
TAU_BASE = (127 - 18) << 7
_LEAST_TAU = np.float32(2.0**-19)

#: Steps of red, green and blue, and where the bits of each begin.
_COLOR_STEPS, _COLOR_BITS = 255, (8, 16, 24)


class Arrays(NamedTuple):
    """The arrays of a :class:`~pyvista_vdi.VDI`, in the order of its constructor's arguments."""

    offsets: NDArray[np.uint64]
    front: NDArray[np.float32]
    back: NDArray[np.float32]
    color: NDArray[np.float32]
    optical_depth: NDArray[np.float32]

    def take(self, offsets: NDArray[Any], rows: Any) -> "Arrays":
        """Return some supersegments, by a slice or by their numbers, in lists of other offsets."""
        return Arrays(offsets.astype(np.uint64, copy=False), *(array[rows] for array in self[1:]))


def words_of(*codes: Any) -> NDArray[np.uint32]:
    """Return the words, uint32 (n, 2), of codes as :meth:`Packed8.codes` returns them."""
    front, back, tau, color = codes
    low = front | back << np.uint32(14) | tau << np.uint32(28)
    return np.stack([low, tau >> np.uint32(4) | color], axis=1)


@dataclass(frozen=True)
class Packed8:
    """The 8-byte form: codes of depth on a grid of the list's own, all else in 36 bits.

    A depth is ``step * (origins[i] + code * strides[i])`` in list i, in whole numbers below 2^24
    that float32 holds, times a power of two: exact on every device.

    ``step``: step of the VDI's depth grid, world units; a power of two. ``offsets``: the lists'.
    ``origins``: int32 (W * H,): where each list's codes begin, steps; 0 for an empty list.
    ``strides``: uint16 (W * H,): steps per code; 0 for an empty list. ``words``: uint32 (n, 2):
    front in bits 0 to 13, back in 14 to 27, optical depth in 28 to 39, red, green and blue from 40,
    48 and 56 on.
    """

    step: float
    offsets: NDArray[np.uint64]
    origins: NDArray[np.int32]
    strides: NDArray[np.uint16]
    words: NDArray[np.uint32]

    @property
    def nbytes(self) -> int:
        """Bytes beside the VDI's own arrays."""
        return self.origins.nbytes + self.strides.nbytes + self.words.nbytes

    def codes(self, rows: slice | NDArray[np.int64]) -> tuple[NDArray[np.uint32], ...]:
        """Return the codes of some supersegments: front, back, tau, colour in bits 8 to 31."""
        low, high = self.words[rows].T
        mask = np.uint32(DEPTH_CODES)
        tau = low >> np.uint32(28) | (high & np.uint32(0xFF)) << np.uint32(4)
        return low & mask, low >> np.uint32(14) & mask, tau, high & np.uint32(0xFFFFFF00)

    def arrays(self) -> Arrays:
        """Return the values that it stands for."""
        n, counts = len(self.words), np.diff(self.offsets).astype(np.int64)
        front, back, tau = (aligned_empty(n, np.float32) for _ in range(3))
        color, bits_of_color = aligned_empty((n, 3), np.float32), np.array(_COLOR_BITS, np.uint32)
        for lists, part in _pieces(self.offsets):
            *faces, tau_codes, colors = self.codes(part)
            own = np.repeat(np.arange(lists.start, lists.stop), counts[lists])
            front[part], back[part] = (self.depths(own, face) for face in faces)
            bits = np.where(tau_codes > 0, tau_codes + np.uint32(TAU_BASE - 1) << np.uint32(16), 0)
            tau[part] = bits.astype(np.uint32).view(np.float32)
            # One multiplication, which every device rounds alike
            steps = colors[:, np.newaxis] >> bits_of_color & np.uint32(_COLOR_STEPS)
            color[part] = steps.astype(np.float32) * (np.float32(1) / np.float32(_COLOR_STEPS))
        return Arrays(self.offsets, front, back, color, tau)

    def depths(self, lists: NDArray[np.int64], codes: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Return what codes of depth in some lists stand for, world units less the origin."""
        whole = self.origins[lists] + codes.view(np.int32) * self.strides[lists].astype(np.int32)
        return whole.astype(np.float32) * np.float32(self.step)


def packing_of(arrays: Arrays, nearest: float) -> Packed8:
    """Return supersegments in 8 bytes each; ``nearest`` is the least depth in front of the eye."""
    counts, n = np.diff(arrays.offsets).astype(np.int64), len(arrays.front)
    if counts.max() > DEPTH_CODES:
        raise InvalidArgumentError(
            f"a list of {counts.max()} supersegments cannot be packed into 8 bytes each: at most "
            f"{DEPTH_CODES} have depths of their own; use the precision 'exact'"
        )
    origins, strides = np.zeros(len(counts), np.int32), np.zeros(len(counts), np.uint16)
    words = np.empty((n, 2), np.uint32)
    # Find the shortest power of two of which at most GRID reach every depth
    step = 1.0
    if n:
        farthest = max(-float(arrays.front.min()), float(arrays.back.max()))
        exponent = math.frexp(farthest / GRID)[1]  # farthest / GRID < 2^exponent
        if farthest / 2.0 ** (exponent - 1) <= GRID:
            exponent -= 1
        step = 2.0 ** max(exponent, LEAST_STEP_EXPONENT)
    for lists, part in _pieces(arrays.offsets):
        # Whole steps, exactly: a division by a power of two; what is before the eye stays there
        faces = np.stack([arrays.front[part], arrays.back[part]], axis=1).astype(np.float64) / step
        np.maximum(faces, np.ceil(max(nearest / step, -(2.0**30))), out=faces)
        # Each list's codes begin at its first front, and are as fine as its extent allows
        occupied = lists.start + np.flatnonzero(counts[lists])
        lengths = counts[occupied]
        first = np.cumsum(lengths) - lengths
        origin = np.rint(faces[first, 0])
        span = np.rint(faces[first + lengths - 1, 1]) - origin
        stride = np.maximum(1, np.ceil(span / DEPTH_CODES))
        origins[occupied], strides[occupied] = origin, stride
        own = np.repeat(np.arange(len(occupied)), lengths)
        depths = np.rint((faces - origin[own, np.newaxis]) / stride[own, np.newaxis])
        # Keep every back at least 1 behind its front. Rounding keeps faces in order; what it made
        # equal is moved behind, and where no codes are left behind, before. Less the thicknesses
        # that must lie before it, a face may equal the one before it
        within = np.arange(len(depths)) - first[own]
        needed = np.stack([within, within + 1], axis=1)
        slack = np.maximum(depths.astype(np.int64), 0) - needed
        apart = own[:, np.newaxis] << 20  # no list's maximum reaches the next list
        running = np.maximum.accumulate((slack + apart).reshape(-1)).reshape(-1, 2) - apart
        most = DEPTH_CODES - lengths[own]
        front, back = (np.minimum(running, most[:, np.newaxis]) + needed).astype(np.uint32).T
        # Round optical depths to eight significant bits, ties to even, between 2^-18 and 16256
        tau = arrays.optical_depth[part]
        bits = tau.view(np.uint32).astype(np.int64)
        upper = (bits + 0x7FFF + (bits >> 16 & 1)) >> 16
        codes = np.where(tau < _LEAST_TAU, 0, np.clip(upper - TAU_BASE + 1, 1, TAU_CODES))
        steps = np.rint(arrays.color[part] * np.float32(_COLOR_STEPS)).astype(np.uint32)
        red, green, blue = (steps << np.array(_COLOR_BITS, np.uint32)).T
        words[part] = words_of(front, back, codes.astype(np.uint32), red | green | blue)
    return Packed8(step, arrays.offsets, origins, strides, words)


def _pieces(offsets: NDArray[np.uint64]) -> Iterator[tuple[slice, slice]]:
    """Lists one after the other and their supersegments, in pieces of about :data:`_PIECE`."""
    starts = offsets.view(np.int64)
    firsts = np.searchsorted(starts, np.arange(0, starts[-1], _PIECE))
    for first, last in itertools.pairwise(np.unique(np.append(firsts, len(starts) - 1))):
        yield slice(first, last), slice(starts[first], starts[last])
