"""The oracle against itself: laws of DESIGN section 3 that hold for any medium and any view."""

from __future__ import annotations

import numpy as np
import pytest
import strategies

from pyvista_vdi import reference
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.compositing import Segment, composite, split
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.reference.raycast import centre_ray_scale

#: Float64 rounding, grown by a few hundred operations and by media as thin as 1e-3 of the depth.
EXACT = 1e-9

SEEDS = range(6)


def case(seed, kind="near", **options):
    rng = np.random.default_rng([seed, 10])
    vdi = strategies.random_vdi(rng, max_window=(9, 7), **options)
    return rng, vdi, *strategies.random_view(rng, vdi, kind)


def rebuilt(vdi, **changes):
    names = (
        "camera",
        "window_size",
        "offsets",
        "front",
        "back",
        "color",
        "optical_depth",
        "bounds",
    )
    arguments = {name: getattr(vdi, name) for name in (*names, "depth_origin")}
    return VDI(**{**arguments, **changes})


def assert_same_picture(first, second, tolerance=EXACT):
    """Equal but for rays within rounding of a border, which may fall on either side."""
    differs = np.abs(first - second).max(axis=-1) > tolerance
    assert differs.mean() <= 0.02, f"{differs.sum()} of {differs.size} pixels differ"


def wide_bounds(vdi):
    """Bounds that cut nothing off, so that lists are seen whole."""
    reach = 1e3 * np.abs(vdi.bounds).max() + 1e3
    return np.tile([-reach, reach], 3)


@pytest.mark.parametrize("seed", SEEDS)
def test_at_v_o_every_pixel_composites_its_own_list(seed):
    _, vdi, _, _ = case(seed)
    vdi = rebuilt(vdi, bounds=wide_bounds(vdi))
    # The near limit grows with the bounds; what lies before it is left out by hand
    limit = reference.raycast.near_limit(vdi) if not vdi.camera.parallel_projection else -np.inf
    image = reference.render(vdi, vdi.camera)
    width, height = vdi.window_size
    for y in range(height):
        for x in range(width):
            part = vdi.list_at(x, y)
            front = vdi.front[part].astype(float) + vdi.depth_origin
            back = vdi.back[part].astype(float) + vdi.depth_origin
            seen = np.clip((back - np.maximum(front, limit)) / (back - front), 0, 1)
            expected = composite(vdi.color[part], vdi.optical_depth[part] * seen)
            np.testing.assert_allclose(image[height - 1 - y, x], expected, atol=EXACT)


@pytest.mark.parametrize("kind", ["same", "around", "behind", "inside"])
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_splitting_supersegments_changes_nothing(seed, kind):
    rng, vdi, camera, size = case(seed, kind, thinnest=0.02)
    parts = {"front": [], "back": [], "color": [], "optical_depth": []}
    for k in range(vdi.n_supersegments):
        segment = Segment(
            float(vdi.front[k]), float(vdi.back[k]), vdi.color[k], float(vdi.optical_depth[k])
        )
        depth = float(
            np.float32(segment.front + rng.uniform(0.2, 0.8) * (segment.back - segment.front))
        )
        for piece in split(segment, depth):
            for name in parts:
                parts[name].append(getattr(piece, name))
    twice = rebuilt(
        vdi, offsets=vdi.offsets * np.uint64(2), **{n: np.array(v) for n, v in parts.items()}
    )
    # Optical depths up to 100 are stored in float32: relative 6e-8 each, times tau exp(-tau) < 0.4
    assert_same_picture(
        reference.render(twice, camera, size), reference.render(vdi, camera, size), 1e-6
    )


@pytest.mark.parametrize("kind", ["around", "parallel", "inside", "axis"])
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_moving_model_and_cameras_together_changes_nothing(seed, kind):
    rng, vdi, camera, size = case(seed, kind)
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
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_the_unit_of_length_does_not_matter(seed, factor):
    _, vdi, camera, size = case(seed, "around")

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

    other = rebuilt(
        vdi,
        camera=scaled(vdi.camera),
        front=vdi.front * np.float32(factor),
        back=vdi.back * np.float32(factor),
        bounds=np.multiply(vdi.bounds, factor),
        depth_origin=vdi.depth_origin * factor,
    )
    # Scaled depths are rounded to float32 again: 6e-8 of media no thinner than 2e-3 of the depth
    assert_same_picture(
        reference.render(other, scaled(camera), size), reference.render(vdi, camera, size), 1e-4
    )


@pytest.mark.parametrize("scale", [(1e-3, 1e-3, 1e-3), (1, 1, 3), (2, 2, 0.5), (-1, 1, 2)])
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_optical_depth_does_not_depend_on_the_actor_s_scale(seed, scale):
    """Lengths are model lengths (DESIGN section 3, "Frames"): scaling an actor keeps its picture.

    Seen in parallel projection along the model's z axis, so that the stretched rays are the same
    lines of the model; a mirrored actor shows the mirrored picture.
    """
    _, vdi, _, _ = case(seed)
    size = (8, 8)
    middle = np.reshape(vdi.bounds, (3, 2)).mean(axis=1)
    plain = Camera(
        np.add(middle, [0, 0, 50]), middle, (0, 1, 0), parallel_projection=True, parallel_scale=2.0
    )
    stretched = plain.replace(
        position=np.multiply(scale, plain.position),
        focal_point=np.multiply(scale, plain.focal_point),
        parallel_scale=2.0 * scale[1],
        model_transform=np.diag([*scale, 1.0]),
    )
    before = reference.render(vdi, plain, size)
    after = reference.render(vdi, stretched, size)
    assert before.any()
    assert_same_picture(after[:, ::-1] if scale[0] < 0 else after, before)


