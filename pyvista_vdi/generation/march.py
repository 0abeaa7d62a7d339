"""The first steps: rays are marched through the volume, and like samples are recorded as runs."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer
from pyvista_vdi.device.work_order import block_items
from pyvista_vdi.generation.kernels import (
    LONGEST_MARCHES,
    LONGEST_MARCHES_16,
    MARCH_LISTS,
    MARCH_LISTS_16,
)
from pyvista_vdi.generation.records import Records
from pyvista_vdi.generation.slices import CHUNK_STEPS, Slice
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.volume.bricks import StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.variant import RayLaunch, Variant

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
        self._records, self._most_steps = records, medium.most_steps
        runtime, arguments = records.runtime, medium.medium_arguments(camera)
        # Opacity is summed up from 0 in every run
        compensated = 2 if medium.variant.compensated > 1 else 0
        variant = replace(
            medium.variant, double_float=records.double_float, compensated=compensated
        )
        bricks = medium.bricks is not None
        self._longest = self._longest_rays(arguments, variant, variant.one_by_one or bricks)
        with ExitStack() as stack:
            self._sampler = None
            if medium.bricks is not None:
                room = records.slices.items * CHUNK_STEPS
                sampler = StepSampler(
                    runtime, medium.bricks, arguments, variant, records.forms, room
                )
                self._sampler = stack.enter_context(sampler)
            self._launch = RayLaunch(
                runtime,
                MARCH_LISTS,
                MARCH_LISTS_16,
                variant.defines,
                one_by_one=variant.one_by_one or bricks,
                **arguments,
                forms=records.forms,
                samples=self._sampler and self._sampler.samples,
                recording=records.recording,
                entering=entering,
                thresholds=records.thresholds,
                records=records.runs,
                counts=records.counts,
            )
            self._buffers = stack.pop_all()

    def __enter__(self) -> March:
        return self

    def __exit__(self, *_: object) -> None:
        self._buffers.close()

    def chunks(self, part: Slice) -> list[Chunk]:
        """Return the chunks that reach the end of a slice's longest ray."""
        found: list[Chunk] = []
        first, steps, most = 0, _FIRST_CHUNK_STEPS, self._most_steps
        while first < min(most, self._longest[part.number]):
            found.append(Chunk(first, steps, first + steps >= most))
            first, steps = first + steps, CHUNK_STEPS
        return found

    def advance(self, chunk: Chunk) -> None:
        """Sample a chunk of steps, and merge them with the last runs where they are alike."""
        records = self._records
        records.view["first_step"], records.view["steps"] = chunk.first_step, chunk.steps
        if self._sampler is not None:
            self._sampler.sample(records.view)
        self._launch(records.items, view=records.view)

    def _longest_rays(
        self, medium: Mapping[str, Any], variant: Variant, one_by_one: bool
    ) -> NDArray[np.int32]:
        """Return the steps of the longest ray of each slice: chunks behind them have nothing."""
        records = self._records
        runtime, window = records.runtime, records.window
        with runtime.buffer((len(records.slices),), np.int32, "longest rays") as longest:
            runtime.fill(longest, np.int32(0))
            launch = RayLaunch(
                runtime,
                LONGEST_MARCHES,
                LONGEST_MARCHES_16,
                variant.defines,
                one_by_one=one_by_one,
                classified=medium["classified"],
                view=records.rays.view(records.size, records.planes, window),
                forms=records.forms,
                slice_rows=records.slices.rows,
                longest=longest,
            )
            launch(block_items(window.x1 - window.x0, window.y1 - window.y0))
            return runtime.download(longest)
