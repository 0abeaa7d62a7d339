"""How far one image is from another: SSIM, PSNR, worst pixel, brightness.

A figure means the same everywhere: RGB over a background, clipped to 0..1, not quantised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_floats

#: Arguments of ``skimage.metrics.structural_similarity``: Wang et al. 2004.
SSIM_ARGUMENTS: dict[str, Any] = {
    "data_range": 1.0,
    "channel_axis": -1,
    "gaussian_weights": True,
    "sigma": 1.5,
    "use_sample_covariance": False,
}

#: Shortest edge of an image that has an SSIM, pixels: the window, 2 round(3.5 sigma) + 1.
SSIM_WINDOW = 11


@dataclass(frozen=True)
class Comparison:
    """What :func:`compare_images` found.

    Parameters
    ----------
    ssim : float
        Structural similarity, 1 for equal images; NaN where an edge is below 11 pixels.
    psnr : float
        Peak signal to noise ratio in dB; infinite for equal images.
    worst_pixel : float
        Largest absolute difference of a channel, in units of 1/255.
    mean_brightness_ratio : float
        Mean of the image's RGB over that of the reference; 1 where both are black.
    """

    ssim: float
    psnr: float
    worst_pixel: float
    mean_brightness_ratio: float


def over_background(
    image: ArrayLike, background: Sequence[float] = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Blend premultiplied RGBA, or RGB, over a background: float64 (H, W, 3), clipped to 0..1."""
    try:
        pixels = np.asarray(image)
    except ValueError:  # lists of different lengths
        pixels = np.empty(0)
    floats = pixels.dtype.kind == "f" and pixels.size and np.isfinite(pixels).all()
    if not floats or pixels.ndim != 3 or pixels.shape[2] not in (3, 4):
        raise InvalidArgumentError(
            "an image is an array of finite floats of shape (height, width, 4), premultiplied "
            f"RGBA, or (height, width, 3), RGB; got {pixels.dtype} of shape {pixels.shape}"
        )
    behind = check_background(background)
    rgb = pixels[..., :3].astype(np.float64)
    if pixels.shape[2] == 4:
        rgb += (1.0 - pixels[..., 3:].astype(np.float64)) * behind
    return np.clip(rgb, 0.0, 1.0)


def check_background(background: Any) -> NDArray[np.float64]:
    """Return RGB as an array, or raise InvalidArgumentError if it is no colour from 0 to 1."""
    behind = as_floats(background)
    if behind.shape != (3,) or not ((behind >= 0) & (behind <= 1)).all():
        raise InvalidArgumentError(
            f"background must be three numbers from 0 to 1; got {background!r}"
        )
    return behind


def compare_images(
    image: ArrayLike, reference: ArrayLike, background: Sequence[float] = (0.0, 0.0, 0.0)
) -> Comparison:
    """Compare an image with a reference.

    Parameters
    ----------
    image, reference : array_like of float, shape (H, W, 4) or (H, W, 3)
        Premultiplied RGBA (what :func:`pyvista_vdi.render` returns) or RGB.
    background : (float, float, float)
        RGB that both are blended over before they are compared.

    Returns
    -------
    Comparison
        SSIM, PSNR, worst pixel, brightness.

    Raises
    ------
    InvalidArgumentError
        If one is not an image, not finite, or their sizes differ.

    References
    ----------
    Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli, "Image quality assessment: from error
    visibility to structural similarity", IEEE TIP 13(4), 2004.

    Examples
    --------
    >>> import numpy as np
    >>> from pyvista_vdi import compare_images
    >>> grey = np.full((16, 16, 3), 0.5)
    >>> compare_images(grey + 1 / 255, grey).worst_pixel
    1.0
    """
    a, b = over_background(image, background), over_background(reference, background)
    if a.shape != b.shape:
        raise InvalidArgumentError(
            f"the images are of different sizes, {a.shape[1]} x {a.shape[0]} and "
            f"{b.shape[1]} x {b.shape[0]}: render both at one size"
        )
    difference = np.abs(a - b)
    mean_square = float(np.mean(np.square(difference)))
    mean, black = float(a.mean()), not b.any()
    ssim = math.nan
    if min(a.shape[:2]) >= SSIM_WINDOW:
        from skimage.metrics import structural_similarity  # loads SciPy

        ssim = float(structural_similarity(a, b, **SSIM_ARGUMENTS))
    return Comparison(
        ssim=ssim,
        psnr=math.inf if mean_square == 0 else -10 * math.log10(mean_square),
        # Rounded to a millionth of a step: what float64 leaves of a whole number of steps
        worst_pixel=round(float(difference.max()) * 255, 6),
        mean_brightness_ratio=(math.inf if mean else 1.0) if black else mean / float(b.mean()),
    )
