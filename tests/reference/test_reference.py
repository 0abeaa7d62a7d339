"""The oracle against itself: laws of docs/dev/conventions.md, of any medium and any view."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from extreme_scenes import slabs_vdi
from ray_scenes import rebuilt

import reference
from pyvista_vdi import Camera, InvalidArgumentError
from reference.compositing import Segment, composite, split
from reference.raycast import centre_ray_scale, near_limit

#: Float64 rounding, grown by a few hundred operations and by media as thin as 1e-3 of the depth.
EXACT = 1e-9

#: A parallel view of the unit cube about the origin that fills the window.
FACING = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1)
CUBE = (-1, 1, -1, 1, -1, 1)


def case(seed, kind="near", **options):
    rng = np.random.default_rng([seed, 10])
    vdi = strategies.random_vdi(rng, max_window=(9, 7), **options)
    return rng, vdi, *strategies.random_view(rng, vdi, kind)


def assert_same_picture(first, second, tolerance=EXACT):
    """Equal but for rays within rounding of a border, which may fall on either side."""
    differs = np.abs(first - second).max(axis=-1) > tolerance
    assert differs.mean() <= 0.02, f"{differs.sum()} of {differs.size} pixels differ"


@pytest.mark.parametrize("seed", range(4))
def test_at_v_o_every_pixel_composites_its_own_list(seed):
    _, vdi, _, _ = case(seed)
    # Bounds that cut nothing off, so that lists are seen whole
    reach = 1e3 * np.abs(vdi.bounds).max() + 1e3
    vdi = rebuilt(vdi, bounds=np.tile([-reach, reach], 3))
    # The near limit grows with the bounds; what lies before it is left out by hand
    limit = -np.inf if vdi.camera.parallel_projection else near_limit(vdi)
    image = reference.render(vdi, vdi.camera)[::-1]
    for y, x in np.ndindex(vdi.counts.shape):
        part = vdi.list_at(x, y)
        front = vdi.front[part].astype(float) + vdi.depth_origin
        back = vdi.back[part].astype(float) + vdi.depth_origin
        seen = np.clip((back - np.maximum(front, limit)) / (back - front), 0, 1)
        expected = composite(vdi.color[part], vdi.optical_depth[part] * seen)
        np.testing.assert_allclose(image[y, x], expected, atol=EXACT)


@pytest.mark.parametrize("kind", ["same", "around", "behind", "inside"])
def test_splitting_supersegments_changes_nothing(kind):
    for seed in range(2):
        rng, vdi, camera, size = case(seed, kind, thinnest=0.02)
        pieces = []
        for k in range(vdi.n_supersegments):
            front, back = float(vdi.front[k]), float(vdi.back[k])
            segment = Segment(front, back, vdi.color[k], float(vdi.optical_depth[k]))
            depth = np.float32(front + rng.uniform(0.2, 0.8) * (back - front))
            pieces += split(segment, float(depth))
        names = ("front", "back", "color", "optical_depth")
        parts = {name: [getattr(piece, name) for piece in pieces] for name in names}
        twice = rebuilt(vdi, offsets=vdi.offsets * np.uint64(2), **parts)
        # Optical depths up to 100 are stored in float32: relative 6e-8 each, times
        # tau exp(-tau) < 0.4
        assert_same_picture(
            reference.render(twice, camera, size), reference.render(vdi, camera, size), 1e-6
        )


@pytest.mark.parametrize("kind", ["around", "parallel", "inside", "axis"])
def test_moving_model_and_cameras_together_changes_nothing(kind):
    rng, vdi, camera, size = case(1, kind)
    motion = strategies.random_transform(rng, "rigid")

    def moved(view):
        rotate = motion[:3, :3]
        return view.replace(
            position=rotate @ view.position + motion[:3, 3],
            focal_point=rotate @ view.focal_point + motion[:3, 3],
            view_up=rotate @ view.view_up,
            model_transform=motion @ view.model_transform,
        )

    before = reference.render(vdi, camera, size)
    # Only the new view's world moves: V_O stays where it was generated
    assert_same_picture(reference.render(vdi, moved(camera), size), before)
    elsewhere = rebuilt(vdi, camera=moved(vdi.camera))
    assert_same_picture(reference.render(elsewhere, camera, size), before)


@pytest.mark.parametrize("factor", [1e-6, 3.0, 1e6])
def test_the_unit_of_length_does_not_matter(factor):
    _, vdi, camera, size = case(2, "around")

    def scaled(view):
        # The model and the world in another unit: M keeps its linear part
        matrix = view.model_transform.copy()
        matrix[:3, 3] *= factor
        return view.replace(
            position=np.multiply(view.position, factor),
            focal_point=np.multiply(view.focal_point, factor),
            parallel_scale=view.parallel_scale * factor,
            model_transform=matrix,
        )

    names = ("front", "back", "bounds", "depth_origin")
    lengths = {name: np.multiply(getattr(vdi, name), factor) for name in names}
    other = rebuilt(vdi, camera=scaled(vdi.camera), **lengths)
    # Scaled depths are rounded to float32 again: 6e-8 of media no thinner than 2e-3 of the depth
    assert_same_picture(
        reference.render(other, scaled(camera), size), reference.render(vdi, camera, size), 1e-4
    )


@pytest.mark.parametrize("scale", [(1e-3, 1e-3, 1e-3), (2, 2, 0.5), (-1, 1, 2)])
def test_optical_depth_does_not_depend_on_the_actor_s_scale(scale):
    """Lengths are model lengths: scaling an actor keeps its picture.

    Seen in parallel projection along the model's z axis, so that the stretched rays are the same
    lines of the model; a mirrored actor shows the mirrored picture.
    """
    _, vdi, _, _ = case(0)
    middle = np.reshape(vdi.bounds, (3, 2)).mean(axis=1)
    plain = FACING.replace(
        position=np.add(middle, [0, 0, 50]), focal_point=middle, parallel_scale=2
    )
    stretched = plain.replace(
        position=np.multiply(scale, plain.position),
        focal_point=np.multiply(scale, plain.focal_point),
        parallel_scale=2.0 * scale[1],
        model_transform=np.diag([*scale, 1.0]),
    )
    before, after = (reference.render(vdi, camera, (8, 8)) for camera in (plain, stretched))
    assert before.any()
    assert_same_picture(after[:, ::-1] if scale[0] < 0 else after, before)


@pytest.mark.parametrize("seed", range(3))
def test_perspective_from_far_away_is_parallel(seed):
    own = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), view_angle=40)
    _, vdi, _, _ = case(seed, camera=own, bounds=(-2, 2, -2, 2, -2, 2))
    direction, distance = np.random.default_rng(seed).normal(size=3), 1e7
    direction /= np.linalg.norm(direction)
    angle = 2 * np.degrees(np.arctan(2.5 / distance))
    far = Camera(direction * distance, (0, 0, 0), (0.1, 1, 0.2), view_angle=angle)
    flat = far.replace(position=direction * 10, parallel_projection=True, parallel_scale=2.5)
    # Rays differ by an angle of 2.5e-7 over a depth of 7: 2e-6 in position, of media 2e-3 thin
    assert_same_picture(
        reference.render(vdi, far, (12, 12)), reference.render(vdi, flat, (12, 12)), 2e-3
    )


def test_looking_backwards_composites_in_the_other_order():
    red, blue = [1, 0, 0], [0, 0, 1]
    vdi = slabs_vdi(FACING, [(4, 5), (5, 6)], [0.5, 0.8], bounds=CUBE, color=[red, blue])
    ahead, back = (reference.render(vdi, FACING.azimuth(turn), (1, 1))[0, 0] for turn in (0, 180))
    np.testing.assert_allclose(ahead, composite([red, blue], [0.5, 0.8]))
    np.testing.assert_allclose(back, composite([blue, red], [0.8, 0.5]))


def test_a_border_belongs_to_the_higher_index_and_its_range_to_both():
    grey = np.repeat([[0.0], [0.25], [0.5], [0.75]], 3, axis=1)
    four = slabs_vdi(FACING, [4, 6], 50, window=(2, 2), bounds=CUBE)
    four = rebuilt(four, color=grey)
    middle = reference.render(four, FACING, (1, 1))[0, 0]  # its ray runs along both borders
    np.testing.assert_allclose(middle[:3], grey[3])
    low, high = reference.render_range(four, FACING, (1, 1), [(0, 0)])
    np.testing.assert_allclose(low, [[*grey[0], 1]], atol=1e-12)
    np.testing.assert_allclose(high, [[*grey[3], 1]], atol=1e-12)


def test_what_ends_rays():
    """The eye, in perspective only; opaque geometry and clipping planes."""
    vdi = slabs_vdi(FACING, [4, 6], 2.0, window=(1, 2), bounds=CUBE)
    inside = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), view_angle=1)
    depth = [[4.5], [np.inf]]  # the top row ends after a quarter
    planes = [[0, 0, 0.5, 0, 0, -3]]  # keeps z <= 0.5: the nearest quarter is gone
    for camera, ends, tau in (
        (inside, {}, [1.0]),
        (inside.replace(parallel_projection=True), {}, [2.0]),
        (FACING, {"opaque_depth": depth}, [0.5, 2.0]),
        (FACING, {"opaque_depth": depth, "clipping_planes": planes}, [0.0, 1.5]),
    ):
        image = reference.render(vdi, camera, (1, len(tau)), **ends)
        np.testing.assert_allclose(image[:, 0, 3], -np.expm1(np.negative(tau)), rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_centre_ray_lengths(seed):
    """L = (back - front) sqrt(1 + (u_c t_x)^2 + (v_c t_y)^2) for M = identity."""
    rng = np.random.default_rng(seed)
    bounds = strategies.random_bounds(rng)
    camera = strategies.camera_around(rng, bounds, np.eye(4), parallel=False)
    vdi = strategies.random_vdi(rng, camera=camera, bounds=bounds)
    (width, height), (tx, ty) = vdi.window_size, camera.half_extent(vdi.window_size)
    u = (2 * np.arange(width) + 1) / width - 1 + camera.window_center[0]
    v = (2 * np.arange(height) + 1) / height - 1 + camera.window_center[1]
    expected = np.sqrt(1 + (u * tx) ** 2 + (v[:, None] * ty) ** 2)
    np.testing.assert_allclose(centre_ray_scale(vdi), expected, rtol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_range_contains_the_unmoved_ray_and_is_narrow_away_from_borders(seed):
    _, vdi, camera, size = case(seed, "around")
    pixels = [(x, y) for y in range(size[1]) for x in range(size[0])]
    exact = reference.render_pixels(vdi, camera, size, pixels)
    low, high = reference.render_range(vdi, camera, size, pixels, n_random=5)
    assert (low <= exact).all()
    assert (exact <= high).all()
    assert np.median(high - low) < 1e-5
    unmoved = reference.render_range(vdi, camera, size, pixels, k=0)
    assert (unmoved[0] >= low - EXACT).all()


def test_bad_arguments_are_refused_by_name():
    _, vdi, camera, size = case(0)
    for ends, message in (
        ({"opaque_depth": np.zeros((size[1] + 1, size[0]))}, "opaque_depth must have shape"),
        ({"clipping_planes": [0, 0, 0, 1]}, "clipping_planes must have shape"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            reference.render(vdi, camera, size, **ends)
    with pytest.raises(InvalidArgumentError, match="k must be"):
        reference.render_range(vdi, camera, size, [(0, 0)], k=-1)
