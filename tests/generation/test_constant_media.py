"""Media whose image is known in closed form: constant volumes, slabs, and a VDI of slabs.

Each law is shown twice: the float64 reference to rounding, and the device to float32's rounding.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from extreme_scenes import slabs_vdi
from reference.compositing import composite

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.model.options import CRITERIA

WINDOW = (12, 9)
OPACITY = 0.35
COLOR = np.array([0.9, 0.4, 0.1])

#: Device: relative rounding of lengths and extinction (16), of up to 60 steps' sums (60) and of
#: compositing, on optical depths up to 4: tau exp(-tau) 2^-24 each, below 0.37 * 80 * 6e-8.
FLOAT32 = 2e-6


def chord(ray_origin, ray_direction, low, high, first):
    """Length of a ray inside a box, by the slab method; independent of the reference's clipping."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.stack([(low - ray_origin) / ray_direction, (high - ray_origin) / ray_direction])
    near, far = np.nanmax(t.min(axis=0)), np.nanmin(t.max(axis=0))
    return max(0.0, far - max(near, first)) * np.linalg.norm(ray_direction)


def pixel_rays(camera, window, to_box):
    """Eye and direction of every pixel's ray in a box's frame, straight from VTK's definitions.

    Yields row, column (top row first), origin, direction and the smallest t.
    """
    width, height = window
    forward = np.subtract(camera.focal_point, camera.position)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.view_up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    aspect = width / height
    linear = to_box[:3, :3]
    for row, column in itertools.product(range(height), range(width)):
        u = (2 * column + 1) / width - 1
        v = 1 - (2 * row + 1) / height
        if camera.parallel_projection:
            scale = camera.parallel_scale
            eye = camera.position + right * u * scale * aspect + up * v * scale
            direction, first = forward, -np.inf
        else:
            tangent = np.tan(np.radians(camera.view_angle) / 2)
            eye = np.array(camera.position)
            direction, first = forward + right * u * tangent * aspect + up * v * tangent, 0.0
        yield row, column, linear @ eye + to_box[:3, 3], linear @ direction, first


def chords(camera, window, volume):
    """Model length of each pixel's ray inside the volume's grid, float64 (H, W)."""
    lengths = np.zeros(window[::-1])
    # In the frame of the grid's own axes; its columns are unit vectors here, so lengths stay
    frame = np.eye(4)
    frame[:3, :3] = volume.direction
    frame[:3, 3] = volume.origin
    to_box = np.linalg.inv(camera.model_transform @ frame)
    top = (np.array(volume.dimensions) - 1) * volume.spacing
    for row, column, origin, direction, first in pixel_rays(camera, window, to_box):
        lengths[row, column] = chord(origin, direction, np.zeros(3), top, first)
    return lengths


def constant_volume(seed, dtype="uint8"):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(3, 8, size=3))
    return Volume(
        np.full(shape, 100, dtype=dtype),
        rng.uniform(0.5, 1.2, size=3),
        rng.normal(size=3) * 3,
        strategies.random_rotation(rng) if seed % 2 else np.eye(3),
    )


CONSTANT = TransferFunction([COLOR], [OPACITY], (0, 255), unit_distance=1.3)


def views(seed, volume):
    rng = np.random.default_rng([seed, 1])
    return [
        strategies.camera_around(
            rng, volume.bounds, strategies.random_transform(rng), parallel=parallel
        ).replace(window_center=(0, 0), use_horizontal_view_angle=False)
        for parallel in (False, True)
    ] + [strategies.camera_inside(rng, volume.bounds, np.eye(4))]


def beer_lambert(lengths):
    """1 - (1 - a)^(l / U) per pixel, times colour; premultiplied RGBA."""
    alpha = 1 - (1 - OPACITY) ** (lengths / CONSTANT.unit_distance)
    return np.dstack([alpha[..., None] * COLOR, alpha])


