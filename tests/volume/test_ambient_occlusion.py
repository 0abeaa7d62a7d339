"""Ambient occlusion: closed forms, the device against float64, and nothing for who does not ask."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from runtimes import let_lack

from pyvista_vdi import AmbientOcclusion, DeviceMemoryError, Shading, TransferFunction, Volume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.volume.classified_volume import DeviceVolume

WINDOW = (7, 6)

#: Largest difference from the reference, of 1: float32 against float64, see test_lighting.py. Up to
#: some hundred factors of a transmittance, each rounded: 1e-5. Measured: 2.4e-6.
TOLERANCE = 1e-5


def nodes_of(runtime, volume, function, occlusion):
    """Mean transmittance at the nodes, by the device, (nz, ny, nx)."""
    medium = DeviceVolume(runtime, volume, function, ambient_occlusion=occlusion)
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0))  # lights have no part in it
    return runtime.download(medium.medium_arguments(camera)["ambient"])


def homogeneous(opacity, unit_distance=1.0):
    """Everything at or below 0.5 has this opacity, everything above is empty."""
    options = {"unit_distance": unit_distance, "interpolation": "linear"}
    return TransferFunction(np.ones((2, 3)), [opacity, 0], (0.5, 0.5), **options)


def test_inside_a_homogeneous_medium_it_is_the_transmittance_of_the_radius(runtime):
    """exp(-sigma R), whatever the direction; an actor's matrix has no part in it."""
    volume = Volume(np.zeros((33, 33, 33), np.int16), spacing=(0.5, 0.5, 0.5))
    function, radius = homogeneous(0.3, unit_distance=2.0), 4.0
    expected = 0.7 ** (radius / 2)
    occlusion = AmbientOcclusion(radius)
    found = nodes_of(runtime, volume, function, occlusion)
    assert found.shape == (33, 33, 33)
    np.testing.assert_allclose(found[16, 16, 16], expected, rtol=1e-5)
    # At a corner seven of eight octants are free, but for the border that cells blur
    assert abs(found[0, 0, 0] - (7 + expected) / 8) < 0.02
    centre = np.array([[16.0, 16, 16]])
    direct = reference.ambient_transmittance(volume, function, centre, radius, 12)
    np.testing.assert_allclose(direct, expected, rtol=1e-6)


def case(seed, **options):
    rng = np.random.default_rng(seed)
    volume = strategies.random_volume(rng, edge=12)
    function = strategies.random_transfer_function(rng, volume, interpolation="linear")
    camera = strategies.random_camera(rng, volume.bounds)
    radius = rng.uniform(0.05, 0.6) * volume.length
    return volume, camera, function.replace(**options), AmbientOcclusion(radius, 0.3, 20)


def test_pictures_are_the_reference_s(runtime):
    volume, camera, function, occlusion = case(1)
    given = {"ambient_occlusion": occlusion}
    expected = reference.volume_image(volume, camera, WINDOW, function, **given)
    plain = reference.volume_image(volume, camera, WINDOW, function)
    assert (plain - expected)[..., :3].max() > 0.004
    assert (expected[..., :3] <= plain[..., :3] + 1e-12).all()
    np.testing.assert_array_equal(expected[..., 3], plain[..., 3])
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime, **given)
    np.testing.assert_allclose(image, expected, atol=TOLERANCE)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime, **given)
    np.testing.assert_allclose(render_vdi(vdi, camera, device=runtime), expected, atol=TOLERANCE)
    about = {"radius": occlusion.radius, "strength": 0.3, "directions": 20}
    assert vdi.metadata["ambient_occlusion"] == about
    own = reference.build_vdi(volume, camera, WINDOW, function, **given)
    np.testing.assert_allclose(reference.render(own, camera), expected, atol=1e-5)


@pytest.mark.parametrize("more", ["gradients", "RGBA"])
def test_with_everything_else_as_well(runtime, more):
    volume, camera, function, occlusion = case(7)
    low, high = volume.finite_range()
    gradient = {"gradient_opacities": [0, 1], "gradient_range": (0, (high - low) / 4)}
    gradient["shading"] = Shading(0.3, 0.6, 0.4, 5)
    changes = {
        "gradients": gradient,
        "RGBA": {"scalar_range": (0, 255)},
    }
    function = function.replace(**changes[more])
    if more == "RGBA":
        rng = np.random.default_rng(0)
        channels = [strategies.random_array(rng, "uint8", (9, 8, 10)) for _ in range(4)]
        volume = Volume(np.stack(channels, axis=-1), volume.spacing, volume.origin)
    given = {"ambient_occlusion": occlusion}
    expected = reference.volume_image(volume, camera, WINDOW, function, **given)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime, **given)
    np.testing.assert_allclose(image, expected, atol=TOLERANCE)
    plain = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    assert (plain - image)[..., :3].max() > 0.005


def test_a_grid_that_does_not_fit_is_refused(runtime, monkeypatch):
    volume, camera, function, _ = case(2)
    let_lack(monkeypatch, runtime, "opacities for ambient occlusion")
    with pytest.raises(DeviceMemoryError, match="larger radius of ambient occlusion"):
        raycast_volume(volume, camera, WINDOW, function, ambient_occlusion=True, device=runtime)
