"""Slices of rays and their records: marched and merged, fitted to the budget, and packed."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pyvista_vdi.device import DeviceBuffer, Keep, Runtime
from pyvista_vdi.device.constants import GROUP, RUN_WORDS, block_items
from pyvista_vdi.generation.list_arrays import LISTS_PER_GROUP, SUPERSEGMENT_BYTES, GrowingLists
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.ray_forms import Floats, Rectangle, check_list_space, packed
from pyvista_vdi.volume.bricks import StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import GridRays, RayLaunch

#: Steps of a ray between two looks at the length of its record.
CHUNK_STEPS = 128
#: The same before the first look: few, so that rays which cannot keep every detail learn it soon.
_FIRST_CHUNK_STEPS = 64
#: Tiles across a window, and at least as many up it, in each of which the longest ray is found.
_TILES = 16
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
    of records, lists and all else but the volume, and ``text`` says of what, for messages.
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
        width, height = size
        most = _SLICE_BYTES
        if not runtime.is_cpu:
            most = max(most, runtime.info.global_memory // _SLICES_IN_GPU)
        if options.memory_limit is not None:
            most = min(most, options.memory_limit // _SLICES_IN_LIMIT)
        per_block_row = block_items(width, 4) * self.capacity * _RUN_BYTES
        self.rows = min(height, 4 * max(1, most // per_block_row))
        self.items = block_items(width, self.rows)
        lists = self.rows * width
        arrays = lists * (limit * SUPERSEGMENT_BYTES + 8) + 8 + 8 * -(-lists // LISTS_PER_GROUP)
        self.bytes = self.items * (self.capacity * _RUN_BYTES + 8) + arrays
        self.text = f"{self.rows} rows of {width} lists of up to {limit} supersegments"
        firsts = range(0, height, self.rows)
        self.parts = [Slice(n, y, min(self.rows, height - y)) for n, y in enumerate(firsts)]


class Records:
    """A ray per list, and the runs of like samples that are recorded along each of a slice's rays.

    ``rays`` are marched through the ``window``, all or part of V_O's window of ``size``, which
    ``slices`` cut. On the device are their ``forms``, their ``runs`` and merge ``errors``, the
    merge error that each accepts (``thresholds``: ``finest`` until its record has been full), and
    how many runs it has (``counts``). ``march`` has the rays in float64, ``view`` the numbers of a
    slice's rays (``RaysOfView``), ``recording`` those of the records, which are shortened to what
    is kept between chunks of a march. The caller releases buffers, which ``keep`` is given.
    """

    def __init__(
        self,
        runtime: Runtime,
        rays: GridRays,
        camera: Camera,
        size: tuple[int, int],
        slices: Slices,
        options: GenerationOptions,
        keep: Keep,
        window: Rectangle | None = None,
    ) -> None:
        check_list_space(camera, rays.grid.bounds)
        self.runtime, self.rays, self.size, self.slices = runtime, rays, size, slices
        self.window = window or Rectangle(0, size[0], 0, size[1])
        self.march = march = rays.forms(camera, size)
        self.depth_origin = march.rays.reference_depth
        self.finest = np.float32(options.finest_error)
        voxel = min(rays.grid.spacing)
        # Steps that a ray whose record has been full composites before it asks about homogeneity.
        # Measured: such a VDI's SSIM changes by less than .003 either way, and generation is up to
        # a fifth faster (docs/decisions). Rays that keep every detail are asked at every step. A
        # hair more, so that half a voxel divides a voxel twice whatever the rounding
        steps = voxel / rays.sample_distance * (1 + 1e-9)
        numbers = {
            "capacity": slices.capacity,
            "grain": int(max(1, min(steps, CHUNK_STEPS))),
            "window_row": self.window.y0,
            "finest": self.finest,
            "reference_length": voxel,
            # Of what V_O cannot see at all when neighbours are merged
            "hidden_weight": 1 - np.cos(np.radians(options.view_cone)),
        }
        self.recording = {**numbers, "limit": slices.kept}
        self._budget = {**numbers, "limit": options.max_supersegments}
        items, capacity = slices.items, slices.capacity
        self.forms = keep(runtime.upload(packed(march.forms), "rays", brief=True))
        self.runs = keep(runtime.buffer((items, capacity, RUN_WORDS), name="recorded runs"))
        self.errors = keep(runtime.buffer((items, capacity), name="merge errors"))
        self.thresholds = keep(runtime.buffer((items,), name="merge thresholds"))
        self.counts = keep(runtime.buffer((items,), np.uint32, "list lengths"))
        records: dict[str, Any] = {"forms": self.forms, "records": self.runs}
        self._shorten = RayLaunch(
            runtime,
            "generation/shorten_lists.cl",
            "shorten_lists",
            {},
            **records,
            thresholds=self.thresholds,
            errors=self.errors,
            counts=self.counts,
        )
        self._cut = None
        if options.criterion == "homogeneity":
            self._cut = runtime.bind(
                "generation/homogeneity.cl",
                "cut_lists",
                **records,
                counts=self.counts,
                recording=self._budget,
            )
        records |= {"double_float": march.double_float, "capacity": capacity}
        self._pack = runtime.bind("generation/pack_lists.cl", "pack_lists", **records)

    def begin(self, part: Slice) -> None:
        """Forget the slice before, and begin another."""
        x0, x1, y0, _ = self.window
        rows = Rectangle(x0, x1, y0 + part.first_row, y0 + part.first_row + part.rows)
        self.items = block_items(x1 - x0, part.rows)
        self.lists = part.rows * (x1 - x0)
        self.view = self.rays.view(self.size, self.march.planes, rows)
        self.runtime.fill(self.counts, np.uint32(0))
        self.runtime.fill(self.thresholds, self.finest)

    def make_room(self, *, last: bool = False) -> None:
        """Fit records without room for another chunk of steps, behind the last one if it must be.

        What is least unlike is merged, and such a ray's threshold is raised. By the criterion
        least-error, :meth:`fit` does it behind the last chunk.
        """
        if self._cut is not None or not last:
            self._shorten(self.items, view=self.view, recording=self.recording, exactly=False)

    def fit(self) -> None:
        """Merge where the error is least, or cut by homogeneity, until the budget is kept."""
        if self._cut is None:
            self._shorten(self.items, view=self.view, recording=self._budget, exactly=True)
        else:
            self._cut(self.items, GROUP, view=self.view)

    def pack(self, lists: GrowingLists) -> None:
        """Write the slice's lists behind those made before; what is launched next need not wait."""
        places = lists.follow(self.counts, self.lists)
        self._pack(self.items, GROUP, view=self.view, **places)


