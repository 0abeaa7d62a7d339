"""VDIs as OpenEXR deep scan line images, both ways; ``docs/files.md`` describes the files.

Everybody's channels (Z, ZBack, A, R, G, B) are written in float32. What they lose is written
beside them as corrections, the differences of bit patterns from what a reader computes; they are
small whole numbers and compress to little. Whoever changes the standard channels changes the VDI.
"""

from __future__ import annotations

import os
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidCameraError, VDIError, VDIFileError, VDIWarning
from pyvista_vdi.io.deep_exr.layout import (
    DeepImage,
    OtherFormError,
    matrix_attribute,
    read_image,
    write_image,
)
from pyvista_vdi.io.deep_exr.samples import agrees, media
from pyvista_vdi.io.deep_exr.view import bounds_of_lists, camera_from_matrices, view_matrices
from pyvista_vdi.io.vdi_file.description import describe, from_json, number, to_json
from pyvista_vdi.io.vdi_file.layout import FORMAT_NAME
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.io.whole_file import whole_file
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.compositing import opacity
from pyvista_vdi.model.vdi import VDI

#: The name that a file's name ends in.
SUFFIX = ".exr"

#: The header's attribute that holds the description in JSON.
DESCRIPTION_ATTRIBUTE = "pyvistaVDI"

#: Version of that description and of our own channels; of this and of lower ones is read.
IMAGE_VERSION = 1

#: How samples may be compressed when they are written.
COMPRESSIONS = ("zips", "none")

#: Predictions smaller than this are taken as 0, so that no processor's treatment of denormal
#: numbers enters them.
_SMALLEST = 2.0**-60

_STANDARD = ("A", "B", "G", "R", "Z", "ZBack")
_DEPTH_BITS = ("bits.front", "bits.back")
_COLOR_BITS = ("bits.red", "bits.green", "bits.blue")
_OURS = ("tau", *_DEPTH_BITS, *_COLOR_BITS)


def write(
    vdi: VDI,
    path: str | os.PathLike[str],
    *,
    compression: str = "zips",
    level: int = 1,
    exact: bool = True,
) -> Path:
    """Write a VDI as an OpenEXR deep scan line image: see :func:`pyvista_vdi.io.write`.

    Parameters
    ----------
    vdi, path
        As there; the name ends in ``.exr``.
    compression : {"zips", "none"}
        ``"zips"`` is zlib, one scan line at a time.
    level : int
        zlib's effort, 1 to 9.
    exact : bool
        Also write the channel ``tau`` and the corrections with which the file reads back to the
        last bit. Without them it has the standard channels alone, and optical depths above about
        ten come back rounded (see ``docs/files.md``).
    """
    offset = _depth_offset(vdi)
    names = [*_STANDARD, *(("tau", *_COLOR_BITS) if exact else ())]
    if exact and offset != 0:
        names += _DEPTH_BITS
    with whole_file(path) as stream:
        write_image(
            stream,
            vdi.counts,
            {name: np.uint32 if name.startswith("bits.") else np.float32 for name in names},
            lambda first, last: _encoded(vdi, slice(first, last), offset, exact),
            _attributes(vdi, offset, exact),
            compression=compression,
            level=level,
        )
    return Path(os.path.realpath(path))


