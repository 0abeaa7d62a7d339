"""Volume to VDI, on a device."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.device import Kernel, Runtime, get_runtime
from pyvista_vdi.device.constants import ERRORS_AT_A_TIME, RUN_WORDS
from pyvista_vdi.device.ray_forms import check_list_space
from pyvista_vdi.device.work_order import BLOCK_RAYS, GROUP, block_items
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.generation.list_arrays import (
    SUPERSEGMENT_BYTES,
    GrowingLists,
    blocks_to_sum,
    growing_lists,
    require_room,
)
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import Room, StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.upload import volume_bytes, voxel_bytes

#: The kernels' name of each criterion other than least error, which compiles nothing.
_CUTS = {
    "homogeneity": "HOMOGENEITY",
    "length": "EQUAL_LENGTH",
    "transmittance": "EQUAL_TRANSMITTANCE",
    "optical-depth": "EQUAL_OPTICAL_DEPTH",
}

#: Bytes of one recorded run on the device, and of its merge error.
_RUN_BYTES = (RUN_WORDS + 1) * 4
#: ``-D`` names that ``generation/march_blocks.cl`` knows; ``COMPENSATED=1`` changes no march.
_IN_BLOCKS = {"VOXEL_T", "INDEX_T", "NEAREST", "BY_SCALAR", "SKIP_EMPTY", "BLOCK_SHIFT"}
#: Bytes of runs that one slice of rays records at a time; also how often progress is reported.
_SLICE_BYTES = 96 * 2**20
#: Slices that a memory limit has room for: the volume gets more than they do.
_SLICES_IN_LIMIT = 4
#: Runs that a ray's record keeps for the criteria other than least error: more than a ray through
#: most data has, so that these cut what was sampled and not what least error has left of it.
_UNMERGED_RUNS = 512
#: Merge error that no picture shows: a difference of a thousandth of full opacity over one voxel.
_INDISTINGUISHABLE = 1e-6
#: Steps of a ray between two looks at the length of its record.
_CHUNK_STEPS = 128
#: The same at first: short, so that rays which cannot keep every detail learn it soon.
_FIRST_CHUNK_STEPS = 64

Progress = Callable[[float], object]
Defines = Mapping[str, str | int | None]


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
    **changes: Any,
) -> Estimate:
    """State the memory that :func:`generate_vdi` takes, before it is taken.

    Scalars whose range is narrow for how far it is from 0 are taken relative to it, which takes 4
    bytes a voxel on the device, and as much on the host while they are scaled. Without a transfer
    function they are taken to be read as they are.
    """
    options = GenerationOptions.of(options, changes)
    width, height = check_window_size(window_size)
    item = voxel_bytes(volume, transfer_function)
    plan = _Slices(width, height, options)
    occlusion = options.occlusion_bytes(volume)
    on_device, samples = volume_bytes(
        volume, volume.array.size * item, plan.room(options.memory_limit, occlusion)
    )
    return Estimate(
        volume=on_device,
        vdi_worst_case=width * height * (options.max_supersegments * SUPERSEGMENT_BYTES + 8) + 8,
        working=plan.bytes + samples,
        occlusion=occlusion,
    )


def generate_vdi(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    options: GenerationOptions | None = None,
    *,
    device: Any = None,
    progress: Progress | None = None,
    metadata: Mapping[str, Any] | None = None,
    **changes: Any,
) -> VDI:
    """Make a VDI of a classified volume.

    Each list's ray is marched once. Neighbouring samples are merged while the medium stays
    homogeneous; what is recorded is then merged at least error, or cut by another criterion,
    until the budget of supersegments is kept. Lists go on behind what V_O sees, because other
    views may see it.

    Parameters
    ----------
    volume : Volume
        The scalars.
    camera : Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height of V_O's window in pixels: one list each.
    transfer_function : TransferFunction
        Scalar to colour and opacity.
    options : GenerationOptions, optional
        How it is made.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the fraction done, 0 to 1, between slices of work; when it returns False the
        work is given up.
    metadata : mapping, optional
        Entries to add to ``vdi.metadata``.
    **changes
        Options by name, in place of those in ``options``.

    Returns
    -------
    VDI
        With the view, the arrays, and in its metadata what made it.

    Raises
    ------
    InvalidArgumentError
        If an argument is out of range.
    Cancelled
        If ``progress`` returned False.
    DeviceMemoryError
        If the device lacks the memory, see :func:`estimate`, or the memory limit is too little
        even for one brick.
    """
    options = GenerationOptions.of(options, changes)
    camera = Camera.from_any(camera)
    width, height = size = check_window_size(window_size)
    require_room(0, size)
    runtime = get_runtime(device)
    slices = _Slices(width, height, options)
    medium = DeviceVolume(
        runtime,
        volume,
        transfer_function,
        options.sample_distance,
        lights=options.lights,
        ambient_occlusion=options.ambient_occlusion,
        room=slices.room(options.memory_limit, options.occlusion_bytes(volume)),
    )
    with (
        medium.giving_bricks_back(),
        _Recorder(runtime, medium, camera, size, slices, options) as recorder,
        growing_lists(runtime, size, options.max_supersegments, slices.rows * width) as lists,
    ):
        _report(progress, 0.0)
        for first_row in range(0, height, slices.rows):
            rows = min(slices.rows, height - first_row)
            recorder.march(first_row, rows)
            if first_row > 0:
                lists.wait()  # for the slice before: the device has this one to go on with
                _report(progress, first_row / height)
            recorder.pack(first_row, rows, lists)
        offsets, front, back, color, optical_depth = lists.finished()
    _report(progress, 1.0)

    made_by = {
        "generator": f"pyvista-vdi {__version__}",
        "criterion": options.criterion,
        "max_supersegments": options.max_supersegments,
        "tolerance": options.tolerance,
        "view_cone": options.view_cone,
        "sample_distance": medium.sample_distance,
        "opacity_unit_distance": medium.unit_distance,
        "transfer_function": transfer_function.to_dict(),
        "volume": {
            "name": volume.name,
            "dimensions": list(volume.dimensions),
            "spacing": list(volume.spacing),
            "dtype": volume.array.dtype.name,
        },
        "device": runtime.info.name,
    }
    if transfer_function.shading is not None:
        made_by["lights"] = options.lights.to_dict()
    if options.ambient_occlusion is not None:
        made_by["ambient_occlusion"] = options.ambient_occlusion.to_dict(volume)
    return VDI(
        camera,
        size,
        offsets,
        front,
        back,
        color,
        optical_depth,
        volume.bounds,
        depth_origin=recorder.depth_origin,
        metadata={**made_by, **(metadata or {})},
    ).with_precision(options.precision)


class _Slices:
    """How many rows of lists are made at a time, and the buffers that this takes."""

    def __init__(self, width: int, height: int, options: GenerationOptions) -> None:
        limit, memory_limit = options.max_supersegments, options.memory_limit
        # Twice the budget: the records' thresholds then stay well below the final merges' errors
        self.kept = max(2 * limit, limit + 12)
        self.capacity = self.kept + _CHUNK_STEPS
        if options.criterion in _CUTS:
            self.kept = max(self.kept, _UNMERGED_RUNS)
            self.capacity = self.kept + _CHUNK_STEPS + limit  # the kernel cuts into what is free
        self.capacity = -(-self.capacity // ERRORS_AT_A_TIME) * ERRORS_AT_A_TIME
        per_block_row = block_items(width, 4) * self.capacity * _RUN_BYTES
        most = _SLICE_BYTES
        if memory_limit is not None:
            most = min(most, memory_limit // _SLICES_IN_LIMIT)
        self.rows = min(height, 4 * max(1, most // per_block_row))
        self.items = block_items(width, self.rows)
        lists = self.rows * width
        sums_bytes = 8 * blocks_to_sum(lists)
        packed_bytes = lists * (limit * SUPERSEGMENT_BYTES + 8) + 8 + sums_bytes
        self.bytes = self.items * (self.capacity * _RUN_BYTES + 8) + packed_bytes
        self.text = f"{self.rows} rows of {width} lists of up to {limit} supersegments"

    def room(self, memory_limit: int | None, occlusion: int) -> Room:
        """Return the room for the volume beside a slice and the grid of an occlusion."""
        steps = self.items * _CHUNK_STEPS
        return Room(memory_limit, self.bytes + occlusion, steps, self.text)


def _steps_per_voxel(volume: Volume, sample_distance: float) -> int:
    """Steps that a ray whose record has been full composites before it asks about homogeneity.

    Measured: such a VDI's SSIM changes by less than .003 either way, and generation is up to a
    fifth faster (docs/decisions/generation.md). Rays that keep every detail are asked at every
    step.
    """
    # A hair more, so that half a voxel divides a voxel twice whatever the rounding
    return int(max(1, min(min(volume.spacing) / sample_distance * (1 + 1e-9), _CHUNK_STEPS)))


def _chunks(steps: int) -> Iterator[tuple[int, int]]:
    """First step and number of steps of each chunk that a march of ``steps`` steps is cut into."""
    first, length = 0, _FIRST_CHUNK_STEPS
    while first < steps:
        yield first, length
        first, length = first + length, _CHUNK_STEPS


class _Recorder:
    """The buffers and kernels that turn slices of rays into packed lists."""

    def __init__(
        self,
        runtime: Runtime,
        medium: DeviceVolume,
        camera: Camera,
        size: tuple[int, int],
        slices: _Slices,
        options: GenerationOptions,
    ) -> None:
        self._runtime = runtime
        self._medium = medium
        self._camera = camera
        self._size = size
        self._limit = options.max_supersegments
        # Differences stay below 1e18, whose square float32 still holds
        self._threshold = np.float32(max(min(options.tolerance, 1e18) ** 2, _INDISTINGUISHABLE))
        self._weights = (
            np.float32(min(medium.volume.spacing)),  # reference length: a voxel
            np.float32(options.hidden_weight),
        )
        check_list_space(camera, medium.volume.bounds)
        rays = medium.forms(camera, size, None)
        self._planes = rays.planes
        self._far_entries = bool(rays.defines)
        self.depth_origin = rays.rays.reference_depth
        self._most_steps = medium.most_steps
        self.slices = slices
        self._grain = _steps_per_voxel(medium.volume, medium.sample_distance)
        items, capacity = self.slices.items, self.slices.capacity
        self._cuts = _CUTS.get(options.criterion)
        defines = {**medium.defines, **rays.defines}
        self._kernels = self._kernels_of(defines, rays.defines)
        with ExitStack() as stack:
            keep = stack.enter_context
            self._forms = keep(runtime.upload(rays.packed(), "rays"))
            self._records = keep(runtime.buffer((items, capacity, RUN_WORDS), name="recorded runs"))
            self._errors = keep(runtime.buffer((items, capacity), name="merge errors"))
            self._thresholds = keep(runtime.buffer((items,), name="merge thresholds"))
            self._counts = keep(runtime.buffer((items,), np.uint32, "list lengths"))
            self._sampler = None
            if medium.bricks is not None:
                march = (
                    self._forms,
                    np.int32(self._planes),
                    np.float32(medium.sample_distance),
                    np.float32(medium.unit_distance),
                )
                of_medium = medium.medium_arguments(camera)
                steps = items * _CHUNK_STEPS
                self._sampler = keep(
                    StepSampler(runtime, medium.bricks, of_medium, defines, march, size, steps)
                )
            self._longest = self._longest_marches()
            self._buffers = stack.pop_all()

    def _kernels_of(self, defines: Defines, of_rays: Defines) -> dict[str, tuple[Kernel, int]]:
        """Return kernels by what they do, with the rays that a work-item of theirs follows."""
        path = "generation/generate.cl"
        used: dict[str, tuple[str, str, Defines, int]] = {
            name: (path, name, defines, 1)
            for name in ("longest_marches", "march_lists", "shorten_lists", "pack_lists")
        }
        if self._cuts:
            used["cut_lists"] = (path, "cut_lists", {**defines, "CRITERION": self._cuts}, 1)
        if self._runtime.is_cpu:
            path = "generation/shorten_blocks.cl"
            used["shorten_lists"] = (path, "shorten_blocks", of_rays, BLOCK_RAYS)
            known = {k: v for k, v in defines.items() if (k, v) != ("COMPENSATED", 1)}
            if "BY_SCALAR" in known and known["INDEX_T"] == "uint" and known.keys() <= _IN_BLOCKS:
                path = "generation/march_blocks.cl"
                used["march_lists"] = (path, "march_blocks", known, BLOCK_RAYS)
        return {
            name: (self._runtime.kernel(path, kernel, given), rays)
            for name, (path, kernel, given, rays) in used.items()
        }

    def __enter__(self) -> _Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self._runtime.finish()  # the forms may be host memory that the device still reads
        self._buffers.close()

    def march(self, first_row: int, rows: int) -> None:
        """March the rays of some rows, and shorten their records to the budget."""
        runtime, medium, (width, height) = self._runtime, self._medium, self._size
        items = block_items(width, rows)
        runtime.fill(self._counts, np.uint32(0))
        runtime.fill(self._thresholds, self._threshold)
        capacity = np.int32(self.slices.capacity)
        longest = int(self._longest[first_row // self.slices.rows])
        for first_step, steps in _chunks(self._most_steps):
            if first_step >= longest:
                break
            sampled: tuple[Any, ...] = ()
            if self._sampler is not None:
                sampled = self._sampler.sample(first_row, rows, first_step, steps)
            self._launch(
                "march_lists",
                items,
                *medium.medium_arguments(self._camera),
                *sampled,
                self._forms,
                np.int32(self._planes),
                np.float32(medium.sample_distance),
                np.float32(medium.unit_distance),
                *(np.int32(n) for n in (width, height, first_row, rows, first_step, steps)),
                np.int32(self._grain),
                self._threshold,
                capacity,
                *self._weights,
                self._thresholds,
                self._records,
                self._counts,
            )
            if self._cuts or first_step + steps < self._most_steps:
                self._shorten(first_row, rows, self.slices.kept, exactly=False)
        if not self._cuts:
            self._shorten(first_row, rows, self._limit, exactly=True)
        if self._cuts:
            self._launch(
                "cut_lists",
                items,
                np.int32(self._limit),
                *(np.int32(n) for n in (width, height, first_row, rows)),
                self._forms,
                capacity,
                *self._weights,
                self._threshold,
                self._records,
                self._counts,
            )

    def _longest_marches(self) -> NDArray[np.int32]:
        """Return the steps of the longest ray of each slice: chunks behind them have nothing."""
        runtime, (width, height) = self._runtime, self._size
        rows = self.slices.rows
        with runtime.buffer((-(-height // rows),), np.int32, "longest rays") as longest:
            runtime.fill(longest, np.int32(0))
            self._launch(
                "longest_marches",
                block_items(width, height),
                self._forms,
                np.int32(self._planes),
                np.float32(self._medium.sample_distance),
                np.float32(self._medium.unit_distance),
                *(np.int32(n) for n in (width, height, rows)),
                longest,
            )
            return runtime.download(longest)

    def _shorten(self, first_row: int, rows: int, limit: int, *, exactly: bool) -> None:
        """Bring records to at most so many runs: least error first, or by raised thresholds."""
        width, height = self._size
        self._launch(
            "shorten_lists",
            block_items(width, rows),
            *(np.int32(n) for n in (limit, exactly, width, height, first_row, rows)),
            self._forms,
            np.int32(self.slices.capacity),
            *self._weights,
            self._thresholds,
            self._records,
            self._errors,
            self._counts,
        )

    def pack(self, first_row: int, rows: int, lists: GrowingLists) -> None:
        """Write the slice's lists behind those made before; what is launched next need not wait."""
        width, height = self._size
        entries: tuple[Any, ...] = ()
        if self._far_entries:
            entries = (self._forms, np.int32(self._planes), np.int32(height), np.int32(first_row))
        self._launch(
            "pack_lists",
            block_items(width, rows),
            self._records,
            np.int32(self.slices.capacity),
            np.int32(width),
            np.int32(rows),
            *lists.follow(self._counts, rows * width),
            *entries,
        )

    def _launch(self, name: str, items: int, *arguments: Any) -> None:
        kernel, rays = self._kernels[name]
        self._runtime.launch(kernel, items // rays, GROUP // rays, *arguments)


def _report(progress: Progress | None, fraction: float) -> None:
    if progress is not None and progress(fraction) is False:
        raise Cancelled(f"generation was cancelled at {fraction:.0%}")


__all__ = ["Estimate", "estimate", "generate_vdi"]
