"""opencl/volume/march.cl: what rays pass by; where their steps lie, pictures show."""

from __future__ import annotations

import numpy as np
import pytest
from strategies import camera_around, random_transform

from pyvista_vdi import TransferFunction, Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume

FILE = "march_functions.cl"


def marched(call, runtime, volume, camera, window, transfer, step, group):
    """For every pixel of a small window the steps of its ray, their media and what is passed by."""
    medium = DeviceVolume(runtime, volume, transfer, sample_distance=step)
    march, given = medium.rays.forms(camera, window), medium.medium_arguments(camera)
    x, y = (i.ravel() for i in np.meshgrid(np.arange(window[0]), np.arange(window[1])))
    offsets = np.column_stack([x + 0.5 - window[0] / 2, y + 0.5 - window[1] / 2])
    n, capacity = len(offsets), int(volume.length / medium.sample_distance) + 4
    steps, media, empty = call(
        FILE, "marches", n, *(given[name] for name in ("classified", "voxels", "table")),
        given["distances"], medium.rays.view(window, march.planes), march.packed(),
        offsets.astype(np.float32), np.int32(group), np.int32(capacity),
        call.empty(n, dtype=np.int32), call.empty(n, capacity, 4),
        call.empty(n, capacity, dtype=np.int32), by_value=(0, 4), **medium.variant.defines,
    )  # fmt: skip
    assert (steps <= capacity - 1).all()
    return steps, media, empty


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("seed", range(2))
def test_what_is_passed_by_is_transparent(call, runtime, seed, interpolation):
    """Skipping decides what is looked at: never a step that holds something, in whole groups."""
    rng = np.random.default_rng(200 + seed)
    array = np.zeros(rng.integers(9, 40, 3), np.float32)
    for _ in range(3):  # single points and a small box, on and off the borders of blocks
        array[tuple(rng.integers(0, array.shape))] = 1
    middle = [slice(n // 2 - 2, n // 2 + 2) for n in array.shape]
    array[tuple(middle)] = rng.random((4, 4, 4)) + 0.1
    array[tuple(rng.integers(0, array.shape))] = np.nan
    volume = Volume(array, spacing=rng.uniform(0.5, 2, 3), origin=rng.normal(size=3))
    transfer = TransferFunction(
        rng.random((4, 3)), [0, 0.4, 0.6, 0.9], (0, 1), interpolation=interpolation
    )
    camera = camera_around(rng, volume.bounds, random_transform(rng))
    group = int(rng.integers(1, 4))
    step = min(volume.spacing) * rng.uniform(0.3, 1.2)
    steps, media, empty = marched(call, runtime, volume, camera, (20, 16), transfer, step, group)
    passed = looked_at = 0
    for i in np.flatnonzero(steps > 0):
        held = media[i, : steps[i], 3] > 0
        ends = np.arange(steps[i]) + empty[i, : steps[i]]
        assert (empty[i, : steps[i]] >= 0).all()
        assert (empty[i, : steps[i]] % group == 0).all()
        assert (ends <= steps[i]).all()
        before = np.concatenate([[0], np.cumsum(held)])
        assert (before[ends] == before[:-1]).all()  # nothing is held from k to where it ends
        passed += (empty[i, : steps[i]] > 0).sum()
        looked_at += held.sum()
    assert looked_at > 0
    assert passed > steps[steps > 0].sum() / 4  # it is of use
