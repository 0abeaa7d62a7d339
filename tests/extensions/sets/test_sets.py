"""Sets in memory: which VDI a view shows, what is blended, and what generates them."""

from __future__ import annotations

import csv
import re
import warnings

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidVDIError,
    VDIFileError,
    VDIWarning,
)
from pyvista_vdi.extensions.sets import generate
from pyvista_vdi.extensions.sets.sphere import orbit, spiral, spread
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.quality.view_error import angle_from_generating_view

SIZE = (64, 36)
VIEW = pvdi.Camera((0, 0, 90), (10, 10, 10), (0, 1, 0))


def _table():
    shades = np.linspace(0, 1, 16)
    colors = np.stack([shades, shades**2, 1 - shades], axis=1)
    return pvdi.TransferFunction(colors, shades * 0.3, (0.0, 255.0))


def _generate(volume, views="sphere", **options):
    return pvdi.generate_set(volume, views, SIZE, **{"transfer_function": _table(), **options})


@pytest.fixture(scope="module")
def volume():
    z, y, x = np.mgrid[-1:1:20j, -1:1:22j, -1:1:24j]
    waves = np.sin(6 * x) * np.cos(5 * y) * np.sin(4 * z + 1)
    inside = x**2 + y**2 + z**2 < 0.9
    return pvdi.Volume((127 * (1 + waves) * inside).astype(np.uint8), (1.0, 1.0, 1.1))


@pytest.fixture(scope="module")
def around(volume):
    return filling_camera(volume.bounds, SIZE)


@pytest.fixture(scope="module")
def made(volume, default_runtime):
    with pytest.MonkeyPatch.context() as fewer:
        fewer.setattr(generate, "DIRECTIONS", 48)
        return _generate(volume, target_ssim=0.9, max_supersegments=8)


def test_directions_are_spread():
    # The best coverings that are known: icosahedron 37.4, of 32 points 22.7 degrees
    for n, most in ((12, 40), (32, 25)):
        nearest = (spiral(800 * n) @ spread(n).T).max(axis=1)
        assert np.degrees(np.arccos(nearest.min())) < most
    for n in (1, 2, 7, 50):
        assert np.allclose(np.linalg.norm(spread(n), axis=1), 1)
    assert np.array_equal(spread(9), spread(9))


def test_an_orbit_looks_at_the_centre_from_its_directions(volume, around):
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    directions = spiral(20)
    for view, direction in zip(orbit(around, volume.bounds, directions), directions, strict=True):
        arm = np.subtract(view.position, centre)
        assert np.allclose(arm / np.linalg.norm(arm), direction)
        assert np.linalg.norm(arm) == pytest.approx(
            np.linalg.norm(np.subtract(around.position, centre))
        )
        assert np.allclose(view.axes[2], -direction)


def test_the_nearest_is_that_of_the_least_angle(made, around):
    for view in orbit(around, made.bounds, spiral(30)):
        angles = [angle_from_generating_view(vdi, view) for vdi in made]
        assert np.allclose(made.distances(view), angles, atol=1e-6)
        assert made.nearest(view) == int(np.argmin(angles))


def test_an_actor_that_is_turned_takes_its_views_along(made, around):
    turn = np.eye(4)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    turn[:3, 3] = (5, 6, 7)
    for view in orbit(around, made.bounds, spiral(5)):
        moved = view.replace(
            position=turn[:3, :3] @ view.position + turn[:3, 3],
            focal_point=turn[:3, :3] @ view.focal_point + turn[:3, 3],
            view_up=turn[:3, :3] @ view.view_up,
            model_transform=turn,
        )
        assert np.allclose(made.distances(moved), made.distances(view), atol=1e-6)


