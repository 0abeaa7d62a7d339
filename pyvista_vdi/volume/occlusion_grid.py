"""Ambient occlusion of a classified volume, computed on a device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, padded
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid

_KERNELS = "volume/ambient_occlusion.cl"
#: Nodes along x in a work-group.
_GROUP = 32
#: Most nodes, with the margin: kernels number them by int32.
_MOST_NODES = 2**31 - 1


def ambient_transmittances(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Sequence[Any],
    visible: tuple[Any, Any],
    defines: dict[str, str | int | None],
    sample_distance: float,
    unit_distance: float,
) -> DeviceBuffer:
    """Return the mean transmittance around each node, float32 (nz, ny, nx) on the device.

    Parameters
    ----------
    runtime : Runtime
        The device.
    grid : OcclusionGrid
        Nodes and marches.
    medium : sequence
        Arguments ``voxels`` to ``gradient`` of the kernels that march, without lights.
    visible : tuple
        Two of them: macrocells that are not transparent, and how many there are.
    defines : dict
        What the kernels are compiled with: of the medium, without lights.
    sample_distance, unit_distance : float
        Length of the volume's own steps, and its opacity unit distance; model units.

    Raises
    ------
    DeviceMemoryError
        If the grid does not fit.
    """
    directions, steps = grid.offsets.shape[:2]
    nodes, cell, margin, in_all = (
        _int4(v) for v in (grid.nodes, grid.cell, grid.margin, grid.padded)
    )
    items = (*padded(grid.nodes[0], _GROUP), *grid.nodes[1:])
    places, shares = _taps(grid)
    opacities, ambient = _grids(runtime, grid)
    with (
        opacities,
        runtime.upload(places, "places of steps") as place_buffer,
        runtime.upload(shares, "weights of steps") as share_buffer,
    ):
        runtime.fill(opacities, np.float32(0))
        runtime.launch(
            runtime.kernel(_KERNELS, "step_opacities", defines),
            items,
            (_GROUP, 1, 1),
            *medium,
            nodes,
            cell,
            _int4(grid.samples),
            margin,
            in_all,
            np.float32(sample_distance / unit_distance),
            np.float32(grid.step / sample_distance),
            opacities,
        )
        runtime.launch(
            runtime.kernel(_KERNELS, "ambient_transmittances", defines),
            items,
            (_GROUP, 1, 1),
            opacities,
            nodes,
            cell,
            margin,
            in_all,
            *visible,
            place_buffer,
            share_buffer,
            np.int32(directions),
            np.int32(steps),
            ambient,
        )
        runtime.finish()  # the tables may be host memory in use, and other queues read the result
    return ambient


def _grids(runtime: Runtime, grid: OcclusionGrid) -> tuple[DeviceBuffer, DeviceBuffer]:
    """Return memory for the opacities with their margin, and for the result."""
    count = math.prod(grid.padded)
    remedy = "a larger radius of ambient occlusion takes a coarser grid"
    if count > _MOST_NODES:
        raise DeviceMemoryError(
            f"ambient occlusion needs a grid of {' x '.join(map(str, grid.padded))} nodes with its "
            f"margin, more than {_MOST_NODES}: {remedy}"
        )
    try:
        opacities = runtime.buffer(grid.padded[::-1], name="opacities for ambient occlusion")
        return opacities, runtime.buffer(grid.nodes[::-1], name="ambient occlusion")
    except DeviceMemoryError as error:
        raise DeviceMemoryError(f"{error}; {remedy}") from error


def _taps(grid: OcclusionGrid) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return where each step's eight opacities begin, and the weights between them."""
    offsets = grid.offsets.reshape(-1, 3)
    floor = np.floor(offsets)
    nx, ny, _ = grid.padded
    places = floor.astype(np.int64) @ np.array([1, nx, nx * ny])
    return places.astype(np.int32), (offsets - floor).astype(np.float32)


def _int4(values: Sequence[int]) -> NDArray[np.int32]:
    return np.array([*values, 0], dtype=np.int32)
