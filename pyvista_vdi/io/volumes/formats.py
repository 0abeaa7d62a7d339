"""What each format's files hold: a function for each, by the format's library, and their table."""

from __future__ import annotations

import gzip
import os
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, warn_external
from pyvista_vdi.io.axes import one_unit, to_world
from pyvista_vdi.io.stores import is_store
from pyvista_vdi.io.volumes.dicom import dicom
from pyvista_vdi.io.volumes.in_file import REMEDY, Lazy, VolumeInFile, head_of

#: What OME and ImageJ call a micrometre.
_MICRONS = ("um", "µm", "\\u00b5m", "micron", "microns")


def nrrd(file: Path) -> list[VolumeInFile]:
    """Return the volume of an NRRD file, in the coordinates that its ``space`` names."""
    import nrrd

    header: Any = nrrd.read_header(str(file))
    others = {*header.get("kinds", ())} - {"domain", "space", "???"}
    if header["dimension"] != 3 or others or "axis mins" in header:
        raise UnsupportedError(
            f"{file} has other axes than x, y and z, or borders in place of points: {REMEDY}"
        )
    steps = header.get("space directions", header.get("spacings", np.ones(3)))
    place = to_world(np.transpose(steps), header.get("space origin", np.zeros(3)))
    units = [str(unit) for unit in header.get("space units", header.get("units", ("", "", "")))]
    dtype = np.dtype(nrrd.reader._determine_datatype(header)).newbyteorder("=")
    shape, read = header["sizes"][::-1].tolist(), partial(nrrd.read, str(file), index_order="C")
    lazy = Lazy(shape, dtype, lambda: read()[0])
    return [VolumeInFile(lazy, "zyx", place, str(header.get("content", "")), one_unit(units))]


def _by_itk(file: Path) -> tuple[NDArray[Any], str, NDArray[np.float64]]:
    """Return what SimpleITK reads: an array, its axes, and its place in ITK's frame."""
    import SimpleITK

    image = SimpleITK.ReadImage(str(file))
    array, n = SimpleITK.GetArrayFromImage(image), image.GetDimension()
    axes = "tzyx"[-n:] if n < 5 else "?" * (n - 4) + "tzyx"
    if (components := image.GetNumberOfComponentsPerPixel()) > 1:
        axes += "s" if components in (3, 4) and array.dtype == np.uint8 else "c"
    turn = np.eye(3)
    turn[:n, :n] = np.reshape(image.GetDirection(), (n, n))[:3, :3]
    lengths, origin = [*image.GetSpacing(), 1.0][:3], [*image.GetOrigin(), 0.0][:3]
    return array, axes, to_world(turn * lengths, origin)


def itk(file: Path) -> list[VolumeInFile]:
    """Return the volume of a MetaImage, in ITK's frame, or of a GIPL or MINC file, in its own."""
    array, axes, place = _by_itk(file)
    if ".gipl" in file.name.lower():  # 256 bytes of header; the others ITK checks
        _require_whole(file, 256 + array.nbytes)
    unit = "" if file.suffix.lower() in (".mha", ".mhd") else "mm"
    return [VolumeInFile(array, axes, place, unit=unit)]


def _require_whole(file: Path, needed: int) -> None:
    """Refuse what ITK would fill up with whatever memory holds, or gzip's checksum refuses."""
    with file.open("rb") as plain:
        packed = plain.read(2) == b"\x1f\x8b"
    with gzip.open(file) if packed else file.open("rb") as stream:
        size = sum(map(len, iter(partial(stream.read, 1 << 24), b"")))
    if size < needed:
        raise ValueError(f"it has {size} of {needed} bytes: it is cut off")


