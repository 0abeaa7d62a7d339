"""Ambient occlusion of a classified volume, computed on a device."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, padded
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid
from pyvista_vdi.volume.rays import Variant

Triple = tuple[int, int, int]

#: Nodes along x in a work-group.
_GROUP = 32
#: Most nodes, with the margin: kernels number them by int32.
_MOST_NODES = 2**31 - 1


def ambient_transmittances(
    runtime: Runtime,
    grid: OcclusionGrid,
    *,
    medium: Mapping[str, Any],
    variant: Variant,
    lengths: tuple[float, float],
) -> DeviceBuffer:
    """Return the mean transmittance around each node, float32 (nz, ny, nx) on the device.

    ``medium``: arguments of the kernels that say what the medium is, and ``visible`` macrocells;
    ``lengths``: of the volume's own steps, and its opacity unit distance. DeviceMemoryError if the
    grid does not fit.
    """
    opacities, ambient = _grids(runtime, grid)
    with opacities:
        runtime.fill(opacities, np.float32(0))
        points = medium["classified"]["size"][:3]
        where = (points, (0, 0, 0), grid.nodes, grid.margin, grid.padded)
        _fill(runtime, grid, medium, variant, lengths, where, opacities)
        macrocells = medium["classified"]["macrocells"]
        _march(runtime, grid, opacities, medium["visible"], macrocells, variant, ambient)
    return ambient


def opacities_of_part(
    runtime: Runtime,
    grid: OcclusionGrid,
    points: Triple,
    first: Triple,
    nodes: Triple,
    *,
    medium: Mapping[str, Any],
    variant: Variant,
    lengths: tuple[float, float],
) -> NDArray[np.float32]:
    """Return this part's share of the mean opacities of nodes, float32 (nz, ny, nx).

    Parameters are those of :func:`ambient_transmittances`; ``points``: of the whole volume;
    ``first``: the first of ``nodes``, both along x, y and z.
    """
    with runtime.buffer(nodes[::-1], name="opacities for ambient occlusion") as opacities:
        where = (points, first, nodes, (0, 0, 0), nodes)
        _fill(runtime, grid, medium, variant, lengths, where, opacities)
        return runtime.download(opacities)


def ambient_of_opacities(
    runtime: Runtime, grid: OcclusionGrid, opacities: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the mean transmittance around each node of which the opacities are known.

    ``opacities``: float32 (nz, ny, nx), of the nodes without a margin.
    """
    around, ambient = _grids(runtime, grid)
    margins = [(m, m) for m in grid.margin[::-1]]
    with (
        around,
        ambient,
        runtime.upload(np.pad(opacities, margins), "opacities for ambient occlusion") as known,
        runtime.upload(np.ones(1, np.uint8), "visible macrocells") as visible,
    ):
        _march(runtime, grid, known, visible, (1, 1, 1, 0), Variant(), ambient)
        return runtime.download(ambient)


def _fill(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Mapping[str, Any],
    variant: Variant,
    lengths: tuple[float, float],
    where: tuple[Any, Triple, Triple, Triple, Triple],
    opacities: DeviceBuffer,
) -> None:
    """Fill in the mean opacities of the nodes' boxes.

    ``where``: the grid's points, the first node, nodes, and those around them and in all.
    """
    sample_distance, unit_distance = lengths
    points, first, nodes, margin, in_all = where
    launch = runtime.bind(
        "volume/ambient_occlusion.cl",
        "step_opacities",
        variant.defines,
        **medium,
        opacities=opacities,
    )
    launch(
        (*padded(nodes[0], _GROUP), *nodes[1:]),
        (_GROUP, 1, 1),
        points=(*points, 0),
        first_node=(*first, 0),
        nodes=(*nodes, 0),
        cell=(*grid.cell, 0),
        samples=(*grid.samples, 0),
        margin=(*margin, 0),
        padded=(*in_all, 0),
        units=sample_distance / unit_distance,
        steps=grid.step / sample_distance,
    )


def _march(
    runtime: Runtime,
    grid: OcclusionGrid,
    opacities: DeviceBuffer,
    visible: DeviceBuffer,
    macrocells: Any,
    variant: Variant,
    ambient: DeviceBuffer,
) -> None:
    """Fill in the mean transmittances around the nodes."""
    directions, steps = grid.offsets.shape[:2]
    places, shares = _taps(grid)
    with (
        runtime.upload(places, "places of steps") as place_buffer,
        runtime.upload(shares, "weights of steps") as share_buffer,
    ):
        launch = runtime.bind(
            "volume/ambient_occlusion.cl",
            "ambient_transmittances",
            variant.defines,
            opacities=opacities,
        )
        launch(
            (*padded(grid.nodes[0], _GROUP), *grid.nodes[1:]),
            (_GROUP, 1, 1),
            nodes=(*grid.nodes, 0),
            cell=(*grid.cell, 0),
            margin=(*grid.margin, 0),
            padded=(*grid.padded, 0),
            visible=visible,
            macrocells=macrocells,
            places=place_buffer,
            shares=share_buffer,
            directions=directions,
            steps=steps,
            ambient=ambient,
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
