"""The formats that volumes are read from: how each is known, and which library reads it."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from pyvista_vdi.errors import UnsupportedError

#: Bytes of a file's beginning by which its format is known.
_HEAD = 4096

_NIFTI = re.compile(rb"(?s)^.{344}(n\+1|ni1)\0|^.{4}(n\+2|ni2)\0")
#: First elements of DICOM files as before 1993, without a preamble.
BARE_DICOM = (b"\x08\0\0\0", b"\x08\0\x05\0", b"\x08\0\x08\0", b"\x08\0\x16\0")
_SIZE_OF_ANALYZE = (b"\x5c\x01\0\0", b"\0\0\x01\x5c")


class VolumeFormat(NamedTuple):
    """A format: its name, the ends of its files' names, and what reads it.

    ``adapter``: module of this folder whose ``volumes_in(path)`` says what a file holds.
    ``begins``: whether a file is of the format, by its first bytes. ``needs``: what is imported,
    and ``extra`` what brings it. ``told_apart``: what several volumes in a file are chosen by.
    ``library``: what the table in ``docs/files.md`` says of it.
    """

    name: str
    suffixes: tuple[str, ...]
    adapter: str
    begins: Callable[[bytes], bool]
    library: str
    needs: tuple[str, ...] = ()
    extra: str = ""
    told_apart: str = "array"


def _starts(*beginnings: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(beginnings)


def _never(_head: bytes) -> bool:
    return False


_MEDICAL, _SCIENCE = "medical", "science"

#: In the order in which contents are looked at.
FORMATS = (
    VolumeFormat("NRRD", (".nrrd", ".nhdr"), "nrrd_files", _starts(b"NRRD0"), "pynrrd", ("nrrd",)),
    VolumeFormat(
        "NIfTI or Analyze",
        (".nii", ".nii.gz", ".hdr", ".img", ".img.gz", ".hdr.gz"),
        "nifti",
        lambda head: bool(_NIFTI.match(head)) or head.startswith(_SIZE_OF_ANALYZE),
        "nibabel",
        ("nibabel",),
        _MEDICAL,
    ),
    VolumeFormat(
        "MINC",
        (".mnc",),
        "nifti",
        lambda head: (head.startswith(b"CDF") and b"xspace" in head) or b"minc-2.0" in head,
        "nibabel, h5py",
        ("nibabel",),
        _MEDICAL,
    ),
    VolumeFormat("MGH", (".mgh", ".mgz"), "nifti", _never, "nibabel", ("nibabel",), _MEDICAL),
    VolumeFormat(
        "AFNI", (".head", ".brik", ".brik.gz"), "nifti", _never, "nibabel", ("nibabel",), _MEDICAL
    ),
    VolumeFormat(
        "PAR/REC",
        (".par", ".rec"),
        "nifti",
        lambda head: b"DATA DESCRIPTION FILE" in head[:200],
        "nibabel",
        ("nibabel",),
        _MEDICAL,
    ),
    VolumeFormat(
        "DICOM",
        (".dcm", ".ima"),
        "dicom",
        lambda head: head[128:132] == b"DICM" or head[:4] in BARE_DICOM,
        "pydicom",
        ("pydicom",),
        _MEDICAL,
        "series",
    ),
    VolumeFormat(
        "MetaImage",
        (".mha", ".mhd"),
        "meta_image",
        lambda head: b"ElementType" in head and b"DimSize" in head and b"NDims" in head,
        "NumPy",
    ),
    VolumeFormat(
        "TIFF",
        (".tif", ".tiff", ".btf", ".tf8", ".lsm"),
        "tiff",
        _starts(b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
        "tifffile",
        ("tifffile",),
        "microscopy",
        "series",
    ),
    VolumeFormat(
        "MRC or CCP4",
        (".mrc", ".map", ".ccp4", ".mrcs", ".st", ".ali"),
        "mrc",
        lambda head: head[208:212] == b"MAP ",
        "mrcfile",
        ("mrcfile",),
        "microscopy",
    ),
    VolumeFormat(
        "NetCDF",
        (".nc", ".nc4", ".cdf"),
        "netcdf",
        lambda head: (
            head.startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05"))
            or (head.startswith(b"\x89HDF") and b"_NCProperties" in head)
        ),
        "xarray, h5netcdf, SciPy",
        ("xarray", "h5netcdf", "scipy"),
        _SCIENCE,
    ),
    VolumeFormat("Imaris", (".ims",), "hdf5", _never, "h5py", ("h5py",), "hdf5"),
    VolumeFormat(
        "HDF5",
        (".h5", ".hdf5", ".he5", ".hdf", ".nxs", ".mat"),
        "hdf5",
        lambda head: b"\x89HDF\r\n" in (head[:6], head[512:518], head[1024:1030]),
        "h5py",
        ("h5py",),
        "hdf5",
    ),
    VolumeFormat(
        "FITS",
        (".fits", ".fit", ".fts", ".fits.gz"),
        "fits",
        _starts(b"SIMPLE  ="),
        "astropy",
        ("astropy",),
        _SCIENCE,
    ),
    VolumeFormat(
        "NumPy",
        (".npy", ".npz"),
        "numpy_files",
        lambda head: (
            head.startswith(b"\x93NUMPY")
            or (head.startswith(b"PK\x03\x04") and b".npy" in head[:300])
        ),
        "NumPy",
    ),
    VolumeFormat("raw", (".raw",), "raw", _never, "NumPy"),
    VolumeFormat(
        "pictures of several frames",
        (".gif", ".png", ".webp"),
        "frames",
        _starts(b"GIF8", b"\x89PNG", b"RIFF"),
        "Pillow",
    ),
)

#: Of VTK and PyVista: in ``plotting/volume_files.py``, as this room knows neither.
VTK = VolumeFormat(
    "VTK and what PyVista reads",
    (".vti", ".vtr", ".vtm", ".vtk", ".slc", ".cube", ".pvti", ".xdmf", ".xmf", ".vtkhdf"),
    "",
    lambda head: head.startswith((b"# vtk DataFile", b"SLC")) or b"<VTKFile" in head[:512],
    "VTK",
    ("pyvista",),
    "plot",
)

#: Ends of names that are volumes' and no VDIs'.
VOLUME_SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.suffixes)

#: What no library that is kept well reads, by the ends of names: what to do.
REFUSED = {
    ".vdb": "OpenVDB, whose library has no wheels: write a dense grid from it (its copyToArray) by "
    "numpy.save",
    ".am": "Amira: save it from there as NRRD",
    ".bov": "BOV: rename its data like x_1024x1024x795_uint8.raw",
    ".mif": "MRtrix: convert it by mrconvert x.mif x.nii.gz",
    ".czi": "Zeiss CZI: save it as OME-TIFF, for instance by bfconvert",
    ".lif": "Leica LIF: save it as OME-TIFF, for instance by bfconvert",
    ".nd2": "Nikon ND2: save it as OME-TIFF, for instance by bfconvert",
    ".oib": "Olympus OIB: save it as OME-TIFF, for instance by bfconvert",
    ".mat": "MATLAB before 7.3: save it there by save(..., '-v7.3')",
    ".zip": "a zip archive: unpack it",
    ".tar": "an archive: unpack it",
}


def head_of(file: Path) -> bytes:
    """Return a file's first bytes, unpacked where it is compressed by gzip."""
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    if head.startswith(b"\x1f\x8b"):
        try:
            return zlib.decompressobj(wbits=31).decompress(head, _HEAD)
        except zlib.error:
            return b""
    return head


def format_of(file: Path) -> VolumeFormat:
    """Return a file's format: by its content, or else by its name.

    Raises UnsupportedError with a remedy where there is none.
    """
    name, head = file.name.lower(), head_of(file)
    every = (*FORMATS, VTK)
    named = [f for f in every if name.endswith(f.suffixes)]
    for each in (*named, *every):
        if each.begins(head):
            if each.name == "HDF5" and named and named[0].suffixes != each.suffixes:
                return named[0]  # MINC, NetCDF, Imaris and VTKHDF are HDF5 inside
            return each
    for suffix, remedy in REFUSED.items():
        if name.endswith(suffix):
            raise UnsupportedError(f"{file} is {remedy}")
    return named[0] if named else VTK
