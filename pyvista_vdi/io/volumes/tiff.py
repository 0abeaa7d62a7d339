"""TIFF stacks, ImageJ's and OME-TIFF, by tifffile."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from pyvista_vdi.errors import warn_external
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: Of a micrometre: what OME and ImageJ call it.
_MICRONS = ("um", "µm", "\\u00b5m", "micron", "microns")


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the series of three axes, with their levels; the top row is the last along y."""
    import tifffile

    found: list[VolumeInFile] = []
    with tifffile.TiffFile(file) as tiff:
        many = [s for s in tiff.series if len(s.shape) > 2]
        for number, series in enumerate(tiff.series):
            for level, one in enumerate(series.levels):
                axes = _axes(one)
                if not {*"zyx"} <= {*axes} or (one.keyframe.is_reduced and not level):
                    continue
                size, unit, channels = _described(tiff, number, one)
                shape = one.shape
                scale = [series.shape[axes.index(a)] / shape[axes.index(a)] for a in "xyz"]
                y = axes.index("y")
                back = (slice(None),) * y + (slice(None, None, -1),)

                def read(number: int = number, level: int = level, back: Any = back) -> Any:
                    with tifffile.TiffFile(file) as again:
                        return again.asarray(series=number, level=level)[back]

                mapped = one.dataoffset is not None and one.keyframe.is_memmappable
                array: Any = Lazy(shape, one.dtype, read)
                if mapped and one.dtype != bool and not tiff.is_ome:
                    array = tiff.filehandle.memmap_array(
                        one.dtype.newbyteorder(tiff.byteorder), shape, offset=one.dataoffset
                    )[back]
                to_world = np.diag([*np.multiply(size, scale), 1.0])
                name = (series.name if len(many) > 1 else "") or ""
                found.append(VolumeInFile(array, axes, to_world, name, unit, channels, level))
    return found


def _axes(series: Any) -> str:
    """Return the axes' letters: of those that nothing names the last is z."""
    axes = series.axes.lower()
    if "z" not in axes:
        for unnamed in "qi":
            at = axes.rfind(unnamed)
            if at >= 0:
                return str(axes[:at] + "z" + axes[at + 1 :])
    return str(axes)


def _described(tiff: Any, number: int, series: Any) -> tuple[list[float], str, tuple[str, ...]]:
    """Return the spacing along x, y and z, its unit and the channels' names, as the file says."""
    if tiff.is_ome and tiff.ome_metadata:
        root = ET.fromstring(tiff.ome_metadata)
        pixels = root.findall(".//{*}Pixels")
        if number < len(pixels):
            one = pixels[number]
            size = [float(one.get(f"PhysicalSize{a}", 1)) for a in "XYZ"]
            units = {one.get(f"PhysicalSize{a}Unit", "µm") for a in "XYZ"}
            said = one.get("PhysicalSizeX") is not None
            names = [channel.get("Name") or "" for channel in one.findall("{*}Channel")]
            return size, units.pop() if said and len(units) == 1 else "", _all(names)
    page = series.keyframe
    ratios = [page.tags.get(f"{a}Resolution") for a in "XY"]
    per = [r.value[0] / r.value[1] if r and all(r.value) else 0.0 for r in ratios]
    size = [1 / n if n else 1.0 for n in per]
    if tiff.is_imagej:
        entries = tiff.imagej_metadata or {}
        unit = str(entries.get("unit", ""))
        labels = _all([str(n) for n in entries.get("Labels", ())])
        named = labels if len(labels) == series.shape[_axes(series).find("c")] else ()
        return (
            [*size, float(entries.get("spacing", 1.0)) or 1.0],
            "um" if unit in _MICRONS else unit.replace("pixel", ""),
            named if "c" in _axes(series) else (),
        )
    if int(page.tags.valueof("ResolutionUnit", 1)) == 3 and all(per):
        warn_external(
            f"{tiff.filename} says that pixels are {10 / per[0]:g} x {10 / per[1]:g} mm, and not "
            "how far apart slices are: spacing is taken as 1; give spacing=(x, y, z)"
        )
    return [1.0, 1.0, 1.0], "", ()  # an inch's are most often nobody's


def _all(names: list[str]) -> tuple[str, ...]:
    return tuple(names) if all(names) and len(set(names)) == len(names) else ()