def nifti(file: Path) -> list[VolumeInFile]:
    """Return the volume of a NIfTI or Analyze file, in its own frame: right, front, head; mm."""
    array, axes, place = _by_itk(file)
    head = head_of(file.with_name(re.sub(r"(?i)\.img(?=$|\.)", ".hdr", file.name)))
    order = "<" if head[:4] == b"\x5c\x01\0\0" else ">"
    real, short = (partial(np.frombuffer, head, f"{order}{kind}") for kind in ("f4", "i2"))
    n, *counts = short(8, 40).tolist()
    needed = int(real(1, 108)[0]) + np.prod(counts[:n], dtype=object) * int(short(1, 72)[0]) // 8
    _require_whole(file.with_name(re.sub(r"(?i)\.hdr(?=$|\.)", ".img", file.name)), needed)
    slope, shift = real(2, 112)
    if shift and np.isfinite(shift) and not (slope and np.isfinite(slope)):
        array = array - array.dtype.type(shift)  # which ITK adds where values are not scaled
    if head[344:347] in (b"n+1", b"ni1") and short(2, 252).any():  # it is placed by a form
        place = np.diag([-1, -1, 1, 1]) @ place
    else:
        place = to_world(np.linalg.norm(place[:3, :3], axis=0))
    return [VolumeInFile(array, axes, place, unit="mm")]


def numpy(file: Path) -> list[VolumeInFile]:
    """Return the array of an .npy file, or those of three axes or more in an .npz file."""
    if file.suffix.lower() == ".npz":
        with file.open("rb") as stream, np.lib.npyio.NpzFile(stream) as packed:  # no objects
            arrays = {name: packed[name] for name in packed if packed[name].ndim > 2}
    else:
        arrays = {"": np.lib.format.open_memmap(file, mode="r")}
    colors = [n for n, a in arrays.items() if a.shape[3:] == (4,) and a.dtype == np.uint8]
    return [
        VolumeInFile(a, "zyxs" if n in colors else "?" * (a.ndim - 3) + "zyx"[-a.ndim :], name=n)
        for n, a in arrays.items()
    ]


def tiff(file: Path) -> list[VolumeInFile]:
    """Return the series of three axes; the top row is the last along y."""
    import tifffile

    def read(number: int, down: int) -> NDArray[Any]:
        values = np.flip(tifffile.imread(file, series=number), down)
        return values if kept is None else (values * slope + shift).astype(kept)

    found = []
    with tifffile.TiffFile(file) as opened:
        # ImageJ keeps signed values as unsigned ones, and others by a line
        said = opened.imagej_metadata or {}
        shift, slope = float(said.get("c0", 0.0)), float(said.get("c1", 1.0))
        signed = (slope, shift) == (1, -32768) and opened.series[0].dtype == np.uint16
        function = said.get("cf", 0 if (slope, shift) != (1, 0) else -1)
        kept = np.dtype(np.int16 if signed else np.float32) if function == 0 else None
        for number, series in enumerate(opened.series):
            axes = str(series.axes).lower()
            # Of axes that nothing names the last is z
            if unnamed := next((a for a in "qi" if a in axes and "z" not in axes), None):
                axes = "z".join(axes.rsplit(unnamed, 1))
            if not {*"zyx"} <= {*axes} or series.keyframe.is_reduced:
                continue
            lazy = Lazy(series.shape, kept or series.dtype, partial(read, number, axes.index("y")))
            size, unit, names = _described(opened, number, series.keyframe)
            channels = series.shape[axes.index("c")] if "c" in axes else 0
            each = len({*names}) == len(names) == channels and all(names)
            name = series.name if len(opened.series) > 1 else ""
            place = to_world(size)
            found.append(VolumeInFile(lazy, axes, place, name, unit, tuple(names) if each else ()))
    return found


