"""VDIs as OpenEXR deep scan lines, by the package OpenEXR; ``docs/files.md`` describes the files.

The channels are everybody's, Z, ZBack, A, R, G and B, and the optical depth, which opacities near 1
do not tell. The view, bounds and metadata are in an attribute of ours.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from pyvista_vdi.errors import VDIError, VDIFileError, warn_external
from pyvista_vdi.extensions.deep_exr.samples import media
from pyvista_vdi.extensions.deep_exr.view import bounds_of_lists, camera_of, view_matrices
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.layout import describe, from_json, number, to_json
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import whole_file

#: The header's attribute with what a VDI has beside its samples, JSON, and its version.
ATTRIBUTE, VERSION = "pyvistaVDI", 3


def write(vdi: VDI, path: Any, *, progress: Progress | None = None) -> Path:
    """Write a VDI as OpenEXR deep scan lines: see :func:`pyvista_vdi.io.write`."""
    # Depths may not be negative, which they are in some parallel views: move the eye back
    depths = [depth.astype(np.float64) + vdi.depth_origin for depth in (vdi.front, vdi.back)]
    shift = 0.0 - float(depths[0].min(initial=0.0)) if vdi.camera.parallel_projection else 0.0
    front, back = (np.maximum(depth + shift, 0).astype(np.float32) for depth in depths)
    back = np.maximum(back, np.nextafter(front, np.float32(np.inf)))  # as thin as float32 has it
    alpha = -np.expm1(-vdi.optical_depth.astype(np.float64))
    channels: dict[str, Any] = {"Z": front, "ZBack": back, "A": alpha, "tau": vdi.optical_depth}
    channels |= {name: vdi.color[:, k] * alpha for k, name in enumerate("RGB")}
    record = describe(vdi, VERSION) | {"depth_shift": shift, "depths": _ends(front, back)}
    header = {
        "type": OpenEXR.deepscanline,
        "compression": OpenEXR.ZIPS_COMPRESSION,
        "software": record["written_by"],
        ATTRIBUTE: to_json(record),
        **view_matrices(vdi.camera, vdi.window_size, shift),
    }
    image = OpenEXR.File(header, {name: _pixels(vdi, array) for name, array in channels.items()})
    content = BytesIO()  # the package does not say why a disk does not take a file
    image.write(content)
    Pieces(progress, 1)()
    with whole_file(path) as stream:
        stream.write(content.getbuffer())
    return Path(path).resolve()


def read(path: Any, *, progress: Progress | None = None, **options: Any) -> VDI:
    """Read a VDI from an OpenEXR deep image: see :func:`pyvista_vdi.read`."""
    vdi, _ = _vdi(path, **options)
    Pieces(progress, 1)()
    return vdi


def read_info(path: Any) -> FileInfo:
    """Return what a file says about itself; all samples are read for it."""
    vdi, header = _vdi(path)
    return FileInfo(
        path=Path(path),
        format_version=VERSION,
        written_by=str(header.get("software", "")),
        camera=vdi.camera,
        window_size=vdi.window_size,
        n_supersegments=vdi.n_supersegments,
        bounds=vdi.bounds,
        depth_origin=vdi.depth_origin,
        metadata=vdi.metadata,
        codec=f"OpenEXR {header['compression'].name.removesuffix('_COMPRESSION').lower()}",
        file_bytes=Path(path).stat().st_size,
        memory_bytes=vdi.nbytes,
    )


def _deep_image(path: Any) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the header of a file's deep image, and the pixels of its channels."""
    try:
        with Path(path).open("rb"):  # whose error has a reason
            pass
        with OpenEXR.File(str(path), separate_channels=True) as file:
            deep = [
                (dict(part.header), {name: each.pixels for name, each in part.channels.items()})
                for part in file.parts
                if part.header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile)
            ]
    except (OSError, TypeError, RuntimeError, ValueError, LookupError, MemoryError) as error:
        raise VDIFileError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}; check its name, "
            "and whether it is an OpenEXR file and whole"
        ) from error
    if len(deep) != 1:
        raise VDIFileError(
            f"{path} has {len(deep)} deep images that can be read, and a VDI is one: a file that "
            "is cut off has none, nor has a flat image, which says nothing about depth; take one "
            "of several out by oiiotool in.exr --subimage 0 -o out.exr"
        )
    return deep[0]


