"""The verbs and their options; imports nothing but the standard library and plain constants."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Sequence
from typing import Any, NoReturn

from pyvista_vdi import registry
from pyvista_vdi._version import __version__
from pyvista_vdi.cli import declare
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import ANGLES, ELEVATION, WINDOW_SIZE

_DESCRIPTION = "Volumetric Depth Images: generate, render, view and compare them."


#: What the command says without a verb.
_LESSON = f"""{_DESCRIPTION} Version {__version__}.

A first session, with a volume that is shipped:

  pyvista-vdi generate --example brain --tf soft -o brain.vdi     make a VDI
  pyvista-vdi view brain.vdi                                      turn it in a window
  pyvista-vdi render brain.vdi -o brain.png --azimuth 20          or a picture from elsewhere
  pyvista-vdi convert brain.vdi -o brain.html                     or a page that turns it
  pyvista-vdi turntable --example brain --tf soft -o brain.gif    or a moving picture

With your own, a file or a folder of DICOM slices:

  pyvista-vdi generate scans/head -o head.vdi --cmap ct-bone

pyvista-vdi --help lists all verbs, pyvista-vdi generate --help explains one, and
pyvista-vdi devices says on what it runs.
"""

#: So many names are listed where none of them is meant; more are left to ``--help``.
_LISTED = 16


class UsageError(Exception):
    """A mistake in the arguments; the message says which and what is right."""


class _Parser(argparse.ArgumentParser):
    """An argument parser that raises instead of leaving the process, and says one line."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def parse(arguments: list[str]) -> argparse.Namespace | None:
    """Parse the command line.

    Parameters
    ----------
    arguments : list of str
        Without the program's name.

    Returns
    -------
    argparse.Namespace or None
        Options, and ``run``, the verb's function; ``None`` if help or the version was asked for.

    Raises
    ------
    UsageError
        If they make no sense; the message suggests what may have been meant.
    """
    parser, verbs = _make_parser(arguments[0] if arguments else "")
    if not arguments:
        print(_LESSON, end="")
        return None
    if not arguments[0].startswith("-") and arguments[0] not in verbs:
        raise UsageError(
            f"there is no verb {arguments[0]!r}: {_suggestion(arguments[0], list(verbs))}"
        )
    if arguments[0] in verbs:
        _check_option_names(verbs[arguments[0]], arguments[1:])
    try:
        options, unknown = parser.parse_known_args(arguments)
    except SystemExit:  # after --help and --version
        return None
    if unknown:
        _refuse_argument(verbs[options.verb], unknown[0])
    return options


def _check_option_names(verb: _Parser, arguments: Sequence[str]) -> None:
    """Name an unknown option before argparse takes the value behind it for a file."""
    for argument in arguments[: arguments.index("--") if "--" in arguments else None]:
        name = argument.split("=")[0]
        if name.startswith("--") and name not in _option_names(verb):
            _refuse_argument(verb, argument)


def _option_names(verb: _Parser) -> list[str]:
    return [name for name in verb._option_string_actions if name.startswith("--")]


def _refuse_argument(verb: _Parser, argument: str) -> NoReturn:
    hint = f"; see {verb.prog} --help"
    if argument.startswith("-"):
        hint = f": {_suggestion(argument.split('=')[0], _option_names(verb))}"
    raise UsageError(f"{verb.prog.split()[-1]} takes no argument {argument!r}{hint}")


def run_verb(options: argparse.Namespace) -> int:
    """Import the verb's module, which brings what it needs, and run it."""
    verb = registry.load(options.place)
    if getattr(options, "device", None) is not None:
        from pyvista_vdi.device import get_runtime

        get_runtime(options.device)  # a wrong name is said before minutes of reading
    return int(verb(options))