@pytest.mark.parametrize("seed", SEEDS[:3])
def test_perspective_from_far_away_is_parallel(seed):
    _, vdi, _, _ = case(seed, camera=Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), view_angle=40),
                           bounds=(-2, 2, -2, 2, -2, 2))  # fmt: skip
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    distance = 1e7
    far = Camera(
        direction * distance, (0, 0, 0), (0.1, 1, 0.2),
        view_angle=2 * np.degrees(np.arctan(2.5 / distance)),
    )  # fmt: skip
    flat = far.replace(position=direction * 10, parallel_projection=True, parallel_scale=2.5)
    # Rays differ by an angle of 2.5e-7 over a depth of 7: 2e-6 in position, of media 2e-3 thin
    assert_same_picture(
        reference.render(vdi, far, (12, 12)), reference.render(vdi, flat, (12, 12)), 2e-3
    )


def test_looking_backwards_composites_in_the_other_order():
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), parallel_projection=True)
    red, blue = [1, 0, 0], [0, 0, 1]
    vdi = VDI(camera, (1, 1), [0, 2], [1, 2], [2, 3], [red, blue], [0.5, 0.8],
              (-1, 1, -1, 1, -9, 0))  # fmt: skip
    back = camera.replace(position=(0, 0, -5), focal_point=(0, 0, 0))
    np.testing.assert_allclose(
        reference.render(vdi, camera, (1, 1))[0, 0], composite([red, blue], [0.5, 0.8])
    )
    np.testing.assert_allclose(
        reference.render(vdi, back, (1, 1))[0, 0], composite([blue, red], [0.8, 0.5])
    )


def test_a_border_belongs_to_the_higher_index():
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), parallel_projection=True)
    colors = [[0.25 * k] * 3 for k in range(4)]
    vdi = VDI(camera, (2, 2), [0, 1, 2, 3, 4], [1] * 4, [2] * 4, colors, [50] * 4,
              (-1, 1, -1, 1, -9, 0))  # fmt: skip
    middle = reference.render(vdi, camera, (1, 1))[0, 0]  # its ray runs along both borders
    np.testing.assert_allclose(middle[:3], colors[3])


def test_the_eye_ends_a_ray_in_perspective_only():
    own = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1)
    vdi = VDI(own, (1, 1), [0, 1], [4], [6], [[1, 1, 1]], [2.0], (-1, 1, -1, 1, -1, 1))
    inside = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), view_angle=1)
    half = reference.render(vdi, inside, (1, 1))[0, 0, 3]
    whole = reference.render(vdi, inside.replace(parallel_projection=True), (1, 1))[0, 0, 3]
    np.testing.assert_allclose([half, whole], -np.expm1([-1.0, -2.0]), rtol=1e-9)


def test_opaque_geometry_and_clipping_planes_end_rays():
    own = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1)
    vdi = VDI(own, (1, 2), [0, 1, 2], [4, 4], [6, 6], [[1, 1, 1]] * 2, [2.0] * 2,
              (-1, 1, -1, 1, -1, 1))  # fmt: skip
    depth = [[4.5], [np.inf]]  # the top row ends after a quarter
    image = reference.render(vdi, own, opaque_depth=depth)
    np.testing.assert_allclose(image[:, 0, 3], -np.expm1([-0.5, -2.0]))
    planes = [[0, 0, 0.5, 0, 0, -3]]  # keeps z <= 0.5: the nearest quarter is gone
    image = reference.render(vdi, own, opaque_depth=depth, clipping_planes=planes)
    np.testing.assert_allclose(image[:, 0, 3], -np.expm1([-0.0, -1.5]))


@pytest.mark.parametrize("seed", SEEDS)
def test_centre_ray_lengths_are_the_formula_of_the_design(seed):
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


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", SEEDS)
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


def test_the_range_of_a_ray_on_a_border_contains_both_sides():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    colors = [[0, 0, 0], [1, 1, 1]]
    vdi = VDI(camera, (2, 1), [0, 1, 2], [4.5] * 2, [5.5] * 2, colors, [40] * 2,
              (-9, 9, -9, 9, -9, 9))  # fmt: skip
    low, high = reference.render_range(vdi, camera, (1, 1), [(0, 0)])
    np.testing.assert_allclose(low, [[0, 0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(high, [[1, 1, 1, 1]], atol=1e-12)


def test_bad_arguments_are_refused_by_name():
    _, vdi, camera, size = case(0)
    with pytest.raises(InvalidArgumentError, match="opaque_depth must have shape"):
        reference.render(vdi, camera, size, opaque_depth=np.zeros((size[1] + 1, size[0])))
    with pytest.raises(InvalidArgumentError, match="clipping_planes must have shape"):
        reference.render(vdi, camera, size, clipping_planes=[0, 0, 0, 1])
    with pytest.raises(InvalidArgumentError, match="k must be"):
        reference.render_range(vdi, camera, size, [(0, 0)], k=-1)
