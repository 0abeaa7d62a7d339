"""Colours as a display takes them, and the light that it gives off: sRGB's curve (IEC 61966-2-1).

The way back is a root by Newton's steps, made of what IEEE 754 rounds alone: it is then the same to
the last bit on every machine, which corrections build upon.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Where the curve's straight part ends, in displayed values and in light.
_KNEE, _LINEAR_KNEE = 0.04045, 0.0031308

#: From .8, the cube roots of .23 to 1.3 are met to 2**-50; each step squares the relative error.
_ROOT_STEPS = 6

#: Attributes of an image in linear light: x and y of the primaries and the white of Rec. 709, which
#: sRGB shares, and the ASWF's name of the colour space.
COLOR_SPACE = {
    "chromaticities": (
        "chromaticities",
        struct.pack("<8f", 0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329),
    ),
    "colorInteropID": ("string", b"lin_rec709_scene"),
}


def to_linear(color: NDArray[Any]) -> NDArray[np.float64]:
    """Return the light of displayed values from 0 to 1."""
    shown = color.astype(np.float64)
    return np.where(shown <= _KNEE, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)


def to_display(light: NDArray[Any]) -> NDArray[np.float64]:
    """Return what is to be displayed for light from 0 to about 1, the same bits everywhere."""
    x = light.astype(np.float64)
    fourth = np.sqrt(np.sqrt(np.maximum(x, _LINEAR_KNEE)))
    root = np.full_like(fourth, 0.8)  # becomes the twelfth root
    for _ in range(_ROOT_STEPS):
        root = root - (root * root * root - fourth) / (3 * root * root)
    power = root * root * root * root * root  # x ** (5 / 12), which is 1 / 2.4
    return np.where(x <= _LINEAR_KNEE, 12.92 * x, 1.055 * power - 0.055)
