"""The estimate of a view's error against the whole pictures' SSIM, and how far a view has moved."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume, render_vdi

from pyvista_vdi import VDI, Camera, Light, Lights, Shading, TransferFunction, Volume
from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model.metrics import compare_images, over_background
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.quality.view_error import (
    COARSE,
    REACH,
    TILE_SIZE,
    TILES,
    Cells,
    TileSample,
    ViewErrorEstimator,
    angle_from_generating_view,
    magnification,
    seen_region,
)

#: Frames; a hundred cells of the default tiles' 14 pixels, of which the bounds take about 60.
WINDOW = (160, 120)
#: Fewer lists than pixels and short ones, so that errors are large.
FEW = {"window_size": (80, 60), "max_supersegments": 4}
#: Fine enough to be close to the volume near V_O.
FINE = {"window_size": WINDOW, "max_supersegments": 20}


#: Estimate against truth with the default tiles. Seen in the views below: 0.006.
CLOSE = 0.012


def blobs(points=24, count=12):
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(points)] * 3, indexing="ij"), axis=-1)
    centres = rng.uniform(4, points - 4, size=(count, 3))
    balls = [np.exp(-np.square(grid - centre).sum(axis=-1) / 8) for centre in centres]
    return Volume((100 * np.max(balls, axis=0)).astype(np.float32))


VOLUME = blobs()
CENTRE = np.reshape(VOLUME.bounds, (3, 2)).mean(axis=1)
TRANSFER = TransferFunction(
    [[1, 0, 0], [1, 1, 0], [0, 1, 1], [1, 1, 1]],
    [0, 0, 0.3, 0.8],
    (0, 100),
    unit_distance=1.0,
    interpolation="linear",
)
VIEW = filling_camera(VOLUME.bounds, WINDOW)


class Scene:
    """The balls on one device: VDIs, estimators and the truth."""

    def __init__(self, runtime):
        self.runtime = runtime
        self.vdi = cache(self._vdi)
        self.estimator = cache(self._estimator)

    def _vdi(self, kind, camera=VIEW):
        settings = {"coarse": FEW, "fine": FINE}[kind]
        return generate_vdi(
            VOLUME, camera, transfer_function=TRANSFER, device=self.runtime, **settings
        )

    def _estimator(self, **options):
        return ViewErrorEstimator(VOLUME, TRANSFER, device=self.runtime, **options)

    def pictures(self, vdi, camera, size=WINDOW, **options):
        device = self.runtime
        return (
            render_vdi(vdi, camera, size, device=device, **options),
            raycast_volume(VOLUME, camera, size, TRANSFER, device=device, **options),
        )

    def truth(self, vdi, camera, size=WINDOW, background=(0, 0, 0), **options):
        return compare_images(*self.pictures(vdi, camera, size, **options), background).ssim


_scenes = {}


@pytest.fixture
def scene(runtime):
    return _scenes.setdefault(runtime, Scene(runtime))


@pytest.mark.parametrize(("kind", "angles"), [("coarse", (5, 20, 45, 90)), ("fine", (5, 40, 90))])
def test_the_estimate_is_close_to_the_truth(scene, kind, angles):
    """And falls where it falls. Truth: 0.984, 0.972, 0.941 at 20, 45 and 90 degrees."""
    vdi, truth, found = scene.vdi(kind), [], []
    for camera in (VIEW.azimuth(angle) for angle in angles):
        found.append(scene.estimator().estimate(vdi, camera, WINDOW))
        truth.append(scene.truth(vdi, camera))
        assert found[-1].tiles == TILES
        assert found[-1].angle == angle_from_generating_view(vdi, camera)
        assert found[-1].magnification == magnification(vdi, camera, WINDOW)
    ssims = [each.ssim for each in found]
    assert ssims == pytest.approx(truth, abs=CLOSE)
    if kind == "coarse":  # each step is more than twice what an estimate may be off
        assert truth[1:] == sorted(truth[1:], reverse=True)
        assert ssims[1:] == sorted(ssims[1:], reverse=True)


def test_at_the_generating_view_only_what_the_lists_lack_is_lost(scene):
    """But rounding, and that tiles have other roundings than lists."""
    found = scene.estimator().estimate(scene.vdi("fine"), VIEW)
    assert found.ssim == pytest.approx(1, abs=1e-6)
    assert found.angle == pytest.approx(0, abs=1e-9)
    assert found.magnification == pytest.approx(1)
    # Fewer lists than pixels are seen
    found = scene.estimator().estimate(scene.vdi("coarse"), VIEW, WINDOW)
    assert found.ssim == pytest.approx(scene.truth(scene.vdi("coarse"), VIEW), abs=CLOSE)
    assert found.ssim < 0.99
    assert found.magnification == pytest.approx(2)


#: A window of 5 x 3 cells of 14 pixels, and the five pixels around them that have no SSIM.
EVEN = (80, 52)
#: Cells that do not overlap and are all told: only roundings are between estimate and truth.
EXACT = 1e-5
INSIDE = VIEW.replace(position=np.add(CENTRE, (1, -6, 2)), view_angle=75)
CLOSE_UP = VIEW.azimuth(30).replace(parallel_projection=True, parallel_scale=5)


@pytest.mark.parametrize("camera", [INSIDE, CLOSE_UP], ids=["inside", "parallel"])
@pytest.mark.parametrize("change", ["nothing", "clipping_planes", "background"])
def test_with_all_tiles_the_estimate_is_the_truth(scene, camera, change):
    options = {
        "nothing": {},
        "clipping_planes": {"clipping_planes": [[*CENTRE, 1, 0.5, 0.2]]},
        "background": {"background": (0.9, 0.5, 0.1)},
    }[change]
    vdi = scene.vdi("coarse")
    truth = scene.truth(vdi, camera, EVEN, **options)
    plain = scene.truth(vdi, camera, EVEN)
    if change != "nothing":
        assert abs(truth - plain) > 20 * EXACT  # the change is one
    background = options.pop("background", (0, 0, 0))
    found = scene.estimator().estimate(vdi, camera, EVEN, RenderOptions(**options), background)
    assert found.tiles == 15
    assert found.ssim == pytest.approx(truth, abs=EXACT)
    assert truth < 0.95


def test_a_light_that_has_moved_with_the_camera_counts(scene):
    """The volume is lit as the view that is judged would light it, and the VDI as V_O was."""
    lamp = Light("camera", (3, 1, 0.5))
    lights = Lights((lamp,), two_sided=False)
    origin, travel = lamp.in_world(VIEW)
    stays = Lights((Light("scene", origin, origin + travel),), two_sided=False)
    shaded = TRANSFER.replace(shading=Shading(0.1, 0.9, 0.0, 1.0))
    turned, device = CLOSE_UP.azimuth(30), scene.runtime
    made = {"transfer_function": shaded, "lights": lights, "device": device}
    vdi = generate_vdi(VOLUME, VIEW, WINDOW, **made)
    picture = render_vdi(vdi, turned, EVEN, device=device)
    found, truth = {}, {}
    for name, lit in (("follows", lights), ("stays", stays)):
        volume = raycast_volume(VOLUME, turned, EVEN, shaded, lights=lit, device=device)
        truth[name] = compare_images(picture, volume).ssim
        estimator = ViewErrorEstimator(VOLUME, shaded, lights=lit, device=device)
        found[name] = estimator.estimate(vdi, turned, EVEN).ssim
    assert found == pytest.approx(truth, abs=EXACT)
    assert truth["follows"] < truth["stays"] - 0.2  # 0.60 and 0.996


@pytest.mark.parametrize("own", [(1, 1), (2.5, 1), (1, 2.5)], ids=["same", "near", "wide"])
def test_views_that_are_zoomed(scene, own):
    """In, where lists show, and out, where V_O's viewport ends in mid-picture."""
    old, new = (VIEW.replace(view_angle=VIEW.view_angle / zoom) for zoom in own)
    vdi = scene.vdi("fine", old)
    truth = scene.truth(vdi, new.azimuth(10))
    found = scene.estimator(tiles=32).estimate(vdi, new.azimuth(10), WINDOW)
    # Parts that are missing are lost whole: tiles differ more. Seen: 0.007 of a loss of 0.1
    assert found.ssim == pytest.approx(truth, abs=0.1 * (1 - truth) + 1e-3)


