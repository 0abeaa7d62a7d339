"""Files: exact round trips, whole or not at all, and refusal of everything that is not ours.

One format, and the files by which each way of breaking it is tried: hence more than 500 lines.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import tracemalloc
import zipfile
import zlib
from io import FileIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import random_vdi

from pyvista_vdi import VDI, Camera, io
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.io.vdi_file import chunks, writer
from pyvista_vdi.io.vdi_file.layout import CHUNK_ROWS, INDEX_DTYPE
from pyvista_vdi.model.coarser import coarser

CODECS = ("lz4", "zstd", "deflate", "none")
ARRAYS = ("counts", "front", "back", "color", "optical_depth")
STORED = Path(__file__).parent / "files"


def small_vdi(seed=1):
    return random_vdi(np.random.default_rng(seed))


def large_vdi(n_lists=(640, 512), per_list=2, **options):
    """More supersegments than one chunk holds; depths with the noise of real ones."""
    rng = np.random.default_rng(5)
    n = n_lists[0] * n_lists[1] * per_list
    faces = np.sort(rng.random((n // per_list, 2 * per_list), dtype=np.float32), axis=1) + 1
    faces += np.arange(2 * per_list, dtype=np.float32) * 1e-3  # no two equal
    front, back = faces.reshape(-1, 2).T
    return VDI(
        Camera((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        n_lists,
        np.arange(n_lists[0] * n_lists[1] + 1) * per_list,
        front,
        back,
        rng.random((n, 3), dtype=np.float32),
        rng.exponential(size=n).astype(np.float32),
        (-1, 1, -1, 1, 1, 2),
        **options,
    )


@pytest.fixture
def file(tmp_path):
    return small_vdi().save(tmp_path / "small.vdi")


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def rewrite(path, edit, *, index=True, **options):
    """Write the archive again with members changed by ``edit``; checksums fit what is written.

    Where an array has one chunk, as all of a small VDI's, its entry in the index fits as well.
    """
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    edit(members)
    if index and len(members.get("chunks", b"")) == INDEX_DTYPE.itemsize * len(ARRAYS):
        found = [members.get(name, b"") for name in ARRAYS]
        rows = np.array([(len(data), zlib.crc32(data)) for data in found], INDEX_DTYPE)
        members["chunks"] = rows.tobytes()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data, **options)


def edit_description(path, **changes):
    def edit(members):
        description = json.loads(members["vdi.json"])
        for name, value in changes.items():
            description[name] = value
        members["vdi.json"] = json.dumps(description).encode()

    rewrite(path, edit)


# -- round trips -----------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32), codec=st.sampled_from(CODECS))
def test_reading_gives_back_every_bit(seed, codec, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / f"round_trip_{os.getpid()}.vdi"
    vdi = small_vdi(seed)
    io.write(vdi, path, compression=codec)
    assert io.read(path).equals(vdi), f"seed {seed}"


@pytest.mark.parametrize("codec", CODECS)
def test_several_chunks_and_metadata(codec, tmp_path):
    vdi = large_vdi(depth_origin=0.1, metadata={"criterion": "x", "values": [1, 2.5, None]})
    assert vdi.n_supersegments > 2 * CHUNK_ROWS[2]
    back = io.read(io.write(vdi, tmp_path / "a.vdi", compression=codec))
    assert back.equals(vdi)
    assert back.metadata == vdi.metadata
    assert back.camera == vdi.camera


@pytest.mark.parametrize("count", [0, 1, 255, 256, 70000])
def test_lists_of_any_length(count, tmp_path):
    faces = np.arange(2 * count, dtype=np.float32).reshape(-1, 2) + 1
    vdi = VDI(
        Camera((0, 0, 0), (0, 0, 1), (0, 1, 0)),
        (2, 1),
        [0, count, count],
        faces[:, 0],
        faces[:, 1],
        np.full((count, 3), 0.5),
        np.ones(count),
        (0, 1, 0, 1, 0, 1),
    )
    assert io.read(vdi.save(tmp_path / "a.vdi")).equals(vdi)


def test_negative_depths_and_signed_zeros(tmp_path):
    view = Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), parallel_projection=True)
    vdi = VDI(
        view,
        (1, 1),
        [0, 3],
        [-2.0, -0.0, 1e-38],
        [-1.0, 1e-40, 3e38],
        np.zeros((3, 3)),
        [0.0, -0.0, 1e30],
        (0, 1, 0, 1, 0, 1),
    )
    back = io.read(vdi.save(tmp_path / "a.vdi"))
    for name in ("front", "back", "optical_depth"):
        assert getattr(back, name).tobytes() == getattr(vdi, name).tobytes()


@pytest.mark.parametrize("precision", ["exact", "16-byte", "8-byte"])
def test_what_is_read_lies_where_a_cpu_device_uses_it_in_place(tmp_path, precision):
    vdi = large_vdi().with_precision(precision)
    read = io.read(vdi.save(tmp_path / "large.vdi"))
    assert read.equals(vdi)
    for name in ("front", "back", "color", "optical_depth"):
        assert getattr(read, name).ctypes.data % 4096 == 0, name


def test_the_same_vdi_gives_the_same_bytes(tmp_path, monkeypatch):
    vdi = large_vdi()
    first = io.write(vdi, tmp_path / "a.vdi").read_bytes()
    monkeypatch.setattr(chunks, "_MAX_THREADS", 1)
    assert io.write(vdi, tmp_path / "b.vdi").read_bytes() == first


def test_compression_makes_smaller_files(tmp_path):
    sizes = [
        io.write(large_vdi(), tmp_path / f"{codec}.vdi", compression=codec).stat().st_size
        for codec in ("zstd", "none")
    ]
    assert sizes[0] < 0.9 * sizes[1]


@pytest.mark.parametrize("suffix", ["vdi", "exr", "html"])
def test_no_level_is_the_usual_one(suffix, tmp_path):
    path = tmp_path / f"a.{suffix}"
    usual = small_vdi().save(path).read_bytes()
    assert small_vdi().save(path, level=None).read_bytes() == usual


def test_save_takes_text_and_overwrites(tmp_path):
    path = str(tmp_path / "a.vdi")
    small_vdi(1).save(path)
    small_vdi(2).save(path)
    assert io.read(path).equals(small_vdi(2))
    assert names_in(tmp_path) == ["a.vdi"]


def test_numpy_metadata_become_plain(tmp_path):
    vdi = large_vdi((4, 4), metadata={"a": np.float32(0.5), "b": np.arange(3)})
    assert io.read(vdi.save(tmp_path / "a.vdi")).metadata == {"a": 0.5, "b": [0, 1, 2]}


# -- information -----------------------------------------------------------------------------------


def test_info_says_what_the_vdi_is(tmp_path):
    vdi = large_vdi((40, 30), metadata={"tolerance": 0.5}, depth_origin=1.0)
    info = io.read_info(io.write(vdi, tmp_path / "a.vdi", compression="lz4"))
    assert (info.window_size, info.n_supersegments) == ((40, 30), 2400)
    assert (info.camera, info.bounds, info.depth_origin) == (vdi.camera, vdi.bounds, 1.0)
    assert (info.metadata, info.codec, info.format_version) == ({"tolerance": 0.5}, "lz4", 2)
    assert info.memory_bytes == vdi.nbytes
    assert info.file_bytes == (tmp_path / "a.vdi").stat().st_size


def test_info_does_not_read_the_arrays(file):
    rewrite(file, lambda members: members.update(color=b"no chunks"))
    assert io.read_info(file).window_size == small_vdi().window_size
    with pytest.raises(VDIFileError, match=r"small\.vdi is damaged: array 'color'"):
        io.read(file)


def test_info_reads_as_little_of_a_large_file_as_of_a_small_one(tmp_path, monkeypatch):
    """What is read is the description and the archive's directory, however large the arrays."""
    read_bytes = []
    opened = Path.open

    class Counting(FileIO):
        def read(self, *size):
            data = super().read(*size)
            read_bytes[-1] += len(data)
            return data

    monkeypatch.setattr(Path, "open", lambda path, mode="r": Counting(path, mode))
    for n_lists in ((2, 2), (640, 512)):
        vdi = large_vdi(n_lists)
        with monkeypatch.context() as unpatched:
            unpatched.setattr(Path, "open", opened)
            path = io.write(vdi, tmp_path / "a.vdi", compression="none")
        read_bytes.append(0)
        assert io.read_info(path).n_supersegments == vdi.n_supersegments
    assert path.stat().st_size > 10**7
    assert max(read_bytes) < 6000
    assert read_bytes[1] - read_bytes[0] < 100  # longer numbers in the description


