"""Off-screen pictures: drawn by VDI or volume, whichever is right for the view, never by time."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, add_judge, shown, soft_ball
from settings import with_settings
from skimage.metrics import structural_similarity

import pyvista_vdi as pvdi
from pyvista_vdi.quality.plan import SIMILAR

pytestmark = pytest.mark.gl

WINDOW = (160, 120)
VIEW = ((5, 2, 3), (0, 0, 0), (0, 0, 1))


def alike(a, b):
    return structural_similarity(a, b, channel_axis=2, data_range=255)


@pytest.fixture
def pair():
    """A plotter with ours and one with VTK's own mapper of the same ball, to be treated alike."""
    plotters = [pv.Plotter(window_size=WINDOW) for _ in range(2)]
    yield plotters
    for plotter in plotters:
        plotter.close()


def film(angles, **options):
    """Return the pictures of a turn, and by what each was drawn."""
    plotter = pv.Plotter(window_size=WINDOW)
    actor = plotter.add_vdi(soft_ball(), **LOOKS, **options)
    pictures, drawn = [], []
    for angle in angles:
        plotter.camera_position = VIEW
        plotter.camera.Azimuth(angle)
        pictures.append(shown(plotter))
        drawn.append(actor.status.drawn)
    plotter.close()
    return pictures, drawn


def test_one_picture_makes_no_vdi_and_actor_vdi_makes_that_of_its_view(plotter):
    actor = plotter.add_vdi(soft_ball(), **LOOKS)
    plotter.camera_position = VIEW
    shown(plotter)
    assert (actor.status.drawn, actor.status.generation, actor.status.vdi) == ("volume", 0, None)
    assert "a volume" in repr(actor)
    plotter.camera.Azimuth(50)
    shown(plotter)
    made = actor.vdi
    np.testing.assert_allclose(made.camera.position, VIEW[0])
    assert actor.vdi is made
    # A change makes another, when it is asked for
    actor.prop.interpolation_type = "linear"
    assert shown(plotter).min() < 200
    assert actor.vdi is not made


def test_a_camera_that_was_given_is_that_of_the_vdi(plotter):
    chosen = pvdi.Camera((0, 6, 1), (0, 0, 0), (0, 0, 1))
    actor = plotter.add_vdi(soft_ball(), camera=chosen, **LOOKS)
    plotter.camera_position = VIEW
    shown(plotter)
    np.testing.assert_allclose(actor.vdi.camera.position, chosen.position)


def test_a_film_has_the_same_bits_in_every_run():
    angles = np.linspace(0, 3, 4)
    (pictures, drawn), (again, drawn_again) = film(angles), film(angles)
    assert drawn == drawn_again == ["volume"] * 4
    for picture, other in zip(pictures, again, strict=True):
        np.testing.assert_array_equal(picture, other)


def _looked_around(plotter, add):
    add()
    for x, y in ((1, 0), (-1, 0.3)):
        plotter.camera_position = ((0.2, 0.1, 0.2), (0.2 + x, 0.1 + y, 0.2), (0, 0, 1))
        plotter.show(auto_close=False)
        plotter.render()


def _moved(plotter, add):
    """A VDI made for another place of the actor."""
    add()
    shown(plotter)
    plotter.volume.position = (0.5, 0.7, 0.1)
    plotter.camera.zoom(1.7)


@pytest.mark.parametrize("script", [_looked_around, _moved])
@pytest.mark.parametrize("made", [False, True])
def test_every_view_is_as_with_vtks_mapper(pair, script, made):
    """With and without a VDI of the first picture's view."""
    ours, judge = pair
    looks = {**LOOKS, "interpolation": "linear", "sample_distance": 0.02}

    def add():
        actor = ours.add_vdi(soft_ball(), **with_settings(**looks))
        if made:
            ours.render()
            shown(ours)
            assert actor.vdi is not None

    script(ours, add)
    script(judge, lambda: add_judge(judge, soft_ball()))
    judge.camera = ours.camera.copy()
    pictures = shown(ours), shown(judge)
    assert np.ptp(pictures[1]) > 100
    assert alike(*pictures) >= SIMILAR


def test_a_picture_at_a_scale_has_the_detail_of_its_pixels(plotter):
    rng = np.random.default_rng(0)
    noise = pv.ImageData(dimensions=(48, 48, 48))
    noise["v"] = rng.random(noise.n_points)
    noise = noise.gaussian_smooth(std_dev=1.0)
    contrast = []
    for draw in ("auto", "volume", "vdi"):
        plotter.clear()
        actor = plotter.add_vdi(noise, opacity=[0, 0, 0, 0.3, 1], show_scalar_bar=False, draw=draw)
        shown(plotter)
        assert actor.vdi is not None
        picture = plotter.screenshot(None, return_img=True, scale=4).astype(float)
        rows, columns = (edge // 4 * 4 for edge in picture.shape[:2])
        blocks = picture[:rows, :columns].reshape(rows // 4, 4, columns // 4, 4, 3)
        contrast.append(blocks.std(axis=(1, 3)).mean())
    assert contrast[0] == pytest.approx(contrast[1], rel=0.1)
    assert contrast[2] < contrast[1] / 2  # what lists can show of it


def test_a_volume_in_bricks_has_its_picture(plotter):
    actor = plotter.add_vdi(soft_ball(80), settings=pvdi.Settings(memory_limit=12_000_000), **LOOKS)
    plotter.camera_position = VIEW
    picture = shown(plotter)
    assert actor.status.drawn == "volume"
    other = pv.Plotter(window_size=plotter.window_size)
    other.add_vdi(soft_ball(80), draw="volume", **LOOKS)
    other.camera_position = VIEW
    np.testing.assert_allclose(picture, shown(other), atol=1)
    other.close()