def _vdi(path: Any, camera: Any = None, thickness: Any = None) -> tuple[VDI, dict[str, Any]]:
    """Return the VDI and the header of a file."""
    header, pixels = _deep_image(path)
    record, display = _record(header, path), np.array(header["displayWindow"])
    size = tuple((np.ptp(display, axis=0) + 1).tolist())
    lists, channels = _samples_in(header, pixels, size, path)
    samples = media(lists, channels, thickness, str(path))
    counts = np.bincount(samples.lists, minlength=size[0] * size[1]).reshape(size[::-1])

    # Take the view of ours, and bounds and metadata where the samples are those that were written
    ends, shift = _ends(channels["Z"], channels.get("ZBack", channels["Z"])), 0.0
    written = bool(record) and record["samples"] == (len(lists), ends)
    if camera is not None:
        view = Camera.from_any(camera)
    elif record:
        moved = np.ptp(header["dataWindow"] - display, axis=0) == 0
        if size != record["size"] or (moved.all() and (header["dataWindow"] != display).any()):
            raise VDIFileError(
                f"{path} was cut, resized or moved after pyvista-vdi wrote it: its view is of "
                f"{record['size']} lists; give the view that it shows: read(..., camera=...)"
            )
        view, shift = record["camera"], record["shift"]
    else:
        view = camera_of(header, size, sum(ends) / 2, path)
    if record and not written:
        warn_external(
            f"{path} was changed after pyvista-vdi wrote it: its bounds are those of its samples, "
            "and its metadata are left out"
        )
    bounds: Any = record.get("bounds")
    if camera is not None or not written:
        bounds = bounds_of_lists(view, counts, _ends(samples.front - shift, samples.back - shift))
    metadata = record["metadata"] if written else {"read_from": Path(path).name}
    offsets = np.concatenate([[0], np.cumsum(counts)])
    try:
        about: dict[str, Any] = {"depth_origin": -shift, "metadata": metadata}
        return VDI(view, size, offsets, *samples[1:], bounds, **about), header
    except VDIError as error:
        raise VDIFileError(f"{path} holds no valid VDI: {error}; write it anew") from error


def _record(header: dict[str, Any], path: Any) -> dict[str, Any]:
    """Return what our attribute says, checked; nothing where there is no such attribute."""
    if ATTRIBUTE not in header:
        return {}
    try:
        entries = from_json(header[ATTRIBUTE])
        if entries["version"] != VERSION:
            warn_external(
                f"{path} is of version {entries['version']} of pyvista-vdi's images, and is read "
                f"as any program's: this release knows version {VERSION}"
            )
            return {}
        return {
            "camera": Camera.from_dict(entries["camera"]),
            "size": tuple(entries["window_size"]),
            "bounds": tuple(number(bound) for bound in entries["bounds"]),
            "shift": number(entries["depth_shift"]),
            "samples": (entries["n_supersegments"], entries["depths"]),
            "metadata": dict(entries["metadata"]),
        }
    except (VDIError, LookupError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise VDIFileError(
            f"{path} is damaged: its attribute {ATTRIBUTE} is wrong ({error!r}); write it anew"
        ) from error


def _pixels(vdi: VDI, array: NDArray[Any]) -> NDArray[Any]:
    """Return each list's values as the package has them: arrays by row and column, from the top."""
    width, height = vdi.window_size
    values, offsets = array.astype(np.float32), vdi.offsets.astype(np.int64)
    pixels = np.full(width * height, None)
    pixels[0] = values[:0]  # which says the type where all lists are empty
    for k in np.flatnonzero(np.diff(offsets)):
        pixels[k] = values[offsets[k] : offsets[k + 1]]
    return np.ascontiguousarray(pixels.reshape(height, width)[::-1])


def _samples_in(header: Any, pixels: Any, size: Any, path: Any) -> tuple[Any, dict[str, Any]]:
    """Return each sample's list, and the channels, of the pixels in the display window."""
    names = [name for name in ("Z", "ZBack", "A", "R", "G", "B", "tau") if name in pixels]
    if not {"Z", "A", "R", "G", "B"} <= {*names}:
        raise VDIFileError(
            f"{path} has the channels {', '.join(pixels)}, and a VDI needs Z, ZBack, A, R, G and B"
        )
    # Lists count rows from the bottom, y of both windows runs downwards
    (left, top), (right, bottom) = header["dataWindow"]
    (first, _), (_, last) = header["displayWindow"]
    x, y = np.arange(left, right + 1) - first, last - np.arange(top, bottom + 1)[::-1]
    inside = ((y >= 0) & (y < size[1]))[:, None] & ((x >= 0) & (x < size[0]))
    channels: dict[str, Any] = {}
    for name in names:
        chosen = pixels[name][::-1][inside]
        lengths = [0 if p is None else len(p) for p in chosen]
        channels[name] = np.concatenate([np.empty(0, "f2"), *(p for p in chosen if p is not None)])
    return np.repeat((y[:, None] * size[0] + x)[inside], lengths), channels


def _ends(front: NDArray[Any], back: NDArray[Any]) -> list[float]:
    """Return the nearest front and the farthest back of samples, 0 and 0 where there are none."""
    return [float(front.min()), float(back.max())] if len(front) else [0.0, 0.0]
