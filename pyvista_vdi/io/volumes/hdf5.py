"""HDF5: which arrays there are, of NeXus which is meant, and Imaris's levels, by h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.coordinates import meant_of_nexus
from pyvista_vdi.io.stores import array_store, arrays_in
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.model.packed_values import packing_of


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the arrays of three axes or more, or the levels of an Imaris file."""
    import h5py

    with h5py.File(file, "r") as data:
        if "DataSet" in data and "DataSetInfo/Image" in data:
            return _imaris(file, data)
        meant = meant_of_nexus(data)
        found = {**arrays_in(data), **{name: data[name] for name in meant}}
        return [_described(file, name, each, meant) for name, each in found.items()]


def _described(file: Path, name: str, array: Any, meant: list[str]) -> VolumeInFile:
    import h5py

    store = array_store(str(file), (name, array), "HDF5")
    axes = "".join(axis if len(axis) == 1 else "?" for axis in store.axes)

    def read(index: Any) -> Any:
        with h5py.File(file, "r") as again:
            return again[name][index]

    packing = packing_of(array)
    lazy = Lazy(array.shape, packing.dtype if packing else array.dtype, read, in_parts=True)
    place = store.levels[0].grid.index_to_model
    return VolumeInFile(lazy, axes, place, name, store.unit, meant=name in meant)


def _imaris(file: Path, data: Any) -> list[VolumeInFile]:
    """Return the levels of an Imaris file, whose arrays are padded, and whose extents are outer."""
    import h5py

    image = data["DataSetInfo/Image"].attrs
    text = {key: b"".join(np.atleast_1d(value).tolist()).decode() for key, value in image.items()}
    low, high = (
        np.array([float(text[f"{end}{i}"]) for i in range(3)]) for end in ("ExtMin", "ExtMax")
    )
    found = []
    for level in range(len(data["DataSet"])):
        times = data[f"DataSet/ResolutionLevel {level}"]
        channels = times["TimePoint 0"]
        first = channels["Channel 0"]
        size = [int(b"".join(np.atleast_1d(first.attrs[f"ImageSize{a}"]).tolist())) for a in "ZYX"]
        step = (high - low) / size[::-1]
        place = to_world(step, low + step / 2)

        def read(index: Any, level: int = level, size: list[int] = size) -> Any:
            t, c = index[:2]
            name = f"DataSet/ResolutionLevel {level}/TimePoint {t}/Channel {c}/Data"
            with h5py.File(file, "r") as again:
                return again[name][tuple(slice(n) for n in size)]

        shape = (len(times), len(channels), *size)
        lazy = Lazy(shape, first["Data"].dtype, read, in_parts=True)
        unit = text.get("Unit", "").replace("µm", "um")
        found.append(VolumeInFile(lazy, "tczyx", place, f"level {level}", unit, (), level))
    return found