@pytest.mark.parametrize("seed", range(4))
def test_a_constant_volume_obeys_beer_lambert(runtime, seed):
    """The reference by either interpolation, the device's picture, and what a list holds: one
    supersegment, as long as the chord."""
    volume = constant_volume(seed, ("uint8", "float32", "int32", "float64")[seed])
    # The table holds float32: what its colour is of the colour meant
    held = np.append(CONSTANT.colors[0].astype(float) / COLOR, 1.0)
    for number, camera in enumerate(views(seed, volume)):
        lengths = chords(camera, WINDOW, volume)
        expected = beer_lambert(lengths)
        assert expected.any()
        for interpolation, step in (("nearest", None), ("linear", 0.31), ("nearest", 50.0)):
            # Steps' lengths add up to the chord, also of one longer than the volume
            look = CONSTANT.replace(interpolation=interpolation)
            image = reference.volume_image(volume, camera, WINDOW, look, step)
            np.testing.assert_allclose(image, expected * held, rtol=0, atol=1e-7)
        image = raycast_volume(volume, camera, WINDOW, CONSTANT, device=runtime)
        np.testing.assert_allclose(image, expected, rtol=0, atol=FLOAT32)
        criterion = CRITERIA[(seed + 2 * number) % len(CRITERIA)]  # which would cut the medium
        vdi = generate_vdi(volume, camera, WINDOW, CONSTANT, criterion=criterion, device=runtime)
        assert vdi.counts.max() == 1
        tau = np.zeros(WINDOW[::-1])
        tau[vdi.counts > 0] = vdi.optical_depth
        depth = -np.log1p(-OPACITY) * lengths / CONSTANT.unit_distance
        np.testing.assert_allclose(tau[::-1], depth, rtol=2e-6, atol=2e-6)
        np.testing.assert_allclose(vdi.color, np.tile(COLOR, (len(vdi.color), 1)), atol=1e-6)


#: Depths of the slabs' faces below z = 2, in model units, and their optical depth per unit length.
FACES = np.array([0.0, 0.5, 1.25, 2.0, 4.0])
EXTINCTION = np.array([0.8, 0.0, 3.0, 0.3])
SLAB_COLORS = np.array([[1, 0, 0.2], [0, 0, 0], [0.1, 0.9, 0.3], [0.2, 0.3, 1.0]])
SLAB_BOUNDS = (-2.0, 2.0, -1.5, 1.5, -2.0, 2.0)


def slab_vdi():
    """Slabs across z, seen by a parallel V_O along z whose window is the bounds' face.

    Then lists and supersegments tile the slabs exactly, and every new view is known.
    """
    own = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.5)
    kept = EXTINCTION > 0
    faces = 3 + np.column_stack([FACES[:-1], FACES[1:]])[kept]
    return slabs_vdi(
        own,
        faces,
        EXTINCTION[kept] * np.diff(faces)[:, 0],
        window=(8, 6),
        bounds=SLAB_BOUNDS,
        color=SLAB_COLORS[kept],
    )


def slab_image(camera, window, opaque_depth=np.inf, below=np.inf):
    """The slabs from any view: per slab the chord of its own box, composited in order.

    ``below`` clips away what lies above that z.
    """
    image = np.zeros((*window[::-1], 4))
    inverse = np.linalg.inv(camera.model_transform)
    low, high = np.reshape(SLAB_BOUNDS, (3, 2)).T
    for row, column, origin, direction, first in pixel_rays(camera, window, inverse):
        taus = []
        for k, extinction in enumerate(EXTINCTION):
            box_low, box_high = low.copy(), high.copy()
            box_high[2], box_low[2] = 2 - FACES[k], 2 - FACES[k + 1]
            box_high[2] = min(box_high[2], below)
            length = 0.0
            if box_high[2] > box_low[2]:
                length = chord(origin, direction, box_low, box_high, first)
                if opaque_depth < np.inf:  # what lies behind it is what a ray from there would see
                    length -= chord(origin, direction, box_low, box_high, max(first, opaque_depth))
            taus.append(extinction * length)
        order = slice(None) if direction[2] < 0 else slice(None, None, -1)
        image[row, column] = composite(SLAB_COLORS[order], taus[order])
    return image


def slab_views():
    """Every side, both projections, inside, and an actor that is stretched and sheared."""
    rng = np.random.default_rng(8)
    for number in range(7):
        transform = strategies.random_transform(
            rng, ("identity", "scale", "mirror", "shear")[number % 4]
        )
        if number == 6:
            yield strategies.camera_inside(rng, SLAB_BOUNDS, transform)
        else:
            yield strategies.camera_around(
                rng, SLAB_BOUNDS, transform, parallel=bool(number % 2)
            ).replace(window_center=(0, 0), use_horizontal_view_angle=False)


SLAB_VIEWS = list(slab_views())


def assert_close_but_at_silhouettes(image, expected, atol):
    """A ray that grazes an edge of the bounds meets it or not, within rounding."""
    differs = np.abs(image - expected).max(axis=-1) > atol
    assert differs.sum() <= 1, np.argwhere(differs)


