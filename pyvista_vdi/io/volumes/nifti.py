"""NIfTI 1 and 2, pairs, Analyze, MINC, MGH, AFNI and PAR/REC, by nibabel."""

from __future__ import annotations

import gzip
import io
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.table import head_of

#: Names that nibabel knows; a file of another name is read as what its content says.
_NAMES = (".nii", ".nii.gz", ".hdr", ".img", ".img.gz", ".mnc", ".mgh", ".mgz", ".head", ".brik")
_UNITS = {"meter": "m", "mm": "mm", "micron": "um"}


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the volume of a neuroimaging file, in its own coordinates: right, front, head."""
    import nibabel as nib

    name = file.name.lower()
    with file.open("rb") as stream:
        head = stream.read(3)
    if head == b"CDF":
        return [_minc_1(file)]
    zipped = head[:2] == b"\x1f\x8b"
    known = name.endswith((*_NAMES, ".brik.gz", ".par", ".rec"))
    if name.endswith(".mgh"):  # whose file nibabel leaves open
        image: Any = nib.MGHImage.from_bytes(file.read_bytes())
    elif known and name.endswith((".gz", ".mgz")) == zipped:
        image = nib.load(_header_of(file))
    else:
        second = head_of(file)[:4] in (b"\x1c\x02\0\0", b"\0\0\x02\x1c")
        kind = nib.Nifti2Image if second else nib.Nifti1Image
        content = file.read_bytes()
        holder = nib.FileHolder(fileobj=io.BytesIO(gzip.decompress(content) if zipped else content))
        image = kind.from_file_map({"header": holder, "image": holder})
    header, stored = image.header, image.dataobj
    dtype = np.dtype(header.get_data_dtype())
    shape, axes = tuple(image.shape), "xyztcuvw"[: len(image.shape)]
    if dtype.names:  # RGB and RGBA, a byte each
        shape, axes = (*shape, len(dtype.names)), axes + "s"

        def read() -> Any:
            colors = np.asarray(stored)
            return np.stack([colors[name] for name in dtype.names], axis=-1)

        array = Lazy(shape, np.uint8, read)
    elif _scaled(stored):
        kind = np.result_type(dtype, np.float32)
        array = Lazy(
            shape, kind, lambda index: np.asarray(stored[index]).astype(kind), in_parts=True
        )
    else:
        array = Lazy(shape, dtype, lambda index: np.asanyarray(stored[index]), in_parts=True)
    place = _to_world(image, nib)
    if isinstance(image, nib.Minc1Image):  # and MINC 2: the slowest axis first
        place, axes = place[:, [2, 1, 0, 3]], "tzyx"[-len(shape) :]
    return [VolumeInFile(array, axes, place, unit=_unit(header))]


def _minc_1(file: Path) -> VolumeInFile:
    """Return the volume of a MINC 1 file; axes are regular where nothing is said."""
    from nibabel.externals.netcdf import netcdf_file
    from nibabel.minc1 import Minc1File

    with netcdf_file(file, mmap=False) as data:
        for name, variable in data.variables.items():
            if name.endswith("space") and not hasattr(variable, "spacing"):
                variable.spacing = b"regular__"
        minc = Minc1File(data)
        kind = np.result_type(minc.get_data_dtype(), np.float32).newbyteorder("=")
        array = minc.get_scaled_data().astype(kind)
        place = minc.get_affine()[:, [2, 1, 0, 3]]  # its axes are the slowest first
        return VolumeInFile(array, "tzyx"[-array.ndim :], place, unit="mm")


def _header_of(file: Path) -> str:
    """Return the name by which nibabel opens a file: that of a pair's header."""
    for before, after in (
        (".rec", ".par"),
        (".REC", ".PAR"),
        (".BRIK", ".HEAD"),
        (".brik", ".head"),
    ):
        if before in file.name:
            return str(file.with_name(file.name.partition(before)[0] + after))
    return str(file)


def _scaled(stored: Any) -> bool:
    """Whether values are others than those that are stored; of MINC they are."""
    slope, shift = getattr(stored, "slope", None), getattr(stored, "inter", None)
    if hasattr(stored, "_slice_scaling"):  # of PAR/REC
        slope, shift = stored._slice_scaling
    if slope is None:
        return hasattr(stored, "minc_file")
    return not (np.all(slope == 1) and np.all(shift == 0))


def _to_world(image: Any, nib: Any) -> Any:
    """Return the file's map; where it has none, points lie from the origin on."""
    header = image.header
    if isinstance(image, nib.Nifti1Pair):
        placed = int(header["sform_code"]) > 0 or int(header["qform_code"]) > 0
    else:
        mat = image.file_map.get("mat")  # of SPM, beside an Analyze pair
        analyze = isinstance(image, nib.AnalyzeImage)
        placed = not analyze or (mat is not None and Path(str(mat.filename)).is_file())
    if placed:
        return np.asarray(image.affine, dtype=np.float64)
    spacing = [*np.abs(header.get_zooms())[:3], 1.0, 1.0, 1.0][:3]
    return np.diag([*(n or 1.0 for n in spacing), 1.0]).astype(np.float64)


def _unit(header: Any) -> str:
    if hasattr(header, "get_xyzt_units"):
        return _UNITS.get(header.get_xyzt_units()[0], "")
    return "mm"