# -- version 1 -------------------------------------------------------------------------------------


def version_1_vdi(n):
    """What the stored files hold: pyvista-vdi wrote them when 1 was the format's version."""
    k = np.arange(n, dtype=np.float32)
    last = k >= n - 3
    return VDI(
        Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), view_angle=20.0),
        (3, 2),
        [0, 0, n - 3, n - 3, n, n, n],
        np.where(last, k - n + 3.25, k),
        np.where(last, k - n + 3.75, k + 1),
        np.stack([k % 2, k % 4 / 4, k % 8 / 8], axis=1),
        k % 16 / 3,
        (-1, 1, -2, 2, 0, n),
        depth_origin=0.1,
        metadata={"criterion": "none", "values": [1, 2.5]},
    )


@pytest.mark.parametrize(("codec", "n"), [("zstd", 300_000), ("none", 60)])
def test_files_of_version_1_are_read(codec, n):
    path = STORED / f"version_1_{codec}.vdi"
    assert n <= 100 or n > CHUNK_ROWS[1]  # one chunk, and more
    info = io.read_info(path)
    assert (info.format_version, info.codec, info.n_supersegments) == (1, codec, n)
    vdi, expected = io.read(path), version_1_vdi(n)
    assert vdi.equals(expected)
    assert vdi.metadata == expected.metadata


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda m: m.update(depth=m["depth"][:-1]), "array 'depth': "),
        (lambda m: m.update(color=m["color"] + b"x"), "array 'color': its chunks have"),
        (lambda m: m.update(color=m["color"][:20]), "array 'color': the data end before row"),
        (lambda m: m.pop("optical_depth"), "its member 'optical_depth' is missing"),
    ],
)
@pytest.mark.parametrize("codec", ["zstd", "none"])
def test_damaged_files_of_version_1(codec, edit, message, tmp_path):
    path = tmp_path / "a.vdi"
    path.write_bytes((STORED / f"version_1_{codec}.vdi").read_bytes())
    rewrite(path, edit)
    with pytest.raises(VDIFileError, match=f"is damaged: {message}"):
        io.read(path)