@pytest.mark.parametrize("cut", [False, True], ids=["whole", "cut"])
@pytest.mark.parametrize("camera", SLAB_VIEWS, ids=lambda camera: repr(camera)[:20])
def test_slabs_from_any_view(runtime, camera, cut):
    """Also behind a clipping plane and before opaque geometry."""
    vdi, ends, expected = slab_vdi(), {}, slab_image(camera, WINDOW)
    if cut:
        end = np.float32(sum(strategies.view_depths(camera, SLAB_BOUNDS)) / 2)
        # Keeps the model's z <= 0.3, in world coordinates: normals go with the inverse transpose
        origin = camera.model_transform @ [0, 0, 0.3, 1]
        normal = np.linalg.inv(camera.model_transform)[:3, :3].T @ [0, 0, -1]
        ends = {
            "opaque_depth": np.full(WINDOW[::-1], end),
            "clipping_planes": [[*origin[:3], *normal]],
        }
        expected = slab_image(camera, WINDOW, opaque_depth=float(end), below=0.3)
    assert cut or expected.any()
    # The colours, optical depths and faces are stored in float32
    exact = reference.render(vdi, camera, WINDOW, **ends)
    assert_close_but_at_silhouettes(exact, expected, 5e-7)
    drawn = render_vdi(vdi, camera, WINDOW, device=runtime, **ends)
    assert_close_but_at_silhouettes(drawn, expected, 2e-5)


def test_generated_slabs_are_the_slabs(runtime):
    """Planes of points, nearest neighbour: each list's supersegments are the voxels' own layers.

    A step of half a spacing fits the layers, whose outer ones are half as thick. A gap ends a
    supersegment where the medium behind it is the same, too.
    """
    values = np.array([3, 3, 1, 0, 1, 2], dtype=np.uint8)
    volume = Volume(np.broadcast_to(values[:, None, None], (6, 4, 4)).copy())
    opacities = np.array([0.0, 0.2, 0.6, 0.9])
    colors = np.eye(4)[:, :3]
    transfer_function = TransferFunction(colors, opacities, (0, 3), unit_distance=1.0)
    camera = Camera(
        (1.5, 1.5, 9), (1.5, 1.5, 2), (0, 1, 0), parallel_projection=True, parallel_scale=1.4
    )
    vdi = generate_vdi(volume, camera, (3, 3), transfer_function, device=runtime)
    # From z = 5 down: value 2 to 4.5, 1 to 3.5, nothing to 2.5, value 1 to 1.5, value 3 to 0
    front, back = [4, 4.5, 6.5, 7.5], [4.5, 5.5, 7.5, 9]
    sigma = -np.log1p(-opacities[[2, 1, 1, 3]])
    for x, y in itertools.product(range(3), repeat=2):
        part = vdi.list_at(x, y)
        np.testing.assert_allclose(vdi.front[part] + vdi.depth_origin, front, atol=2e-6)
        np.testing.assert_allclose(vdi.back[part] + vdi.depth_origin, back, atol=2e-6)
        np.testing.assert_allclose(
            vdi.optical_depth[part], sigma * np.subtract(back, front), rtol=2e-6
        )
        np.testing.assert_allclose(vdi.color[part], colors[[2, 1, 1, 3]], atol=1e-6)


@pytest.mark.parametrize(("view_cone", "expected"), [(90.0, 3), (0.0, 2)])
def test_what_v_o_hardly_sees_differs_by_as_little(runtime, view_cone, expected):
    """Green and blue behind dense red: unlike by far, but hardly any of their light is seen.

    Half a voxel of blue behind a voxel of green, each of density ln 2 / (ln 2 + 1) = 0.41: the sum
    of squares grows by (1 x 0.5 / 1.5) x 2 x 0.41^2 = 0.11, above the tolerance's 0.1^2. Weighted
    by the transmittance of 1.5 voxels of red, 3e-5, it lies below.
    """
    values = np.array([2, 2, 1, 0, 0], dtype=np.uint8)
    volume = Volume(np.broadcast_to(values[:, None, None], (5, 4, 4)).copy())
    looks = TransferFunction(np.eye(3)[::-1], (0.5, 0.5, 0.999), (0, 2), unit_distance=1.0)
    camera = Camera(
        (1.5, 1.5, 9), (1.5, 1.5, 2), (0, 1, 0), parallel_projection=True, parallel_scale=1.4
    )
    vdi = generate_vdi(
        volume, camera.azimuth(180), (3, 3), looks, tolerance=0.1, view_cone=view_cone,
        device=runtime,
    )  # fmt: skip
    np.testing.assert_array_equal(vdi.counts, expected)
