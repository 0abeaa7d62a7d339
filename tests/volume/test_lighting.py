"""Shading and gradient opacity: the device against the float64 reference, and what is compiled."""

from __future__ import annotations

import march_ways
import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from reference.generate import medium_at

from pyvista_vdi import (
    Light,
    Lights,
    Shading,
    TransferFunction,
    Volume,
)
from pyvista_vdi.model.camera import Camera

WINDOW = (7, 6)

#: Largest difference from the reference, of 1. Some tens of float32 roundings in a normal and in
#: its power of 30, of samples that are composited: 1e-5. Measured over 84 cases on two platforms:
#: 1.0e-6.
TOLERANCE = 1e-5

SHINY = Shading(0.2, 0.6, 0.5, 30.0)
DIRECTIONAL = Light("scene", (3, -2, 4), (0, 0, 0), (0.1, 0, 0.2), (0.9, 0.8, 0.7), (0.5, 0.6, 1))
BESIDE = Light("camera", (1, 0.5, 0.2), (0, 0, 0), diffuse=(0.3, 0.5, 0.2))
SPOT = Light(
    "scene", (9, 9, 15), (0, 0, 0), positional=True, attenuation=(0.5, 0.02, 0.001), cone_angle=40,
    exponent=2,
)  # fmt: skip
BULB = Light("camera", (0.5, 1, 0.5), (0, 0, 0), positional=True, cone_angle=180)

LIGHTS = {
    "headlight": Lights(),
    "one-sided headlight": Lights(two_sided=False),
    "directional": Lights((DIRECTIONAL,)),
    "one-sided": Lights((DIRECTIONAL, BESIDE), two_sided=False),
    "with a headlight": Lights((DIRECTIONAL, BESIDE, Light(diffuse=(0.2, 0.2, 0.2)))),
    "positional": Lights((SPOT, BULB, BESIDE)),
    "dimmed headlight": Lights((Light(ambient=(0.5, 0, 0.2), diffuse=(1, 0.5, 0), intensity=0.6),)),
    "positional headlight": Lights((Light(positional=True),)),
    "none": Lights(()),
}


