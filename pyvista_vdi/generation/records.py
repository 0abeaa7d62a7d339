"""What is recorded of a slice's rays on a device, how it is fitted to the budget, and packed."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.constants import RUN_WORDS
from pyvista_vdi.device.work_order import GROUP, block_items
from pyvista_vdi.generation.kernels import (
    CUT_LISTS,
    PACK_LISTS,
    RECORDING,
    SHORTEN_LISTS,
    SHORTEN_LISTS_16,
)
from pyvista_vdi.generation.list_arrays import GrowingLists
from pyvista_vdi.generation.slices import CHUNK_STEPS, Slice, Slices
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.ray_forms import Rectangle, check_list_space
from pyvista_vdi.volume.rays import GridRays
from pyvista_vdi.volume.variant import RayLaunch

#: Merge error that no picture shows: a difference of a thousandth of full opacity over one voxel.
_INDISTINGUISHABLE = 1e-6


class Records:
    """A ray per list, and the runs of like samples that are recorded along each of a slice's rays.

    Attributes
    ----------
    size : (int, int)
        Of V_O's window.
    slices : Slices
        What ``window`` is cut into.
    window : Rectangle
        Part of V_O's window, or all of it.
    rays : GridRays
        What the rays are marched through.
    planes, double_float, depth_origin
        Of the rays, see :class:`~pyvista_vdi.volume.rays.MarchForms`.
    forms, runs, errors, thresholds, counts : DeviceBuffer
        The rays; their runs and merge errors; the merge error that each accepts, ``finest`` until
        its record has been full; and how many runs it has.
    view : numpy.ndarray
        The numbers of a slice's rays (``kernels.RAYS``), of :meth:`begin`.
    recording : numpy.ndarray
        Those of the records (``kernels.RECORDING``), which are shortened to what is kept between
        chunks of a march.
    """

    def __init__(
        self,
        runtime: Runtime,
        rays: GridRays,
        camera: Camera,
        size: tuple[int, int],
        slices: Slices,
        options: GenerationOptions,
        window: Rectangle | None = None,
    ) -> None:
        check_list_space(camera, rays.grid.bounds)
        self.runtime, self.rays, self.size, self.slices = runtime, rays, size, slices
        self.window = window or Rectangle(0, size[0], 0, size[1])
        march = rays.forms(camera, size)
        self.planes, self.double_float = march.planes, march.double_float
        self.depth_origin = march.rays.reference_depth
        # Differences stay below 1e18, whose square float32 still holds
        self.finest = np.float32(max(min(options.tolerance, 1e18) ** 2, _INDISTINGUISHABLE))
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
            "hidden_weight": options.hidden_weight,
        }
        self.recording = RECORDING(**numbers, limit=slices.kept)
        self._budget = RECORDING(**numbers, limit=options.max_supersegments)
        items, capacity = slices.items, slices.capacity
        with ExitStack() as stack:
            keep = stack.enter_context
            self.forms = keep(runtime.upload(march.packed(), "rays"))
            self.runs = keep(runtime.buffer((items, capacity, RUN_WORDS), name="recorded runs"))
            self.errors = keep(runtime.buffer((items, capacity), name="merge errors"))
            self.thresholds = keep(runtime.buffer((items,), name="merge thresholds"))
            self.counts = keep(runtime.buffer((items,), np.uint32, "list lengths"))
            self._buffers = stack.pop_all()
        self.defines = {"DOUBLE_FLOAT_RAYS": march.double_float}
        records: dict[str, Any] = {"forms": self.forms, "records": self.runs}
        self._shorten = RayLaunch(
            runtime,
            SHORTEN_LISTS,
            SHORTEN_LISTS_16,
            self.defines,
            **records,
            thresholds=self.thresholds,
            errors=self.errors,
            counts=self.counts,
        )
        self._cut = None
        if options.criterion == "homogeneity":
            records["counts"] = self.counts
            self._cut = runtime.bind(CUT_LISTS, self.defines, **records, recording=self._budget)
            del records["counts"]
        self._pack = runtime.bind(PACK_LISTS, self.defines, **records, capacity=capacity)

    def __enter__(self) -> Records:
        return self

    def __exit__(self, *_: object) -> None:
        self.runtime.finish()  # the forms may be host memory that the device still reads
        self._buffers.close()

    def begin(self, part: Slice) -> None:
        """Forget the slice before, and begin another."""
        x0, x1, y0, _ = self.window
        rows = Rectangle(x0, x1, y0 + part.first_row, y0 + part.first_row + part.rows)
        self.items = block_items(x1 - x0, part.rows)
        self.lists = part.rows * (x1 - x0)
        self.view: NDArray[Any] = self.rays.view(self.size, self.planes, rows)
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
