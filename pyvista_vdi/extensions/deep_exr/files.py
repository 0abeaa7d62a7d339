"""VDIs as OpenEXR deep scan line images, both ways; ``docs/files.md`` describes the files.

Everybody's channels (Z, ZBack, A, R, G, B) are written in float32. What they lose is written
beside them as corrections, the differences of bit patterns from what a reader computes; they are
small whole numbers and compress to little. Whoever changes the standard channels changes the VDI.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidCameraError, VDIError, VDIFileError, warn_external
from pyvista_vdi.extensions.deep_exr.corrections import (
    COLOR_BITS,
    DEPTH_BITS,
    OURS,
    STANDARD,
    channel_names,
    corrected,
    correction,
    exact_colors,
    is_correction,
    relative,
    straight,
    whole_numbers,
)
from pyvista_vdi.extensions.deep_exr.layout import (
    DeepImage,
    OtherFormError,
    matrix_attribute,
    read_image,
    write_image,
)
from pyvista_vdi.extensions.deep_exr.linear_light import COLOR_SPACE, to_display, to_linear
from pyvista_vdi.extensions.deep_exr.record import (
    ATTRIBUTE,
    COUNTS,
    Record,
    checksums_of,
    parsed_record,
    record_text,
)
from pyvista_vdi.extensions.deep_exr.samples import media
from pyvista_vdi.extensions.deep_exr.view import (
    bounds_of_lists,
    camera_from_matrices,
    view_matrices,
)
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.compositing import opacity
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import whole_file

#: The name that a file's name ends in.
SUFFIX = ".exr"

#: x_min, y_min, x_max and y_max of pixels, y downwards, both ends included.
Box = tuple[int, int, int, int]

#: How samples may be compressed when they are written.
COMPRESSIONS = ("zips", "none")

#: Samples whose checksums are taken at a time.
_PART = 2**18

#: How far a matrix of the header may be from the one that was written, relative to its largest
#: entry: programs keep them in float32, some as text of seven digits.
_SAME_MATRIX = 1e-5


def write(
    vdi: VDI,
    path: str | os.PathLike[str],
    *,
    compression: str = "zips",
    level: int = 1,
    exact: bool = True,
    linear: bool = False,
    progress: Progress | None = None,
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
    linear : bool
        Write colours as linear light (sRGB's curve undone), which compositing programs take them
        for, instead of as a display takes them. The file says so, and reading it gives back the
        VDI's colours.
    progress : callable, optional
        As for :func:`pyvista_vdi.io.write`.
    """
    offset = _depth_offset(vdi)
    names = channel_names(exact, offset)

    def encoded(first: int, last: int) -> dict[str, NDArray[Any]]:
        channels = _encoded(vdi, slice(first, last), offset, linear)
        return {name: channels[name] for name in names}

    def parts() -> Iterator[dict[str, NDArray[Any]]]:
        for first in range(0, max(vdi.n_supersegments, 1), _PART):
            yield encoded(first, first + _PART)

    checksums = checksums_of(vdi.counts, parts())
    with whole_file(path) as stream:
        write_image(
            stream,
            vdi.counts,
            {name: np.uint32 if is_correction(name) else np.float32 for name in names},
            encoded,
            _attributes(vdi, offset, record_text(vdi, offset, exact, linear, checksums), linear),
            compression=compression,
            level=level,
            progress=progress,
        )
    return Path(os.path.realpath(path))


