"""What rays meet, counted in float64 on the host: the work that no kernel can do without.

Two walks, both for many rays at once in NumPy and independent of the kernels: through the lists of
a VDI, and through a volume step by step. ``model.py`` turns the counts into bytes and operations.

Both walks share their steps: hence more than 500 lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.device.ray_forms import depth_range
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH, TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.reference.raycast import centre_ray_scale, near_limit

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Edge of the blocks that volumes are skipped by, cells.
BLOCK = 8

#: Pixels along the edges of the blocks whose rays go together, and in a block.
EDGE, LANES = 4, 16

#: Runs are the same medium within this merge error, as generation has it.
INDISTINGUISHABLE = 1e-6


@dataclass(frozen=True)
class Rays:
    """Rays of some pixels in the model frame: ``origin + t direction``, float64 (n, 3) each."""

    origin: Array
    direction: Array

    @classmethod
    def of(cls, camera: Camera, size: tuple[int, int], x: Integers, y: Integers) -> Rays:
        """Return the rays through pixel centres; y = 0 is the bottom row, t is view depth."""
        at = np.stack(
            [np.ones(len(x)), (2 * x + 1) / size[0] - 1, (2 * y + 1) / size[1] - 1], axis=1
        )
        origin, direction = camera.ray_coefficients(size)
        inverse = np.linalg.inv(camera.model_to_view)
        return cls(
            at @ origin @ inverse[:3, :3].T + inverse[:3, 3],
            at @ direction @ inverse[:3, :3].T,
        )


def sampled_blocks(size: tuple[int, int], every: int) -> tuple[Integers, Integers]:
    """Return x and y of the pixels of one block of 4 x 4 in every so many pixels both ways.

    Those of a block lie behind one another, as its rays lie in the lanes of a vector. A window is
    at least four pixels wide and high.
    """
    every = max(every // EDGE, 1) * EDGE
    middle = (every - EDGE) // 2 // EDGE * EDGE
    columns, rows = (
        np.arange(min(middle, (n - EDGE) // EDGE * EDGE), n - EDGE + 1, every) for n in size
    )
    lanes = np.arange(LANES)
    x, y = np.broadcast_arrays(
        columns[np.newaxis, :, np.newaxis] + lanes % EDGE,
        rows[:, np.newaxis, np.newaxis] + lanes // EDGE,
    )
    return x.ravel(), y.ravel()


def busy_lanes(turns: Integers) -> float:
    """Return the share of lanes at work where each block's rays take their turns in lockstep."""
    blocks = np.reshape(turns, (-1, LANES))
    most = LANES * blocks.max(axis=1).sum()
    return float(blocks.sum() / most) if most else 1.0


