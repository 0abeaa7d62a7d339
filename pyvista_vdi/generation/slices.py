"""How many rows of lists are made at a time, and the memory that making a VDI takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.constants import RUN_WORDS, block_items
from pyvista_vdi.generation.list_arrays import SUPERSEGMENT_BYTES, blocks_to_sum
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import Room

#: Steps of a ray between two looks at the length of its record.
CHUNK_STEPS = 128
#: Bytes of one recorded run on the device, and of its merge error.
_RUN_BYTES = (RUN_WORDS + 1) * 4
#: Bytes of runs that one slice of rays records at a time; also how often progress is reported. On a
#: GPU a share of its memory: a window's rays are few for one (docs/decisions/gpu.md).
_SLICE_BYTES = 96 * 2**20
_SLICES_IN_GPU = 16
#: Slices that a memory limit has room for: the volume gets more than they do.
_SLICES_IN_LIMIT = 4
#: Runs that a ray's record keeps for homogeneity: more than a ray through most data has, so that it
#: cuts what was sampled and not what least error has left of it.
_UNMERGED_RUNS = 512


class Slice(NamedTuple):
    """Rows of lists that are made together."""

    number: int
    first_row: int
    rows: int


class Slices:
    """The slices of a window, and the buffers that one of them takes.

    ``more`` runs are recorded of a ray, at most, between two looks at the length of its record,
    which is shortened to ``kept`` runs then and has room for ``capacity``. A slice has ``rows``
    rows of lists, the last one maybe fewer, and ``items`` work-items; ``bytes`` are on the device,
    of records, lists and all else but the volume.
    """

    def __init__(
        self,
        runtime: Runtime,
        size: tuple[int, int],
        options: GenerationOptions,
        more: int = CHUNK_STEPS,
    ) -> None:
        limit = options.max_supersegments
        # Twice the budget: the records' thresholds then stay well below the final merges' errors
        self.kept = max(2 * limit, limit + 12)
        if options.criterion == "homogeneity":
            self.kept = max(self.kept, _UNMERGED_RUNS)
        self.capacity = self.kept + more
        width, self._height = size
        most = _SLICE_BYTES
        if not runtime.is_cpu:
            most = max(most, runtime.info.global_memory // _SLICES_IN_GPU)
        if options.memory_limit is not None:
            most = min(most, options.memory_limit // _SLICES_IN_LIMIT)
        per_block_row = block_items(width, 4) * self.capacity * _RUN_BYTES
        self.rows = min(self._height, 4 * max(1, most // per_block_row))
        self.items = block_items(width, self.rows)
        lists = self.rows * width
        packed_bytes = lists * (limit * SUPERSEGMENT_BYTES + 8) + 8 + 8 * blocks_to_sum(lists)
        self.bytes = self.items * (self.capacity * _RUN_BYTES + 8) + packed_bytes
        self._options = options
        self._text = f"{self.rows} rows of {width} lists of up to {limit} supersegments"

    def __len__(self) -> int:
        return -(-self._height // self.rows)

    def __iter__(self) -> Iterator[Slice]:
        for number in range(len(self)):
            first_row = number * self.rows
            yield Slice(number, first_row, min(self.rows, self._height - first_row))

    def room(self, volume: Volume) -> Room:
        """Return the room for a volume beside a slice and the grid of an ambient occlusion."""
        beside = self.bytes + self._options.occlusion_bytes(volume)
        return Room(self._options.memory_limit, beside, self.items * CHUNK_STEPS, self._text)
