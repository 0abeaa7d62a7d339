"""Files of volumes: PyVista's and VTK's readers, and the orientation that they drop."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    InvalidVolumeError,
    UnsupportedError,
    VDIError,
    warn_external,
    with_article,
)
from pyvista_vdi.plotting.dicom import Slice, read_slice, require_uncompressed, slices_of, values_of
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkDICOMImageReader,
    vtkMetaImageReader,
    vtkNIFTIImageReader,
)

#: Names of files that hold VDIs, not volumes.
_VDI_SUFFIXES = (".vdi", ".exr", ".html")

#: Names of files whose readers announce times; that of legacy .vtk files announces others.
_WITH_TIMES = (".vti", ".pvti", ".vtkhdf")

#: Bytes of a MetaImage's header, at most: some twenty lines of text.
_MAX_META_HEADER = 1 << 16

#: What the direction is called in a MetaImage; the first is what is written today.
_META_DIRECTIONS = ("TransformMatrix", "Rotation", "Orientation")

#: What every MetaImage says.
_META_NEEDED = ("NDims", "DimSize", "ElementType")

#: By how much of their mean the distances of slices may differ: more are missing slices.
_EVEN = 0.01


def read_volume(path: str | os.PathLike[str]) -> pv.ImageData:
    """Read a volume by PyVista's readers, with the orientation that its file states.

    A file in any format of ``pyvista.read`` that holds a uniform grid (MetaImage, NIfTI, .vti,
    .vtk, TIFF, ...), or a folder of DICOM slices, gives the grid in the file's own coordinates:
    those of NIfTI grow to the right, the front and the head, those of DICOM and of most MetaImages
    to the left, the back and the head; millimetres. What cannot be read is refused with a remedy;
    slices that are damaged, do not say where they lie, or are not at equal distances bring a
    ``VDIWarning``.
    """
    file = Path(path)
    if not os.path.exists(file):  # noqa: PTH110 - pathlib's raises for a name that is too long
        raise InvalidVolumeError(f"{file} does not exist: check the volume's path")
    name = file.name.lower()
    if name.endswith(_VDI_SUFFIXES) and file.is_file():
        raise InvalidVolumeError(
            f"{file} is a VDI, not a volume: 'pyvista-vdi render' and 'view' show it"
        )
    try:
        if file.is_dir():
            data = _dicom_series(file)
        elif name.endswith(".dcm"):
            data = _dicom_file(file)
        elif name.endswith((".nii", ".nii.gz")):
            data = _nifti(file)
        elif name.endswith((".mha", ".mhd")):
            data = _meta_image(file)
        else:
            data = _by_pyvista(file)
    except VDIError:
        raise
    except Exception as error:  # each format has readers, and exceptions, of its own
        raise InvalidVolumeError(f"{file} cannot be read as a volume: {error}") from error
    if not isinstance(data, pv.ImageData):
        raise UnsupportedError(
            f"{file} holds {with_article(type(data).__name__)}, not a uniform grid: resample "
            "it to a pyvista.ImageData first"
        )
    if is_vdi_image(data):
        raise InvalidVolumeError(
            f"{file} is a VDI in its VTK form, not a volume: "
            "pyvista_vdi.render(pyvista.read(path), camera) shows it"
        )
    if data.n_points == 0 or not data.array_names:
        raise InvalidVolumeError(f"{file} holds no scalars that PyVista could read")
    return data


def steps_of(path: str | os.PathLike[str]) -> tuple[Sequence[Any], tuple[float, ...]]:
    """Return what a file holds at each of its times, read when it is asked for, and the times.

    There are none where its reader announces none, or it cannot be read.
    """
    try:
        reader: Any = pv.get_reader(path)
        if hasattr(reader, "time_values"):
            return steps_and_times(reader)
        if Path(path).suffix.lower() in _WITH_TIMES:
            return steps_and_times(reader.reader)
    except Exception:  # of each format; reading it as one volume says what is wrong
        return (), ()
    return (), ()


def _by_pyvista(file: Path) -> Any:
    """Read by PyVista, and raise what VTK's reader would only print."""
    try:
        reader = pv.get_reader(file)
    except ValueError:  # formats that are not VTK's
        return pv.read(file)
    messages = _messages_of(reader.reader)
    data = reader.read()
    if messages:
        raise _refusal(messages[0], file)
    return data


