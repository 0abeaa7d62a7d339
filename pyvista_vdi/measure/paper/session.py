"""The run: data set by data set, window by window, VDI by VDI, and view by view."""

from __future__ import annotations

import time
from contextlib import closing
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.measure.clock import Times, take_turns
from pyvista_vdi.measure.paper.datasets import Dataset, find_dataset, label_of, require_allocation
from pyvista_vdi.measure.paper.plan import Plan
from pyvista_vdi.measure.paper.preview import measure_preview
from pyvista_vdi.measure.paper.results import Results
from pyvista_vdi.measure.report import across
from pyvista_vdi.measure.session import (
    Bench,
    Progress,
    Steps,
    VDIRenderer,
    accuracy,
    refusal,
    sizes_of,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume


def run(plan: Plan, results: Results, device: Any = None, progress: Progress | None = None) -> None:
    """Measure what is missing, and write the file after every row.

    A volume or VDI that the host or the device cannot hold gives rows that are marked as refused,
    with the reason.

    Parameters
    ----------
    plan : Plan
        What is measured.
    results : Results
        Where it goes; rows that are there are not measured again.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the finished fraction and what is being done.
    """
    _Run(plan, results, get_runtime(device), progress).everything()


class _Run:
    def __init__(
        self, plan: Plan, results: Results, runtime: Runtime, progress: Progress | None
    ) -> None:
        self._plan, self._results, self._runtime = plan, results, runtime
        self._measured = [label_of(name) for name in plan.datasets]
        self._previewed = None if plan.preview is None else label_of(plan.preview[0])
        # In the order of the plan; that of Table 2 last where it is no other's
        names = [*plan.datasets, *([plan.preview[0]] if plan.preview else [])]
        self._datasets = [find_dataset(name, plan.seed) for name in dict.fromkeys(names)]
        rows = sum(self._missing(dataset.name) for dataset in self._datasets)
        self._step = Steps(progress, rows)

    def everything(self) -> None:
        """Measure what is missing."""
        for dataset in self._datasets:
            if self._missing(dataset.name):
                self._dataset(dataset)
        self._results.save()

    def _cells(self, name: str) -> list[tuple[tuple[int, int], int]]:
        return list(self._plan.cells()) if name in self._measured else []

    def _missing(self, name: str) -> int:
        """Return how many rows of a data set are not there yet."""
        rows = sum(
            self._results.missing_angles(self._plan, name, *cell) for cell in self._cells(name)
        )
        return rows + int(self._preview_missing(name))

    def _preview_missing(self, name: str) -> bool:
        return name == self._previewed and not self._results.data["previews"]

    def _dataset(self, dataset: Dataset) -> None:
        """Measure a data set, or mark its rows as refused."""
        name = dataset.name
        try:
            require_allocation(self._runtime, dataset)
            begin = time.perf_counter()
            volume = dataset.load(lambda fraction: self._step(f"{name}: making it"))
            seconds = time.perf_counter() - begin
        except (VDIError, MemoryError) as error:
            self._refuse(name, self._cells(name), error)
            return
        described = {**dataset.describe(volume), "load_seconds": seconds}
        self._results.data["datasets"][name] = described
        table = dataset.transfer_function(volume, self._plan.interpolation)
        for size in dict.fromkeys(size for size, _ in self._cells(name)):
            self._window(name, volume, table, size)
        if self._preview_missing(name):
            self._table2(name, volume, table)

    def _refuse(
        self, name: str, cells: list[tuple[tuple[int, int], int]], error: BaseException
    ) -> None:
        reason = refusal(error)
        for size, limit in cells:
            rows = self._results.missing_angles(self._plan, name, size, limit)
            if rows:
                self._results.new_cell(name, size, limit)["refused"] = reason
            self._step(f"{name}: refused", finished=rows)
        if self._preview_missing(name):
            self._results.data["previews"].append(self._preview_entry(reason))
            self._step(f"{name}: refused", finished=1)
        self._results.save()

    def _window(
        self, name: str, volume: Volume, table: TransferFunction, size: tuple[int, int]
    ) -> None:
        limits = [
            limit
            for limit in self._plan.limits
            if self._results.missing_angles(self._plan, name, size, limit)
        ]
        if not limits:
            return
        try:
            bench = Bench(self._runtime, volume, table, size, self._plan.vtk)
        except (VDIError, MemoryError) as error:
            self._refuse(name, [(size, limit) for limit in limits], error)
            return
        with closing(bench):
            if bench.opengl is not None:
                self._results.data["system"]["opengl"] = bench.opengl
            for limit in limits:
                try:
                    self._cell(name, limit, bench)
                except (VDIError, MemoryError) as error:
                    self._refuse(name, [(size, limit)], error)

    def _cell(self, name: str, limit: int, bench: Bench) -> None:
        doing = f"{name}, {across(bench.size)}, N_S {limit}"
        self._step(f"{doing}: generating")
        vdi, seconds = self._generated(bench, limit)
        cell = self._results.new_cell(name, bench.size, limit)
        if cell["vdi"] is None:
            cell["vdi"] = {"generation_seconds": seconds, **sizes_of(vdi)}
        draw = VDIRenderer(self._runtime, vdi, bench.size)
        there = {row["angle"] for row in cell["angles"]}
        for angle in self._plan.angles:
            if angle in there:
                continue
            self._step(f"{doing}: {angle:g} degrees")
            cell["angles"].append(self._row(angle, draw, bench))
            cell["angles"].sort(key=lambda row: row["angle"])
            cell["left_out"] = dict(bench.left_out)
            self._results.save()
            self._step(doing, finished=1)

    def _generated(self, bench: Bench, limit: int) -> tuple[VDI, Times]:
        """Generate the VDI as often as is timed."""
        made, seconds = bench.generate(
            bench.view,
            bench.size,
            self._plan.generations,
            max_supersegments=limit,
            sample_distance=bench.step,
        )
        return made["exact"], seconds["generate"]

    def _row(self, angle: float, draw: VDIRenderer, bench: Bench) -> dict[str, Any]:
        """Compare the pictures of one view, and time everybody's frames."""
        camera = bench.view.azimuth(angle)
        reference, vtk_accuracy = bench.reference(camera, angle)
        frames = {**draw.frames(camera), **bench.frames(camera)}
        return {
            "angle": angle,
            "vdi_to_volume": accuracy(draw.image(camera), reference),
            "volume_to_vtk_gpu": vtk_accuracy,
            "seconds": take_turns(frames, self._plan.repeats, runtime=self._runtime),
        }

    def _table2(self, name: str, volume: Volume, table: TransferFunction) -> None:
        assert self._plan.preview is not None
        _, size, limit, angle = self._plan.preview
        self._step(f"{name}: previews at target rates")
        entry = self._preview_entry(None)
        try:
            bench = Bench(self._runtime, volume, table, size, vtk=False)
            vdi, _ = self._generated(bench, limit)
            draw = VDIRenderer(self._runtime, vdi, size)
            camera = bench.view.azimuth(angle)
            reference = bench.image(camera)
            frames = draw.frames(camera)
            full = take_turns(frames, self._plan.repeats, runtime=self._runtime)["vdi_skipping"]
            to_volume = accuracy(draw.image(camera), reference)
            entry["full"] = {"seconds": full, "to_volume": to_volume}
            entry["rows"] = measure_preview(draw, camera, size, full, reference)
        except (VDIError, MemoryError) as error:
            entry["refused"] = refusal(error)
        self._results.data["previews"].append(entry)
        self._results.save()
        self._step(f"{name}: previews", finished=1)

    def _preview_entry(self, reason: str | None) -> dict[str, Any]:
        entry = self._plan.to_dict()["preview"]
        return {**entry, "refused": reason, "full": None, "rows": []}
