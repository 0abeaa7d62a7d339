"""``.vdi`` files: every bit back, whole or not at all, and refusal of all that is not ours."""

from __future__ import annotations

import json
import os
import tracemalloc
import zipfile
import zlib
from io import BytesIO

import numpy as np
import pytest
from extension_marks import cases
from hypothesis import given, settings
from hypothesis import strategies as st
from rewriting import check_changed_bytes, declaring, described, rewritten
from strategies import random_vdi

from pyvista_vdi import VDI, Camera, io
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.io.vdi_file.layout import CHUNK_ROWS, INDEX_DTYPE
from pyvista_vdi.io.vdi_file.writer import coarser

CODECS = ("lz4", "zstd", "deflate", "none")
PRECISIONS = ("exact", "8-byte")
ARRAYS = ("counts", "front", "back", "color", "optical_depth")
VIEW = Camera((0, 0, 0), (0, 0, 1), (0, 1, 0))


def small_vdi(seed=1, precision="exact"):
    return random_vdi(np.random.default_rng(seed)).with_precision(precision)


def large_vdi(n_lists=(640, 512), per_list=2, **options):
    """More supersegments than one chunk holds; depths with the noise of real ones."""
    rng = np.random.default_rng(5)
    n = n_lists[0] * n_lists[1] * per_list
    faces = np.sort(rng.random((n // per_list, 2 * per_list), dtype=np.float32), axis=1) + 1
    faces += np.arange(2 * per_list, dtype=np.float32) * 1e-3  # no two equal
    front, back = faces.reshape(-1, 2).T
    offsets = np.arange(n_lists[0] * n_lists[1] + 1) * per_list
    colors = rng.random((n, 3), dtype=np.float32)
    depths = rng.exponential(size=n).astype(np.float32)
    return VDI(VIEW, n_lists, offsets, front, back, colors, depths, (-1, 1, -1, 1, 1, 2), **options)


@pytest.fixture
def file(tmp_path):
    return small_vdi().save(tmp_path / "small.vdi")


@pytest.fixture
def packed(tmp_path):
    """Plain arrays of the 8-byte form, one chunk each."""
    return small_vdi(precision="8-byte").save(tmp_path / "packed.vdi", compression="none")


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def rewrite(path, edit, **options):
    """Write the archive again with members changed by ``edit``; checksums fit what is written."""
    path.write_bytes(rewritten(path.read_bytes(), edit, **options))


def put(name, index, value, kind="<u2"):
    """Return an edit that changes numbers of an array without compression."""

    def edit(members):
        array = np.frombuffer(members[name], kind).copy()
        array[index] = value
        members[name] = array.tobytes()

    return edit


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32), codec=st.sampled_from(CODECS), precision=st.sampled_from(PRECISIONS)
)
def test_reading_gives_back_every_bit(seed, codec, precision, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / f"round_trip_{os.getpid()}.vdi"
    vdi = small_vdi(seed, precision)
    first = io.write(vdi, path, compression=codec).read_bytes()
    back = io.read(path)
    assert back.precision == precision
    assert back.equals(vdi), f"seed {seed}"
    assert io.write(back, path, compression=codec).read_bytes() == first


@pytest.mark.parametrize("precision", PRECISIONS)
def test_chunks_that_end_within_a_list(precision, tmp_path):
    vdi = large_vdi((320, 256), per_list=3)
    assert vdi.n_supersegments > 2 * CHUNK_ROWS
    assert CHUNK_ROWS % 3
    expected = vdi.with_precision(precision)
    path = vdi.save(tmp_path / "a.vdi", precision=precision)
    read, info = io.read(path), io.read_info(path)
    assert read.equals(expected)
    # Versions of packed files are newer: readers that know version 2 alone still read exact ones
    assert (info.precision, info.format_version) == (precision, 2 if precision == "exact" else 3)
    assert info.memory_bytes == expected.nbytes
    for name in ARRAYS[1:]:  # where a device that is a CPU uses them in place
        assert getattr(read, name).ctypes.data % 4096 == 0, name


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions and symbolic links")
def test_permissions_are_the_users_and_kept_and_links_are_followed(tmp_path):
    (tmp_path / "data").mkdir()
    real, link = tmp_path / "data" / "real.vdi", tmp_path / "a.vdi"
    link.symlink_to(real)
    old = os.umask(0o027)
    try:
        assert small_vdi().save(link) == real
    finally:
        os.umask(old)
    assert link.is_symlink()
    assert io.read(link).equals(small_vdi())
    assert real.stat().st_mode & 0o777 == 0o640
    real.chmod(0o600)
    small_vdi().save(link)
    assert real.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("name", "options", "message"),
    cases(
        ("a.vdi", {"compression": "gzip"}, r"must be one of lz4, zstd, deflate and none; got 'gz"),
        ("a.vdi", {"level": "best"}, "level must be a whole number from 1 to 9; got 'best'"),
        ("a.vdi", {"precision": "half"}, "precision must be .exact. or .8-byte."),
        ("a.vdi", {"exact": True}, "options compression, level, precision; got exact"),
        ("a.exr", {"compression": "zips"}, "with the options none; got compression"),
        ("a.html", {"compression": "zstd"}, "must be 'deflate'; got 'zstd'"),
    ),
)
def test_options_are_checked_before_anything_is_written(name, options, message, tmp_path):
    with pytest.raises(InvalidArgumentError, match=message):
        small_vdi().save(tmp_path / name, **options)
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("value", [np.nan, {1: {2}}])
def test_metadata_that_json_cannot_hold(value, tmp_path):
    with pytest.raises(VDIFileError, match="metadata cannot be written"):
        large_vdi((4, 4), metadata={"entry": value}).save(tmp_path / "a.vdi")
    assert names_in(tmp_path) == []


def archive_with(text):
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("vdi.json", text)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 5, "written_by": "pyvista-vdi 9.0"}, r"5, .* 9\.0'; .* versions 2 to 4: upgr"),
        ({"version": 1}, "of format version 1, .* reads versions 2 to 4"),
        ({"version": 2, "codec": "deflate"}, "version 2 has no codec 'deflate'"),
    ],
)
def test_other_versions_are_refused(changes, message, file):
    file.write_bytes(described(file.read_bytes(), precision="exact", **changes))
    with pytest.raises(VDIFileError, match=message):
        io.read(file)