def _messages_of(reader: Any) -> list[str]:
    """Return a list that gets the errors of a reader of VTK, in place of the terminal."""
    messages: list[str] = []

    def note(_reader: Any, _event: str, message: str) -> None:
        messages.append(message)

    def pass_over(_reader: Any, _event: str) -> None:
        """Warnings are about what is set right here."""

    note.CallDataType = "string0"  # type: ignore[attr-defined]
    for source in (reader, reader.GetExecutive()):
        source.AddObserver("ErrorEvent", note)
        source.AddObserver("WarningEvent", pass_over)
    return messages


def _refusal(message: str, file: Path) -> InvalidVolumeError:
    why = message.split("): ", 1)[-1].strip()
    return InvalidVolumeError(f"{file} cannot be read as a volume: {why}")


def _read_whole(reader: Any, file: Path) -> pv.ImageData:
    """Read by a reader of VTK, and raise what it would only print."""
    messages = _messages_of(reader)
    reader.Update()
    if messages or reader.GetErrorCode():
        raise _refusal(messages[0] if messages else _code(reader), file)
    data = pv.wrap(reader.GetOutput())
    if data.n_points == 0 or data.active_scalars is None:
        raise InvalidVolumeError(f"{file} holds no scalars that VTK could read")
    return data


def _code(reader: Any) -> str:
    code = reader.GetErrorCode()
    try:
        from pyvista_vdi.vtk_pipeline.vtk import vtkErrorCode
    except ImportError:  # as in cvista
        return f"VTK's error {code}"
    return str(vtkErrorCode.GetStringFromErrorCode(code))


def _place(data: pv.ImageData, to_world: NDArray[np.float64], file: Path) -> pv.ImageData:
    """Set a grid's map from point index to world coordinates, float64 (4, 4)."""
    spacing = np.linalg.norm(to_world[:3, :3], axis=0)
    volume = abs(np.linalg.det(to_world[:3, :3]))  # of a voxel
    if not (np.isfinite(to_world).all() and volume > 1e-9 * np.prod(spacing) > 0):
        raise InvalidVolumeError(
            f"{file} states an orientation that cannot be inverted: {to_world[:3].tolist()}"
        )
    data.spacing = spacing
    data.direction_matrix = to_world[:3, :3] / spacing
    data.origin = to_world[:3, 3]
    return data


def _nifti(file: Path) -> pv.ImageData:
    """Read NIfTI: VTK leaves out its two maps to the world, and the scale of its values."""
    reader = vtkNIFTIImageReader()
    reader.SetFileName(str(file))
    data = _read_whole(reader, file)
    n_times = reader.GetTimeDimension()
    if n_times > 1:
        raise UnsupportedError(
            f"{file} holds {n_times} time points, and a VDI is made from one: "
            "extract one, for instance by nibabel's img.slicer[..., 0]"
        )
    # What VTK gives maps points, spacing included, to the world: after the slices' own flip
    matrix = reader.GetSFormMatrix() or reader.GetQFormMatrix()
    if matrix is not None:
        to_world = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        data = _place(data, to_world @ np.diag([*data.spacing, 1.0]), file)
    slope, intercept = reader.GetRescaleSlope(), reader.GetRescaleIntercept()
    if slope not in (0.0, 1.0) or (slope == 1.0 and intercept != 0.0):  # 0: as they are
        values = data.active_scalars
        kind = np.result_type(values.dtype, np.float32)
        data.point_data[data.active_scalars_name] = (values * slope + intercept).astype(kind)
    return data


