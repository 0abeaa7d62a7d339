"""What our files say about themselves, and which of it still holds.

Other programs copy the header's attributes blindly, whatever they did to the samples. So the
attribute records a checksum of each channel, and what it says of a channel that is another now is
not believed.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import VDIError, VDIFileError
from pyvista_vdi.extensions.deep_exr.corrections import (
    channel_names,
    exact_colors,
    is_correction,
    whole_numbers,
)
from pyvista_vdi.extensions.deep_exr.layout import DeepImage
from pyvista_vdi.extensions.deep_exr.samples import agree
from pyvista_vdi.io.vdi_file.description import describe, from_json, number, to_json
from pyvista_vdi.io.vdi_file.layout import FORMAT_NAME
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: The header's attribute that holds the record in JSON.
ATTRIBUTE = "pyvistaVDI"

#: Version of the record and of our own channels; of this and of lower ones is read. Version 1 has
#: no checksums.
IMAGE_VERSION = 2

#: The name of the samples per pixel among the checksums.
COUNTS = "counts"


@dataclass(frozen=True)
class Record:
    """The entries of our attribute, checked; ``docs/files.md`` says what they mean."""

    camera: Camera
    window_size: tuple[int, int]
    n_supersegments: int
    bounds: tuple[float, ...]
    depth_origin: float
    depth_offset: float
    exact: bool
    linear: bool
    checksums: dict[str, int]
    version: int
    metadata: dict[str, Any]

    def changed(self, image: DeepImage) -> tuple[str, ...]:
        """Return what is not as it was written: names of channels, and ``"counts"``."""
        names = (COUNTS, *channel_names(self.exact, self.depth_offset))
        if self.version == 1:
            return () if self._seems_unchanged(image) else names
        return tuple(name for name in names if self.checksums.get(name) != _found(name, image))

    def _seems_unchanged(self, image: DeepImage) -> bool:
        """Whether a file without checksums is as it was written, as far as that can be seen."""
        names, channels = channel_names(True, self.depth_offset), image.channels
        types = {name: np.uint32 if is_correction(name) else np.float32 for name in names}
        if not self.exact or any(image.channel_types.get(n) != kind for n, kind in types.items()):
            return False
        if self.n_supersegments != len(channels["Z"]) or self.n_supersegments == 0:
            return self.n_supersegments == len(channels["Z"])
        color = exact_colors(channels, self.linear)
        fit = color.min() >= 0 and color.max() <= 1
        return bool(fit and agree(channels["A"], channels["tau"]).all())


def record_text(
    vdi: VDI, offset: float, exact: bool, linear: bool, checksums: Mapping[str, int]
) -> str:
    """Return the attribute's text."""
    return to_json(
        {
            **describe(vdi, IMAGE_VERSION),
            "depth_offset": offset,
            "exact": exact,
            "linear": linear,
            "checksums": dict(checksums),
        }
    )


def parsed_record(text: str, path: Any) -> Record:
    """Return what a file's attribute says."""
    try:
        entries = from_json(text)
        if entries["format"] != FORMAT_NAME or isinstance(entries["version"], bool):
            raise ValueError("it does not name the format")
        if not 1 <= entries["version"] <= IMAGE_VERSION:
            raise VDIFileError(
                f"{path} is of format version {entries['version']}; this release reads "
                f"up to version {IMAGE_VERSION}: upgrade by pip install -U pyvista-vdi"
            )
        width, height = entries["window_size"]
        if not isinstance(entries["metadata"], dict):
            raise TypeError("its metadata are no dictionary")
        newer = entries["version"] > 1
        return Record(
            camera=Camera.from_dict(entries["camera"]),
            window_size=(width, height),
            n_supersegments=entries["n_supersegments"],
            bounds=tuple(number(b) for b in entries["bounds"]),
            depth_origin=number(entries["depth_origin"]),
            depth_offset=number(entries["depth_offset"]),
            exact=entries["exact"] is True,
            linear=newer and entries["linear"] is True,
            checksums=dict(entries["checksums"]) if newer else {},
            version=entries["version"],
            metadata=entries["metadata"],
        )
    except VDIFileError:
        raise
    except (VDIError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ValueError(repr(error)) from error


def checksums_of(
    counts: NDArray[Any], parts: Iterable[Mapping[str, NDArray[Any]]]
) -> dict[str, int]:
    """Return the CRC-32 of each channel, given part by part, and of the samples per pixel."""
    sums = {COUNTS: _crc(counts.astype(np.uint32))}
    for part in parts:
        for name, array in part.items():
            sums[name] = _crc(array, sums.get(name, 0))
    return sums


def _found(name: str, image: DeepImage) -> int | None:
    if name == COUNTS:
        return _crc(image.counts.astype(np.uint32))
    array = image.channels.get(name)
    if array is None:
        return None
    return _crc(whole_numbers(array) if is_correction(name) else array)


def _crc(array: NDArray[Any], before: int = 0) -> int:
    little = array.dtype.newbyteorder("<")
    plain: Any = np.ascontiguousarray(array, little).ravel().view(np.uint8)
    return zlib.crc32(plain, before)
