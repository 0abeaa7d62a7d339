"""Deep images as other programs write or change them, by the package OpenEXR."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import OpenEXR

from pyvista_vdi.extensions.deep_exr.view import view_matrices

MATRICES = ("worldToCamera", "worldToNDC")


class Deep(NamedTuple):
    """An image: all samples of its pixels, the bottom row first."""

    header: dict[str, Any]
    counts: np.ndarray  # samples of each pixel, (H, W)
    channels: dict[str, np.ndarray]


def read_deep(path, part=0):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header, arrays = dict(file.parts[part].header), {}
        for name, channel in file.parts[part].channels.items():
            arrays[name] = channel.pixels[::-1].ravel()
        shape = channel.pixels.shape
    counts = [0 if samples is None else len(samples) for samples in arrays["Z"]]
    kept = {name: [s for s in each if s is not None] for name, each in arrays.items()}
    channels = {name: np.concatenate([np.empty(0, "f2"), *each]) for name, each in kept.items()}
    return Deep(header, np.reshape(counts, shape), channels)


def matrices_of(view, size):
    return view_matrices(view, size, 0.0)


def part_of(counts, channels, header, compression="ZIPS"):
    """Return a part of a file."""
    pixels = {}
    for name, array in channels.items():
        pixels[name] = np.empty(counts.size, object)
        pixels[name][:] = np.split(array, np.cumsum(counts.ravel())[:-1])
        pixels[name] = np.ascontiguousarray(pixels[name].reshape(counts.shape)[::-1])
    kind = {
        "type": OpenEXR.deepscanline,
        "compression": getattr(OpenEXR, f"{compression}_COMPRESSION"),
    }
    return OpenEXR.Part(kind | header, pixels, "deep")


def write_deep(path, counts, channels, header, compression="ZIPS"):
    OpenEXR.File([part_of(counts, channels, header, compression)]).write(str(path))
    return path


def change(path, header=None, **channels):
    """Write a deep image of ours again with other channels, or attributes of the header."""
    image = read_deep(path)
    kept = {n: image.header[n] for n in (*MATRICES, "pyvistaVDI", "software")}
    return write_deep(path, image.counts, image.channels | channels, kept | (header or {}))