@pytest.mark.parametrize("size", [(11, 11), (11, 200), (40, 12), (301, 33)])
def test_windows_of_any_shape(scene, size):
    vdi, camera = scene.vdi("coarse"), VIEW.azimuth(60)
    estimator = scene.estimator(tiles=1000)
    found = estimator.estimate(vdi, camera, size)
    # All cells are told; the last few pixels of an odd region are in two cells
    assert found.ssim == pytest.approx(scene.truth(vdi, camera, size), abs=CLOSE)
    without = estimator.estimate(vdi, camera, (10, size[1]))  # no SSIM, no estimate
    assert np.isnan(without.ssim)
    assert without.tiles == 0


@pytest.mark.parametrize(
    "camera",
    [
        VIEW.replace(focal_point=2 * np.subtract(VIEW.position, CENTRE) + CENTRE),
        VIEW.replace(window_center=(9, 0)),
        VIEW.replace(parallel_projection=True, parallel_scale=5, window_center=(0, 20)),
    ],
    ids=["behind", "beside", "parallel"],
)
def test_a_volume_out_of_view_has_no_error(scene, camera):
    found = scene.estimator().estimate(scene.vdi("coarse"), camera, WINDOW)
    assert (found.ssim, found.tiles) == (1, 0)


def test_a_moved_actor_is_judged_where_it_is(scene):
    vdi = scene.vdi("coarse")
    turn = np.eye(4)
    turn[:2, :2] = rotation(-40)
    turn[:3, 3] = CENTRE - turn[:3, :3] @ CENTRE
    moved = scene.estimator().estimate(vdi, VIEW.replace(model_transform=turn), WINDOW)
    turned = scene.estimator().estimate(vdi, VIEW.azimuth(40), WINDOW)
    assert moved.ssim == pytest.approx(turned.ssim, abs=1e-3)
    assert moved.angle == pytest.approx(turned.angle)


