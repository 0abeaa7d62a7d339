"""opencl/volume/march.cl against float64: where the steps of a ray lie, and what is in them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from strategies import camera_around, random_transform

from pyvista_vdi import TransferFunction, Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume

EPS = 2.0**-24  # unit roundoff of float32
FILE = "march_functions.cl"


def random_volume(rng):
    shape = rng.integers(3, 9, 3)
    rotation = random_transform(rng, "rigid")[:3, :3]
    return Volume(
        rng.random(shape).astype(np.float32),
        spacing=rng.uniform(0.5, 2, 3),
        origin=rng.normal(size=3) * 5,
        direction=rotation if rng.random() < 0.5 else None,
    )


def marched(call, runtime, volume, camera, window, transfer, step, *, group=1):
    """Whole marches of every pixel of a small window, and the rays that they belong to."""
    medium = DeviceVolume(runtime, volume, transfer, sample_distance=step)
    march = medium.forms(camera, window)
    rays = march.rays
    x, y = (i.ravel() for i in np.meshgrid(np.arange(window[0]), np.arange(window[1])))
    offsets = np.column_stack([x + 0.5 - window[0] / 2, y + 0.5 - window[1] / 2])
    n, capacity = len(offsets), int(volume.length / medium.sample_distance) + 4
    n_planes = np.int32(march.planes)
    results = call(
        FILE, "marches", n, *medium.medium_arguments(camera), march.packed(), n_planes,
        offsets.astype(np.float32), np.float32(medium.sample_distance),
        np.float32(medium.unit_distance), np.float32(np.inf), np.int32(group), np.int32(capacity),
        call.empty(n, 4), call.empty(n, dtype=np.int32), call.empty(n, capacity),
        call.empty(n, capacity, 4), call.empty(n, capacity, dtype=np.int32),
        by_value=(1, 7), **medium.defines, **march.defines,
    )  # fmt: skip
    assert (results[1] <= capacity - 1).all()
    pixel = np.column_stack([np.ones(n), offsets])
    return (pixel @ rays.origin, pixel @ rays.direction), results


def box_interval(volume, start, direction):
    """Where rays are inside the grid's oriented box, float64: (n,), (n,)."""
    to_index = np.linalg.inv(volume.index_to_model)
    p = start @ to_index[:3, :3].T + to_index[:3, 3]
    d = direction @ to_index[:3, :3].T
    top = np.array(volume.dimensions) - 1
    with np.errstate(divide="ignore"):
        roots = np.stack([-p / d, (top - p) / d])
    return roots.min(axis=0).max(axis=1), roots.max(axis=0).min(axis=1), p, d


@pytest.mark.parametrize("seed", range(3))
def test_steps_cover_the_ray_without_gaps(call, runtime, seed):
    rng = np.random.default_rng(100 + seed)
    volume = random_volume(rng)
    transform = random_transform(rng)
    camera = camera_around(rng, volume.bounds, transform, distance=rng.uniform(1.3, 4))
    table = rng.random((6, 4))
    transfer = TransferFunction(
        table[:, :3], table[:, 3] * 0.9, (0.1, 0.9), unit_distance=0.7, interpolation="linear"
    )
    step = min(volume.spacing) * rng.uniform(0.2, 1.5)
    (start, direction), results = marched(call, runtime, volume, camera, (9, 8), transfer, step)
    intervals, steps, faces, media, _ = results
    low, high, p, d = box_interval(volume, start, direction)
    speed = np.linalg.norm(direction, axis=1)
    chord = (high - low) * speed  # model length inside the box
    # Positions are within a few units of float32's last digit of the box's size; seen at a
    # grazing angle of down to 1e-3 that is a thousandth of a thousandth of it along the ray
    assert (steps[chord > 1e-3 * volume.length] > 0).all()
    assert (steps[chord < -1e-3 * volume.length] == -1).all()
    hit = np.flatnonzero((steps > 0) & (chord > 1e-3 * volume.length))
    assert len(hit) > 5
    grid = [np.arange(n) for n in volume.array.shape]
    between_points = RegularGridInterpolator(grid, volume.array.astype(np.float64))
    reach = np.array(volume.dimensions).max() + np.abs(p).max()
    for i in hit:
        n, ray = steps[i], faces[i, : steps[i] + 1].astype(np.float64)
        t0, t1, _, units = intervals[i].astype(np.float64)
        width = t1 - t0
        # The ends lie on the box: to the roundings of three terms of its planes' forms
        steepest = np.abs(d[i])
        for end, exact in ((t0, low[i]), (t1, high[i])):
            assert abs(end - exact) <= 32 * EPS * reach / steepest[steepest > 1e-3].min()
        # Contiguous: one number per face, in order; from the first end to the other
        assert (np.diff(ray) > 0).all()
        assert ray[0] == t0
        assert abs(ray[-1] - t1) <= 4 * EPS * (abs(t0) + abs(t1) + width)
        # Steps of equal model length, only the last one shorter
        lengths = np.diff(ray) * speed[i]
        slack = 8 * EPS * (abs(t0) + abs(t1) + width) * speed[i]
        assert np.abs(lengths[:-1] - step).max(initial=0) <= slack
        assert lengths[-1] <= step + slack
        assert n == pytest.approx(width * speed[i] / step, abs=1 + 1e-4)
        assert units == pytest.approx(speed[i] / 0.7, rel=16 * EPS)
        # Each step's medium is that of its midpoint, met over its length
        middle = (ray[:-1] + ray[1:]) / 2
        at = np.clip(p[i] + middle[:, None] * d[i], 0, np.array(volume.dimensions) - 1)
        scalars = between_points(at[:, ::-1])
        nodes = np.linspace(0.1, 0.9, 6)
        entry = np.stack([np.interp(scalars, nodes, c) for c in medium_table(transfer)], axis=1)
        # Positions carry 32 EPS of their reach; the field changes by 1 a voxel along each axis,
        # the table by 1 an entry (1/0.16 a unit of scalar)
        blur = (3 * 32 * EPS * reach + 15 * EPS) / 0.16 + 32 * EPS
        assert np.abs(media[i, :n, :3] - entry[:, :3]).max() <= blur
        tau = -np.log1p(-entry[:, 3]) * lengths / 0.7
        bound = blur / (1 - 0.9) * lengths / 0.7 + tau * (32 * EPS + slack / lengths)
        assert (np.abs(media[i, :n, 3] - tau) <= bound).all()


def medium_table(transfer):
    return [*transfer.colors.T.astype(np.float64), transfer.opacities.astype(np.float64)]


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
    _, (_, steps, _, media, empty) = marched(
        call, runtime, volume, camera, (20, 16), transfer, step, group=group
    )
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
