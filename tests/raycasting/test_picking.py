"""What a ray hits first: analytic cases, what counts as a hit, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from extreme_scenes import slabs_vdi
from strategies import kept_values

import pyvista_vdi as pvdi
from pyvista_vdi import InvalidArgumentError, InvalidVDIError

#: The bounds of the slabs below, and the planes of their faces.
BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
THIN = (-0.75, -0.5)  # z of the haze; float32 holds all of these depths
SOLID = (0.25, 0.75)

#: A few operations of float64 on numbers of about 10.
ROUNDING = 1e-13


#: A parallel view along z, from below, of which +x lies on the left.
FACING = pvdi.Camera((0, 0, -5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)


def slabs(thin=0.02, solid=30.0, edge=8, camera=FACING):
    """Two slabs across the cube, a haze and something solid."""
    return slabs_vdi(
        camera,
        np.add([THIN, SOLID], 5),
        [thin, solid],
        window=(edge, edge),
        bounds=BOUNDS,
        color=[[1, 0.5, 0], [0, 0.5, 1]],
    )


def view(position, transform=None):
    """A perspective view of the cube."""
    return pvdi.Camera(position, (0, 0, 0), (0, 1, 0.1), model_transform=transform)


def ray(camera, pixel, size):
    """Eye and unit direction in the world of the ray through a pixel's centre."""
    half_width, half_height = camera.half_extent(size)
    u, v = (2 * pixel[0] + 1) / size[0] - 1, (2 * pixel[1] + 1) / size[1] - 1
    direction = np.array([u * half_width, v * half_height, 1.0]) @ camera.axes
    return np.array(camera.position), direction / np.linalg.norm(direction)


OBLIQUE, SIZE, PIXEL = view((0.4, 0.3, -6)), (64, 48), (31, 20)


def test_a_slab_in_a_cube_is_hit_on_its_face():
    hit = pvdi.pick(slabs(), OBLIQUE, PIXEL, SIZE, opacity_threshold=0.5)
    eye, direction = ray(OBLIQUE, PIXEL, SIZE)
    expected = eye + (SOLID[0] - eye[2]) / direction[2] * direction
    assert isinstance(hit, pvdi.Pick)
    assert hit.position == pytest.approx(expected, abs=ROUNDING)
    assert hit.position[2] == pytest.approx(SOLID[0], abs=ROUNDING)
    assert hit.depth == pytest.approx((expected - eye) @ OBLIQUE.axes[2], abs=ROUNDING)
    assert hit.color == (0, 0.5, 1)
    # Crossed over lists' borders, by the length along the ray; the haze before it has tau 0.02
    assert hit.opacity == pytest.approx(-math.expm1(-hit.optical_depth), rel=1e-12)
    before = hit.accumulated_optical_depth - hit.optical_depth
    assert before == pytest.approx(0.02 / direction[2], rel=1e-6)  # stored in float32
    with pytest.raises(AttributeError):
        hit.depth = 0.0


@pytest.mark.parametrize(
    ("camera", "options", "axis", "place", "index"),
    [
        (OBLIQUE, {"opacity_threshold": 0}, 2, THIN[0], 0),  # haze, where so little is asked for
        (view((0.4, 0.3, 6)), {}, 2, SOLID[1], 1),  # from behind the far face is the first
        (OBLIQUE, {"clipping_planes": [[0, 0, 0.5, 0, 0, 1]]}, 2, 0.5, 1),
        # From beside, the bounds are hit first, in the outermost column
        (pvdi.Camera((6, 0, 0.5), (0, 0, 0.5), (0, 1, 0)), {}, 0, 1.0, 1),
    ],
    ids=["haze", "from behind", "clipped", "from beside"],
)
def test_which_face_is_hit(camera, options, axis, place, index):
    # The middle of a window: from beside, a ray along no list
    pixel, size = (PIXEL, SIZE) if axis == 2 else ((10, 10), (21, 21))
    hit = pvdi.pick(slabs(), camera, pixel, size, **options)
    assert hit.position[axis] == pytest.approx(place, abs=ROUNDING)
    assert hit.index == index
    assert hit.color == ((1, 0.5, 0), (0, 0.5, 1))[index]
    assert axis == 2 or hit.list[0] == 0
    if "clipping_planes" in options:  # what is cut away absorbs nothing
        assert hit.accumulated_optical_depth == hit.optical_depth


def test_accumulated_opacity_does_not_depend_on_how_a_list_is_cut():
    """Ten supersegments of which none is seen by itself."""
    z = 4 + np.arange(11) / 5
    haze = slabs_vdi(FACING, np.column_stack([z[:-1], z[1:]]), 0.04, bounds=BOUNDS)
    # 0.04 k >= -log(1 - 0.15) = 0.1625: five
    hit = pvdi.pick(haze, FACING, (0, 0), opacity_threshold=0.15)
    assert hit.index == 4
    assert hit.accumulated_opacity == pytest.approx(-math.expm1(-0.2), rel=1e-6)
    assert pvdi.pick(haze, FACING, (0, 0), opacity_threshold=0.15, accumulated=False) is None
    by_itself = pvdi.pick(haze, FACING, (0, 0), opacity_threshold=0.03, accumulated=False)
    assert by_itself.index == 0
    hazy = slabs(thin=0.2)
    assert pvdi.pick(hazy, FACING, (3, 3), opacity_threshold=0.5, accumulated=False).index == 1