# -- whole or not at all ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "expected", "message"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), VDIFileError, "No space left on device"),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        (MemoryError(), MemoryError, None),
    ],
)
def test_a_failure_leaves_the_old_file_and_nothing_else(
    error, expected, message, file, monkeypatch
):
    before = file.read_bytes()

    def fail(stream, *_):
        stream.write(b"half")
        raise error

    monkeypatch.setattr(writer, "write_chunks", fail)
    with pytest.raises(expected, match=message):
        small_vdi(2).save(file)
    assert file.read_bytes() == before
    assert names_in(file.parent) == [file.name]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no/such/folder/a.vdi", r"the folder .*folder does not exist; create it"),
        ("folder.vdi", r"folder\.vdi cannot be written: it is a folder"),
        ("plain/a.vdi", r"the folder .*plain does not exist"),
        ("a.png", r"'.*a\.png' cannot be written as a VDI: the name must end in \.vdi.*'a\.vdi'"),
        ("", r"must end in \.vdi"),
        ("a\0b.vdi", "cannot be written"),
        ("x" * 300 + ".vdi", "cannot be written"),
    ],
)
def test_unwritable_targets_are_refused_before_anything_is_done(name, message, tmp_path):
    (tmp_path / "folder.vdi").mkdir()
    (tmp_path / "plain").write_text("not a folder")
    target = f"{tmp_path}/{name}" if name else ""
    with pytest.raises(VDIFileError, match=message):
        io.checked_target(target)
    with pytest.raises(VDIFileError, match=message):
        small_vdi().save(target)
    assert names_in(tmp_path) == ["folder.vdi", "plain"]


def test_a_checked_target_is_left_alone(tmp_path):
    io.checked_target(tmp_path / "a.vdi")
    assert names_in(tmp_path) == []


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")
def test_permissions_are_the_users_and_kept(tmp_path):
    old = os.umask(0o027)
    try:
        path = small_vdi().save(tmp_path / "a.vdi")
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o777 == 0o640
    path.chmod(0o600)
    small_vdi().save(path)
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(os.name != "posix", reason="symbolic links")
def test_links_are_followed(tmp_path):
    (tmp_path / "data").mkdir()
    link = tmp_path / "a.vdi"
    link.symlink_to(tmp_path / "data" / "real.vdi")
    assert small_vdi().save(link) == tmp_path / "data" / "real.vdi"
    assert link.is_symlink()
    assert io.read(link).equals(small_vdi())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"compression": "gzip"},
            r"compression of .* must be one of lz4, zstd, deflate and none; got 'gzip'",
        ),
        ({"level": 0}, "level must be a whole number from 1 to 9; got 0"),
        ({"level": "best"}, "level must be a whole number from 1 to 9; got 'best'"),
    ],
)
def test_unknown_compression(options, message, tmp_path):
    with pytest.raises(InvalidArgumentError, match=message):
        small_vdi().save(tmp_path / "a.vdi", **options)
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("value", [float("nan"), object(), {1: {2}}])
def test_metadata_that_json_cannot_hold(value, tmp_path):
    vdi = large_vdi((4, 4), metadata={"entry": value})
    with pytest.raises(VDIFileError, match="metadata cannot be written"):
        vdi.save(tmp_path / "a.vdi")
    assert names_in(tmp_path) == []


