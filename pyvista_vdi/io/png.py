"""Pictures as PNG files, by Pillow: eight bits per channel, no gamma."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.metrics import over_background
from pyvista_vdi.model.whole_file import as_path, whole_file, with_suffix


def to_bytes(image: ArrayLike, background: Sequence[float] | None = None) -> NDArray[np.uint8]:
    """Return a rendered image in eight bits per channel.

    ``image`` (float, shape (H, W, 4)): premultiplied RGBA, top row first. ``background``: RGB, 0 to
    1, to blend it over. Returns: uint8 (H, W, 4), straight RGBA, rounded; or, over a background,
    uint8 (H, W, 3). Raises InvalidArgumentError if one is no colour or no image.
    """
    pixels = np.asarray(image)
    if background is not None:
        return np.rint(over_background(pixels, background).clip(0, 1) * 255).astype(np.uint8)
    if pixels.ndim != 3 or pixels.shape[2] != 4:
        raise InvalidArgumentError(
            f"an image is premultiplied RGBA of shape (height, width, 4); got {pixels.shape}"
        )
    color, alpha = pixels[..., :3].astype(np.float64), pixels[..., 3:].astype(np.float64)
    straight = np.divide(color, alpha, out=np.zeros_like(color), where=alpha > 0)
    return np.rint(np.concatenate([straight, alpha], axis=2).clip(0, 1) * 255).astype(np.uint8)


def write_png(pixels: NDArray[np.uint8], path: str | os.PathLike[str]) -> Path:
    """Write uint8 RGB, or straight RGBA, (H, W, 3 or 4), top row first; return the file, ``.png``.

    Raises VDIFileError if it cannot be written; it appears whole or not at all.
    """
    from PIL import Image

    target = with_suffix(as_path(path), (".png",), "a picture")
    with whole_file(target) as stream:
        Image.fromarray(pixels).save(stream, format="png")
    return target
