"""Packed VDIs in .vdi files: every bit back, small, and refused where they were tampered with."""

from __future__ import annotations

import json
import os
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rewriting import described, rewritten
from strategies import random_vdi

from pyvista_vdi import VDI, Camera, io
from pyvista_vdi.cli import main
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.io.vdi_file.layout import CHUNK_ROWS
from pyvista_vdi.model.packing import channel_differences, colors_of_differences

CODECS = ("lz4", "zstd", "deflate", "none")
JUNK = (None, -1, True, 2**70, 1e300, "x", [], {}, [1], [[]], {"a": 1})
PACKED = ("16-byte", "8-byte")
ARRAYS = ("counts", "origin", "stride", "front", "back", "color", "optical_depth")


def packed_vdi(seed=1, precision="8-byte"):
    return random_vdi(np.random.default_rng(seed)).with_precision(precision)


def large_vdi(n_lists=(640, 512), per_list=2):
    """Depths with the noise of real ones."""
    rng = np.random.default_rng(5)
    total = n_lists[0] * n_lists[1]
    faces = np.sort(rng.random((total, 2 * per_list), dtype=np.float32), axis=1) + 1
    faces += np.arange(2 * per_list, dtype=np.float32) * 1e-3  # no two equal
    front, back = faces.reshape(-1, 2).T
    return VDI(
        Camera((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        n_lists,
        np.arange(total + 1) * per_list,
        front,
        back,
        rng.random((len(front), 3), dtype=np.float32),
        rng.exponential(size=len(front)),
        (-1, 1, -1, 1, 1, 2),
    )


def rewrite(path, edit, arrays=None):
    path.write_bytes(rewritten(path.read_bytes(), edit, arrays))


@pytest.fixture
def file(tmp_path):
    """Plain arrays of the 8-byte form, one chunk each."""
    return packed_vdi().save(tmp_path / "packed.vdi", compression="none")


def edit_array(path, name, edit):
    """Change an array of a file without compression; checksums fit what is written."""

    def changed(members):
        kind = {"counts": "u1", "origin": "<i4", "color": "u1"}.get(name, "<u2")
        array = np.frombuffer(members[name], kind).copy()
        edit(array)
        members[name] = array.tobytes()

    rewrite(path, changed, ARRAYS)


@given(seed=st.integers(0, 2**32), codec=st.sampled_from(CODECS), precision=st.sampled_from(PACKED))
def test_reading_gives_back_every_bit(seed, codec, precision, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / f"packed_{os.getpid()}.vdi"
    vdi = packed_vdi(seed, precision)
    first = io.write(vdi, path, compression=codec).read_bytes()
    back = io.read(path)
    assert back.precision == precision
    assert back.equals(vdi), f"seed {seed}"
    assert io.write(back, path, compression=codec).read_bytes() == first


@pytest.mark.parametrize("precision", PACKED)
def test_several_chunks(precision, tmp_path):
    """Lists of three, so that chunks end within a list."""
    vdi = large_vdi((320, 256), per_list=3)
    assert vdi.n_supersegments > 2 * CHUNK_ROWS[3]
    assert CHUNK_ROWS[3] % 3
    packed = vdi.with_precision(precision)
    path = vdi.save(tmp_path / "a.vdi", precision=precision)
    assert io.read(path).equals(packed)
    info = io.read_info(path)
    assert (info.precision, info.format_version) == (precision, 3)
    assert info.memory_bytes == packed.nbytes


def test_differences_of_channels_give_back_every_colour():
    colors = np.random.default_rng(3).integers(0, 256, (1000, 3), dtype=np.uint8)
    stored = channel_differences(colors)
    np.testing.assert_array_equal(stored[:, 0], colors[:, 2])
    np.testing.assert_array_equal(colors_of_differences(stored), colors)


def test_an_empty_vdi(tmp_path):
    for precision in PACKED:
        vdi = large_vdi((3, 2), per_list=1)
        none = type(vdi)(vdi.camera, (3, 2), [0] * 7, [], [], [], [], vdi.bounds)
        back = io.read(none.save(tmp_path / "a.vdi", precision=precision))
        assert (back.precision, back.n_supersegments) == (precision, 0)


def test_exact_files_are_what_they_were(tmp_path):
    """Readers that know version 2 alone still read them."""
    info = io.read_info(large_vdi((4, 4)).save(tmp_path / "a.vdi", precision="exact"))
    assert (info.format_version, info.precision) == (2, "exact")


def test_packed_files_are_smaller(tmp_path):
    sizes = [
        large_vdi().save(tmp_path / "a.vdi", precision=precision, compression=codec).stat().st_size
        for codec in ("none", "lz4", "deflate")
        for precision in ("exact", "16-byte", "8-byte")
    ]
    assert sizes[0] > sizes[1] > sizes[2]
    assert sizes[3] > sizes[4] > sizes[5]
    assert sizes[6] > sizes[7] > sizes[8]


def test_options_are_checked_before(tmp_path):
    with pytest.raises(InvalidArgumentError, match="precision must be one of exact, 16-byte and"):
        packed_vdi().save(tmp_path / "a.vdi", precision="half")
    with pytest.raises(InvalidArgumentError, match="got precision"):
        packed_vdi().save(tmp_path / "a.exr", precision="8-byte")
    assert not list(tmp_path.iterdir())


def test_convert_packs_and_unpacks(tmp_path, capsys):
    source = random_vdi(np.random.default_rng(2)).save(tmp_path / "exact.vdi")
    packed, exact = tmp_path / "packed.vdi", tmp_path / "again.vdi"
    assert main(["convert", str(source), "-o", str(packed), "--precision", "8-byte"]) == 0
    assert io.read(packed).equals(io.read(source).with_precision("8-byte"))
    assert main(["convert", str(packed), "-o", str(exact)]) == 0
    assert io.read(exact).precision == "8-byte"
    assert main(["convert", str(packed), "-o", str(exact), "--precision", "exact"]) == 0
    assert io.read(exact).precision == "exact"
    assert main(["info", str(packed)]) == 0
    assert "8-byte" in capsys.readouterr().out


# -- damaged and hostile files ---------------------------------------------------------------------


def test_every_changed_byte_is_noticed_or_harmless(file):
    whole = file.read_bytes()
    original, refused = io.read(file), 0
    positions = range(0, len(whole), max(1, len(whole) // 700))
    for position in positions:
        changed = bytearray(whole)
        changed[position] ^= 0x55
        file.write_bytes(changed)
        try:
            vdi = io.read(file)
        except VDIFileError:
            refused += 1
        else:
            assert vdi.equals(original), position
    assert refused > 0.8 * len(positions)


@pytest.mark.parametrize("key", ["precision", "depth_step", "arrays", "version"])
def test_junk_in_the_description(key, file):
    whole = file.read_bytes()
    for value in (*JUNK, "exact", "16-byte", 0.0, -0.5, 0.3, 2.0**-200, 2.0**200):
        if key == "depth_step" and value == 2**70:
            continue  # a power of two: another size of world
        file.write_bytes(described(whole, **{key: value}))
        with pytest.raises(VDIFileError):
            io.read(file)


def test_a_missing_step(file):
    with zipfile.ZipFile(file) as archive:
        description = json.loads(archive.read("vdi.json"))
    for name in ("depth_step", "precision"):
        left = {k: v for k, v in description.items() if k != name}
        rewrite(file, lambda members, d=left: members.update({"vdi.json": json.dumps(d).encode()}))
        with pytest.raises(VDIFileError, match=f"incomplete or wrong: KeyError.'{name}'"):
            io.read(file)


def put(index, value):
    def edit(array):
        array[index] = value

    return edit


@pytest.mark.parametrize(
    ("name", "edit", "why"),
    [
        ("back", put(0, 0), "no thickness, or a code beyond"),
        ("back", put(0, 65535), "no thickness, or a code beyond"),
        ("front", put(1, 65535), "no thickness, or a code beyond"),
        ("optical_depth", put(0, 4096), "no thickness, or a code beyond"),
        ("stride", put(slice(None), 0), "lists with a stride are not those"),
        ("stride", put(slice(None), 65535), "beyond the VDI's grid"),
        ("origin", put(0, 2**31 - 1), "beyond the VDI's grid"),
        ("origin", put(0, -(2**31)), "beyond the VDI's grid"),
        ("counts", put(0, 255), "lists do not hold"),
    ],
)
def test_codes_that_packing_does_not_give(name, edit, why, file):
    edit_array(file, name, edit)
    with pytest.raises(VDIFileError, match=why):
        io.read(file)
