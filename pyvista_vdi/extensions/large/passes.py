"""What is done for a block, and for rows of lists: wherever it is done, by the same functions.

The first pass finds each ray's optical depth in each block. Behind the sums of these, in the order
in which V_O sees the blocks, the second pass knows the light that enters a block, and makes lists
whose merge errors count as they do in one piece. Rows of all blocks' lists are then put behind each
other, and merged to the budget.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.device.constants import GROUP, RUN_WORDS, block_items
from pyvista_vdi.device.devices import bytes_text
from pyvista_vdi.errors import DeviceMemoryError, UnsupportedError
from pyvista_vdi.extensions.large.blocks import (
    Blocks,
    Ends,
    Indices,
    Offset,
    Values,
    Windows,
    ends_of,
    with_halo,
)
from pyvista_vdi.generation.list_arrays import GrowingLists
from pyvista_vdi.generation.march import CHUNK_STEPS, March, Records, Slice, Slices
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import held_unit_distance
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.ray_forms import Rectangle, packed, pixels_of_points
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import GridRays, RayLaunch, checked_sample_distance

#: Finished lists of whole rows: their lengths, fronts, backs, colours and optical depths.
Rows = tuple[NDArray[Any], ...]

#: Light of which nothing is told apart any more, as an optical depth.
_DARK = 80.0


class BlockSummary(NamedTuple):
    """What the first pass finds of a block."""

    #: Least and largest scalar of what each neighbour needs, and by (0, 0, 0) of all own points;
    #: NaN left out, and where there is nothing else
    ends: dict[Offset, Ends]
    #: What the blocks around it need of its points, by where it lies for them
    faces: dict[Offset, Values]
    #: Optical depth of each ray of the block's window, float16 (rows, columns); ``None`` where the
    #: block is transparent
    depths: NDArray[np.float16] | None = None

    def without_faces(self) -> BlockSummary:
        """Return what whoever sums up the light needs."""
        return self._replace(faces={})


class Piece(NamedTuple):
    """Lists of a block's rays, or of some rows of them."""

    window: Rectangle  # which lists of V_O's window they are
    counts: NDArray[np.uint16]  # runs of each list, uint16 (rows, columns)
    runs: NDArray[np.float32]  # the runs of ``generation/records.cl``, list by list, float32 (n, 8)

    def rows(self, y0: int, y1: int) -> Piece:
        """Return the lists in rows y0 to y1 - 1 of V_O's window, without keeping the others."""
        window = self.window
        low = min(max(y0, window.y0), window.y1)
        high = max(min(y1, window.y1), low)
        if (low, high) == (window.y0, window.y1):
            return self
        before, counts = np.split(self.counts[: high - window.y0], [low - window.y0])
        first = before.sum(dtype=np.int64)
        runs = self.runs[first : first + counts.sum(dtype=np.int64)]
        return Piece(window._replace(y0=low, y1=high), counts.copy(), runs.copy())


