"""OpenEXR deep images: ours come back within float32's rounding, others' within what is stated."""

from __future__ import annotations

import json

import numpy as np
import pytest

OpenEXR = pytest.importorskip("OpenEXR")

from command_line import run  # noqa: E402
from deep_images import MATRICES, change, matrices_of, read_deep, write_deep  # noqa: E402
from deep_programs import RECORDED, SIZE, pair  # noqa: E402
from deep_programs import VIEW as PROGRAMS_VIEW  # noqa: E402
from hypothesis import given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from strategies import random_vdi  # noqa: E402

import pyvista_vdi as pvdi  # noqa: E402
from pyvista_vdi import VDI, Camera  # noqa: E402
from pyvista_vdi.errors import (  # noqa: E402
    InvalidArgumentError,
    VDIFileError,
    VDIWarning,
)
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH  # noqa: E402

VIEW = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), view_angle=40)
BOX = (-9, 9, -9, 9, -9, 9)

#: Half the spacing of float32 at 1: what one rounding costs, relative to the value.
ROUNDING = 2.0**-24

#: A sample's Z, ZBack, A, R, G and B.
GOOD = [5, 6, 0.5, 0.25, 0.5, 0.0]
NAMES = ("Z", "ZBack", "A", "R", "G", "B")


def small_vdi(seed=1):
    return random_vdi(np.random.default_rng(seed))


def one_list(front, back, tau, color=0.5, **options):
    n = len(front)
    colors = np.broadcast_to(np.asarray(color, float), (n, 3))
    camera = options.pop("camera", VIEW)
    return VDI(camera, (1, 1), [0, n], front, back, colors, tau, BOX, **options)


def write_foreign(path, pixels, size=(3, 2), *, view=VIEW, names=NAMES, types=None, **more):
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
    compression = more.pop("compression", "ZIPS")
    matrices = {} if view is None else matrices_of(view, size)
    return write_deep(path, counts, channels, matrices | more, compression)


def check_same(back, vdi):
    """Hold what is read against what was written: the same within float32's rounding."""
    assert (back.camera, back.window_size, back.bounds) == (vdi.camera, vdi.window_size, vdi.bounds)
    assert back.metadata == vdi.metadata
    assert np.array_equal(back.offsets, vdi.offsets)
    for name in ("front", "back"):
        depth = getattr(vdi, name).astype(float) + vdi.depth_origin
        again = getattr(back, name).astype(float) + back.depth_origin
        # Of the depth from the eye, which a parallel view may move back by its nearest depth
        far = np.abs(depth).max(initial=0) - min(depth.min(initial=0), 0)
        assert np.abs(again - depth).max(initial=0) <= 2 * ROUNDING * far
    # Rounded as a product and as a quotient
    assert np.abs(back.color - vdi.color).max(initial=0) <= 4 * ROUNDING
    assert np.array_equal(back.optical_depth, vdi.optical_depth)


@pytest.fixture
def file(tmp_path):
    return small_vdi().save(tmp_path / "small.exr")


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_reading_gives_back_what_was_written(seed, tmp_path_factory):
    vdi = small_vdi(seed)
    check_same(pvdi.read(vdi.save(tmp_path_factory.getbasetemp() / "a.exr")), vdi)


@pytest.mark.parametrize("origin", [0.0, 1e6])
def test_hard_values(origin, tmp_path):
    """What shows nothing is left out, and what float32 cannot tell apart keeps a thickness."""
    front = np.array([0.3, 1.3, 2.3, 2.3 + 2.0**-20, 4.3, 5.3], np.float32)
    back = np.append(front[1:], 6)
    vdi = one_list(front, back, [0, 1e-30, 40, 3e38, 1, 2], (1, 1e-30, 0.1), depth_origin=origin)
    found = pvdi.read(vdi.save(tmp_path / "a.exr"))
    if origin == 0:
        assert found.optical_depth.tolist() == vdi.optical_depth.tolist()[1:]
        assert np.abs(found.color - vdi.color[1:]).max() <= 4 * ROUNDING
    assert found.optical_depth.sum() == pytest.approx(vdi.optical_depth.sum(), rel=1e-6)
    assert (found.front < found.back).all()
    assert found.bounds == vdi.bounds