def clipped(planes: list[tuple[Array, Array]], n: int) -> tuple[Array, Array]:
    """Return first and last t of n rays inside all planes, ``offset + t slope >= 0`` of each."""
    t0, t1 = np.full(n, -np.inf), np.full(n, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for offset, slope in planes:
            crossing = -offset / slope
            t0 = np.where(slope > 0, np.maximum(t0, crossing), t0)
            t1 = np.where(slope < 0, np.minimum(t1, crossing), t1)
            t1 = np.where((slope == 0) & (offset < 0), -np.inf, t1)
    return t0, t1


def box_planes(rays: Rays, bounds: Any) -> list[tuple[Array, Array]]:
    """Return the six planes of axis-aligned bounds for :func:`clipped`."""
    planes = []
    for axis in range(3):
        o, d = rays.origin[:, axis], rays.direction[:, axis]
        planes += [(o - bounds[2 * axis], d), (bounds[2 * axis + 1] - o, -d)]
    return planes


# -- a VDI -----------------------------------------------------------------------------------------


class CountedVDI:
    """A VDI in the form that counting needs; made once and asked for many views.

    Parameters
    ----------
    vdi : VDI
        What is walked through.
    """

    def __init__(self, vdi: VDI) -> None:
        self.vdi = vdi
        self.offsets: Integers = vdi.offsets.astype(np.int64)
        counts = np.diff(self.offsets)
        owner = np.repeat(np.arange(len(counts)), counts)
        self.front = vdi.front.astype(np.float64) + vdi.depth_origin
        self.back = vdi.back.astype(np.float64) + vdi.depth_origin
        self.near, self.far = depth_range(vdi.camera, vdi.bounds)
        # Lists are sorted, so one sorted array of "list + depth within it" finds in all at once
        self.front_key = owner + self.share_of_depth(self.front)
        self.back_key = owner + self.share_of_depth(self.back)
        # Optical depth per unit of view depth is that of the centre ray over its length
        scale = centre_ray_scale(vdi).ravel()[owner]
        self.per_length = vdi.optical_depth / np.maximum((self.back - self.front) * scale, 1e-300)
        self.sums = np.zeros(len(owner) + 1)
        np.cumsum(self.per_length * (self.back - self.front), out=self.sums[1:])
        self.tiles_wide = -(-vdi.window_size[0] // STACK)
        #: Occupied cells before each slab of each tile of the occupancy grid, (tiles, slabs + 1)
        self.occupied_before = self._occupied_before(owner)

    def share_of_depth(self, depth: Array) -> Array:
        """Return depths as shares of the bounds', kept within [0, 1)."""
        extent = max(self.far - self.near, 1e-300)
        return np.clip((depth - self.near) / extent, 0.0, 1.0) * (1 - 2.0**-20)

    def slab_of(self, depth: Array) -> Integers:
        """Return the occupancy grid's slab that holds each view depth."""
        extent = max(self.far - self.near, 1e-300)
        return np.clip((depth - self.near) / extent * SLABS, 0, SLABS - 1).astype(np.int64)

    def _occupied_before(self, owner: Integers) -> Integers:
        width, height = self.vdi.window_size
        tiles = self.tiles_wide * -(-height // STACK)
        tile = owner // width // STACK * self.tiles_wide + owner % width // STACK
        first, last = self.slab_of(self.front), self.slab_of(self.back)
        edges = np.zeros((tiles, SLABS + 1), np.int64)
        np.add.at(edges, (tile, first), 1)
        np.add.at(edges, (tile, last + 1), -1)
        before = np.zeros((tiles, SLABS + 1), np.int64)
        np.cumsum(np.cumsum(edges, axis=1)[:, :SLABS] > 0, axis=1, out=before[:, 1:])
        return before


@dataclass(frozen=True)
class Walk:
    """What each ray of a view met in a VDI, int64 (n,) unless said otherwise.

    Attributes
    ----------
    lists : numpy.ndarray
        Lists stepped through, until the ray left or too little light was left.
    filled : numpy.ndarray
        Those of them that hold a supersegment.
    occupied : numpy.ndarray
        Those of all that lie in an occupied cell of the occupancy grid where the ray crosses them.
    filled_occupied : numpy.ndarray
        Those that are both.
    met : numpy.ndarray
        Pieces of supersegments composited, until too little light was left.
    tiles : numpy.ndarray
        Tiles of the occupancy grid entered.
    in_step : numpy.ndarray
        Turns that its block of 16 rays takes where all take their n-th list together, and wait for
        the one that meets most in it: one for the list, and one for each that is met.
    optical_depth : numpy.ndarray
        Of what the lists hold on the ray's way, float64.
    """

    lists: Integers
    filled: Integers
    occupied: Integers
    filled_occupied: Integers
    met: Integers
    tiles: Integers
    in_step: Integers
    optical_depth: Array


def walk(
    counted: CountedVDI,
    rays: Rays,
    *,
    perspective: bool = True,
    skips: bool = False,
    cutoff: float = TRANSMITTANCE_CUTOFF,
) -> Walk:
    """Walk rays through a VDI's lists, front to back.

    Parameters
    ----------
    counted : CountedVDI
        The VDI.
    rays : Rays
        In the VDI's model frame, parametrised by view depth of the new view.
    perspective : bool
        Whether rays begin at t = 0, the eye of the new view.
    skips : bool
        Whether lists in empty cells of the occupancy grid take no turn.
    cutoff : float
        A ray ends behind the list in which less transmittance than this is left.
    """
    vdi = counted.vdi
    n, (width, height) = len(rays.origin), vdi.window_size
    at, slope = _viewport_lines(vdi, rays)
    planes = box_planes(rays, vdi.bounds)
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            planes.append((at[3] + sign * at[axis], slope[3] + sign * slope[axis]))
    if not vdi.camera.parallel_projection:
        planes.append((at[2] - near_limit(vdi), slope[2]))
    if perspective:
        planes.append((np.zeros(n), np.ones(n)))
    t0, t1 = clipped(planes, n)
    speed = np.linalg.norm(rays.direction, axis=1)

    names = ("lists", "filled", "occupied", "filled_occupied", "met", "tiles")
    found = {name: np.zeros(n, np.int64) for name in names}
    depth_met = np.zeros(n)
    block_turns = np.zeros(-(-n // LANES), np.int64)
    most = -np.log(cutoff) if cutoff > 0 else np.inf
    going = np.flatnonzero(t0 < t1)
    t = t0.copy()
    i, j = _lists_at(at, slope, t0, t1, (width, height))
    step_i, step_j = (_sense(at, slope, axis) for axis in (0, 1))
    tile_before = np.full(n, -1)
    while going.size:
        r = going
        a, s = at[:, r], slope[:, r]
        # What lies before the beginning is a ray's own list, whose borders meet in V_O's eye
        least = t0[r] - 1e-9 * (t1[r] - t0[r])
        t_u = _crossing(a, s, 0, i[r] + (step_i[r] > 0), width, least)
        t_v = _crossing(a, s, 1, j[r] + (step_j[r] > 0), height, least)
        t_next = np.maximum(t[r], np.minimum(t1[r], np.minimum(t_u, t_v)))
        z = a[2] + t[r] * s[2]
        z_next = a[2] + t_next * s[2]
        list_ = j[r] * width + i[r]
        low, high = np.minimum(z, z_next), np.maximum(z, z_next)
        begin, end = counted.offsets[list_], counted.offsets[list_ + 1]
        first = np.searchsorted(counted.back_key, list_ + counted.share_of_depth(low), "right")
        last = np.searchsorted(counted.front_key, list_ + counted.share_of_depth(high), "left")
        first, last = np.clip(first, begin, end), np.clip(last, begin, end)
        tile = j[r] // STACK * counted.tiles_wide + i[r] // STACK

        found["lists"][r] += 1
        found["filled"][r] += end > begin
        found["tiles"][r] += tile != tile_before[r]
        upto = counted.occupied_before[tile, counted.slab_of(high) + 1]
        occupied = upto > counted.occupied_before[tile, counted.slab_of(low)]
        found["occupied"][r] += occupied
        found["filled_occupied"][r] += occupied & (end > begin)
        tile_before[r] = tile
        piece = _Piece(counted, first, last, low, high, (t_next - t[r]) * speed[r])
        met = piece.met(most - depth_met[r], away=z_next >= z)
        found["met"][r] += met
        longest = np.zeros(-(-n // LANES), np.int64)
        np.maximum.at(longest, r // LANES, met + (occupied if skips else 1))
        block_turns += longest
        depth_met[r] += piece.optical_depth

        # On to the next list
        over_u = t_u <= t_v
        i[r] += np.where(over_u, step_i[r], 0)
        j[r] += np.where(over_u, 0, step_j[r])
        t[r] = t_next
        inside = (i[r] >= 0) & (i[r] < width) & (j[r] >= 0) & (j[r] < height)
        going = r[(t_next < t1[r]) & inside & (depth_met[r] <= most)]
    in_step = np.repeat(block_turns, LANES)[:n]
    return Walk(**found, in_step=in_step, optical_depth=depth_met)


def _viewport_lines(vdi: VDI, rays: Rays) -> tuple[Array, Array]:
    """Return (u d, v d, Z, d) of V_O at t = 0 and per unit of t, float64 (4, n) each."""
    to_view = vdi.camera.model_to_view
    viewport = vdi.camera.viewport_matrix(vdi.window_size)
    origin = rays.origin @ to_view[:3, :3].T + to_view[:3, 3]
    direction = rays.direction @ to_view[:3, :3].T
    ones = np.ones((len(origin), 1))
    return viewport @ np.hstack([origin, ones]).T, viewport @ np.hstack([direction, 0 * ones]).T


def _lists_at(
    at: Array, slope: Array, t: Array, t1: Array, size: tuple[int, int]
) -> tuple[Integers, Integers]:
    """Return the column and row of the list in which each ray begins."""
    # A hair inside, so that a ray that begins on a border is on the side to which it goes
    inside = np.where(t < t1, t + 1e-12 * (t1 - t), 0.0)
    d = at[3] + inside * slope[3]
    found = []
    for axis, edge in enumerate(size):
        with np.errstate(divide="ignore", invalid="ignore"):
            place = ((at[axis] + inside * slope[axis]) / d + 1) / 2 * edge
        place = np.where(np.isfinite(place), place, 0)
        found.append(np.clip(np.floor(place), 0, edge - 1).astype(np.int64))
    return found[0], found[1]


def _sense(at: Array, slope: Array, axis: int) -> Integers:
    """Return whether u, or v, grows along each ray: 1, or -1."""
    grows = slope[axis] * at[3] - at[axis] * slope[3]
    return np.where(grows > 0, 1, -1)


def _crossing(
    at: Array, slope: Array, axis: int, border: Integers, edge: int, least: Array
) -> Array:
    """Return t at which rays cross borders between columns, or rows, of lists.

    Infinite where that is never, or before ``least``.
    """
    place = 2 * border / edge - 1
    offset, rise = at[axis] - place * at[3], slope[axis] - place * slope[3]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -offset / rise
    return np.where(np.isfinite(t) & (t >= least), t, np.inf)


class _Piece:
    """Supersegments first to last - 1 of a list between two view depths, for many rays.

    ``length`` is the model length of the ray there.
    """

    def __init__(
        self,
        counted: CountedVDI,
        first: Integers,
        last: Integers,
        low: Array,
        high: Array,
        length: Array,
    ) -> None:
        self._sums, self._count = counted.sums, np.maximum(last - first, 0)
        self._first, self._last = np.where(self._count > 0, first, 0), last
        end = np.where(self._count > 0, last - 1, 0)
        self._before, self._behind = np.zeros(len(low)), np.zeros(len(low))
        density = np.zeros(len(low))
        if len(counted.front):
            begin, per_length = self._first, counted.per_length
            # What of the first and of the last lies outside, in sums of extinction by depth
            self._before = per_length[begin] * np.maximum(low - counted.front[begin], 0)
            self._behind = per_length[end] * np.maximum(counted.back[end] - high, 0)
            density = per_length[begin]
        extent = high - low
        # Across the depth, all of the ray's piece is in one supersegment
        self._across = extent <= 1e-12 * (abs(high) + 1)
        self._factor = length / np.where(self._across, 1.0, extent)
        whole = self._sums[end + (self._count > 0)] - self._sums[self._first]
        inside = np.maximum(whole - self._before - self._behind, 0) * self._factor
        crossed = np.where(self._across, density * length, inside)
        self.optical_depth = np.where(self._count > 0, crossed, 0.0)

    def met(self, left: Array, *, away: NDArray[np.bool_]) -> Integers:
        """Return how many are met until an optical depth of ``left`` is reached."""
        with np.errstate(divide="ignore", invalid="ignore"):
            needed = np.where(self._across, np.inf, left / self._factor)
        ahead = self._sums[self._first] + self._before + needed
        back = self._sums[self._last] - self._behind - needed
        onward = np.searchsorted(self._sums, ahead, "left") - self._first
        homeward = self._last - (np.searchsorted(self._sums, back, "right") - 1)
        return np.clip(np.where(away, onward, homeward), np.minimum(self._count, 1), self._count)


# -- a volume --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class March:
    """What each ray met in a volume, int64 (n,).

    Attributes
    ----------
    steps : numpy.ndarray
        Steps along the ray within the volume, or to where too little light was left.
    looked : numpy.ndarray
        Those in blocks that are not transparent throughout: samples that are taken.
    visible : numpy.ndarray
        Those that are not transparent.
    blocks : numpy.ndarray
        Transparent blocks passed by.
    runs : numpy.ndarray
        Runs of homogeneous medium that generation records at its finest threshold.
    """

    steps: Integers
    looked: Integers
    visible: Integers
    blocks: Integers
    runs: Integers


def visible_blocks(volume: Volume, function: TransferFunction) -> NDArray[np.bool_]:
    """Return which blocks of 8 x 8 x 8 cells hold anything that is not transparent, by z, y, x."""
    least = most = volume.array
    for axis in range(3):
        least, most = _over_blocks(least, axis, np.minimum), _over_blocks(most, axis, np.maximum)
    before = np.concatenate([[0], np.cumsum(function.opacities > 0)])
    first = np.floor(_table_positions(least, function)).astype(np.int64)
    last = np.ceil(_table_positions(most, function)).astype(np.int64)
    return before[last + 1] > before[first]


def _over_blocks(values: NDArray[Any], axis: int, reduce: np.ufunc) -> NDArray[Any]:
    """Reduce an axis of points to blocks of cells, whose first and last points are shared."""
    points = values.shape[axis]
    starts = np.arange(0, max(points - 1, 1), BLOCK)
    within = reduce.reduceat(values, starts, axis=axis)
    ends = np.take(values, np.minimum(starts + BLOCK, points - 1), axis=axis)
    return reduce(within, ends)


def _table_positions(scalars: NDArray[Any], function: TransferFunction) -> Array:
    low, high = function.scalar_range
    last = len(function.opacities) - 1
    return np.clip((scalars.astype(np.float64) - low) * (last / (high - low)), 0, last)


def march(
    volume: Volume,
    function: TransferFunction,
    rays: Rays,
    step: float,
    *,
    blocks: NDArray[np.bool_],
    stops: bool,
    runs: bool = False,
    perspective: bool = True,
    cutoff: float = TRANSMITTANCE_CUTOFF,
) -> March:
    """March rays through a volume, samples at the midpoints of equal steps.

    Parameters
    ----------
    volume : Volume
        Scalars, one component.
    function : TransferFunction
        How they look; without shading.
    rays : Rays
        In the volume's model frame.
    step : float
        Model units.
    blocks : numpy.ndarray
        Of :func:`visible_blocks`.
    stops : bool
        Whether a ray ends where less transmittance than ``cutoff`` is left.
    runs : bool
        Whether runs are counted, which takes longer.
    perspective : bool
        Whether rays begin at t = 0.
    cutoff : float
        See ``stops``.
    """
    n = len(rays.origin)
    to_index = np.linalg.inv(volume.index_to_model)
    start = rays.origin @ to_index[:3, :3].T + to_index[:3, 3]
    slope = rays.direction @ to_index[:3, :3].T
    planes = []
    for axis, points in enumerate(volume.dimensions):
        planes += [(start[:, axis], slope[:, axis])]
        planes += [(points - 1 - start[:, axis], -slope[:, axis])]
    if perspective:
        planes.append((np.zeros(n), np.ones(n)))
    t0, t1 = clipped(planes, n)
    per_step = step / np.linalg.norm(rays.direction, axis=1)
    steps = np.where(t0 < t1, np.ceil((t1 - t0) / per_step), 0).astype(np.int64)
    unit = function.unit_distance or volume.default_unit_distance

    names = ("steps", "looked", "visible", "blocks", "runs")
    found = {name: np.zeros(n, np.int64) for name in names}
    recorder = _Runs(n, min(volume.spacing), step) if runs else None
    depth_met, block_before = np.zeros(n), np.full(n, -1)
    going, k = np.flatnonzero(steps > 0), 0
    while going.size:
        r = going
        front, back = t0[r] + k * per_step[r], np.minimum(t0[r] + (k + 1) * per_step[r], t1[r])
        position = start[r] + (0.5 * (front + back))[:, np.newaxis] * slope[r]
        block = np.clip(position[:, ::-1].astype(np.int64) // BLOCK, 0, np.array(blocks.shape) - 1)
        place = np.ravel_multi_index(tuple(block.T), blocks.shape)
        looked = blocks.ravel()[place]
        found["steps"][r] += 1
        found["looked"][r] += looked
        found["blocks"][r] += ~looked & (place != block_before[r])
        block_before[r] = place

        seen = r[looked]
        samples = _classified(volume, function, position[looked])
        share = ((back - front) / per_step[r])[looked]  # the last step is shorter
        tau = _step_optical_depth(samples[:, 3], share * step / unit)
        visible = tau > 0
        found["visible"][seen] += visible
        if recorder is not None:
            recorder.append(seen[visible], k, samples[visible, :3], tau[visible], share[visible])
        depth_met[seen] += tau
        k += 1
        going = r[steps[r] > k]
        if stops:
            going = going[np.exp(-depth_met[going]) > cutoff]
    if recorder is not None:
        found["runs"][:] = recorder.count
    return March(**found)


def _classified(volume: Volume, function: TransferFunction, position: Array) -> Array:
    """Return RGB and opacity at index positions (x, y, z), float64 (n, 4)."""
    size = np.array(volume.dimensions)
    array = volume.array
    if function.interpolation == "nearest":
        x, y, z = np.clip(np.floor(position + 0.5).astype(np.int64), 0, size - 1).T
        scalars = array[z, y, x].astype(np.float64)
    else:
        cell = np.clip(position.astype(np.int64), 0, np.maximum(size - 2, 0))
        weight = np.clip(position - cell, 0, 1)
        scalars = np.zeros(len(position))
        for corner in np.ndindex(2, 2, 2):
            x, y, z = np.minimum(cell + corner, size - 1).T
            share = np.prod(np.where(corner, weight, 1 - weight), axis=1)
            scalars += share * array[z, y, x]
    at = _table_positions(scalars, function)
    here = np.minimum(at.astype(np.int64), max(len(function.opacities) - 2, 0))
    entries = np.column_stack([function.colors, function.opacities]).astype(np.float64)
    share = (at - here)[:, np.newaxis]
    return (1 - share) * entries[here] + share * entries[np.minimum(here + 1, len(entries) - 1)]


def _step_optical_depth(opacity: Array, units: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = -np.log1p(-opacity) * units
    return np.where(opacity < 1, tau, np.maximum(OPAQUE_OPTICAL_DEPTH, units))


class _Runs:
    """Counts runs of homogeneous medium: Ward's merge error with the run's mean, as generation.

    An error counts as seen in full.
    """

    def __init__(self, n: int, voxel: float, step: float) -> None:
        self._length = step / voxel
        self.count = np.zeros(n, np.int64)
        self._last = np.full(n, -2)
        self._mean = np.zeros((n, 4))
        self._run_length = np.zeros(n)

    def append(self, rays: Integers, k: int, colors: Array, tau: Array, share: Array) -> None:
        """Append step k of some rays; ``share`` says how much of a step each is."""
        length = self._length * share
        density = (tau / (tau + length))[:, np.newaxis]
        feature = np.hstack([colors * density, density])
        part = length / (self._run_length[rays] + length)
        difference = feature - self._mean[rays]
        error = self._run_length[rays] * part * np.sum(difference**2, axis=1)
        new = (self._last[rays] != k - 1) | (error > INDISTINGUISHABLE)
        self.count[rays] += new
        grown = self._mean[rays] + part[:, np.newaxis] * difference
        self._mean[rays] = np.where(new[:, np.newaxis], feature, grown)
        self._run_length[rays] = np.where(new, length, self._run_length[rays] + length)
        self._last[rays] = k