class March:
    """Marches the rays of slices, a chunk of steps at a time.

    ``entering``: the light that enters part of a grid along each ray of the window, 0 to 1. No ray
    has more than ``most_steps``.
    """

    def __init__(
        self,
        records: Records,
        medium: DeviceVolume,
        camera: Camera,
        keep: Keep,
        entering: DeviceBuffer | None = None,
    ) -> None:
        self._records, self.most_steps, bricks = records, medium.most_steps, medium.bricks
        runtime, arguments = records.runtime, medium.medium_arguments(camera)
        # Opacity is summed up from 0 in every run
        compensated = 2 if medium.variant.compensated > 1 else 0
        variant = replace(
            medium.variant, double_float=records.march.double_float, compensated=compensated
        )
        self._longest = self._longest_rays(arguments["classified"], medium.rays.sample_distance)
        self._sampler = None
        if bricks is not None:
            forms, room = records.forms, records.slices.items * CHUNK_STEPS
            self._sampler = StepSampler(runtime, bricks, arguments, variant, forms, room, keep)
        self._launch = RayLaunch(
            runtime,
            "generation/march_lists.cl",
            "march_lists",
            variant.defines,
            one_by_one=variant.one_by_one or bricks is not None,
            **arguments,
            forms=records.forms,
            samples=self._sampler and self._sampler.samples,
            recording=records.recording,
            entering=entering,
            thresholds=records.thresholds,
            records=records.runs,
            counts=records.counts,
        )

    def chunks(self, part: Slice) -> list[range]:
        """Return the steps up to the end of a slice's longest ray, in chunks."""
        found: list[range] = []
        first, steps = 0, _FIRST_CHUNK_STEPS
        while first < min(self.most_steps, self._longest[part.number]):
            found.append(range(first, first + steps))
            first, steps = first + steps, CHUNK_STEPS
        return found

    def advance(self, chunk: range) -> None:
        """Sample a chunk of steps, and merge them with the last runs where they are alike."""
        records = self._records
        records.view["first_step"], records.view["steps"] = chunk.start, len(chunk)
        if self._sampler is not None:
            self._sampler.sample(records.view)
        self._launch(records.items, view=records.view)

    def _longest_rays(self, classified: Mapping[str, Any], sample_distance: float) -> Floats:
        """Return the most steps of the rays of each slice: chunks behind them have nothing.

        The window is cut into tiles. In one of them a ray comes to a face of the volume no earlier
        or later than at the corners, unless some of the tile's rays do not move towards it.
        """
        records = self._records
        (x0, x1, y0, y1), (width, height) = records.window, records.size
        slices, rows = len(records.slices.parts), records.slices.rows
        high = -(-_TILES // slices)  # tiles in a slice
        y = np.minimum(y0 + np.arange(slices * high + 1) * rows / high, y1) - height / 2
        b, a = np.meshgrid(y, np.linspace(x0, x1, _TILES + 1) - width / 2, indexing="ij")
        forms = np.reshape(records.march.forms[:6], (2, 3, 2, 3))
        at = np.tensordot(forms, [np.ones_like(a), a, b], 1)
        start, slope, speed = at[0, :, 0], at[0, :, 1], np.linalg.norm(at[1, :, 1], axis=0)
        first, size = (np.reshape(classified[of][:3], (3, 1, 1)) for of in ("part_first", "size"))
        corners, over = partial(sliding_window_view, window_shape=(2, 2), axis=(-2, -1)), (-2, -1)
        # A voxel on either side is for what float32 rounds, as are a thousandth and two steps more
        with np.errstate(all="ignore"):
            faces = np.sort([(first - 1 - start) / slope, (first + size - start) / slope], axis=0)
            moves = corners(slope).min(over) * corners(slope).max(over) > 0
            near = np.where(moves, corners(faces[0]).min(over), 0).max(axis=0, initial=0)
            far = np.where(moves, corners(faces[1]).max(over), np.inf).min(axis=0)
            steps = 1.001 * (far - near) * corners(speed).max(over) / sample_distance + 2
        return steps.reshape(slices, -1).max(axis=1)
