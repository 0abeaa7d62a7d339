"""The first step: rays are marched through the volume, and runs of like samples are recorded."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer
from pyvista_vdi.device.steps import Step
from pyvista_vdi.device.work_order import block_items
from pyvista_vdi.generation.records import Records
from pyvista_vdi.generation.slices import CHUNK_STEPS, Slice
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.volume.bricks import StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.march_step import march_step

#: Steps of a ray before the first look at the length of its record: few, so that rays which cannot
#: keep every detail learn it soon.
_FIRST_CHUNK_STEPS = 64


class Chunk(NamedTuple):
    """Steps that all rays of a slice march before their records are looked at."""

    first_step: int
    steps: int
    last: bool


class March:
    """Marches the rays of slices, a chunk of steps at a time.

    ``entering``: the light that enters part of a grid along each ray of the window, 0 to 1.
    """

    def __init__(
        self,
        records: Records,
        medium: DeviceVolume,
        camera: Camera,
        entering: DeviceBuffer | None = None,
    ) -> None:
        self._records = records
        self._medium = medium
        self._camera = camera
        # Steps that a ray whose record has been full composites before it asks about homogeneity.
        # Measured: such a VDI's SSIM changes by less than .003 either way, and generation is up to
        # a fifth faster (docs/decisions). Rays that keep every detail are asked at every step. A
        # hair more, so that half a voxel divides a voxel twice whatever the rounding
        voxel = min(medium.grid.spacing) / medium.sample_distance * (1 + 1e-9)
        self._grain = np.int32(max(1, min(voxel, CHUNK_STEPS)))
        self._entering: tuple[Any, ...] = ()
        if entering is not None:
            self._entering = (np.int32(records.window.y0), entering)
        self._step = _step_for(records, "march_lists")
        with ExitStack() as stack:
            self._sampler = None
            if medium.bricks is not None:
                self._sampler = stack.enter_context(
                    StepSampler(
                        records.runtime,
                        medium.bricks,
                        medium.medium_arguments(camera),
                        records.of_medium,
                        records.march,
                        records.size,
                        records.slices.items * CHUNK_STEPS,
                    )
                )
            self._longest = self._longest_rays()
            self._buffers = stack.pop_all()

    def __enter__(self) -> March:
        return self

    def __exit__(self, *_: object) -> None:
        self._buffers.close()

    def chunks(self, part: Slice) -> Iterator[Chunk]:
        """Yield the chunks that reach the end of a slice's longest ray."""
        first, steps, most = 0, _FIRST_CHUNK_STEPS, self._medium.most_steps
        while first < min(most, self._longest[part.number]):
            yield Chunk(first, steps, first + steps >= most)
            first, steps = first + steps, CHUNK_STEPS

    def advance(self, part: Slice, chunk: Chunk) -> None:
        """March a chunk of steps, and append to the records what is not like their last run."""
        records, medium = self._records, self._medium
        sampled: tuple[Any, ...] = ()
        if self._sampler is not None:
            sampled = self._sampler.sample(part.first_row, part.rows, chunk.first_step, chunk.steps)
        records.launch(
            self._step,
            part,
            *medium.medium_arguments(self._camera),
            *sampled,
            *records.march,
            *records.place(part),
            np.int32(chunk.first_step),
            np.int32(chunk.steps),
            self._grain,
            records.finest,
            np.int32(records.slices.capacity),
            *records.weights,
            *self._entering,
            records.thresholds,
            records.runs,
            records.counts,
        )

    def _longest_rays(self) -> NDArray[np.int32]:
        """Return the steps of the longest ray of each slice: chunks behind them have nothing."""
        records = self._records
        runtime, window = records.runtime, records.window
        step = _step_for(records, "longest_marches")
        columns, rows = window.x1 - window.x0, window.y1 - window.y0
        of_part = self._medium.medium_arguments(self._camera) if self._entering else ()
        place = (*records.size, window.x0, columns, window.y0, rows, records.slices.rows)
        with runtime.buffer((len(records.slices),), np.int32, "longest rays") as longest:
            runtime.fill(longest, np.int32(0))
            step.launch(
                runtime,
                block_items(columns, rows),
                *of_part,
                *records.march,
                *(np.int32(n) for n in place),
                longest,
            )
            return runtime.download(longest)


def _step_for(records: Records, name: str) -> Step:
    """Return a kernel that marches, one that follows blocks of rays where they can be."""
    # COMPENSATED=1 changes no march that records
    defines = {k: v for k, v in records.of_medium.items() if (k, v) != ("COMPENSATED", 1)}
    return march_step(records.runtime, "generation/march_lists.cl", name, defines)
