"""``.vdis`` files: what is written is read, whatever becomes of writer and file."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
import warnings
import zlib
from concurrent.futures import ThreadPoolExecutor
from io import FileIO
from pathlib import Path

import numpy as np
import pytest
import stepped_vdis
from stepped_vdis import SIZE, damaged, frames_of, packed_steps, same, stepped_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, VDIWarning
from pyvista_vdi.extensions.series import files, layout, reader, steps_writer
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.model.standard_cases import filling_camera

ARRAYS = ("offsets", "front", "back", "color", "optical_depth")


@pytest.fixture(scope="module")
def steps():
    return [step for step in packed_steps(12) for _ in range(2)]


@pytest.fixture(scope="module")
def saved(steps, tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "a.vdis"
    VDISeries.of(steps, np.arange(24) * 0.5).save(path)
    return path


def all_same(read, steps):
    return all(same(one, other) for one, other in zip(read, steps, strict=True))


def test_every_step_is_read_to_the_last_bit(steps, saved):
    series = pvdi.read(saved)
    assert isinstance(series, VDISeries)
    assert series.times == tuple(np.arange(24) * 0.5)
    assert (series.camera, series.window_size) == (steps[0].camera, SIZE)
    assert series.bounds == steps[0].bounds
    assert all_same(series, steps)
    for read, vdi in zip(series, steps, strict=True):
        assert np.array_equal(read.packing.words, vdi.packing.words)
    assert same(series[5:7][1], steps[6])


@pytest.mark.every(4)
@pytest.mark.parametrize("compression", ["zstd", "lz4", "deflate", "none"])
@pytest.mark.parametrize("precision", ["8-byte", "exact"])
def test_precisions_and_compressions(precision, compression, tmp_path):
    steps = [stepped_vdi(step=k // 2) for k in range(4)]
    options = {"precision": precision, "compression": compression}
    read = pvdi.read(VDISeries.of(steps).save(tmp_path / "a.vdis", **options))
    assert all_same(read, [vdi.with_precision(precision) for vdi in steps])


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "changes",
    [
        {"metadata": {}},  # nothing is known of samples or colours
        {"metadata": {"sample_distance": 1e-9}},
        {"metadata": {"sample_distance": 1e9}},
        {"metadata": {"sample_distance": "1", "transfer_function": {"colors": "no"}}},
        {"palette": False},
        {"still": 1.0},
        {"still": 0.0},
        {"size": (1, 1)},
        {"partly": True},
        {"partly": True, "metadata": {}},
    ],
)
def test_guesses_that_are_wrong_cost_bytes_and_no_more(changes, tmp_path):
    steps = packed_steps(4, **changes)
    assert all_same(pvdi.read(VDISeries.of(steps).save(tmp_path / "a.vdis", key_every=8)), steps)


def test_views_windows_metadata_and_grids_may_change_from_step_to_step(tmp_path):
    first = stepped_vdi()
    camera = pvdi.Camera((0, 1, 50), (0, 0, 0), (0, 1, 0))
    arrays = {name: getattr(first, name) for name in ARRAYS}
    moved = pvdi.VDI(camera, SIZE, **arrays, bounds=first.bounds, metadata={"moved": [1.5]})
    empty = pvdi.VDI(camera, (3, 2), np.zeros(7, int), [], [], np.empty((0, 3)), [], first.bounds)
    told = pvdi.VDI(first.camera, SIZE, **arrays, bounds=first.bounds, metadata={"told": True})
    arrays.update(front=first.front * 4, back=first.back * 4)
    far = pvdi.VDI(first.camera, SIZE, **arrays, bounds=first.bounds, metadata=first.metadata)
    steps = (first, moved, empty, empty, first, told, told, first, far, first)
    steps = [step.with_precision("8-byte") for step in steps]
    assert steps[7].packing.step != steps[8].packing.step
    assert all_same(pvdi.read(VDISeries.of(steps).save(tmp_path / "a.vdis")), steps)


def single_bytes(steps, folder):
    saved = [step.save(folder / "single.vdi", compression="zstd").stat() for step in steps]
    return sum(stat.st_size for stat in saved)


def test_a_still_scene_costs_next_to_nothing(tmp_path):
    still = stepped_vdi(size=(64, 36)).with_precision("8-byte")
    path = VDISeries.of([still] * 100).save(tmp_path / "a.vdis")
    assert path.stat().st_size <= 0.05 * 100 * single_bytes([still], tmp_path)
    steps = reader.StepsReader(path)
    assert steps[73].equals(still)
    assert steps.n_decoded == 1


def test_noise_costs_no_more_than_single_files(tmp_path):
    steps, size, n = [], (64, 36), 64 * 36
    for k in range(4):
        random = np.random.default_rng(k)
        faces = np.sort(random.random((n, 10)), axis=1).reshape(-1, 2).T + 1
        media = (random.random((5 * n, 3)), random.random(5 * n))
        camera, bounds = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)), (-1, 1, -1, 1, -1, 1)
        vdi = pvdi.VDI(camera, size, np.arange(n + 1) * 5, *faces, *media, bounds)
        steps.append(vdi.with_precision("8-byte"))
    path = VDISeries.of(steps).save(tmp_path / "a.vdis")
    assert path.stat().st_size <= 1.02 * single_bytes(steps, tmp_path)
    assert all_same(pvdi.read(path), steps)


def test_a_seek_decodes_three_steps_at_most(tmp_path):
    steps = packed_steps(20, size=(12, 7))
    path = VDISeries.of(steps).save(tmp_path / "a.vdis")
    for i in range(20):
        fresh = reader.StepsReader(path)
        assert fresh[i].equals(steps[i])
        assert 1 <= fresh.n_decoded <= steps_writer.MOST_DECODED
    walk = reader.StepsReader(path)
    for i in range(20):
        assert walk[i].equals(steps[i])
    assert walk.n_decoded <= 20  # one after the other, each is decoded once
    assert max(np.diff([*files.read_info(path).keys, 20])) <= steps_writer.KEY_EVERY


def test_a_tolerance_is_kept(tmp_path):
    tolerance = 0.03
    steps = packed_steps(6, size=(48, 27))
    exact = VDISeries.of(steps).save(tmp_path / "a.vdis")
    path = VDISeries.of(steps).save(tmp_path / "b.vdis", tolerance=tolerance)
    assert path.stat().st_size < exact.stat().st_size
    assert files.read_info(path).tolerance == tolerance
    for read, vdi in zip(pvdi.read(path), steps, strict=True):
        for name in ("offsets", "front", "back"):
            assert np.array_equal(getattr(read, name), getattr(vdi, name))
        for length in (1, 4):
            opacity, written = (-np.expm1(-length * v.optical_depth) for v in (vdi, read))
            assert np.abs(opacity - written).max() <= tolerance + 1e-6
        lost = np.abs(read.color - vdi.color).max(axis=1) * -np.expm1(-4 * vdi.optical_depth)
        assert lost.max() <= tolerance + 1e-6


def test_many_threads_read_at_once(steps, saved):
    series = pvdi.read(saved)

    def look(seed):
        chosen = np.random.default_rng(seed).integers(0, len(steps), 12).tolist()
        return all(series[i].equals(steps[i]) for i in chosen)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(look, range(4)))


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 100_000,
        b'{"arrays": {"vdi": 5}}',
        b'{"arrays": {"vdi": ["|u1", []]}}',
        b'{"arrays": {}}',
    ],
    ids=["nested", "no array", "no length", "nothing"],
)
@pytest.mark.parametrize("kind", [layout.VDI_FILE, layout.LISTS])
def test_frames_that_say_nonsense_are_refused(kind, text, saved, tmp_path):
    """A file with one frame, whose checksums fit whatever it says."""
    packed, begin = zlib.compress(text), frames_of(saved)[0][0]
    body = len(packed).to_bytes(4, "little") + bytes(4) + packed
    header = layout.FrameHeader(layout.STEP, 0, kind, -1, 0.0, len(body), zlib.crc32(body))
    path = tmp_path / "a.vdis"
    path.write_bytes(saved.read_bytes()[:begin] + header.to_bytes() + body)
    with pytest.raises(VDIFileError, match="step 0"):
        pvdi.read(path)[0]


class Stream(FileIO):
    """A file of which reading, writing or flushing fails: ``error`` at ``fails``."""

    fails = error = None

    def _use(self, name):
        if name == Stream.fails:
            error, Stream.fails = Stream.error, None
            raise error

    def seek(self, *place):
        self._use("seek")
        return super().seek(*place)

    def write(self, data):
        if Stream.fails == "write":
            super().write(data[: len(data) // 2])
        self._use("write")
        return super().write(data)

    def flush(self):
        self._use("flush")
        super().flush()


@pytest.fixture
def stream(monkeypatch):
    """Lets files of series, which are read and written in place, be such."""
    original = Path.open

    def opened(path, mode="r", *arguments):
        return Stream(path, mode) if mode in ("rb", "r+b") else original(path, mode, *arguments)

    monkeypatch.setattr(Path, "open", opened)

    def fail(fails, error):
        monkeypatch.setattr(Stream, "error", error)
        monkeypatch.setattr(Stream, "fails", fails)

    return fail


def test_a_disk_that_fails_while_a_step_is_read_is_named(saved, stream):
    steps = reader.StepsReader(saved)
    stream("seek", OSError(5, "Input/output error"))
    with pytest.raises(VDIFileError, match=r"a\.vdis cannot be read: Input/output error"):
        steps[3]


@pytest.mark.parametrize("use", ["write", "flush"])
def test_a_step_that_does_not_fit_is_not_counted(use, tmp_path, stream):
    steps, path = packed_steps(2, size=(6, 4)), tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        out.append(steps[0])
        size = path.stat().st_size
        stream(use, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
        with pytest.raises(VDIFileError, match="No space left on device; its 1 steps can be read"):
            out.append(steps[1])
    assert len(out) == 1
    assert path.stat().st_size == size
    assert all_same(pvdi.read(path), steps[:1])


def test_an_interrupt_leaves_no_half_step(steps, tmp_path, stream):
    """Half of one before the index would part it from the steps."""
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        out.append(steps[0])
        stream("write", KeyboardInterrupt())
        with pytest.raises(KeyboardInterrupt):
            out.append(steps[1])
        out.append(steps[2])
    assert files.read_info(path).closed
    assert all_same(pvdi.read(path), [steps[0], steps[2]])


@pytest.mark.parametrize("precision", ["exact", "8-byte"])
def test_the_level_is_that_of_whole_files_too(precision, tmp_path):
    made, path = VDISeries.of([stepped_vdi(size=(64, 36))]), tmp_path / "a.vdis"
    options = {"precision": precision, "compression": "deflate"}
    sizes = [made.save(path, level=level, **options).stat().st_size for level in (1, 9)]
    assert sizes[0] > sizes[1]


def test_what_was_appended_is_readable_at_once(steps, tmp_path):
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        with pytest.raises(VDIFileError, match="no finished step"):
            pvdi.read(path)
        for k, vdi in enumerate(steps[:5]):
            out.append(vdi, 10.0 + k)
            series = pvdi.read(path)
            assert (len(out), len(series)) == (k + 1, k + 1)
            assert not files.read_info(path).closed
            assert all(same(read, step) for read, step in zip(series, steps, strict=False))
        with pytest.raises(InvalidArgumentError, match="ascend"):
            out.append(steps[0], 14.0)
        with pytest.raises(InvalidArgumentError, match="camera and window_size"):
            out.append(object(), 15.0)
    assert files.read_info(path).closed
    assert pvdi.read(path).times == (10.0, 11.0, 12.0, 13.0, 14.0)
    with pytest.raises(VDIFileError, match="closed"):
        out.append(steps[0])


def test_a_file_is_gone_on_with_or_kept(steps, tmp_path):
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        for vdi in steps[:3]:
            out.append(vdi)
    whole = path.read_bytes()
    with pytest.raises(VDIFileError, match=r"is there already with 3 steps, .*append=True.*over"):
        pvdi.SeriesWriter(path)
    with pytest.raises(InvalidArgumentError, match="pass one of them"):
        pvdi.SeriesWriter(path, append=True, overwrite=True)
    for wrong in ({"precision": "exact"}, {"tolerance": 0.1}, {"compression": "none"}):
        with pytest.raises(InvalidArgumentError, match=f"written with {next(iter(wrong))}="):
            pvdi.SeriesWriter(path, append=True, **wrong)
    with pvdi.SeriesWriter(path, append=True) as out:
        assert len(out) == 3
        with pytest.raises(InvalidArgumentError, match="ascend; got 2.0 after 2.0"):
            out.append(steps[3], 2.0)
        with pytest.raises(InvalidArgumentError, match="its camera is"):
            out.append(turned_away(steps[3]))
    assert path.read_bytes() == whole
    with pvdi.SeriesWriter(path, append=True) as out:
        for vdi in steps[3:5]:
            out.append(vdi)
    assert files.read_info(path).closed
    assert all_same(pvdi.read(path), steps[:5])
    with pvdi.SeriesWriter(path, overwrite=True) as out:
        out.append(steps[0])
    assert len(pvdi.read(path)) == 1


def turned_away(vdi):
    arrays = (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth)
    return pvdi.VDI(
        vdi.camera.azimuth(3), vdi.window_size, *arrays, vdi.bounds, depth_origin=vdi.depth_origin
    )


def test_every_cut_of_a_killed_run_is_gone_on_with(tmp_path):
    small, path = packed_steps(4, size=(6, 4)), tmp_path / "a.vdis"
    VDISeries.of(small[:3]).save(path)
    data, cut = path.read_bytes(), tmp_path / "cut.vdis"
    ends = [place + layout.HEADER_BYTES + h.n_bytes for place, h in frames_of(path)]
    begin = frames_of(path)[0][0]
    for n in [0, begin, begin + 9, *(end + k for end in ends for k in (-1, 0, 30)), len(data)]:
        cut.write_bytes(data[:n])
        finished = sum(end <= n for end in ends)
        with pvdi.SeriesWriter(cut, append=True) as out:
            out.append(small[3], 9.0)
        assert files.read_info(cut).closed
        assert all_same(pvdi.read(cut), [*small[:finished], small[3]])


@pytest.mark.parametrize("content", [b"not a series", b"\x89VDIS\r\n\x1a" + bytes(40)])
def test_a_foreign_file_is_neither_replaced_nor_gone_on_with(content, tmp_path):
    path = tmp_path / "a.vdis"
    path.write_bytes(content)
    with pytest.raises(VDIFileError, match="is there already"):
        pvdi.SeriesWriter(path)
    with pytest.raises(VDIFileError, match="not a series|damaged"):
        pvdi.SeriesWriter(path, append=True)
    assert path.read_bytes() == content


def test_a_writer_takes_volumes(tmp_path, default_runtime):
    z, y, x = np.mgrid[:9, :8, :7]
    volumes = [pvdi.Volume((x * y + z + k).astype(np.float32)) for k in range(3)]
    camera = filling_camera(volumes[0].bounds, SIZE)
    shades = np.linspace(0, 1, 16)
    table = pvdi.TransferFunction(np.stack([shades] * 3, axis=1), shades * 0.7, (0.0, 60.0))
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path, camera, SIZE, transfer_function=table) as out:
        for volume in volumes:
            out.append(volume)
    made = pvdi.generate_series(volumes, camera, SIZE, transfer_function=table)
    assert all_same(pvdi.read(path), made)


def test_every_cut_leaves_the_finished_steps(steps, tmp_path):
    path = tmp_path / "a.vdis"
    small = packed_steps(5, size=(6, 4))
    VDISeries.of(small).save(path)
    data = path.read_bytes()
    ends = [place + layout.HEADER_BYTES + h.n_bytes for place, h in frames_of(path)]
    cut = tmp_path / "cut.vdis"
    around = [end + k for end in ends for k in (-1, 0)]
    for n in [*range(0, 60, 4), *range(60, len(data), 397), *around, len(data) - 1]:
        cut.write_bytes(data[:n])
        finished = sum(end <= n for end in ends)
        if finished == 0:
            with pytest.raises(VDIFileError):
                pvdi.read(cut)
            continue
        series = pvdi.read(cut)
        assert len(series) == finished
        assert series[finished - 1].equals(small[finished - 1])


@pytest.mark.slow
def test_flipped_bytes_are_noticed_and_cost_no_other_step(tmp_path):
    path = tmp_path / "a.vdis"
    small = packed_steps(5, size=(6, 4))
    VDISeries.of(small).save(path, key_every=1)
    data = path.read_bytes()
    random = np.random.default_rng(0)
    head = frames_of(path)[0][0]
    for place in random.integers(0, len(data), 150).tolist():
        flipped = damaged(path, lambda d, at=place: d.__setitem__(at, d[at] ^ 0x10))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", VDIWarning)
                series = pvdi.read(flipped)
        except VDIFileError:
            assert place < head  # the head alone makes a file unreadable
            continue
        right = 0
        for i, at in enumerate(series.times):
            try:
                assert series[i].equals(small[int(at)])
                right += 1
            except VDIFileError as error:
                assert "checksum" in str(error)  # noqa: PT017 - most steps raise nothing
        assert right >= len(small) - 1


def test_a_step_without_its_header_is_told(tmp_path):
    path, small = tmp_path / "a.vdis", packed_steps(4, size=(6, 4))
    with pvdi.SeriesWriter(path, key_every=1) as out:
        for vdi in small:
            out.append(vdi)
        place = frames_of(path)[1][0]  # no index is there yet
        cut = damaged(path, lambda data: data.__setitem__(place + 9, data[place + 9] ^ 1))
    with pytest.warns(VDIWarning, match="steps 1 cannot be found, 3 others"):
        series = pvdi.read(cut)
    assert series.times == (0.0, 2.0, 3.0)
    assert series[1].equals(small[2])


def test_a_damaged_index_is_not_needed(saved, steps):
    path = damaged(saved, lambda data: data.__setitem__(-30, data[-30] ^ 1))
    assert all_same(pvdi.read(path), steps)
    assert not files.read_info(path).closed


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04 nothing of ours", "not a series"),
        (b"", "not a series"),
        (None, "cannot be read"),
        (b"newer", "version 99.*upgrade"),
    ],
)
def test_foreign_and_newer_files_are_named(content, message, tmp_path, saved):
    path = tmp_path / "a.vdis"
    if content == b"newer":
        path = damaged(saved, lambda data: data.__setitem__(8, 99))
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(path)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"tolerance": -1}, "tolerance"),
        ({"tolerance": 0.1, "precision": "exact"}, "8-byte"),
        ({"key_every": 0}, "key_every"),
        ({"compression": "rar"}, "compression"),
        ({"level": 10}, "level"),
        ({"precision": "half"}, "precision"),
        ({"name": "a.vdi"}, r"\.vdis"),
    ],
)
def test_options_and_names_that_there_are_not(options, what, steps, tmp_path):
    path = tmp_path / options.get("name", "a.vdis")
    options = {key: value for key, value in options.items() if key != "name"}
    for save in (VDISeries.of(steps[:1]).save, pvdi.SeriesWriter):
        with pytest.raises((InvalidArgumentError, VDIFileError), match=what):
            save(path, **options)
    assert not list(tmp_path.iterdir())


_KILLED = """
import sys
sys.path[:0] = {folders!r}
import pyvista_vdi as pvdi
from stepped_vdis import packed_steps
steps = packed_steps(8, size=(12, 8))
with pvdi.SeriesWriter({path!r}) as out:
    print("begun", flush=True)
    for k in range(100000):
        out.append(steps[k % 8])
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on this system")
def test_a_killed_writer_leaves_its_finished_steps(tmp_path):
    random = np.random.default_rng(0)
    steps = packed_steps(8, size=(12, 8))
    for k in range(int(os.environ.get("PYVISTA_VDI_KILLS", "2"))):
        path = tmp_path / f"{k}.vdis"
        code = _KILLED.format(folders=[str(Path(stepped_vdis.__file__).parent)], path=str(path))
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
            process.stdout.readline()
            while path.stat().st_size < 20_000 and process.poll() is None:
                time.sleep(0.001)
            time.sleep(random.random() * 0.05)
            process.kill()
        series = pvdi.read(path)
        assert len(series) > 1
        for i in [*random.integers(0, len(series), 6).tolist(), len(series) - 1]:
            assert series[i].equals(steps[i % 8])
