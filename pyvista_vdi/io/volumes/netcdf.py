"""NetCDF 3 and 4 by xarray: packed values by the CF conventions, places by coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.io.axes import first_and_step, in_one_unit, to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: What axes are called, in standard names or by their dimensions, by the letters of ours.
_NAMES = {
    "x": "x lon longitude projection_x_coordinate xc i west_east easting",
    "y": "y lat latitude projection_y_coordinate yc j south_north northing",
    "z": "z lev level depth height altitude plev pressure k bottom_top",
    "t": "t time",
}


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
    along = {a: data.coords.get(variable.dims[axes.index(a)]) for a in "xyz" if a in axes}
    places, units, uneven = [(0.0, 1.0)] * 3, [""] * 3, None
    for k, axis in enumerate("xyz"):
        if (one := along.get(axis)) is not None:
            units[k] = str(one.attrs.get("units", ""))
            try:
                places[k] = first_and_step(one.values, f"{name!r} lies along {one.name!r}")
            except UnsupportedError as error:
                uneven = error

    def read(index: Any) -> Any:
        if uneven is not None:
            raise uneven
        with xr.open_dataset(file, **options) as again:
            return np.asarray(again[name][index].values)

    (origin, unit), (step, _) = (in_one_unit(n, units) for n in zip(*places, strict=True))
    array = Lazy(variable.shape, variable.dtype, read, in_parts=True)
    return VolumeInFile(array, axes, to_world(step, origin), name, unit)


def _letter(data: Any, dim: str) -> str:
    """Return which axis a dimension is: by its coordinate's attributes, then by its name."""
    coordinate = data.coords.get(dim)
    said = {} if coordinate is None else coordinate.attrs
    axis = str(said.get("axis", "")).lower()
    if axis and axis in "xyzt":
        return axis
    units = str(said.get("units", "")).lower().replace("degrees", "degree")
    for part, letter in (("since", "t"), ("degree_e", "x"), ("degree_n", "y")):
        if part in units:
            return letter
    names = (str(said.get("standard_name", "")), dim.lower())
    return next((a for name in names for a in "xyzt" if name in _NAMES[a].split()), "?")