def read(
    path: str | os.PathLike[str],
    *,
    camera: Any = None,
    thickness: float | None = None,
) -> VDI:
    """Read a VDI from an OpenEXR deep image: see :func:`pyvista_vdi.read`.

    Parameters
    ----------
    path : path-like
        A file that :func:`write` wrote, or another program.
    camera : Camera or vtkCamera or pyvista.Camera, optional
        The view that the image shows, where the file does not say it, or instead of what it says.
    thickness : float, optional
        World units: given to samples that have none, such as those of surfaces.

    Warns
    -----
    VDIWarning
        If one of our files was changed by another program, or colours are outside 0 to 1.
    """
    with np.errstate(invalid="ignore"):  # a signalling NaN is refused as any other
        return _File(path).vdi(camera, thickness)


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Return what a file says about itself; of a foreign one all samples are read for it."""
    with np.errstate(invalid="ignore"):
        return _File(path).info()


# -- writing ---------------------------------------------------------------------------------------


def _depth_offset(vdi: VDI) -> float:
    """Return what is added to front and back for Z, which the standard wants not to be negative.

    In parallel projection depths may be: then the eye is moved back.
    """
    if not vdi.camera.parallel_projection or not vdi.n_supersegments:
        return vdi.depth_origin
    nearest = float(vdi.front.min()) + vdi.depth_origin
    return vdi.depth_origin - min(nearest, 0.0)


def _attributes(vdi: VDI, offset: float, exact: bool) -> dict[str, tuple[str, bytes]]:
    to_camera, to_ndc = view_matrices(vdi.camera, vdi.window_size, offset - vdi.depth_origin)
    half = vdi.camera.half_extent(vdi.window_size)
    center = [c * h for c, h in zip(vdi.camera.window_center, half, strict=True)]
    description = {**describe(vdi, IMAGE_VERSION), "depth_offset": offset, "exact": exact}
    return {
        DESCRIPTION_ATTRIBUTE: ("string", to_json(description).encode("ascii")),
        "screenWindowCenter": ("v2f", struct.pack("<2f", *center)),
        "screenWindowWidth": ("float", struct.pack("<f", 2 * half[0])),
        "software": ("string", str(description["written_by"]).encode()),
        "worldToCamera": matrix_attribute(to_camera),
        "worldToNDC": matrix_attribute(to_ndc),
    }


def _encoded(vdi: VDI, part: slice, offset: float, exact: bool) -> dict[str, NDArray[Any]]:
    front, back, tau = vdi.front[part], vdi.back[part], vdi.optical_depth[part]
    alpha = opacity(tau).astype(np.float32)
    channels: dict[str, NDArray[Any]]
    channels = {"A": alpha, "Z": _depth(front, offset), "ZBack": _depth(back, offset), "tau": tau}
    for i, (name, bits) in enumerate(zip("RGB", _COLOR_BITS, strict=True)):
        straight = vdi.color[part, i]
        channels[name] = straight * alpha
        if exact:
            channels[bits] = _correction(straight, _straight(channels[name], alpha))
    if exact and offset != 0:
        for name, bits, exactly in zip(("Z", "ZBack"), _DEPTH_BITS, (front, back), strict=True):
            channels[bits] = _correction(exactly, _relative(channels[name], offset))
    return channels


def _depth(relative: NDArray[np.float32], offset: float) -> NDArray[np.float32]:
    if offset == 0:
        return relative
    # The nearest may come out as -0.0 or a rounding below 0, the farthest beyond float32
    with np.errstate(over="ignore"):
        return np.maximum(relative.astype(np.float64) + offset, 0).astype(np.float32)


# -- what a reader computes from the standard channels, exactly as IEEE 754 says -------------------


def _relative(depth: NDArray[np.float32], offset: float) -> NDArray[np.float32]:
    """Return view depth less the offset, rounded once."""
    if offset == 0:
        return depth
    relative = depth.astype(np.float64) - offset
    with np.errstate(over="ignore"):
        return np.where(np.abs(relative) < _SMALLEST, 0, relative).astype(np.float32)


def _straight(color: NDArray[np.float32], alpha: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a premultiplied colour over its opacity, and 0 where that says nothing."""
    enough = (alpha >= _SMALLEST) & (color >= _SMALLEST)
    return np.divide(color, alpha, out=np.zeros_like(color), where=enough)