def _suggestion(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    if near:
        return f"did you mean {near[0]!r}?"
    names = list(dict.fromkeys(known))
    return f"known are {', '.join(names)}" if len(names) <= _LISTED else "see --help"


def _make_parser(asked: str) -> tuple[_Parser, dict[str, _Parser]]:
    """Return the parser and those of all verbs, of which only the one that is asked has options."""
    parser = _Parser(
        prog="pyvista-vdi",
        description=_DESCRIPTION,
        epilog="Each verb explains itself: pyvista-vdi generate --help",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"pyvista-vdi {__version__}")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    verbs: dict[str, _Parser] = {}
    added = registry.verbs()
    known = {name: verb[1:] for name, verb in _VERBS.items()} | {
        name: (verb.summary, verb.example, None) for name, verb in added.items()
    }
    for name, (summary, example, add_options) in known.items():
        verbs[name] = subparsers.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"Example:\n  {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        if name == asked:
            (add_options or registry.load(added[name].options))(verbs[name])
        of_core = f"{__package__}.{_VERBS[name][0]}:{name}" if name in _VERBS else None
        verbs[name].set_defaults(run=run_verb, place=of_core or added[name].run)
    return parser, verbs


def _add_devices(parser: argparse.ArgumentParser) -> None:
    declare.switch(parser, "--json", "print JSON")


def _add_info(parser: argparse.ArgumentParser) -> None:
    declare.vdi_or_volume(parser)
    declare.array(parser)
    declare.switch(parser, "--json", "print JSON, with all metadata")


def _add_generate(parser: argparse.ArgumentParser) -> None:
    declare.volume(parser)
    declare.output(parser)
    declare.size(parser, WINDOW_SIZE)
    declare.camera(
        parser, f"the view that the volume fills, {ELEVATION:g} degrees above its middle"
    )
    declare.classification(parser)
    declare.occlusion(parser)
    declare.limits(parser)
    declare.dial(parser)
    declare.file_format(parser)
    declare.scheduler(parser)
    declare.device(parser)


def _add_convert(parser: argparse.ArgumentParser) -> None:
    declare.vdi_file(parser)
    declare.output(parser)
    declare.file_format(parser)
    group = parser.add_argument_group("deep images of other programs")
    view = "the view that the image shows, where it does not say it: Camera.to_dict() as JSON"
    declare.option(group, "--camera-json", view, "FILE")
    thickness = "world units, given to samples that have none (surfaces)"
    declare.option(group, "--thickness", thickness, "LENGTH", declare.parse_number)
    declare.switch(group, "--from-linear", "the colours are linear light: show it by sRGB's curve")


def _add_render(parser: argparse.ArgumentParser) -> None:
    declare.option(
        parser,
        "files",
        f"{declare.VDI_FILE}; several are merged by depth, each where it was generated, and the "
        "view and the size are those of the first unless they are given",
        "FILE",
        nargs="+",
    )
    declare.output(parser, ".png to write")
    declare.size(parser, None)
    declare.option(
        parser,
        "--background",
        "blend over this: a name, #rrggbb or R,G,B from 0 to 1; otherwise the picture is "
        "transparent where the volume is",
        "COLOR",
        declare.parse_color,
    )
    declare.option(
        parser,
        "--transmittance-cutoff",
        "end rays where less than this is left, 0 to below 1 (0.000001): what a channel may "
        "lose; VTK's mappers stop at about 0.004. For a single file",
        "LIGHT",
        declare.parse_number,
    )
    declare.time(parser)
    declare.camera(parser, "the VDI's generating view")
    declare.device(parser)


def _add_view(parser: argparse.ArgumentParser) -> None:
    declare.vdi_or_volume(parser)
    declare.size(parser, None)
    declare.option(parser, "--screenshot", "write this .png, open no window", "FILE")
    group = parser.add_argument_group("series", "The space bar plays and pauses, a slider seeks.")
    declare.switch(group, "--play", "begin to play at once")
    text = "steps per second; what is not ready when its time comes is left out (default: 24)"
    declare.option(group, "--rate", text, "RATE", declare.parse_frames_per_second)
    declare.time(group)
    group = parser.add_argument_group("while the view moves")
    rate = "frames per second to keep, by fewer pixels; 0: every frame is full (default: 30)"
    declare.option(group, "--target-fps", rate, "RATE", declare.parse_rate, default=30.0)
    declare.option(
        group,
        "--regenerate",
        "auto (default): where the view is beyond what the VDI was made to serve, make another of "
        "the volume, or say it once of a VDI that was opened without; never: take it as it is",
        choices=("auto", "never"),
        default="auto",
    )
    declare.option(
        group,
        "--draw",
        "what is raycast of a volume: vdi, volume, or auto (default): what is expected to give the "
        "better picture within the frame rate",
        choices=("auto", "vdi", "volume"),
        default="auto",
    )
    declare.switch(
        group,
        "--status",
        "show in a corner how it is drawn: pixels, frames per second, angle from the "
        "generating view",
    )
    declare.classification(parser, tables=False)
    declare.device(parser)


def _add_frames(parser: argparse.ArgumentParser, frames: str) -> None:
    declare.vdi_or_volume(parser)
    declare.output(
        parser,
        ".gif to write; or .mp4, .webm (pip install 'pyvista-vdi[movie]'); or pictures, "
        "frame_{:04d}.png",
    )
    declare.size(parser, None)
    declare.option(
        parser,
        "--background",
        "a name, #rrggbb or R,G,B from 0 to 1 (default: black)",
        "COLOR",
        declare.parse_color,
        default=(0.0, 0.0, 0.0),
    )
    declare.option(parser, "--frames", frames, "N", declare.parse_count)
    text = "frames per second (default: 25)"
    declare.option(parser, "--fps", text, "RATE", declare.parse_frames_per_second, default=25.0)


def _add_turntable(parser: argparse.ArgumentParser) -> None:
    _add_frames(parser, "of the whole turn (default: four seconds of them)")
    text = "turn by so many in all, about the view's up direction (default: 360)"
    declare.option(parser, "--degrees", text, "DEGREES", declare.parse_number, default=360.0)
    declare.camera(parser, "the first view is the VDI's own, or one that the volume fills")
    declare.classification(parser)
    declare.device(parser)


def _add_movie(parser: argparse.ArgumentParser) -> None:
    _add_frames(
        parser,
        "in all (default: a series has one for each step, a path four seconds of them from one "
        "view to the next)",
    )
    text = "views to fly along, each Camera.to_dict() as JSON; two at least"
    declare.option(parser, "--path", text, "FILE", nargs="+")
    text = "turn by so many meanwhile, about the view's up direction (default: 0)"
    declare.option(parser, "--turn", text, "DEGREES", declare.parse_number, default=0.0)
    declare.camera(parser, "the first view is the VDI's own, or one that the volume fills")
    declare.classification(parser)
    declare.device(parser)


def _add_compare(parser: argparse.ArgumentParser) -> None:
    front = (
        "our ways to draw against VTK's, by time and SSIM, for every known volume at hand, "
        "transfer function and view: hours"
    )
    declare.volume(parser, ("--front", front))
    declare.switch(parser, "--quick", "of --front: 24 cases of two shipped volumes, minutes")
    declare.switch(parser, "--resume", "of --front: go on with front.json where it was left")
    declare.option(parser, "--out", "where the files go", "FOLDER", default=".")
    declare.size(parser, WINDOW_SIZE)
    declare.angles(
        parser, f"degrees from V_O (default: {','.join(f'{a:g}' for a in ANGLES)})", ANGLES
    )
    declare.repeats(parser, "timed frames of each kind (default: 3)", 3, metavar=None)
    declare.no_vtk(parser)
    declare.classification(parser, tables=False)
    declare.longest(parser)
    declare.option(
        parser,
        "--precision",
        "of the supersegments: exact (default, 24 bytes each), 16-byte or 8-byte",
        choices=PRECISIONS,
        default="exact",
    )
    declare.option(
        parser,
        "--compression",
        "of the .vdi: lz4 (default), zstd, deflate or none",
        choices=("lz4", "zstd", "deflate", "none"),
        default="lz4",
    )
    declare.step(parser)
    declare.device(parser)


def _add_benchmark(parser: argparse.ArgumentParser) -> None:
    declare.option(
        parser,
        "--profile",
        "quick (default): small volumes, minutes; full: the paper's sizes and all volumes at "
        "hand, hours; gpu: the paper's cells, frames that stay on the device, too, minutes on a "
        "data centre's GPU",
        choices=("quick", "full", "gpu"),
        default="quick",
    )
    declare.option(
        parser,
        "--out",
        ".json to write; the tables (.md) go beside it (default: benchmark.json)",
        "FILE",
        default="benchmark.json",
    )
    declare.switch(parser, "--resume", "go on with FILE where it was left")
    group = parser.add_argument_group("what is measured", "In place of the profile's.")
    declare.option(
        group,
        "--datasets",
        "volumes known by name, and kingsnake_like, beechnut_like, richtmyer_meshkov_like: "
        "made at the paper's sizes, or with @4 behind the name at a quarter along each edge",
        "NAME",
        nargs="+",
    )
    declare.option(
        group,
        "--volume",
        "a file, may be repeated; a NAME of kingsnake, beechnut or richtmyer_meshkov says "
        "that it is the paper's; raw files are named like x_1024x1024x795_uint8.raw",
        "[NAME=]FILE",
        action="append",
    )
    declare.option(group, "--sizes", "windows, pixels", "WxH", declare.parse_size, nargs="+")
    declare.option(group, "--max-supersegments", None, "N", declare.parse_count, nargs="+")
    declare.angles(group, "degrees from V_O")
    declare.repeats(group, "timed frames of each kind and view (5)")
    declare.option(group, "--interpolation", "(nearest)", choices=("nearest", "linear"))
    declare.option(group, "--seed", "of the made volumes (1)", "N", declare.parse_count)
    tables = "which of the paper's tables (both)"
    declare.option(group, "--tables", tables, kind=declare.parse_whole, nargs="+", choices=(1, 2))
    declare.no_vtk(parser)
    declare.device(parser)


def _add_tradeoff(parser: argparse.ArgumentParser) -> None:
    declare.volume(parser)
    results = "where tradeoff-NAME.json (every figure), .md (tables) and .png (plot) go"
    declare.option(parser, "--out", results, "FOLDER", default=".")
    declare.option(parser, "--name", "in place of the volume's own, for several runs of one")
    declare.switch(parser, "--resume", "go on with what is there")
    declare.switch(parser, "--quick", "fewer settings and angles in a smaller window")
    parser.add_argument(
        "--size",
        "--window-size",
        type=declare.parse_size,
        metavar="WxH",
        help="of all frames, pixels (default: 640x360; with --quick 320x180)",
    )
    declare.angles(parser, "degrees from V_O (default: 5,30,60; with --quick 5,30)")
    declare.option(
        parser,
        "--sweep",
        "which settings, with values other than the usual ones: max-supersegments, "
        "tolerance, lists (along an edge, per pixel), precision, skip-empty, preview (share of the "
        "pixels along an edge); and on request criterion, view-cone, sample-distance (voxels)",
        "AXIS[=A,B,...]",
        nargs="+",
    )
    declare.repeats(parser, "timed frames (default: 5)", 5)
    generations = "timed generations of each VDI (default: 5)"
    declare.option(parser, "--generations", generations, "N", declare.parse_count, default=5)
    declare.no_vtk(parser)
    declare.classification(parser)
    declare.device(parser)


_VERBS: dict[str, tuple[str, str, str, Any]] = {
    "devices": (
        "files",
        "list the OpenCL devices, and say why one is not used",
        "pyvista-vdi devices",
        _add_devices,
    ),
    "generate": (
        "generate",
        "generate a VDI of a volume and write it to a file",
        "pyvista-vdi generate knee.nrrd -o knee.vdi --cmap bone --opacity sigmoid_6 --azimuth 30",
        _add_generate,
    ),
    "render": (
        "render",
        "render a VDI from a new view and write a picture",
        "pyvista-vdi render knee.vdi -o knee.png --azimuth 20 --background white",
        _add_render,
    ),
    "view": (
        "render",
        "open a window in which a VDI, or a volume by a VDI of it, can be turned",
        "pyvista-vdi view knee.vdi",
        _add_view,
    ),
    "turntable": (
        "movie",
        "turn a VDI, a set or a volume about itself and write a moving picture",
        "pyvista-vdi turntable knee.vdiset -o knee.gif --frames 60",
        _add_turntable,
    ),
    "movie": (
        "movie",
        "play a series, or fly along a path of views, and write a moving picture",
        "pyvista-vdi movie run.vdis -o run.mp4 --turn 20",
        _add_movie,
    ),
    "info": (
        "files",
        "say what a file holds: a VDI or a volume",
        "pyvista-vdi info knee.vdi --json",
        _add_info,
    ),
    "compare": (
        "comparison",
        "render a volume by VTK's mappers, our raycaster and a VDI, and compare them",
        "pyvista-vdi compare --example brain --tf soft --out out",
        _add_compare,
    ),
    "benchmark": (
        "benchmark",
        "measure the paper's tables: frame times and accuracy beside volume rendering",
        "pyvista-vdi benchmark --profile quick --out quick.json",
        _add_benchmark,
    ),
    "tradeoff": (
        "tradeoff",
        "measure what each setting of a VDI costs and gives, and draw the fronts",
        "pyvista-vdi tradeoff --example brain --out out",
        _add_tradeoff,
    ),
    "convert": (
        "files",
        "write a VDI, or each one of a series or set, as .vdi, .exr, .vti or .html; a set as .cdb",
        "pyvista-vdi convert knee.vdi -o knee.exr",
        _add_convert,
    ),
}
