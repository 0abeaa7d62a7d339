"""Lights and gradient opacity as the kernels take them: ``opencl/volume/shading.cl``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import LARGEST_POWER
from pyvista_vdi.model.grid import Geometry
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.model.transfer_function import GRADIENT_SHARE, TransferFunction

#: In place of a specular power of 0, as of which a highlight is where the ray is mirrored to the
#: eye's side: what small powers tend to, while 0 to the power of 0 is 1.
_LEAST_POWER = 1e-30
#: In place of a cone's cosine: the light shines everywhere.
_NO_CONE = -2.0


def shading_variant(transfer_function: TransferFunction, lights: Lights) -> dict[str, Any]:
    """Return the fields of a :class:`Variant` that say how samples are lit."""
    shading = transfer_function.shading
    return {
        "shaded": 0 if shading is None else 2 if lights.headlight_only else 1,
        "sharp": shading is not None and shading.specular_power > LARGEST_POWER,
        "gradient_opacity": transfer_function.gradient_opacities is not None,
    }


def lighting_table(
    grid: Geometry, camera: Camera, shading: Shading, lights: Lights
) -> NDArray[np.float32]:
    """Return the material and the lights of a view.

    The lights' frame has its origin at the eye, where float32 resolves the directions. A headlight
    alone is in the model frame's axes, in which VTK shades it; other lights are in the view's.
    """
    to_frame = np.eye(4)
    if lights.headlight_only:
        to_frame[:3, 3] = -rays.inverse_affine(camera.model_to_view)[:3, 3]
    else:
        to_frame = camera.model_to_view
    index_to_frame = to_frame @ grid.index_to_model
    # Of normals only the direction matters: scaled to what float32 holds, whatever the spacing
    normal = rays.inverse_affine(index_to_frame)[:3, :3].T
    normal = normal / np.abs(normal).max()
    head = [
        *normal.ravel(),
        *index_to_frame[:3].ravel(),
        shading.ambient,
        shading.diffuse,
        shading.specular,
        max(shading.specular_power, _LEAST_POWER),
        float(lights.two_sided),
        float(shading.specular_power > LARGEST_POWER),
        len(lights.lights),
    ]
    return np.array(
        [*head, *(v for light in lights.lights for v in _light(light, camera))], dtype=np.float32
    )


def _light(light: Light, camera: Camera) -> list[float]:
    position, direction = light.in_world(camera)
    to_view = camera.view_matrix
    cone = math.cos(math.radians(light.cone_angle)) if light.cone_angle <= 90 else _NO_CONE
    return [
        *(light.intensity * c for c in (*light.ambient, *light.diffuse, *light.specular)),
        *(to_view[:3, :3] @ direction),
        float(light.positional),
        *(to_view[:3, :3] @ position + to_view[:3, 3]),
        *light.attenuation,
        cone,
        light.exponent,
    ]


def gradient_table(
    spacing: Sequence[float],
    scalar_range: tuple[float, float],
    transfer_function: TransferFunction,
    per_difference: float,
) -> NDArray[np.float32]:
    """Return the gradient opacities, and how differences on the device lead to their places.

    ``per_difference``: scalars per unit of the device's voxels.
    """
    assert transfer_function.gradient_opacities is not None
    assert transfer_function.gradient_range is not None
    table = transfer_function.gradient_opacities
    low, high = transfer_function.gradient_range
    per_magnitude = (len(table) - 1) / (high - low)
    smallest, largest = scalar_range
    to_table = np.mean(spacing) / (2 * np.asarray(spacing)) * per_difference * per_magnitude
    last = GRADIENT_SHARE * (largest - smallest) * per_magnitude
    with np.errstate(over="ignore"):
        return np.array(
            [*to_table, last, len(table), -low * per_magnitude, *table], dtype=np.float32
        )
