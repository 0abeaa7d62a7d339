"""Stores of zarr, and images of OME-Zarr in them; zarr is imported where one is opened."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIError, needing
from pyvista_vdi.io.axes import one_unit
from pyvista_vdi.io.stores.arrays import BROKEN, array_store, check_axes, grid_of, only_array
from pyvista_vdi.io.stores.record import Level, Store


def open_zarr(path: str, inner: str) -> Store:
    """Open an array or a multi-scale image of a zarr store, by its name or as the only one."""
    with needing(f"{path} needs zarr: pip install 'pyvista-vdi[files]'"):
        import zarr
    try:
        # Other processes, and this one in another folder, open the same one
        node: Any = zarr.open(path if "://" in path else os.path.abspath(path), mode="r")  # noqa: PTH100
        node = node[inner] if inner else node
    except Exception as error:  # each version and each kind of store has errors of its own
        raise InvalidVolumeError(
            f"{path}{'::' + inner if inner else ''} cannot be read as zarr: {error or 'not there'}"
        ) from error
    if hasattr(node, "shape"):
        return array_store(path, (inner, node), "zarr")
    attributes = node.attrs.asdict()
    described = attributes.get("ome", attributes)
    if "plate" in described or "well" in described:
        raise UnsupportedError(f"{path} is a plate of many images: open one, such as {path}::A/1/0")
    if "multiscales" not in described:
        before = f"{inner}/" if inner else ""
        try:
            arrays = {before + name: array for name, array in node.arrays() if array.ndim > 2}
        except BROKEN as error:
            raise InvalidVolumeError(f"{path} cannot be read as zarr: {error}") from error
        return array_store(path, only_array(path, "", arrays), "zarr")
    try:
        return _multiscale(path, node, described, "ome" in attributes)
    except VDIError as error:
        raise error if path in str(error) else type(error)(f"{path}: {error}") from error
    except BROKEN as error:
        raise InvalidVolumeError(
            f"the metadata of {path} break OME-Zarr ({type(error).__name__}: {error}): write them "
            "anew, or open an array of it by its name, as x.zarr::0"
        ) from error


def _multiscale(path: str, group: Any, described: Mapping[str, Any], in_ome: bool) -> Store:
    image = described["multiscales"][0]
    version = str((described if in_ome else image).get("version", "0.4"))
    if version not in (("0.5",) if in_ome else ("0.4",)):
        raise UnsupportedError(
            f"{path} is of OME-Zarr {version}: 0.4 and 0.5 are read; open an array of it by its "
            f"name instead ({path}::0), which knows no spacing"
        )
    kinds = {"time": "t", "channel": "c"}
    axes = tuple(kinds.get(axis.get("type"), axis["name"]) for axis in image["axes"])
    check_axes(path, axes)
    unit = one_unit([axis.get("unit") for axis in image["axes"][-3:]])
    levels, clock = [], (1.0, 0.0)
    for entry in image["datasets"]:
        array = group[entry["path"]]
        of_all = image.get("coordinateTransformations", ())
        steps = [*entry["coordinateTransformations"], *of_all]
        scale, translation = _placed(path, len(axes), steps)
        grid = grid_of(array.shape[-3:], scale[-3:], translation[-3:])
        levels.append(Level(entry["path"], array, grid))
        if "t" in axes and scale[axes.index("t")] > 0:
            clock = float(scale[axes.index("t")]), float(translation[axes.index("t")])
    names = [channel.get("label") for channel in described.get("omero", {}).get("channels", ())]
    channels = tuple(map(str, names)) if all(names) else ()
    kind = f"OME-Zarr {version}"
    return Store(path, tuple(levels), axes, unit, channels, kind, clock)


def _placed(
    path: str, count: int, steps: Sequence[Mapping[str, Any]]
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Return the scale and the translation that transformations, one after another, make."""
    scale, translation = np.ones(count), np.zeros(count)
    for step in steps:
        kind = step["type"]
        if kind == "identity":
            continue
        if kind not in ("scale", "translation") or kind not in step:
            raise UnsupportedError(
                f"{path} places its voxels by a transformation of type {kind!r}: scale and "
                "translation with numbers are read"
            )
        numbers = np.asarray(step[kind], dtype=np.float64)
        if numbers.shape != (count,):
            raise ValueError(f"{kind} has {numbers.size} numbers for {count} axes")
        if kind == "scale":
            scale, translation = scale * numbers, translation * numbers
        else:
            translation = translation + numbers
    return scale, translation
