"""The last step: a slice's lists are written into the VDI's arrays, one behind the other."""

from __future__ import annotations

from typing import Any

import numpy as np

from pyvista_vdi.device.steps import Step
from pyvista_vdi.generation.list_arrays import GrowingLists
from pyvista_vdi.generation.records import Records
from pyvista_vdi.generation.slices import Slice


class Pack:
    """Writes records as lists of supersegments."""

    def __init__(self, records: Records, lists: GrowingLists) -> None:
        self._records = records
        self._lists = lists
        path = "generation/pack_lists.cl"
        self._step = Step.of(records.runtime, path, "pack_lists", records.of_rays)

    def append(self, part: Slice) -> None:
        """Write the slice's lists behind those made before; what is launched next need not wait."""
        records, (width, height) = self._records, self._records.size
        entries: tuple[Any, ...] = ()
        if records.of_rays:  # depths count from where a ray enters
            of_slice = (np.int32(height), np.int32(records.window.y0 + part.first_row))
            entries = (records.forms, np.int32(records.planes), *of_slice)
        records.launch(
            self._step,
            part,
            records.runs,
            np.int32(records.slices.capacity),
            np.int32(width),
            np.int32(part.rows),
            *self._lists.follow(records.counts, part.rows * width),
            *entries,
        )
