"""Files of sets: ``.vdiset``, and pages that show one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.series import archive
from pyvista_vdi.extensions.series.archive import Archive
from pyvista_vdi.extensions.sets import EXTENSION
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera

SET = EXTENSION.formats[0]


def save(vdi_set: VDISet, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write one file with a set, or a page that shows it: see :meth:`VDISet.save`."""
    return archive.save(vdi_set, path, SET, about(vdi_set), **options)


def about(vdi_set: VDISet) -> dict[str, Any]:
    """Return what the JSON of a set says."""
    return {
        "views": [view.to_dict() for view in vdi_set.cameras],
        "camera": vdi_set.camera.to_dict(),
        "picture_size": list(vdi_set.window_size),
        "bounds": list(vdi_set.bounds),
    }


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISet:
    """Read a set; its VDIs are read when they are asked for."""
    vdis = Archive(path, SET)
    try:
        vdi_set = VDISet(
            vdis,
            [Camera.from_dict(view) for view in vdis.about["views"]],
            camera=Camera.from_dict(vdis.about["camera"]),
            window_size=vdis.about["picture_size"],
            bounds=vdis.about["bounds"],
        )
    except (VDIError, KeyError, TypeError, ValueError) as error:
        vdis.refuse(f"its {SET.head} is incomplete or wrong ({error!r})")
    Pieces(progress, 1)()
    return vdi_set


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a set says about itself, without its arrays: errors as for :func:`read`."""
    return Archive(path, SET).info()
