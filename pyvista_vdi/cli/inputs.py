"""What verbs share: volumes, cameras and looks that they read, files and bars that they show."""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from threading import Event, Thread
from typing import Any, TypeVar

from pyvista_vdi import registry
from pyvista_vdi.cli.text import mebibytes, plain_number, printable
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIFileError
from pyvista_vdi.io import check_writable, check_write_options, is_vdi_file, stores, volumes
from pyvista_vdi.io.files import format_named, holds
from pyvista_vdi.io.stores import StoredVolume, is_store
from pyvista_vdi.io.volumes import list_volumes
from pyvista_vdi.io.volumes.in_file import placed
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion
from pyvista_vdi.model.arguments import Settings
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Look
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import Deferral, declared
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.imports import import_pyvista
from pyvista_vdi.plotting.progress import DelayedBar
from pyvista_vdi.vtk_pipeline.vtk import BACKEND

_T = TypeVar("_T")

#: Seconds between two looks of a bar at the clock.
_PULSE = 0.5

#: Options that are arguments of the same name, given only if the user gave them.
CLASSIFICATION = tuple(declared(Look))

#: Options that say how a volume's file is read.
_OF_A_VOLUME = ("scalars", "preference", "spacing", "origin")

#: Options that say what is taken of a file or a store that holds several volumes.
OF_A_STORE = ("level", "channel", "time_index", "series")

#: Options that say what is read, and how a volume looks.
OF_NO_LOOK = (*_OF_A_VOLUME, *OF_A_STORE)
OF_ANY_VOLUME = (*OF_NO_LOOK, "tf", "transfer_function", *CLASSIFICATION)

#: Options that say where the eye is, instead of turning the default view.
PLACE = ("camera_json", "position", "focal_point", "view_up", "parallel_scale")


def read_volume(options: argparse.Namespace, *, in_chunks: bool = False) -> Volume:
    """Return the volume that is named, with the scalars, the spacing and the origin asked for.

    A store is read whole, unless ``in_chunks``.
    """
    if options.example is not None:
        refuse(options, OF_A_STORE, "files that hold several volumes, and this is none")
        from pyvista_vdi import examples

        return laid_out(examples.load_data(options.example, as_volume=True), options)
    if is_store(options.file):
        volume: Any = open_store(options)
        if len(volume.store.levels) > 1 and options.level in (None, "auto"):
            # Of another level they are others
            refuse(options, ("spacing", "origin"), "one level of a store, which --level chooses")
        return laid_out(volume if in_chunks else _loaded(volume), options)
    array = options.scalars
    if array is not None and options.preference == "cell":
        of_cells = f"cell:{array}"  # where points have one of that name, too
        names = {each.name for each in list_volumes(options.file)}
        array = of_cells if of_cells in names else array
    volume = volumes.read_volume(
        options.file,
        array=array,
        series=getattr(options, "series", None),
        channel=options.channel,
        time=options.time_index,
        level=options.level,
        spacing=options.spacing,
        origin=options.origin,
    )
    if volume.chunked and not in_chunks:
        volume = _loaded(volume)
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
    return stores.open_store(
        options.file,
        level="auto" if options.level is None else options.level,
        channel=0 if options.channel is None else options.channel,
        time=0 if options.time_index is None else options.time_index,
    )


def _loaded(volume: Volume) -> Volume:
    remedy = "take a coarser level by --level, or make a VDI of it (pyvista-vdi generate)"
    path = volume.store.path if isinstance(volume, StoredVolume) else volume.name
    require_free_memory(volume.array.nbytes, f"the volume in {path}", remedy)
    return volume.load()


def is_series(options: argparse.Namespace) -> bool:
    """Whether FILE names a series of VDIs."""
    return options.file is not None and holds(options.file) == "series"


def is_volume(options: argparse.Namespace) -> bool:
    """Whether FILE or ``--example`` names a volume, and not a VDI, a series or a set."""
    if options.example is not None:
        return True
    if not is_vdi_file(options.file) and holds(options.file) in (None, "VDI"):
        return True
    is_vdi = f"{printable(options.file)} is a VDI: "
    refuse(options, (*_OF_A_VOLUME, *OF_A_STORE), "volumes", is_vdi)
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