@dataclass(frozen=True)
class Task:
    """A VDI that is to be made in blocks: all that whoever does a part of it needs to know."""

    blocks: Blocks
    camera: Camera  # V_O
    size: tuple[int, int]  # lists along the width and the height of its window
    transfer_function: TransferFunction  # with its unit distance
    options: GenerationOptions  # with the sample distance
    scalar_range: Ends
    rays: GridRays  # what is marched through, without values
    device: Any  # what get_runtime takes, where a part is done

    @classmethod
    def of(cls, blocks: Blocks, request: GenerationRequest, scalar_range: Ends) -> Task:
        """Make defaults that follow from the whole grid explicit."""
        grid, options = blocks.grid, request.options
        if options.ambient_occlusion is not None:
            raise UnsupportedError(
                "ambient occlusion needs the volume in one piece, and this one is in blocks: leave "
                "ambient_occlusion out, or give a volume that is in memory"
            )
        step = checked_sample_distance(grid, options.sample_distance)
        unit = request.transfer_function.unit_distance or grid.default_unit_distance
        rays = GridRays(grid, step, held_unit_distance(unit, step))
        return cls(
            blocks,
            request.camera,
            request.window_size,
            request.transfer_function.replace(unit_distance=unit),
            replace(options, sample_distance=step),
            scalar_range,
            rays,
            request.device,
        )

    def window(self, block: Indices) -> Rectangle:
        """Return where in V_O's window rays may meet a block, nowhere if it is out of sight."""
        points, view = self.blocks.corners(block), self.camera.model_to_view
        if not self.camera.parallel_projection and (points @ view[2, :3] + view[2, 3]).max() <= 0:
            points = points[:0]
        return pixels_of_points(self.camera, self.size, points)

    def to_read(self, windows: Windows) -> list[Indices]:
        """Return the blocks that the first pass must read, in the order in which V_O sees them.

        A block in the window needs its neighbours' points; no others are read.
        """
        order = self.blocks.in_order(self.camera)
        wanted = {block for block, window in windows.items() if window.pixels}
        for block in [*wanted]:
            wanted.update(self.blocks.neighbours(block).values())
        return [block for block in order if block in wanted]

    def first_pass(self, block: Indices, values: Values | Callable[[], Values]) -> BlockSummary:
        """Find the optical depths of a block's rays, without its neighbours' points."""
        own = values() if callable(values) else values
        faces = self.blocks.faces(own)
        ends = {at: ends_of(part) for at, part in {(0, 0, 0): own, **faces}.items()}
        seen, window = BlockSummary(ends, faces), self.window(block)
        if not window.pixels or not self.may_be_visible(*ends[0, 0, 0]):
            return seen
        with self._medium(block, own, lit=False) as medium:
            depths = self._optical_depths(medium, window)
        return seen._replace(depths=depths.astype(np.float16)) if depths.any() else seen

    def light_entering(
        self, windows: Windows, seen: Mapping[Indices, BlockSummary]
    ) -> dict[Indices, NDArray[np.float16]]:
        """Return the light that enters each block that may be seen, along its window's rays.

        From 0 to 1. Blocks come in the order in which V_O sees them.
        """
        passed = np.zeros(self.size[::-1], np.float32)
        found = {}
        for block in self.blocks.in_order(self.camera):
            if not windows[block].pixels:
                continue
            # Between its last point and a neighbour's first one there is something of both
            around = self.blocks.neighbours(block).items()
            of_others = [seen[other].ends[offset] for offset, other in around]
            low, high = zip(seen[block].ends[0, 0, 0], *of_others, strict=True)
            if self.may_be_visible(np.fmin.reduce(low), np.fmax.reduce(high)):
                x0, x1, y0, y1 = windows[block]
                before = passed[y0:y1, x0:x1]
                found[block] = np.exp(-np.minimum(before, _DARK)).astype(np.float16)
                if seen[block].depths is not None:
                    before += seen[block].depths
        return found

    def second_pass(
        self,
        block: Indices,
        values: Values | Callable[[], Values],
        light: NDArray[np.float16],
        *around: BlockSummary | None,
    ) -> Piece:
        """Make the lists of a block's rays.

        ``light``: that which enters it along each ray of its window, 0 to 1; ``around``: the
        neighbours, in the order of the blocks' offsets.
        """
        given = zip(self.blocks.offsets, around, strict=True)
        parts = {at: seen.faces[at] for at, seen in given if seen is not None}
        own = with_halo(values() if callable(values) else values, parts)
        counts, runs, window = [], [], self.window(block)
        with self._medium(block, own) as medium:
            runtime, options = medium.runtime, self.options
            slices = Slices(runtime, window.size, options)
            with ExitStack() as stack:
                keep = stack.enter_context
                entering = keep(runtime.upload(light.astype(np.float32), "light that enters"))
                view = self.rays, self.camera, self.size
                records = Records(runtime, *view, slices, options, keep, window)
                march = March(records, medium, self.camera, keep, entering)
                for part in slices.parts:
                    records.begin(part)
                    for chunk in march.chunks(part):
                        march.advance(chunk)
                        records.make_room(last=chunk.stop >= march.most_steps)
                    if options.criterion == "least-error":
                        records.fit()
                    of_part, runs_of_part = _downloaded(records, part)
                    counts.append(of_part)
                    runs.append(runs_of_part)
        return Piece(window, np.concatenate(counts), np.concatenate(runs))

    def merge(self, y0: int, y1: int, *pieces: Piece | None) -> Rows:
        """Put rows of all blocks' lists behind each other and merge them to the budget.

        ``pieces`` come in the order in which V_O sees the blocks.
        """
        runtime, width, options = get_runtime(self.device), self.size[0], self.options
        window = Rectangle(0, width, y0, y1)
        slices = self._slices_to_merge(runtime, y1 - y0)
        with ExitStack() as stack:
            keep, view = stack.enter_context, (self.rays, self.camera, self.size)
            made = Records(runtime, *view, slices, options, keep, window)
            size, limit = (width, y1 - y0), options.max_supersegments
            lists = keep(GrowingLists(runtime, size, limit, slices.rows * width))
            for part in slices.parts:
                made.begin(part)
                first = y0 + part.first_row
                for piece in filter(None, pieces):
                    of_part = piece.rows(first, first + part.rows)
                    if len(of_part.runs):
                        _append(made, of_part)
                        made.make_room()  # each ray by what it has itself, whatever the rows
                made.fit()
                made.pack(lists)
            arrays: Any = lists.finished()  # on the host: none were to stay
        return np.diff(arrays.offsets).astype(np.uint32), *arrays[1:]

    def may_be_visible(self, low: float, high: float) -> bool:
        """Return whether anything between two scalars, that are not NaN, is not transparent."""
        table, (first, last) = self.transfer_function.opacities, self.transfer_function.scalar_range
        per_scalar = (len(table) - 1) / (last - first) if last > first else np.inf
        with np.errstate(invalid="ignore"):
            at = np.nan_to_num((np.array([low, high], np.float64) - first) * per_scalar)
        # So much of an entry on either side covers the rounding of scalars, and of their places
        margin = max(1e-3, 2.4e-7 * len(table))
        begin, end = np.clip([at[0] - margin, at[1] + margin], 0, len(table) - 1)
        return bool(low <= high and (table[int(begin) : int(np.ceil(end)) + 1] > 0).any())

    @contextmanager
    def _medium(
        self, block: Indices, values: Values, *, lit: bool = True
    ) -> Iterator[DeviceVolume]:
        """Bring a block to a device: with its neighbours' points, if it is ``lit``."""
        grid, runtime, limit = self.blocks.grid, get_runtime(self.device), self.options.memory_limit
        window = self.window(block)
        if limit is not None and window.pixels:
            own = values.nbytes + Slices(runtime, window.size, self.options).bytes
            together = self._slices_to_merge(runtime, self.size[1])
            if max(own, together.bytes) > limit:
                points = " x ".join(map(str, values.shape[2::-1]))
                raise DeviceMemoryError(
                    f"a block of {points} points takes {bytes_text(own)} with its lists, and "
                    f"{together.rows} rows of {self.size[0]} lists {bytes_text(together.bytes)}; "
                    f"memory_limit is {bytes_text(limit)}: raise memory_limit, write the volume in "
                    "smaller chunks, or use a smaller window size or max_supersegments"
                )
        before = self.blocks.before if lit else 0
        try:
            yield DeviceVolume(
                runtime,
                Volume(values, grid.spacing, grid.origin, grid.direction, name="block"),
                self.transfer_function,
                self.options,
                part=self.blocks.part(block, before, self.scalar_range),
            )
        finally:
            runtime.finish()  # the values may be host memory in use

    def _optical_depths(self, medium: DeviceVolume, window: Rectangle) -> NDArray[np.float32]:
        """Return those of the window's rays in a block, (rows, columns)."""
        runtime, march = medium.runtime, self.rays.forms(self.camera, self.size)
        variant = replace(medium.variant, double_float=march.double_float)
        columns, rows = window.size
        voxel = min(medium.rays.grid.spacing) / medium.rays.sample_distance * (1 + 1e-9)
        with (
            runtime.upload(packed(march.forms), "rays") as forms,
            runtime.buffer((rows, columns), name="optical depths") as depths,
        ):
            launch = RayLaunch(
                runtime,
                "large/optical_depths.cl",
                "optical_depths",
                variant.defines,
                one_by_one=variant.one_by_one,
                **medium.medium_arguments(self.camera),
                view=self.rays.view(self.size, march.planes, window),
                forms=forms,
                stride=int(max(1, min(voxel, CHUNK_STEPS))),
                depths=depths,
            )
            launch(block_items(columns, rows))
            return runtime.download(depths)

    def _slices_to_merge(self, runtime: Runtime, rows: int) -> Slices:
        """Return what rows of all blocks' lists are merged in."""
        size, longest = (self.size[0], rows), self.options.max_supersegments
        if self.options.criterion != "least-error":  # what is recorded is cut when all is together
            longest = Slices(runtime, size, self.options).kept
        return Slices(runtime, size, self.options, max(CHUNK_STEPS, longest))


