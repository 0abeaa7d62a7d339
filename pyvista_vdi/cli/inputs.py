"""What subcommands share: volumes, cameras and looks that they read, files, bars."""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any, TypeVar

from pyvista_vdi import registry
from pyvista_vdi.cli.text import mebibytes, plain_number, printable
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIFileError
from pyvista_vdi.io import check_writable, check_write_options, is_vdi_file, stores, volumes
from pyvista_vdi.io.files import format_named, holds
from pyvista_vdi.io.stores import StoredVolume, is_store
from pyvista_vdi.io.volumes.in_file import placed
from pyvista_vdi.model.arguments import Settings
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Look
from pyvista_vdi.model.host_memory import require_host_memory
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import QualityTarget, declared
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.imports import import_pyvista
from pyvista_vdi.plotting.progress import DelayedBar

_T = TypeVar("_T")

#: Seconds between two looks of a bar at the clock.
_PULSE = 0.5
#: Options that say what is taken of a file or a store that holds several volumes.
OF_SEVERAL = ("level", "channel", "time_index", "series")
#: Options that say how a volume's file is read.
OF_VOLUMES = ("scalars", "preference", "spacing", "origin", *OF_SEVERAL)
#: Options that give colours and opacities.
LOOK = ("tf", "transfer_function", *declared(Look))
#: Options that say where the eye is, instead of turning the default view.
PLACE = ("camera_json", "position", "focal_point", "view_up", "parallel_scale")
_SHADING = ("shade", "ambient", "diffuse", "specular", "specular_power")


def given(options: argparse.Namespace, *records: Any, flat: bool = False) -> dict[str, Any]:
    """Return the options of some records that were given, as arguments of public functions.

    What is seldom turned is in ``settings``, or ``flat`` beside the others.
    """
    values = {name: getattr(options, name, None) for name in declared(*records)}
    found = {name: value for name, value in values.items() if value is not None}
    seldom = {name: found.pop(name) for name in Settings.declared if name in found and not flat}
    return found | ({"settings": Settings(**seldom)} if seldom else {})


