"""Deep images as other programs write or change them."""

from __future__ import annotations

import struct

import numpy as np

from pyvista_vdi.extensions.deep_exr import layout
from pyvista_vdi.extensions.deep_exr.record import ATTRIBUTE
from pyvista_vdi.extensions.deep_exr.view import view_matrices

MATRICES = ("worldToCamera", "worldToNDC")


def read_deep(path):
    return layout.read_image(path, lambda name: True)


def matrices_of(view, size, depth_offset=0.0):
    return dict(zip(MATRICES, view_matrices(view, size, depth_offset), strict=True))


def write_deep(path, counts, channels, attributes, compression="zips"):
    """Write a deep image.

    ``attributes`` are text, matrices for column vectors, or an OpenEXR type and its bytes.
    """
    header = {
        "screenWindowCenter": ("v2f", bytes(8)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
    }
    for name, value in attributes.items():
        if isinstance(value, np.ndarray):
            header[name] = layout.matrix_attribute(value)
        else:
            header[name] = ("string", value.encode()) if isinstance(value, str) else value
    with path.open("wb") as stream:
        layout.write_image(
            stream,
            counts,
            {name: array.dtype for name, array in channels.items()},
            lambda first, last: {name: array[first:last] for name, array in channels.items()},
            header,
            compression=compression,
            level=1,
        )
    return path


def change(path, **changes):
    """Write a deep image of ours again with other channels, matrices or description."""
    image = read_deep(path)
    channels = {name: changes.get(name, array) for name, array in image.channels.items()}
    kept = {ATTRIBUTE: image.attributes[ATTRIBUTE]}
    kept |= {name: image.attributes[name].T for name in MATRICES}
    attributes = {name: changes.get(name, value) for name, value in kept.items()}
    return write_deep(path, image.counts, channels, attributes, "none")