def test_of_two_eyes_in_a_line_the_one_at_that_distance_is_nearest(volume, around):
    centre = np.asarray(around.focal_point)
    near, far = (
        around.replace(position=centre + k * np.subtract(around.position, centre)) for k in (1, 3)
    )
    vdis = [
        pvdi.generate(volume, view, (16, 9), transfer_function=_table(), max_supersegments=2)
        for view in (near, far)
    ]
    both = pvdi.VDISet.of(vdis)
    assert both.nearest(near) == 0
    assert both.nearest(far) == 1
    # Twice as far is ln 2, as if turned by that angle
    for k in (2, 1e300):
        away = around.replace(position=centre + k * np.subtract(around.position, centre))
        assert both.distances(away)[0] == pytest.approx(np.degrees(np.log(k)), rel=1e-6)


def test_weights_add_up_and_nothing_jumps_on_a_path(made, around):
    # In steps of .05 degrees a distance changes by that at most, a share by twice that over the
    # reach: at least a few hundredths of a degree but where three others are as near
    previous = None
    for azimuth in np.arange(0, 20, 0.05):
        view = around.azimuth(azimuth)
        weights = made.weights(view)
        assert weights[0][0] == made.nearest(view)
        assert sum(w for _, w in weights) == pytest.approx(1)
        assert 1 <= len(weights) <= 3
        dense = np.zeros(len(made))
        dense[[i for i, _ in weights]] = [w for _, w in weights]
        if previous is not None:
            assert np.abs(dense - previous).max() < 0.1
        previous = dense


def test_without_blending_the_nearest_is_shown_alone(made, around):
    view = around.azimuth(11)
    made.blend = 0
    try:
        assert made.weights(view) == [(made.nearest(view), 1.0)]
        picture = pvdi.render(made, view)
        alone = pvdi.render(made[made.nearest(view)], view, SIZE)
        assert np.array_equal(picture, alone)
    finally:
        made.blend = 6
    with pytest.raises(InvalidArgumentError, match="blend"):
        made.blend = -1


def test_a_picture_is_the_weighted_mean(made, around):
    blended = 0
    for view in orbit(around, made.bounds, spiral(30)):
        weights = made.weights(view)
        mean = sum(w * pvdi.render(made[i], view, SIZE).astype(float) for i, w in weights)
        blended += len(weights) > 1
        assert np.allclose(pvdi.render(made, view), mean, atol=1e-6)
    assert blended > 3  # or the test shows nothing