def _correction(exact: NDArray[np.float32], predicted: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return the difference of bit patterns modulo 2**32, with the sign in the lowest bit."""
    step = np.ascontiguousarray(exact).view(np.int32) - predicted.view(np.int32)
    return ((step << 1) ^ (step >> 31)).view(np.uint32)


def _corrected(predicted: NDArray[np.float32], correction: NDArray[Any]) -> NDArray[np.float32]:
    bits = correction.astype(np.uint32, copy=False)
    step = (bits >> np.uint32(1)) ^ (np.uint32(0) - (bits & np.uint32(1)))
    return (predicted.view(np.uint32) + step).view(np.float32)


# -- reading ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Description:
    """The entries of our own attribute, checked."""

    camera: Camera
    window_size: tuple[int, int]
    n_supersegments: int
    bounds: tuple[float, ...]
    depth_origin: float
    depth_offset: float
    exact: bool
    version: int
    metadata: dict[str, Any]


class _File:
    """A deep image that has been read; says what it holds."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._path = Path(path)
        except TypeError as error:
            raise VDIFileError(f"a file's name is a path; got {type(path).__name__}") from error
        self._image = self._read_image()
        self._description = self._read_description()
        x0, y0, x1, y1 = self._image.display_window
        self._window_size = (x1 - x0 + 1, y1 - y0 + 1)

    def vdi(self, camera: Any, thickness: float | None) -> VDI:
        """Return the VDI: ours exactly, or what the standard channels say."""
        if camera is None and thickness is None and self._is_untouched():
            return self._exact_vdi()
        return self._standard_vdi(camera, thickness)

    def info(self) -> FileInfo:
        """Return what the file says."""
        own = self._description
        vdi = self.vdi(None, None)
        return FileInfo(
            path=self._path,
            format_version=own.version if own else 2,
            written_by=str(self._image.attributes.get("software", "")),
            camera=vdi.camera,
            window_size=vdi.window_size,
            n_supersegments=vdi.n_supersegments,
            bounds=vdi.bounds,
            depth_origin=vdi.depth_origin,
            metadata=vdi.metadata,
            codec=f"OpenEXR {self._image.compression}",
            file_bytes=self._path.stat().st_size,
            memory_bytes=vdi.nbytes,
        )

    # -- what is in the file ---------------------------------------------------------------------

    def _read_image(self) -> DeepImage:
        wanted = {*_STANDARD, *_OURS}
        try:
            image = read_image(self._path, wanted.__contains__)
        except OtherFormError as error:
            from pyvista_vdi.io.deep_exr.package import read_by_package

            image = read_by_package(self._path, wanted, str(error))
        missing = [name for name in ("Z", "A", "R", "G", "B") if name not in image.channel_types]
        if missing:
            raise VDIFileError(
                f"{self._path} has no channel {', '.join(missing)}; it has "
                f"{', '.join(image.channel_types)}: a VDI needs Z, ZBack, A, R, G and B"
            )
        for name, array in image.channels.items():
            if len(array) and (array.dtype.kind == "u") != name.startswith("bits."):
                self._refuse(f"its channel {name} is of type {array.dtype}")
        return image

    def _read_description(self) -> _Description | None:
        text = self._image.attributes.get(DESCRIPTION_ATTRIBUTE)
        if text is None:
            return None
        try:
            entries = from_json(text)
            if entries["format"] != FORMAT_NAME or isinstance(entries["version"], bool):
                raise ValueError("it does not name the format")
            if not 1 <= entries["version"] <= IMAGE_VERSION:
                raise VDIFileError(
                    f"{self._path} is of format version {entries['version']}; this release reads "
                    f"up to version {IMAGE_VERSION}: upgrade by pip install -U pyvista-vdi"
                )
            width, height = entries["window_size"]
            if not isinstance(entries["metadata"], dict):
                raise TypeError("its metadata are no dictionary")
            return _Description(
                camera=Camera.from_dict(entries["camera"]),
                window_size=(width, height),
                n_supersegments=entries["n_supersegments"],
                bounds=tuple(number(b) for b in entries["bounds"]),
                depth_origin=number(entries["depth_origin"]),
                depth_offset=number(entries["depth_offset"]),
                exact=entries["exact"] is True,
                version=entries["version"],
                metadata=entries["metadata"],
            )
        except VDIFileError:
            raise
        except (VDIError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
            self._refuse(f"its attribute {DESCRIPTION_ATTRIBUTE} is incomplete or wrong: {error!r}")

    def _is_untouched(self) -> bool:
        """Whether the file is as :func:`write` left it, as far as that can be seen."""
        own, image = self._description, self._image
        if own is None or not own.exact:
            return False
        needed = [*_STANDARD, "tau", *_COLOR_BITS, *(_DEPTH_BITS if own.depth_offset else ())]
        untouched = (
            all(image.channel_types.get(n) in (np.float32, np.uint32) for n in needed)
            and own.window_size == self._window_size
            and image.data_window == image.display_window
            and own.n_supersegments == len(image.channels["Z"])
            and agrees(image.channels["A"], image.channels["tau"])
            and self._colors_fit()
        )
        if not untouched:
            warnings.warn(
                f"{self._path} was changed after pyvista-vdi wrote it: its standard channels are "
                "read, as those of any program's files",
                VDIWarning,
                stacklevel=4,
            )
        return untouched

    def _colors_fit(self) -> bool:
        color = self._exact_color()
        return len(color) == 0 or bool(color.min() >= 0 and color.max() <= 1)

    def _exact_color(self) -> NDArray[np.float32]:
        channels = self._image.channels
        color = np.empty((len(channels["A"]), 3), np.float32)
        for i, (name, bits) in enumerate(zip("RGB", _COLOR_BITS, strict=True)):
            predicted = _straight(channels[name], channels["A"])
            color[:, i] = _corrected(predicted, channels[bits])
        return color

    # -- VDIs ------------------------------------------------------------------------------------

    def _exact_vdi(self) -> VDI:
        own, channels = self._description, self._image.channels
        assert own is not None
        front, back = (_relative(channels[n], own.depth_offset) for n in ("Z", "ZBack"))
        if own.depth_offset:
            front, back = (
                _corrected(depth, channels[bits])
                for depth, bits in zip((front, back), _DEPTH_BITS, strict=True)
            )
        return self._checked_vdi(
            own.camera,
            _offsets(self._image.counts),
            (front, back, self._exact_color(), channels["tau"]),
            own.bounds,
            depth_origin=own.depth_origin,
            metadata=own.metadata,
        )

    def _standard_vdi(self, camera: Any, thickness: float | None) -> VDI:
        samples = media(*self._samples_in_window(), thickness, str(self._path))
        width, height = self._window_size
        counts = np.bincount(samples.lists, minlength=width * height).reshape(height, width)
        starts = _offsets(counts).astype(np.int64)
        filled = np.flatnonzero(np.diff(starts))
        nearest = samples.front[starts[filled]].astype(np.float64)
        farthest = samples.back[starts[filled + 1] - 1].astype(np.float64)
        shift = 0.0
        own = self._description
        if camera is None and own is not None and own.window_size == self._window_size:
            view, shift = own.camera, own.depth_offset - own.depth_origin
        else:
            view = self._view(camera, nearest, farthest)
        bounds = bounds_of_lists(view, self._window_size, counts, nearest - shift, farthest - shift)
        if own is not None and not own.exact and view == own.camera:
            bounds = np.array(own.bounds)
        return self._checked_vdi(
            view,
            _offsets(counts),
            (samples.front, samples.back, samples.color, samples.optical_depth),
            bounds,
            depth_origin=-shift,
            metadata=own.metadata if own is not None else {"read_from": self._path.name},
        )

    def _samples_in_window(self) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]]]:
        """Return each sample's list, and the channels, of pixels in the display window."""
        image = self._image
        channels = {n: a for n, a in image.channels.items() if not n.startswith("bits.")}
        width, height = self._window_size
        rows, columns = image.counts.shape
        # Lists count rows from the bottom, y of both windows runs downwards
        x = np.arange(columns) + (image.data_window[0] - image.display_window[0])
        y = np.arange(rows) + (image.display_window[3] - image.data_window[3])
        inside = ((y >= 0) & (y < height))[:, None] & ((x >= 0) & (x < width))
        pixels = y[:, None] * width + x
        lists = np.repeat(pixels.ravel(), image.counts.ravel())
        if inside.all():
            return lists, channels
        kept = np.repeat(inside.ravel(), image.counts.ravel())
        return lists[kept], {name: array[kept] for name, array in channels.items()}

    def _view(self, camera: Any, nearest: Any, farthest: Any) -> Camera:
        if camera is not None:
            return Camera.from_any(camera)
        middle = (nearest.min() + farthest.max()) / 2 if len(nearest) else 1.0
        try:
            return camera_from_matrices(
                self._matrix("worldToCamera"),
                self._matrix("worldToNDC"),
                self._window_size,
                middle,
            )
        except InvalidCameraError as error:
            raise VDIFileError(
                f"{self._path} does not say from where its image is seen: {error}; give the view: "
                "read(..., camera=...)"
            ) from error

    def _matrix(self, name: str) -> NDArray[np.float64] | None:
        """Return a matrix of the header for column vectors."""
        matrix = self._image.attributes.get(name)
        return matrix.T if isinstance(matrix, np.ndarray) else None

    def _checked_vdi(
        self, view: Camera, offsets: Any, arrays: tuple[Any, ...], bounds: Any, **options: Any
    ) -> VDI:
        front, back, color, tau = arrays
        try:
            return VDI(view, self._window_size, offsets, front, back, color, tau, bounds, **options)
        except VDIError as error:
            self._refuse(f"it holds no valid VDI: {error}")

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(
            f"{self._path} is damaged: {why}; copy it from its source again, or write it anew"
        )


def _offsets(counts: NDArray[Any]) -> NDArray[np.uint64]:
    offsets = np.zeros(counts.size + 1, np.uint64)
    np.cumsum(counts.ravel(), out=offsets[1:])
    return offsets
