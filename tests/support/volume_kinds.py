"""Files of sixty kinds, made by script from one scan: each with what is right of it.

A kind is a function that writes a file into a folder and returns a :class:`Kind`. Where a library
writes it, that is another than the one that reads it, or the bytes are the format's own.
"""

from __future__ import annotations

import gzip
import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scan_files import write_dicom, write_meta_image, write_nifti

SPACING, ORIGIN = np.array([1.0, 1.5, 2.5]), np.array([-10.0, 20.0, 30.0])
SHAPE = (5, 6, 7)  # z, y, x


def scan(dtype=np.int16):
    return (np.arange(210).reshape(SHAPE) * 7 % 211).astype(dtype)


def affine(spacing=SPACING, origin=ORIGIN, direction=None):
    matrix = np.eye(4)
    matrix[:3, :3] = (np.eye(3) if direction is None else direction) * np.asarray(spacing)
    matrix[:3, 3] = origin
    return matrix


def turned():
    c, s = np.cos(0.5), np.sin(0.5)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@dataclass
class Kind:
    path: Path
    values: np.ndarray = field(default_factory=scan)
    to_world: np.ndarray = field(default_factory=affine)
    unit: str = ""
    options: dict = field(default_factory=dict)
    flipped: bool = False  # in NIfTI's frame, whose x and y are SimpleITK's negated


KINDS: dict[str, Callable[[Path], Kind]] = {}


def kind(make):
    KINDS[make.__name__] = make
    return make


# NIfTI and its relatives


@kind
def nifti(folder):
    path = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine(direction=turned()))
    return Kind(path, to_world=affine(direction=turned()), unit="mm", flipped=True)


@kind
def nifti_gz(folder):
    path = write_nifti(folder / "a.nii.gz", scan(), SPACING, quaternion=(0, 0, 0, *ORIGIN))
    return Kind(path, unit="mm", flipped=True)


@kind
def nifti_misnamed(folder):
    path = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine())
    return Kind(path.rename(folder / "IM0001"), unit="mm")


@kind
def nifti_scaled(folder):
    path = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine(), slope=0.5)
    return Kind(path, scan() * 0.5 - 3, unit="mm", flipped=True)


@kind
def nifti_nan_slope(folder):
    path = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine(), slope=float("nan"))
    return Kind(path, unit="mm")


@kind
def nifti_time(folder):
    path = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine(), nt=3)
    return Kind(path, unit="mm", options={"time": 2}, flipped=True)


@kind
def nifti_pair(folder):
    whole = write_nifti(folder / "a.nii", scan(), SPACING, sform=affine()).read_bytes()
    header = bytearray(whole[:348])
    struct.pack_into("<f", header, 108, 0.0)
    header[344:348] = b"ni1\0"
    (folder / "b.hdr").write_bytes(header)
    (folder / "b.img").write_bytes(whole[352:])
    return Kind(folder / "b.img", unit="mm", flipped=True)


@kind
def nifti_2(folder):
    header = bytearray(544)
    struct.pack_into("<i8s", header, 0, 540, b"n+2\0\r\n\x1a\n")
    struct.pack_into("<hh8q", header, 12, 4, 16, 3, *SHAPE[::-1], 1, 1, 1, 1)
    struct.pack_into("<8d", header, 104, 1, *SPACING, 1, 1, 1, 1)
    struct.pack_into("<q", header, 168, 544)
    struct.pack_into("<ii", header, 344, 0, 1)
    struct.pack_into("<12d", header, 400, *affine()[:3].ravel())
    struct.pack_into("<i", header, 500, 2)
    (folder / "a.nii").write_bytes(bytes(header) + scan().astype("<i2").tobytes())
    return Kind(folder / "a.nii", unit="mm")


@kind
def nifti_rgba(folder):
    whole = bytearray(write_nifti(folder / "a.nii", scan(), SPACING, sform=affine()).read_bytes())
    struct.pack_into("<2h", whole, 70, 2304, 32)
    colors = np.random.default_rng(2).integers(0, 255, (*SHAPE, 4), np.uint8)
    (folder / "a.nii").write_bytes(bytes(whole[:352]) + colors.tobytes())
    return Kind(folder / "a.nii", colors, unit="mm", flipped=True)


@kind
def analyze(folder):
    header = bytearray(348)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 4, *SHAPE[::-1], 1, 1, 1, 1)
    struct.pack_into("<hh", header, 70, 4, 16)
    struct.pack_into("<4f", header, 76, 0, *SPACING)
    (folder / "a.hdr").write_bytes(header)
    (folder / "a.img").write_bytes(scan().astype("<i2").tobytes())
    return Kind(folder / "a.hdr", to_world=affine(origin=(0, 0, 0)), unit="mm")


def _mgh():
    header = bytearray(284)
    struct.pack_into(">7ih", header, 0, 1, *SHAPE[::-1], 1, 4, 0, 1)
    centre = ORIGIN + turned() @ (SPACING * np.array(SHAPE[::-1]) / 2)
    struct.pack_into(">15f", header, 30, *SPACING, *turned().T.ravel(), *centre)
    return bytes(header) + scan().astype(">i2").tobytes()


@kind
def mgh(folder):
    (folder / "a.mgh").write_bytes(_mgh())
    return Kind(folder / "a.mgh", to_world=affine(direction=turned()), unit="mm")


@kind
def mgz(folder):
    (folder / "a.mgz").write_bytes(gzip.compress(_mgh()))
    return Kind(folder / "a.mgz", to_world=affine(direction=turned()), unit="mm")


@kind
def minc_1(folder):
    netcdf_file = pytest.importorskip("scipy.io").netcdf_file
    axes = dict(zip(("xspace", "yspace", "zspace"), turned().T, strict=True))
    start = turned().T @ ORIGIN  # along the axes
    with netcdf_file(folder / "a.mnc", "w") as file:
        for k, name in enumerate(("zspace", "yspace", "xspace")):
            file.createDimension(name, SHAPE[k])
            variable = file.createVariable(name, "i", ())
            variable.step, variable.start = SPACING[2 - k], start[2 - k]
            variable.direction_cosines = axes[name]
        image = file.createVariable("image", "h", ("zspace", "yspace", "xspace"))
        image[:] = scan()
        image.signtype, image.valid_range = b"signed__", np.array([0, 1000.0])
        for name, value in (("image-max", 10.0), ("image-min", 0.0)):
            file.createVariable(name, "d", ("zspace",))[:] = np.full(5, value)
    return Kind(folder / "a.mnc", scan() / 100, affine(direction=turned()), "mm")


