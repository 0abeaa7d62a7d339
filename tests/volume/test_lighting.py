"""Shading and gradient opacity: the device against the float64 reference, and what is compiled."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi

from pyvista_vdi import Light, Lights, Shading, TransferFunction, Volume

WINDOW = (7, 6)
PLACE = ("spacing", "origin", "direction")

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


@pytest.mark.parametrize(
    ("name", "dtype", "interpolation", "gradient", "blanked"),
    [
        ("headlight", "float32", "linear", False, True),
        ("one-sided headlight", "float64", "linear", True, False),
        ("directional", "float64", "linear", False, False),
        ("one-sided", "int32", "linear", False, True),
        ("with a headlight", "float32", "linear", False, True),
        ("positional", "float32", "nearest", True, False),
        ("dimmed headlight", "int32", "linear", False, False),
        ("positional headlight", "float64", "linear", False, True),
        ("none", "float32", "linear", False, False),
        (None, "int16", "linear", True, True),  # without shading
    ],
)
def test_pictures_are_the_reference_s(runtime, name, dtype, interpolation, gradient, blanked):
    """Shaded, by gradient opacity, of blank octants and NaN; voxels that are scaled for the device
    have the same gradients."""
    seed = len(name or "")
    volume, camera, function = case(seed, dtype, shaded=name is not None, gradient=gradient)
    if blanked:
        octants = np.random.default_rng(4).integers(0, 256, (2, *volume.array.shape), np.uint8)
        volume.blanked = octants[0] & octants[1]
    if dtype == "float32":
        array = volume.array.copy()
        array[5, 6, 3:9] = np.nan  # a sample beside it keeps its other differences
        blanked, volume = volume.blanked, Volume(array, *(getattr(volume, n) for n in PLACE))
        volume.blanked = blanked
    function = function.replace(interpolation=interpolation)
    lights = LIGHTS.get(name)
    image = raycast_volume(volume, camera, WINDOW, function, lights=lights, device=runtime)
    expected = reference.volume_image(volume, camera, WINDOW, function, lights=lights)
    assert expected[..., 3].max() > 0.1
    off = np.abs(image - expected).max(axis=2) > TOLERANCE
    # A sample within rounding of a voxel's border may take either side's value
    assert off.sum() <= (2 if interpolation == "nearest" else 0), np.abs(image - expected).max()


def test_a_vdi_has_the_light_in_its_colours(runtime):
    """Seen from V_O it is the shaded volume, and its metadata tell what lit it."""
    volume, camera, function = case(5, gradient=True)
    lights = LIGHTS["positional"]
    vdi = generate_vdi(volume, camera, WINDOW, function, lights=lights, device=runtime)
    expected = reference.volume_image(volume, camera, WINDOW, function, lights=lights)
    np.testing.assert_allclose(render_vdi(vdi, camera, device=runtime), expected, atol=TOLERANCE)
    assert vdi.metadata["lights"] == asdict(lights)
    assert TransferFunction.from_dict(vdi.metadata["transfer_function"]) == function
    own = reference.build_vdi(volume, camera, WINDOW, function, lights=lights)
    np.testing.assert_allclose(reference.render(own, camera), expected, atol=1e-5)