FOREIGN = r"(?s)a\.vdi is (not a VDI file|truncated).*generate"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(100), FOREIGN),
        (b"P", FOREIGN),
        (archive_with('{"format": "other"}'), "not a VDI file: vdi.json does not name the format"),
        (b"", r"is damaged: it is empty; copy it .* again"),
    ],
)
def test_a_foreign_file(content, message, tmp_path):
    path = tmp_path / "a.vdi"
    path.write_bytes(content)
    with pytest.raises(VDIFileError, match=message):
        io.read(path)


@pytest.mark.parametrize("codec", ["lz4", "deflate"])
def test_every_truncation_is_noticed(codec, file):
    """One of version 4 has a whole file in it, which is not taken for the rest."""
    whole = small_vdi().save(file, compression=codec).read_bytes()
    cuts = {*range(60), *range(0, len(whole), 197), *range(len(whole) - 60, len(whole))}
    coarse_ends = whole.find(b"PK\5\6", 0, -22) + 22
    cuts |= {coarse_ends, coarse_ends + 1} if codec == "deflate" else set()
    for cut in sorted(cuts):
        file.write_bytes(whole[:cut])
        with pytest.raises(VDIFileError, match=r"is (truncated|damaged|not a VDI)"):
            io.read(file)
    file.write_bytes(whole[:-1])
    with pytest.raises(VDIFileError, match="is truncated: the directory at its end is missing"):
        io.read(file)