@kind
def minc_2(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.mnc", "w") as file:
        root = file.create_group("minc-2.0")
        for k, name in enumerate(("zspace", "yspace", "xspace")):
            attributes = root.create_dataset(f"dimensions/{name}", data=0).attrs
            attributes["step"], attributes["start"] = SPACING[2 - k], ORIGIN[2 - k]
            attributes["length"] = SHAPE[k]
            attributes["direction_cosines"] = np.eye(3)[2 - k]
        image = root.create_dataset("image/0/image", data=scan())
        image.attrs["dimorder"] = np.bytes_("zspace,yspace,xspace")
        image.attrs["valid_range"] = [0.0, 1000.0]
        root["image/0/image-max"], root["image/0/image-min"] = 10.0, 0.0
    return Kind(folder / "a.mnc", scan() / 100, unit="mm")


@kind
def afni(folder):
    def entry(type_, name, values):
        text = " ".join(map(str, values)) if type_ != "string" else f"'{values}~"
        count = len(values) + (type_ == "string")
        return f"\ntype = {type_}-attribute\nname = {name}\ncount = {count}\n{text}\n"

    head = entry("string", "TYPESTRING", "3DIM_HEAD_ANAT") + entry(
        "string", "BYTEORDER_STRING", "LSB_FIRST"
    )
    head += entry("integer", "DATASET_RANK", [3, 1, 0, 0, 0, 0, 0, 0])
    head += entry("integer", "DATASET_DIMENSIONS", [*SHAPE[::-1], 0, 0])
    head += entry("integer", "BRICK_TYPES", [1]) + entry("float", "BRICK_FLOAT_FACS", [0.0])
    head += entry("integer", "SCENE_DATA", [0, 0, 0]) + entry(
        "integer", "ORIENT_SPECIFIC", [0, 3, 4]
    )
    head += entry("float", "ORIGIN", ORIGIN) + entry("float", "DELTA", SPACING)
    lps = np.diag([-1, -1, 1, 1]) @ affine()
    head += entry("float", "IJK_TO_DICOM_REAL", lps[:3].ravel())
    (folder / "a+orig.HEAD").write_text(head)
    (folder / "a+orig.BRIK").write_bytes(scan().astype("<i2").tobytes())
    return Kind(folder / "a+orig.HEAD", unit="mm")


@kind
def afni_gz(folder):
    afni(folder)
    packed = gzip.compress((folder / "a+orig.BRIK").read_bytes())
    (folder / "a+orig.BRIK").unlink()
    (folder / "a+orig.BRIK.gz").write_bytes(packed)
    return Kind(folder / "a+orig.HEAD", unit="mm")


def _par_rec(folder, dynamics=1, slope=2.0, intercept=-5.0):
    """Philips': places are of the middle, in (front-back, foot-head, right-left)."""
    nz, ny, nx = SHAPE
    sx, sy, sz = SPACING
    centre = -np.array([ORIGIN[1], 0, ORIGIN[0]]) + (sy * (ny - 1) / 2, 0, sx * (nx - 1) / 2)
    centre[1] = ORIGIN[2] + sz * (nz - 1) / 2
    numbers = " ".join(f"{n:.6f}" for n in centre)
    lines = [
        "# === DATA DESCRIPTION FILE ======",
        "# CLINICAL TRYOUT             Research image export tool     V4.2",
        "# === GENERAL INFORMATION ========",
        *(
            f".    {name}   :   {value}"
            for name, value in (
                ("Patient name", "a"),
                ("Max. number of slices/locations", nz),
                ("Max. number of dynamics", dynamics),
                ("Max. number of echoes", 1),
                ("Max. number of diffusion values", 1),
                ("Max. number of gradient orients", 1),
                ("Max. number of cardiac phases", 1),
                ("Max. number of mixes", 1),
                ("Number of label types   <0=no ASL>", 0),
                ("Repetition time [ms]", 10.0),
                ("Scan resolution  (x, y)", f"{nx} {ny}"),
                ("FOV (ap,fh,rl) [mm]", f"{sy * ny} {sz * nz} {sx * nx}"),
                ("Angulation midslice(ap,fh,rl)[degr]", "0 0 0"),
                ("Off Centre midslice(ap,fh,rl) [mm]", numbers),
                ("Dynamic scan      <0=no 1=yes> ?", int(dynamics > 1)),
                ("Diffusion         <0=no 1=yes> ?", 0),
                ("Phase encoding velocity [cm/sec]", "0 0 0"),
            )
        ),
        "# === IMAGE INFORMATION ==========",
    ]
    for time in range(dynamics):
        for z in range(nz):
            lines.append(
                f"{z + 1} 1 {time + 1} 1 0 2 {time * nz + z} 16 100 {nx} {ny} {intercept} {slope} 1"
                f" 100 200 0 0 0 {numbers} {sz} 0 0 1 0 2 {sx} {sy} 5 0 0 0 1 90 0 0 0 1 0 1 1 0 0"
                " 0 0 0 1"
            )
    (folder / "a.PAR").write_text("\n".join([*lines, "# === END OF DATA DESCRIPTION FILE ==="]))
    stored = np.concatenate([scan() + 9 * (dynamics - 1 - time) for time in range(dynamics)])
    (folder / "a.REC").write_bytes(stored.astype("<i2").tobytes())
    # Columns run to the left, rows to the back: both against NIfTI's frame
    place = affine(ORIGIN, (0, 0, 0)) @ np.eye(4)
    place[:3, :3], place[:3, 3] = np.diag(SPACING * (-1, -1, 1)), 0
    corner = np.array([-centre[2], -centre[0], centre[1]])
    place[:3, 3] = corner - place[:3, :3] @ ((np.array(SHAPE[::-1]) - 1) / 2)
    return place


@kind
def par_rec(folder):
    place = _par_rec(folder)
    return Kind(folder / "a.PAR", scan() * 2 - 5, place, unit="mm")


@kind
def par_rec_times(folder):
    place = _par_rec(folder, dynamics=2)
    return Kind(folder / "a.REC", scan() * 2 - 5, place, unit="mm", options={"time": 1})


# NRRD

_LPS = "space: left-posterior-superior\nspace origin: (-10,20,30)\n"
_STEPS = "(1,0,0) (0,1.5,0) (0,0,2.5)"


def _nrrd(folder, header, data=b"", *, sizes="7 6 5", kind_="short", name="a.nrrd", dimension=3):
    text = f"NRRD0005\ntype: {kind_}\ndimension: {dimension}\nsizes: {sizes}\nendian: little\n"
    (folder / name).write_bytes((text + header).encode() + (b"\n" + data if data else b""))
    return folder / name


def _bytes(array=None):
    return (scan() if array is None else array).astype("<i2").tobytes()


@kind
def nrrd(folder):
    header = f"encoding: raw\n{_LPS}space directions: {_STEPS}\n"
    return Kind(_nrrd(folder, header, _bytes()))


@kind
def nrrd_gzip(folder):
    header = f'encoding: gzip\n{_LPS}space directions: {_STEPS}\nspace units: "mm" "mm" "mm"\n'
    return Kind(_nrrd(folder, header, gzip.compress(_bytes())), unit="mm")


@kind
def nrrd_text(folder):
    header = f"encoding: ascii\n{_LPS}space directions: {_STEPS}\n"
    return Kind(_nrrd(folder, header, " ".join(map(str, scan().ravel())).encode()))


@kind
def nrrd_detached(folder):
    (folder / "a.raw").write_bytes(_bytes())
    header = f"encoding: raw\n{_LPS}space directions: {_STEPS}\ndata file: a.raw\n"
    return Kind(_nrrd(folder, header, name="a.nhdr"))


def _pieces(folder):
    for i, piece in enumerate(scan()):
        (folder / f"s{i}.raw").write_bytes(_bytes(piece))
    return f"encoding: raw\n{_LPS}space directions: {_STEPS}\ndata file: "


@kind
def nrrd_list(folder):
    names = "".join(f"s{i}.raw\n" for i in range(5))
    return Kind(_nrrd(folder, f"{_pieces(folder)}LIST\n{names}", name="a.nhdr"))


@kind
def nrrd_pattern(folder):
    return Kind(_nrrd(folder, f"{_pieces(folder)}s%d.raw 0 4 1\n", name="a.nhdr"))


@kind
def nrrd_axis_mins_of_cells(folder):
    low = ORIGIN - SPACING / 2
    header = f"encoding: raw\nspacings: 1 1.5 2.5\naxis mins: {low[0]} {low[1]} {low[2]}\n"
    return Kind(_nrrd(folder, f"{header}centers: cell cell cell\n", _bytes()))


@kind
def nrrd_rgba(folder):
    colors = np.random.default_rng(3).integers(0, 255, (*SHAPE, 4), np.uint8)
    header = f"encoding: raw\n{_LPS}space directions: none {_STEPS}\n"
    header += "kinds: RGBA-color domain domain domain\n"
    path = _nrrd(folder, header, colors.tobytes(), sizes="4 7 6 5", kind_="uchar", dimension=4)
    return Kind(path, colors)


@kind
def nrrd_channels(folder):
    array = np.stack([scan() + 300, scan()])
    header = f"encoding: raw\n{_LPS}space directions: {_STEPS} none\n"
    header += "kinds: domain domain domain list\n"
    path = _nrrd(folder, header, _bytes(array), sizes="7 6 5 2", dimension=4)
    return Kind(path, options={"channel": 1})


@kind
def nrrd_times(folder):
    array = np.stack([scan() + 300, scan()])
    header = (
        f"encoding: raw\n{_LPS}space directions: {_STEPS} none\nkinds: domain domain domain time\n"
    )
    path = _nrrd(folder, header, _bytes(array), sizes="7 6 5 2", dimension=4)
    return Kind(path, options={"time": 1})


# MetaImage


@kind
def meta_image(folder):
    path = write_meta_image(folder / "a.mha", scan(), SPACING, ORIGIN, turned())
    return Kind(path, to_world=affine(direction=turned()))


@kind
def meta_image_detached(folder):
    path = write_meta_image(folder / "a.mhd", scan(), SPACING, ORIGIN, turned())
    return Kind(path, to_world=affine(direction=turned()))


def _meta(folder, more, data=b"", type_="MET_SHORT", sizes="7 6 5"):
    n = len(sizes.split())
    numbers = [*map(str, SPACING), "1"][:n], [*map(str, ORIGIN), "0"][:n]
    text = f"ObjectType = Image\nNDims = {n}\nDimSize = {sizes}\nElementType = {type_}\n"
    text += f"ElementSpacing = {' '.join(numbers[0])}\nOffset = {' '.join(numbers[1])}\n{more}"
    (folder / "a.mhd").write_bytes(text.encode() + data)
    return folder / "a.mhd"


@kind
def meta_image_compressed(folder):
    data = zlib.compress(_bytes())
    more = f"CompressedData = True\nCompressedDataSize = {len(data)}\nElementDataFile = LOCAL\n"
    return Kind(_meta(folder, f"BinaryData = True\n{more}", data))


@kind
def meta_image_list(folder):
    _pieces(folder)
    names = "".join(f"s{i}.raw\n" for i in range(5))
    return Kind(_meta(folder, f"ElementDataFile = LIST\n{names}"))


@kind
def meta_image_pattern(folder):
    _pieces(folder)
    return Kind(_meta(folder, "ElementDataFile = s%d.raw 0 4 1\n"))


@kind
def meta_image_long(folder):
    data = scan().astype("<i8").tobytes()
    return Kind(_meta(folder, "ElementDataFile = LOCAL\n", data, "MET_LONG_LONG"))


@kind
def meta_image_big_endian(folder):
    more = "BinaryDataByteOrderMSB = True\nElementDataFile = LOCAL\n"
    return Kind(_meta(folder, more, scan().astype(">f4").tobytes(), "MET_FLOAT"))


@kind
def meta_image_times(folder):
    data = _bytes(np.stack([scan() + 9, scan()]))
    return Kind(
        _meta(folder, "ElementDataFile = LOCAL\n", data, sizes="7 6 5 2"), options={"time": 1}
    )


@kind
def meta_image_channels(folder):
    data = _bytes(np.stack([scan() + 9, scan()], axis=-1))
    more = "ElementNumberOfChannels = 2\nElementDataFile = LOCAL\n"
    return Kind(_meta(folder, more, data), options={"channel": 1})


@kind
def meta_image_with_a_header_before_its_data(folder):
    (folder / "d.raw").write_bytes(b"of another program" + _bytes())
    return Kind(_meta(folder, "HeaderSize = -1\nElementDataFile = d.raw\n"))


# TIFF: the top row is the last along y, and there is no origin


def _tiff(
    folder, array, values=None, spacing=(1, 1, 1), unit="", options=None, name="a.tif", **how
):
    tifffile = pytest.importorskip("tifffile")
    tifffile.imwrite(folder / name, array, **how)
    values = array if values is None else values
    return Kind(folder / name, values[:, ::-1], affine(spacing, (0, 0, 0)), unit, options or {})


@kind
def tiff(folder):
    return _tiff(folder, scan(np.uint16), photometric="minisblack")


@kind
def tiff_imagej(folder):
    how = {"imagej": True, "resolution": (5, 5)}
    said = {"axes": "ZYX", "spacing": 0.5, "unit": "um"}
    return _tiff(folder, scan(np.uint16), spacing=(0.2, 0.2, 0.5), unit="um", metadata=said, **how)


@kind
def tiff_imagej_signed(folder):
    """ImageJ keeps signed values as unsigned ones, with a line that takes 32768 off."""
    said = "ImageJ=1.53t\nimages=5\nslices=5\nunit=cm\nspacing=0.25\ncf=0\nc0=-32768.0\nc1=1.0\n"
    how = {"description": said, "metadata": None, "resolution": (10, 5)}
    stored = (scan(np.int32) - 100 + 32768).astype(np.uint16)
    return _tiff(folder, stored, scan() - 100, spacing=(0.1, 0.2, 0.25), unit="cm", **how)


@kind
def tiff_lsm(folder):
    """Zeiss': a thumbnail after each slice, and voxels' sizes in metres in a tag of its own."""
    info = bytearray(512)
    sizes = (*SHAPE[::-1], 1, 1, 2, 3, 3, *SPACING / 1e6, 0, 0, 0)
    struct.pack_into("<I9i6d", info, 0, 0x0400494C, 512, *sizes)
    tifffile = pytest.importorskip("tifffile")
    with tifffile.TiffWriter(folder / "a.lsm") as file:
        for picture in scan(np.uint16):
            tags = [(34412, 1, 512, bytes(info), True)]
            file.write(picture, extratags=tags, metadata=None)
            file.write(picture[::2, ::2].astype(np.uint8), subfiletype=1, metadata=None)
    place = affine(origin=(0, 0, 0))
    return Kind(folder / "a.lsm", scan()[:, ::-1], place, unit="um")


@kind
def tiff_ome_units(folder):
    """Of which one is another."""
    said = {"axes": "ZYX", "PhysicalSizeX": 0.001, "PhysicalSizeXUnit": "mm"}
    said |= {"PhysicalSizeY": 1.5, "PhysicalSizeZ": 2.5}
    how = {"name": "a.ome.tif", "photometric": "minisblack", "metadata": said}
    return _tiff(folder, scan(np.uint16), spacing=SPACING / 1000, unit="mm", **how)


@kind
def tiff_ome(folder):
    said = {"axes": "ZYX"} | {f"PhysicalSize{a}": s for a, s in zip("XYZ", SPACING, strict=True)}
    how = {"name": "a.ome.tif", "photometric": "minisblack", "metadata": said}
    return _tiff(folder, scan(np.uint16), spacing=SPACING, unit="µm", **how)


@kind
def tiff_ome_channels(folder):
    array = np.stack([scan(np.uint16) + 9, scan(np.uint16)])
    said = {"axes": "CZYX", "Channel": {"Name": ["DAPI", "GFP"]}}
    how = {"name": "a.ome.tif", "photometric": "minisblack", "metadata": said}
    return _tiff(folder, array, scan(np.uint16), options={"channel": "GFP"}, **how)


@kind
def tiff_channels(folder):
    array = np.stack([scan(np.uint16) + 9, scan(np.uint16)], axis=1)
    how = {"imagej": True, "metadata": {"axes": "ZCYX"}}
    return _tiff(folder, array, scan(np.uint16), options={"channel": 1}, **how)


@kind
def tiff_times(folder):
    array = np.stack([scan(np.uint16) + 9, scan(np.uint16)])
    how = {"imagej": True, "metadata": {"axes": "TZYX"}}
    return _tiff(folder, array, scan(np.uint16), options={"time": 1}, **how)


@kind
def tiff_grey_lut(folder):
    lut = (np.arange(256) * 256 * np.ones((3, 1))).astype(np.uint16)
    return _tiff(folder, scan(np.uint8), photometric="palette", colormap=lut)


@kind
def tiff_bits(folder):
    return _tiff(folder, scan() > 100, photometric="minisblack")


@kind
def tiff_float64(folder):
    return _tiff(folder, scan() / 7, photometric="minisblack")


@kind
def tiff_half(folder):
    return _tiff(folder, scan(np.float16), photometric="minisblack")


@kind
def tiff_tiles(folder):
    return _tiff(folder, scan(np.uint16), photometric="minisblack", tile=(16, 16))


@kind
def tiff_big_deflated(folder):
    return _tiff(folder, scan(), photometric="minisblack", bigtiff=True, compression="zlib")


@kind
def tiff_lzw(folder):
    pytest.importorskip("imagecodecs")
    return _tiff(folder, scan(), photometric="minisblack", compression="lzw")


@kind
def tiff_with_a_thumbnail(folder):
    tifffile = pytest.importorskip("tifffile")
    with tifffile.TiffWriter(folder / "a.tif") as file:
        for page in scan():
            file.write(page, photometric="minisblack", contiguous=False, metadata=None)
        file.write(scan()[0, ::2, ::2], subfiletype=1, photometric="minisblack", metadata=None)
    return Kind(folder / "a.tif", scan()[:, ::-1], np.eye(4))


@kind
def tiff_levels(folder):
    tifffile = pytest.importorskip("tifffile")
    fine = np.arange(4 * 32 * 32, dtype=np.uint16).reshape(4, 32, 32)
    with tifffile.TiffWriter(folder / "a.ome.tif") as file:
        how = {"photometric": "minisblack", "tile": (16, 16)}
        file.write(
            fine,
            subifds=1,
            metadata={"axes": "ZYX", "PhysicalSizeX": 2.0, "PhysicalSizeZ": 1.0},
            **how,
        )
        file.write(fine[:, ::2, ::2], subfiletype=1, **how)
    world = affine((4, 2, 1), (0, 0, 0))
    return Kind(folder / "a.ome.tif", fine[:, ::2, ::2][:, ::-1], world, "µm", {"level": 1})


# DICOM


def _edited(folder, edit):
    pydicom = pytest.importorskip("pydicom")
    write_dicom(folder / "scan", scan(), SPACING, ORIGIN, turned())
    for path in (folder / "scan").iterdir():
        data = pydicom.dcmread(path)
        data.file_meta.MediaStorageSOPClassUID = data.SOPClassUID
        data.file_meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = "1.2.3.4"
        edit(data)
        data.save_as(path, enforce_file_format=True)
    return Kind(folder / "scan", to_world=affine(direction=turned()), unit="mm")


@kind
def dicom(folder):
    return _edited(folder, lambda data: None)


@kind
def dicom_without_a_preamble(folder):
    """As before 1993: no 128 bytes and no DICM, implicit."""
    found = _edited(folder, lambda data: None)
    pydicom = pytest.importorskip("pydicom")
    for path in found.path.iterdir():
        data = pydicom.Dataset()
        data.update(pydicom.dcmread(path))
        pydicom.dcmwrite(path, data, implicit_vr=True, little_endian=True)
    return found


@kind
def dicom_modality_lut(folder):
    """Values are those of a table, in place of a slope and an intercept."""
    pydicom = pytest.importorskip("pydicom")

    def edit(data):
        table = pydicom.Dataset()
        table.LUTDescriptor, table.ModalityLUTType = [256, 0, 16], "US"
        table.add_new("LUTData", "US", [3 * i + 1 for i in range(256)])
        data.ModalityLUTSequence, data.PixelRepresentation = [table], 0
        for name in ("RescaleSlope", "RescaleIntercept"):
            data.pop(name, None)

    found = _edited(folder, edit)
    found.values = scan() * 3 + 1
    return found


@kind
def dicom_rle(folder):
    return _edited(folder, lambda data: data.compress("1.2.840.10008.1.2.5"))


@kind
def dicom_deflated(folder):
    def edit(data):
        data.file_meta.TransferSyntaxUID = "1.2.840.10008.1.2.1.99"

    return _edited(folder, edit)


def _frames(folder, values, **elements):
    pydicom = pytest.importorskip("pydicom")
    data, meta = pydicom.Dataset(), pydicom.dataset.FileMetaDataset()
    meta.TransferSyntaxUID = "1.2.840.10008.1.2.1"
    meta.MediaStorageSOPClassUID = data.SOPClassUID = "1.2.840.10008.5.1.4.1.1.2.1"
    meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = data.SeriesInstanceUID = "1.2.3"
    data.file_meta, data.NumberOfFrames = meta, len(values)
    data.Rows, data.Columns, data.SamplesPerPixel = *values.shape[1:], 1
    data.PhotometricInterpretation, data.PixelRepresentation = "MONOCHROME2", 0
    data.BitsAllocated = data.BitsStored = 8 * values.dtype.itemsize
    data.HighBit, data.PixelData = data.BitsStored - 1, values.tobytes() + bytes(values.nbytes % 2)
    for name, value in elements.items():
        setattr(data, name, value)
    data.save_as(folder / "a.dcm", enforce_file_format=True)
    return folder / "a.dcm"


def _group(name, **elements):
    pydicom = pytest.importorskip("pydicom")
    inner, outer = pydicom.Dataset(), pydicom.Dataset()
    for key, value in elements.items():
        setattr(inner, key, value)
    setattr(outer, name, pydicom.Sequence([inner]))
    return outer


def _shared():
    shared = _group("PixelMeasuresSequence", PixelSpacing=[1.5, 1.0])
    shared.update(_group("PlaneOrientationSequence", ImageOrientationPatient=[1, 0, 0, 0, 1, 0]))
    return shared


def _at(z, **more):
    place = [float(v) for v in (ORIGIN[0], ORIGIN[1], ORIGIN[2] + 2.5 * z)]
    return _group("PlanePositionSequence", ImagePositionPatient=place)


@kind
def dicom_enhanced(folder):
    order = [3, 0, 4, 1, 2]
    frames = [_at(z) for z in order]
    elements = {"SharedFunctionalGroupsSequence": [_shared()]}
    elements["PerFrameFunctionalGroupsSequence"] = frames
    return Kind(_frames(folder, scan(np.uint16)[order], **elements), unit="mm")


@kind
def dicom_dose(folder):
    elements = {
        "ImagePositionPatient": ORIGIN.tolist(),
        "PixelSpacing": [1.5, 1],
        "ImageOrientationPatient": [1, 0, 0, 0, 1, 0],
        "DoseGridScaling": 0.5,
        "GridFrameOffsetVector": [0, 2.5, 5, 7.5, 10],
    }
    return Kind(_frames(folder, scan(np.uint16), **elements), scan() / 2, unit="mm")


@kind
def dicom_segments(folder):
    """Two segments; frames in which one is empty are left out, as they may be."""
    pydicom = pytest.importorskip("pydicom")
    frames, values = [], []
    for z in range(5):
        for number in (1, 2):
            if (z, number) != (2, 2):
                frame = _at(z)
                frame.update(
                    _group("SegmentIdentificationSequence", ReferencedSegmentNumber=number)
                )
                frames.append(frame)
                values.append((scan(np.uint8)[z] % 3 == number).astype(np.uint8))
    segments = []
    for number, label in ((1, "liver"), (2, "spleen")):
        segment = pydicom.Dataset()
        segment.SegmentNumber, segment.SegmentLabel = number, label
        segments.append(segment)
    elements = {"SharedFunctionalGroupsSequence": [_shared()], "SegmentSequence": segments}
    elements["PerFrameFunctionalGroupsSequence"] = frames
    expected = (scan(np.uint8) % 3 == 2).astype(np.uint8)
    expected[2] = 0
    path = _frames(folder, np.array(values), **elements)
    return Kind(path, expected, unit="mm", options={"channel": "spleen"})


@kind
def dicom_segments_of_bits(folder):
    """As most are written: eight voxels a byte, the frames without gaps."""
    pydicom = pytest.importorskip("pydicom")
    right = dicom_segments(folder)
    data = pydicom.dcmread(right.path)
    frames = np.frombuffer(data.PixelData, np.uint8)[: int(data.NumberOfFrames) * 42]
    packed = np.packbits(frames, bitorder="little").tobytes()
    data.PixelData = packed + bytes(len(packed) % 2)
    data.BitsAllocated, data.BitsStored, data.HighBit = 1, 1, 0
    data["PixelData"].VR = "OB"
    data.save_as(right.path, enforce_file_format=True)
    return right


# NumPy, HDF5, NetCDF, zarr


@kind
def npy(folder):
    np.save(folder / "a.npy", scan())
    return Kind(folder / "a.npy", to_world=np.eye(4))


@kind
def npz(folder):
    np.savez_compressed(folder / "a.npz", one=scan() + 9, two=scan())
    return Kind(folder / "a.npz", to_world=np.eye(4), options={"array": "two"})


@kind
def raw(folder):
    path = folder / "a_7x6x5_int16.raw"
    path.write_bytes(_bytes())
    placed = {"spacing": SPACING, "origin": ORIGIN}
    return Kind(path, options=placed)


@kind
def hdf5(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.nxs", "w") as file:
        file["v"] = scan()
        file["v"].attrs["element_size_um"] = SPACING[::-1]
    return Kind(folder / "a.nxs", to_world=affine(origin=(0, 0, 0)), unit="micrometer")


@kind
def hdf5_checked(folder):
    """With checksums of the chunks and, by the newest format, of the metadata."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.h5", "w", libver="latest") as file:
        file.create_dataset("v", data=scan(), chunks=SHAPE, fletcher32=True)
    return Kind(folder / "a.h5", to_world=np.eye(4))


@kind
def zarr_checked(folder):
    zarr = pytest.importorskip("zarr", minversion="3")
    codecs = [zarr.codecs.ZstdCodec(checksum=True), zarr.codecs.Crc32cCodec()]
    zarr.create_array(
        str(folder / "a.zarr"), data=scan(), chunks=SHAPE, compressors=codecs, zarr_format=3
    )
    return Kind(folder / "a.zarr", to_world=np.eye(4))


@kind
def hdf5_ilastik(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.h5", "w") as file:
        data = file.create_dataset("exported_data", data=np.stack([scan() + 9, scan()], axis=-1))
        data.attrs["axistags"] = json.dumps({"axes": [{"key": key} for key in "zyxc"]})
    return Kind(folder / "a.h5", to_world=np.eye(4), options={"channel": 1})


def _nexus(file, group, values, link=None):
    data = file.create_group(group)
    data.attrs["NX_class"], data.attrs["signal"] = "NXdata", "counts"
    data.attrs["axes"] = ["slow", "rows", "columns"]
    data["counts"] = values if link is None else link
    for k, name in enumerate(data.attrs["axes"]):
        data[name] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
        data[name].attrs["units"] = "um"


@kind
def nexus(folder):
    """What the file says is its default, among others."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.nxs", "w") as file:
        entry = file.create_group("entry")
        file.attrs["default"], entry.attrs["default"] = "entry", "reconstruction"
        entry.attrs["NX_class"] = "NXentry"
        _nexus(file, "entry/raw", scan() + 9)
        _nexus(file, "entry/reconstruction", scan())
        entry["instrument/detector/data"] = scan() + 8
    return Kind(folder / "a.nxs", unit="um")


@kind
def nexus_link(folder):
    """The signal is a link to what lies elsewhere, as beamlines write it."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.nxs", "w") as file:
        file["entry/instrument/detector/frames"] = scan()
        file["entry/other"] = scan() + 9
        link = h5py.SoftLink("/entry/instrument/detector/frames")
        _nexus(file, "entry/data", None, link)
    return Kind(folder / "a.nxs", unit="um")


@kind
def nexus_old(folder):
    """Before 2014: the data say that they are the signal, and their axes."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("entry1/data")
        group.attrs["NX_class"] = b"NXdata"
        group["counts"] = scan()
        group["counts"].attrs["signal"], group["counts"].attrs["axes"] = 1, b"slow:rows:columns"
        for k, name in enumerate(("slow", "rows", "columns")):
            group[name] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
        file["entry1/other"] = scan() + 9
    return Kind(folder / "a.h5")


@kind
def matlab_7_3(folder):
    """HDF5 behind 512 bytes of text; the first index of MATLAB's is the last one here."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file["v"] = scan(np.float64)
        file["v"].attrs["MATLAB_class"] = np.bytes_("double")
        file["name"] = np.array([[97]], np.uint16)
        file["#refs#/a"] = scan() + 9  # of a cell array
        cells = file.create_dataset("cells", (2, 2, 2), h5py.ref_dtype)
        cells[0, 0, 0] = file["#refs#/a"].ref
    text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124)
    with (folder / "a.mat").open("r+b") as stream:
        stream.write(text + b"\x00\x02IM")
    (folder / "a.mat").rename(folder / "results")
    return Kind(folder / "results", scan(np.float64), np.eye(4))


_PACKED = {"scale_factor": 0.5, "add_offset": 100.0, "_FillValue": 7}


def _unpacked():
    values = scan() * 0.5 + 100
    return np.where(scan() == 7, np.nan, values)


@kind
def hdf5_packed(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.h5", "w") as file:
        file["T"] = scan()
        file["T"].attrs.update(_PACKED)
        for k, name in enumerate(("lev", "lat", "lon")):
            file[name] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
            file[name].make_scale(name)
            file["T"].dims[k].attach_scale(file[name])
    return Kind(folder / "a.h5", _unpacked())


@kind
def zarr_packed(folder):
    """As xarray writes it, latitudes falling."""
    zarr = pytest.importorskip("zarr", minversion="3")
    group = zarr.open_group(str(folder / "a.zarr"), mode="w", zarr_format=2)
    array = group.create_array("T", data=scan(), chunks=(2, 4, 4), fill_value=7)
    array.attrs.update(_ARRAY_DIMENSIONS=["lev", "lat", "lon"], scale_factor=0.5, add_offset=100.0)
    world = affine(SPACING * (1, -1, 1))
    for k, name in enumerate(("lev", "lat", "lon")):
        step = world[2 - k, 2 - k]
        along = group.create_array(name, data=ORIGIN[2 - k] + step * np.arange(SHAPE[k]))
        along.attrs.update(_ARRAY_DIMENSIONS=[name], units="degrees")
    return Kind(folder / "a.zarr", _unpacked(), world, "degrees")


@kind
def imaris(folder):
    h5py = pytest.importorskip("h5py")

    def text(value):
        return np.array([c.encode() for c in str(value)], "S1")

    with h5py.File(folder / "a.ims", "w") as file:
        for channel in range(2):
            name = f"DataSet/ResolutionLevel 0/TimePoint 0/Channel {channel}"
            padded = np.zeros((8, 8, 8), np.int16)
            padded[:5, :6, :7] = scan() + 9 * (1 - channel)
            group = file.create_group(name)
            group["Data"] = padded
            for axis, n in zip("ZYX", SHAPE, strict=True):
                group.attrs[f"ImageSize{axis}"] = text(n)
        image = file.create_group("DataSetInfo/Image").attrs
        image["Unit"] = text("um")
        for i in range(3):
            low = ORIGIN[i] - SPACING[i] / 2
            image[f"ExtMin{i}"] = text(low)
            image[f"ExtMax{i}"] = text(low + SPACING[i] * SHAPE[2 - i])
    return Kind(folder / "a.ims", unit="um", options={"channel": 1})


def _cf(file, packed):
    for k, name in enumerate(("z", "y", "x")):
        file.createDimension(name, SHAPE[k])
        coordinate = file.createVariable(name, "d", (name,))
        coordinate[:] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
        coordinate.units = "m"
    file.createDimension("time", 2)
    variable = file.createVariable("T", "h", ("time", "z", "y", "x"))
    variable[:] = np.stack([scan() + 9, scan()])
    if packed:
        variable.scale_factor, variable.add_offset = 0.5, 100.0


@kind
def netcdf_3(folder):
    with pytest.importorskip("scipy.io").netcdf_file(folder / "a.nc", "w") as file:
        _cf(file, packed=False)
    return Kind(folder / "a.nc", unit="m", options={"time": 1})


@kind
def netcdf_packed(folder):
    with pytest.importorskip("scipy.io").netcdf_file(folder / "a.nc", "w") as file:
        _cf(file, packed=True)
    return Kind(folder / "a.nc", scan() * 0.5 + 100, unit="m", options={"time": 1})


@kind
def netcdf_4(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.nc", "w") as file:
        file["T"] = scan()
        for k, name in enumerate(("lev", "lat", "lon")):
            file[name] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
            file[name].make_scale(name)
            file["T"].dims[k].attach_scale(file[name])
    return Kind(folder / "a.nc")


@kind
def netcdf_units(folder):
    """Kilometres along x and y, metres along z, which falls."""
    xarray = pytest.importorskip("xarray")
    coordinates = {}
    for k, (axis, unit) in enumerate((("z", "m"), ("y", "km"), ("x", "km"))):
        places = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
        places = places[::-1] * 1000 if axis == "z" else places
        coordinates[axis] = (axis, places, {"units": unit})
    data = xarray.DataArray(scan(), dims=("z", "y", "x"), coords=coordinates, name="T")
    data.to_netcdf(folder / "a.nc", engine="h5netcdf")
    place = affine(direction=np.diag([1, 1, -1]), origin=ORIGIN + np.array([0, 0, 4 * SPACING[2]]))
    return Kind(folder / "a.nc", to_world=place, unit="km")


@kind
def hdf5_itk(folder):
    """As ITK writes it: lengths along x, y and z beside the voxels."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.hdf5", "w") as file:
        group = file.create_group("ITKImage/0")
        group["VoxelData"], group["Directions"] = scan(), np.eye(3)
        group["Spacing"], group["Origin"] = SPACING, ORIGIN
    return Kind(folder / "a.hdf5")


