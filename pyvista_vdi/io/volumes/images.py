"""NRRD by pynrrd; NIfTI, MetaImage, GIPL and MINC by SimpleITK; MRC and NumPy's by NumPy."""

from __future__ import annotations

import gzip
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.axes import one_unit, to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.table import head_of
from pyvista_vdi.model.host_memory import aligned_empty

#: Units of length in NIfTI, and types in MRC.
_UNITS = {1: "m", 2: "mm", 3: "um"}
_MODES = {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}


def nrrd(file: Path) -> list[VolumeInFile]:
    """Return the volume of an NRRD file, in the coordinates that its ``space`` names.

    What pynrrd does not put together SimpleITK does: data in several files, other axes, borders.
    """
    import nrrd

    head = head_of(file).partition(b"\n\n")[0].decode("latin-1")
    header: Any = {}
    if not re.search(r"(?im)^(data ?file: *(LIST|\S*%)|axis ?m)", head):
        header = nrrd.read_header(str(file))
    if header.get("dimension") != 3 or {*header.get("kinds", ())} - {"domain", "space"}:
        array, axes, place = _by_itk(file)
        # ITK turns frames that grow to the right and the front: turn them back
        space = "".join(re.findall(r"(?im)^space: *(\S+)", head)).lower()
        initials = "".join(word[0] for word in space.split("-")) if "-" in space else space
        signs = [1 - 2 * (initials[:1] == "r"), 1 - 2 * (initials[1:2] == "a"), 1, 1]
        return [VolumeInFile(array, axes, np.diag(signs) @ place)]

    def read() -> NDArray[Any]:
        values, _ = nrrd.read(str(file), index_order="C")
        array = aligned_empty(values.shape, values.dtype.newbyteorder("="))
        array[...] = values  # where a CPU device reads it without a copy of its own
        return array

    steps = header.get("space directions", header.get("spacings", np.ones(3)))
    place = to_world(np.transpose(steps), header.get("space origin", np.zeros(3)))
    units = [str(unit) for unit in header.get("space units", header.get("units", ("", "", "")))]
    dtype = np.dtype(nrrd.reader._determine_datatype(header)).newbyteorder("=")
    array = Lazy(header["sizes"][::-1].tolist(), dtype, read)
    return [VolumeInFile(array, "zyx", place, str(header.get("content", "")), one_unit(units))]


def _by_itk(file: Path) -> tuple[NDArray[Any], str, NDArray[np.float64]]:
    """Return what SimpleITK reads: an array, its axes, and its place in ITK's frame."""
    import SimpleITK

    shown = SimpleITK.ProcessObject.GetGlobalWarningDisplay()
    SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        image = SimpleITK.ReadImage(str(file))
    finally:
        SimpleITK.ProcessObject.SetGlobalWarningDisplay(shown)
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
    unit = "" if file.suffix.lower() in (".mha", ".mhd") else "mm"
    return [VolumeInFile(*_by_itk(file), unit=unit)]


def nifti(file: Path) -> list[VolumeInFile]:
    """Return the volume of a NIfTI or Analyze file, in its own frame: right, front, head."""
    array, axes, place = _by_itk(file)
    # Take from the header what ITK rounds, brings to millimetres or decides otherwise
    head = head_of(file.with_name(re.sub(r"(?i)\.img(?=$|\.)", ".hdr", file.name)))
    order = "<" if head[:4] == b"\x5c\x01\0\0" else ">"
    real, short = (partial(np.frombuffer, head, f"{order}{kind}") for kind in ("f4", "i2"))
    quaternion, sform = short(2, 252)
    _require_bytes(file, int(real(1, 108)[0]) + array.size * int(short(1, 72)[0]) // 8)
    steps = np.abs(real(3, 80).astype(np.float64))
    slope, shift = real(2, 112)
    if shift and np.isfinite(shift) and not (slope and np.isfinite(slope)):
        array = array - array.dtype.type(shift)  # which ITK adds where values are not scaled
    steps[steps == 0], unit = 1.0, _UNITS.get(head[123] & 7, "")
    if head[344:347] not in (b"n+1", b"ni1"):
        return [VolumeInFile(array, axes, to_world(steps), unit="mm")]
    if sform > 0:
        place[:3] = real(12, 280).reshape(3, 4)
    elif quaternion > 0:
        turn = np.diag([-1, -1, 1]) @ place[:3, :3] / np.linalg.norm(place[:3, :3], axis=0)
        place = to_world(turn * steps, real(3, 268))
    else:
        place = to_world(steps)
    return [VolumeInFile(array, axes, place, unit=unit)]


def _require_bytes(file: Path, count: int) -> None:
    """Refuse a file of values that is cut off, or changed where gzip has a checksum."""
    values = file.with_name(re.sub(r"(?i)\.hdr(?=$|\.)", ".img", file.name))
    with values.open("rb") as stream:
        packed = stream.read(2) == b"\x1f\x8b"
    size = 0
    with gzip.open(values) if packed else values.open("rb") as stream:
        while part := stream.read(1 << 24):
            size += len(part)
    if size < count:
        raise InvalidVolumeError(f"it has {size} of {count} bytes: it is cut off")


def mrc(file: Path) -> list[VolumeInFile]:
    """Return an MRC or CCP4 map, axes as MAPC, MAPR and MAPS have them; lengths in angstrom.

    SimpleITK refuses maps that begin elsewhere than at a cell's corner, and half floats.
    """
    head = head_of(file)
    order = "<" if 0 < int.from_bytes(head[64:68], "little") < 4 else ">"
    words, reals = (np.frombuffer(head, f"{order}{kind}4", 56) for kind in "if")
    shape, mode, mapped = words[2::-1].tolist(), int(words[3]), words[16:19].tolist()
    if head[208:212] != b"MAP " or mode not in _MODES or sorted(mapped) != [1, 2, 3]:
        raise InvalidVolumeError(
            f"it is no map, or of mode {mode}, where modes {', '.join(map(str, _MODES))} are read"
        )
    axes = "".join("?xyz"[n] for n in mapped)
    counts = np.maximum(words[7:10], 1)
    step = np.where(reals[10:13] > 0, reals[10:13].astype(np.float64) / counts, 1.0)
    origin = reals[49:52].astype(np.float64)
    if not origin.any():  # CCP4's maps have whole voxels in place of an origin
        origin = step * [words[4 + axes.index(a)] for a in "xyz"]
    dtype, begin = np.dtype(f"{order}{_MODES[mode]}"), 1024 + int(words[23])
    array = np.fromfile(file, dtype, int(np.prod(shape)), offset=begin).reshape(shape)
    return [VolumeInFile(array, axes[::-1], to_world(step, origin), unit="angstrom")]


def numpy(file: Path) -> list[VolumeInFile]:
    """Return the array of an .npy file, or those of three axes in an .npz file."""
    if file.suffix.lower() == ".npz":
        with np.lib.npyio.NpzFile(file) as packed:  # which refuses objects
            return [_array(packed[name], name) for name in packed if packed[name].ndim > 2]
    return [_array(np.lib.format.open_memmap(file, mode="r"))]


def _array(array: NDArray[Any], name: str = "") -> VolumeInFile:
    n, colors = array.ndim, array.shape[3:] == (4,) and array.dtype == np.uint8
    axes = "zyxs" if colors else "?" * (n - 3) + "zyx"[-n:]
    return VolumeInFile(array, axes, name=name)
