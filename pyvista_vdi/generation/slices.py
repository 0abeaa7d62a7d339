"""How many rows of lists are made at a time, and the memory that making a VDI takes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.device.constants import RUN_WORDS, block_items
from pyvista_vdi.generation.list_arrays import SUPERSEGMENT_BYTES, blocks_to_sum
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import Room
from pyvista_vdi.volume.upload import volume_bytes, voxel_bytes

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


@dataclass(frozen=True)
class Estimate:
    """Memory that making a VDI takes, in bytes.

    Attributes
    ----------
    volume : int
        The volume on the device, or as many bricks of it as a memory limit leaves room for.
    vdi_worst_case : int
        The VDI with every list full; most are far shorter.
    working : int
        Buffers on the device while a slice of rays is made.
    occlusion : int
        The grid of the ambient occlusion on the device, while it is computed.
    total : int
        All of these.
    """

    volume: int
    vdi_worst_case: int
    working: int
    occlusion: int = 0

    @property
    def total(self) -> int:
        """Sum of them all, bytes."""
        return self.volume + self.vdi_worst_case + self.working + self.occlusion


def estimate(
    volume: Volume,
    window_size: Sequence[int],
    options: GenerationOptions | None = None,
    *,
    transfer_function: TransferFunction | None = None,
    device: Any = None,
    **changes: Any,
) -> Estimate:
    """State the memory that :func:`~pyvista_vdi.generation.generate.generate_vdi` takes.

    Scalars whose range is narrow for how far it is from 0 are taken relative to it, which takes 4
    bytes a voxel on the device, and as much on the host while they are scaled. Without a transfer
    function they are taken to be read as they are. A GPU makes larger slices of a VDI at a time.
    """
    options = GenerationOptions.of(options, changes)
    width, height = size = check_window_size(window_size)
    slices = Slices(get_runtime(device), size, options)
    nbytes = volume.array.size * voxel_bytes(volume, transfer_function)
    on_device, samples = volume_bytes(volume, nbytes, slices.room(volume))
    return Estimate(
        volume=on_device,
        vdi_worst_case=width * height * (options.max_supersegments * SUPERSEGMENT_BYTES + 8) + 8,
        working=slices.bytes + samples,
        occlusion=options.occlusion_bytes(volume),
    )
