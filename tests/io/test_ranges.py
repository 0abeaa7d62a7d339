"""Ranges of chunks beside their store: whole or not at all, and never those of another content."""

from __future__ import annotations

import shutil
import tempfile

import numpy as np
import platformdirs
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.model.chunk_ranges import keeper_of

VALUES = np.random.default_rng(6).normal(size=(12, 10, 14)).astype(np.float32)
VALUES[:4, :5, :7] = np.nan
CHUNKS = (4, 5, 7)


def zarr_store(path):
    zarr = pytest.importorskip("zarr")
    array = zarr.open(str(path), mode="w", shape=VALUES.shape, chunks=CHUNKS, dtype="f4")
    array[...] = VALUES


def hdf5_store(path):
    with pytest.importorskip("h5py").File(path, "w") as file:
        file.create_dataset("x", data=VALUES, chunks=CHUNKS)


@pytest.fixture(params=[("x.zarr", zarr_store), ("x.h5", hdf5_store)], ids=["zarr", "h5py"])
def store(request, tmp_path, monkeypatch):
    name, write = request.param
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda *_, **__: str(tmp_path / "cache"))
    (tmp_path / "data").mkdir()
    write(tmp_path / "data" / name)
    return tmp_path / "data" / name


def kept(store):
    return list(store.with_name(store.name + ".ranges").glob("*.npz"))


def change_one_value(store):
    if store.name == "x.h5":
        with pytest.importorskip("h5py").File(store, "a") as file:
            file["x"][5, 5, 5] = 99
    else:
        pytest.importorskip("zarr").open(str(store), mode="a")[5, 5, 5] = 99


def expected(values):
    blocks = values.reshape(3, 4, 2, 5, 2, 7).transpose(0, 2, 4, 1, 3, 5).reshape(3, 2, 2, -1)
    return np.fmin.reduce(blocks, axis=-1), np.fmax.reduce(blocks, axis=-1)


def assert_same(found, values):
    for one, other in zip(found, expected(values), strict=True):
        np.testing.assert_array_equal(one, other)


def test_they_are_kept_beside_the_store(store):
    volume = pvdi.open_volume(store)
    assert volume.array.ranges() is None
    assert volume.finite_range() == (np.nanmin(VALUES), np.nanmax(VALUES))
    assert len(kept(store)) == 1
    assert [p.name for p in store.parent.rglob("*.tmp")] == []
    again = pvdi.open_volume(store)
    assert_same(again.array.ranges(), VALUES)


def test_not_those_of_a_store_that_has_changed(store):
    pvdi.open_volume(store).finite_range()
    change_one_value(store)
    volume = pvdi.open_volume(store)
    assert volume.array.ranges() is None
    assert volume.finite_range()[1] == 99
    changed = VALUES.copy()
    changed[5, 5, 5] = 99
    assert_same(pvdi.open_volume(store).array.ranges(), changed)


def test_what_was_read_while_the_store_changed_is_not_kept(store):
    volume = pvdi.open_volume(store)
    assert volume.array.ranges() is None
    before = expected(VALUES)
    if store.name == "x.zarr":  # HDF5 locks a file that is read
        change_one_value(store)
    else:
        store.touch()
    volume.array.keep_ranges(*before)
    assert not kept(store)


def test_what_is_kept_is_dropped_where_files_change_while_the_volume_is_open(store, tmp_path):
    volume = pvdi.open_volume(store)
    assert volume.finite_range()[1] == np.nanmax(VALUES)
    other = tmp_path / store.name
    shutil.copytree(store, other) if store.is_dir() else shutil.copy(store, other)
    change_one_value(other)
    if store.name == "x.zarr":
        shutil.copytree(other, store, dirs_exist_ok=True)
        assert volume.array.ranges() is None
        assert volume.finite_range()[1] == 99
        zarr_store(other)
        pytest.importorskip("zarr").open(str(other), mode="a").attrs["spacing"] = [1, 2, 3]
        shutil.copytree(other, store, dirs_exist_ok=True)
    else:
        shutil.copyfile(other, store)  # HDF5 has parts of the file in memory still
    for use in (volume.finite_range, volume.load):
        with pytest.raises(InvalidVolumeError, match="written anew.*open it again"):
            use()
    assert pvdi.open_volume(store).load().array[5, 5, 5] == other_value(other)


