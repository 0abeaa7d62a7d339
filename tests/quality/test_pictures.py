"""What a view shows of a VDI, and what draws a picture that is kept."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.frame_state import Estimate, FrameAsked, Pictures, Sight
from pyvista_vdi.quality.pictures import SIMILAR, deserves_vdi, drawn_by_volume, serves
from pyvista_vdi.quality.tiles import contrast_ratio
from pyvista_vdi.quality.view_error import angle_from_generating_view

SIZE = (64, 64)
BOUNDS = (-1.0, 1.0) * 3


def vdi_of(camera, size=SIZE):
    """A VDI of nothing, with a view and bounds."""
    empty = np.zeros(size[0] * size[1] + 1, dtype=np.int64)
    return pvdi.VDI(camera, size, empty, [], [], np.zeros((0, 3)), [], BOUNDS)


def along_z(scale=1.0, center=(0.0, 0.0), **changes):
    view = ((0, 0, 5), (0, 0, 0), (0, 1, 0))
    how = {"parallel_projection": True, "parallel_scale": scale, "window_center": center}
    return pvdi.Camera(*view, **{**how, **changes})


@pytest.mark.parametrize(
    ("v_o", "v_n", "share"),
    [
        (along_z(), along_z(), 1.0),
        (along_z(2.0), along_z(), 1.0),
        (along_z(), along_z(2.0), 1.0),  # what is around the volume is not asked for
        (along_z(center=(1.0, 0.0)), along_z(), 0.5),  # its left half lies outside
        (along_z(0.5), along_z(), 0.25),
        (along_z(), pvdi.Camera((0, 0, -5), (0, 0, 0), (0, 1, 0)), 1.0),  # from behind
        (along_z(), pvdi.Camera((0, 0, 5), (0, 0, 9), (0, 1, 0)), 1.0),  # nothing in view
    ],
)
def test_coverage_is_the_share_of_the_rays_that_the_vdi_has(v_o, v_n, share):
    # Of 33 rays along an edge, those at the border may be in or out
    assert coverage(vdi_of(v_o), v_n, SIZE) == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.0), (0.9, 0.9, 0.9), (0.0, 0.0, 3.0)])
def test_an_eye_that_turns_leaves_what_was_covered(eye):
    """An eye within the volume has its own view, and not all of one that it has turned to."""
    inside = max(eye) < 1
    v_o = pvdi.Camera(eye, (0.0, 0.1, -9.0), (0, 1, 0), view_angle=40)
    aside = v_o.replace(focal_point=(9.0, 0.1, 9.0))
    assert coverage(vdi_of(v_o), v_o, SIZE) == 1.0
    turned = coverage(vdi_of(v_o), aside, SIZE)
    assert (turned < 0.6) if inside else (turned == 1.0)  # from outside nothing is seen there
    # Something of what lies behind V_O's eye is not covered, though it is in V_O's direction
    assert coverage(vdi_of(v_o), v_o.replace(position=(0, 0, 9.0)), SIZE) < 1 or not inside


def test_contrast_is_of_detail_within_blocks_and_weighted():
    rng = np.random.default_rng(1)
    sharp = np.float32(rng.random((2, 24, 24, 4)))
    sharp[..., 3] = 1
    coarse = sharp[:, ::4, ::4].repeat(4, axis=1).repeat(4, axis=2)
    assert contrast_ratio(list(coarse), list(sharp), np.ones(2)) == 0
    half = [0.5 * sharp[0] + 0.5 * coarse[0], sharp[1]]
    assert contrast_ratio(half, list(sharp), np.ones(2)) == pytest.approx(0.75, abs=0.01)
    assert contrast_ratio(half, list(sharp), np.array([1.0, 3.0])) == pytest.approx(0.875, abs=0.01)
    assert contrast_ratio(list(coarse), list(coarse), np.ones(2)) == 1


class Judge:
    """Answers what is asked of an estimate, and counts."""

    def __init__(self, ssim=1.0, contrast=1.0):
        self.ssim, self.contrast, self.asked = ssim, contrast, 0


def view(angle):
    return View(along_z(1.5).azimuth(angle), SIZE)


class Asked:
    """Pictures in a row, of VDIs of one volume."""

    def __init__(self, vdi):
        self.pictures, self.vdi = Pictures(), vdi

    def __call__(self, angle, judge, *, detail=1.0, bound=None, options=None, seen_from=None):
        shown = view(angle) if seen_from is None else seen_from
        of = (angle_from_generating_view(self.vdi, shown.camera), detail)
        seen = Sight(1, BOUNDS, None, *of, coverage(self.vdi, shown.camera, SIZE), options=options)
        frame = FrameAsked(0.0, 1, shown, 1)
        self.pictures, does = serves(self.pictures, seen, frame, bound)
        if does is None:
            judge.asked += 1
            found = Estimate(1, shown, judge.ssim, judge.contrast, options)
            frame = FrameAsked(0.0, 1, shown, 1, judged=found)
            self.pictures, does = serves(self.pictures, seen, frame, bound)
        return does


@pytest.fixture
def ask():
    return Asked(vdi_of(along_z(1.5)))


def test_a_vdi_draws_what_it_shows_as_the_volume_does(ask):
    judge = Judge(SIMILAR)
    assert ask(3, judge)
    assert ask(3.1, judge)  # by the same estimate
    assert judge.asked == 1
    assert not ask(30, judge)  # where the volume is as fast
    assert not ask(3, judge, detail=1.3)
    assert judge.asked == 1
    assert ask(3, judge, options="clipped")
    assert judge.asked == 2


def test_what_lies_beside_v_o_is_not_left_out():
    """However well the rest is drawn: an estimate compares what both show."""
    zoomed = Asked(vdi_of(along_z(0.5)))
    assert not zoomed(0, Judge(), seen_from=View(along_z(1.5), SIZE))
    assert zoomed(0, Judge(), seen_from=View(along_z(0.4), SIZE))


@pytest.mark.parametrize("judge", [Judge(SIMILAR - 0.001), Judge(1.0, 0.89), Judge(1.0, 1.11)])
def test_what_fails_near_its_view_is_not_asked_about_farther_away(ask, judge):
    asked = judge.asked
    assert not ask(3, judge)
    assert not ask(6, judge)
    assert judge.asked == asked + 1
    for angle in range(20):
        ask.pictures = drawn_by_volume(ask.pictures, view(3 + 0.01 * angle))
    assert not deserves_vdi(ask.pictures, view(3), BOUNDS)


def test_a_bound_that_was_given_takes_the_place_of_detail(ask):
    assert ask(3, Judge(0.91, 0.5), detail=3.0, bound=0.9)
    assert not ask(6, Judge(0.89), bound=0.9)


def test_a_vdi_is_worth_while_after_as_many_pictures_as_it_costs():
    pictures = Pictures()
    for number in range(40):
        angle = 0.3 * number
        deserved = deserves_vdi(pictures, view(angle), BOUNDS)
        assert deserved == (number >= 12)
        for _ in range(3):  # the same picture once more costs nothing
            pictures = drawn_by_volume(pictures, view(angle))
    apart = Pictures()
    for number in range(40):
        apart = drawn_by_volume(apart, view(20 * number))
    assert not deserves_vdi(apart, view(0), BOUNDS)
