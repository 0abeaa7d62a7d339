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
from pyvista_vdi.errors import Cancelled, InvalidArgumentError
from pyvista_vdi.generation.list_arrays import (
    SUPERSEGMENT_BYTES,
    GrowingLists,
    blocks_to_sum,
    growing_lists,
    require_room,
)
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, memory_limit_bytes
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import Dial, refuse_settings
from pyvista_vdi.volume.bricks import Room, StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.upload import volume_bytes, voxel_bytes

#: Most supersegments that a list may be allowed.
MAX_SUPERSEGMENTS = 4096

#: What decides where lists are cut that must be shortened: what users ask for, and the kernels'
#: name. ``docs/concepts.md`` says what each means; the first is the default and compiles nothing.
_CRITERIA: dict[str, str | None] = {
    "least-error": None,
    "homogeneity": "HOMOGENEITY",
    "length": "EQUAL_LENGTH",
    "transmittance": "EQUAL_TRANSMITTANCE",
    "optical-depth": "EQUAL_OPTICAL_DEPTH",
}
CRITERIA = tuple(_CRITERIA)

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


def check_max_supersegments(max_supersegments: int) -> int:
    """Return ``max_supersegments`` as an int between 1 and :data:`MAX_SUPERSEGMENTS`."""
    try:
        limit = int(max_supersegments)
    except (TypeError, ValueError, OverflowError):
        limit = 0
    if limit != max_supersegments or not 1 <= limit <= MAX_SUPERSEGMENTS:
        raise InvalidArgumentError(
            f"max_supersegments must be a whole number from 1 to {MAX_SUPERSEGMENTS}; "
            f"got {max_supersegments!r}"
        )
    return limit


def check_criterion(criterion: str) -> str:
    """Return ``criterion`` if it is one of :data:`CRITERIA`."""
    if criterion not in CRITERIA:
        raise InvalidArgumentError(
            f"criterion must be one of {', '.join(CRITERIA)}; got {criterion!r}"
        )
    return criterion


def estimate(
    volume: Volume,
    window_size: Sequence[int],
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    ambient_occlusion: Any = None,
    memory_limit: Any = None,
    transfer_function: TransferFunction | None = None,
) -> Estimate:
    """State the memory that :func:`generate_vdi` takes, before it is taken.

    Parameters
    ----------
    volume : Volume
        What would be generated from.
    window_size : (int, int)
        Width and height of V_O's window in pixels.
    max_supersegments : int
        Most supersegments in a list.
    criterion : {"least-error", "homogeneity", "length", "transmittance", "optical-depth"}
        As for :func:`generate_vdi`; all but the first record more of each ray at a time.
    ambient_occlusion, memory_limit : optional
        As for :func:`generate_vdi`.
    transfer_function : TransferFunction, optional
        Scalars whose range is narrow for how far it is from 0 are taken relative to it, which
        takes 4 bytes a voxel on the device, and as much on the host while they are scaled. Without
        it they are taken to be read as they are.

    Returns
    -------
    Estimate
        Bytes.
    """
    width, height = check_window_size(window_size)
    limit = check_max_supersegments(max_supersegments)
    memory = memory_limit_bytes(memory_limit)
    item = voxel_bytes(volume, transfer_function)
    lists = width * height
    plan = _Slices(width, height, limit, check_criterion(criterion), memory)
    occlusion = AmbientOcclusion.from_any(ambient_occlusion)
    grid = 0 if occlusion is None else OcclusionGrid.of(volume, occlusion).nbytes
    room = plan.room(memory, grid)
    on_device, samples = volume_bytes(volume, volume.array.size * item, room)
    return Estimate(
        volume=on_device,
        vdi_worst_case=lists * (limit * SUPERSEGMENT_BYTES + 8) + 8,
        working=plan.bytes + samples,
        occlusion=grid,
    )


