"""Writes scans byte by byte, as other programs do: DICOM, NIfTI and MetaImage."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np

EXPLICIT, IMPLICIT, JPEG = (f"1.2.840.10008.1.2{end}" for end in (".1", "", ".4.70"))
_CT = "1.2.840.10008.5.1.4.1.1.2"


def numbers(values):
    return "\\".join(f"{v:.9g}" for v in np.ravel(values))


def element(tag, vr, value, *, explicit=True):
    """A DICOM element (PS3.5, section 7.1); text is padded to an even length."""
    group, number = tag >> 16, tag & 0xFFFF
    if isinstance(value, int):
        value = struct.pack("<H", value)
    data = value if isinstance(value, bytes) else value.encode()
    if len(data) % 2:
        data += b"\0" if vr == "UI" else b" "
    if not explicit:
        return struct.pack("<HHI", group, number, len(data)) + data
    if vr in ("OW", "SQ", "UT"):
        return struct.pack("<HH2sHI", group, number, vr.encode(), 0, len(data)) + data
    return struct.pack("<HH2sH", group, number, vr.encode(), len(data)) + data


def dicom_slice(
    pixels,
    position,
    orientation,
    spacing,
    *,
    number=1,
    series="1.2.3",
    syntax=EXPLICIT,
    slope=None,
    sequence=b"",
):
    """A CT slice: int16 pixels, (rows, columns)."""

    def add(tag, vr, value):
        return element(tag, vr, value, explicit=syntax != IMPLICIT)

    meta = element(0x00020010, "UI", syntax)
    body = add(0x00080016, "UI", _CT) + sequence
    body += add(0x0008103E, "LO", f"series {series}") + add(0x00180050, "DS", f"{spacing[2]}")
    body += add(0x0020000E, "UI", series) + add(0x00200013, "IS", f"{number}")
    if position is not None:
        body += add(0x00200032, "DS", numbers(position)) + add(
            0x00200037, "DS", numbers(orientation)
        )
    body += add(0x00280002, "US", 1) + add(0x00280004, "CS", "MONOCHROME2")
    body += add(0x00280010, "US", pixels.shape[0]) + add(0x00280011, "US", pixels.shape[1])
    body += add(0x00280030, "DS", numbers((spacing[1], spacing[0])))
    body += add(0x00280100, "US", 16) + add(0x00280101, "US", 16) + add(0x00280102, "US", 15)
    body += add(0x00280103, "US", 1)
    if slope is not None:
        body += add(0x00281052, "DS", "-100") + add(0x00281053, "DS", f"{slope}")
    body += add(0x7FE00010, "OW", pixels.astype("<i2").tobytes())
    size = element(0x00020000, "UL", struct.pack("<I", len(meta)))
    return bytes(128) + b"DICM" + size + meta + body


def write_dicom(folder, array, spacing, origin, direction, *, suffix=".dcm", **options):
    """Write a series, whose files' names are not in the slices' order."""
    folder.mkdir(exist_ok=True)
    for z, pixels in enumerate(array):
        position = origin + direction[:, 2] * spacing[2] * z
        data = dicom_slice(pixels, position, direction[:, :2].T, spacing, number=z + 1, **options)
        (folder / f"{7 * z % 11:02d}{suffix}").write_bytes(data)
    return folder


def write_nifti(path, array, spacing, *, sform=None, quaternion=None, qfac=1.0, slope=0.0, nt=1):
    """Write NIfTI-1; ``quaternion`` is (b, c, d, x, y, z), ``sform`` a 4 x 4 matrix."""
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 4 if nt > 1 else 3, *array.shape[::-1], nt, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)  # int16
    struct.pack_into("<8f", header, 76, qfac, *spacing, 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, slope, -3.0 if slope else 0.0)
    header[123] = 2  # millimetres
    struct.pack_into("<2h", header, 252, quaternion is not None, sform is not None)
    struct.pack_into("<6f", header, 256, *(quaternion if quaternion is not None else [0] * 6))
    struct.pack_into("<12f", header, 280, *(np.zeros(12) if sform is None else sform[:3].ravel()))
    header[344:348] = b"n+1\0"
    data = bytes(header) + array.astype("<i2").tobytes() * nt
    Path(path).write_bytes(gzip.compress(data) if str(path).endswith(".gz") else data)
    return path


def write_meta_image(path, array, spacing, origin, direction, key="TransformMatrix"):
    """Write MetaImage as ITK does: axis after axis; .mhd has its data in a file beside it."""
    alone = path.suffix == ".mha"
    data_file = "LOCAL" if alone else path.with_suffix(".raw").name
    text = (
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        f"{key} = {' '.join(repr(float(v)) for v in direction.T.ravel())}\n"
        f"Offset = {' '.join(repr(float(v)) for v in origin)}\n"
        f"ElementSpacing = {' '.join(repr(float(v)) for v in spacing)}\n"
        f"DimSize = {' '.join(str(n) for n in array.shape[::-1])}\n"
        f"ElementType = MET_SHORT\nElementDataFile = {data_file}\n"
    ).encode()
    data = array.astype("<i2").tobytes()
    path.write_bytes(text + data if alone else text)
    if not alone:
        path.with_suffix(".raw").write_bytes(data)
    return path
