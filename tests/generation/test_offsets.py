"""opencl/generation/offsets.cl: where lists begin, against NumPy's running sum by slices."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

LISTS_PER_ITEM = 16  # see generation/offsets.cl
UNTOUCHED = np.uint64(0xA5A5A5A5A5A5A5A5)


def lengths_of(kind, n, seed):
    rng = np.random.default_rng(seed)
    if kind == "longest":  # sums beyond 2^32 from the second on
        return np.full(n, 2**32 - 1, np.uint32)
    return (rng.integers(0, 4097, n) * (rng.random(n) < 0.7)).astype(np.uint32)


def summed(runtime, slices, group):
    """Offsets that the device makes of slices of lengths, one behind the other."""
    most = max(map(len, slices))
    room = np.full(sum(map(len, slices)) + 3, UNTOUCHED)
    room[0] = 0
    with (
        runtime.buffer(room.shape, np.uint64) as offsets,
        runtime.buffer((-(-most // (group * LISTS_PER_ITEM)),), np.uint64) as sums,
    ):
        runtime.write(offsets, room)
        shared = {"partial": group, "sums": sums}
        sum_lengths = runtime.bind("generation/offsets.cl", "sum_lengths", **shared)
        list_offsets = runtime.bind(
            "generation/offsets.cl", "list_offsets", **shared, all_offsets=offsets
        )
        made = 0
        for lengths in slices:
            blocks = -(-len(lengths) // (group * LISTS_PER_ITEM))
            with runtime.upload(lengths) as given:
                of_slice = {"lists": len(lengths), "lengths": given}
                sum_lengths(blocks * group, group, **of_slice)
                list_offsets(blocks * group, group, **of_slice, made=made)
            made += len(lengths)
        return runtime.download(offsets)


@pytest.mark.parametrize("kind", ["mixed", "longest"])
@pytest.mark.parametrize("sizes", [(15, 16, 17), (1024, 1, 1023, 1025, 70001)], ids=str)
def test_offsets_are_the_running_sum(runtime, kind, sizes):
    """Also where a launch is cut into several, as behind frames."""
    slices = [lengths_of(kind, n, 70 + n) for n in sizes]
    n = sum(sizes)
    expected = np.cumsum(np.concatenate([[0], *slices]), dtype=np.uint64)
    for group, aside in ((1, False), (64, False), (100, False), (64, True)):
        with runtime.background() if aside else contextlib.nullcontext():
            found = summed(runtime, slices, group)
        np.testing.assert_array_equal(found[n + 1 :], UNTOUCHED)
        np.testing.assert_array_equal(found[: n + 1], expected)