def generate_vdi(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    sample_distance: float | None = None,
    tolerance: float = 0.0,
    view_cone: float = 60.0,
    precision: str = "exact",
    dial: Dial | None = None,
    lights: Any = None,
    ambient_occlusion: Any = None,
    memory_limit: Any = None,
    device: Any = None,
    progress: Progress | None = None,
    metadata: Mapping[str, Any] | None = None,
) -> VDI:
    """Make a VDI of a classified volume.

    Each list's ray is marched once. Neighbouring samples are merged while the medium stays
    homogeneous; what is recorded is then merged at least error, or cut by another ``criterion``,
    until ``max_supersegments`` are left. Lists go on behind what V_O sees, because other views may
    see it.

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
    max_supersegments : int
        Most supersegments in a list, 1 to 4096; never exceeded, and nothing that is not
        transparent is dropped.
    criterion : {"least-error", "homogeneity", "length", "transmittance", "optical-depth"}
        What decides where a list is cut. ``"least-error"``: neighbours are merged at least error.
        The others are those of the paper's section 2, for comparison. ``"homogeneity"`` (Frey et
        al. 2013): a supersegment goes on while the medium is like its mean so far, by the least
        threshold that keeps the budget on this ray. ``"length"`` (Brady et al. 1997): cuts at
        equal depths from the first to the last of what is not transparent. ``"transmittance"``
        (Lochmann et al. 2016): cuts where V_O has lost equal shares of the light it loses.
        ``"optical-depth"``: the same by ratios, so that each lets the same share through. With
        each of them neighbours within ``tolerance`` are merged; they record up to 512 runs of a
        ray before unlike ones are merged, which takes more time and, in wide windows, memory.
    sample_distance : float, optional
        Length of a step, model units; half the smallest spacing by default.
    tolerance : float
        Neighbours are merged even under budget where this changes (opacity-weighted colour,
        opacity) per voxel, in the root of the sum of squares along the ray, by no more than this.
        0 merges only what is homogeneous.
    view_cone : float
        Half angle in degrees, 0 to 90, of the cone of views that must be served: what V_O cannot
        see at all counts ``1 - cos(view_cone)`` as much as what it sees when neighbours are merged
        at least error or within ``tolerance``. Other criteria cut without regard to it.
    precision : {"exact", "16-byte", "8-byte"}
        What a supersegment takes; see :meth:`VDI.with_precision`.
    dial : Dial, optional
        Chooses the lists of the window, max_supersegments and precision in place of those given
        here, which must have their defaults, as tolerance must; see
        :mod:`pyvista_vdi.quality.dial`.
    lights : optional
        What a shaded volume is lit by; see :meth:`pyvista_vdi.Lights.from_any`. The light is
        baked into the colours: it stays as it is where V_O has it.
    ambient_occlusion : optional
        Darken what is hidden from the light around it, see
        :meth:`pyvista_vdi.AmbientOcclusion.from_any`; baked into the colours as well, and the same
        from every view.
    memory_limit : int, float or str, optional
        Most bytes to take on the device, or a text such as ``"2 GiB"``; by default what the device
        has. A volume that does not fit goes there brick by brick, which takes more time and makes
        the same VDI to the last bit.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the fraction done, 0 to 1, between slices of work; when it returns False the
        work is given up.
    metadata : mapping, optional
        Entries to add to ``vdi.metadata``.

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
        If the device lacks the memory, see :func:`estimate`, or ``memory_limit`` is too little
        even for one brick.
    """
    camera = Camera.from_any(camera)
    if dial is not None:
        from pyvista_vdi.quality.probe import choose  # it measures VDIs that are made here

        refuse_settings(
            dial,
            max_supersegments=(max_supersegments, 20),
            tolerance=(tolerance, 0.0),
            precision=(precision, "exact"),
        )
        choice = choose(
            volume,
            camera,
            window_size,
            transfer_function,
            dial,
            device=device,
            progress=progress,
            criterion=check_criterion(criterion),
            sample_distance=sample_distance,
            view_cone=view_cone,
            lights=lights,
            ambient_occlusion=ambient_occlusion,
            memory_limit=memory_limit,
        )
        window_size = choice.prediction.window_size
        max_supersegments = choice.prediction.setting.max_supersegments
        precision = choice.prediction.setting.precision
        metadata = {**(metadata or {}), "dial": choice.to_dict()}
    width, height = check_window_size(window_size)
    limit = check_max_supersegments(max_supersegments)
    criterion, precision = check_criterion(criterion), check_precision(precision)
    tolerance, hidden_weight = _check_weights(tolerance, view_cone)
    require_room(0, (width, height))
    runtime = get_runtime(device)
    lights = Lights.from_any(lights)
    occlusion = AmbientOcclusion.from_any(ambient_occlusion)
    memory = memory_limit_bytes(memory_limit)
    slices = _Slices(width, height, limit, criterion, memory)
    grid = 0 if occlusion is None else OcclusionGrid.of(volume, occlusion).nbytes
    medium = DeviceVolume(
        runtime,
        volume,
        transfer_function,
        sample_distance,
        lights=lights,
        ambient_occlusion=occlusion,
        room=slices.room(memory, grid),
    )
    size = (width, height)
    with (
        medium.giving_bricks_back(),
        _Recorder(
            runtime, medium, camera, size, slices, limit, criterion, tolerance, hidden_weight
        ) as recorder,
        growing_lists(runtime, size, limit, slices.rows * width) as lists,
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
        "criterion": criterion,
        "max_supersegments": limit,
        "tolerance": tolerance,
        "view_cone": float(view_cone),
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
        made_by["lights"] = lights.to_dict()
    if occlusion is not None:
        made_by["ambient_occlusion"] = occlusion.to_dict(volume)
    return VDI(
        camera,
        (width, height),
        offsets,
        front,
        back,
        color,
        optical_depth,
        volume.bounds,
        depth_origin=recorder.depth_origin,
        metadata={**made_by, **(metadata or {})},
    ).with_precision(precision)


class _Slices:
    """How many rows of lists are made at a time, and the buffers that this takes."""

    def __init__(
        self, width: int, height: int, limit: int, criterion: str, memory_limit: int | None
    ) -> None:
        # Twice the budget: the records' thresholds then stay well below the final merges' errors
        self.kept = max(2 * limit, limit + 12)
        self.capacity = self.kept + _CHUNK_STEPS
        if _CRITERIA[criterion]:
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
    fifth faster (docs/performance.md). Rays that keep every detail are asked at every step.
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
        limit: int,
        criterion: str,
        tolerance: float,
        hidden_weight: float,
    ) -> None:
        self._runtime = runtime
        self._medium = medium
        self._camera = camera
        self._size = size
        self._limit = limit
        # Differences stay below 1e18, whose square float32 still holds
        self._threshold = np.float32(max(min(tolerance, 1e18) ** 2, _INDISTINGUISHABLE))
        self._weights = (
            np.float32(min(medium.volume.spacing)),  # reference length: a voxel
            np.float32(hidden_weight),
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
        self._cuts = _CRITERIA[criterion]
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


def _check_weights(tolerance: float, view_cone: float) -> tuple[float, float]:
    difference, angle = as_float(tolerance), as_float(view_cone)
    if not (np.isfinite(difference) and difference >= 0):
        raise InvalidArgumentError(f"tolerance must be a number >= 0; got {tolerance!r}")
    if not 0 <= angle <= 90:
        raise InvalidArgumentError(
            f"view_cone must be an angle between 0 and 90 degrees; got {view_cone!r}"
        )
    return difference, float(1 - np.cos(np.radians(angle)))


def _report(progress: Progress | None, fraction: float) -> None:
    if progress is not None and progress(fraction) is False:
        raise Cancelled(f"generation was cancelled at {fraction:.0%}")


__all__ = ["CRITERIA", "MAX_SUPERSEGMENTS", "Estimate", "estimate", "generate_vdi"]
