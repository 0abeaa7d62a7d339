"""The second step: neighbouring runs are merged until each ray's record keeps the budget."""

from __future__ import annotations

import numpy as np

from pyvista_vdi.device.steps import Step
from pyvista_vdi.generation.march import Chunk
from pyvista_vdi.generation.records import Records
from pyvista_vdi.generation.slices import Slice
from pyvista_vdi.model.options import GenerationOptions


class Merge:
    """Shortens the records of a slice, between chunks of the march and to the budget."""

    def __init__(self, records: Records, options: GenerationOptions) -> None:
        self._records = records
        self._limit = options.max_supersegments
        runtime, defines = records.runtime, records.of_rays
        path = "generation/shorten_lists.cl"
        self._shorten_step = Step.of(
            runtime, path, "shorten_lists", defines, in_blocks=runtime.is_cpu
        )
        self._cut = None
        if options.criterion == "homogeneity":
            self._cut = Step.of(runtime, "generation/homogeneity.cl", "cut_lists", defines)

    def make_room(self, part: Slice, chunk: Chunk) -> None:
        """Merge what is least unlike in records without room for another chunk.

        Such a ray's threshold is raised. What follows the last chunk does it at least error.
        """
        if self._cut is not None or not chunk.last:
            self.shorten(part)

    def shorten(self, part: Slice) -> None:
        """Merge what is least unlike in records that are longer than is kept."""
        self._shorten(part, self._records.slices.kept, exactly=False)

    def to_budget(self, part: Slice) -> None:
        """Merge at least error, or cut by homogeneity, until the budget is kept."""
        if self._cut is None:
            self._shorten(part, self._limit, exactly=True)
            return
        records = self._records
        records.launch(
            self._cut,
            part,
            np.int32(self._limit),
            *records.place(part),
            records.forms,
            np.int32(records.slices.capacity),
            *records.weights,
            records.finest,
            records.runs,
            records.counts,
        )

    def _shorten(self, part: Slice, limit: int, *, exactly: bool) -> None:
        """Bring records to at most so many runs: least error first, or by raised thresholds."""
        records = self._records
        records.launch(
            self._shorten_step,
            part,
            np.int32(limit),
            np.int32(exactly),
            *records.place(part),
            records.forms,
            np.int32(records.slices.capacity),
            *records.weights,
            records.thresholds,
            records.runs,
            records.errors,
            records.counts,
        )
