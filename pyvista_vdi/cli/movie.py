"""The verbs that write moving pictures: ``turntable`` and ``movie``."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pyvista_vdi.api import read, render, render_volume
from pyvista_vdi.cli.inputs import (
    OF_NO_LOOK,
    PLACE,
    camera,
    classification,
    from_json,
    is_volume,
    measuring,
    read_volume,
    refuse,
    with_look,
)
from pyvista_vdi.cli.steps import in_order
from pyvista_vdi.cli.text import mebibytes, printable
from pyvista_vdi.errors import InvalidArgumentError, MissingDependencyError, VDIError, VDIFileError
from pyvista_vdi.io import check_writable, to_bytes, write_png
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.standard_cases import WINDOW_SIZE, filling_camera
from pyvista_vdi.model.vdi import VDI, picture_view

Frame = NDArray[np.uint8]
#: Names of moving pictures, and of single ones with a place for the number.
_FILMS, _SUFFIXES = (".mp4", ".webm"), (".gif", ".mp4", ".webm", ".png")
#: Frames of a path, from one of its views to the next, if not said otherwise: four seconds.
_SECONDS_A_LEG = 4.0
#: Rates of a GIF: its times are hundredths of a second, of which browsers take 1 for 10.
_GIF_RATES = (0.01, 50.0)
#: Views further than this from V_O see what its VDI was not made for, degrees.
_SERVED = 60.0


def turntable(options: argparse.Namespace) -> int:
    """Turn what a file shows about the view's up direction, and write what is seen."""

    def views(first: Camera, _: int | None) -> list[Camera]:
        frames = options.frames or max(1, round(4 * options.fps))
        return [first.azimuth(options.degrees * k / frames) for k in range(frames)]

    return _write(options, views)


def movie(options: argparse.Namespace) -> int:
    """Play a series, or fly along a path of views, and write what is seen."""
    if options.path is not None and len(options.path) < 2:
        raise InvalidArgumentError("a path has two views at least: --path A.json B.json ...")
    if options.path is not None:
        turned = [name for name in ("azimuth", "elevation") if getattr(options, name)]
        refuse(options, (*PLACE, "view_angle", *turned), "movies without --path")
    files = in_order(options.path or ())
    keys = [from_json(file, Camera.from_dict, "camera") for file in files]
    if len({key.parallel_projection for key in keys}) > 1:
        raise InvalidArgumentError(
            "views of a path are all parallel or all perspective; got "
            + ", ".join(
                f"{printable(file)}: {'parallel' if key.parallel_projection else 'perspective'}"
                for file, key in zip(files, keys, strict=True)
            )
        )

    def views(first: Camera, steps: int | None) -> list[Camera]:
        if steps is None and not (keys or options.turn):
            raise InvalidArgumentError(
                f"{printable(options.file or options.example)} has one moment, and nothing moves: "
                "give a path (--path A.json B.json), a turn (--turn DEGREES), or a series, .vdis"
            )
        legs = max(len(keys) - 1, 1)
        frames = options.frames or steps or max(1, round(legs * _SECONDS_A_LEG * options.fps))
        along = np.linspace(0, 1, frames)
        path = camera_path(keys, along) if keys else [first] * frames
        return [view.azimuth(options.turn * s) for view, s in zip(path, along, strict=True)]

    return _write(options, views)


def camera_path(
    keys: Sequence[Camera], along: Sequence[float] | NDArray[np.float64]
) -> list[Camera]:
    """Return views on a smooth path through several, at shares of it from 0 to 1.

    The point looked at, the logarithm of the distance and the angle of view follow cubic splines;
    the orientation a spline of rotations whose angular acceleration is continuous. Views are passed
    at equal intervals of time.
    """
    try:
        from scipy.interpolate import CubicSpline
        from scipy.spatial.transform import Rotation, RotationSpline
    except ImportError as error:
        raise MissingDependencyError(
            f"a path needs SciPy ({error}): pip install 'pyvista-vdi[movie]'"
        ) from error
    knots = np.linspace(0, 1, len(keys))
    kind = "natural" if len(keys) > 2 else "clamped"
    focal = np.array([key.focal_point for key in keys])
    offsets = np.array([key.position for key in keys]) - focal
    distances = np.linalg.norm(offsets, axis=1)
    # Right, up and ahead are left-handed: what is behind makes them a rotation
    turned = Rotation.from_matrix([key.axes * [[1], [1], [-1]] for key in keys])
    lengths = np.column_stack(
        [
            np.log(distances),
            [key.view_angle for key in keys],
            np.log([k.parallel_scale for k in keys]),
        ]
    )
    at = np.asarray(along, np.float64)
    points = CubicSpline(knots, focal, bc_type=kind)(at)
    scalars = CubicSpline(knots, lengths, bc_type=kind)(at)
    axes = RotationSpline(knots, turned)(at).as_matrix()
    path = []
    for point, (distance, angle, scale), rows in zip(points, scalars, axes, strict=True):
        _, up, behind = rows
        path.append(
            keys[0].replace(
                position=point + behind * np.exp(distance),
                focal_point=point,
                view_up=up,
                view_angle=angle,
                parallel_scale=np.exp(scale),
            )
        )
    return path


