"""Marches in blocks of rays against one ray in a work-item: small volumes, views, and both ways."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.device import Launch
from pyvista_vdi.device.constants import BLOCK_RAYS, GROUP
from pyvista_vdi.model.standard_cases import filling_camera

WINDOW = (53, 39)  # no multiple of a block's edge
CENTER = (24.5, 20.0, 23.0)

VIEWS = {
    "all of it": lambda volume: filling_camera(volume.bounds, WINDOW).azimuth(33),
    "parallel": lambda volume: Camera(
        (90, 60, 80), CENTER, (0, 1, 0), parallel_projection=True, parallel_scale=40
    ),
    "along an axis": lambda volume: Camera(
        (*CENTER[:2], 90), CENTER, (0, 1, 0), parallel_projection=True
    ),
    "from inside": lambda volume: Camera(CENTER, (0, 0, 0), (0, 1, 0)),
    "past it": lambda volume: Camera((0, 0, 120), (0, 0, 0), (0, 1, 0)),
}


def volume_of(dtype, spacing=(1, 1, 1)):
    """Layers, noise, and a corner of nothing, where blocks are passed by."""
    rng = np.random.default_rng(11)
    z, y, x = np.mgrid[:47, :41, :50] / 40
    field = 0.5 + 0.4 * np.sin(9 * x * y) * np.cos(5 * z) + 0.1 * rng.random(x.shape)
    field[(x + y + z > 1.9) | (x < 0.2)] = 0
    low, high = (-100, 100) if np.dtype(dtype).kind == "i" else (0, 200)
    array = (low + (high - low) * field).astype(dtype)
    if array.dtype.kind == "f":
        array[20:24, 20:24, 20:24] = np.nan
    return Volume(array, spacing)


def transfer_for(volume, interpolation="nearest", **options):
    """Random colours; the lowest scalars are transparent, the highest is opaque."""
    rng = np.random.default_rng(12)
    opacities = np.clip(np.linspace(-0.1, 0.7, 30), 0, 1)
    opacities[-1] = 1.0
    colors = rng.random((30, 3))
    scalars = volume.finite_range()
    return TransferFunction(colors, opacities, scalars, interpolation=interpolation, **options)


def both_ways(monkeypatch, runtime, name, make):
    """Return what a call makes with blocks and without, and how often each was launched.

    ``name`` is the kernel's.
    """
    if not runtime.is_cpu:
        pytest.skip("only CPU devices march in blocks")
    launches = {GROUP: 0, GROUP // BLOCK_RAYS: 0}
    launch = Launch.__call__

    def counted(self, size, group=None, /, **arguments):
        if repr(name) in repr(self):
            launches[group] += 1
        launch(self, size, group, **arguments)

    with monkeypatch.context() as patch:
        patch.setattr(Launch, "__call__", counted)
        found = make()
        patch.setattr(runtime, "is_cpu", False)
        expected = make()
    return found, expected, (launches[GROUP // BLOCK_RAYS], launches[GROUP])


def ray_depths(vdi):
    """Optical depth of each list."""
    sums = np.concatenate([[0], np.cumsum(vdi.optical_depth, dtype=np.float64)])
    return np.diff(sums[vdi.offsets.astype(np.int64)])
