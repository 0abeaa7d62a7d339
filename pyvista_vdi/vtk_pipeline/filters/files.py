"""``VDIReader`` and ``VDIWriter``: files at the ends of a VTK pipeline."""

from __future__ import annotations

import os
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkImageData

from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.io import checked_target, read, read_info
from pyvista_vdi.model.vdi import picture_size
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm, accessors, announce
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image


def _as_path(path: str | os.PathLike[str] | None) -> str | None:
    return os.fspath(path) if path else None


class VDIReader(Algorithm):
    """Read a VDI from a ``.vdi`` file or an OpenEXR deep image.

    Out comes the VDI in its canonical VTK form, see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`.

    Notes
    -----
    Python's ``Update`` raises what went wrong; an update that VTK asks for writes it to VTK's
    output window and gives an empty image.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self._path: str | None = None

    SetFileName, GetFileName = accessors(
        "FileName", "_path", "path", "Set the file.", "Return the file.", _as_path
    )

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent: one point per list; reads the file's description only."""
        try:
            about = read_info(self._path) if self._path else None
        except (VDIError, OSError):  # RequestData says it
            about = None
        self.picture_size = picture_size(about.window_size, about.metadata) if about else None
        announce(outputs, about.window_size if about else (1, 1))
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._path is None:
            raise InvalidArgumentError("VDIReader has no file name: call SetFileName(path)")
        vtkImageData.GetData(outputs, 0).ShallowCopy(vdi_to_image(read(self._path)))


class VDIWriter(Algorithm):
    """Write the VDI at its input, in its canonical VTK form, to a ``.vdi`` or ``.exr`` file.

    The file appears whole or not at all. Nothing is written before :meth:`Write`.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, inputType="vtkImageData", nOutputPorts=0)
        self._path: str | None = None

    def SetInputData(self, image: vtkImageData) -> None:
        """Set the VDI's canonical VTK form."""
        self.SetInputDataObject(image)

    SetFileName, GetFileName = accessors(
        "FileName",
        "_path",
        "path",
        "Set the file; its name ends in ``.vdi`` or ``.exr``.",
        "Return the file.",
        _as_path,
    )

    def Write(self) -> None:
        """Write the file.

        Raises
        ------
        InvalidArgumentError
            If there is no file name, or it names no format.
        InvalidVDIError
            If the input is no VDI.
        OSError
            If it cannot be written.
        """
        self.Modified()
        self.Update()

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._path is None:
            raise InvalidArgumentError("VDIWriter has no file name: call SetFileName(path)")
        target = checked_target(self._path)
        vdi_from_image(vtkImageData.GetData(inputs[0], 0)).save(target)
