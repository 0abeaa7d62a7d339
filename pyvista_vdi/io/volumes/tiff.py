"""TIFF stacks, ImageJ's and OME-TIFF, by tifffile."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from pyvista_vdi.errors import warn_external
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: Of a micrometre: what OME and ImageJ call it.
_MICRONS = ("um", "µm", "\\u00b5m", "micron", "microns")


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the series of three axes, with their levels; the top row is the last along y."""
    import tifffile

    def read(number: int, level: int, down: int) -> Any:
        with tifffile.TiffFile(file) as again:
            return np.flip(again.asarray(series=number, level=level), down)

    found: list[VolumeInFile] = []
    with tifffile.TiffFile(file) as tiff:
        many = sum(len(series.shape) > 2 for series in tiff.series) > 1
        levels = [
            (n, s, k, one) for n, s in enumerate(tiff.series) for k, one in enumerate(s.levels)
        ]
        for number, series, level, one in levels:
            axes, shape = _axes(one), one.shape
            if not {*"zyx"} <= {*axes} or (one.keyframe.is_reduced and not level):
                continue
            down = axes.index("y")
            array: Any = Lazy(shape, one.dtype, partial(read, number, level, down))
            mapped = one.dataoffset is not None and one.keyframe.is_memmappable
            if mapped and one.dtype != bool and not tiff.is_ome:
                whole = tifffile.memmap(file, series=number, level=level, mode="r")
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


def _described(tiff: Any, number: int, series: Any) -> tuple[list[float], str, tuple[str, ...]]:
    """Return the spacing along x, y and z, its unit and the channels' names, as the file says."""
    if tiff.is_ome and tiff.ome_metadata:
        root = ET.fromstring(tiff.ome_metadata)
        pixels = root.findall(".//{*}Pixels")
        if number < len(pixels):
            one = pixels[number]
            size = [float(one.get(f"PhysicalSize{a}", 1)) for a in "XYZ"]
            units = {one.get(f"PhysicalSize{a}Unit", "µm") for a in "XYZ"}
            unit = units.pop() if "PhysicalSizeX" in one.attrib and len(units) == 1 else ""
            return size, unit, _all([c.get("Name", "") for c in one.findall("{*}Channel")])
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
        warn_external(
            f"{tiff.filename} says that pixels are {10 / per[0]:g} x {10 / per[1]:g} mm, and not "
            "how far apart slices are: spacing is taken as 1; give spacing=(x, y, z)"
        )
    return [1.0, 1.0, 1.0], "", ()  # an inch's are most often nobody's


def _all(names: list[str]) -> tuple[str, ...]:
    return tuple(names) if all(names) and len(set(names)) == len(names) else ()