def test_parallel_projection_with_negative_depths(tmp_path):
    view = VIEW.replace(parallel_projection=True, parallel_scale=2.0)
    vdi = one_list([-2.0, -0.0, 1.0], [-1.0, 1e-3, 3.0], [0.5] * 3, camera=view)
    path = vdi.save(tmp_path / "a.exr")
    image = read_deep(path)
    assert image.channels["Z"].min() >= 0  # as the standard demands
    check_same(pvdi.read(path), vdi)
    # The eye in the matrices is where Z counts from
    point = np.array([0, 0, 2.0, 1]) @ image.header["worldToCamera"]
    assert point[2] == pytest.approx(image.channels["Z"][0], abs=1e-6)


def test_rows_run_from_the_top_and_matrices_are_the_standards(tmp_path):
    """NDC (0, 0) at the upper left, z forward; row vectors."""
    # One supersegment in the lower left pixel of 2 x 3: the last scan line's first pixel
    vdi = VDI(VIEW, (2, 3), [0, *[1] * 6], [1.0], [2.0], [[1, 0, 0]], [1.0], BOX)
    path = vdi.save(tmp_path / "a.exr")
    with OpenEXR.File(str(path), separate_channels=True) as image:
        pixels, header = image.channels()["Z"].pixels, image.header()
        assert [samples is None for samples in pixels.ravel()] == [*[True] * 4, False, True]
        half = VIEW.half_extent((2, 3))
        corner = np.array([-half[0], -half[1], -1, 1]) * (2, 2, 2, 1)  # the lower left, at depth 2
        x, y, _, d = corner @ header["worldToNDC"]
        assert (x / d, y / d, d) == pytest.approx((0, 1, 2), abs=1e-6)
        assert (corner @ header["worldToCamera"])[2] == pytest.approx(2)


def test_a_foreign_file(tmp_path):
    samples = {(2, 1): [GOOD, [6, 7, 1.0, 1.0, 0.5, 0.25]]}
    path = write_foreign(tmp_path / "a.exr", samples, compression="RLE")
    vdi = pvdi.read(path)
    assert vdi.window_size == (3, 2)
    assert vdi.list_at(2, 1) == slice(0, 2)
    assert (vdi.front.tolist(), vdi.back.tolist()) == ([5, 6], [6, 7])
    assert vdi.optical_depth.tolist() == pytest.approx([np.log(2), OPAQUE_OPTICAL_DEPTH])
    assert vdi.color.tolist() == [[0.5, 1.0, 0.0], [1.0, 0.5, 0.25]]
    assert vdi.metadata == {"read_from": "a.exr"}
    assert np.linalg.norm(np.subtract(vdi.camera.focal_point, vdi.camera.position)) == 6


@pytest.mark.parametrize("seed", range(4))
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


GOOD_VIEW = matrices_of(VIEW, (3, 2))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({}, "does not say from where .* give the view: .*camera="),
        ({n: np.zeros((4, 4), "f4") for n in MATRICES}, "LinAlgError"),
        ({n: np.full((4, 4), np.nan, "f4") for n in MATRICES}, "InvalidCameraError"),
        (matrices_of(VIEW, (6, 2)), "pixels are not square"),
        (
            {n: np.float32(np.diag([-1, 1, 1, 1])) @ GOOD_VIEW[n] for n in MATRICES},
            "shear, scale or mirror",
        ),
    ],
)
def test_no_view(header, message, tmp_path):
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [GOOD]}, view=None, **header)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(path)
    assert pvdi.read(path, camera=VIEW).camera == VIEW


def test_samples_without_thickness(tmp_path):
    # ZBack before Z means a point (the standard's "Sample Locations")
    path = write_foreign(tmp_path / "a.exr", {(1, 1): [[5, 4, 0.5, 0.25, 0.5, 0.0]]})
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


def but(place, value):
    return [[*GOOD[:place], value, *GOOD[place + 1 :]]]


@pytest.mark.parametrize(
    ("samples", "names", "message"),
    [
        (but(0, np.nan), NAMES, "'Z and ZBack finite.*Z nan"),
        (but(0, -1), NAMES, "Z not negative'"),
        (but(2, -0.1), NAMES, "'A from 0 to 1'.*A -0.1"),
        (but(5, -np.inf), NAMES, "'R, G and B finite'"),
        ([[1] * 5], ("A", "B", "G", "R", "Z2"), "has the channels A, B, G, R, Z2, and a VDI needs"),
    ],
)
def test_samples_that_mean_nothing(samples, names, message, tmp_path):
    path = write_foreign(tmp_path / "a.exr", {(0, 0): samples}, names=names)
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(path)