def test_pick_and_depth_are_those_of_the_nearest(made, around):
    view = around.azimuth(20)
    nearest = made[made.nearest(view)]
    middle = (SIZE[0] // 2, SIZE[1] // 2)
    assert pvdi.pick(made, view, middle) == pvdi.pick(nearest, view, middle, SIZE)
    assert pvdi.pick(made, view, middle) is not None
    assert np.array_equal(pvdi.render_depth(made, view), pvdi.render_depth(nearest, view, SIZE))


def test_a_set_beside_a_vdi_in_one_scene(made, around):
    aside = np.eye(4)
    aside[0, 3] = 30
    view = around.azimuth(20)
    nearest = made[made.nearest(view)]
    placed = {"model_transforms": [np.eye(4), aside], "window_size": SIZE}
    together = pvdi.render([made, made[0]], view, **placed)
    assert np.array_equal(together, pvdi.render([nearest, made[0]], view, **placed))


def test_every_direction_reaches_the_target(made, volume, around):
    reached = made.about["reached"]
    assert (reached["below_target"], reached["directions"]) == (0, 48)
    assert 0.9 <= reached["least"] <= reached["mean"] <= 1
    assert made.window_size == SIZE
    # In between it is a little less
    random = np.random.default_rng(3).normal(size=(12, 3))
    random /= np.linalg.norm(random, axis=1)[:, None]
    for view in orbit(around, volume.bounds, random):
        truth = pvdi.render_volume(volume, view, SIZE, transfer_function=_table())
        assert pvdi.compare_images(pvdi.render(made, view), truth).ssim > 0.87


def test_a_vdi_of_a_set_is_what_generate_makes(made, volume):
    vdi = made[0]
    alone = pvdi.generate(
        volume,
        vdi.camera,
        vdi.window_size,
        transfer_function=_table(),
        max_supersegments=8,
        view_cone=30,
        precision="8-byte",
    )
    assert vdi.precision == "8-byte"
    assert vdi.equals(alone)


def test_views_that_are_given_are_served(volume, around):
    path = [around.azimuth(angle) for angle in range(0, 180, 15)]
    vdis = _generate(volume, path, target_ssim=0.97, lists=1, max_supersegments=2)
    assert 1 < len(vdis) < len(path)
    assert vdis.about["reached"]["directions"] == len(path)
    eyes = {view.position for view in path}
    assert all(camera.position in eyes for camera in vdis.cameras)


def test_limits_are_kept_and_what_is_missed_is_said(volume, monkeypatch):
    monkeypatch.setattr(generate, "DIRECTIONS", 20)
    coarse = {"target_ssim": 0.999, "lists": 0.5, "max_supersegments": 4}
    with pytest.warns(VDIWarning, match="not reached"):
        few = _generate(volume, max_views=5, **coarse)
    assert len(few) <= 5
    assert few.about["reached"]["below_target"] > 0
    with pytest.warns(VDIWarning, match="not reached"):
        small = _generate(volume, max_bytes=40_000, **coarse)
    assert 1 <= len(small) < 40
    with pytest.warns(VDIWarning, match="not reached"):
        helped = _generate(volume, [VIEW, VIEW.azimuth(60)], **coarse)
    for vdi in (*small, *few, *helped):  # those that come to help as well
        assert vdi.metadata["max_supersegments"] == 4 >= vdi.counts.max()
        assert np.prod(vdi.window_size) <= 0.25 * np.prod(SIZE)
    assert len(helped) > 1


#: Where views are that a volume of one long and detailed side looks larger from than from others.
UNLIKE_VIEWS = {"sphere": "sphere", "path": [VIEW.azimuth(angle) for angle in range(0, 360, 24)]}


@pytest.mark.every(4)
@pytest.mark.parametrize("views", UNLIKE_VIEWS)
@pytest.mark.parametrize("limit", [1_000, 10_000, 20_000, 40_000, 90_000])
@pytest.mark.parametrize("given", [{}, {"lists": 1, "max_supersegments": 6}], ids=["free", "given"])
def test_the_file_is_within_max_bytes_or_it_is_said(views, limit, given, monkeypatch, tmp_path):
    monkeypatch.setattr(generate, "DIRECTIONS", 12)
    z, y, x = np.mgrid[-1:1:6j, -1:1:12j, -1:1:40j]
    noise = np.random.default_rng(2).normal(size=x.shape)
    slab = pvdi.Volume((127 * (1 + np.sin(9 * x + noise) * np.cos(5 * y + z))).astype(np.uint8))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        vdis = _generate(slab, UNLIKE_VIEWS[views], max_bytes=limit, **given)
    said = [str(warning.message) for warning in caught]
    size = vdis.save(tmp_path / "a.vdiset").stat().st_size
    if size > limit:
        assert len(vdis) == 1
        figures = [int(n) for n in re.findall(r"max_bytes=(\d+) cannot.* takes (\d+)", said[0])[0]]
        assert figures[0] == limit
        assert figures[1] == pytest.approx(size, abs=16)
        assert given or limit == 1_000
    else:
        assert not any("cannot be kept" in text for text in said)
        # A bound that is kept by leaving it half empty would be no use
        assert size > limit / 3 or vdis.about["reached"]["below_target"] == 0


@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        ({"views": "cube"}, InvalidArgumentError, "views"),
        ({"views": []}, InvalidArgumentError, "no view"),
        ({"target_ssim": 1}, InvalidArgumentError, "target_ssim"),
        ({"max_bytes": 0}, InvalidArgumentError, "max_bytes"),
        ({"max_views": 0}, InvalidArgumentError, "max_views"),
        ({"max_views": float("inf")}, InvalidArgumentError, "max_views"),
        ({"lists": 0}, InvalidArgumentError, "lists"),
        ({"window_size": (10, 10)}, InvalidArgumentError, "no SSIM"),
        ({"views": [VIEW], "camera": VIEW}, InvalidArgumentError, "camera is for"),
        ({"oppacity": "linear"}, TypeError, "oppacity"),
        ({"quality": "high"}, TypeError, "quality"),
        ({"progress": lambda _: False}, Cancelled, None),
    ],
)
def test_arguments_out_of_range_are_named(changes, error, said, volume):
    arguments = {"window_size": SIZE, "transfer_function": _table(), **changes}
    with pytest.raises(error, match=said):
        pvdi.generate_set(volume, **arguments)


