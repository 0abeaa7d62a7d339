"""``pyvista.read`` of ``.vdis``: the steps of a series, each in its canonical VTK form."""

from __future__ import annotations

from typing import Any

import pyvista as pv

from pyvista_vdi.vtk_pipeline.filters.algorithm import UPDATE_TIME_STEP, wanted_time
from pyvista_vdi.vtk_pipeline.filters.files import VDIReader


class SeriesReader(pv.BaseReader, pv.TimeReader):  # type: ignore[type-arg]
    """Read the steps of a ``.vdis`` folder or file as PyVista reads any file with times.

    ``pyvista.get_reader("x.vdis")`` returns one from PyVista 0.49 on, and ``pyvista.read`` the
    first step. PyVista 0.48 knows readers of its own only: there call this class.

    Parameters
    ----------
    path : str or path-like
        The folder or file; FileNotFoundError is raised if there is none.
    """

    _class_reader = VDIReader

    def _set_directory(self, directory: Any) -> None:
        self._set_filename(directory)

    def read(self, **options: Any) -> pv.ImageData:
        """Return the active step, the first one before another is set; raise what is wrong."""
        self.reader.Update()  # raises, where PyVista's update would tell VTK's window
        return super().read(**options)

    @property
    def time_values(self) -> list[float]:
        """The steps' times; of a folder that is being written, those of the finished steps."""
        return list(self.reader.GetSeries().times)

    @property
    def number_time_points(self) -> int:
        """How many steps there are."""
        return len(self.time_values)

    def time_point_value(self, time_point: int) -> float:
        """Return the time of a step, by its index."""
        return self.time_values[time_point]

    @property
    def active_time_value(self) -> float:
        """The time of the step that :meth:`read` returns: the nearest to that which was set."""
        series, wanted = self.reader.GetSeries(), wanted_time(self._information)
        return float(series.times[0 if wanted is None else series.nearest(wanted)])

    def set_active_time_value(self, time_value: float) -> None:
        """Choose the step that is nearest to a time."""
        self._information.Set(UPDATE_TIME_STEP, float(time_value))

    def set_active_time_point(self, time_point: int) -> None:
        """Choose a step by its index."""
        self.set_active_time_value(self.time_point_value(time_point))

    @property
    def _information(self) -> Any:
        return self.reader.GetOutputInformation(0)


#: What PyVista is told to read ``.vdis`` by: 0.48 calls it and takes what it returns for data
read_series: Any = (
    SeriesReader if pv.version_info >= (0, 49) else lambda path: SeriesReader(path).read()
)
