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
Defines = dict[str, str | int | None]
Triple = tuple[int, int, int]

#: Nodes along x in a work-group.
_GROUP = 32
#: Most nodes, with the margin: kernels number them by int32.
_MOST_NODES = 2**31 - 1


def ambient_transmittances(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Sequence[Any],
    visible: tuple[Any, Any],
    defines: Defines,
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
    opacities, ambient = _grids(runtime, grid)
    with opacities:
        runtime.fill(opacities, np.float32(0))
        lengths = (sample_distance, unit_distance)
        all_of_it = (medium[1], (0, 0, 0), grid.nodes, grid.margin, grid.padded)
        _fill(runtime, grid, medium, defines, lengths, all_of_it, opacities)
        _march(runtime, grid, opacities, visible, defines, ambient)
    return ambient


def opacities_of_part(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Sequence[Any],
    defines: Defines,
    lengths: tuple[float, float],
    points: Triple,
    first: Triple,
    nodes: Triple,
) -> NDArray[np.float32]:
    """Return what part of a volume has of the opacities of nodes, float32 (nz, ny, nx).

    Parameters are those of :func:`ambient_transmittances`; ``lengths``: of a step, and the opacity
    unit distance; ``points``: of the whole volume; ``first``: the first of ``nodes``, both along x,
    y and z.
    """
    with runtime.buffer(nodes[::-1], name="opacities for ambient occlusion") as opacities:
        where = (_int4(points), first, nodes, (0, 0, 0), nodes)
        _fill(runtime, grid, medium, defines, lengths, where, opacities)
        return runtime.download(opacities)


def ambient_of_opacities(
    runtime: Runtime, grid: OcclusionGrid, opacities: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the mean transmittance around each node of which the opacities are known.

    ``opacities``: float32 (nz, ny, nx), of the nodes without a margin.
    """
    around, ambient = _grids(runtime, grid)
    margins = [(m, m) for m in grid.margin[::-1]]
    defines: Defines = {"VOXEL_T": "uchar", "INDEX_T": "uint", "MACROCELL_SHIFT": 0}
    with (
        around,
        ambient,
        runtime.upload(np.pad(opacities, margins), "opacities for ambient occlusion") as known,
        runtime.upload(np.ones(1, np.uint8), "visible macrocells") as visible,
    ):
        _march(runtime, grid, known, (visible, _int4((1, 1, 1))), defines, ambient)
        return runtime.download(ambient)


def _fill(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Sequence[Any],
    defines: Defines,
    lengths: tuple[float, float],
    where: tuple[Any, Triple, Triple, Triple, Triple],
    opacities: DeviceBuffer,
) -> None:
    """Give nodes the mean opacities of their boxes.

    ``where``: the grid's points, the first node, nodes, and those around them and in all.
    """
    sample_distance, unit_distance = lengths
    points, first, nodes, margin, in_all = where
    runtime.launch(
        runtime.kernel(_KERNELS, "step_opacities", defines),
        (*padded(nodes[0], _GROUP), *nodes[1:]),
        (_GROUP, 1, 1),
        *medium,
        points,
        _int4(first),
        _int4(nodes),
        _int4(grid.cell),
        _int4(grid.samples),
        _int4(margin),
        _int4(in_all),
        np.float32(sample_distance / unit_distance),
        np.float32(grid.step / sample_distance),
        opacities,
    )


def _march(
    runtime: Runtime,
    grid: OcclusionGrid,
    opacities: DeviceBuffer,
    visible: tuple[Any, Any],
    defines: Defines,
    ambient: DeviceBuffer,
) -> None:
    """Fill in the mean transmittances around the nodes."""
    directions, steps = grid.offsets.shape[:2]
    places, shares = _taps(grid)
    with (
        runtime.upload(places, "places of steps") as place_buffer,
        runtime.upload(shares, "weights of steps") as share_buffer,
    ):
        runtime.launch(
            runtime.kernel(_KERNELS, "ambient_transmittances", defines),
            (*padded(grid.nodes[0], _GROUP), *grid.nodes[1:]),
            (_GROUP, 1, 1),
            opacities,
            *(_int4(v) for v in (grid.nodes, grid.cell, grid.margin, grid.padded)),
            *visible,
            place_buffer,
            share_buffer,
            np.int32(directions),
            np.int32(steps),
            ambient,
        )
        runtime.finish()  # the tables may be host memory in use, and other queues read the result


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