def test_files_that_other_programs_changed(file, tmp_path):
    """Their samples count, whatever our attribute says; a picture of another frame is refused."""
    vdi, image = small_vdi(), read_deep(file)
    with pytest.warns(VDIWarning, match="was changed after pyvista-vdi wrote it"):
        deeper = pvdi.read(change(file, ZBack=image.channels["ZBack"] + np.float32(50)))
    assert deeper.camera == vdi.camera
    assert np.ptp(deeper.bounds) > np.ptp(vdi.bounds) + 10
    assert deeper.metadata == {"read_from": "small.exr"}
    vdi.save(file)
    height, width = image.counts.shape
    for corner in ((0, 0), (1, 0)):  # a display that is larger, and one that was moved
        last = (corner[0] + width - (corner[0] > 0), height - 1)
        box = tuple(np.array(point, np.int32) for point in (corner, last))
        with pytest.raises(VDIFileError, match="was cut, resized or moved .* give the view"):
            pvdi.read(change(file, {"displayWindow": box}))
        vdi.save(file)


def test_truncations_are_noticed(file):
    whole = file.read_bytes()
    for cut in (100, 1000, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:cut])
        with pytest.raises(VDIFileError):
            pvdi.read(file)


def test_convert_a_foreign_file(capsys, tmp_path):
    names = ("Z", "A", "R", "G", "B")
    path = write_foreign(tmp_path / "a.exr", {(0, 0): [[5, 0.5, 0, 0, 0]]}, names=names, view=None)
    target = tmp_path / "b.vdi"
    assert "without a thickness" in run(capsys, "convert", path, "-o", target, status=1)
    (tmp_path / "view.json").write_text(json.dumps(VIEW.to_dict()))
    options = ["--thickness", "0.5", "--camera-json", tmp_path / "view.json"]
    run(capsys, "convert", path, "-o", target, *options)
    assert pvdi.read(target).camera == VIEW


# -- what OpenEXR's own programs made of ours ------------------------------------------------------

A, B = pair()


def depths(vdi):
    """Absolute view depths of fronts and backs."""
    return np.stack([vdi.front, vdi.back]).astype(float) + vdi.depth_origin


def recorded(name, **options):
    """Read a recorded file; its attribute is an older one."""
    with pytest.warns(VDIWarning, match="is of version 2 of .* as any program's"):
        return pvdi.read(RECORDED / f"oiiotool_{name}.exr", **options)


@pytest.mark.parametrize(
    ("name", "lost"), [("tiled", ROUNDING), ("run_lengths", ROUNDING), ("half", 2.0**-11)]
)
def test_recorded_files_are_read(name, lost):
    vdi = recorded(name)
    assert np.array_equal(vdi.counts, A.counts)
    assert np.allclose(depths(vdi), depths(A), rtol=2 * lost)
    assert np.allclose(vdi.color, A.color, atol=4 * lost)
    alphas = [-np.expm1(-each.optical_depth.astype(float)) for each in (vdi, A)]
    assert np.allclose(*alphas, rtol=2 * lost)
    assert np.allclose(vdi.camera.axes, PROGRAMS_VIEW.axes, atol=1e-6)
    assert vdi.metadata == {"read_from": f"oiiotool_{name}.exr"}


def test_a_recorded_file_of_two_shows_both(default_runtime):
    # A is rounded to float32 when it is written and again when a sample is split. At tau = 12 that
    # moves tau by 2**-24 exp(12) = .0097 each time; over a part x of its length that is
    # .0097 x exp(-12 x) of the opacity, at most .0097 / 12 e = 3e-4. Elsewhere it is far less.
    vdi, view = recorded("merged"), PROGRAMS_VIEW.azimuth(90)
    truth = pvdi.render([A, B], view, (80, 60))
    assert np.abs(pvdi.render(vdi, view, (80, 60)) - truth).max() < 6e-4
    flat = OpenEXR.File(str(RECORDED / "oiiotool_merged_flat.exr")).channels()["RGBA"].pixels
    assert np.abs(pvdi.render(vdi, PROGRAMS_VIEW, SIZE) - flat).max() < 1e-5


@pytest.mark.filterwarnings("ignore:.*is of version 2:pyvista_vdi.errors.VDIWarning")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no_back", "60 samples without a thickness"),
        ("renamed", r"has the channels left\.A, .* needs Z, ZBack, A, R, G and B"),
        ("flat", "has 0 deep images .* nor has a flat image, which says nothing about depth"),
        ("parts", "has 2 deep images .* take one of several out by oiiotool"),
    ],
)
def test_what_is_refused_says_why(name, message):
    with pytest.raises(VDIFileError, match=message):
        pvdi.read(RECORDED / f"oiiotool_{name}.exr")
    assert recorded("no_back", thickness=0.1).n_supersegments == A.n_supersegments
