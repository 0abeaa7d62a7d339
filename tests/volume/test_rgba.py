"""RGBA volumes: colours of their own, opacity by the fourth component."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi

from pyvista_vdi import InvalidVolumeError, Shading, TransferFunction, Volume

WINDOW = (7, 6)

#: Largest difference from the reference, of 1: float32 against float64, see test_lighting.py.
TOLERANCE = 1e-5


def rgba_volume(rng, **options):
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, n) for n in (9, 10, 11)), indexing="ij")
    alpha = 250 * np.exp(-2 * (x**2 + (y - 0.2) ** 2 + z**2))
    colors = [127 + 120 * x, 127 + 120 * y * z, 100 + 100 * z]
    return Volume(np.stack([*colors, alpha], axis=-1).astype(np.uint8), **options)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {
            "shading": Shading(0.3, 0.6, 0.3, 5),
            "gradient_opacities": [0, 1],
            "gradient_range": (0, 40),
        },
    ],
    ids=["plain", "shaded by gradients"],
)
def test_pictures_are_the_reference_s(runtime, more):
    rng = np.random.default_rng(len(more))
    volume = rgba_volume(rng, spacing=rng.uniform(0.5, 1.5, 3), origin=rng.normal(size=3))
    camera = strategies.random_camera(rng, volume.bounds)
    options = {"unit_distance": 2.0, "interpolation": "linear", **more}
    function = TransferFunction(np.zeros((3, 3)), [0, 0.4, 0.9], (0, 255), **options)
    expected = reference.volume_image(volume, camera, WINDOW, function)
    assert expected[..., :3].max() > 0.05
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    np.testing.assert_allclose(image, expected, atol=TOLERANCE)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    np.testing.assert_allclose(render_vdi(vdi, camera, device=runtime), expected, atol=TOLERANCE)


def test_its_parts():
    volume = rgba_volume(np.random.default_rng(0))
    assert volume.rgba
    assert volume.dimensions == (11, 10, 9)
    assert volume.finite_range() == (volume.array[..., 3].min(), volume.array[..., 3].max())
    assert "RGBA" in repr(volume)
    for shape, dtype in (((3, 3, 3, 3), "uint8"), ((3, 3, 3, 4), "uint16")):
        with pytest.raises(InvalidVolumeError, match="RGBA as four uint8"):
            Volume(np.zeros(shape, dtype))
