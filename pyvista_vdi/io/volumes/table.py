"""The formats that volumes are read from: which function reads them, and by which library."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import NamedTuple

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError
from pyvista_vdi.io.volumes.in_file import REMEDY


class VolumeFormat(NamedTuple):
    """A format: its name, the ends of its files' names, and what reads it.

    ``reader``: a module of this folder, and the function in it that says what a file holds.
    ``library`` is in ``extra``. ``magic``: what its files begin with, behind a preamble in DICOM.
    """

    name: str
    ends: str
    reader: str
    library: str
    extra: str = "files"
    magic: tuple[bytes, ...] = ()

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The ends of its files' names."""
        return tuple(self.ends.split())


DICOM = VolumeFormat("DICOM", ".dcm .ima", "dicom:dicom", "pydicom", magic=(b"DICM",))
HDF5 = VolumeFormat("HDF5", ".h5 .hdf5 .he5 .hdf .nxs", "", "h5py", magic=(b"\x89HDF",))
PICTURES = VolumeFormat("PNG slices", ".png", "pictures:pictures", "PIL", "")
#: In ``plotting/volume_files.py``, as this room knows neither VTK nor PyVista.
VTK = VolumeFormat(
    *("VTK", ".vti .vtr .vtm .vtk .pvti .vtkhdf", "", "pyvista", "plot"),
    magic=(b"# vtk DataFile", b"<VTKFile"),
)
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

FORMATS = (
    VolumeFormat("NRRD", ".nrrd .nhdr", "images:nrrd", "nrrd", "", (b"NRRD0",)),
    VolumeFormat("NIfTI", ".nii .nii.gz .hdr .img .img.gz", "images:nifti", "SimpleITK"),
    VolumeFormat("MetaImage", ".mha .mhd", "images:itk", "SimpleITK"),
    VolumeFormat("GIPL", ".gipl .gipl.gz", "images:itk", "SimpleITK"),
    VolumeFormat("MINC 2", ".mnc", "images:itk", "SimpleITK"),
    VolumeFormat("MRC", ".mrc .map .ccp4 .mrcs .st .ali", "images:mrc", "numpy", ""),
    DICOM,
    VolumeFormat("TIFF", ".tif .tiff .btf .tf8 .lsm", "pictures:tiff", "tifffile", magic=_TIFF),
    HDF5,
    VolumeFormat("NumPy", ".npy .npz", "images:numpy", "numpy", "", (b"\x93NUMPY",)),
    PICTURES,
    VTK,
)

#: Ends of names that are volumes' and no VDIs'.
VOLUME_SUFFIXES = tuple(suffix for each in FORMATS[:-1] for suffix in each.suffixes)


def head_of(file: Path) -> bytes:
    """Return a file's first bytes, unpacked where it is compressed by gzip."""
    with file.open("rb") as stream:
        head = stream.read(4096)
    if not head.startswith(b"\x1f\x8b"):
        return head
    try:
        return zlib.decompressobj(wbits=31).decompress(head, 4096)
    except zlib.error:
        return b""


def format_of(file: Path) -> VolumeFormat:
    """Return the format of a file by its name, or else by its content.

    Raises UnsupportedError with a remedy where there is none, and InvalidVolumeError for a VDI.
    """
    name, head = file.name.lower(), head_of(file)
    if name.endswith((".vdi", ".exr", ".html")):
        raise InvalidVolumeError(
            f"{file} is a VDI, not a volume: 'pyvista-vdi render' and 'view' show it"
        )
    for each in FORMATS:
        if name.endswith(each.suffixes) and not head.startswith(b"CDF"):  # as MINC 1 is
            return each
    for each in FORMATS:
        if each.magic and (head.startswith(each.magic) or head[128:].startswith(each.magic)):
            return each
    raise UnsupportedError(f"{file} is of no format that is read here: {REMEDY}")
