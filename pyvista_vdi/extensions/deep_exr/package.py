"""Deep images that only the OpenEXR package reads: tiles, several parts, newer compressions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import MissingDependencyError, VDIFileError, warn_external
from pyvista_vdi.extensions.deep_exr.layout import DeepImage
from pyvista_vdi.model.camera import MAX_WINDOW_EDGE

_DEEP_TYPES = ("deepscanline", "deeptile")

#: Attributes that are used, as the package names them.
_ATTRIBUTES = ("pyvistaVDI", "software", "worldToCamera", "worldToNDC")


def read_by_package(path: Path, wanted: set[str], form: str) -> DeepImage:
    """Read the first deep part of a file; warn where there are more.

    The package holds every pixel's samples as an array of its own, which takes about a hundred
    bytes per pixel and channel: this is for files that nothing else reads.
    """
    try:
        import OpenEXR
    except ImportError as error:
        raise MissingDependencyError(
            f'{path} {form}, which only the OpenEXR package reads: pip install "pyvista-vdi[exr]"'
        ) from error
    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            index, *others = _deep_parts(file, path)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            image = _image(file.parts[index], wanted)
    except VDIFileError:
        raise
    except (RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        raise VDIFileError(
            f"{path} {form}, and the OpenEXR package cannot read it ({error}); write it as a "
            "deep scan line image with ZIPS compression"
        ) from error
    if others:
        warn_external(
            f"{path} has {1 + len(others)} deep parts, of which the first is read, part {index}: "
            f"take another out by oiiotool in.exr --subimage {others[0]} -o out.exr"
        )
    return image


def _deep_parts(file: Any, path: Path) -> list[int]:
    deep = []
    for index, part in enumerate(file.parts):
        kind = getattr(part.header.get("type"), "name", "")
        x0, y0, x1, y1 = _box(part.header["dataWindow"])
        if kind in _DEEP_TYPES and max(x1 - x0, y1 - y0) < MAX_WINDOW_EDGE:
            deep.append(index)
    if not deep:
        raise VDIFileError(f"{path} has no part that is a deep image")
    return deep


def _image(part: Any, wanted: set[str]) -> DeepImage:
    header, pixels = part.header, {n: c.pixels for n, c in part.channels.items()}
    first = next(iter(pixels.values()))
    lengths = [0 if samples is None else len(samples) for samples in first[::-1].ravel()]
    found = {name: header[name] for name in _ATTRIBUTES if name in header}
    channels = {name: _joined(array) for name, array in pixels.items()}
    return DeepImage(
        attributes={
            name: value.astype(np.float64) if isinstance(value, np.ndarray) else value
            for name, value in found.items()
        },
        data_window=_box(header["dataWindow"]),
        display_window=_box(header["displayWindow"]),
        compression=header["compression"].name,
        channel_types={name: array.dtype for name, array in channels.items()},
        counts=np.array(lengths, np.int64).reshape(first.shape),
        channels={name: array for name, array in channels.items() if name in wanted},
    )


def _joined(pixels: Any) -> NDArray[Any]:
    """Return all pixels' samples, bottom row first."""
    filled = [samples for samples in pixels[::-1].ravel() if samples is not None]
    return np.concatenate(filled) if filled else np.empty(0, np.float32)


def _box(window: Any) -> tuple[int, int, int, int]:
    (x0, y0), (x1, y1) = window
    return int(x0), int(y0), int(x1), int(y1)