@kind
def hdf5_emd(folder):
    """Of electron microscopy: coordinates are called dim1, dim2, dim3, and units like [n_m]."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.emd", "w") as file:
        group = file.create_group("data/tomogram")
        group.attrs["emd_group_type"], group["data"] = 1, scan()
        for k in range(3):
            group[f"dim{k + 1}"] = ORIGIN[2 - k] + SPACING[2 - k] * np.arange(SHAPE[k])
            group[f"dim{k + 1}"].attrs.update(name="zyx"[k], units="[n_m]")
    return Kind(folder / "a.emd", unit="nm")


@kind
def ome_zarr(folder):
    zarr = pytest.importorskip("zarr", minversion="3")
    group = zarr.open_group(str(folder / "a.ome.zarr"), mode="w", zarr_format=2)
    group.create_array("0", data=scan())
    steps = [
        {"type": "scale", "scale": SPACING[::-1].tolist()},
        {"type": "translation", "translation": ORIGIN[::-1].tolist()},
    ]
    axes = [{"name": a, "type": "space", "unit": "micrometer"} for a in "zyx"]
    image = {"datasets": [{"path": "0", "coordinateTransformations": steps}], "axes": axes}
    group.attrs["multiscales"] = [{"version": "0.4", **image}]
    return Kind(folder / "a.ome.zarr", unit="micrometer")


# FITS and MRC


def _fits(folder, array, bitpix, **more):
    cards = {"SIMPLE": "T", "BITPIX": bitpix, "NAXIS": 3}
    cards |= {f"NAXIS{i + 1}": n for i, n in enumerate(SHAPE[::-1])}
    for i in range(3):
        cards |= {f"CRPIX{i + 1}": 1.0, f"CRVAL{i + 1}": ORIGIN[i], f"CDELT{i + 1}": SPACING[i]}
        cards |= {f"CUNIT{i + 1}": "'m       '"}
    text = "".join(f"{k:<8}= {v!s:>20}".ljust(80) for k, v in {**cards, **more}.items()) + "END"
    data = array.astype(array.dtype.newbyteorder(">")).tobytes()
    whole = text.ljust(-(-len(text) // 2880) * 2880).encode() + data
    (folder / "a.fits").write_bytes(whole.ljust(-(-len(whole) // 2880) * 2880, b"\0"))
    return folder / "a.fits"


@kind
def fits(folder):
    return Kind(_fits(folder, scan(np.float32), -32), unit="m")


@kind
def fits_scaled(folder):
    path = _fits(folder, scan(), 16, BSCALE=0.5, BZERO=100.0)
    return Kind(path, scan() * 0.5 + 100, unit="m")


@kind
def fits_checked(folder):
    """CHECKSUM and DATASUM: sums of 32-bit words in which a carry comes round."""
    path = _fits(folder, scan(np.float32), -32)
    whole = path.read_bytes()
    head, data = whole[:2880], whole[2880:]

    def total(content):
        number = sum(struct.unpack(f">{len(content) // 4}I", content))
        while number >> 32:
            number = (number & 0xFFFFFFFF) + (number >> 32)
        return number

    def card(name, value):
        return f"{name:<8}= '{value}'".ljust(80).encode()

    text = head.rstrip()[:-3] + card("DATASUM", total(data))
    filled = (text + card("CHECKSUM", "0" * 16) + b"END").ljust(2880)
    rest = 0xFFFFFFFF - total(filled + data)
    # Each byte of what is missing as four letters, no punctuation, the last letter first
    columns = []
    for i in range(4):
        byte = rest >> (24 - 8 * i) & 255
        letters = [byte // 4 + (byte % 4 if k == 0 else 0) + 48 for k in range(4)]
        while any(58 <= n <= 64 or 91 <= n <= 96 for n in letters):
            for k in (0, 2):
                if any(58 <= n <= 64 or 91 <= n <= 96 for n in letters[k : k + 2]):
                    letters[k], letters[k + 1] = letters[k] + 1, letters[k + 1] - 1
        columns.append(letters)
    code = "".join(chr(columns[i][k]) for k in range(4) for i in range(4))
    code = code[-1] + code[:-1]
    path.write_bytes((text + card("CHECKSUM", code) + b"END").ljust(2880) + data)
    return Kind(path, unit="m")


def _mrc(folder, array, mode, name="a.mrc", order=(1, 2, 3)):
    header = bytearray(1024)
    struct.pack_into("<4i", header, 0, *array.shape[::-1], mode)
    struct.pack_into("<3i", header, 28, *SHAPE[::-1])
    struct.pack_into("<6f", header, 40, *(SPACING * SHAPE[::-1]), 90, 90, 90)
    struct.pack_into("<3i", header, 64, *order)
    struct.pack_into("<i", header, 88, 1)
    struct.pack_into("<3f", header, 196, *ORIGIN)
    header[208:216] = b"MAP \x44\x44\0\0"
    (folder / name).write_bytes(bytes(header) + array.tobytes())
    return folder / name


@kind
def mrc(folder):
    return Kind(_mrc(folder, scan(np.float32), 2), unit="angstrom")


@kind
def mrc_bytes(folder):
    return Kind(_mrc(folder, scan(np.int8), 0), scan(np.int8), unit="angstrom")


@kind
def ccp4_with_other_axes(folder):
    array = np.ascontiguousarray(scan(np.float32).transpose(2, 1, 0))  # z fastest
    return Kind(_mrc(folder, array, 2, "a.map", (3, 2, 1)), unit="angstrom")


# Pictures, and VTK's own


@kind
def png_slices(folder):
    from PIL import Image

    for i, page in enumerate(scan(np.uint8)):
        Image.fromarray(page).save(folder / f"s{i}.png")
    return Kind(folder, scan(np.uint8)[:, ::-1], np.eye(4))


@kind
def gif(folder):
    from PIL import Image

    pages = [Image.fromarray(page) for page in scan(np.uint8)]
    pages[0].save(folder / "a.gif", save_all=True, append_images=pages[1:])
    return Kind(folder / "a.gif", scan(np.uint8)[:, ::-1], np.eye(4))


def _grid():
    pv = pytest.importorskip("pyvista")
    grid = pv.ImageData(dimensions=SHAPE[::-1], spacing=SPACING, origin=ORIGIN)
    grid["T"] = scan().ravel()
    return grid


def _saved(name, binary=True):
    def make(folder):
        _grid().save(folder / name, binary=binary)
        return Kind(folder / name)

    return make


KINDS["vti"], KINDS["vtk"] = _saved("a.vti"), _saved("a.vtk")
KINDS["vtk_text"] = _saved("a.vtk", binary=False)


@kind
def vtr_equidistant(folder):
    pv = pytest.importorskip("pyvista")
    grid = pv.RectilinearGrid(*(ORIGIN[i] + SPACING[i] * np.arange(SHAPE[2 - i]) for i in range(3)))
    grid["T"] = scan().ravel()
    grid.save(folder / "a.vtr")
    return Kind(folder / "a.vtr")


@kind
def vtm_of_one(folder):
    pv = pytest.importorskip("pyvista")
    pv.MultiBlock([_grid()]).save(folder / "a.vtm")
    return Kind(folder / "a.vtm")


def _xdmf(time):
    def make(folder):
        pytest.importorskip("pyvista")
        z_first = [" ".join(map(str, numbers[::-1])) for numbers in (ORIGIN, SPACING)]
        places = "".join(f'<DataItem Format="XML" Dimensions="3">{n}</DataItem>' for n in z_first)
        values = " ".join(map(str, scan().ravel()))
        (folder / "a.xdmf").write_text(
            '<?xml version="1.0" ?><Xdmf Version="2.0"><Domain><Grid Name="g" GridType="Uniform">'
            f'{time}<Topology TopologyType="3DCoRectMesh" Dimensions="5 6 7"/>'
            f'<Geometry GeometryType="ORIGIN_DXDYDZ">{places}</Geometry>'
            '<Attribute Name="T" AttributeType="Scalar" Center="Node"><DataItem Format="XML" '
            f'Dimensions="5 6 7" NumberType="Int">{values}</DataItem></Attribute>'
            "</Grid></Domain></Xdmf>"
        )
        return Kind(folder / "a.xdmf")

    return make


KINDS["xdmf"], KINDS["xdmf_without_time"] = _xdmf('<Time Value="0"/>'), _xdmf("")


@kind
def cube(folder):
    """Gaussian's: text, z fastest, in Bohr, an atom before the values."""
    lines = ["a", "b", f"1 {ORIGIN[0]} {ORIGIN[1]} {ORIGIN[2]}"]
    for i in range(3):
        step = np.zeros(3)
        step[i] = SPACING[i]
        lines.append(f"{SHAPE[2 - i]} {step[0]} {step[1]} {step[2]}")
    lines += ["6 6.0 0.0 0.0 0.0", *(f"{v}.0" for v in scan().transpose(2, 1, 0).ravel())]
    (folder / "a.cube").write_text("\n".join(lines) + "\n")
    return Kind(
        folder / "a.cube",
        to_world=affine(SPACING * 0.529177249, ORIGIN * 0.529177249),
        unit="angstrom",
    )


