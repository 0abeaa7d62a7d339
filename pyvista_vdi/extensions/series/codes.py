"""A step's supersegments as whole numbers, and the tables that they are told apart by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.packing import DEPTH_CODES, TAU_BASE, TAU_CODES, Packed8, packed_8
from pyvista_vdi.model.vdi import VDI

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]

#: Entries of a step's tables of colours and extinctions.
ENTRIES = 256


@dataclass
class Codes:
    """The 8-byte form of a VDI, each field by itself; int64 and so free to be computed with."""

    step: float  # of the depth grid, world units
    counts: Integers  # per list: its length
    origins: Integers  # where its codes begin
    strides: Integers  # how many steps a code takes
    front: Integers  # per supersegment
    back: Integers  # per supersegment
    tau: Integers  # per supersegment
    color: NDArray[np.uint8]  # uint8 (n, 3)
    #: uint8 (n,): which of the tables' colours each is nearest to; empty until that is known
    entries: NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, np.uint8))

    @cached_property
    def starts(self) -> Integers:
        """Where each list begins, and the number of supersegments."""
        return np.concatenate([[0], np.cumsum(self.counts)])

    @classmethod
    def of(cls, vdi: VDI) -> Codes:
        """Return those of a VDI of 8-byte precision."""
        assert isinstance(vdi.packing, Packed8)
        return cls.of_packed(vdi.counts.reshape(-1), vdi.packing)

    @classmethod
    def of_packed(
        cls, counts: NDArray[Any], packed: Packed8, entries: NDArray[np.uint8] | None = None
    ) -> Codes:
        """Return those of lists of so many supersegments."""
        front, back = packed.depth_codes()
        return cls(
            packed.step,
            counts.astype(np.int64),
            packed.origins.astype(np.int64),
            packed.strides.astype(np.int64),
            front.astype(np.int64),
            back.astype(np.int64),
            packed.tau_codes().astype(np.int64),
            packed.colors(),
            np.empty(0, np.uint8) if entries is None else entries,
        )

    def packed(self) -> tuple[NDArray[np.uint64], Packed8]:
        """Return offsets and the packed form, checked."""
        gaps = self.front.copy()
        gaps[1:] -= self.back[:-1]
        gaps[self.starts[:-1][self.counts > 0]] = 0
        offsets = self.starts.astype(np.uint64)
        stored: Mapping[str, NDArray[Any]] = {
            "origin": self.origins,
            "stride": self.strides,
            "front": gaps,
            "back": self.back - self.front,
            "color": self.color,
            "optical_depth": self.tau,
        }
        return offsets, packed_8(self.step, offsets, stored, max(1, len(gaps)))


@dataclass(frozen=True)
class Tables:
    """256 colours, and the optical depth of a sample of each."""

    colors: NDArray[np.uint8]  # uint8 (256, 3)
    #: float32 (256,): optical depth per unit of length, see :class:`Samples`
    extinctions: NDArray[np.float32]

    def nearest(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the entry that each colour, uint8 (n, 3), is nearest to."""
        wide = color.astype(np.int64)
        keys = wide[:, 0] << 16 | wide[:, 1] << 8 | wide[:, 2]
        kinds, which = np.unique(keys, return_inverse=True)
        red, green, blue = (kinds >> 16, kinds >> 8 & 255, kinds & 255)
        found = np.empty(len(kinds), np.uint8)
        table = self.colors.astype(np.int64)
        for first in range(0, len(kinds), 4096):
            part = slice(first, first + 4096)
            distance = sum(
                (channel[part, np.newaxis] - table[:, k]) ** 2
                for k, channel in enumerate((red, green, blue))
            )
            found[part] = np.argmin(distance, axis=1)
        return found[which]

    def tau(self, entries: NDArray[np.uint8], lengths: Floats) -> Integers:
        """Return the codes of optical depth of lengths of these entries' media."""
        with np.errstate(over="ignore"):
            tau = self.extinctions[entries] * lengths.astype(np.float32)
        bits = tau.view(np.uint32).astype(np.int64)
        return np.clip((bits + 0x8000 >> 16) - TAU_BASE + 1, 0, TAU_CODES)

    @classmethod
    def of(cls, codes: Codes, lengths: Floats, metadata: Mapping[str, Any]) -> Tables:
        """Return tables for a step.

        The colours are the transfer function's where the metadata have it, else the mean ones of
        each value of the channel that tells most colours apart.
        """
        colors = _function_colors(metadata)
        if colors is None:
            colors = _mean_colors(codes.color)
        tables = cls(colors, np.zeros(ENTRIES, np.float32))
        entries = tables.nearest(codes.color)
        # What few samples make is one of the table's media itself, and not a mixture
        pure = (colors[entries] == codes.color).all(axis=1) & (lengths <= 2)
        pure &= (codes.tau > 0) & (lengths > 0)
        if not pure.any():
            pure = (codes.tau > 0) & (lengths > 0)
        extinction = tau_values(codes.tau[pure]) / lengths[pure]
        return cls(colors, _medians(entries[pure], extinction))


