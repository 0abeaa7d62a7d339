"""TIFF stacks, ImageJ's and OME-TIFF, by tifffile."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from pyvista_vdi.errors import warn_external
from pyvista_vdi.io.axes import in_one_unit, to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: Of a micrometre: what OME and ImageJ call it.
_MICRONS = ("um", "µm", "\\u00b5m", "micron", "microns")


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the series of three axes, with their levels; the top row is the last along y."""
    import tifffile

    def read(number: int, level: int, down: int) -> Any:
        with tifffile.TiffFile(file) as again:
            values = np.flip(again.asarray(series=number, level=level), down)
        return values if calibrated is None else (values * slope + shift).astype(calibrated)

    found: list[VolumeInFile] = []
    with tifffile.TiffFile(file) as tiff:
        calibrated, slope, shift = _calibration(tiff)
        many = sum(len(series.shape) > 2 for series in tiff.series) > 1
        levels = [
            (n, s, k, one) for n, s in enumerate(tiff.series) for k, one in enumerate(s.levels)
        ]
        for number, series, level, one in levels:
            axes, shape = _axes(one), one.shape
            if not {*"zyx"} <= {*axes} or (one.keyframe.is_reduced and not level):
                continue
            down = axes.index("y")
            kind = calibrated or one.dtype
            array: Any = Lazy(shape, kind, partial(read, number, level, down))
            mapped = one.dataoffset is not None and one.keyframe.is_memmappable
            if mapped and kind == one.dtype != bool and not tiff.is_ome:
                dtype = one.dtype.newbyteorder(tiff.byteorder)
                whole = tiff.filehandle.memmap_array(dtype, shape, offset=one.dataoffset)
                array = np.flip(whole, down)
            size, unit, channels = _described(tiff, number, one)
            coarser = [series.shape[axes.index(a)] / shape[axes.index(a)] for a in "xyz"]
            name = (series.name if many else "") or ""
            place = to_world(np.multiply(size, coarser))
            found.append(VolumeInFile(array, axes, place, name, unit, channels, level))
    return found


def _axes(series: Any) -> str:
    """Return the axes' letters: of those that nothing names the last is z."""
    axes = str(series.axes).lower()
    unnamed = next((letter for letter in "qi" if letter in axes and "z" not in axes), None)
    return "z".join(axes.rsplit(unnamed, 1)) if unnamed else axes


def _calibration(tiff: Any) -> tuple[Any, float, float]:
    """Return what ImageJ's values are of and by which line; it keeps signed ones as unsigned."""
    said = (tiff.imagej_metadata or {}) if tiff.is_imagej else {}
    shift, slope = float(said.get("c0", 0.0)), float(said.get("c1", 1.0))
    function = said.get("cf", 0 if (slope, shift) != (1, 0) else -1)
    if function not in (-1, 0, 20, 21):  # none, or of an uncalibrated density
        warn_external(
            f"{tiff.filename} calibrates its values by ImageJ's function {function}, which is not "
            "applied: values are those that are stored; apply it in ImageJ"
        )
    if function != 0:
        return None, 1.0, 0.0
    signed = (slope, shift) == (1, -32768) and tiff.series[0].dtype == np.uint16
    return np.dtype(np.int16 if signed else np.float32), slope, shift


def _described(tiff: Any, number: int, series: Any) -> tuple[list[float], str, tuple[str, ...]]:
    """Return the spacing along x, y and z, its unit and the channels' names, as the file says."""
    if tiff.is_ome and tiff.ome_metadata:
        root = ET.fromstring(tiff.ome_metadata)
        pixels = root.findall(".//{*}Pixels")
        if number < len(pixels):
            one = pixels[number]
            size = [float(one.get(f"PhysicalSize{a}", 1)) for a in "XYZ"]
            said = [f"PhysicalSize{a}" in one.attrib for a in "XYZ"]
            if said[0] and not said[2] and int(one.get("SizeZ", 1)) > 1:
                _say_apart(tiff.filename, f"{size[0]:g} x {size[1]:g}")
            units = [one.get(f"PhysicalSize{a}Unit", "µm") for a in "XYZ"]
            size, unit = in_one_unit(size, units) if said[0] else (size, "")
            return size, unit, _all([c.get("Name", "") for c in one.findall("{*}Channel")])
    if tiff.is_lsm:  # of Zeiss, in metres
        size = [1e6 * float(tiff.lsm_metadata.get(f"VoxelSize{a}", 0)) or 1.0 for a in "XYZ"]
        return size, "um", ()
    page = series.keyframe
    per = page.get_resolution() if 282 in page.tags and 283 in page.tags else (0, 0)
    size = [1 / n if n else 1.0 for n in per]
    if tiff.is_imagej:
        entries = tiff.imagej_metadata or {}
        unit, apart = str(entries.get("unit", "")), float(entries.get("spacing", 1.0)) or 1.0
        unit = "um" if unit in _MICRONS else unit.replace("pixel", "")
        names, axes = _all([str(n) for n in entries.get("Labels", ())]), _axes(series)
        each = "c" in axes and len(names) == series.shape[axes.index("c")]
        return [*size, apart], unit, names if each else ()
    if int(page.tags.valueof("ResolutionUnit", 1)) == 3 and all(per):
        _say_apart(tiff.filename, f"{10 / per[0]:g} x {10 / per[1]:g} mm")
    return [1.0, 1.0, 1.0], "", ()  # an inch's are most often nobody's


def _all(names: list[str]) -> tuple[str, ...]:
    return tuple(names) if all(names) and len(set(names)) == len(names) else ()


def _say_apart(name: str, pixels: str) -> None:
    warn_external(
        f"{name} says that pixels are {pixels}, and not how far apart slices are: spacing is taken "
        "as 1; give spacing=(x, y, z)"
    )