def classification(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that say how the volume looks; which array it is, the volume says."""
    found = {**(TRANSFER_FUNCTIONS[options.tf] if options.tf else {}), **given(options, Look)}
    path = getattr(options, "transfer_function", None)
    if path is not None:
        function = from_json(path, TransferFunction.from_dict, "transfer function")
        found["transfer_function"] = function
    return found


def refuse_with_values(options: argparse.Namespace) -> None:
    """Refuse, before a volume is read, what does not go with when scalars are classified."""
    if options.classification != "deferred":
        refuse(options, ("value_range",), "--classification deferred")
        return
    why = "--classification deferred keeps values, which have no colours yet: "
    found = format_named(options.output)
    if found is not None and not found.values and found.holds == "VDI":
        raise InvalidArgumentError(f"{why}write a .vdi file in place of {found.suffix}")
    names = (*_SHADING, *declared(QualityTarget))
    refuse(options, names, "VDIs that have colours", why)
    looks = [name for name in LOOK if name != "interpolation"]
    refuse(options, looks, "'pyvista-vdi render', view or convert of what is written", why)


def refuse(options: argparse.Namespace, names: Iterable[str], what: str, why: str = "") -> None:
    """Refuse options that were given and would mean nothing: they are for something else."""
    for name in names:
        value = getattr(options, name, None)
        if value is not None and value is not False:
            values = value if isinstance(value, list | tuple) else [value] * (value is not True)
            shown = [v if isinstance(v, str) else plain_number(v) for v in values]
            option = " ".join([f"--{name.replace('_', '-')}", *shown])
            raise UnsupportedError(f"{why}{option} is for {what}: leave it out")


def read_volume(options: argparse.Namespace, *, in_chunks: bool = False) -> Volume:
    """Return the volume that is named, with the scalars, the spacing and the origin asked for.

    A store is read whole, unless ``in_chunks``.
    """
    if options.example is not None:
        refuse(options, OF_SEVERAL, "files that hold several volumes, and this is none")
        from pyvista_vdi import examples

        return laid_out(examples.load_data(options.example, as_volume=True), options)
    if is_store(options.file):
        volume: Any = open_store(options)
        if len(volume.store.levels) > 1 and options.level in (None, "auto"):
            # Of another level they are others
            refuse(options, ("spacing", "origin"), "one level of a store, which --level chooses")
        volume = laid_out(volume, options)
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
        remedy = "take a coarser level by --level, or make a VDI of it (pyvista-vdi generate)"
        require_host_memory(volume.array.nbytes, f"the volume in {options.file}", remedy, free=True)
        volume = volume.load()
    return volume  # type: ignore[no-any-return]


def laid_out(volume: Any, options: argparse.Namespace) -> Volume:
    """Return a volume with the scalars, the spacing and the origin asked for."""
    taken = as_volume(volume, options.scalars, options.preference or "point")
    return placed(taken, options.spacing, options.origin)


@contextmanager
def quietly() -> Iterator[None]:
    """Silence VTK's readers: the error says what is wrong."""
    before = logging.root.manager.disable
    logging.disable(logging.ERROR)
    try:
        with import_pyvista().vtk_verbosity("off"):
            yield
    finally:
        logging.disable(before)


def open_store(options: argparse.Namespace) -> StoredVolume:
    """Open the store that is named, with what is asked of it."""
    asked = {"level": options.level, "channel": options.channel, "time": options.time_index}
    chosen: Any = {name: value for name, value in asked.items() if value is not None}
    return stores.open_store(options.file, **chosen)


def is_volume(options: argparse.Namespace) -> bool:
    """Whether FILE or ``--example`` names a volume, and not a VDI, a series or a set."""
    if options.example is not None:
        return True
    if not is_vdi_file(options.file) and holds(options.file) in (None, "VDI"):
        return True
    refuse(options, OF_VOLUMES, "volumes", f"{printable(options.file)} is a VDI: ")
    return False


def require_vdi(file: str, verb: str) -> None:
    """Refuse a volume where a VDI is wanted, and say how the command makes one."""
    named = printable(file)
    if not (is_vdi_file(file) or is_store(file) or os.path.exists(file)):  # noqa: PTH110 - too long
        raise VDIFileError(f"{named} does not exist: check the file's name")
    if not is_vdi_file(file) and holds(file) not in ("series", "set"):
        raise UnsupportedError(
            f"{named} is no VDI, which is what {verb} takes; of a volume, 'pyvista-vdi generate "
            f"{named} -o FILE.vdi' makes one"
        )


def volume_name(options: argparse.Namespace) -> str:
    """Return a short name of the volume, for files and reports."""
    if options.example is not None:
        return str(options.example)
    return Path(options.file).resolve().name.split(".")[0]


@contextmanager
def output_files(options: argparse.Namespace, stem: str, *kinds: str) -> Iterator[dict[str, Path]]:
    """Yield where ``--out`` has the files go, after finding that they can be written there.

    A folder that is made for them, and into which nothing is written, is gone again.
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
        yield {kind: check_writable(folder / f"{stem}.{kind}") for kind in kinds}
    except BaseException:
        if made:
            with suppress(OSError):  # something is there
                folder.rmdir()
        raise


@contextmanager
def measuring(label: str) -> Iterator[DelayedBar]:
    """Show a bar that is alive."""
    bar, finished = DelayedBar(label=label), Event()

    def pulse() -> None:
        while not finished.wait(_PULSE):
            bar.pulse()

    Thread(target=pulse, daemon=True).start()
    try:
        yield bar
    finally:
        finished.set()
        bar.close()


def part(bar: DelayedBar, first: float, last: float, doing: str) -> Callable[[float], None]:
    """Return what shows a part of the work on its part of a bar."""
    bar(first, doing)
    return lambda fraction: bar(first + fraction * (last - first), doing)


def say_written(files: Iterable[Path]) -> None:
    """Name the files that were written."""
    print("Written: " + ", ".join(printable(path) for path in files))


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
    written = format_named(options.output)
    for name, argument in names.items():
        of = [each.suffix for each in registry.formats() if argument in each.write_options]
        if of and written and written.holds == "VDI" and argument not in written.write_options:
            refuse(options, (name,), f"{' and '.join(of)}, not {printable(options.output)}")
    found = {argument: getattr(options, name, None) for name, argument in names.items()}
    found = {argument: value for argument, value in found.items() if value is not None}
    if written and written.holds == "VDI":
        check_write_options(options.output, found)
    return found


def keeps_values(found: Any) -> bool:
    """Whether what was read keeps values, so that a look can be given."""
    return getattr(found, "value_range", None) is not None


def look_for(
    options: argparse.Namespace, found: Any, file: str, *, colors: bool = True
) -> dict[str, Any]:
    """Return the look that the options give what was read, where it keeps values.

    Where it does not, a look is refused, and where ``colors`` are needed the lack of one.
    """
    named = printable(file)
    if not keeps_values(found):
        refuse(options, LOOK, "VDIs that keep values", f"{named} has its look, and ")
        return {}
    look = classification(options)
    if colors and not look:
        raise UnsupportedError(
            f"{named} keeps values, which have no colours yet: give --cmap, --opacity, --tf or "
            "--transfer-function"
        )
    return look


def say_vdi(options: argparse.Namespace, vdi: Any, more: str = "") -> None:
    """Print what was written to ``--output``."""
    width, height = vdi.window_size
    print(
        f"{printable(options.output)}: {vdi.n_supersegments} supersegments in {width} x {height} "
        f"lists, {mebibytes(Path(options.output).stat().st_size)}{more}"
    )


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
