"""Ambient occlusion: closed forms, the device against float64, and nothing for who does not ask."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from reference.generate import node_occlusion
from runtimes import let_lack
from scipy.interpolate import RegularGridInterpolator

from pyvista_vdi import (
    AmbientOcclusion,
    DeviceMemoryError,
    Shading,
    TransferFunction,
    Volume,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.quality.view_error import ViewErrorEstimator
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
    volume = Volume(np.zeros((33, 33, 33), np.uint8), spacing=(0.5, 0.5, 0.5))
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


def half_space(depth, sigma, radius):
    """Mean transmittance at a depth in a half space, by quadrature over the cosine."""
    cosine = (np.arange(20000) + 0.5) / 20000
    out = np.exp(-sigma * np.minimum(radius, depth / cosine)).mean()
    return (out + np.exp(-sigma * radius)) / 2


@pytest.mark.parametrize("tilted", [False, True])
def test_in_a_half_space_it_is_the_mean_over_the_sky(runtime, tilted):
    points = 61
    index = np.arange(points) - 30.0
    z, y, x = np.meshgrid(index, index, index, indexing="ij")
    normal = np.array([1, 2, 3]) / np.sqrt(14) if tilted else np.array([0.0, 0, 1])
    below = -(normal[0] * x + normal[1] * y + normal[2] * z)  # voxels under the face
    volume = Volume((-below).astype(np.float32) + 0.5)  # the medium is at 0.5 and less
    function = homogeneous(0.2)
    sigma, radius = -np.log(0.8), 12.0
    position = 30 - np.arange(0, 7)[:, None] * normal  # depths of 0 to 6 voxels
    expected = [half_space(d, sigma, radius) for d in range(7)]
    direct = reference.ambient_transmittance(volume, function, position, radius, 512)
    # 512 directions and steps of half a voxel; measured 0.0017
    np.testing.assert_allclose(direct, expected, atol=0.004)
    nodes = nodes_of(runtime, volume, function, AmbientOcclusion(radius))
    assert nodes.shape == (61, 61, 61)
    found = RegularGridInterpolator([range(points)] * 3, nodes.astype(float))(position[:, ::-1])
    # 32 directions, and cells that blur the face by half a voxel; measured 0.014, and 0.070 on the
    # face itself, along which rays then see half of the medium
    np.testing.assert_allclose(found[1:], expected[1:], atol=0.025)
    np.testing.assert_allclose(found[0], expected[0], atol=0.09)


def case(seed, **options):
    rng = np.random.default_rng(seed)
    volume = strategies.random_volume(rng, edge=12)
    function = strategies.random_transfer_function(rng, volume, interpolation="linear")
    camera = strategies.random_camera(rng, volume.bounds)
    radius = rng.uniform(0.05, 0.6) * volume.length
    return volume, camera, function.replace(**options), AmbientOcclusion(radius, 0.3, 20)


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", range(4))
def test_pictures_are_the_reference_s(runtime, seed):
    volume, camera, function, occlusion = case(seed)
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


@pytest.mark.every(4)
@pytest.mark.parametrize("more", ["nearest", "gradient opacity", "shading", "RGBA", "opaque"])
def test_with_everything_else_as_well(runtime, more):
    volume, camera, function, occlusion = case(7)
    low, high = volume.finite_range()
    gradient = {"gradient_opacities": [0, 1], "gradient_range": (0, (high - low) / 4)}
    changes = {
        "nearest": {"interpolation": "nearest"},
        "gradient opacity": gradient,
        "shading": {"shading": Shading(0.3, 0.6, 0.4, 5)},
        "RGBA": {"scalar_range": (0, 255)},
        "opaque": {"opacities": np.where(function.opacities > 0.5, 1, function.opacities)},
    }
    function = function.replace(**changes[more])
    if more == "RGBA":
        rng = np.random.default_rng(0)
        channels = [strategies.random_array(rng, "uint8", (9, 8, 10)) for _ in range(4)]
        volume = Volume(np.stack(channels, axis=-1), volume.spacing, volume.origin)
    given = {"ambient_occlusion": occlusion}
    expected = reference.volume_image(volume, camera, WINDOW, function, **given)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime, **given)
    off = np.abs(image - expected).max(axis=2) > TOLERANCE
    # A nearest sample within rounding of a voxel's border may take either side's value
    assert off.sum() <= (2 if more == "nearest" else 0), np.abs(image - expected).max()
    plain = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    assert (plain - image)[..., :3].max() > 0.005


def test_the_grid_is_near_the_definition():
    """Where something is to be seen; smaller cells than the radius's eighth are not needed."""
    rng = np.random.default_rng(3)
    volume = Volume(strategies.random_array(rng, "float32", (24, 24, 24)))
    function = TransferFunction(
        np.ones((3, 3)), [0, 0, 0.5], volume.finite_range(), unit_distance=1.0,
        interpolation="linear",
    )  # fmt: skip
    grid = node_occlusion(volume, function, AmbientOcclusion(6.0, strength=1.0))
    position = rng.uniform(6, 17, size=(100, 3))
    _, tau = reference.generate.medium_at(volume, function, position, np.ones(len(position)))
    position = position[tau > 0]
    assert len(position) > 30
    exact = reference.ambient_transmittance(volume, function, position, 6.0, 128)
    assert np.abs(grid.factors(position) - exact).mean() < 0.02


