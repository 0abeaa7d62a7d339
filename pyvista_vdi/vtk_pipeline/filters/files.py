"""``VDIReader`` and ``VDIWriter``: files at the ends of a VTK pipeline."""

from __future__ import annotations

import os
from contextlib import suppress
from functools import partial
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.io import checked_target, read, read_info
from pyvista_vdi.io.files import holds
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.vdi import DeferredVDI, picture_view
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    PIPELINE,
    Algorithm,
    accessors,
    announce,
    ask_for_all,
    wanted_time,
)
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import vtkDataObject, vtkImageData


class VDIFileAlgorithm(Algorithm):
    """An algorithm with the name of a file."""

    SetFileName, GetFileName = accessors(
        "file_name",
        "the file's name: it ends in ``.vdi``, ``.exr`` or, of a series to read, ``.vdis``",
        check=lambda path: os.fspath(path) if path else None,
    )

    def _path(self) -> str:
        """Return the file's name, or raise that there is none."""
        path = self.GetFileName()
        if path is None:
            raise InvalidArgumentError(f"{type(self).__name__} has no file: call SetFileName(path)")
        return str(path)


class VDIReader(VDIFileAlgorithm):
    """Read a VDI from a ``.vdi`` file or an OpenEXR deep image, or the steps of a ``.vdis`` series.

    Out comes the VDI in its canonical VTK form, see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`. Of a series the times are
    announced (``TIME_STEPS``, ``TIME_RANGE``), and out comes the step nearest to the time that is
    asked for (``UPDATE_TIME_STEP``), the first one where none is; its own time is the output's
    ``DATA_TIME_STEP``.

    Notes
    -----
    Python's ``Update`` raises what went wrong; an update that VTK asks for writes it to VTK's
    output window and gives an empty image. ``Modified()`` has a file read again that is another
    by now.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._series: Any = None

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce times, and the extent: one point per list; reads the file's description only."""
        about: Any = None
        self._series = None
        with suppress(VDIError, OSError):  # RequestData says it
            path = self._path()
            about = read_info(path)
            self._series = read(path) if holds(path) == "series" else None
        self.picture_size = picture_view(about)[1] if about else None
        announce(outputs, about.window_size if about else (1, 1))
        times = () if self._series is None else self._series.times or ()
        information = outputs.GetInformationObject(0)
        ends = (times[0], times[-1]) if times else ()
        for key, told in ((PIPELINE.TIME_STEPS(), times), (PIPELINE.TIME_RANGE(), ends)):
            if told:
                information.Set(key, told, len(told))
            else:
                information.Remove(key)
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        image = vtkImageData.GetData(outputs, 0)
        if self._series is None:  # what is wrong with one is raised by reading it
            found = read(self._path())
            vdi = found if isinstance(found, DeferredVDI) else as_vdi(found)
            image.ShallowCopy(vdi_to_image(vdi))
            return
        time = wanted_time(outputs.GetInformationObject(0))
        step = 0 if time is None else self._series.nearest(time)
        vdi = self._series[step]
        announce(outputs, vdi.window_size)
        ask_for_all([outputs])
        image.ShallowCopy(vdi_to_image(vdi))
        image.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), self._series.times[step])


class VDIWriter(VDIFileAlgorithm):
    """Write the VDI at its input, in its canonical VTK form, to a ``.vdi`` or ``.exr`` file.

    The file appears whole or not at all. Nothing is written before :meth:`Write`.
    """

    SetPrecision, GetPrecision = accessors(
        "precision",
        "what a supersegment takes: ``'exact'`` or ``'8-byte'``; ``None``: as of the VDI",
        check=partial(one_of, name="precision", names=PRECISIONS, none=True),
    )
    SetCompression, GetCompression = accessors(
        "compression", "the compression, as of :meth:`VDI.save`; ``None``: the file's usual one"
    )

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, inputType="vtkImageData", nOutputPorts=0)

    def Write(self) -> None:
        """Write the file.

        Raises
        ------
        InvalidArgumentError
            If there is no file name, or an option is not one of the file's format.
        InvalidVDIError
            If there is no input, or it is no VDI.
        VDIFileError
            If the file's name ends in no format's, or it cannot be written.
        """
        self.Modified()
        self.Update()

    def _execute(self, inputs: Any, outputs: Any) -> None:
        target = checked_target(self._path())
        given = {"precision": self.GetPrecision(), "compression": self.GetCompression()}
        options = {name: value for name, value in given.items() if value}
        vdi_from_image(vtkImageData.GetData(inputs[0], 0)).save(target, **options)