def smooth_volume(rng, dtype="float32", **options):
    """A field whose gradient never vanishes for long: two soft blobs on a slope."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in (11, 12, 13)), indexing="ij")
    field = np.zeros_like(x)
    for weight in (150, -100):
        a, b, c = rng.uniform(-0.5, 0.5, 3)
        field += weight * np.exp(-3 * ((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2))
    return Volume((field + 40 * x + 30 * y - 50 * z + 128).astype(dtype), **options)


def looks(volume, *, shaded=True, gradient=False, **options):
    if shaded:
        options["shading"] = SHINY
    if gradient:
        options["gradient_opacities"] = [0.0, 0.1, 0.8, 1.0, 0.3]
        options["gradient_range"] = (2.0, 25.0)
    colors = [[0.9, 0.2, 0.1], [0.3, 0.8, 0.5], [0.2, 0.3, 0.9]]
    options = {"unit_distance": 1.0, "interpolation": "linear", **options}
    return TransferFunction(colors, [0.0, 0.3, 0.7], volume.finite_range(), **options)


def case(seed, dtype="float32", **more):
    rng = np.random.default_rng(seed)
    volume = smooth_volume(
        rng,
        dtype,
        spacing=rng.uniform(0.5, 1.5, 3),
        origin=rng.normal(size=3) * 3,
        direction=strategies.random_rotation(rng),
    )
    camera = strategies.random_camera(rng, volume.bounds)
    return volume, camera, looks(volume, **more)


@pytest.mark.parametrize(("seed", "name"), list(enumerate(LIGHTS)))
def test_shaded_pictures_are_the_reference_s(runtime, name, seed):
    volume, camera, function = case(seed)
    lights = LIGHTS[name]
    image = raycast_volume(volume, camera, WINDOW, function, lights=lights, device=runtime)
    expected = reference.volume_image(volume, camera, WINDOW, function, lights=lights)
    assert expected[..., 3].max() > 0.1
    np.testing.assert_allclose(image, expected, atol=TOLERANCE)


@pytest.mark.parametrize(
    ("dtype", "shaded"), [("float32", True), ("uint8", False), ("float64", False), ("int32", True)]
)
def test_gradient_opacity_is_the_reference_s(runtime, dtype, shaded):
    """Voxels that are scaled for the device have the same gradients."""
    volume, camera, function = case(3, dtype, shaded=shaded, gradient=True)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    expected = reference.volume_image(volume, camera, WINDOW, function)
    plain = reference.volume_image(volume, camera, WINDOW, looks(volume, shaded=shaded))
    assert np.abs(plain - expected).max() > 0.05
    np.testing.assert_allclose(image, expected, atol=TOLERANCE)


@pytest.mark.every(4)
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("name", ["headlight", "positional", "one-sided", None])
def test_blocks_of_rays_are_lit_as_one_ray_is(monkeypatch, runtime, name, interpolation):
    """To the last bit, on a CPU device; by gradient opacity alone, too."""
    volume = march_ways.volume_of(np.uint8, (1, 0.8, 1.3))
    function = looks(volume, shaded=name is not None, gradient=name in (None, "positional"))
    function = function.replace(interpolation=interpolation)
    camera, lights = march_ways.VIEWS["all of it"](volume), LIGHTS.get(name)
    found, expected, launches = march_ways.both_ways(
        monkeypatch,
        runtime,
        "render_volume",
        lambda: raycast_volume(volume, camera, (37, 23), function, lights=lights, device=runtime),
    )
    assert launches == (1, 1)
    assert found.tobytes() == expected.tobytes()
    assert found[..., :3].max() > 0.1


@pytest.mark.parametrize("name", ["headlight", "positional"])
def test_a_vdi_has_the_light_in_its_colours(runtime, name):
    """Seen from V_O it is the shaded volume, and its metadata tell what lit it."""
    volume, camera, function = case(5, gradient=True)
    lights = LIGHTS[name]
    vdi = generate_vdi(volume, camera, WINDOW, function, lights=lights, device=runtime)
    expected = reference.volume_image(volume, camera, WINDOW, function, lights=lights)
    np.testing.assert_allclose(render_vdi(vdi, camera, device=runtime), expected, atol=TOLERANCE)
    assert vdi.metadata["lights"] == lights.to_dict()
    assert TransferFunction.from_dict(vdi.metadata["transfer_function"]) == function
    own = reference.build_vdi(volume, camera, WINDOW, function, lights=lights)
    np.testing.assert_allclose(reference.render(own, camera), expected, atol=1e-5)


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_nan_beside_a_sample_leaves_its_other_differences(runtime, interpolation):
    array = smooth_volume(np.random.default_rng(8)).array.copy()
    array[5, 6, 3:9] = np.nan
    volume, camera = Volume(array), Camera((30, -50, 20), (6, 6, 5), (0, 0, 1))
    function = looks(volume, gradient=True).replace(interpolation=interpolation)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    assert np.isfinite(image).all()
    expected = reference.volume_image(volume, camera, WINDOW, function)
    off = np.abs(image - expected).max(axis=2) > TOLERANCE
    # A sample within rounding of a voxel's border may take either side's value
    assert off.sum() <= (2 if interpolation == "nearest" else 0)


def test_a_flat_volume_reflects_ambient_light_only():
    volume = Volume(np.full((4, 4, 4), 7.0))
    function = TransferFunction([[0.5, 1, 0]], [0.4], (7, 7), unit_distance=1.0, shading=SHINY)
    camera = Camera((9, 1.5, 1.5), (1.5, 1.5, 1.5), (0, 0, 1))
    color, tau = medium_at(volume, function, np.array([[1.5, 1, 2]]), np.ones(1), camera)
    np.testing.assert_allclose(color, [[0.1, 0.2, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(tau, -np.log(1 - np.float32(0.4)), rtol=1e-6)


def test_a_slope_seen_along_its_normal_by_a_headlight():
    """Ambient + diffuse on the colour, specular in white; half a turn away the same, two-sided."""
    x = np.broadcast_to(np.arange(8.0), (8, 8, 8))
    volume = Volume(x * 10, spacing=(0.5, 2, 3))
    function = TransferFunction(
        [[0.2, 0.4, 0.6]], [0.5], (0, 70), shading=Shading(0.1, 0.5, 0.2, 8), unit_distance=1.0
    )
    middle = np.array([[3.5, 3.5, 3.5]])
    centre = (3.5 * 0.5, 7, 10.5)
    for side in (-1, 1):
        camera = Camera((centre[0] + side * 40, *centre[1:]), centre, (0, 0, 1))
        color, _ = medium_at(volume, function, middle, np.ones(1), camera)
        np.testing.assert_allclose(color, [np.array([0.2, 0.4, 0.6]) * 0.6 + 0.2], rtol=1e-6)
        one_sided = Lights(two_sided=False)
        color, _ = medium_at(volume, function, middle, np.ones(1), camera, one_sided)
        lit = side < 0  # the scalar grows away from the eye
        wanted = np.array([0.2, 0.4, 0.6]) * (0.6 if lit else 0.1) + (0.2 if lit else 0)
        np.testing.assert_allclose(color, [wanted], rtol=1e-6)


def test_gradient_opacity_multiplies_the_step_s_opacity():
    """Magnitude: scalars per mean spacing, at most a quarter of the range; in closed form."""
    _, y, x = np.meshgrid(*(np.arange(8.0),) * 3, indexing="ij")
    volume = Volume(x * 6 + y, spacing=(1, 2, 3))
    options = {"gradient_opacities": [0, 1], "gradient_range": (0, 20), "interpolation": "linear"}
    function = TransferFunction([[1, 1, 1]], [0.5], (0, 1), unit_distance=1.0, **options)
    position, length = np.array([[3.5, 3.5, 3.5]]), np.array([0.7])
    _, tau = medium_at(volume, function, position, length)
    magnitude = 2 * np.hypot(6, 0.5)  # of 6 and 1 / 2 per unit, at a mean spacing of 2
    magnitude = min(magnitude, 49 / 4)
    alpha = 1 - 0.5**0.7
    np.testing.assert_allclose(tau, -np.log(1 - magnitude / 20 * alpha), rtol=1e-6)


def test_lights_change_nothing_without_shading(runtime):
    volume, camera, function = case(2, shaded=False)
    dark, lit = (
        generate_vdi(volume, camera, WINDOW, function, lights=lights, device=runtime)
        for lights in (None, LIGHTS["positional"])
    )
    assert lit.equals(dark)
    assert "lights" not in dark.metadata
    assert "shading" not in dark.metadata["transfer_function"]