def test_the_same_question_has_the_same_answer(scene):
    vdi, camera = scene.vdi("coarse"), VIEW.azimuth(33)
    another = ViewErrorEstimator(VOLUME, TRANSFER, device=scene.runtime)
    estimators = [scene.estimator()] * 2 + [another]
    assert len({each.estimate(vdi, camera, WINDOW) for each in estimators}) == 1


def test_coarse_pictures_are_made_in_bands(scene):
    vdi, camera, size = scene.vdi("coarse"), VIEW.azimuth(33), (1000, 750)
    region = seen_region(camera, size, (vdi.bounds, VOLUME.bounds))
    pixels = tuple(-(-extent // COARSE) for extent in region[1])
    lens = camera.tile(size, region[0], tuple(COARSE * n for n in pixels))
    coarse = [over_background(p, (0, 0, 0)) for p in scene.pictures(vdi, lens, pixels)]
    cells = Cells(*region, size, TILE_SIZE - 2 * REACH)
    expected = cells.sample(cells.guess(*coarse), TILES)
    found = scene.estimator().sample(vdi, FrameRequest(camera, size, device=scene.runtime))
    np.testing.assert_array_equal(found.corners, expected.corners)
    # Rays about another centre differ by float32 roundings, 5e-5 of pictures; guesses are of 0.1
    np.testing.assert_allclose(found.guess, expected.guess, rtol=1e-3)
    assert found.guessed == pytest.approx(expected.guessed, rel=1e-3)


def cells_of(columns, rows):
    """A region of so many cells of 14 x 14 pixels."""
    extent = (14 * columns, 14 * rows)
    return Cells((5, 5), extent, (extent[0] + 50, extent[1] + 50), 14)


def test_cells_lie_along_a_curve_of_single_steps():
    """Any other grid than a square of a power of two is part of such a curve."""
    for columns, rows in ((16, 16), (5, 3)):
        cells = cells_of(columns, rows).corners // 14
        places = {(i, j) for i in range(columns) for j in range(rows)}
        assert {tuple(cell) for cell in cells.tolist()} == places
        if columns == 16:
            np.testing.assert_array_equal(np.abs(np.diff(cells, axis=0)).sum(axis=1), 1)


@pytest.mark.parametrize(
    ("first", "extent", "edge", "end", "expected"),
    [
        (5, 28, 14, 100, [5, 19]),
        (5, 29, 14, 100, [5, 12, 20]),  # three overlap rather than reach beyond
        (5, 3, 14, 100, [5]),  # larger than what it covers
        (90, 3, 14, 100, [86]),  # and moved inside
    ],
)
def test_cells_cover_a_region(first, extent, edge, end, expected):
    cells = Cells((first, 50), (extent, 1), (end + REACH, 200), edge)
    assert sorted(cells.corners[:, 0] + REACH) == expected
    assert cells.tile_size == (edge + 2 * REACH,) * 2


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("tiles", [2, 7, 50])
def test_a_sample_has_as_many_tiles_the_likelier_the_more_is_guessed(seed, tiles):
    cells = cells_of(10, 5)
    guess = np.random.default_rng(seed).exponential(size=50) ** 3  # some are worth many others
    sample = cells.sample(guess, tiles)
    assert len({tuple(corner) for corner in sample.corners}) == tiles
    assert ((sample.chances > 0) & (sample.chances <= 1)).all()
    chances = sample.chances[np.argsort(sample.guess)]
    assert (np.diff(chances) >= -1e-12).all()
    certain = sample.chances == 1
    if certain.any():
        assert certain.sum() == (guess >= sample.guess[certain].min()).sum()
    # A tenth of the tiles that are left is spread evenly, the rest by what is guessed
    rest = guess[guess < sample.guess[certain].min(initial=np.inf)]
    weight = 0.1 + 0.9 * sample.guess[~certain] / guess.mean()
    all_weights = (0.1 + 0.9 * rest / guess.mean()).sum()
    np.testing.assert_allclose(
        sample.chances[~certain], (tiles - certain.sum()) * weight / all_weights
    )


def test_what_is_inferred_from_a_sample():
    cells = cells_of(10, 6)
    for seed in range(3):  # a guess that is right up to a factor leaves no error
        guess = np.random.default_rng(seed).exponential(size=60)
        sample = cells.sample(guess, 9)
        ssim = sample.infer(1 - 0.03 * sample.guess)
        assert ssim == pytest.approx(1 - sample.share * 0.03 * guess.sum())
    # Where nothing is guessed all have the same chance, and the weighted losses count: two of four
    # with a chance of a half each, 2 (0.1 + 0.3)
    np.testing.assert_allclose(cells_of(4, 2).sample(np.zeros(8), 2).chances, 0.25)
    half = np.array([0.5, 0.5])
    sample = TileSample(np.zeros((2, 2), int), (24, 24), half, np.zeros(2), 0.0, 1.0)
    assert sample.infer(np.array([0.9, 0.7])) == pytest.approx(1 - 0.8)


BOUNDS = (-1, 1, -1, 1, -1, 1)
FRONT = Camera((0, -10, 0), (0, 0, 0), (0, 0, 1))


def rotation(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s], [s, c]])