def _downloaded(records: Records, part: Slice) -> tuple[NDArray[np.uint16], NDArray[np.float32]]:
    """Return the lengths and the runs of a slice's records."""
    runtime, columns = records.runtime, records.window.size[0]
    n = part.rows * columns
    counts = runtime.download(records.counts)[:n]
    begins = np.append(0, counts.cumsum()).astype(np.uint32)
    made = int(begins[-1])
    with (
        runtime.upload(begins, "places of runs") as places,
        runtime.buffer((max(made, 1), RUN_WORDS), name="runs") as runs,
    ):
        launch = runtime.bind("large/runs.cl", "copy_runs", records=records.runs, runs=runs)
        launch(
            records.items,
            GROUP,
            view=records.view,
            capacity=records.slices.capacity,
            counts=records.counts,
            begins=places,
        )
        found = runtime.download(runs)[:made]
    return counts.reshape(part.rows, columns).astype(np.uint16), found


def _append(records: Records, piece: Piece) -> None:
    runtime, window = records.runtime, piece.window
    columns = window.x1 - window.x0
    begins = np.append(0, piece.counts.cumsum()).astype(np.uint32)
    with (
        runtime.upload(begins, "places of runs") as places,
        runtime.upload(np.ascontiguousarray(piece.runs), "runs") as runs,
    ):
        launch = runtime.bind("large/runs.cl", "append_runs", records=records.runs, runs=runs)
        launch(
            records.items,
            GROUP,
            view=records.view,
            forms=records.forms,
            recording=records.recording,
            window=(window.x0, window.y0, columns, window.y1 - window.y0),
            begins=places,
            counts=records.counts,
        )
        runtime.finish()  # the runs may be host memory in use