@pytest.mark.parametrize("precision", ["exact", "8-byte"])
def test_every_changed_byte_is_noticed_or_harmless(precision, file):
    small_vdi(precision=precision).save(
        file, compression="none" if precision == "8-byte" else "lz4"
    )
    places = range(0, file.stat().st_size, file.stat().st_size // 300)
    check_changed_bytes(file, io.read, VDIFileError, places)


def without(name):
    """Return an edit that leaves an entry of the description out."""

    def edit(members):
        description = json.loads(members["vdi.json"])
        del description[name]
        members["vdi.json"] = json.dumps(description).encode()

    return edit


@pytest.mark.parametrize(
    ("edit", "why"),
    [
        (put("back", 0, 65535), "no thickness, or a code beyond"),
        (put("optical_depth", 0, 4096), "no thickness, or a code beyond"),
        (put("stride", slice(None), 0), "lists with a stride are not those"),
        (put("origin", 0, -(2**31), "<i4"), "beyond the VDI's grid"),
        (put("counts", 0, 255, "u1"), "lists do not hold"),
        (without("depth_step"), "incomplete or wrong: KeyError.'depth_step'"),
    ],
)
def test_codes_that_packing_does_not_give(edit, why, packed):
    rewrite(packed, edit)
    with pytest.raises(VDIFileError, match=why):
        io.read(packed)


@pytest.mark.parametrize(
    ("codec", "declared"), [("lz4", {"n": 10**12}), ("deflate", {"window": [65536, 65536]})]
)
def test_nothing_is_allocated_for_what_a_file_only_declares(declared, codec, file):
    file.write_bytes(declaring(small_vdi().save(file, compression=codec).read_bytes(), **declared))
    tracemalloc.start()
    try:
        with pytest.raises(
            VDIFileError, match="its member 'chunks' has .* bytes for|array 'front': 0 chunks"
        ):
            io.read(file)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The file, its description and Python's own; the arrays declared would take tens of gigabytes
    assert peak < 4 * file.stat().st_size + 2**20


@pytest.mark.parametrize(
    ("name", "size", "message"),
    [
        ("color", 2**32 - 1, "array 'color': its chunks have 4294967295 bytes, but"),
        ("back", 16, "array 'back': 16 bytes cannot hold"),
        ("front", 17, "array 'front': its chunks have 17 bytes, but"),
        (None, None, "its member 'chunks' has 80 bytes for 5 chunks"),
    ],
)
def test_an_index_that_lies(name, size, message, file):
    def edit(members):
        index = np.frombuffer(members["chunks"], INDEX_DTYPE).copy()
        if name:
            index["bytes"][ARRAYS.index(name)] = size
        members["chunks"] = index.tobytes() * (1 if name else 2)

    rewrite(file, edit, arrays=())
    with pytest.raises(VDIFileError, match=f"is damaged: {message}"):
        io.read(file)


# With ids: pytest 8 would write 400 MB of zeros into its own
@pytest.mark.parametrize("more", [b"", b"\0" * 10**8], ids=["short", "long"])
def test_streams_of_zlib_that_lie_about_their_size(more, tmp_path):
    path = io.write(large_vdi((8, 8)), tmp_path / "a.vdi", compression="deflate")

    def edit(members):
        raw = zlib.decompress(members["front"])
        members["front"] = zlib.compress(raw + more if more else raw[:-1])

    rewrite(path, edit)
    tracemalloc.start()
    try:
        with pytest.raises(VDIFileError, match="a stream of zlib does not end after the 512 bytes"):
            io.read(path)
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()


def test_version_4_begins_with_a_coarse_level(tmp_path):
    vdi = large_vdi((18, 12))
    path = io.write(vdi, tmp_path / "a.vdi", compression="deflate")
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["vdi.json", "coarse.vdi", *ARRAYS, "chunks"]
        (tmp_path / "coarse.vdi").write_bytes(archive.read("coarse.vdi"))
    coarse = io.read(tmp_path / "coarse.vdi")
    assert coarse.equals(coarser(vdi).with_precision("8-byte"))
    assert io.read_info(tmp_path / "coarse.vdi").format_version == 4
    with zipfile.ZipFile(io.write(large_vdi((18, 3)), path, compression="deflate")) as archive:
        assert "coarse.vdi" not in archive.namelist()


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_that_are_compressed_elsewhere_or_there_twice_are_refused(file):
    whole = file.read_bytes()
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("color", b"")
    with pytest.raises(VDIFileError, match="two of its members have the same name"):
        io.read(file)
    moved = bytearray(whole)
    at = moved.rindex(b"color") - 4  # where the directory has the member's place
    moved[at : at + 4] = (len(moved) - 10).to_bytes(4, "little")
    file.write_bytes(moved)
    with pytest.raises(VDIFileError, match="member 'color' is not where its directory says"):
        io.read(file)
    file.write_bytes(rewritten(whole, lambda _: None, compress_type=zipfile.ZIP_DEFLATED))
    with pytest.raises(VDIFileError, match="its member 'vdi.json' is not stored plainly"):
        io.read(file)