def matrix(linear=None, offset=(0, 0, 0)):
    result = np.eye(4)
    result[:3, :3] = np.eye(3) if linear is None else linear
    result[:3, 3] = offset
    return result


def empty_vdi(camera=FRONT, bounds=BOUNDS, window_size=(20, 20)):
    """A VDI without supersegments: only its view matters here."""
    offsets = np.zeros(window_size[0] * window_size[1] + 1, np.uint64)
    nothing = np.empty(0, np.float32)
    return VDI(camera, window_size, offsets, nothing, nothing, np.empty((0, 3)), nothing, bounds)


TURN = np.eye(3)
TURN[:2, :2] = rotation(30)
PARALLEL = FRONT.replace(parallel_projection=True, parallel_scale=2)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (FRONT, FRONT, 0),
        (FRONT, FRONT.azimuth(30), 30),
        (FRONT, FRONT.azimuth(-170), 170),
        (FRONT, FRONT.azimuth(180), 180),
        (FRONT, FRONT.elevation(-25), 25),
        # From the horizon: cos = cos 60 cos 45
        (FRONT, FRONT.elevation(45).azimuth(60), math.degrees(math.acos(0.5 * math.sqrt(0.5)))),
        (FRONT, FRONT.replace(position=(0, -3, 0)), 0),  # closer
        (FRONT, FRONT.replace(focal_point=(0, 0, 4)), 0),  # looked elsewhere
        (FRONT, FRONT.replace(view_up=(1, 0, 1), view_angle=10), 0),  # rolled and zoomed
        (FRONT, FRONT.replace(position=(10, -10, 0), focal_point=(10, 0, 0)), 45),  # moved aside
        # The model turned by 30, the eye not, or with it
        (FRONT, FRONT.replace(model_transform=matrix(TURN)), 30),
        (FRONT.replace(model_transform=matrix(TURN)), FRONT, 30),
        (FRONT, FRONT.azimuth(30).replace(model_transform=matrix(TURN)), 0),
        (FRONT, FRONT.replace(model_transform=matrix(2 * np.eye(3))), 0),
        # Moved away sideways: the eye is now at (-10, -10, 0) from it
        (FRONT, FRONT.replace(model_transform=matrix(offset=(10, 0, 0))), 45),
        # Stretched from the start: as it looks, not as the model frame has it
        (
            FRONT.replace(model_transform=matrix(np.diag([1, 3, 1]))),
            FRONT.azimuth(40).replace(model_transform=matrix(np.diag([1, 3, 1]))),
            40,
        ),
        (
            FRONT.replace(model_transform=matrix(np.diag([-1, 1, 1]))),
            FRONT.azimuth(40).replace(model_transform=matrix(np.diag([-1, 1, 1]))),
            40,
        ),
        # Parallel: the direction of projection alone
        (PARALLEL, PARALLEL.azimuth(35), 35),
        (PARALLEL, PARALLEL.replace(position=(9, -10, 4), focal_point=(9, 0, 4)), 0),
        (FRONT, PARALLEL.azimuth(35), 35),
        (PARALLEL, FRONT.azimuth(35).replace(model_transform=matrix(TURN)), 5),
        # An eye at the centre looks along its direction of projection
        (FRONT, Camera((0, 0, 0), (0, 5, 0), (0, 0, 1)), 0),
        (FRONT, Camera((0, 0, 0), (5, 0, 0), (0, 0, 1)), 90),
        # The squares of these overflow
        (FRONT, Camera((1e300, -1e300, 0), (0, 0, 0), (0, 0, 1)), 45),
        (FRONT, FRONT.azimuth(40).replace(model_transform=np.diag([1e-300] * 3 + [1])), 40),
    ],
)
def test_angle_from_the_generating_view(old, new, expected):
    found = angle_from_generating_view(empty_vdi(old), new)
    assert found == pytest.approx(expected, abs=1e-6)


