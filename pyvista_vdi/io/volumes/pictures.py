"""TIFF stacks, ImageJ's and OME-TIFF, by tifffile; pictures of slices by Pillow."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, warn_external
from pyvista_vdi.io.axes import in_one_unit, to_world
from pyvista_vdi.io.time_steps import natural_key
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile, stack

#: Of a micrometre: what OME and ImageJ call it.
_MICRONS = ("um", "µm", "\\u00b5m", "micron", "microns")
_TIFF = (".tif", ".tiff")


def tiff(file: Path) -> list[VolumeInFile]:
    """Return the series of three axes, with their levels; the top row is the last along y."""
    import tifffile

    def read(number: int, down: int) -> NDArray[Any]:
        with tifffile.TiffFile(file) as again:
            values = np.flip(again.asarray(series=number), down)
        return values if calibrated is None else (values * slope + shift).astype(calibrated)

    found = []
    with tifffile.TiffFile(file) as stack:
        calibrated, slope, shift = _calibration(stack)
        many = len(stack.series) > 1
        for number, series in enumerate(stack.series):
            axes = _axes(series)
            if not {*"zyx"} <= {*axes} or series.keyframe.is_reduced:
                continue
            lazy = partial(read, number, axes.index("y"))
            array = Lazy(series.shape, calibrated or series.dtype, lazy)
            size, unit, channels = _described(stack, number, series)
            name = series.name if many else ""
            found.append(VolumeInFile(array, axes, to_world(size), name, unit, channels))
    return found


def _axes(series: Any) -> str:
    """Return the axes' letters: of those that nothing names the last is z."""
    axes = str(series.axes).lower()
    unnamed = next((letter for letter in "qi" if letter in axes and "z" not in axes), None)
    return "z".join(axes.rsplit(unnamed, 1)) if unnamed else axes


def _calibration(stack: Any) -> tuple[Any, float, float]:
    """Return what ImageJ's values are of and by which line; it keeps signed ones as unsigned."""
    said = (stack.imagej_metadata or {}) if stack.is_imagej else {}
    shift, slope = float(said.get("c0", 0.0)), float(said.get("c1", 1.0))
    function = said.get("cf", 0 if (slope, shift) != (1, 0) else -1)
    if function not in (-1, 0, 20, 21):  # none, or of an uncalibrated density
        warn_external(
            f"{stack.filename} calibrates its values by ImageJ's function {function}, which is not "
            "applied: values are those that are stored; apply it in ImageJ"
        )
    if function != 0:
        return None, 1.0, 0.0
    signed = (slope, shift) == (1, -32768) and stack.series[0].dtype == np.uint16
    return np.dtype(np.int16 if signed else np.float32), slope, shift


def _described(stack: Any, number: int, series: Any) -> tuple[list[float], str, tuple[str, ...]]:
    """Return the spacing along x, y and z, its unit and the channels' names, as the file says."""
    if stack.is_ome and stack.ome_metadata:
        pixels = ET.fromstring(stack.ome_metadata).findall(".//{*}Pixels")
        if number < len(pixels):
            one = pixels[number]
            size = [float(one.get(f"PhysicalSize{a}", 1)) for a in "XYZ"]
            said = [f"PhysicalSize{a}" in one.attrib for a in "XYZ"]
            if said[0] and not said[2] and int(one.get("SizeZ", 1)) > 1:
                _say_apart(stack.filename, f"{size[0]:g} x {size[1]:g}")
            units = [one.get(f"PhysicalSize{a}Unit", "µm") for a in "XYZ"]
            size, unit = in_one_unit(size, units) if said[0] else (size, "")
            return size, unit, _all([c.get("Name", "") for c in one.findall("{*}Channel")])
    if stack.is_lsm:  # of Zeiss, in metres
        return [1e6 * float(stack.lsm_metadata[f"VoxelSize{a}"]) for a in "XYZ"], "um", ()
    page = series.keyframe
    per = page.get_resolution() if 282 in page.tags and 283 in page.tags else (0, 0)
    if stack.is_imagej:
        entries = stack.imagej_metadata or {}
        unit, apart = str(entries.get("unit", "")), float(entries.get("spacing", 1.0)) or 1.0
        unit = "um" if unit in _MICRONS else unit.replace("pixel", "")
        names, axes = _all([str(n) for n in entries.get("Labels", ())]), _axes(series)
        each = "c" in axes and len(names) == series.shape[axes.index("c")]
        return [*(1 / n if n else 1.0 for n in per), apart], unit, names if each else ()
    if int(page.tags.valueof("ResolutionUnit", 1)) == 3 and all(per):
        _say_apart(stack.filename, f"{10 / per[0]:g} x {10 / per[1]:g} mm")
    return [1.0, 1.0, 1.0], "", ()  # an inch's are most often nobody's


def _all(names: list[str]) -> tuple[str, ...]:
    return tuple(names) if all(names) and len(set(names)) == len(names) else ()


def _say_apart(name: str, pixels: str) -> None:
    warn_external(
        f"{name} says that pixels are {pixels}, and not how far apart slices are: spacing is taken "
        "as 1; give spacing=(x, y, z)"
    )


def slices_in(folder: Path) -> list[Path]:
    """Return the pictures of slices in a folder, in natural order."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    found = [file for file in files if file.suffix.lower() in (*_TIFF, ".png")]
    return sorted(found, key=lambda file: natural_key(file.name.lower()))


def pictures(path: Path) -> list[VolumeInFile]:
    """Return the pictures in a folder as slices along z, by the types that they have.

    The top row is the last along y, as VTK has pictures.
    """
    files = slices_in(path) if path.is_dir() else [path]
    if len(files) < 2:
        raise InvalidVolumeError(
            f"{path} holds one slice, and a volume needs two: give the folder that holds all"
        )
    numbers = [int(n[-1]) for file in files if (n := re.findall(r"\d+", file.stem))]
    if len(numbers) == len(files) and len(set(np.diff(numbers))) > 1:
        warn_external(
            f"the numbers of the slices in the folder {path} are not evenly spaced "
            f"({files[0].name} to {files[-1].name}, {len(files)} files), and are taken as if: "
            "are some missing?"
        )
    slices = stack(files, _picture)
    return [VolumeInFile(slices, "zyxs"[: len(slices.shape)])]


def _picture(file: Path) -> NDArray[Any]:
    try:
        if file.suffix.lower() in _TIFF:
            import tifffile

            found = np.asarray(tifffile.imread(file))
        else:
            from PIL import Image

            with Image.open(file) as picture:
                found = np.asarray(picture.convert("RGBA") if picture.mode == "P" else picture)
    except Exception as error:  # each format has readers, and exceptions, of its own
        raise InvalidVolumeError(f"{file} cannot be read as a picture: {error}") from error
    return found[::-1]