def refuse(options: argparse.Namespace, names: Iterable[str], what: str, why: str = "") -> None:
    """Refuse options that were given and would mean nothing: they are for something else."""
    for name in names:
        value = getattr(options, name, None)
        if value is not None and value is not False:
            raise UnsupportedError(f"{why}{as_option(name)} is for {what}: leave it out")


def volume_name(options: argparse.Namespace) -> str:
    """Return a short name of the volume, for files and reports."""
    if options.example is not None:
        return str(options.example)
    return Path(options.file).resolve().name.split(".")[0]


def classification(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that say how the volume looks; which array it is, the volume says."""
    given = dict(TRANSFER_FUNCTIONS[options.tf]) if options.tf else {}
    for name in CLASSIFICATION:
        if getattr(options, name, None) is not None:
            given[name] = getattr(options, name)
    path = getattr(options, "transfer_function", None)
    if path is not None:
        given["transfer_function"] = from_json(
            path, TransferFunction.from_dict, "transfer function"
        )
    return given


def settings(options: argparse.Namespace) -> Settings:
    """Return what is seldom turned, as far as there are options of it."""
    given = {name: getattr(options, name, None) for name in Settings.declared}
    return Settings(**{name: value for name, value in given.items() if value is not None})


def kept_values(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments that say what is kept where scalars are classified afterwards.

    What goes with none of that is refused, by the options' names.
    """
    given = {name: getattr(options, name) for name in declared(Deferral)}
    kept = {name: value for name, value in given.items() if value is not None}
    if kept.get("classification") == "deferred":
        _refuse_with_values(options)
    else:
        for name in [name for name in kept if name != "classification"]:
            separator = " " if name == "value_range" else ","
            values = separator.join(map(plain_number, kept[name]))
            raise InvalidArgumentError(
                f"{as_option(name)} {values} says what is kept to be classified afterwards: give "
                f"--classification deferred as well, or leave {as_option(name)} out"
            )
    return {name: value for name, value in kept.items() if name not in Settings.declared}


def _refuse_with_values(options: argparse.Namespace) -> None:
    """Refuse what VDIs that keep values cannot have, before a volume is read."""

    def given(*names: str) -> str:
        values = {name: getattr(options, name, None) for name in names}
        return ", ".join(as_option(n) for n, value in values.items() if value not in (None, False))

    found = format_named(options.output)
    if found is not None and not found.values and found.holds == "VDI":
        raise InvalidArgumentError(
            f"--classification deferred keeps values, and {found.suffix} files hold colours: write "
            "a .vdi file, of which 'pyvista-vdi convert' with --cmap makes one, or leave "
            "--classification out"
        )
    if given("shade"):
        raise UnsupportedError(
            "--shade needs the volume's gradients, which --classification deferred does not keep: "
            "leave out one of them"
        )
    look = given("tf", "transfer_function", *(n for n in CLASSIFICATION if n != "interpolation"))
    if look:
        raise InvalidArgumentError(
            f"--classification deferred keeps values, whatever their look: give {look} to "
            "'pyvista-vdi render', view or convert of what is written"
        )
    occlusion = given("ambient_occlusion", "occlusion_radius", "occlusion_strength")
    if occlusion:
        raise UnsupportedError(
            f"{occlusion}: ambient occlusion follows from opacities, which --classification "
            "deferred does not keep: leave it out"
        )
    if target := given("quality", "target_ssim", "full_fps", "max_bytes"):
        raise UnsupportedError(
            f"{target}: settings are chosen by a look, which --classification deferred does not "
            "have: give --max-supersegments"
        )


def as_option(name: str) -> str:
    """Return an argument's name as the command line has it."""
    return f"--{name.replace('_', '-')}"


def has_vtk(options: argparse.Namespace) -> bool:
    """Whether VTK's mappers take part; says so where they cannot."""
    if not options.no_vtk and find_spec(BACKEND) is None:
        print("VTK is not installed: its mappers are left out", file=sys.stderr)
        return False
    return not options.no_vtk


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

    pulsing = Thread(target=pulse, daemon=True)
    try:
        pulsing.start()
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


def ambient_occlusion(options: argparse.Namespace) -> AmbientOcclusion | None:
    """Return the ambient occlusion that the options ask for, if any."""
    values = {n: getattr(options, f"occlusion_{n}") for n in ("radius", "strength")}
    given = {n: value for n, value in values.items() if value is not None}
    return AmbientOcclusion(**given) if options.ambient_occlusion or given else None


def camera(options: argparse.Namespace, default: Camera) -> Camera:
    """Return the view that the camera options make of a default."""
    view = given_camera(options) or default
    names = ("position", "focal_point", "view_up", "view_angle")
    changes = {n: getattr(options, n) for n in names if getattr(options, n) is not None}
    if options.parallel_scale is not None:
        changes |= {"parallel_scale": options.parallel_scale, "parallel_projection": True}
    elif options.view_angle is not None:
        changes["parallel_projection"] = False
    if changes:
        view = view.replace(**changes)
    if options.azimuth:
        view = view.azimuth(options.azimuth)
    return view.elevation(options.elevation) if options.elevation else view


def given_camera(options: argparse.Namespace) -> Camera | None:
    """Return the view in the file that ``--camera-json`` names, if it was given."""
    if options.camera_json is None:
        return None
    return from_json(options.camera_json, Camera.from_dict, "camera")


#: Options that a file's writer takes as arguments; ``--level`` is that of a volume's store.
_FILE_ARGUMENTS = {
    "compression": "compression",
    "compression_level": "level",
    "precision": "precision",
}


def of_the_file(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of a file that were given."""
    given = {argument: getattr(options, name, None) for name, argument in _FILE_ARGUMENTS.items()}
    return {argument: value for argument, value in given.items() if value is not None}


def file_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the arguments of ``VDI.save`` that the options stand for; refused now, not later."""
    given, written = of_the_file(options), format_named(options.output)
    for name, argument in _FILE_ARGUMENTS.items():
        of = [each.suffix for each in registry.formats() if argument in each.write_options]
        if of and written is not None and argument not in written.write_options:
            refuse(options, (name,), f"{' and '.join(of)}, not {printable(options.output)}")
    check_write_options(options.output, given)
    return given


def keeps_values(found: Any) -> bool:
    """Whether what was read keeps values, so that a look can be given."""
    return getattr(found, "value_range", None) is not None


def with_look(options: argparse.Namespace, found: Any, file: str, *, colors: bool = True) -> Any:
    """Return what was read, classified as the options ask where it keeps values."""
    look = look_for(options, found, file, colors=colors)
    return found.classified(**look) if look else found


def look_for(
    options: argparse.Namespace, found: Any, file: str, *, colors: bool = True
) -> dict[str, Any]:
    """Return the look that the options give what was read, where it keeps values.

    Where it does not, a look is refused, and where ``colors`` are needed the lack of one.
    """
    if keeps_values(found):
        look = classification(options)
        if colors and not look:
            raise UnsupportedError(
                f"{printable(file)} keeps values, which have no colours yet: give --cmap, "
                "--opacity, --tf or --transfer-function"
            )
        return look
    for name in ("tf", "transfer_function", *CLASSIFICATION):
        value = getattr(options, name, None)
        if value is not None:
            text = " ".join(map(str, value)) if isinstance(value, list | tuple) else value
            raise UnsupportedError(
                f"{printable(file)} has its look, and {as_option(name)} {text} is for "
                "VDIs that keep values: leave it out"
            )
    return {}


def say_vdi(options: argparse.Namespace, vdi: VDI | DeferredVDI, more: str = "") -> None:
    """Print what was written to ``--output``."""
    width, height = vdi.window_size
    print(
        f"{printable(options.output)}: {vdi.n_supersegments} supersegments in {width} x {height} "
        f"lists, {mebibytes(Path(options.output).stat().st_size)}{more}"
    )


def has_own_place(options: argparse.Namespace) -> bool:
    """Whether the options say where the eye is, instead of turning the default view."""
    return any(getattr(options, name) is not None for name in PLACE)


def from_json(path: str, build: Callable[[dict[str, Any]], _T], kind: str) -> _T:
    """Return what a file of JSON describes; ``kind`` says what that is."""
    try:
        state = json.loads(Path(path).read_text(encoding="utf-8"))
        return build(state)
    except OSError as error:
        raise InvalidArgumentError(
            f"the {kind} {path} cannot be read: {error.strerror or error}; check the file's name"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InvalidArgumentError(
            f"{path} is no {kind} in JSON ({error}): write one by json.dump(x.to_dict(), file)"
        ) from error