def test_where_all_light_arrives_not_a_bit_changes(runtime):
    """A medium so thin that float32 sees no loss; and strength 0 is none at all."""
    volume, camera, function, occlusion = case(5)
    thin = function.replace(opacities=function.opacities * 1e-10)
    assert nodes_of(runtime, volume, thin, occlusion).min() == 1.0
    for looks, asked in ((thin, occlusion), (function, AmbientOcclusion(strength=0))):
        scene = (volume, camera, WINDOW, looks)
        plain = generate_vdi(*scene, device=runtime)
        occluded = generate_vdi(*scene, ambient_occlusion=asked, device=runtime)
        assert plain.n_supersegments > 0
        assert occluded.equals(plain)
    assert "ambient_occlusion" not in occluded.metadata


def test_its_memory_is_given_back(runtime):
    volume, camera, function, occlusion = case(2)
    before = runtime.allocated
    raycast_volume(volume, camera, WINDOW, function, ambient_occlusion=occlusion, device=runtime)
    del volume
    assert runtime.allocated == before


def test_a_grid_that_does_not_fit_is_refused(runtime, monkeypatch):
    volume, camera, function, _ = case(2)
    let_lack(monkeypatch, runtime, "opacities for ambient occlusion")
    with pytest.raises(DeviceMemoryError, match="larger radius of ambient occlusion"):
        raycast_volume(volume, camera, WINDOW, function, ambient_occlusion=True, device=runtime)


def test_an_occluded_vdi_is_judged_by_the_occluded_volume(default_runtime):
    """What decides when a plotter makes a VDI anew: at V_O there is no error to be seen."""
    volume = Volume(strategies.random_array(np.random.default_rng(1), "float32", (20, 20, 20)))
    low, high = volume.finite_range()
    function = TransferFunction(np.ones((2, 3)), [0, 0.8], (low, high), interpolation="linear")
    camera = Camera((9, -70, 25), (9.5, 9.5, 9.5), (0, 0, 1))
    occlusion = AmbientOcclusion(8.0, 1.0)
    vdi = generate_vdi(volume, camera, (64, 48), function, ambient_occlusion=occlusion)
    with_it = ViewErrorEstimator(volume, function, ambient_occlusion=occlusion)
    without = ViewErrorEstimator(volume, function)
    assert with_it.estimate(vdi, camera).ssim > 0.9999
    assert without.estimate(vdi, camera).ssim < 0.99
