"""NIfTI 1 and 2, pairs, Analyze, MINC, MGH, AFNI and PAR/REC, by nibabel."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.table import head_of

_UNITS = {"meter": "m", "mm": "mm", "micron": "um"}


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the volume of a neuroimaging file, in its own coordinates: right, front, head."""
    with _opened(file) as image:
        header, place, shape = image.header, _to_world(image), tuple(image.shape)
        kind = dtype = np.dtype(header.get_data_dtype())
        axes = "xyztcuvw"[: len(shape)]
        if dtype.names:  # RGB and RGBA, a byte each
            kind, shape, axes = np.dtype(np.uint8), (*shape, len(dtype.names)), axes + "s"
        elif _scaled(image.dataobj):
            kind = np.result_type(dtype, np.float32)
        if hasattr(image.dataobj, "minc_file"):  # the slowest axis first
            place, axes = place[:, [2, 1, 0, 3]], "tzyx"[-len(shape) :]

    def read(index: Any) -> Any:
        with _opened(file, whole=True) as again:
            values = np.asanyarray(again.dataobj[index[: again.ndim]])
        if dtype.names:
            return np.stack([values[name] for name in dtype.names], axis=-1)[..., index[-1]]
        return values.astype(kind, copy=False)

    unit = header.get_xyzt_units()[0] if hasattr(header, "get_xyzt_units") else "mm"
    lazy = Lazy(shape, kind, read, in_parts=True)
    return [VolumeInFile(lazy, axes, place, unit=_UNITS.get(unit, ""))]


@contextmanager
def _opened(file: Path, *, whole: bool = False) -> Iterator[Any]:
    """Open an image. ``whole``: compare gzip's checksums, before which nibabel stops reading."""
    import nibabel as nib
    from nibabel.externals.netcdf import netcdf_file

    head = head_of(file)
    kind = next((k for k in nib.all_image_classes if k.path_maybe_image(str(file))[0]), None)
    with ExitStack() as stack:
        if head.startswith(b"CDF"):  # MINC 1, whose axes are regular where nothing is said
            data = stack.enter_context(netcdf_file(file, mmap=False))
            for name, variable in data.variables.items():
                if name.endswith("space") and not hasattr(variable, "spacing"):
                    variable.spacing = b"regular__"
            minc = nib.minc1.Minc1File(data)
            header = nib.minc1.Minc1Header(minc.get_data_dtype())
            proxy = nib.Minc1Image.ImageArrayProxy(minc)
            yield nib.Minc1Image(proxy, minc.get_affine(), header)
            return
        if kind is not None:
            holders = kind.filespec_to_file_map(str(file))
        else:  # of another name
            second = head[:4] in (b"\x1c\x02\0\0", b"\0\0\x02\x1c")
            kind = nib.Nifti2Image if second else nib.Nifti1Image
            holders = {"image": nib.FileHolder(str(file))}
        for holder in holders.values() if kind is not nib.Minc2Image else ():
            name = Path(holder.filename)
            if name.suffix.lower() not in (".par", ".head") and name.is_file():  # they are text
                holder.fileobj = stack.enter_context(name.open("rb"))
                if holder.fileobj.peek(2).startswith(b"\x1f\x8b"):
                    holder.fileobj = stack.enter_context(gzip.open(holder.fileobj))
        yield kind.from_file_map(holders)
        for stream in [holder.fileobj for holder in holders.values() if whole]:
            while isinstance(stream, gzip.GzipFile) and stream.read(1 << 24):
                pass


def _scaled(stored: Any) -> bool:
    """Whether values are others than those that are stored; of MINC they are."""
    slope, shift = getattr(stored, "slope", None), getattr(stored, "inter", None)
    if hasattr(stored, "_slice_scaling"):  # of PAR/REC
        slope, shift = stored._slice_scaling
    if slope is None:
        return hasattr(stored, "minc_file")
    return not (np.all(slope == 1) and np.all(shift == 0))


def _to_world(image: Any) -> Any:
    """Return the file's map; where it has none, points lie from the origin on."""
    from nibabel.analyze import AnalyzeHeader

    header = image.header
    if isinstance(header, AnalyzeHeader):  # NIfTI's is one
        mat = image.file_map.get("mat")  # of SPM, beside an Analyze pair
        coded = any(int(header[c]) for c in ("sform_code", "qform_code") if c in header)
        if not coded and (mat is None or not Path(str(mat.filename)).is_file()):
            return to_world([n or 1.0 for n in [*np.abs(header.get_zooms()), 1.0, 1.0, 1.0][:3]])
    return np.asarray(image.affine, dtype=np.float64)
