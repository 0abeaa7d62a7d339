"""Cropping and the opacity multiplier: the device against the float64 oracle, and against laws.

The bound for each channel is that of tests/support/oracle.py: crossings of cropping planes are
found with as many roundings as the ends of a ray, and the oracle's range moves the ends of every
part that cropping leaves of it.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import generate_vdi, pick_vdi, raycast_volume, render_first_hits, render_vdi
from oracle import assert_explained, total
from ray_scenes import random_cropping, random_ends, random_planes
from reference.raycast import clip, inside_box, kept_parts, pixel_ray

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.cropping import PRESETS, Cropping
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.quality.view_error import ViewErrorEstimator

in_two_ways = pytest.mark.parametrize("dealt", ["one by one", "blocks"], indirect=True)


def case(seed, **options):
    rng = np.random.default_rng([seed, 600])
    vdi = strategies.random_vdi(rng, max_window=(12, 9), **options)
    kind = strategies.VIEWS[seed % len(strategies.VIEWS)]
    camera, size = strategies.random_view(rng, vdi, kind)
    return rng, vdi, camera, size, f"seed {[seed, 600]}, view {kind!r}"


@in_two_ways
@pytest.mark.every(3)
@pytest.mark.parametrize("kind", ["flags", *PRESETS])
def test_every_pixel_is_within_the_range_of_the_moved_ray(runtime, kind, dealt):
    """With and without what else ends rays."""
    parts = []
    for seed in range(20 if kind == "flags" else 6):
        rng, vdi, camera, size, name = case(seed)
        regions = int(rng.integers(Cropping.ALL + 1)) if kind == "flags" else kind
        shown = {
            "cropping": random_cropping(rng, vdi.bounds, regions),
            "opacity_multiplier": float(2 ** rng.uniform(-3, 3)),
        }
        if seed % 3 == 2:
            shown |= random_ends(rng, vdi, camera, size)
        image = render_vdi(vdi, camera, size, device=runtime, **shown)
        plain = render_vdi(vdi, camera, size, device=runtime, skip_empty=False, **shown)
        np.testing.assert_array_equal(image, plain)
        parts.append(assert_explained(vdi, camera, size, image, name=name, **shown))
    assert total(parts).drawn > total(parts).pixels / 50


@in_two_ways
def test_all_regions_are_everything_and_none_is_nothing(runtime, dealt):
    rng, vdi, camera, size, _ = case(2)
    planes = random_planes(rng, vdi.bounds)
    whole = render_vdi(vdi, camera, size, device=runtime)
    assert whole.any()
    for cropping in ((planes, Cropping.ALL), tuple(vdi.bounds)):
        np.testing.assert_array_equal(
            render_vdi(vdi, camera, size, cropping=cropping, device=runtime), whole
        )
    for nothing in ({"cropping": (planes, 0)}, {"opacity_multiplier": 0.0}):
        assert not render_vdi(vdi, camera, size, device=runtime, **nothing).any()


def test_only_what_is_used_is_compiled():
    _, vdi, camera, size, _ = case(2)
    pixel_rays = rays.pixel_rays(camera, size, vdi.bounds)
    middle = np.reshape(vdi.bounds, (3, 2)).mean(axis=1)[:, None]
    inside = (middle + (np.reshape(vdi.bounds, (3, 2)) - middle) / 3).ravel()
    for cropping, planes, several in (
        (None, 0, False),
        (Cropping(inside, Cropping.ALL), 0, False),
        (Cropping(inside), 6, False),
        (Cropping(inside, 0), 1, False),
        (Cropping(inside, "fence"), 0, True),
    ):
        cropped = rays.cropped(pixel_rays, cropping, vdi.bounds)
        assert (len(cropped.planes), bool(cropped.forms)) == (planes, several)


def test_previews_are_cropped_and_multiplied(runtime):
    differences = []
    for seed in range(6):
        rng, vdi, camera, size, _ = case(seed, thinnest=0.3, max_supersegments=3)
        shown = {
            "cropping": (random_planes(rng, vdi.bounds), int(rng.integers(Cropping.ALL))),
            "opacity_multiplier": 0.3,
        }
        exact = render_vdi(vdi, camera, size, device=runtime, **shown)
        preview = render_vdi(vdi, camera, size, preview_samples=3000, device=runtime, **shown)
        differences.append(np.abs(exact - preview).max(axis=-1).ravel())
    # An approximation: a sample stands for a part of the ray (seen: a mean of 0.0015)
    assert np.concatenate(differences).mean() < 0.01


@pytest.mark.parametrize("regions", [*PRESETS, 0x2A55A3C, 0x0000001, 0])
def test_a_constant_volume_absorbs_by_the_length_that_is_kept(runtime, regions):
    rng = np.random.default_rng(5)
    volume = Volume(np.ones((5, 6, 7), np.uint8), (0.5, 0.4, 0.3), (1.0, 2.0, -1.0))
    look = TransferFunction([[0.2, 0.5, 0.8]] * 2, [0.7, 0.7], (0, 2), unit_distance=1.0)
    box = np.reshape(volume.bounds, (3, 2))
    planes = box[:, :1] + [[0.2, 0.75]] * (box[:, 1:] - box[:, :1])
    cropping = Cropping(planes.ravel(), regions)
    camera = strategies.camera_around(
        rng, np.array(volume.bounds), strategies.random_transform(rng)
    )
    size = (21, 17)
    shown = {"cropping": cropping, "opacity_multiplier": 1.7, "early_termination": False}
    image = raycast_volume(
        volume, camera, size, look, sample_distance=0.05, device=runtime, **shown
    )
    expected = np.zeros(size[::-1])
    for y, x in np.ndindex(expected.shape):
        ray = pixel_ray(camera, size, x, y)
        span = clip(inside_box(ray, volume.bounds))
        parts = [] if span is None else kept_parts(ray, *span, cropping)
        length = sum(b - a for a, b in parts) * np.linalg.norm(ray.direction)
        expected[size[1] - 1 - y, x] = -np.expm1(1.7 * np.log1p(-0.7) * length)
    # Sixty steps of three roundings; where a ray grazes an edge, its ends are as exact as that
    np.testing.assert_allclose(image[..., 3], expected, atol=2e-5)
    assert regions == 0 or expected.max() > 0.1


def test_an_estimate_compares_the_pictures_that_are_shown(default_runtime):
    """Where a volume has changed, and what has changed is cropped away, nothing is lost."""
    rng = np.random.default_rng(7)
    before = rng.random((16, 16, 16), dtype=np.float32)
    after = before.copy()
    after[:, :, 8:] = 0  # the half of larger x
    ramp = np.linspace(0, 1, 16)
    look = TransferFunction(np.stack([ramp] * 3, axis=1), 0.3 * ramp, (0, 1), unit_distance=1.0)
    camera = Camera((8, -40, 10), (8, 8, 8), (0, 0, 1))
    vdi = generate_vdi(Volume(before), camera, (96, 72), look, max_supersegments=64)
    estimator = ViewErrorEstimator(Volume(after), look)
    corner = ((6.5, 20, 0, 20, 12, 20), 0x49)  # no box, to the left of 6.5
    assert estimator.estimate(vdi, camera).ssim < 0.9
    for cropping in ((-1, 6.5, -1, 20, -1, 20), corner):
        shown = RenderOptions(cropping=cropping)
        assert estimator.estimate(vdi, camera, None, shown).ssim > 0.99, cropping


def test_what_is_picked_is_what_is_shown(runtime):
    """The device and the host agree, and nothing is hit where nothing is kept."""
    pixels = hits = moved = different = 0
    for seed in range(12):
        if strategies.VIEWS[seed % len(strategies.VIEWS)] == "half":
            continue  # every ray runs along borders
        rng, vdi, camera, size, _ = case(seed, thinnest=0.05)
        cropping = random_cropping(rng, vdi.bounds, int(rng.integers(Cropping.ALL)))
        shown = {"cropping": cropping, "opacity_multiplier": 2.0, "opacity_threshold": 0.3}
        depth = render_first_hits(vdi, camera, size, device=runtime, **shown)[::-1]
        whole = pick_depths(vdi, camera, size, opacity_threshold=0.3)
        picked = pick_depths(vdi, camera, size, **shown)
        near, far = strategies.view_depths(camera, vdi.bounds)
        both = np.isfinite(depth) & np.isfinite(picked)
        # float32 on either side of a border or of the threshold may hit another supersegment
        differs = np.isfinite(depth) != np.isfinite(picked)
        differs[both] = np.abs(depth[both] - picked[both]) > 1e-4 * (far - near)
        different += differs.sum()
        pixels += differs.size
        hits += both.sum()
        moved += np.count_nonzero(both & (whole != picked))
    assert different < 0.01 * pixels  # seen: 0 of 918
    assert hits > 80
    assert moved > 40


def pick_depths(vdi, camera, size, cropping=None, **shown):
    """View depth of what each pixel picks, (H, W), bottom row first; inf for nothing."""
    depth = np.full(size[::-1], np.inf)
    for y, x in np.ndindex(depth.shape):
        hit = pick_vdi(vdi, camera, (x, y), size, cropping=cropping, **shown)
        if hit is None:
            continue
        depth[y, x] = hit.depth
        if cropping is not None:
            to_model = np.linalg.inv(camera.model_transform)
            beyond = 1e-9 * (np.array(hit.position) - camera.position)
            point = (to_model @ [*(np.array(hit.position) + beyond), 1])[:3]
            point = cropping.normals @ point
            planes = np.reshape(cropping.planes, (3, 2))
            assert cropping.keeps(*(int((point[a] >= planes[a]).sum()) for a in range(3)))
    return depth
