"""Cinema databases of sets: a folder with a picture from each V_O, and their table.

By specification D, "Dietrich": a folder whose name ends in ``.cdb``, in it ``data.csv``, whose
first row names the columns, those of files last and their names beginning with ``FILE``.
"""

from __future__ import annotations

import csv
import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentTypeError, VDIFileError
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io.png import to_bytes, write_png
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_flag
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.metrics import check_background
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.whole_file import as_path, check_writable, with_suffix
from pyvista_vdi.quality.view_error import eye_from_centre
from pyvista_vdi.raycasting.multi_vdi import blended

SUFFIX = ".cdb"
_VECTORS = ("position", "focal_point", "view_up")


def write(
    vdi_set: VDISet,
    path: str | os.PathLike[str],
    *,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    vdis: bool = False,
    device: Any = None,
    progress: Progress | None = None,
) -> Path:
    """Write a Cinema database, specification D: a folder with ``data.csv`` and a picture per V_O.

    Cinema's viewers show it as a table of pictures, and one picture that is turned by sliders of
    its columns ``phi`` and ``theta``.

    Parameters
    ----------
    vdi_set : VDISet
        Its V_Os are the rows.
    path : path-like
        The folder, which must not exist; its name ends in ``.cdb``. It appears whole or not at all.
    background : (float, float, float)
        RGB that pictures are blended over, 0 to 1.
    vdis : bool
        Write each VDI as well, as a ``.vdi`` file, and name it in the column ``FILE_vdi``.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the finished fraction, 0 to 1; when it returns False, nothing is written.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    VDIFileError
        If it exists, or cannot be written.
    InvalidArgumentError
        If another argument cannot be used.

    Notes
    -----
    Columns: ``phi`` and ``theta``, the direction of the eye from the centre of the bounds in the
    model frame, degrees: the angle about z from x, -180 to 180, and that from z, 0 to 180;
    ``position_x`` to ``view_up_z`` and ``view_angle``, the camera; ``FILE``, the picture.
    """
    if not isinstance(vdi_set, VDISet):
        raise InvalidArgumentTypeError(
            f"vdi_set must be a VDISet, as of generate_set; got {type(vdi_set).__name__}"
        )
    target = with_suffix(as_path(path), (SUFFIX,), "a Cinema database")
    vdis = as_flag(vdis, "vdis")
    check_background(background)
    done = Pieces(progress, len(vdi_set))
    if os.path.lexists(target):
        raise VDIFileError(f"{target} exists: remove it, or choose another name")
    check_writable(target)
    try:
        with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
            made = Path(folder) / "made"
            (made / "image").mkdir(parents=True)
            rows = []
            for i, camera in enumerate(_lenses(vdi_set)):
                request = FrameRequest(camera, vdi_set.window_size, device=device)
                vdi = vdi_set[i]
                picture = to_bytes(blended([(vdi, 1.0)], request), background)
                files = {"FILE": f"image/{i:04}.png"}
                write_png(picture, made / files["FILE"])
                if vdis:
                    files["FILE_vdi"] = f"vdi/{i:04}.vdi"
                    (made / "vdi").mkdir(exist_ok=True)
                    vdi.save(made / files["FILE_vdi"], precision="8-byte", compression="zstd")
                rows.append({**_numbers(camera, vdi_set), **files})
                done()
            with (made / "data.csv").open("w", newline="", encoding="utf-8") as stream:
                table = csv.DictWriter(stream, rows[0], lineterminator="\n")
                table.writeheader()
                table.writerows(rows)
            made.rename(target)
    except OSError as error:
        raise VDIFileError(f"{target} cannot be written: {error.strerror or error}") from error
    return target


def _lenses(vdi_set: VDISet) -> list[Camera]:
    """Return the V_Os' views with one lens, in which all of the volume is in all pictures."""
    corners = np.column_stack([bounds_corners(vdi_set.bounds), np.ones(8)])
    width, height = vdi_set.window_size
    half = 0.0
    for camera in vdi_set.cameras:
        x, y, z = (corners @ camera.model_to_view.T)[:, :3].T
        if camera.parallel_projection:
            half = max(half, float(np.abs(y).max()), float(np.abs(x).max()) * height / width)
        elif z.min() > 0:
            half = max(
                half, float(np.abs(y / z).max()), float(np.abs(x / z).max()) * height / width
            )
    if half == 0:  # an eye within the volume: as it is
        return list(vdi_set.cameras)
    return [
        camera.replace(
            window_center=(0.0, 0.0),
            view_angle=2 * math.degrees(math.atan(half)),
            use_horizontal_view_angle=False,
            **({"parallel_scale": half} if camera.parallel_projection else {}),
        )
        for camera in vdi_set.cameras
    ]


def _numbers(camera: Camera, vdi_set: VDISet) -> dict[str, float]:
    (x, y, z), _ = eye_from_centre(camera, vdi_set.bounds, np.eye(3))
    numbers = {
        "phi": math.degrees(math.atan2(y, x)),
        "theta": math.degrees(math.atan2(math.hypot(x, y), z)),
    }
    for name in _VECTORS:
        for axis, value in zip("xyz", getattr(camera, name), strict=True):
            numbers[f"{name}_{axis}"] = value
    numbers["view_angle"] = camera.view_angle
    return {name: float(np.round(value, 9)) for name, value in numbers.items()}
