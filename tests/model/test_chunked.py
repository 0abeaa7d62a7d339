"""Volumes whose voxels are read chunk by chunk: of Dask, zarr and h5py, against NumPy's arrays."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from drawing import generate_in_blocks

import pyvista_vdi as pvdi
from pyvista_vdi import Camera, InvalidVolumeError, TransferFunction, Volume
from pyvista_vdi.model.chunked import ChunkedArray

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


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("dtype", ["uint8", ">i2", "float32", "bool", "float16", "int64"])
def test_parts_are_those_of_the_array(source, dtype, tmp_path):
    values = VALUES.astype(dtype)
    volume = Volume(SOURCES[source](values, tmp_path), (1, 2, 3))
    expected = Volume(values, (1, 2, 3))
    assert volume.chunked
    assert not expected.chunked
    for again in (volume, pickle.loads(pickle.dumps(volume))):
        assert again.chunks.chunks == CHUNKS
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


def test_nothing_is_read_before_it_is_needed():
    source = Counted()
    volume = Volume(source)
    assert (volume.length, volume.dimensions, repr(volume)) == (
        volume.length,
        (26, 21, 30),
        "Volume(26 x 21 x 30 uint8, spacing=(1.0, 1.0, 1.0))",
    )
    assert not source.read
    volume.finite_range()
    assert len(source.read) == 4 * 3 * 3
    volume.finite_range()
    assert len(source.read) == 4 * 3 * 3


def test_ranges_leave_nan_out():
    dask = pytest.importorskip("dask.array")
    values = VALUES.astype(np.float32)
    values[:8, :9] = np.nan
    ends = Volume(dask.from_array(values, chunks=CHUNKS)).finite_range()
    assert ends == (np.nanmin(values), np.nanmax(values))


def test_time_and_channel_are_chosen_by_index(tmp_path):
    values = np.stack([VALUES, VALUES + 1])[:, None]
    array = zarr_array(values, tmp_path)
    with pytest.raises(InvalidVolumeError, match="three-dimensional.*choose time and channel"):
        Volume(array)
    chosen = ChunkedArray(array, index=(1, 0, slice(None), slice(None), slice(None)))
    np.testing.assert_array_equal(chosen[BOX], VALUES[BOX] + 1)
    assert chosen.chunks == CHUNKS


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
    with pytest.raises(InvalidVolumeError, match="three slices of step 1"):
        volume.array[0]
    assert not hasattr(volume.array, "something")


def test_a_target_loads_the_whole_array():
    """Settings are chosen by pictures of the volume, which need it in memory."""
    camera = Camera((60, 50, 70), (13, 10, 15), (0, 1, 0))
    looks = {"cmap": "bone", "opacity": "linear", "clim": (0, 200), "target_ssim": 0.5}
    found, whole = (
        pvdi.generate(Volume(array), camera, (24, 18), **looks) for array in (Counted(), VALUES)
    )
    assert found.equals(whole)


@pytest.mark.parametrize("source", ["dask", "h5py"])
def test_colours_and_uneven_chunks_are_refused_by_name(source, tmp_path):
    dask = pytest.importorskip("dask.array")
    colours = np.zeros((4, 5, 6, 4), dtype=np.uint8)
    array = dask.from_array(colours)
    if source == "h5py":
        file = pytest.importorskip("h5py").File(tmp_path / "x.h5", "w")
        array = file.create_dataset("colours", data=colours)
    with pytest.raises(InvalidVolumeError, match=r"RGBA: .*Volume\(numpy\.asarray\(array\)\)"):
        Volume(array)
    assert Volume(np.asarray(array)).rgba
    with pytest.raises(InvalidVolumeError, match="different lengths.*rechunk"):
        Volume(dask.from_array(VALUES, chunks=((8, 12, 10), 9, 10)))
    lazy = dask.from_array(VALUES)
    with pytest.raises(InvalidVolumeError, match="compute_chunk_sizes"):
        Volume(lazy[lazy[:, 0, 0] < 200])


@pytest.mark.extension("large")
def test_generate_makes_it_block_by_block(default_runtime):
    volume = Volume(Counted(), (1, 2, 3))
    camera = Camera((60, 50, 170), (13, 20, 45), (0, 1, 0))
    vdi = pvdi.generate(volume, camera, (32, 18), opacity="linear", device=default_runtime.info)
    function = TransferFunction.from_dict(vdi.metadata["transfer_function"])
    whole = Volume(VALUES, (1, 2, 3))
    expected = generate_in_blocks(
        whole, camera, (32, 18), function, chunks=CHUNKS, block_bytes=2**24
    )
    assert vdi.n_supersegments > 500
    np.testing.assert_array_equal(vdi.front, expected.front)
    np.testing.assert_array_equal(vdi.color, expected.color)
    assert vdi.metadata["blocks"] == [1, 1, 1]
