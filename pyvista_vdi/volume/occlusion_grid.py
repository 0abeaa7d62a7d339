"""Ambient occlusion of a classified volume, computed on a device."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pyvista_vdi.device import DeviceBuffer, Runtime, padded
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid
from pyvista_vdi.volume.rays import Variant

#: Nodes along x in a work-group.
_GROUP = 32
#: Most nodes, with the margin: kernels number them by int32.
_MOST_NODES = 2**31 - 1


def ambient_transmittances(
    runtime: Runtime,
    grid: OcclusionGrid,
    medium: Mapping[str, Any],
    variant: Variant,
    lengths: tuple[float, float],
) -> DeviceBuffer:
    """Return the mean transmittance around each node, float32 (nz, ny, nx) on the device.

    ``medium``: arguments of the kernels that say what the medium is, and ``visible`` macrocells;
    ``lengths``: of the volume's own steps, and its opacity unit distance. DeviceMemoryError if the
    grid does not fit.
    """
    sample_distance, unit_distance = lengths
    file, items = "volume/ambient_occlusion.cl", (*padded(grid.nodes[0], _GROUP), *grid.nodes[1:])
    nodes = {"nodes": grid.nodes, "cell": grid.cell, "margin": grid.margin, "padded": grid.padded}
    shape: dict[str, Any] = {name: (*numbers, 0) for name, numbers in nodes.items()}
    # Where each step's eight opacities begin, and the weights between them
    offsets, (nx, ny, _) = grid.offsets.reshape(-1, 3), grid.padded
    floor = np.floor(offsets)
    places = (floor.astype(np.int64) @ np.array([1, nx, nx * ny])).astype(np.int32)
    shares = (offsets - floor).astype(np.float32)
    opacities, ambient = _grids(runtime, grid)
    with (
        opacities,
        runtime.upload(places, "places of steps") as place_buffer,
        runtime.upload(shares, "weights of steps") as share_buffer,
    ):
        # Fill in the mean opacities of the nodes' boxes
        runtime.fill(opacities, np.float32(0))
        fill = runtime.bind(file, "step_opacities", variant.defines, **medium, opacities=opacities)
        fill(
            items,
            (_GROUP, 1, 1),
            **shape,
            samples=(*grid.samples, 0),
            units=sample_distance / unit_distance,
            steps=grid.step / sample_distance,
        )
        # Fill in the mean transmittances around the nodes
        march = runtime.bind(file, "ambient_transmittances", variant.defines, opacities=opacities)
        directions, steps = grid.offsets.shape[:2]
        march(
            items,
            (_GROUP, 1, 1),
            **shape,
            visible=medium["visible"],
            macrocells=medium["classified"]["macrocells"],
            places=place_buffer,
            shares=share_buffer,
            directions=directions,
            steps=steps,
            ambient=ambient,
        )
        runtime.finish()  # the tables may be host memory in use
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
