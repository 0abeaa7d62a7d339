"""Files of sets: ``.vdiset``, and pages that show one."""

from __future__ import annotations

import os

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.series.archive import Archive
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISet:
    """Read a set; its VDIs are read when they are asked for."""
    vdis = Archive(path, VDISet.kind)
    try:
        vdi_set = VDISet(
            vdis,
            [Camera.from_dict(view) for view in vdis.about["views"]],
            camera=Camera.from_dict(vdis.about["camera"]),
            window_size=vdis.about["picture_size"],
            bounds=vdis.about["bounds"],
        )
    except (VDIError, KeyError, TypeError, ValueError) as error:
        vdis.refuse(f"its {VDISet.kind.head} is incomplete or wrong ({error!r})")
    Pieces(progress, 1)()
    return vdi_set


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a set says about itself, without its arrays: errors as for :func:`read`."""
    return Archive(path, VDISet.kind).info()
