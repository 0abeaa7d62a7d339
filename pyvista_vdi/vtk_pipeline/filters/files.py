"""``VDIReader`` and ``VDIWriter``: files at the ends of a VTK pipeline."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, VDIError, VDIFileError
from pyvista_vdi.io import checked_target, read, read_info
from pyvista_vdi.io.files import format_of, holds
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_any_vdi
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.vdi import picture_size
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    Algorithm,
    announce,
    announce_times,
    ask_for_all,
    wanted_time,
)
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image
from pyvista_vdi.vtk_pipeline.filters.temporal import StepSequence, steps_and_times
from pyvista_vdi.vtk_pipeline.vtk import vtkDataObject, vtkImageData


def _as_path(path: str | os.PathLike[str] | None) -> str | None:
    return os.fspath(path) if path else None


class VDIReader(Algorithm):
    """Read a VDI from a ``.vdi`` file or an OpenEXR deep image, or the steps of a ``.vdis`` series.

    Out comes the VDI in its canonical VTK form, see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`. Of a series the times are
    announced (``TIME_STEPS``, ``TIME_RANGE``), and out comes the step nearest to the time that is
    asked for (``UPDATE_TIME_STEP``), the first one where none is; its own time is the output's
    ``DATA_TIME_STEP``.

    Notes
    -----
    Python's ``Update`` raises what went wrong; an update that VTK asks for writes it to VTK's
    output window and gives an empty image. Python's ``Update``, ``UpdateTimeStep`` and
    ``UpdateInformation`` look whether the file is another by now, as a folder's that grows.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._path: str | None = None
        self._series: VDICollection | None = None
        self._seen: Any = None

    def SetFileName(self, path: str | os.PathLike[str] | None) -> None:
        """Set the file."""
        self._change("_path", _as_path(path))

    def GetFileName(self) -> str | None:
        """Return the file."""
        return self._path

    def GetSeries(self) -> VDICollection:
        """Return the series of a ``.vdis`` path, with the steps that are finished by now.

        Raises
        ------
        VDIFileError
            If the file is no readable series.
        """
        self.UpdateInformation()
        if holds(self._path) != "series":
            raise VDIFileError(f"{self._path} is not a series of VDIs: name a .vdis file")
        return read(self._path or "") if self._series is None else self._series  # type: ignore[no-any-return]

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong."""
        self._look_at_file()
        super().Update(*args)

    def UpdateInformation(self) -> None:
        """Bring up to date what is announced."""
        self._look_at_file()
        super().UpdateInformation()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce times, and the extent: one point per list; reads the file's description only."""
        about: Any = None
        self._series = None
        with suppress(VDIError, OSError):  # RequestData says it
            if self._path:
                about = read_info(self._path)
                self._series = read(self._path) if holds(self._path) == "series" else None
        self.picture_size = picture_size(about.window_size, about.metadata) if about else None
        announce(outputs, about.window_size if about else (1, 1))
        announce_times(outputs, () if self._series is None else self._series.times or ())
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._path is None:
            raise InvalidArgumentError("VDIReader has no file name: call SetFileName(path)")
        image = vtkImageData.GetData(outputs, 0)
        if holds(self._path) != "series":
            image.ShallowCopy(vdi_to_image(as_any_vdi(read(self._path))))
            return
        # What is wrong with it is raised by opening it again
        series: Any = read(self._path) if self._series is None else self._series
        time = wanted_time(outputs.GetInformationObject(0))
        step = 0 if time is None else series.nearest(time)
        vdi = as_any_vdi(series[step])
        announce(outputs, vdi.window_size)
        ask_for_all([outputs])
        image.ShallowCopy(vdi_to_image(vdi))
        image.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), series.times[step])

    def _look_at_file(self) -> None:
        """Be out of date if the file is another by now."""
        if self._path is None:
            return
        try:
            path = Path(self._path)
            form = format_of(path) if path.is_dir() else None
            found = (path if form is None else path / form.head).stat()
            seen = (self._path, found.st_ino, found.st_size, found.st_mtime_ns)
        except (OSError, ValueError):
            seen = None
        if seen != self._seen:
            self._seen = seen
            self.Modified()


class VDIWriter(Algorithm):
    """Write the VDI at its input, in its canonical VTK form, to a ``.vdi`` or ``.exr`` file.

    To a ``.vdis`` file it writes those of all times that the input announces, one by one, in the
    8-byte form unless :meth:`SetPrecision` says otherwise. The file appears whole or not at all.
    Nothing is written before :meth:`Write`.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, inputType="vtkImageData", nOutputPorts=0)
        self._path: str | None = None
        self._precision: str | None = None
        self._compression: str | None = None

    def SetInputData(self, image: vtkImageData) -> None:
        """Set the VDI's canonical VTK form."""
        self.SetInputDataObject(image)

    def SetFileName(self, path: str | os.PathLike[str] | None) -> None:
        """Set the file; its name ends in ``.vdi``, ``.exr`` or ``.vdis``."""
        self._change("_path", _as_path(path))

    def GetFileName(self) -> str | None:
        """Return the file."""
        return self._path

    def SetPrecision(self, precision: str | None) -> None:
        """Set what a supersegment takes: ``"exact"`` or ``"8-byte"``.

        By default, ``None``, steps of a ``.vdis`` take 8 bytes, and all else is exact, as with
        :meth:`VDI.save`. ``.exr`` files have float32.
        """
        self._change("_precision", None if precision is None else check_precision(precision))

    def GetPrecision(self) -> str | None:
        """Return what a supersegment takes; ``None``: what is usual for the file."""
        return self._precision

    def SetCompression(self, compression: str | None) -> None:
        """Set the compression, as of :meth:`VDI.save`; ``None``: the file's usual one."""
        self._change("_compression", compression)

    def GetCompression(self) -> str | None:
        """Return the compression; ``None``: the file's usual one."""
        return self._compression

    def Write(self) -> None:
        """Write the file.

        Raises
        ------
        InvalidArgumentError
            If there is no file name; or it is that of a series, and the input has no times; or an
            option is not one of the file's format.
        InvalidVDIError
            If there is no input, or it is no VDI.
        VDIFileError
            If the file's name ends in no format's, or it cannot be written.
        """
        found = format_of(self._path)
        if found is not None and found.holds == "series" and self.GetNumberOfInputConnections(0):
            images, times = steps_and_times(self.GetInputAlgorithm(0, 0))
            vdis = StepSequence(lambda i: vdi_from_image(images[i]), len(times))
            options = {"precision": "8-byte", **self._options()}
            series = registry.load(registry.names()["VDISeries"])(vdis, times)
            series.save(self._path, **options)
            return
        self.Modified()
        self.Update()

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._path is None:
            raise InvalidArgumentError("VDIWriter has no file name: call SetFileName(path)")
        target = checked_target(self._path)
        vdi_from_image(vtkImageData.GetData(inputs[0], 0)).save(target, **self._options())

    def _options(self) -> dict[str, Any]:
        """Return the options of the file that were set."""
        given = {"precision": self._precision, "compression": self._compression}
        return {name: value for name, value in given.items() if value}