def _write(options: argparse.Namespace, views: Callable[[Camera, int | None], list[Camera]]) -> int:
    """Draw each view and write all of them; the file appears whole or not at all."""
    target = _checked_target(options.output, options.fps)
    draw, own, steps, size = _shown(options)
    path = views(camera(options, own), steps)
    if target.suffix.lower() in _FILMS:
        # Films halve their colours' pixels
        size = (max(2, size[0] - size[0] % 2), max(2, size[1] - size[1] % 2))
    with (
        tempfile.TemporaryDirectory(prefix=".pyvista-vdi-", dir=target.parent) as folder,
        measuring("drawing") as bar,
    ):

        def frames() -> Iterator[Frame]:
            for k, view in enumerate(path):
                at = None if steps is None else k * steps // len(path)
                yield to_bytes(draw(view, size, at), options.background)
                bar((k + 1) / (len(path) + 1))

        try:
            written = _encoded(Path(folder), target, frames(), len(path), options.fps)
            size_on_disk = sum(file.stat().st_size for file in written)
            for file in written:
                file.replace(target.with_name(file.name))
        except OSError as error:  # a full disk, or an encoder that has ended
            if isinstance(error, VDIError):
                raise
            raise VDIFileError(f"{target} could not be written: {error}") from error
    name = target.name if len(written) == 1 else f"{written[0].name} to {written[-1].name}"
    print(
        f"{printable(name)}: {len(path)} frames of {size[0]} x {size[1]} pixels, "
        f"{len(path) / options.fps:.1f} s at {options.fps:g} a second, {mebibytes(size_on_disk)}"
    )
    return 0


def _shown(
    options: argparse.Namespace,
) -> tuple[Callable[[Camera, Any, int | None], Any], Camera, int | None, tuple[int, int]]:
    """Return what draws a view, at a step of a series; the first view, the steps, and the size."""
    if is_volume(options):
        looks, volume = classification(options), read_volume(options)
        size = options.size or WINDOW_SIZE
        return (
            lambda view, size, _: render_volume(volume, view, size, device=options.device, **looks),
            filling_camera(volume.bounds, size),
            None,
            size,
        )
    refuse(options, OF_NO_LOOK, "volumes", f"{printable(options.file)} is a VDI: ")
    found = with_look(options, read(options.file), options.file)
    in_time = isinstance(found, VDICollection) and found.times is not None
    steps = len(found) if in_time else None
    first = found[0] if in_time else found
    told: list[bool] = []

    def draw(view: Camera, size: Any, step: int | None) -> Any:
        vdi = found if step is None else found[step]
        if isinstance(vdi, VDI) and not told and _angle(vdi.camera, view) > _SERVED:
            told.append(True)
            print(
                f"Note: views more than {_SERVED:g} degrees from where a VDI was made are poor: "
                "write a set (pyvista-vdi set), or turn the volume itself",
                file=sys.stderr,
            )
        return render(vdi, view, size, device=options.device)

    own, size = picture_view(first)
    return draw, own, steps, options.size or size


def _angle(one: Camera, other: Camera) -> float:
    """Return the angle between two views' directions, degrees."""
    ahead, towards = (np.subtract(each.focal_point, each.position) for each in (one, other))
    cosine = ahead @ towards / (np.linalg.norm(ahead) * np.linalg.norm(towards))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def _checked_target(name: str, fps: float) -> Path:
    """Return the file to write, after finding that it can be, with so many frames a second."""
    target = Path(name)
    suffix = target.suffix.lower()
    numbered = suffix == ".png" and _numbered(target.name, 0) != _numbered(target.name, 1)
    if suffix not in _SUFFIXES or (suffix == ".png" and not numbered):
        raise InvalidArgumentError(
            f"{printable(name)} is no moving picture: a name ends in .gif, .mp4 or .webm; or it "
            "has a place for the number of a picture, frame_{:04d}.png"
        )
    if suffix == ".gif" and not _GIF_RATES[0] <= fps <= _GIF_RATES[1]:
        raise InvalidArgumentError(
            f"a .gif shows {_GIF_RATES[0]:g} to {_GIF_RATES[1]:g} frames a second; got --fps "
            f"{fps:g}: choose another, or write a .mp4"
        )
    if suffix in _FILMS:
        _film_writer()
    if suffix == ".png":
        return check_writable(target.with_name(_numbered(target.name, 0))).parent / target.name
    return check_writable(target)


def _numbered(name: str, number: int) -> str:
    try:
        return name.format(number)
    except (IndexError, KeyError, ValueError):
        return name


def _film_writer() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingDependencyError(
            f"a film needs imageio-ffmpeg ({error}): pip install 'pyvista-vdi[movie]'; a .gif "
            "needs nothing more"
        ) from error
    return imageio_ffmpeg.write_frames


def _encoded(folder: Path, target: Path, frames: Iterator[Frame], n: int, fps: float) -> list[Path]:
    """Write n frames into a folder, under the names that they are to have."""
    suffix = target.suffix.lower()
    if suffix == ".png":
        return [
            write_png(frame, folder / _numbered(target.name, k)) for k, frame in enumerate(frames)
        ]
    file = folder / target.name
    if suffix == ".gif":
        images = (Image.fromarray(frame) for frame in frames)
        ends = [round(100 * k / fps) for k in range(n + 1)]  # so that the whole lasts as long
        times = [10 * (end - begin) for begin, end in pairwise(ends)]
        next(images).save(file, "GIF", save_all=True, append_images=images, duration=times, loop=0)
        return [file]
    first = next(frames)
    height, width = first.shape[:2]
    codec = "libx264" if suffix == ".mp4" else "libvpx-vp9"
    writer = _film_writer()(
        str(file), (width, height), fps=fps, codec=codec, quality=8, macro_block_size=2
    )
    writer.send(None)
    try:
        for frame in chain([first], frames):
            writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()
    return [file]
