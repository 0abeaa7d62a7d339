"""What subcommands share: volumes, cameras and looks that they read, files, bars."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIFileError
from pyvista_vdi.io import check_writable, check_write_options, volumes
from pyvista_vdi.io.files import format_named, holds
from pyvista_vdi.io.stores import is_store
from pyvista_vdi.io.volumes.in_file import placed
from pyvista_vdi.model.arguments import Settings
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification, Look
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

_T = TypeVar("_T")

#: Options that say how a volume's file is read.
OF_VOLUMES = (
    *("scalars", "preference", "spacing", "origin", "level", "channel", "time_index", "series"),
)
#: Options that give colours and opacities.
LOOK = ("transfer_function", *Look.declared)
#: Options that say where the eye is, instead of turning the default view.
PLACE = ("camera_json", "position", "focal_point", "view_up", "parallel_scale")


def given(options: argparse.Namespace, *records: Any, flat: bool = False) -> dict[str, Any]:
    """Return the options of some records that were given, as arguments of public functions.

    What is seldom turned is in ``settings``, or ``flat`` beside the others.
    """
    named = {name for record in records for name in record.declared}
    found = {n: value for n, value in vars(options).items() if n in named and value is not None}
    seldom = {name: found.pop(name) for name in Settings.declared if name in found and not flat}
    return found | ({"settings": Settings(**seldom)} if seldom else {})


def classification(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that say how the volume looks; which array it is, the volume says.

    What cannot be is refused now, before the volume is read.
    """
    found = given(options, Look)
    path = getattr(options, "transfer_function", None)
    if path is not None:
        function = from_json(path, TransferFunction.from_dict, "transfer function")
        found["transfer_function"] = function
    Classification(**found)
    return found


def refuse(options: argparse.Namespace, names: Iterable[str], what: str) -> None:
    """Refuse options that were given and would mean nothing: they are for something else."""
    for name in names:
        value = getattr(options, name, None)
        if value is not None and value is not False:
            given = f"--{name.replace('_', '-')}={value}".removesuffix("=True")
            raise UnsupportedError(f"{given} is for {what}: leave it out")


def read_volume(options: argparse.Namespace, *, in_chunks: bool = False) -> Volume:
    """Return the volume that is named, with the scalars, the spacing and the origin asked for.

    A store is read whole, unless ``in_chunks``.
    """
    if options.example is not None:
        refuse(options, OF_VOLUMES[4:], "files that hold several volumes, and this is none")
        from pyvista_vdi import examples

        return _laid_out(examples.load_data(options.example, as_volume=True), options)
    if is_store(options.file):
        volume: Any = open_store(options)
        if len(volume.store.levels) > 1 and options.level in (None, "auto"):
            # Of another level they are others
            refuse(options, ("spacing", "origin"), "one level of a store, which --level chooses")
        volume = _laid_out(volume, options)
    else:
        array = options.scalars
        if array is not None and options.preference == "cell":
            of_cells = f"cell:{array}"  # where points have one of that name, too
            names = {each.name for each in volumes.list_volumes(options.file)}
            array = of_cells if of_cells in names else array
        names = {"series", "channel", "level", "spacing", "origin"}
        chosen = {name: getattr(options, name) for name in names}
        volume = volumes.read_volume(options.file, array=array, time=options.time_index, **chosen)
    if volume.chunked and not in_chunks:
        return volume.load()  # type: ignore[no-any-return]
    return volume  # type: ignore[no-any-return]


def _laid_out(volume: Any, options: argparse.Namespace) -> Volume:
    taken = as_volume(volume, options.scalars, options.preference or "point")
    return placed(taken, options.spacing, options.origin)


def open_store(options: argparse.Namespace) -> Any:
    """Open the store that is named, with what is asked of it."""
    chosen = {"level": options.level, "channel": options.channel, "time": options.time_index}
    return volumes.read_volume(options.file, **chosen)


def is_volume(options: argparse.Namespace) -> bool:
    """Whether FILE or ``--example`` names a volume, and not a VDI, a series or a set."""
    if options.example is not None:
        return True
    if holds(options.file) is None:
        return True
    refuse(options, OF_VOLUMES, f"volumes, and {printable(options.file)} is a VDI")
    return False


def volume_name(options: argparse.Namespace) -> str:
    """Return a short name of the volume, for files and reports."""
    if options.example is not None:
        return str(options.example)
    return Path(options.file).resolve().name.split(".")[0]


@contextmanager
def output_files(options: argparse.Namespace, stem: str, *kinds: str) -> Iterator[dict[str, Path]]:
    """Yield where ``--out`` has the files go, after finding that they can be written there.

    They are named when they are written. A folder that is made for them, and into which nothing is
    written, is gone again.
    """
    folder = Path(options.out)
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise VDIFileError(
            f"the folder {folder} cannot be made: {error.strerror}; choose another --out"
        ) from error
    try:
        files = {kind: check_writable(folder / f"{stem}.{kind}") for kind in kinds}
        yield files
    except BaseException:
        if made:
            with suppress(OSError):  # something is there
                folder.rmdir()
        raise
    print("Written: " + ", ".join(map(printable, files.values())))


def camera(options: argparse.Namespace, default: Camera) -> Camera:
    """Return the view that the camera options make of a default."""
    view = default
    if options.camera_json is not None:
        view = from_json(options.camera_json, Camera.from_dict, "camera")
    names = ("position", "focal_point", "view_up", "view_angle")
    changes = {n: getattr(options, n) for n in names if getattr(options, n) is not None}
    if options.parallel_scale is not None:
        changes |= {"parallel_scale": options.parallel_scale, "parallel_projection": True}
    elif options.view_angle is not None:
        changes["parallel_projection"] = False
    view = view.replace(**changes) if changes else view
    view = view.azimuth(options.azimuth) if options.azimuth else view
    return view.elevation(options.elevation) if options.elevation else view


def file_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of ``save`` that the options stand for; refused now, not later."""
    names = {"compression": "compression", "compression_level": "level", "precision": "precision"}
    found = {argument: getattr(options, name, None) for name, argument in names.items()}
    found = {argument: value for argument, value in found.items() if value is not None}
    written = format_named(options.output)
    if written and written.holds == "VDI":
        check_write_options(options.output, found)
    return found


def look_for(
    options: argparse.Namespace, found: Any, file: str, *, colors: bool = True
) -> dict[str, Any]:
    """Return the look that the options give what was read, where it stores scalars.

    Where it does not, a look is refused, and where ``colors`` are needed the lack of one.
    """
    named = printable(file)
    if getattr(found, "value_range", None) is None:
        refuse(options, LOOK, f"VDIs that store scalars, and {named} has its look")
        return {}
    look = classification(options)
    if colors and not look:
        raise UnsupportedError(
            f"{named} stores scalars, which have no colours yet: give --cmap, --opacity or "
            "--transfer-function"
        )
    return look


def from_json(path: str, build: Callable[[dict[str, Any]], _T], kind: str) -> _T:
    """Return what a file of JSON describes; ``kind`` says what that is."""
    try:
        return build(json.loads(Path(path).read_text(encoding="utf-8")))
    except OSError as error:
        raise InvalidArgumentError(
            f"the {kind} {path} cannot be read: {error.strerror or error}; check the file's name"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InvalidArgumentError(
            f"{path} is no {kind} in JSON ({error}): write one by json.dump(x.to_dict(), file)"
        ) from error