def _described(opened: Any, number: int, page: Any) -> tuple[list[float], str, list[str]]:
    """Return the spacing along x, y and z, its unit and the channels' names, as the file says."""
    size, unit, names = [1.0, 1.0, 1.0], "", []
    described = opened.ome_metadata
    of_ome = ET.fromstring(described).findall(".//{*}Pixels")[number:] if described else []
    if of_ome:
        x, y, z = (of_ome[0].get(f"PhysicalSize{axis}") for axis in "XYZ")
        units = [of_ome[0].get(f"PhysicalSize{axis}Unit", "µm") for axis in "XYZ"]
        names = [channel.get("Name", "") for channel in of_ome[0].findall("{*}Channel")]
        if x:
            size, unit = [float(x), float(y or 1), float(z or 1)], one_unit(units)
        if x and not z:
            said = f"{opened.filename} says that pixels are {x} x {y}, and not how far apart slices"
            warn_external(f"{said} are: spacing is taken as 1; give spacing=(x, y, z)")
    elif opened.is_imagej:
        entries = opened.imagej_metadata or {}
        per = page.get_resolution() if {282, 283} <= {*page.tags.keys()} else (0, 0)
        size = [*(1 / n if n else 1.0 for n in per), float(entries.get("spacing", 1.0)) or 1.0]
        unit = str(entries.get("unit", "")).replace("pixel", "")
        unit = "um" if unit in _MICRONS else unit
        names = [str(n) for n in entries.get("Labels", ())]
    return size, unit, names


def vtk(file: Path) -> list[VolumeInFile]:
    """Return what PyVista reads: this room knows neither VTK nor PyVista."""
    return registry.method("volumes_in")(file)  # type: ignore[no-any-return]


class VolumeFormat(NamedTuple):
    """A format: the ends of its files' names, what reads it, and what the files begin with.

    ``library`` is imported by the function, and is in ``extra``.
    """

    name: str
    suffixes: tuple[str, ...]
    volumes_in: Callable[[Path], list[VolumeInFile]] | None  # None: a store, which is opened
    library: str
    extra: str = "files"
    magic: tuple[bytes, ...] = ()


_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_VTK = (b"# vtk DataFile",)  # of XML the name says which
_TABLE: Any = (
    ("NRRD", ".nrrd .nhdr", nrrd, "nrrd", "", (b"NRRD0",)),
    ("NIfTI", ".nii .nii.gz .hdr .img .img.gz", nifti, "SimpleITK"),
    ("MetaImage", ".mha .mhd", itk, "SimpleITK"),
    ("GIPL, MINC 2", ".gipl .gipl.gz .mnc", itk, "SimpleITK"),
    ("DICOM", ".dcm .ima", dicom, "pydicom", "files", (b"DICM",)),
    ("TIFF", ".tif .tiff .btf .tf8", tiff, "tifffile", "files", _TIFF),
    ("HDF5", ".h5 .hdf5 .he5 .hdf .nxs", None, "h5py", "files", (b"\x89HDF",)),
    ("NumPy", ".npy .npz", numpy, "numpy", "", (b"\x93NUMPY",)),
    ("VTK", ".vti .vtr .vtm .vtk .pvti .vtkhdf", vtk, "pyvista", "plot", _VTK),
)
FORMATS = {
    name: VolumeFormat(name, tuple(suffixes.split()), *more) for name, suffixes, *more in _TABLE
}


def format_of(path: str | os.PathLike[str]) -> VolumeFormat:
    """Return the format of a file, by its name or else by its content, or of a folder.

    HDF5 of any store. What does not exist, or is of no format, is refused with a remedy.
    """
    if is_store(path):
        return FORMATS["HDF5"]
    file, why = Path(path), ""
    name = file.name.lower()
    if not os.path.exists(file):  # noqa: PTH110 - pathlib's raises for a name that is too long
        why = "does not exist: check the volume's path, or try pyvista_vdi.examples (--example)"
    elif file.is_dir():
        return FORMATS["DICOM"]
    elif not file.is_file() or not file.stat().st_size:
        why = "cannot be read as a volume: it is empty, or no file"
    elif name.endswith((".vdi", ".exr", ".html")):
        why = "is a VDI, not a volume: 'pyvista-vdi render' and 'view' show it"
    if why:
        raise InvalidVolumeError(f"{file} {why}")
    for each in FORMATS.values():
        if name.endswith(each.suffixes):
            return each
    head = head_of(file)
    for each in FORMATS.values():
        if each.magic and (head.startswith(each.magic) or head[128:].startswith(each.magic)):
            return each
    raise UnsupportedError(f"{file} is of no format that is read here: {REMEDY}")