def read(
    path: str | os.PathLike[str],
    *,
    camera: Any = None,
    thickness: float | None = None,
    linear: bool | None = None,
    progress: Progress | None = None,
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
    linear : bool, optional
        Whether the colours are linear light, to be shown by sRGB's curve; by default what the
        file says where it is one of ours, and of others no.
    progress : callable, optional
        As for :func:`pyvista_vdi.io.write`.

    Warns
    -----
    VDIWarning
        If one of our files was changed by another program, colours are outside 0 to 1, or the
        file has more deep parts than the one that is read.
    """
    with np.errstate(invalid="ignore"):  # a signalling NaN is refused as any other
        return _File(path, progress).vdi(camera, thickness, linear)


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Return what a file says about itself; of a foreign one all samples are read for it."""
    with np.errstate(invalid="ignore"):
        return _File(path).info()


def _depth_offset(vdi: VDI) -> float:
    """Return what is added to front and back for Z, which the standard wants not to be negative.

    In parallel projection depths may be: then the eye is moved back.
    """
    if not vdi.camera.parallel_projection or not vdi.n_supersegments:
        return vdi.depth_origin
    nearest = float(vdi.front.min()) + vdi.depth_origin
    return vdi.depth_origin - min(nearest, 0.0)


def _attributes(vdi: VDI, offset: float, record: str, linear: bool) -> dict[str, tuple[str, bytes]]:
    to_camera, to_ndc = view_matrices(vdi.camera, vdi.window_size, offset - vdi.depth_origin)
    half = vdi.camera.half_extent(vdi.window_size)
    center = [c * h for c, h in zip(vdi.camera.window_center, half, strict=True)]
    return {
        ATTRIBUTE: ("string", record.encode("ascii")),
        "screenWindowCenter": ("v2f", struct.pack("<2f", *center)),
        "screenWindowWidth": ("float", struct.pack("<f", 2 * half[0])),
        "software": ("string", f"pyvista-vdi {__version__}".encode()),
        "worldToCamera": matrix_attribute(to_camera),
        "worldToNDC": matrix_attribute(to_ndc),
        **(COLOR_SPACE if linear else {}),
    }


def _encoded(vdi: VDI, part: slice, offset: float, linear: bool) -> dict[str, NDArray[Any]]:
    """Return all channels that a file may have."""
    front, back, tau = vdi.front[part], vdi.back[part], vdi.optical_depth[part]
    alpha = opacity(tau).astype(np.float32)
    channels: dict[str, NDArray[Any]]
    channels = {"A": alpha, "Z": _depth(front, offset), "ZBack": _depth(back, offset), "tau": tau}
    for i, (name, bits) in enumerate(zip("RGB", COLOR_BITS, strict=True)):
        shown = vdi.color[part, i]
        light = (to_linear(shown) * alpha).astype(np.float32) if linear else shown * alpha
        channels[name] = light
        channels[bits] = correction(shown, straight(light, alpha, linear))
    for name, bits, exactly in zip(("Z", "ZBack"), DEPTH_BITS, (front, back), strict=True):
        channels[bits] = correction(exactly, relative(channels[name], offset))
    return channels


def _depth(relative: NDArray[np.float32], offset: float) -> NDArray[np.float32]:
    if offset == 0:
        return relative
    # The nearest may come out as -0.0 or a rounding below 0, the farthest beyond float32
    with np.errstate(over="ignore"):
        return np.maximum(relative.astype(np.float64) + offset, 0).astype(np.float32)


class _File:
    """A deep image that has been read; says what it holds."""

    def __init__(self, path: str | os.PathLike[str], progress: Progress | None = None) -> None:
        try:
            self._path = Path(path)
        except TypeError as error:
            raise VDIFileError(f"a file's name is a path; got {type(path).__name__}") from error
        self._image = self._read_image(progress)
        self._record = self._read_record()
        self._changed = self._record.changed(self._image) if self._record else ()

    def vdi(self, camera: Any, thickness: float | None, linear: bool | None) -> VDI:
        """Return the VDI: ours exactly, or what the standard channels say."""
        record, frame = self._record, self._image.display_window
        if camera is None:
            frame = self._frame()
        asked = camera is not None or thickness is not None
        if record is not None and record.exact and not asked and linear in (None, record.linear):
            if not self._changed and self._keeps_view(record):
                return self._exact_vdi(record)
            self._warn_of_changes()
        return self._standard_vdi(frame, camera, thickness, linear)

    def info(self) -> FileInfo:
        """Return what the file says."""
        record = self._record
        vdi = self.vdi(None, None, None)
        return FileInfo(
            path=self._path,
            format_version=record.version if record else 2,
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

    def _read_image(self, progress: Progress | None) -> DeepImage:
        wanted = {*STANDARD, *OURS}
        try:
            image = read_image(self._path, wanted.__contains__, progress)
        except OtherFormError as error:
            from pyvista_vdi.extensions.deep_exr.package import read_by_package

            image = read_by_package(self._path, wanted, str(error))
        missing = [name for name in ("Z", "A", "R", "G", "B") if name not in image.channel_types]
        if missing:
            raise VDIFileError(
                f"{self._path} has no channel {', '.join(missing)}; it has "
                f"{', '.join(image.channel_types)}: a VDI needs Z, ZBack, A, R, G and B"
                f"{_layer_remedy(missing, image.channel_types)}"
            )
        for name in STANDARD:
            kind = image.channel_types.get(name)
            if kind is not None and kind.kind != "f" and len(image.channels["Z"]):
                raise VDIFileError(
                    f"{self._path} holds no VDI: its channel {name} is of type {kind}, and must be "
                    "float32 or float16; convert it: oiiotool in.exr -d float -o out.exr"
                )
        if image.channel_types.get("tau", np.dtype("f4")).kind != "f":
            del image.channels["tau"]  # another's channel of that name
        return image

    def _read_record(self) -> Record | None:
        text = self._image.attributes.get(ATTRIBUTE)
        if text is None:
            return None
        try:
            return parsed_record(text, self._path)
        except VDIFileError:
            raise
        except ValueError as error:
            self._refuse(f"its attribute {ATTRIBUTE} is incomplete or wrong: {error}")

    def _frame(self) -> Box:
        """Return the pixels of the view; both windows of a file of ours are alike."""
        data, display, record = self._image.data_window, self._image.display_window, self._record
        if record is None:
            return display
        whole = [box for box in (display, data) if _size(box) == record.window_size]
        if not whole:
            raise VDIFileError(
                f"{self._path} was cut or resized after pyvista-vdi wrote it: its display window "
                f"is {_text(_size(display))}, and its view is of {_text(record.window_size)} "
                "lists; give the view that it shows: read(..., camera=...)"
            )
        if len(whole) == 2 and data != display:
            raise VDIFileError(
                f"{self._path} was moved after pyvista-vdi wrote it: its data window begins at "
                f"{data[:2]}, its display window at {display[:2]}; no view shows it so: move it "
                "back, or give a view: read(..., camera=...)"
            )
        return whole[0]

    def _keeps_view(self, record: Record) -> bool:
        """Whether the header's matrices, where it has them, are those of the record's view."""
        shift = record.depth_offset - record.depth_origin
        written = view_matrices(record.camera, record.window_size, shift)
        for name, matrix in zip(("worldToCamera", "worldToNDC"), written, strict=True):
            found, size = self._matrix(name), np.abs(matrix[:, :3]).max()
            if found is not None and not np.allclose(
                found, matrix, rtol=_SAME_MATRIX, atol=_SAME_MATRIX * size
            ):
                return False
        return True

    def _warn_of_changes(self) -> None:
        """Name what was changed: where that is the standard channels, ours follow."""
        what: tuple[str, ...] = self._changed or ("its matrices",)
        if COUNTS in what:
            what = ("the number of samples",)
        elif set(what) & set(STANDARD):
            what = tuple(name for name in what if name in STANDARD)
        warn_external(
            f"{self._path} was changed after pyvista-vdi wrote it ({', '.join(what)}): its "
            "standard channels are read, as those of any program's files"
        )

    def _exact_vdi(self, record: Record) -> VDI:
        channels = self._image.channels
        front, back = (relative(channels[n], record.depth_offset) for n in ("Z", "ZBack"))
        if record.depth_offset:
            front, back = (
                corrected(depth, whole_numbers(channels[bits]))
                for depth, bits in zip((front, back), DEPTH_BITS, strict=True)
            )
        return self._checked_vdi(
            record.camera,
            _offsets(self._image.counts),
            (front, back, exact_colors(channels, record.linear), channels["tau"]),
            record.bounds,
            record.window_size,
            depth_origin=record.depth_origin,
            metadata=record.metadata,
        )

    def _standard_vdi(
        self, frame: Box, camera: Any, thickness: float | None, linear: bool | None
    ) -> VDI:
        samples = media(*self._samples_in(frame), thickness, str(self._path))
        width, height = size = _size(frame)
        counts = np.bincount(samples.lists, minlength=width * height).reshape(height, width)
        starts = _offsets(counts).astype(np.int64)
        filled = np.flatnonzero(np.diff(starts))
        nearest = samples.front[starts[filled]].astype(np.float64)
        farthest = samples.back[starts[filled + 1] - 1].astype(np.float64)
        record, shift = self._record, 0.0
        bounds: Any = None
        if camera is None and record is not None and self._keeps_view(record):
            view, shift = record.camera, record.depth_offset - record.depth_origin
            if thickness is None and not {COUNTS, "Z", "ZBack"}.intersection(self._changed):
                bounds = record.bounds
        else:
            view = self._view(camera, size, nearest, farthest)
        if bounds is None:
            bounds = bounds_of_lists(view, size, counts, nearest - shift, farthest - shift)
        if linear is None:
            linear = record is not None and record.linear
        # What the record says of how the VDI was made is of the samples that were written
        kept = record is not None and not {COUNTS, *STANDARD}.intersection(self._changed)
        return self._checked_vdi(
            view,
            _offsets(counts),
            (
                samples.front,
                samples.back,
                to_display(samples.color).clip(0, 1) if linear else samples.color,
                samples.optical_depth,
            ),
            bounds,
            size,
            depth_origin=-shift,
            metadata=record.metadata if record and kept else {"read_from": self._path.name},
        )

    def _samples_in(self, frame: Box) -> tuple[NDArray[np.int64], dict[str, NDArray[Any]]]:
        """Return each sample's list, and the channels, of pixels in the frame."""
        image = self._image
        channels = {n: a for n, a in image.channels.items() if not is_correction(n)}
        width, height = _size(frame)
        rows, columns = image.counts.shape
        # Lists count rows from the bottom, y of both windows runs downwards
        x = np.arange(columns) + (image.data_window[0] - frame[0])
        y = np.arange(rows) + (frame[3] - image.data_window[3])
        inside = ((y >= 0) & (y < height))[:, None] & ((x >= 0) & (x < width))
        pixels = y[:, None] * width + x
        lists = np.repeat(pixels.ravel(), image.counts.ravel())
        if inside.all():
            return lists, channels
        kept = np.repeat(inside.ravel(), image.counts.ravel())
        return lists[kept], {name: array[kept] for name, array in channels.items()}

    def _view(self, camera: Any, size: tuple[int, int], nearest: Any, farthest: Any) -> Camera:
        if camera is not None:
            return Camera.from_any(camera)
        middle = (nearest.min() + farthest.max()) / 2 if len(nearest) else 1.0
        try:
            return camera_from_matrices(
                self._matrix("worldToCamera"), self._matrix("worldToNDC"), size, middle
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
        self,
        view: Camera,
        offsets: Any,
        arrays: tuple[Any, ...],
        bounds: Any,
        size: tuple[int, int],
        **options: Any,
    ) -> VDI:
        front, back, color, tau = arrays
        try:
            return VDI(view, size, offsets, front, back, color, tau, bounds, **options)
        except VDIError as error:
            self._refuse(f"it holds no valid VDI: {error}")

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(
            f"{self._path} is damaged: {why}; copy it from its source again, or write it anew"
        )


def _size(box: Box) -> tuple[int, int]:
    return box[2] - box[0] + 1, box[3] - box[1] + 1


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"


def _layer_remedy(missing: list[str], names: Collection[str]) -> str:
    """Return how to take the channels of a layer, where one has those that are missing."""
    layers = {name.rpartition(".")[0] for name in names} - {""}
    for layer in sorted(layers):
        if all(f"{layer}.{name}" in names for name in missing):
            renamed = ",".join(f"{n}={layer}.{n}" for n in STANDARD if f"{layer}.{n}" in names)
            return f"; take those of its layer {layer}: oiiotool in.exr --ch {renamed} -o out.exr"
    return ""


def _offsets(counts: NDArray[Any]) -> NDArray[np.uint64]:
    offsets = np.zeros(counts.size + 1, np.uint64)
    np.cumsum(counts.ravel(), out=offsets[1:])
    return offsets