# -- files that are not ours, or not whole ---------------------------------------------------------


def test_an_absent_file(tmp_path):
    with pytest.raises(VDIFileError, match=r"none\.vdi cannot be read: No such file or directory"):
        io.read(tmp_path / "none.vdi")


def test_a_folder(tmp_path):
    with pytest.raises(VDIFileError, match="cannot be read"):
        io.read(tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        b"\x89PNG\r\n\x1a\n" + bytes(100),
        b"NRRD0004\n",
        b"P",
        b"PK\x03\x04" + bytes(26) + b"other.js",
    ],
)
def test_a_foreign_file(content, tmp_path):
    path = tmp_path / "a.vdi"
    path.write_bytes(content)
    with pytest.raises(VDIFileError, match=r"a\.vdi is (not a VDI file|truncated)") as caught:
        io.read(path)
    assert "generate" in str(caught.value)


def test_an_empty_file(tmp_path):
    (tmp_path / "a.vdi").touch()
    with pytest.raises(VDIFileError, match=r"is damaged: it is empty; copy it .* again"):
        io.read(tmp_path / "a.vdi")


def test_another_archive_with_a_description(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.vdi", "w") as archive:
        archive.writestr("vdi.json", '{"format": "other"}')
    with pytest.raises(VDIFileError, match="is not a VDI file: vdi.json does not name the format"):
        io.read(tmp_path / "a.vdi")


def test_a_newer_version(file):
    edit_description(file, version=5, written_by="pyvista-vdi 9.0")
    with pytest.raises(
        VDIFileError,
        match=r"is of format version 5, written by 'pyvista-vdi 9\.0'; this is pyvista-vdi .*, "
        r"which reads up to version 4: upgrade by pip install -U pyvista-vdi",
    ):
        io.read(file)


@pytest.mark.parametrize("codec", ["lz4", "deflate"])
def test_every_truncation_is_noticed(codec, file):
    """One of version 4 has a whole file in it, which is not taken for the rest."""
    whole = small_vdi().save(file, compression=codec).read_bytes()
    cuts = {*range(200), *range(0, len(whole), 97), *range(len(whole) - 120, len(whole))}
    coarse_ends = whole.find(b"PK\5\6", 0, -22) + 22
    cuts |= {coarse_ends, coarse_ends + 1} if codec == "deflate" else set()
    for cut in sorted(cuts):
        file.write_bytes(whole[:cut])
        with pytest.raises(VDIFileError, match=r"is (truncated|damaged|not a VDI)"):
            io.read(file)
    file.write_bytes(whole[:-1])
    with pytest.raises(VDIFileError, match="is truncated: the directory at its end is missing"):
        io.read(file)


def test_every_changed_byte_is_noticed_or_harmless(file):
    whole = file.read_bytes()
    original, refused = io.read(file), 0
    positions = range(0, len(whole), max(1, len(whole) // 1500))
    for position in positions:
        changed = bytearray(whole)
        changed[position] ^= 0x55
        file.write_bytes(changed)
        try:
            vdi = io.read(file)
        except VDIFileError:
            refused += 1
        else:  # ZIP's own fields that say nothing of the content, such as times and permissions
            assert vdi.equals(original), position
    assert refused > 0.8 * len(positions)


@pytest.mark.parametrize("name", [*ARRAYS, "chunks", "vdi.json"])
def test_a_missing_member(name, file):
    rewrite(file, lambda members: members.pop(name))
    with pytest.raises(VDIFileError, match=rf"its member '{name}' is missing|not a VDI file"):
        io.read(file)


# -- hostile files ---------------------------------------------------------------------------------


JUNK = (None, -1, True, 2**70, 1e300, "x", [], {}, [1], [[]], {"a": 1})


@pytest.mark.parametrize(
    "key",
    [
        "format",
        "version",
        "window_size",
        "n_supersegments",
        "camera",
        "bounds",
        "depth_origin",
        "codec",
        "chunk_rows",
        "arrays",
        "metadata",
    ],
)
def test_junk_in_the_description(key, file):
    whole = file.read_bytes()
    for value in JUNK:
        file.write_bytes(whole)
        edit_description(file, **{key: value})
        try:
            io.read(file)
        except VDIFileError:
            continue
        # What is left is as good as what was there
        number = isinstance(value, int | float) and not isinstance(value, bool)
        assert (key == "metadata" and isinstance(value, dict)) or (
            key == "depth_origin" and number
        ), (key, value)


@pytest.mark.parametrize(
    "text",
    [b"[" * 100000, b"\xff\xfe", b"{", b'{"format": NaN}', b"9" * 5000],
    ids=["nested", "bytes", "cut off", "nan", "digits"],  # pytest 8 writes values out
)
def test_a_description_that_is_no_json(text, file):
    rewrite(file, lambda members: members.update({"vdi.json": text}))
    with pytest.raises(VDIFileError, match=r"is no JSON|is not a VDI file"):
        io.read(file)


def _declare(path, n=None, window=None):
    """Declare more than there is, consistently: only the arrays' data give it away."""
    with zipfile.ZipFile(path) as archive:
        description = json.loads(archive.read("vdi.json"))
    arrays = description["arrays"]
    n = n or description["n_supersegments"]
    window = window or description["window_size"]
    for name in ARRAYS[1:]:
        arrays[name]["shape"][0] = n
    arrays["counts"]["shape"][0] = window[0] * window[1]
    edit_description(path, n_supersegments=n, window_size=window, arrays=arrays)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("declared", [{"n": 10**12}, {"window": [65536, 65536]}])
def test_nothing_is_allocated_for_what_a_file_only_declares(declared, codec, tmp_path):
    path = io.write(small_vdi(), tmp_path / "a.vdi", compression=codec)
    _declare(path, **declared)
    tracemalloc.start()
    try:
        with pytest.raises(
            VDIFileError, match="its member 'chunks' has .* bytes for|array 'front': 0 chunks"
        ):
            io.read(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The file, its description and Python's own; the arrays declared would take tens of gigabytes
    assert peak < 4 * path.stat().st_size + 2**20


def test_chunks_that_lie_about_their_size(file):
    def edit(members):
        data = bytearray(members["color"])
        data[4:8] = (2**31 - 1).to_bytes(4, "little")
        members["color"] = bytes(data)

    rewrite(file, edit)
    with pytest.raises(VDIFileError, match="array 'color': a chunk declares 2147483647 bytes"):
        io.read(file)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("name", ARRAYS)
def test_a_chunk_that_was_changed(name, codec, tmp_path):
    """The index has the checksum of every chunk, whatever ZIP's own says."""
    path = io.write(large_vdi((8, 8)), tmp_path / "a.vdi", compression=codec)

    def edit(members):
        members[name] = members[name][:-1] + bytes([members[name][-1] ^ 1])

    rewrite(path, edit, index=False)
    with pytest.raises(VDIFileError, match=f"array '{name}': chunk 0 .* checksum differs"):
        io.read(path)


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"color": 2**32 - 1}, "array 'color': its chunks have 4294967295 bytes, but"),
        ({"back": 16}, "array 'back': 16 bytes cannot hold"),
        ({"front": 17}, "array 'front': its chunks have 17 bytes, but"),
    ],
)
def test_an_index_that_lies(sizes, message, file):
    def edit(members):
        index = np.frombuffer(members["chunks"], INDEX_DTYPE).copy()
        for name, size in sizes.items():
            index["bytes"][ARRAYS.index(name)] = size
        members["chunks"] = index.tobytes()

    rewrite(file, edit, index=False)
    with pytest.raises(VDIFileError, match=f"is damaged: {message}"):
        io.read(file)


