"""How far one image is from another: SSIM, PSNR, worst pixel, brightness; and edges along lists.

A figure means the same everywhere: RGB over a background, clipped to 0..1, not quantised.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_floats

#: Arguments of ``skimage.metrics.structural_similarity``: Wang et al. 2004.
SSIM_ARGUMENTS: MappingProxyType[str, Any] = MappingProxyType(
    {
        "data_range": 1.0,
        "channel_axis": -1,
        "gaussian_weights": True,
        "sigma": 1.5,
        "use_sample_covariance": False,
    }
)

#: Shortest edge of an image that has an SSIM, pixels: the window, 2 round(3.5 sigma) + 1.
SSIM_WINDOW = 11

#: Share of red, green and blue in luminance (Rec. 709).
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


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
    worst_position : (int, int)
        Column and row of that pixel, from the top left.
    mean_brightness_ratio : float
        Mean of the image's RGB over that of the reference; 1 where both are black.
    """

    ssim: float
    psnr: float
    worst_pixel: float
    worst_position: tuple[int, int]
    mean_brightness_ratio: float


def over_background(
    image: ArrayLike, background: Sequence[float] = (0.0, 0.0, 0.0)
) -> NDArray[np.float64]:
    """Blend a premultiplied image over a background.

    ``image`` (float, shape (H, W, 4) or (H, W, 3)): premultiplied RGBA, or RGB, which has nothing
    to blend. ``background``: RGB, 0 to 1. Returns: float64 (H, W, 3), clipped to 0..1. Raises
    InvalidArgumentError if it is not such an image, or not finite.
    """
    try:
        pixels = np.asarray(image)
    except ValueError:  # lists of different lengths
        pixels = np.empty(0)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype.kind != "f":
        raise InvalidArgumentError(
            "an image is an array of floats of shape (height, width, 4), premultiplied RGBA, or "
            f"(height, width, 3), RGB; got {pixels.dtype} of shape {pixels.shape}"
        )
    if not np.isfinite(pixels).all():
        row, column = np.argwhere(~np.isfinite(pixels).all(axis=2))[0]
        raise InvalidArgumentError(
            f"the image is not finite: pixel (column {column}, row {row}) is {pixels[row, column]}"
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
    if a.size == 0:
        raise InvalidArgumentError(f"the images are empty: their shape is {a.shape}")
    difference = np.abs(a - b)
    row, column, _ = np.unravel_index(int(difference.argmax()), difference.shape)
    mean_square = float(np.mean(np.square(difference)))
    mean, reference_mean = float(a.mean()), float(b.mean())
    both_black = 1.0 if mean == 0 else math.inf
    ssim = math.nan
    if min(a.shape[:2]) >= SSIM_WINDOW:
        from skimage.metrics import structural_similarity  # loads SciPy

        ssim = float(structural_similarity(a, b, **SSIM_ARGUMENTS))
    return Comparison(
        ssim=ssim,
        psnr=math.inf if mean_square == 0 else -10 * math.log10(mean_square),
        # Rounded to a millionth of a step: what float64 leaves of a whole number of steps
        worst_pixel=round(float(difference.max()) * 255, 6),
        worst_position=(int(column), int(row)),
        mean_brightness_ratio=mean / reference_mean if reference_mean else both_black,
    )


@dataclass(frozen=True)
class ListEdges:
    """How much the error of a picture jumps from list to list: what :func:`list_edges` found.

    ``across`` is the mean absolute step of the error's luminance between neighbouring pixels of two
    lists, ``within`` that of neighbours in one list; NaN where no two share a list.
    """

    across: float
    within: float

    @property
    def ratio(self) -> float:
        """``across`` over ``within``: above 1 squares show; 0 where no two pixels share a list."""
        if self.across == 0 or math.isnan(self.within):
            return 0.0
        return self.across / self.within if self.within > 0 else math.inf


def list_edges(
    image: ArrayLike,
    reference: ArrayLike,
    columns: ArrayLike,
    rows: ArrayLike,
    background: Sequence[float] = (0.0, 0.0, 0.0),
) -> ListEdges:
    """Measure the edges that a picture has along the borders of a VDI's lists.

    Where a list covers several pixels, all of them show what its middle shows: squares, which SSIM
    hardly notices and people do. The error, picture less reference, then jumps from list to list
    and follows the reference within a list, so that the two kinds of steps tell squares from other
    errors. On a ramp a list of n pixels has a ratio of n - 1.

    ``image``, ``reference``, ``background``: as for :func:`compare_images`, both from the
    generating view; ``columns``, ``rows``: where each column and each row of pixels lies among the
    lists, see :func:`list_places`. InvalidArgumentError if their sizes differ.

    Examples
    --------
    >>> import numpy as np
    >>> from pyvista_vdi.model.metrics import list_edges
    >>> ramp = np.linspace(0, 1, 16)[:, None, None] * np.ones((1, 16, 3))
    >>> squares = ramp.reshape(4, 4, 16, 3).mean(axis=1).repeat(4, axis=0)
    >>> lists_of_pixels = np.arange(16) // 4
    >>> round(list_edges(squares, ramp, lists_of_pixels, lists_of_pixels).ratio, 6)
    3.0
    """
    a, b = over_background(image, background), over_background(reference, background)
    across, down = np.floor(columns), np.floor(rows)
    if a.shape != b.shape or a.shape[:2] != (len(down), len(across)):
        raise InvalidArgumentError(
            f"the images and the lists of their pixels are of different sizes: {a.shape[:2]}, "
            f"{b.shape[:2]}, and {len(down)} rows of {len(across)} pixels"
        )
    error = (a - b) @ _LUMINANCE
    borders, others = [], []
    for axis, lists in enumerate((down, across)):
        steps = np.abs(np.diff(error, axis=axis))
        border = np.diff(lists) != 0
        borders.append(np.compress(border, steps, axis=axis).ravel())
        others.append(np.compress(~border, steps, axis=axis).ravel())
    on, off = np.concatenate(borders), np.concatenate(others)
    return ListEdges(
        float(on.mean()) if on.size else 0.0, float(off.mean()) if off.size else math.nan
    )


def list_places(
    camera: Camera, window_size: Sequence[int], lists: Sequence[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the pixels of a picture from the generating view lie among its lists.

    ``window_size`` and ``lists`` are pixels of the picture, and lists of the VDI, along each edge.
    Returns columns and rows, float64 (W,) and (H,): a list's width or height is 1, 0 is the left or
    the upper end of the first, so that ``floor`` numbers the lists. The picture may reach a little
    beyond the first and the last: the window of the lists may not have its aspect to the last
    digit.
    """
    size, count = check_window_size(window_size), check_window_size(lists)
    seen, held = camera.half_extent(size), camera.half_extent(count)
    centre = (camera.window_center[0], -camera.window_center[1])  # downwards, as rows go
    columns, rows = (
        (((2 * np.arange(pixels) + 1) / pixels - 1 + c) * extent / of_lists - c + 1) / 2 * n
        for pixels, n, extent, of_lists, c in zip(size, count, seen, held, centre, strict=True)
    )
    return columns, rows
