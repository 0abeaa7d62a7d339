"""OpenEXR deep images: ours come back to the last bit, others' within what is stated."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from deep_images import MATRICES, change, matrices_of, read_deep, write_deep
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import VDI, Camera, cli, examples, io
from pyvista_vdi.errors import (
    InvalidArgumentError,
    MissingDependencyError,
    VDIFileError,
    VDIWarning,
)
from pyvista_vdi.extensions.deep_exr import files as exr
from pyvista_vdi.extensions.deep_exr.layout import MAGIC
from pyvista_vdi.extensions.deep_exr.record import ATTRIBUTE
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH

ARRAYS = ("offsets", "front", "back", "color", "optical_depth")
VIEW = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), view_angle=40)
BOX = (-9, 9, -9, 9, -9, 9)

#: Half the spacing of float32 at 1: what one rounding costs, relative to the value.
ROUNDING = 2.0**-24

#: A sample's Z, ZBack, A, R, G and B.
GOOD = [5, 6, 0.5, 0.25, 0.5, 0.0]


def same_bits(first, second):
    return all(getattr(first, n).tobytes() == getattr(second, n).tobytes() for n in ARRAYS)


def small_vdi(seed=1):
    return random_vdi(np.random.default_rng(seed))


def one_list(front, back, tau, color=0.5, **options):
    n = len(front)
    colors = np.broadcast_to(np.asarray(color, float), (n, 3))
    camera = options.pop("camera", VIEW)
    return VDI(camera, (1, 1), [0, n], front, back, colors, tau, BOX, **options)


NAMES = ("Z", "ZBack", "A", "R", "G", "B")


def write_foreign(
    path, pixels, size=(3, 2), *, view=VIEW, names=NAMES, types=None, compression="zips", **header
):
    """Write a deep image as another program might.

    ``pixels`` has the samples (n, channels) of pixels (x, y), y = 0 at the bottom.
    """
    counts, rows = np.zeros(size[::-1], int), []
    for (x, y), samples in sorted(pixels.items(), key=lambda item: item[0][::-1]):
        counts[y, x] = len(samples)
        rows += samples
    table = np.array(rows, float).reshape(-1, len(names)).T
    kinds = dict.fromkeys(names, np.float32) | (types or {})
    channels = {name: row.astype(kinds[name]) for name, row in zip(names, table, strict=True)}
    matrices = {} if view is None else matrices_of(view, size)
    return write_deep(path, counts, channels, matrices | header, compression)


@pytest.fixture
def file(tmp_path):
    return small_vdi().save(tmp_path / "small.exr")


@pytest.fixture(scope="module")
def openexr():
    return pytest.importorskip("OpenEXR")


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32), compression=st.sampled_from(exr.COMPRESSIONS))
def test_reading_gives_back_every_bit(seed, compression, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / f"round_trip_{os.getpid()}.exr"
    vdi = small_vdi(seed)
    vdi.save(path, compression=compression)
    back = pvdi.read(path)
    assert back.equals(vdi)
    assert same_bits(back, vdi)


@pytest.mark.parametrize("origin", [0.0, 1.0, 1e6, 0.1])
def test_metadata_and_hard_values(origin, tmp_path):
    n = 6
    front = np.arange(n, dtype=np.float32) + np.float32(0.3)
    vdi = one_list(
        front,
        front + np.float32(0.5),
        [0.0, -0.0, 1e-45, 1e-30, 40.0, 3e38],
        [1, 1e-30, 0.1],
        depth_origin=origin,
        metadata={"criterion": "x", "values": [1, 2.5, None], "name": "τ"},
    )
    back = pvdi.read(vdi.save(tmp_path / "a.exr"))
    assert back.equals(vdi)
    assert same_bits(back, vdi)
    assert back.metadata == vdi.metadata


def test_parallel_projection_with_negative_depths(tmp_path):
    view = VIEW.replace(parallel_projection=True, parallel_scale=2.0)
    vdi = one_list([-2.0, -0.0, 1e-38], [-1.0, 1e-40, 3e38], [0.5] * 3, camera=view)
    path = vdi.save(tmp_path / "a.exr")
    image = read_deep(path)
    assert image.channels["Z"].min() >= 0  # as the standard demands
    assert same_bits(pvdi.read(path), vdi)
    # The eye in the matrices is where Z counts from
    point = np.array([0, 0, 2.0, 1]) @ image.attributes["worldToCamera"]
    assert point[2] == pytest.approx(image.channels["Z"][0], abs=1e-6)


def test_an_empty_vdi_and_what_the_file_says(file, tmp_path):
    vdi = VDI(VIEW, (4, 3), np.zeros(13, int), [], [], np.empty((0, 3)), [], BOX)
    assert pvdi.read(vdi.save(tmp_path / "a.exr")).equals(vdi)
    assert pvdi.read(vdi.save(tmp_path / "b.exr", exact=False)).n_supersegments == 0
    vdi, info = small_vdi(), io.read_info(file)
    assert (info.camera, info.window_size) == (vdi.camera, vdi.window_size)
    assert (info.n_supersegments, info.bounds) == (vdi.n_supersegments, vdi.bounds)
    assert info.codec == "OpenEXR zips"
    assert info.written_by.startswith("pyvista-vdi ")


def test_rows_run_from_the_top(tmp_path):
    # One supersegment in the lower left pixel of 2 x 3: the last scan line's first pixel
    vdi = VDI(VIEW, (2, 3), [0, *[1] * 6], [1.0], [2.0], [[1, 0, 0]], [1.0], BOX)
    data = vdi.save(tmp_path / "a.exr", compression="none").read_bytes()
    at = data.index(struct.pack("<iQQQ", 2, 8, 40, 40))
    assert struct.unpack_from("<2i", data, at + 28) == (1, 1)
    assert data.count(struct.pack("<iQQQ", 0, 8, 0, 0)) == 1


def test_the_matrices_are_the_standards(file):
    """x right, y up, z forward; NDC (0, 0) at the upper left; row vectors."""
    vdi = small_vdi()
    attributes = read_deep(file).attributes
    rng, view = np.random.default_rng(3), vdi.camera
    points = np.append(np.asarray(view.focal_point) + rng.normal(size=(20, 3)), np.ones((20, 1)), 1)
    seen = points @ view.view_matrix.T
    scale = np.abs(points).max() * 2.0**-20  # float32 matrices, sums of four products
    assert np.allclose(points @ attributes["worldToCamera"], seen, atol=scale)
    u, v, _, d = view.viewport_matrix(vdi.window_size) @ seen.T
    ndc = points @ attributes["worldToNDC"]
    assert np.allclose(ndc[:, 0], (u + d) / 2, atol=4 * scale)
    assert np.allclose(ndc[:, 1], (d - v) / 2, atol=4 * scale)
    assert np.allclose(ndc[:, 3], d, atol=scale)


def test_the_standards_channels_are_everybodys(file):
    vdi, image = small_vdi(), read_deep(file)
    channels, tau = image.channels, vdi.optical_depth.astype(np.float64)
    depth = vdi.front.astype(np.float64) + vdi.depth_origin
    assert np.allclose(channels["Z"], depth, rtol=ROUNDING, atol=0)
    assert np.allclose(channels["A"], -np.expm1(-tau), rtol=ROUNDING * 1.01, atol=1e-45)
    red = vdi.color[:, 0] * channels["A"].astype(np.float64)
    assert np.allclose(channels["R"], red, rtol=ROUNDING * 1.01, atol=1e-45)


def test_a_failure_leaves_the_old_file(file, monkeypatch):
    before = file.read_bytes()
    monkeypatch.setattr(zlib, "compress", lambda *_: (_ for _ in ()).throw(MemoryError()))
    with pytest.raises(MemoryError):
        small_vdi(2).save(file, compression="zips")
    assert file.read_bytes() == before
    assert [p.name for p in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("seed", range(12))
def test_standard_channels_lose_what_is_stated(seed, tmp_path):
    vdi = small_vdi(seed)
    back = pvdi.read(vdi.save(tmp_path / "a.exr", exact=False))
    tau = vdi.optical_depth.astype(np.float64)
    seen = (-np.expm1(-tau)).astype(np.float32) > 0  # opacities that are 0 show nothing
    assert back.n_supersegments == seen.sum()
    assert (back.camera, back.bounds, back.metadata) == (vdi.camera, vdi.bounds, vdi.metadata)
    tau, found = tau[seen], back.optical_depth.astype(np.float64)
    # A is rounded to float32, which moves it by A * 2**-24 at most, and d tau = dA / (1 - A) =
    # dA * exp(tau); tau itself is rounded once more
    thin = tau < 15
    bound = ROUNDING * (np.expm1(tau) + tau) * 1.01
    assert (np.abs(found - tau) <= bound)[thin].all()
    # Opaque ones: 1 - A is at least 2**-24, or 0
    assert (found[~thin] > 14).all()
    assert (found[tau > 17.4] == OPAQUE_OPTICAL_DEPTH).all()
    # Colour: rounded as product, as quotient, and A itself cancels
    assert np.abs(back.color - vdi.color[seen]).max(initial=0) <= 2 * ROUNDING
    for name in ("front", "back"):
        depth = getattr(vdi, name).astype(np.float64)[seen] + vdi.depth_origin
        again = getattr(back, name).astype(np.float64) + back.depth_origin
        assert np.allclose(again, depth, rtol=ROUNDING * 1.01, atol=1e-6 * ROUNDING)


@pytest.mark.parametrize("compression", ["zips", "none"])
def test_a_foreign_file(compression, tmp_path):
    samples = {(2, 1): [GOOD, [6, 7, 1.0, 1.0, 0.5, 0.25]]}
    path = write_foreign(tmp_path / "a.exr", samples, compression=compression)
    vdi = pvdi.read(path)
    assert vdi.window_size == (3, 2)
    assert vdi.list_at(2, 1) == slice(0, 2)
    assert (vdi.front.tolist(), vdi.back.tolist()) == ([5, 6], [6, 7])
    assert vdi.optical_depth.tolist() == pytest.approx([np.log(2), OPAQUE_OPTICAL_DEPTH])
    assert vdi.color.tolist() == [[0.5, 1.0, 0.0], [1.0, 0.5, 0.25]]
    assert vdi.depth_origin == 0
    assert vdi.metadata == {"read_from": "a.exr"}


@pytest.mark.parametrize("seed", range(10))
def test_the_view_comes_from_the_matrices(seed, tmp_path):
    vdi = small_vdi(seed)
    view = vdi.camera.replace(model_transform=np.eye(4))
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [GOOD]}, vdi.window_size, view=view)
    found = pvdi.read(path).camera
    # As matrices of the same pixels, to float32 of the matrix's own size
    want = view.viewport_matrix(vdi.window_size) @ view.view_matrix
    got = found.viewport_matrix(vdi.window_size) @ found.view_matrix
    assert np.allclose(got, want, atol=2.0**-18 * np.abs(want).max())
    assert found.parallel_projection == view.parallel_projection


def test_bounds_hold_everything(tmp_path):
    pixels = {(0, 0): [[2, 3, 0.5, 0, 0, 0]], (2, 1): [[4, 8, 0.5, 0, 0, 0]]}
    vdi = pvdi.read(write_foreign(tmp_path / "a.exr", pixels))
    t_x, t_y = VIEW.half_extent((3, 2))
    # The right pixel reaches to u = v = 1 at depth 8, the left one to u = v = -1 at depth 3;
    # the view looks along -z
    assert vdi.bounds == pytest.approx((-3 * t_x, 8 * t_x, -3 * t_y, 8 * t_y, -8, -2), rel=1e-5)


def test_windows_that_differ(tmp_path):
    """Samples outside the display window are left out; those inside stay in their pixels."""
    pixels = {(x, y): [[5 + x, 6 + x, *GOOD[2:]]] for x in range(3) for y in range(2)}
    boxes = {
        "dataWindow": ("box2i", struct.pack("<4i", 0, 0, 2, 1)),
        "displayWindow": ("box2i", struct.pack("<4i", 1, -2, 4, 0)),
    }
    path = write_foreign(tmp_path / "a.exr", pixels, **boxes)
    vdi = pvdi.read(path, camera=VIEW)
    assert vdi.window_size == (4, 3)
    # Data columns 1 and 2 are display columns 0 and 1; the upper data row is the lowest one shown
    assert vdi.counts.tolist() == [[1, 1, 0, 0], [0] * 4, [0] * 4]
    assert vdi.front.tolist() == [6, 7]


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (None, "does not say from where .* worldToNDC is missing; give the view: .*camera="),
        (np.zeros((4, 4)), r"flatten"),
        (np.full((4, 4), np.nan), "not finite"),
        (np.diag([1.0, 1, 1, 1]), "parallel projection.*worldToCamera"),
        (matrices_of(VIEW, (6, 2))["worldToNDC"], "pixels are not square"),
    ],
)
def test_no_view(matrix, message, tmp_path):
    header = {} if matrix is None else {"worldToNDC": matrix}
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [GOOD]}, view=None, **header)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(path)
    assert pvdi.read(path, camera=VIEW).camera == VIEW


@pytest.mark.parametrize("with_back", [True, False])
def test_samples_without_thickness(with_back, tmp_path):
    names = NAMES if with_back else [name for name in NAMES if name != "ZBack"]
    # ZBack before Z also means a point (the standard's "Sample Locations")
    sample = [5, *([4] if with_back else []), 0.5, 0.25, 0.5, 0.0]
    path = write_foreign(tmp_path / "a.exr", {(1, 1): [sample]}, names=names)
    with pytest.raises(VDIFileError, match=r"1 samples without a thickness.*depth 5.*thickness="):
        pvdi.read(path)
    vdi = pvdi.read(path, thickness=0.5)
    assert (vdi.front.tolist(), vdi.back.tolist()) == ([5], [5.5])
    assert vdi.optical_depth[0] == pytest.approx(np.log(2))
    for thickness in (-1, "thin"):
        with pytest.raises(InvalidArgumentError, match=f"a positive length.* got {thickness!r}"):
            pvdi.read(path, thickness=thickness)


def test_unsorted_and_overlapping_samples_are_tidied(tmp_path):
    tau = np.array([4.0, 2.0, 1.0])
    alpha = -np.expm1(-tau)
    red, green = (alpha[0], 0, 0), (0, alpha[1], 0)
    path = write_foreign(
        tmp_path / "a.exr",
        {
            (0, 0): [[9, 10, alpha[2], 0, 0, 0], [3, 4, alpha[2], 0, 0, 0]],  # not sorted
            (1, 0): [[2, 6, alpha[0], *red], [4, 8, alpha[1], *green]],  # they share 4 to 6
        },
    )
    vdi = pvdi.read(path)
    assert vdi.counts.tolist() == [[2, 3, 0], [0, 0, 0]]
    assert vdi.front.tolist() == [3, 9, 2, 4, 6]
    assert vdi.back.tolist() == [4, 10, 4, 6, 8]
    # Optical depths split by length and add: 4 * 2/4, that and 2 * 2/4, and 2 * 2/4
    assert vdi.optical_depth == pytest.approx([1, 1, 2, 3, 1], rel=1e-5)
    assert vdi.color[3] == pytest.approx([2 / 3, 1 / 3, 0], abs=1e-5)


def test_colours_outside_the_range(tmp_path):
    samples = [[1, 2, 0.5, 2.0, 0.25, -0.5], [2, 3, 0.0, 1.0, 0, 0], [3, 4, 0.5, 0, 0, 0]]
    path = write_foreign(tmp_path / "a.exr", {(0, 0): samples})
    with pytest.warns(VDIWarning, match="those of 1 samples were clamped, and 1 samples"):
        vdi = pvdi.read(path)
    assert vdi.color[0].tolist() == [1, 0.5, 0]
    assert vdi.front.tolist() == [1, 3]


def test_half_floats_and_tau(tmp_path):
    types = dict.fromkeys("ARGB", np.float16)
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [[1, 2, 0.3, 0.3, 0.1, 0]]}, types=types)
    vdi = pvdi.read(path)
    # float16 rounds by 2**-11 of the value at most; the colour is a quotient of two
    assert vdi.color[0] == pytest.approx([1, 1 / 3, 0], rel=2**-10)
    assert vdi.optical_depth[0] == pytest.approx(-np.log(0.7), rel=2**-10)
    write_foreign(path, {(0, 0): [[1, 2, 1, 0.5, 0.5, 0.5, 77.0]]}, names=(*NAMES, "tau"))
    assert pvdi.read(path).optical_depth.tolist() == [77.0]


def but(place, value):
    return [[*GOOD[:place], value, *GOOD[place + 1 :]]]


@pytest.mark.parametrize(
    ("samples", "names", "types", "message"),
    [
        (but(0, np.nan), NAMES, {}, "'Z and ZBack finite'.*Z nan"),
        (but(1, np.inf), NAMES, {}, "'Z and ZBack finite'"),
        (but(0, -1), NAMES, {}, "'Z not negative'"),
        (but(2, -0.1), NAMES, {}, "'A from 0 to 1'.*A -0.1"),
        (but(2, 1.1), NAMES, {}, "'A from 0 to 1'"),
        (but(2, np.nan), NAMES, {}, "'A from 0 to 1'"),
        (but(4, np.nan), NAMES, {}, "'R, G and B finite'"),
        (but(5, -np.inf), NAMES, {}, "'R, G and B finite'"),
        ([[1] * 5], ("A", "B", "G", "R", "ZBack"), {}, "has no channel Z; it has A, B, G, R, ZBa"),
        ([[1] * 3], ("A", "Y", "Z"), {}, "has no channel R, G, B; it has A, Y, Z"),
        ([[1] * 6], NAMES, {"A": np.uint32}, "its channel A is of type uint32"),
        (
            [[1, 1000 + i, 0.5, 0, 0, 0] for i in range(4097)],
            *(NAMES, {}, "4097 overlapping samples in one pixel"),
        ),
    ],
)
def test_samples_that_mean_nothing(samples, names, types, message, tmp_path):
    path = write_foreign(tmp_path / "a.exr", {(0, 0): samples}, names=names, types=types)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it is empty"),
        (b"PK\x03\x04" + bytes(100), "is not an OpenEXR file"),
        (MAGIC + struct.pack("<I", 2) + bytes(50), "a flat image"),
        (MAGIC + struct.pack("<I", 0x803) + bytes(50), "its version is 3"),
        (MAGIC + struct.pack("<I", 0x802) + b"x" * 100, "a name .* has no end"),
        (MAGIC + struct.pack("<I", 0x802) + bytes(50), "its type is None"),
    ],
)
def test_other_files(content, message, tmp_path):
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(tmp_path / "a.exr")
    with pytest.raises(VDIFileError, match=r"none\.exr cannot be read: No such file"):
        pvdi.read(tmp_path / "none.exr")


def test_every_truncation_is_noticed(file):
    whole = file.read_bytes()
    for cut in sorted({*range(0, 1200, 17), *range(0, len(whole), 631), len(whole) - 1}):
        file.write_bytes(whole[:cut])
        with pytest.raises(VDIFileError):
            pvdi.read(file)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning")
def test_changed_bytes_never_crash(file):
    """OpenEXR has no checksums but zlib's, so that not every change is seen; none goes astray."""
    whole, refused = file.read_bytes(), 0
    positions = range(0, len(whole), max(1, len(whole) // 1000))
    for position in positions:
        changed = bytearray(whole)
        changed[position] ^= 0x55
        file.write_bytes(changed)
        try:
            pvdi.read(file)
        except (VDIFileError, MissingDependencyError):
            refused += 1
    assert refused > 0.8 * len(positions)


KEYS = (
    *("format", "version", "window_size", "n_supersegments", "camera", "bounds", "depth_origin"),
    *("depth_offset", "exact", "linear", "checksums", "metadata"),
)


@pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning")
@pytest.mark.parametrize("key", KEYS)
def test_junk_in_the_description(key, tmp_path):
    path = one_list([1.0], [2.0], [1.0]).save(tmp_path / "a.exr")
    description = json.loads(read_deep(path).attributes[ATTRIBUTE])
    for value in (None, -1, True, 2**70, "x", [], {}, [1]):
        change(path, **{ATTRIBUTE: json.dumps({**description, key: value})})
        try:
            back = pvdi.read(path)
        except VDIFileError:
            continue
        assert back.n_supersegments == 1, (key, value)


def check_refused_in(most, path, data, message):
    """Hold the bytes of memory that a file's refusal takes against a limit."""
    path.write_bytes(data)
    tracemalloc.start()
    try:
        with pytest.raises(VDIFileError, match=message):
            pvdi.read(path)
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("last", "message"),
    [
        (65535, "it ends within its header|scan line"),
        (2**31 - 1, "its dataWindow is 2147483648 x 2147483648"),
    ],
)
def test_a_window_larger_than_the_file(last, message, file):
    width, height = small_vdi().window_size
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    data = file.read_bytes().replace(box, struct.pack("<4i", 0, 0, last, last))
    check_refused_in(2**21, file, data, message)
    data = data.replace(b"dataWindow\0box2i", b"dataWindoX\0box2i")
    check_refused_in(2**21, file, data, "its dataWindow is missing")


def test_a_line_that_does_not_unpack_is_named(tmp_path):
    front = np.arange(1.0, 100)
    arrays = (front, front + 1, np.full((99, 3), 0.5), np.ones(99))
    path = VDI(VIEW, (1, 3), [0, 0, 1, 99], *arrays, BOX).save(tmp_path / "a.exr", exact=False)
    data = bytearray(path.read_bytes())
    # The table of three scan lines begins where the first one is right behind it: the upper line
    at = next(i + 24 for i in range(len(data)) if data[i : i + 8] == struct.pack("<Q", i + 24))
    sums, packed = struct.unpack_from("<QQ", data, at + 4)
    data[at + 28 + sums : at + 28 + sums + packed] = bytes(packed)
    path.write_bytes(data)
    with pytest.raises(VDIFileError, match="scan line 0 does not hold"):
        pvdi.read(path)


def test_more_samples_than_the_file_can_hold(tmp_path):
    """A scan line declares two billion samples, and its packed bytes cannot be that many."""
    path = one_list([1.0], [2.0], [1.0]).save(tmp_path / "a.exr", compression="none")
    n, bytes_each = 2**31 - 1, 40
    data = bytearray(path.read_bytes())
    at = data.index(struct.pack("<iQQQ", 0, 4, 40, 40))
    data[at + 20 : at + 32] = struct.pack("<Qi", n * bytes_each, n)
    check_refused_in(2**20, path, data, "which 40 packed bytes cannot hold")
    data[at + 28 : at + 32] = struct.pack("<i", -1)
    check_refused_in(2**20, path, data, "fewer than 0 samples")


def package_arrays(image):
    """Arrays (H, W) of arrays, top row first, as the package wants them."""
    ends = np.cumsum(image.counts.ravel())
    for name, array in image.channels.items():
        pixels = np.empty(image.counts.size, object)
        pixels[:] = np.split(array, ends[:-1])
        yield name, np.ascontiguousarray(pixels.reshape(image.counts.shape)[::-1])


@pytest.mark.parametrize("compression", ["ZIPS", "RLE", "NO"])
def test_what_the_package_writes_we_read(openexr, compression, file):
    image = read_deep(file)
    header = {
        "type": openexr.deepscanline,
        "compression": getattr(openexr, f"{compression}_COMPRESSION"),
        ATTRIBUTE: image.attributes[ATTRIBUTE],
        **{name: image.attributes[name].astype("f4") for name in MATRICES},
    }
    openexr.File(header, dict(package_arrays(image))).write(str(file))
    back = pvdi.read(file)
    assert back.equals(small_vdi())
    assert same_bits(back, small_vdi())


@pytest.mark.parametrize("compression", exr.COMPRESSIONS)
def test_what_we_write_the_package_reads(openexr, compression, tmp_path):
    path = small_vdi().save(tmp_path / "a.exr", compression=compression)
    image = read_deep(path)
    channels = openexr.File(str(path), separate_channels=True).channels()
    assert sorted(channels) == sorted(image.channels)
    for name, array in image.channels.items():
        pixels = channels[name].pixels[::-1].ravel()
        lengths = [0 if p is None else len(p) for p in pixels]
        assert lengths == image.counts.ravel().tolist()
        assert np.array_equal(np.concatenate([p for p in pixels if p is not None]), array)


def test_several_parts_are_read_by_the_package(openexr, file, tmp_path):
    image = read_deep(file)
    path = tmp_path / "parts.exr"
    depth = {"Z": np.zeros(image.counts.shape, "f4")}
    flat = openexr.Part({"type": openexr.scanlineimage}, depth, "flat")
    header = {
        "type": openexr.deepscanline,
        "compression": openexr.ZIPS_COMPRESSION,
        ATTRIBUTE: image.attributes[ATTRIBUTE],
    }
    deep = openexr.Part(header, dict(package_arrays(image)), "deep")
    openexr.File([flat, deep]).write(str(path))
    back = pvdi.read(path)
    assert same_bits(back, small_vdi())
    openexr.File([flat, openexr.Part({}, depth, "b")]).write(str(path))
    with pytest.raises(VDIFileError, match="flat image"):
        pvdi.read(path)


def test_several_parts_need_the_package(openexr, file, monkeypatch):
    data = bytearray(file.read_bytes())
    data[5] |= 0x10  # the flag of several parts
    broken = file.with_name("parts.exr")
    broken.write_bytes(data)
    with pytest.raises(VDIFileError, match="several parts, and the OpenEXR package cannot read"):
        pvdi.read(broken)
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    assert pvdi.read(file).equals(small_vdi())  # ours do not need it
    with pytest.raises(
        MissingDependencyError, match=r'has several parts.*pip install "pyvista-vdi\[exr\]"'
    ):
        pvdi.read(broken)


def test_openexrs_own_check_accepts_our_files(tmp_path):
    """What ``exrcheck`` does, from OpenEXR's library: Debian's package has no such program."""
    try:
        library = ctypes.CDLL("libOpenEXRUtil-3_1.so.30")
    except OSError:
        pytest.skip("libOpenEXRUtil-3_1 (Debian's libopenexr-3-1-30) is not installed")
    check = library._ZN7Imf_3_116checkOpenEXRFileEPKcbbb
    check.restype = ctypes.c_bool  # true where something is wrong
    for seed in range(5):
        for compression in exr.COMPRESSIONS:
            path = small_vdi(seed).save(tmp_path / "a.exr", compression=compression)
            for core in (False, True):
                assert not check(str(path).encode(), False, False, core)
    path.write_bytes(path.read_bytes()[:-100])
    assert check(str(path).encode(), False, False, True)


def test_exrinfo_accepts_our_files(file):
    program = shutil.which("exrinfo") or pytest.skip("exrinfo is not installed")
    command = [program, "-v", "-s", str(file)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    # Debian's 3.1.5 returns a number at random for any file, and says ERROR where there is one
    assert "ERROR" not in result.stderr
    assert "compression 'zips'" in result.stdout
    assert "worldToNDC: m44f" in result.stdout


def test_oiiotool_flattens_to_the_picture_from_the_generating_view(tmp_path, default_runtime):
    """Within 2/255 of ``render`` at V_O."""
    program = shutil.which("oiiotool") or pytest.skip("oiiotool is not installed")
    openexr = pytest.importorskip("OpenEXR")
    volume, size = examples.load_data("brain", as_volume=True), (160, 90)
    view = filling_camera(volume.bounds, size)
    pytest.importorskip("pyvista")  # colour maps by name
    for name, looks in TRANSFER_FUNCTIONS.items():
        vdi = pvdi.generate(volume, view, size, **looks)
        deep, flat = vdi.save(tmp_path / "deep.exr"), tmp_path / "flat.exr"
        command = [program, str(deep), "--flatten", "--ch", "R,G,B,A", "-d", "float", "-o"]
        subprocess.run([*command, str(flat)], check=True, capture_output=True)
        pixels = openexr.File(str(flat)).channels()["RGBA"].pixels
        picture = pvdi.render(vdi, view)
        assert picture.max() > 0.3, name  # something is there
        assert np.abs(pixels - picture).max() <= 2 / 255, name


def run(capsys, *arguments):
    status = cli.main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_convert_there_and_back(capsys, tmp_path):
    vdi, there = small_vdi(), tmp_path / "b.exr"
    first = vdi.save(tmp_path / "a.vdi")
    assert run(capsys, "convert", first, "-o", there)[0] == 0
    status, out, _ = run(capsys, "convert", there, "-o", tmp_path / "c.vdi")
    assert (status, f"{vdi.n_supersegments} supersegments" in out) == (0, True)
    assert same_bits(pvdi.read(tmp_path / "c.vdi"), vdi)
    assert run(capsys, "convert", first, "-o", there, "--standard-channels")[0] == 0
    assert "tau" not in read_deep(there).channels
    arguments = ["generate", "--example", "no such volume", "-o", there, "--compression", "zstd"]
    status, _, error = run(capsys, *arguments)  # refused before the work
    assert (status, "must be one of zips and none; got 'zstd'" in error) == (1, True)


def test_convert_a_foreign_file(capsys, tmp_path):
    names = ("Z", "A", "R", "G", "B")
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [[5, 0.5, 0, 0, 0]]}, names=names, view=None)
    target = tmp_path / "b.vdi"
    status, _, error = run(capsys, "convert", path, "-o", target)
    assert (status, "without a thickness" in error) == (1, True)
    (tmp_path / "view.json").write_text(json.dumps(VIEW.to_dict()))
    options = ["--thickness", "0.5", "--camera-json", tmp_path / "view.json"]
    assert run(capsys, "convert", path, "-o", target, *options)[0] == 0
    assert pvdi.read(target).camera == VIEW


def test_info_and_render_take_exr(capsys, file, tmp_path, default_runtime):
    status, out, _ = run(capsys, "info", file)
    assert (status, "OpenEXR zips" in out) == (0, True)
    status, _, error = run(capsys, "render", file, "-o", tmp_path / "a.png")
    assert status == 0, error
    assert (tmp_path / "a.png").stat().st_size > 0


def test_the_files_are_documented_as_they_are(file):
    """docs/files.md names every channel and every attribute of ours."""
    page = Path(__file__).parents[3] / "docs" / "files.md"
    if not page.is_file():
        pytest.skip("the documentation is not beside the tests")
    text = page.read_text(encoding="utf-8")
    image = read_deep(file)
    entries = json.loads(image.attributes[ATTRIBUTE])
    names = {*image.channels, *entries, ATTRIBUTE, *MATRICES}
    assert [name for name in sorted(names) if f"`{name}`" not in text] == []
