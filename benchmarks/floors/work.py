"""What each stage has to do at least, and the least time that a machine could take for it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from floors.machine import Rates
from pyvista_vdi import reference
from pyvista_vdi.device.constants import STACK
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.compositing import optical_depth_over_length
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.reference.raycast import Lists, crossings, lines_of_pixel

Floats = NDArray[np.float64]

# Bytes on the device: offset of a list, mask of a tile, faces and medium of a supersegment; RGBA
# float32; an entry of the transfer function.
OFFSET, MASK, FACES, MEDIUM, PIXEL, ENTRY = 4, 8, 8, 16, 16, 16

#: A walk's rays share with their neighbours in a block about as much as this times one ray's bytes.
SHARED_BY_BLOCK = 4


def operations(multiply_add: float = 0, divide: float = 0, exponential: float = 0) -> Floats:
    """Return float32 operations: multiply-adds and what costs as much, divisions, exponentials."""
    return np.array([multiply_add, divide, exponential], float)


# Counted by reading the kernels as simply as they could be written; address arithmetic, masks and
# what decides where to go are left out.
#: Clipping to eleven planes, both ends in list space, the crossings' coefficients.
OF_LIST_RAY = operations(130, 20)
#: Two crossings, the nearer one, the depth there, one step.
OF_LIST = operations(12)
#: Clip to two faces, length, opacity, over.
OF_SUPERSEGMENT = operations(16, 1, 1)
#: A tile's border and slab ahead.
OF_STACK = operations(16, 1)
#: Clipping to seven planes, positions and steps.
OF_MARCHED_RAY = operations(80, 14)
#: Faces of a step, position, place of the nearest voxel; weights and seven interpolations.
OF_SAMPLE, OF_LINEAR = operations(18), operations(24)
#: Place in the table, two entries mixed, optical depth; opacity of a step, over.
OF_CLASSIFICATION, OF_VISIBLE = operations(12, 0, 1), operations(8, 0, 1)
#: Feature of a step, its difference from the run, the run grown.
OF_RUN_STEP = operations(28, 3)
#: Two runs become one, and its errors with both neighbours are known.
OF_MERGE = operations(60, 5)


class Gathers(NamedTuple):
    """Elements gathered: how many, of how many bytes, and from how many bytes."""

    elements: float
    size: int
    working_set: float


@dataclass(frozen=True)
class Work:
    """What a stage has to do at least.

    Bytes that memory has to give and take, each once; elements at places that differ by lane;
    arithmetic.
    """

    read: float = 0.0
    write: float = 0.0
    gathers: tuple[Gathers, ...] = ()
    operations: Floats = field(default_factory=operations)


class Floor(NamedTuple):
    """The least time of some work, seconds, and which resource decides.

    ``waiting``: the floor where each gather is waited for before the next.
    """

    seconds: float
    bound: str
    waiting: float


def floor_of(work: Work, rates: Rates) -> Floor:
    """Return the least time of some work on a machine with these rates.

    Memory, gathers and arithmetic overlap at best; a launch is waited for.
    """
    resources = {
        "memory": work.read / rates.read + work.write / rates.write,
        "gathers": sum(g.elements / rates.gather(g[1], g[2]) for g in work.gathers),
        "arithmetic": float(work.operations @ rates.seconds_of_operations),
    }
    slowest = max(resources.values())
    chained = sum(g.elements / rates.gather(g[1], g[2], "near, chained") for g in work.gathers)
    bound = max(resources, key=lambda name: resources[name])
    return Floor(slowest + rates.launch, bound, max(slowest, chained) + rates.launch)


class Walked(NamedTuple):
    """What a ray meets in a VDI until too little light is left, means over a view.

    Lists crossed, and those in which something is met; pieces of supersegments; tiles of the
    occupancy grid entered.
    """

    lists: float
    filled: float
    met: float
    tiles: float


def walked(vdi: VDI, camera: Camera, size: tuple[int, int]) -> Walked:
    """Count along the float64 reference's rays, one for each pixel of a window."""
    lists, edges = Lists(vdi), np.array(vdi.window_size)
    owner = np.repeat(np.arange(vdi.counts.size), vdi.counts.ravel())
    found = np.zeros(4)
    for pixel in np.ndindex(*size):
        for line in lines_of_pixel(vdi, camera, size, pixel):
            met = crossings(lists, line)
            depths = optical_depth_over_length(
                lists.optical_depth[met.member], met.length, lists.length[met.member]
            )
            left = np.exp(-(np.cumsum(depths) - depths)) >= TRANSMITTANCE_CUTOFF
            seen = met.member[left]
            end = line.t1 if left.all() else float(met.end[left][-1])
            places = []
            for t in (line.t0, end):
                at = lists.viewport @ np.append(line.origin + t * line.direction, 1.0)
                places.append((at[:2] / at[3] + 1) / 2 * edges)
            found += (
                _borders(places, edges),
                len(np.unique(owner[seen])),
                len(seen),
                _borders(np.array(places) / STACK, -(-edges // STACK)),
            )
    return Walked(*map(float, found / np.prod(size)))


def _borders(places: Any, edges: Any) -> int:
    """Return the cells between two places of a grid along a straight line."""
    first, last = (np.clip(np.floor(place), 0, edges - 1) for place in places)
    return 1 + int(np.abs(last - first).sum())


class Marched(NamedTuple):
    """Samples that a ray takes in a volume, and those that are not transparent, means."""

    steps: float
    visible: float


def marched(
    volume: Volume,
    view: Camera,
    size: tuple[int, int],
    function: TransferFunction,
    step: float,
    *,
    stops: bool,
) -> Marched:
    """Count the float64 reference's samples; ``stops``: until too little light is left."""
    found = np.zeros(2)
    for ray in reference.samples(volume, view, size, function, step):
        tau = ray.optical_depth
        left = np.exp(-(np.cumsum(tau) - tau)) >= (TRANSMITTANCE_CUTOFF if stops else 0.0)
        found += np.count_nonzero(left), np.count_nonzero(tau[left])
    return Marched(*map(float, found / np.prod(size)))


def raycast_work(each: Walked, rays: int, n_bytes: float, *, skips: bool) -> Work:
    """Return the work of a VDI frame's raycast from ``n_bytes`` of lists.

    ``skips``: whether lists in which nothing is met are passed by, tile by tile.
    """
    visits = rays * (each.filled if skips else each.lists)
    met, tiles = rays * each.met, rays * each.tiles if skips else 0.0
    # Where a ray ends in a list, one face more than is met says so
    faces = met + rays * each.filled
    gathered = visits * 2 * OFFSET + faces * FACES + met * MEDIUM
    shared = SHARED_BY_BLOCK * gathered / rays
    return Work(
        read=min(gathered, n_bytes),
        write=rays * PIXEL,
        gathers=(
            Gathers(visits, 2 * OFFSET, shared),
            Gathers(faces, FACES, shared),
            Gathers(met, MEDIUM, shared),
            Gathers(tiles, MASK, shared),
        ),
        operations=OF_LIST_RAY * rays + OF_LIST * visits + OF_SUPERSEGMENT * met + OF_STACK * tiles,
    )


def march_work(
    each: Marched, rays: int, volume: Volume, function: TransferFunction, *, records: bool
) -> Work:
    """Return the work of a march: what is transparent need not be looked at.

    ``records``: whether runs are recorded for generation, or a picture is made.
    """
    samples, linear = rays * each.visible, function.interpolation == "linear"
    # A whole number has an entry of its own, which says the optical depth as well
    looked_up = not linear and volume.array.dtype.kind in "iu"
    item, corners = min(volume.array.dtype.itemsize, 4), 8 if linear else 1
    needed = OF_MARCHED_RAY * rays + (OF_SAMPLE + OF_VISIBLE) * samples
    for more, wanted in ((OF_LINEAR, linear), (OF_CLASSIFICATION, not looked_up)):
        needed = needed + more * (samples * wanted)
    if records:
        needed = needed + OF_RUN_STEP * samples
    shared = SHARED_BY_BLOCK * samples * item * corners / rays
    return Work(
        read=min(float(volume.array.nbytes), samples * item * corners),
        write=0.0 if records else rays * PIXEL,
        gathers=(
            Gathers(samples * corners, item, shared),
            Gathers(samples * (1 if looked_up else 2), ENTRY, len(function.opacities) * ENTRY),
        ),
        operations=needed,
    )


def shorten_work(recorded: float, kept: int) -> Work:
    """Return the work of merging as many runs as a march has recorded down to those kept."""
    return Work(operations=OF_MERGE * max(recorded - kept, 0.0))