def _meta_image(file: Path) -> pv.ImageData:
    """Read MetaImage: VTK takes its matrix row by row where the axes lie one after the other."""
    with file.open("rb") as stream:
        header = stream.read(_MAX_META_HEADER).partition(b"ElementDataFile")[0].decode("latin-1")
    entries = dict(re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*$", header, re.MULTILINE))
    missing = [name for name in _META_NEEDED if name not in entries]
    if missing:  # the library behind VTK's reader would write that to the terminal
        raise InvalidVolumeError(
            f"{file} cannot be read as a volume: it is no MetaImage, for it does not say its "
            f"{' and '.join(missing)}"
        )
    reader = vtkMetaImageReader()
    reader.SetFileName(str(file))
    data = _read_whole(reader, file)
    axes = next((entries[key] for key in _META_DIRECTIONS if key in entries), "")
    numbers = np.array([float(v) for v in axes.split()])
    if len(numbers) == 9:
        data.direction_matrix = numbers.reshape(3, 3).T
    return data


def _dicom_file(file: Path) -> pv.ImageData:
    """Read one file, which holds one slice unless it is of the rare kind with many."""
    one = read_slice(file)
    if one is not None:
        require_uncompressed(one)
    reader = vtkDICOMImageReader()
    reader.SetFileName(str(file))
    data = _read_whole(reader, file)
    if data.dimensions[2] == 1:
        raise InvalidVolumeError(
            f"{file} holds one slice of {data.dimensions[0]} x {data.dimensions[1]} pixels: give "
            "the folder that holds all slices of its series"
        )
    return data if one is None else _with_spacing(data, one)


def _with_spacing(data: pv.ImageData, one: Slice) -> pv.ImageData:
    """Set a grid's spacing of slices: releases of VTK differ in which number comes first."""
    if one.spacing is not None and (one.spacing > 0).all():
        between_rows, between_columns = one.spacing
        data.spacing = (between_columns, between_rows, data.spacing[2])
    return data


def _dicom_series(folder: Path) -> pv.ImageData:
    """Read a folder's slices, and put them where they lie in the patient.

    Rows count upwards, and slices by descending place along the normal, the cross product of the
    directions of columns and rows: as VTK has them.
    """
    slices = sorted(slices_of(folder), key=lambda one: (one.number, one.path.name))
    if len(slices) < 2:
        raise InvalidVolumeError(f"the folder {folder} holds one DICOM slice: a volume needs two")
    positions, orientations = ([getattr(s, n) for s in slices] for n in ("position", "orientation"))
    if any(p is None for p in positions) or any(o is None for o in orientations):
        data = _stacked(slices)
        apart = slices[0].thickness or data.spacing[0]
        warn_external(
            f"slices in the folder {folder} do not say where they lie or how they are turned: rows "
            f"are taken to run along y, slices along z, {apart:g} apart, in an order that may be "
            "the wrong one"
        )
        data.spacing = (*data.spacing[:2], apart)
        return data
    along, down = orientations[0]
    if any(not np.allclose(o, orientations[0], atol=1e-3) for o in orientations):
        raise InvalidVolumeError(
            f"slices in the folder {folder} are turned against each other, as of a localiser: "
            "put those that are parallel into a folder of their own"
        )
    places = np.array(positions) @ np.cross(along, down)
    ordered = np.array(positions)[np.argsort(-places)]
    gaps = np.diff(np.sort(places))
    if gaps.min() < _EVEN * gaps.mean():
        raise InvalidVolumeError(
            f"several slices in the folder {folder} lie in the same place, as those of several "
            "times or echoes do: put those of one into a folder of their own"
        )
    if np.ptp(gaps) > _EVEN * gaps.mean():
        warn_external(
            f"slices in the folder {folder} are {gaps.min():g} to {gaps.max():g} apart, and are "
            f"taken as {gaps.mean():g} apart: some are missing, or resample them"
        )
    data = _stacked([slices[i] for i in np.argsort(-places)])
    n_rows = data.dimensions[1]
    step = (ordered[-1] - ordered[0]) / (len(slices) - 1)  # of a tilted gantry not the normal
    to_world = np.eye(4)
    to_world[:3, 0] = along * data.spacing[0]
    to_world[:3, 1] = -down * data.spacing[1]
    to_world[:3, 2] = step
    to_world[:3, 3] = ordered[0] + down * data.spacing[1] * (n_rows - 1)
    return _place(data, to_world, folder)


def _stacked(slices: list[Slice]) -> pv.ImageData:
    array = values_of(slices)
    data = pv.ImageData(dimensions=array.shape[::-1])
    data.point_data["values"] = array.ravel()
    return _with_spacing(data, slices[0])
