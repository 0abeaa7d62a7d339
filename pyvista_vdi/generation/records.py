"""What is recorded of a slice's rays on a device: the steps from march to pack work on it."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.constants import RUN_WORDS
from pyvista_vdi.device.ray_forms import check_list_space
from pyvista_vdi.device.steps import Step
from pyvista_vdi.device.work_order import Rectangle, block_items
from pyvista_vdi.generation.slices import Slice, Slices
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.volume.classified_volume import DeviceVolume, GridRays

#: Merge error that no picture shows: a difference of a thousandth of full opacity over one voxel.
_INDISTINGUISHABLE = 1e-6


class Records:
    """A ray per list, and the runs of like samples that are recorded along each of a slice's rays.

    ``of_medium`` and ``of_rays`` are what kernels that march, and those that take rays alone, are
    compiled with; ``march`` their arguments ``forms`` to ``unit_distance``, ``weights`` those of a
    merge error. ``runs`` come with their merge ``errors``, and with the number (``counts``) and the
    accepted merge error (``thresholds``) of each ray: ``finest`` until its record has been full.
    ``window`` is what the slices are cut of: part of V_O's window, or all of it.
    """

    def __init__(
        self,
        runtime: Runtime,
        medium: DeviceVolume | GridRays,
        camera: Camera,
        size: tuple[int, int],
        slices: Slices,
        options: GenerationOptions,
        window: Rectangle | None = None,
    ) -> None:
        check_list_space(camera, medium.grid.bounds)
        self.runtime, self.size, self.slices = runtime, size, slices
        self.window = window or Rectangle(0, size[0], 0, size[1])
        rays = medium.forms(camera, size)
        self.planes, self.depth_origin = rays.planes, rays.rays.reference_depth
        self.of_medium, self.of_rays = {**medium.defines, **rays.defines}, rays.defines
        # Differences stay below 1e18, whose square float32 still holds
        self.finest = np.float32(max(min(options.tolerance, 1e18) ** 2, _INDISTINGUISHABLE))
        voxel = min(medium.grid.spacing)
        self.weights = (np.float32(voxel), np.float32(options.hidden_weight))
        items, capacity = slices.items, slices.capacity
        with ExitStack() as stack:
            keep = stack.enter_context
            self.forms = keep(runtime.upload(rays.packed(), "rays"))
            self.runs = keep(runtime.buffer((items, capacity, RUN_WORDS), name="recorded runs"))
            self.errors = keep(runtime.buffer((items, capacity), name="merge errors"))
            self.thresholds = keep(runtime.buffer((items,), name="merge thresholds"))
            self.counts = keep(runtime.buffer((items,), np.uint32, "list lengths"))
            self._buffers = stack.pop_all()
        self.march = (
            self.forms,
            np.int32(self.planes),
            np.float32(medium.sample_distance),
            np.float32(medium.unit_distance),
        )

    def __enter__(self) -> Records:
        return self

    def __exit__(self, *_: object) -> None:
        self.runtime.finish()  # the forms may be host memory that the device still reads
        self._buffers.close()

    def clear(self) -> None:
        """Forget the slice before."""
        self.runtime.fill(self.counts, np.uint32(0))
        self.runtime.fill(self.thresholds, self.finest)

    def launch(self, step: Step, part: Slice, *arguments: Any) -> None:
        """Launch a step for the rays of a slice."""
        columns = self.window.x1 - self.window.x0
        step.launch(self.runtime, block_items(columns, part.rows), *arguments)

    def place(self, part: Slice) -> tuple[np.int32, ...]:
        """Return the arguments ``width`` to ``rows`` of the kernels that take a slice's rays."""
        window = self.window
        columns, first_row = window.x1 - window.x0, window.y0 + part.first_row
        place = (*self.size, window.x0, columns, first_row, part.rows)
        return tuple(np.int32(n) for n in place)
