"""The subcommands that write moving pictures: ``turntable`` and ``movie``."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from pyvista_vdi.api import read, render, render_volume
from pyvista_vdi.cli import inputs
from pyvista_vdi.cli.steps import in_order
from pyvista_vdi.cli.text import mebibytes, printable
from pyvista_vdi.errors import InvalidArgumentError, MissingDependencyError, VDIFileError
from pyvista_vdi.io import check_writable, to_bytes
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.standard_cases import WINDOW_SIZE, filling_camera
from pyvista_vdi.model.vdi import picture_view
from pyvista_vdi.model.whole_file import with_suffix


def turntable(options: argparse.Namespace) -> int:
    """Turn what a file shows about the view's up direction, and write what is seen."""
    n = options.frames or max(1, round(4 * options.fps))
    return _write(options, lambda v, _: [v.azimuth(options.degrees * k / n) for k in range(n)])


def movie(options: argparse.Namespace) -> int:
    """Play a series, or fly along a path of views, and write what is seen."""
    if options.path is not None:
        turned = [name for name in ("azimuth", "elevation") if getattr(options, name)]
        inputs.refuse(options, (*inputs.PLACE, "view_angle", *turned), "movies without --path")
    keys = [inputs.from_json(f, Camera.from_dict, "camera") for f in in_order(options.path or ())]

    def views(first: Camera, steps: int | None) -> list[Camera]:
        if not (len(keys) > 1 or options.turn or steps):
            raise InvalidArgumentError("nothing moves: give --path two views or more, --turn")
        # A path takes four seconds from one of its views to the next
        frames = options.frames or steps or max(1, round(max(len(keys) - 1, 1) * 4 * options.fps))
        along, path = np.linspace(0, 1, frames), [first] * frames
        if keys:  # VTK's spline through them
            from pyvista_vdi.vtk_pipeline import vtk
            from pyvista_vdi.vtk_pipeline.filters.view import aim

            spline, seen = vtk.vtkCameraInterpolator(), vtk.vtkCamera()
            for share, key in zip(np.linspace(0, 1, len(keys)), keys, strict=True):
                aim(seen, key)
                spline.AddCamera(share, seen)
            for k, share in enumerate(along):
                spline.InterpolateCamera(share, seen)
                path[k] = Camera.from_any(seen, model_transform=keys[0].model_transform)
        return [view.azimuth(options.turn * s) for view, s in zip(path, along, strict=True)]

    return _write(options, views)


def _write(options: argparse.Namespace, views: Callable[[Camera, int | None], list[Camera]]) -> int:
    """Draw each view and write all of them; the file appears whole or not at all."""
    film = {"fps": options.fps, "macro_block_size": 2, "ffmpeg_log_level": "error"}
    gif = {"duration": 1000 / options.fps, "loop": 0}
    kinds: Any = {".gif": gif, ".mp4": film, ".webm": film | {"codec": "libvpx-vp9"}}
    target = check_writable(with_suffix(Path(options.output), (*kinds,), "a moving picture"))
    steps, how = None, {"device": options.device}
    draw: Any = render_volume if inputs.is_volume(options) else render
    if draw is render:
        shown: Any = read(options.file)
        if look := inputs.look_for(options, shown, options.file):
            shown = shown.classified(**look)
        steps = None if getattr(shown, "times", None) is None else len(shown)
        first, size = picture_view(shown if steps is None else shown[0])
    else:
        how |= inputs.classification(options)
        shown, size = inputs.read_volume(options), options.size or WINDOW_SIZE
        first = filling_camera(shown.bounds, size)
    pixels = [max(2, n - n % 2) for n in options.size or size]  # films need even numbers
    path = views(inputs.camera(options, first), steps)
    with tempfile.TemporaryDirectory(prefix=".pyvista-vdi-", dir=target.parent) as folder:
        file = Path(folder) / target.name
        try:
            from imageio import get_writer  # as PyVista's open_movie

            writer = get_writer(file, **kinds[target.suffix.lower()])
        except (ImportError, ValueError) as error:  # ValueError: it lacks what encodes
            raise MissingDependencyError(f"{error}: pip install 'pyvista-vdi[movie]'") from error
        for k, view in enumerate(tqdm(path, "drawing", leave=False, disable=None)):
            now = shown if steps is None else shown[k * steps // len(path)]
            writer.append_data(to_bytes(draw(now, view, pixels, **how), options.background))
        writer.close()
        if not (written := file.stat().st_size):  # an encoder fails silently
            raise VDIFileError(f"{target} could not be written by its encoder")
        file.replace(target)
    print(
        f"{printable(target.name)}: {len(path)} frames of {pixels[0]} x {pixels[1]} pixels, "
        f"{len(path) / options.fps:.1f} s at {options.fps:g} a second, {mebibytes(written)}"
    )
    return 0
