"""The oracle: slow, plain float64 NumPy generation and raycasting; never imports the device code.

Written from docs/dev/conventions.md and from nothing in the kernels, it defines what is correct.
:func:`render` gives the exact image of any VDI from any view, :func:`render_joint` that of several
together, :func:`render_range` and :func:`render_joint_range` what float32 arithmetic may make of a
ray, :func:`volume_image` the direct volume rendering, :func:`build_vdi` a plain VDI, and
:func:`ambient_transmittance` what ambient occlusion stands for.
"""

from __future__ import annotations

from reference.generate import (
    RaySamples,
    ambient_transmittance,
    build_vdi,
    samples,
    volume_image,
)
from reference.multi_vdi import render_joint, render_joint_range
from reference.ranges import render_range
from reference.raycast import render, render_pixels

__all__ = [
    "RaySamples",
    "ambient_transmittance",
    "build_vdi",
    "render",
    "render_joint",
    "render_joint_range",
    "render_pixels",
    "render_range",
    "samples",
    "volume_image",
]