def test_what_its_own_process_writes_into_an_hdf5_file_counts(tmp_path):
    path = tmp_path / "x.h5"
    hdf5_store(path)
    with pytest.importorskip("h5py").File(path, "r+") as file:
        volume = pvdi.Volume(file["x"])
        volume.finite_range()
        file["x"][5, 5, 5] = 99
        assert volume.finite_range()[1] == 99


def other_value(store):
    return pvdi.open_volume(store).array[5:6, 5:6, 5:6].item()


def test_a_damaged_chunk_is_named_with_its_store(store):
    if store.name == "x.h5":
        with pytest.importorskip("h5py").File(store, "w") as file:
            data = file.create_dataset("x", data=VALUES, chunks=CHUNKS, compression="gzip")
            damaged = store, data.id.get_chunk_info_by_coord((4, 5, 7)).byte_offset
    else:
        (chunk,) = [f for f in store.rglob("*") if f.as_posix().endswith(("c/1/1/1", "1.1.1"))]
        damaged = chunk, 0
    with damaged[0].open("r+b") as stream:
        stream.seek(damaged[1])
        stream.write(b"nonsense" * 4)
    volume = pvdi.open_volume(store)
    with pytest.raises(
        InvalidVolumeError, match=rf"{store.name}.*\[4:8, 5:10, 7:14\].*copy it from its source"
    ):
        volume.finite_range()


def test_in_the_cache_where_the_store_s_folder_cannot_be_written(store, tmp_path):
    store.with_name(store.name + ".ranges").touch()  # no folder of this name can be made
    pvdi.open_volume(store).finite_range()
    assert len(list((tmp_path / "cache" / "ranges").rglob("*.npz"))) == 1
    assert_same(pvdi.open_volume(store).array.ranges(), VALUES)


def test_in_memory_where_neither_can(store, tmp_path, monkeypatch):
    store.with_name(store.name + ".ranges").touch()
    (tmp_path / "cache").touch()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "cache"))  # nor among temporary files
    volume = pvdi.open_volume(store)
    volume.finite_range()
    assert_same(volume.array.ranges(), VALUES)
    assert pvdi.open_volume(store).array.ranges() is None


@pytest.mark.parametrize("damage", [lambda b: b[:-40], lambda _: b"", lambda _: b"rubbish"])
def test_a_damaged_file_is_as_none(store, damage):
    pvdi.open_volume(store).finite_range()
    (file,) = kept(store)
    file.write_bytes(damage(file.read_bytes()))
    assert pvdi.open_volume(store).array.ranges() is None
    pvdi.open_volume(store).finite_range()
    assert_same(pvdi.open_volume(store).array.ranges(), VALUES)


def test_no_changed_byte_keeps_a_store_from_being_opened(store):
    pvdi.open_volume(store).finite_range()
    (file,) = kept(store)
    whole = file.read_bytes()
    for place in range(0, len(whole), 7):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        found = pvdi.open_volume(store).array.ranges()
        if found is not None:
            assert_same(found, VALUES)


def test_they_move_with_their_store(store, tmp_path):
    pvdi.open_volume(store).finite_range()
    shutil.move(store.parent, tmp_path / "moved")
    assert_same(pvdi.open_volume(tmp_path / "moved" / store.name).array.ranges(), VALUES)


def test_arrays_elsewhere_keep_none(tmp_path):
    zarr = pytest.importorskip("zarr")
    assert keeper_of(zarr.zeros((4, 4, 4), chunks=(2, 2, 2))) is None
    dask = pytest.importorskip("dask.array")
    assert keeper_of(dask.zeros((4, 4, 4))) is None