@dataclass(frozen=True)
class Samples:
    """Where the samples lie that lists were made of: their faces are at whole ones."""

    #: Nine: the constant, and the shares of u and v, of a vector whose length is the number of
    #: samples to a world unit of view depth along a list's centre ray
    coefficients: tuple[float, ...]

    @classmethod
    def of(cls, vdi: VDI) -> Samples | None:
        """Return those that a VDI's metadata tell of, or None."""
        distance = vdi.metadata.get("sample_distance")
        if isinstance(distance, bool) or not isinstance(distance, int | float) or not distance > 0:
            return None
        try:
            directions = vdi.camera.ray_coefficients(vdi.window_size)[1]
            to_model = np.linalg.inv(vdi.camera.model_to_view)[:3, :3]
        except (VDIError, np.linalg.LinAlgError):
            return None
        found = (directions @ to_model.T / distance).reshape(-1)
        return cls(tuple(found.tolist())) if np.isfinite(found).all() else None

    @lru_cache(maxsize=4)  # noqa: B019 - small, and a series has one
    def pitches(self, window_size: tuple[int, int], step: float) -> Floats | None:
        """Return steps of the depth grid from sample to sample, per list; None if unusable.

        Of sums, products, quotients and roots alone, which every machine rounds alike: what was
        written is read to the last bit.
        """
        width, height = window_size
        u = (2 * np.arange(width) + 1) / width - 1
        v = ((2 * np.arange(height) + 1) / height - 1)[:, np.newaxis]
        c = self.coefficients
        with np.errstate(all="ignore"):
            x, y, z = (c[k] + u * c[k + 3] + v * c[k + 6] for k in range(3))
            pitches = 1 / (np.sqrt(x * x + y * y + z * z) * step)
        good = np.isfinite(pitches).all() and pitches.min() > 2.0**-8 and pitches.max() < 2.0**40
        if not good:
            return None
        found = aligned_empty(width * height, np.float64)  # which devices use as it lies
        found[...] = np.asarray(pitches).reshape(-1)
        return found


def tau_values(codes: Integers) -> NDArray[np.float32]:
    """Return the optical depths that codes stand for."""
    bits = np.where(codes > 0, codes + (TAU_BASE - 1) << 16, 0)
    return bits.astype(np.uint32).view(np.float32)


def strides_for(spans: Floats) -> Integers:
    """Return the steps per code of lists that span so many steps."""
    return np.maximum(1, np.ceil(spans / DEPTH_CODES)).astype(np.int64)


def _function_colors(metadata: Mapping[str, Any]) -> NDArray[np.uint8] | None:
    """Return the colours of the transfer function in a VDI's metadata, as bytes."""
    try:
        table = np.asarray(metadata["transfer_function"]["colors"], np.float64)
        if table.ndim != 2 or table.shape[1] != 3 or not np.isfinite(table).all():
            return None
        rows = np.rint(np.linspace(0, len(table) - 1, ENTRIES)).astype(int)
        return np.rint(np.clip(table[rows], 0, 1) * 255).astype(np.uint8)
    except (KeyError, TypeError, ValueError, IndexError):
        return None


def _mean_colors(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the mean colour of each value of the channel that has most of them."""
    values = [np.bincount(color[:, k], minlength=ENTRIES) for k in range(3)]
    key = int(np.argmax([np.count_nonzero(counts) for counts in values]))
    present = np.flatnonzero(values[key])
    if len(present) == 0:
        return np.repeat(np.arange(ENTRIES, dtype=np.uint8)[:, np.newaxis], 3, axis=1)
    means = [
        np.bincount(color[:, key], color[:, k], ENTRIES)[present] / values[key][present]
        for k in range(3)
    ]
    all_entries = np.arange(ENTRIES)
    table = np.stack([np.interp(all_entries, present, mean) for mean in means], axis=1)
    table[:, key] = all_entries
    return np.rint(table).astype(np.uint8)


def _medians(entries: NDArray[np.uint8], values: Floats) -> NDArray[np.float32]:
    """Return the median of each entry's values; between those without any, interpolated ones."""
    if len(entries) == 0:
        return np.zeros(ENTRIES, np.float32)
    order = np.lexsort((values, entries))
    counts = np.bincount(entries, minlength=ENTRIES)
    present = np.flatnonzero(counts)
    middle = (np.cumsum(counts) - counts + counts // 2)[present]
    medians = values[order][middle]
    return np.interp(np.arange(ENTRIES), present, medians).astype(np.float32)