def test_a_set_grows(made, volume, around):
    view = around.azimuth(77).elevation(13)
    grown = pvdi.VDISet.of(list(made), window_size=SIZE)
    assert not grown.can_grow
    with pytest.raises(InvalidArgumentError, match="not at hand"):
        grown.generate(view)
    assert made.can_grow
    more = made.generate(view)
    assert angle_from_generating_view(more, view) < 1e-6
    grown.add(more)
    assert len(grown) == len(made) + 1
    assert grown[-1] is more
    assert grown.nearest(view) == len(made)
    z = pvdi.Volume(np.zeros((3, 3, 3), np.uint8))
    other = pvdi.generate(z, around, (4, 4), transfer_function=_table())
    with pytest.raises(InvalidVDIError, match="bounds"):
        grown.add(other)
    with pytest.raises(InvalidVDIError, match="bounds"):
        pvdi.VDISet.of([made[0], other])


def test_what_is_no_set_is_refused(made):
    with pytest.raises(InvalidArgumentError, match="at least one"):
        pvdi.VDISet.of([])
    with pytest.raises(InvalidVDIError, match="in a list"):
        pvdi.VDISet.of(made[0])
    with pytest.raises(IndexError, match=r"is out of range: there are \d+ VDIs"):
        made[len(made)]
    assert [vdi is made[i] for i, vdi in enumerate(made)] == [True] * len(made)
    assert made[1:3] == [made[1], made[2]]
    assert f"{len(made)} VDIs" in repr(made)


def test_a_cinema_database_is_by_the_specification(made, tmp_path):
    from PIL import Image

    folder = made.save_cinema(tmp_path / "a.cdb", vdis=True)
    with (folder / "data.csv").open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream, strict=True)
    assert len(rows) == len(made)
    assert len(set(header)) == len(header)
    assert all(name == name.strip() != "" for name in header)
    files = [name.startswith("FILE") for name in header]
    assert files == sorted(files)  # those of files are last
    assert header[files.index(True)] == "FILE"
    for row, vdi in zip(rows, made, strict=True):
        assert len(row) == len(header)
        cells = dict(zip(header, row, strict=True))
        numbers = {n: float(v) for n, v in cells.items() if not n.startswith("FILE")}
        phi, theta = np.radians([numbers["phi"], numbers["theta"]])
        out = (np.cos(phi) * np.sin(theta), np.sin(phi) * np.sin(theta), np.cos(theta))
        eye = [numbers[f"position_{axis}"] for axis in "xyz"]
        centre = np.reshape(made.bounds, (3, 2)).mean(axis=1)
        arm = np.subtract(eye, centre)
        assert np.allclose(arm / np.linalg.norm(arm), out)
        assert np.allclose(eye, vdi.camera.position)
        with Image.open(folder / cells["FILE"]) as picture:
            assert picture.size == SIZE
            seen = np.asarray(picture)
        # All of it is in the picture: its border is background
        assert seen.max() > 20
        assert max(seen[0].max(), seen[-1].max(), seen[:, 0].max(), seen[:, -1].max()) < 20
        assert pvdi.read(folder / cells["FILE_vdi"]).equals(vdi)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.cdb"]
    with pytest.raises(VDIFileError, match="exists"):
        made.save_cinema(tmp_path / "a.cdb")
    with pytest.raises(Cancelled):
        made.save_cinema(tmp_path / "b.cdb", progress=lambda _: False)
    assert not (tmp_path / "b.cdb").exists()