def test_the_angle_is_about_the_centre_of_the_bounds():
    """Bounds around (10, 0, 0): the eye goes from (-10, -10) to (0, -10), seen from there."""
    vdi = empty_vdi(bounds=(9, 11, -1, 1, -1, 1))
    beside = FRONT.replace(position=(10, -10, 0), focal_point=(10, 0, 0))
    assert angle_from_generating_view(vdi, beside) == pytest.approx(45)
    far = FRONT.replace(position=(0, -1.7e308, 0), focal_point=(0, 0, 0))
    with pytest.raises(InvalidCameraError, match=r"1\.7e\+308.* from the centre .* move it"):
        angle_from_generating_view(empty_vdi(bounds=(-1, 1, 1e307, 1.7e308, -1, 1)), far)


#: Cameras whose view angle's tangent is a quarter, and that look away.
LONG = FRONT.replace(view_angle=2 * math.degrees(math.atan(math.tan(math.radians(15)) / 4)))
AWAY = FRONT.replace(focal_point=(0, -20, 0))


@pytest.mark.parametrize(
    ("old", "new", "size", "expected"),
    [
        (FRONT, FRONT, (20, 20), 1),
        (FRONT, FRONT, (40, 40), 2),
        (FRONT, FRONT, (60, 20), 1),  # wider: the view angle is vertical
        (FRONT, FRONT.azimuth(77), (20, 20), 1),
        (FRONT, FRONT.replace(position=(0, -5, 0)), (20, 20), 2),
        (FRONT, FRONT.replace(position=(0, -20, 0)), (20, 20), 0.5),
        (FRONT, FRONT.replace(model_transform=matrix(3 * np.eye(3))), (20, 20), 3),
        # 1 along the eye does not count, 2 and 8 across it: root of their product
        (FRONT, FRONT.replace(model_transform=matrix(np.diag([2, 1, 8]))), (20, 20), 4),
        # Half way out of view: the bounds are between 0 and 1 in front of the eye, 0.5 on average
        (FRONT, FRONT.replace(position=(0, 0, 0), focal_point=(0, 1, 0)), (20, 20), 20),
        (FRONT, FRONT.replace(position=(0, 5, 0), focal_point=(0, 6, 0)), (20, 20), 0),  # behind
        (FRONT, LONG, None, 4),
        (PARALLEL, PARALLEL.replace(parallel_scale=0.5, position=(0, -99, 0)), None, 4),
        # Half the window at the centre is 10 tan 15 in perspective, 2 in parallel projection
        (FRONT, PARALLEL, None, 5 * math.tan(math.radians(15))),
        (AWAY, FRONT, None, math.inf),
        (AWAY, AWAY, None, 0),
    ],
)
def test_magnification(old, new, size, expected):
    assert magnification(empty_vdi(old), new, size) == pytest.approx(expected)