def test_a_ray_ends_at_opaque_geometry():
    vdi, depth = slabs(), 5 + SOLID[0]
    assert pvdi.pick(vdi, FACING, (3, 3), opaque_depth=depth - 1e-6) is None
    # tau is 60 per unit, and 0.0513 are an opacity of 0.05
    assert pvdi.pick(vdi, FACING, (3, 3), opaque_depth=depth + 1e-3).index == 1
    assert pvdi.pick(vdi, FACING, (3, 3), opaque_depth=math.inf).index == 1


def test_an_origin_far_away_costs_no_digits_of_the_world():
    far = 1e6
    matrix = np.eye(4)
    matrix[2, 3] = far
    camera = pvdi.Camera((0.4, 0.3, far - 6), (0, 0, far), (0, 1, 0), model_transform=matrix)
    hit = pvdi.pick(slabs(), camera, PIXEL, SIZE)
    assert hit.position[2] - far == pytest.approx(SOLID[0], abs=4 * np.spacing(far))


def test_beside_it_nothing_is_hit():
    assert pvdi.pick(slabs(), OBLIQUE, (0, 0), SIZE) is None
    assert pvdi.pick(slabs_vdi(FACING, [], [], bounds=BOUNDS), FACING, (0, 0)) is None
    assert pvdi.pick(slabs(thin=0, solid=0), FACING, (3, 3), opacity_threshold=0) is None


DEPTH = "opaque_depth must be a view depth"
WINDOW = "pixel must be .* inside the window of 8 x 8"


@pytest.mark.parametrize(
    ("pixel", "options", "message"),
    [
        *(
            ((0, 0), {"opacity_threshold": threshold}, "opacity_threshold must be at least 0")
            for threshold in (-0.1, 1, 1.5, math.nan, "much", None)
        ),
        *((pixel, {}, WINDOW) for pixel in ((8, 0), (0, -1), (math.nan, 0), (1, 2, 3), 5, None)),
        ((0, 0), {"opaque_depth": math.nan}, DEPTH),
        ((0, 0), {"opaque_depth": [1.0, 2.0]}, DEPTH),
        ((0, 0), {"clipping_planes": [[1, 2]]}, "clipping_planes"),
    ],
)
def test_impossible_arguments_are_refused_by_name(pixel, options, message):
    with pytest.raises(InvalidArgumentError, match=message):
        pvdi.pick(slabs(), FACING, pixel, **options)


def test_other_things_are_refused():
    with pytest.raises(InvalidVDIError, match="expected a VDI"):
        pvdi.pick("knee.vdi", FACING, (0, 0))
    with pytest.raises(InvalidArgumentError, match="opacity_threshold"):
        pvdi.render_depth(slabs(), FACING, opacity_threshold=1.0)


def test_depth_image_of_a_slab(runtime):
    """The kernel's depth of a plane at right angles to the view is the same everywhere."""
    depth = pvdi.render_depth(slabs(), FACING, (20, 10), device=runtime)
    assert depth.shape == (10, 20)
    assert depth.dtype == np.float32
    # The window is twice as wide as the VDI's: on either side there is nothing
    assert np.isinf(depth[:, :5]).all()
    assert np.isinf(depth[:, 15:]).all()
    # 4 units of float32: a rounding each of the face, the ray's ends and the sum
    assert depth[:, 5:15] == pytest.approx(5 + SOLID[0], rel=5e-7)


def test_depth_image_ends_rays_of_another_picture(runtime):
    scene = slabs(), OBLIQUE, (32, 24)
    depth = pvdi.render_depth(*scene, opacity_threshold=0.5, device=runtime)
    alone = pvdi.render(*scene, opaque_depth=depth, device=runtime)[..., 3]
    seen = np.isfinite(depth)
    assert seen.any()
    # Mostly only the haze is left before it, tau 0.02; over a list's border something solid, too
    assert alone[seen].max() < 0.5
    assert np.median(alone[seen]) == pytest.approx(0.02, abs=1e-3)


def test_a_deferred_vdi_says_the_value_that_is_hit():
    slabs_of_values = slabs()
    n = slabs_of_values.n_supersegments
    rng = np.random.default_rng(3)
    values = rng.uniform(0, 1, n), np.zeros(n), np.ones(n)
    kept = kept_values(slabs_of_values, *values, unit_distance=1.0, sample_distance=0.01)
    # What is below 200 is transparent, and left out: the lists that are shown have other numbers
    look = pvdi.TransferFunction([[1, 1, 1]] * 3, [0, 0, 1], (100, 300))
    values = set()
    for x, y in np.ndindex(8, 8):
        hit = pvdi.pick(kept, FACING, (x, y), opacity_threshold=0, transfer_function=look)
        opaque = kept.values[kept.lists.list_at(x, y)]
        opaque = opaque[opaque > 200]  # nearest to the eye first
        assert (hit is None) == (len(opaque) == 0)
        if hit is not None:
            assert hit.value == pytest.approx(opaque[0])
            values.add(hit.value)
            seen = (x, y)
    assert len(values) > 8
    assert pvdi.pick(kept.classified(transfer_function=look), FACING, seen).value is None
