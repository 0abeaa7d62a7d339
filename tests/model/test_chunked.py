"""Volumes whose voxels are read chunk by chunk: of Dask, zarr and h5py, against NumPy's arrays."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import Camera, InvalidVolumeError, TransferFunction, Volume

VALUES = np.random.default_rng(4).integers(0, 200, (30, 21, 26), np.uint8)
CHUNKS = (8, 9, 10)
BOX = (slice(3, 17), slice(None), slice(20, 26))


def dask_array(values, _folder):
    return pytest.importorskip("dask.array").from_array(values, chunks=CHUNKS)


def zarr_array(values, folder):
    place, chunks = str(folder / "x.zarr"), (*(1,) * (values.ndim - 3), *CHUNKS)
    array = pytest.importorskip("zarr").open(
        place, mode="w", shape=values.shape, chunks=chunks, dtype=values.dtype
    )
    array[...] = values
    return array


def hdf5_data(values, folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "x.h5", "w") as file:
        file.create_dataset("a/b", data=values, chunks=CHUNKS)
    return h5py.File(folder / "x.h5")["a/b"]


SOURCES = {"dask": dask_array, "zarr": zarr_array, "h5py": hdf5_data}


@pytest.mark.parametrize(
    ("source", "dtype"), [("dask", "uint8"), ("zarr", "float16"), ("h5py", ">i2"), ("zarr", "bool")]
)
def test_parts_are_those_of_the_array(source, dtype, tmp_path):
    values = VALUES.astype(dtype)
    volume = Volume(SOURCES[source](values, tmp_path), (1, 2, 3))
    expected = Volume(values, (1, 2, 3))
    assert volume.chunked
    assert not expected.chunked
    for again in (volume, pickle.loads(pickle.dumps(volume))):
        assert again.array.chunks == CHUNKS
        assert again.array.dtype == expected.array.dtype
        assert again.array.shape == values.shape
        assert again.array.nbytes == expected.array.nbytes
        part = again.array[BOX]
        assert type(part) is np.ndarray
        assert part.dtype == expected.array.dtype
        assert part.flags.c_contiguous
        np.testing.assert_array_equal(part, expected.array[BOX])
    assert volume.bounds == expected.bounds
    assert volume.finite_range() == expected.finite_range()
    loaded = volume.load()
    assert not loaded.chunked
    np.testing.assert_array_equal(loaded.array, expected.array)


class Counted:
    """An array that counts what is read of it."""

    shape, dtype, chunks = VALUES.shape, VALUES.dtype, CHUNKS

    def __init__(self):
        self.read = []

    def __getitem__(self, box):
        self.read.append(box)
        return VALUES[box]


Counted.__module__ = "zarr.test"


def test_what_needs_the_whole_array_says_so():
    volume = Volume(Counted())
    camera = Camera((60, 50, 70), (13, 10, 15), (0, 1, 0))
    function = TransferFunction(np.ones((2, 3)), [0, 0.1], (0, 255))
    scene = volume, camera, (16, 9)
    pv = pytest.importorskip("pyvista")
    for use in (
        lambda: np.asarray(volume.array),
        lambda: pvdi.render_volume(*scene, transfer_function=function),
        lambda: volume.array.reshape(-1),
        lambda: pv.Plotter(off_screen=True).add_vdi(volume, cmap="bone"),
    ):
        with pytest.raises(InvalidVolumeError, match=r"read chunk by chunk.*volume\.load\(\)"):
            use()
    with pytest.raises(InvalidVolumeError, match="by three slices of step 1"):
        volume.array[0]
    assert not hasattr(volume.array, "something")