def test_an_index_of_another_length(file):
    rewrite(file, lambda members: members.update(chunks=members["chunks"] * 2), index=False)
    with pytest.raises(VDIFileError, match="its member 'chunks' has 80 bytes for 5 chunks"):
        io.read(file)


@given(data=st.binary(max_size=200), seed=st.integers(0, 2**32))
def test_chunks_of_noise(data, seed, tmp_path_factory):
    """Behind a header that is right, the compressed bytes are noise: no crash, one error."""
    vdi = large_vdi((8, 8), 2)
    path = io.write(vdi, tmp_path_factory.getbasetemp() / f"noise_{os.getpid()}.vdi")
    rng = np.random.default_rng(seed)

    def edit(members):
        for name in ("front", "color"):
            content = bytearray(members[name])
            for position in rng.integers(16, len(content), size=8):
                content[position] = data[position % len(data)] if data else 0
            members[name] = bytes(content)

    rewrite(path, edit)
    with contextlib.suppress(VDIFileError):
        io.read(path)


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


@pytest.mark.parametrize(("version", "codec"), [(4, "lz4"), (3, "deflate"), (2, "deflate")])
def test_versions_and_codecs_belong_together(version, codec, file):
    edit_description(file, version=version, codec=codec, precision="exact")
    with pytest.raises(VDIFileError, match=f"version {version} has no codec '{codec}'"):
        io.read(file)