#: What SimpleITK reads, too, and places likewise.
ITK = [
    "nifti",
    "nifti_gz",
    "nifti_scaled",
    "nifti_pair",
    "nifti_time",
    "nifti_rgba",
    "analyze",
    "minc_2",
    "nrrd",
    "nrrd_gzip",
    "nrrd_text",
    "nrrd_detached",
    "nrrd_list",
    "nrrd_pattern",
    "nrrd_axis_mins_of_cells",
    "nrrd_rgba",
    "nrrd_channels",
    "meta_image",
    "meta_image_detached",
    "meta_image_compressed",
    "meta_image_list",
    "meta_image_pattern",
    "meta_image_long",
    "meta_image_big_endian",
    "meta_image_times",
    "meta_image_channels",
    "meta_image_with_a_header_before_its_data",
    "dicom",
    "dicom_rle",
    "dicom_deflated",
    "mrc",
    "vtk",
    "vtk_text",
]

#: What it reads as pages, the top row first, that have no place: which of them. Others it reads
#: otherwise: a slope of NaN, LUTs, bits, halves, tiles and levels of TIFF, DICOM of several frames,
#: signed bytes and other orders of axes in MRC.
ITK_PAGES = dict.fromkeys(
    [
        "tiff",
        "tiff_imagej",
        "tiff_ome",
        "tiff_big_deflated",
        "tiff_lzw",
        "tiff_with_a_thumbnail",
        "png_slices",
    ],
    slice(None),
)
ITK_PAGES |= {"tiff_ome_channels": slice(5, 10), "tiff_times": slice(5, 10)}
ITK_PAGES |= {"tiff_channels": slice(1, None, 2)}

#: What they need beside the package and its tests.
NEEDS = {
    "nibabel": "nifti analyze mgh mgz minc afni par_rec",
    "astropy": "fits",
    "mrcfile": "mrc ccp4",
    "xarray": "netcdf",
    "h5netcdf": "netcdf",
}
