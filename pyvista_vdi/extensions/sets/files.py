"""Writes and reads .vdiset files: those of a series in all but their head, which has the views."""

from __future__ import annotations

import io
import math
import os
from pathlib import Path
from typing import Any, BinaryIO

from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.extensions.series.layout import index_bytes
from pyvista_vdi.extensions.series.reader import SeriesInfo, StepsReader
from pyvista_vdi.extensions.series.series import refuse_look
from pyvista_vdi.extensions.series.steps_writer import StepsWriter
from pyvista_vdi.extensions.series.steps_writer import write_all as write_parts
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io.files import format_named
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.description import number
from pyvista_vdi.io.vdi_file.layout import MAX_DESCRIPTION_BYTES
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import as_path, check_writable, whole_file, with_suffix
from pyvista_vdi.quality.view_error import eye_from_centre

FORMAT_NAME = "pyvista-vdi-set"
SUFFIX = ".vdiset"
#: The first bytes; the rest is as of a series, see :mod:`pyvista_vdi.extensions.series.layout`.
MAGIC = b"\x89VDIV\r\n\x1a"


class SetReader(StepsReader):
    """The VDIs of a .vdiset file: read and decoded when they are asked for, from any thread."""

    _MAGIC, _PART = MAGIC, "view"
    _FOREIGN = (
        "a set of VDIs: it begins with {!r}; such a file is written by VDISet.save() or "
        "'pyvista-vdi set'"
    )
    _KEPT_VDIS = 8

    def _check_head(self, found: dict[str, Any]) -> None:
        self._views = [Camera.from_dict(view) for view in found["views"]]
        self.picture_size = check_window_size(found["picture_size"])
        self.all_bounds = tuple(number(bound) for bound in found["bounds"])
        self.about = found["about"]
        if not isinstance(self.about, dict):
            raise TypeError("what is said about a set is a dictionary")
        if self.about.get("camera") is not None:
            Camera.from_dict(self.about["camera"])
        if len(self.all_bounds) != 6 or not all(map(math.isfinite, self.all_bounds)):
            raise ValueError("bounds are six finite numbers")
        for view in self._views:  # as the set will ask
            eye_from_centre(view, self.all_bounds, self._views[0].model_transform[:3, :3])

    @property
    def cameras(self) -> list[Camera]:
        """The view V_O of each VDI that is there."""
        if self._frames[-1][1].number >= len(self._views):
            self._refuse("it has more VDIs than views")
        return [self._views[header.number] for _, header in self._frames]

    def _decoded(self, i: int) -> VDI:
        vdi = super()._decoded(i)
        if vdi.bounds != self.all_bounds:
            self._refuse(f"view {self._frames[i][1].number} is of another scene")
        return vdi


def save(vdi_set: VDISet, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write a file of a set, or a page that shows it: see :meth:`VDISet.save`."""
    refuse_look(vdi_set, options)
    found = format_named(path)
    if found is not None and found.page:
        as_vdi(vdi_set[0])  # refuses what has no colours
        return found.load().write_set(vdi_set, path, **options)  # type: ignore[no-any-return]
    return write(vdi_set, path, **options)


def write(
    vdi_set: VDISet,
    path: str | os.PathLike[str],
    *,
    precision: str = "8-byte",
    tolerance: float = 0.0,
    compression: str = "zstd",
    level: int = 1,
    progress: Progress | None = None,
) -> Path:
    """Write a set to a file, which appears whole or not at all: see :meth:`VDISet.save`."""
    target = check_writable(with_suffix(as_path(path), (SUFFIX,), "a set"))
    writer = StepsWriter(precision, tolerance, 1, compression, level)
    with whole_file(target) as stream:
        write_all(stream, writer, vdi_set, progress)
    return target


def write_all(
    stream: BinaryIO, writer: StepsWriter, vdi_set: VDISet, progress: Progress | None = None
) -> int:
    """Write a whole file to a stream; return how many bytes show its first VDI."""
    head = _head(vdi_set)
    n = len(head["views"])
    if bytes_around(vdi_set) - index_bytes(n) > MAX_DESCRIPTION_BYTES:
        raise InvalidVDIError(f"{n} views are more than a file's head can hold")
    return write_parts(stream, writer, vdi_set, range(n), progress, **head)


def bytes_around(vdi_set: VDISet) -> int:
    """Return the bytes that a set's file has beside the frames of its VDIs."""
    stream = io.BytesIO()
    StepsWriter("8-byte", 0.0, 1, "zstd", 1).begin(stream, **_head(vdi_set))
    return stream.tell() + index_bytes(len(vdi_set.cameras))


def _head(vdi_set: VDISet) -> dict[str, Any]:
    """Return what the head of a set's file says."""
    return {
        "magic": MAGIC,
        "name": FORMAT_NAME,
        "views": [view.to_dict() for view in vdi_set.cameras],
        "picture_size": list(vdi_set.window_size),
        "bounds": list(vdi_set.bounds),
        "about": vdi_set.about,
    }


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISet:
    """Read a set from a .vdiset file; VDIs are decoded when they are asked for."""
    views = SetReader(path)
    Pieces(progress, 1)()
    return VDISet(
        views,
        views.cameras,
        window_size=views.picture_size,
        bounds=views.all_bounds,
        about=views.about,
    )


def read_info(path: str | os.PathLike[str]) -> SeriesInfo:
    """Read what a .vdiset file says about itself: errors as for :func:`read`."""
    return SetReader(path).info()
