"""NetCDF 3 and 4 by xarray: packed values by the CF conventions, places by coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: What axes are called, by the letters of ours; standard names and units come first.
_NAMES = {
    "x": ("x", "lon", "longitude", "xc", "i", "west_east", "easting"),
    "y": ("y", "lat", "latitude", "yc", "j", "south_north", "northing"),
    "z": (
        "z",
        "lev",
        "level",
        "depth",
        "height",
        "altitude",
        "plev",
        "pressure",
        "k",
        "bottom_top",
    ),
    "t": ("t", "time"),
}
_STANDARD = {"longitude": "x", "latitude": "y", "projection_x_coordinate": "x"}
_STANDARD |= {"projection_y_coordinate": "y", "depth": "z", "height": "z", "time": "t"}
#: By how much of a step coordinates may differ from equal ones.
_EVEN = 1e-4


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the variables of three axes or more."""
    import xarray as xr

    with file.open("rb") as stream:
        old = stream.read(3) == b"CDF"
    options: Any = {"engine": "scipy" if old else "h5netcdf", "decode_times": False}
    found = []
    with xr.open_dataset(file, **options) as data:
        for name, variable in data.data_vars.items():
            if variable.ndim > 2 and variable.dtype.kind in "biuf":
                found.append(_volume(file, data, str(name), variable, options))
    return found


def _volume(file: Path, data: Any, name: str, variable: Any, options: Any) -> VolumeInFile:
    import xarray as xr

    letters = [_letter(data, str(d)) for d in variable.dims]
    rest = [i for i, letter in enumerate(letters) if letter == "?"]
    missing = [a for a in "zyx" if a not in letters]
    for i, letter in zip(rest[::-1], missing[::-1], strict=False):  # the last three are z, y, x
        letters[i] = letter
    axes = "".join("c" if letter == "?" else letter for letter in letters)
    place, units, uneven = np.eye(4), [], ""
    for k, axis in enumerate("xyz"):
        dim = variable.dims[axes.index(axis)] if axis in axes else ""
        coordinate = data.coords.get(dim)
        units.append(str(coordinate.attrs.get("units", "")) if coordinate is not None else "")
        if coordinate is None or coordinate.size < 2:
            continue
        places = np.asarray(coordinate.values, dtype=np.float64)
        step = (places[-1] - places[0]) / (len(places) - 1)
        place[k, k], place[k, 3] = step, places[0]
        if not np.abs(np.diff(places) - step).max() <= _EVEN * abs(step):
            uneven = str(dim)
    unit = units[0] if len({*units}) == 1 else ", ".join(u or "1" for u in units)

    def read(index: Any) -> Any:
        if uneven:
            raise UnsupportedError(
                f"{file} has {name!r} at unequal distances along {uneven!r}: interpolate it, for "
                f"instance by xarray's data.interp({uneven}=...)"
            )
        with xr.open_dataset(file, **options) as again:
            return np.asarray(again[name][index].values)

    array = Lazy(variable.shape, variable.dtype, read, in_parts=True)
    return VolumeInFile(array, axes, place, name, unit)


def _letter(data: Any, dim: str) -> str:
    """Return which axis a dimension is: by its coordinate's attributes, then by its name."""
    coordinate = data.coords.get(dim)
    said = {} if coordinate is None else coordinate.attrs
    axis = str(said.get("axis", "")).lower()
    if axis and axis in "xyzt":
        return axis
    units = str(said.get("units", "")).lower()
    if "since" in units:
        return "t"
    for start, letter in (("degrees_e", "x"), ("degree_e", "x"), ("degrees_n", "y")):
        if units.startswith(start):
            return letter
    if (standard := str(said.get("standard_name", ""))) in _STANDARD:
        return _STANDARD[standard]
    return next((a for a, names in _NAMES.items() if dim.lower() in names), "?")
