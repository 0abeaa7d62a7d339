"""Coordinates of arrays in HDF5 and zarr: NeXus, dimension scales, and xarray's beside an array."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.io.axes import first_and_step, in_one_unit

#: Attributes by which an array says itself how far apart its points are.
_SAID = ("spacing", "origin", "element_size_um")


def attributes_of(array: Any, axes: Sequence[str]) -> dict[str, Any]:
    """Return an array's attributes, with what its coordinates say of spacing and origin.

    These are along z, y and x, and ``unit of length`` is theirs. ``axes``: of the array.
    """
    attributes = dict(array.attrs)
    group: Any = getattr(array, "parent", {})
    if {"VoxelData", "Directions", "Origin", "Spacing"} <= {*group}:  # of ITK
        if array.ndim != 3 or not np.allclose(group["Directions"][:], np.eye(3)):
            raise UnsupportedError(
                f"{array.name}, as ITK writes HDF5, is turned by its Directions or has several "
                "components, which is read of other formats: write it as NRRD"
            )
        said = {name.lower(): group[name][:][::-1] for name in ("Origin", "Spacing")}
        return {**attributes, **said}
    along = _coordinates(array)
    found = [along[axes.index(axis)] for axis in "zyx"]
    if any(name in attributes for name in _SAID) or all(each is None for each in found):
        return attributes
    places = [
        (0.0, 1.0) if each is None else first_and_step(each[:], f"{array.name} lies along {axis}")
        for each, axis in zip(found, "zyx", strict=True)
    ]
    units = ["" if each is None else _text(each.attrs.get("units", "")) for each in found[::-1]]
    if any(unit.startswith("[") for unit in units):  # of EMD: "[n_m]"
        units = [unit.strip("[]").replace("_", "") for unit in units]
    along_xyz = (in_one_unit(n[::-1], units) for n in zip(*places, strict=True))
    (origin, spacing), unit = zip(*((n[::-1], said) for n, said in along_xyz), strict=True)
    return {**attributes, "origin": origin, "spacing": spacing, "unit of length": unit[0]}


def _coordinates(array: Any) -> list[Any]:
    """Return the coordinates along each axis: an array, or None where there are none."""
    dims: Any = getattr(array, "dims", ())
    names: Any
    if type(array).__module__.partition(".")[0] == "h5py":
        group = array.parent
        said = array.attrs.get("axes", group.attrs.get("axes", ()))  # the former is of old NeXus
        said = _text(said).replace(",", ":").split(":") if isinstance(said, str | bytes) else said
        names = [_text(name).strip("[] ") for name in said]
        if "emd_group_type" in group.attrs:  # of electron microscopy
            names = [f"dim{i}" for i in range(1, array.ndim + 1)]
    else:
        names = getattr(getattr(array, "metadata", None), "dimension_names", None)
        names = [*(names or array.attrs.get("_ARRAY_DIMENSIONS", ()))]
        # An array that is the whole store has nothing beside it
        group = _group_of(array) if len(names) == array.ndim and array.path else {}
    found: list[Any] = [None] * array.ndim
    for i, n in enumerate(array.shape):
        scales = dims[i].values() if len(dims) else []
        one = group.get(names[i]) if len(names) == array.ndim else next(iter(scales), None)
        if one is not None and getattr(one, "shape", ()) == (n,) and one.dtype.kind in "iuf":
            found[i] = one
    return found


def _group_of(array: Any) -> Any:
    import zarr

    return zarr.open_group(array.store, mode="r", path=array.path.rpartition("/")[0])


def meant_of_nexus(file: Any) -> list[str]:
    """Return the names of the arrays that a NeXus file is about: one, where it says its default."""
    group = file
    while "default" in group.attrs and _text(group.attrs["default"]) in group:
        group = group[_text(group.attrs["default"])]
    found = []

    def visit(name: str, node: Any) -> None:
        if _text(node.attrs.get("NX_class", "")) != "NXdata":
            return
        signals = [key for key, each in node.items() if "signal" in each.attrs]  # of old NeXus
        signal = _text(node.attrs.get("signal", (*signals, "")[0]))
        one: Any = node.get(signal) if signal else None  # a link, more often than not
        if getattr(one, "ndim", 0) > 2 and one.dtype.kind in "biuf":
            found.append(f"{name}/{signal}".strip("/"))

    visit(group.name, group)
    if not found:
        group.visititems(lambda name, node: visit(f"{group.name}/{name}", node))
    return found


def _text(value: Any) -> str:
    value = np.ravel(value)[0] if isinstance(value, np.ndarray) and value.size else value
    return value.decode() if isinstance(value, bytes) else str(value)