def test_lists_that_do_not_add_up(tmp_path):
    path = io.write(large_vdi((4, 4)), tmp_path / "a.vdi", compression="none")
    rewrite(path, lambda members: members.update(counts=bytes([3] * 16)))
    with pytest.raises(VDIFileError, match="its lists do not hold 32 supersegments"):
        io.read(path)


def test_arrays_that_break_a_rule(tmp_path):
    path = io.write(large_vdi((4, 4)), tmp_path / "a.vdi", compression="none")

    def edit(members):
        members["optical_depth"] = np.full(32, -1, "<f4").tobytes()

    rewrite(path, edit)
    with pytest.raises(VDIFileError, match="it holds no valid VDI: supersegment 0 .*optical_depth"):
        io.read(path)


def test_a_compressed_member_is_refused(file):
    rewrite(file, lambda members: None, compress_type=zipfile.ZIP_DEFLATED)
    with pytest.raises(VDIFileError, match="its member 'vdi.json' is not stored plainly"):
        io.read(file)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_two_members_of_one_name_are_refused(file):
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("color", b"")
    with pytest.raises(VDIFileError, match="two of its members have the same name"):
        io.read(file)


def test_the_format_is_documented_as_it_is(file):
    """docs/files.md names every member and every entry of the description."""
    from pathlib import Path

    page = Path(__file__).parents[2] / "docs" / "files.md"
    if not page.is_file():
        pytest.skip("the documentation is not beside the tests")
    text = page.read_text(encoding="utf-8")
    with zipfile.ZipFile(file) as archive:
        names = archive.namelist()
        entries = json.loads(archive.read("vdi.json"))
    missing = [n for n in (*names, *entries) if not re.search(rf"`{re.escape(n)}`", text)]
    assert not missing, missing


# -- pictures --------------------------------------------------------------------------------------


def test_pictures_hold_straight_colour():
    image = np.zeros((2, 2, 4), np.float32)
    image[0, 0] = (0.25, 0.125, 0.0, 0.5)  # half transparent (0.5, 0.25, 0)
    image[1, 1] = (1.0, 1.0, 1.0, 1.0)
    pixels = io.to_bytes(image)
    assert pixels.dtype == np.uint8
    assert pixels[0, 0].tolist() == [128, 64, 0, 128]
    assert pixels[1, 1].tolist() == [255] * 4
    assert pixels[0, 1].tolist() == [0] * 4


def test_pictures_over_a_background():
    image = np.zeros((1, 2, 4), np.float32)
    image[0, 0] = (0.25, 0.125, 0.0, 0.5)
    pixels = io.to_bytes(image, (1.0, 1.0, 0.0))
    assert pixels.tolist() == [[[191, 159, 0], [255, 255, 0]]]


def test_a_written_picture_reads_back(tmp_path):
    from PIL import Image

    pixels = np.random.default_rng(0).integers(0, 256, (3, 5, 4), dtype=np.uint8)
    path = io.write_png(pixels, tmp_path / "a.png")
    with Image.open(path) as picture:
        assert np.array_equal(np.asarray(picture), pixels)
    assert names_in(tmp_path) == ["a.png"]


def test_pictures_are_png(tmp_path):
    with pytest.raises(VDIFileError, match=r"must end in \.png, for instance 'a\.png'"):
        io.checked_png_target(tmp_path / "a.jpg")


@pytest.mark.parametrize("background", [(0, 0), (0, 0, 2), (np.nan, 0, 0)])
def test_a_background_is_a_colour(background):
    with pytest.raises(InvalidArgumentError, match="background must be three numbers from 0 to 1"):
        io.to_bytes(np.zeros((1, 1, 4), np.float32), background)
