"""The verbs and their options; imports nothing but the standard library and plain constants."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from .._version import __version__
from ..camera import check_window_size
from ..checks import memory_limit_bytes
from ..dial import QUALITIES, TARGET_ANGLE
from ..errors import InvalidArgumentError
from ..precision import PRECISIONS
from ..standard_cases import ANGLES, ELEVATION, TRANSFER_FUNCTIONS, WINDOW_SIZE
from .tradeoff_options import add_sweep_options

_DESCRIPTION = "Volumetric Depth Images: generate, render, view and compare them."

_VDI_FILE = "a .vdi file, an .exr deep image, or a VDI as .vti"
_VDI_TARGET = ".vdi, .exr or .vti to write"


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
    parser, verbs = _make_parser()
    if not arguments:
        parser.print_help()
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
    return ["--help", *re.findall(r"--[\w-]+", verb.format_help())]


def _refuse_argument(verb: _Parser, argument: str) -> NoReturn:
    hint = f"; see {verb.prog} --help"
    if argument.startswith("-"):
        hint = f": {_suggestion(argument.split('=')[0], _option_names(verb))}"
    raise UsageError(f"{verb.prog.split()[-1]} takes no argument {argument!r}{hint}")


def run_verb(options: argparse.Namespace) -> int:
    """Import the verb's module, which brings what it needs, and run it."""
    verb = import_module(f".{options.module}", __package__)
    return int(getattr(verb, options.verb)(options))


def _suggestion(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(dict.fromkeys(known))}"


def _make_parser() -> tuple[_Parser, dict[str, _Parser]]:
    parser = _Parser(
        prog="pyvista-vdi",
        description=_DESCRIPTION,
        epilog="Each verb explains itself: pyvista-vdi generate --help",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"pyvista-vdi {__version__}")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    verbs: dict[str, _Parser] = {}
    for name, (module, summary, example, add_options) in _VERBS.items():
        verbs[name] = subparsers.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            epilog=f"Example:\n  {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        add_options(verbs[name])
        verbs[name].set_defaults(run=run_verb, module=module)
    return parser, verbs


# -- the verbs' options ----------------------------------------------------------------------------


def _add_devices(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON")


def _add_info(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help=_VDI_FILE)
    parser.add_argument("--json", action="store_true", help="print JSON, with all metadata")


def _add_generate(parser: argparse.ArgumentParser) -> None:
    _add_volume(parser)
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help=_VDI_TARGET)
    _add_size(parser, WINDOW_SIZE)
    _add_camera(parser, f"the view that the volume fills, {ELEVATION:g} degrees above its middle")
    _add_classification(parser)
    _add_occlusion(parser)
    _add_limits(parser)
    _add_dial(parser)
    _add_file(parser)
    _add_device(parser)


def _add_convert(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help=_VDI_FILE)
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help=_VDI_TARGET)
    _add_file(parser)
    group = parser.add_argument_group("deep images of other programs")
    group.add_argument(
        "--camera-json",
        metavar="FILE",
        help="the view that the image shows, where it does not say it: Camera.to_dict() as JSON",
    )
    group.add_argument(
        "--thickness",
        type=float,
        metavar="LENGTH",
        help="world units, given to samples that have none (surfaces)",
    )


def _add_paraview(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--environment",
        action="store_true",
        help="print, for a shell's eval, the variables that make ParaView find this package and "
        "load the plugin",
    )


def _add_file(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("file")
    group.add_argument(
        "--compression",
        choices=("lz4", "zstd", "zips", "zlib", "lzma", "none"),
        help="of .vdi: lz4 (default), zstd or none; of .exr: zips (default) or none; of .vti: lz4 "
        "(default), zlib, lzma or none",
    )
    group.add_argument(
        "--level",
        type=int,
        metavar="N",
        help="1 (fast) to 9 (small); by default 9 for lz4 and 1 for the others",
    )
    group.add_argument(
        "--precision",
        choices=PRECISIONS,
        help="of .vdi: exact (24 bytes per supersegment before they are compressed; default of "
        "generate), 16-byte or 8-byte; convert keeps what the file has",
    )
    group.add_argument(
        "--standard-channels",
        action="store_true",
        help="leave out of an .exr what makes it exact: tau, and corrections",
    )


def _add_render(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help=f"{_VDI_FILE}; several are merged by depth, each where it was generated, and the "
        "view and the size are those of the first unless they are given",
    )
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help=".png to write")
    _add_size(parser, None)
    parser.add_argument(
        "--background",
        type=_color,
        metavar="COLOR",
        help="blend over this: a name, #rrggbb or R,G,B from 0 to 1; otherwise the picture is "
        "transparent where the volume is",
    )
    parser.add_argument(
        "--transmittance-cutoff",
        type=float,
        metavar="LIGHT",
        help="end rays where less than this is left, 0 to below 1 (0.000001): what a channel may "
        "lose; VTK's mappers stop at about 0.004. For a single file",
    )
    _add_camera(parser, "the VDI's generating view")
    _add_device(parser)


def _add_view(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help=_VDI_FILE)
    _add_size(parser, None)
    parser.add_argument("--screenshot", metavar="FILE", help="write this .png, open no window")
    group = parser.add_argument_group("while the view moves")
    group.add_argument(
        "--target-fps",
        type=_rate,
        metavar="RATE",
        default=30.0,
        help="frames per second to keep, by fewer pixels; 0: every frame is full (default: 30)",
    )
    group.add_argument(
        "--regenerate",
        choices=("auto", "never"),
        default="auto",
        help="auto (default): say once that the view is beyond what the VDI was made to serve (a "
        "file holds no volume to make another from); never: take it as it is",
    )
    group.add_argument(
        "--status",
        action="store_true",
        help="show in a corner how it is drawn: pixels, frames per second, angle from the "
        "generating view",
    )


def _add_compare(parser: argparse.ArgumentParser) -> None:
    _add_volume(parser)
    parser.add_argument("--out", metavar="FOLDER", default=".", help="where the files go")
    _add_size(parser, WINDOW_SIZE)
    parser.add_argument(
        "--angles",
        type=_numbers,
        metavar="A,B,...",
        default=ANGLES,
        help=f"degrees from V_O (default: {','.join(f'{a:g}' for a in ANGLES)})",
    )
    parser.add_argument(
        "--repeats", type=_count, default=3, help="timed frames of each kind (default: 3)"
    )
    parser.add_argument("--no-vtk", action="store_true", help="leave out VTK's mappers")
    _add_classification(parser, tables=False)
    parser.add_argument("--max-supersegments", type=int, default=20, metavar="N")
    parser.add_argument("--sample-distance", type=float, metavar="LENGTH")
    _add_device(parser)


def _add_benchmark(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--profile",
        choices=("quick", "full"),
        default="quick",
        help="quick (default): small volumes, minutes; full: the paper's sizes and all volumes at "
        "hand, hours",
    )
    parser.add_argument(
        "--out",
        metavar="FILE",
        default="benchmark.json",
        help=".json to write; a table (.md) and a plot (.png) go beside it (default: "
        "benchmark.json)",
    )
    parser.add_argument("--resume", action="store_true", help="go on with FILE where it was left")
    parser.add_argument(
        "--compare",
        nargs=2,
        metavar=("A", "B"),
        help="measure nothing: say what changed between two files beyond noise",
    )
    group = parser.add_argument_group("what is measured", "In place of the profile's.")
    group.add_argument(
        "--datasets",
        nargs="+",
        metavar="NAME",
        help="volumes known by name, and kingsnake_like, beechnut_like, richtmyer_meshkov_like: "
        "made at the paper's sizes, or with @4 behind the name at a quarter along each edge",
    )
    group.add_argument(
        "--volume",
        action="append",
        metavar="[NAME=]FILE",
        help="a file, may be repeated; a NAME of kingsnake, beechnut or richtmyer_meshkov says "
        "that it is the paper's; raw files are named like x_1024x1024x795_uint8.raw",
    )
    group.add_argument("--sizes", nargs="+", type=_size, metavar="WxH", help="windows, pixels")
    group.add_argument("--max-supersegments", nargs="+", type=_count, metavar="N")
    group.add_argument("--angles", type=_numbers, metavar="A,B,...", help="degrees from V_O")
    group.add_argument(
        "--repeats", type=_count, metavar="N", help="timed frames of each kind and view (5)"
    )
    group.add_argument("--interpolation", choices=("nearest", "linear"), help="(nearest)")
    group.add_argument("--seed", type=_count, metavar="N", help="of the made volumes (1)")
    group.add_argument(
        "--tables", nargs="+", type=int, choices=(1, 2), help="which of the paper's tables (both)"
    )
    parser.add_argument("--no-vtk", action="store_true", help="leave out VTK's mappers")
    _add_device(parser)


def _add_tradeoff(parser: argparse.ArgumentParser) -> None:
    _add_volume(parser)
    add_sweep_options(parser, _size, _numbers, _count)
    _add_classification(parser)
    _add_device(parser)


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
        "open a window in which a VDI can be turned",
        "pyvista-vdi view knee.vdi",
        _add_view,
    ),
    "info": (
        "files",
        "say what a .vdi, .exr or .vti file holds",
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
        "write a VDI in another format: .vdi, OpenEXR deep image or VTK's .vti",
        "pyvista-vdi convert knee.vdi -o knee.exr",
        _add_convert,
    ),
    "paraview": (
        "paraview",
        "print the path of the plugin for ParaView",
        "pyvista-vdi paraview --environment",
        _add_paraview,
    ),
}


# -- groups of options -----------------------------------------------------------------------------


def _add_volume(parser: argparse.ArgumentParser) -> None:
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "volume",
        metavar="VOLUME",
        nargs="?",
        help="a file that PyVista reads as a uniform grid (.nrrd, .mha, .nii, .vti, ...), .npy, "
        "a raw file named like x_1024x1024x795_uint8.raw, or a folder of DICOM slices",
    )
    source.add_argument("--example", metavar="NAME", help="a volume known by name, e.g. brain")


def _add_size(parser: argparse.ArgumentParser, default: tuple[int, int] | None) -> None:
    shown = "the VDI's" if default is None else f"{default[0]}x{default[1]}"
    parser.add_argument(
        "--size",
        type=_size,
        metavar="WxH",
        default=default,
        help=f"window size in pixels (default: {shown})",
    )


def _add_camera(parser: argparse.ArgumentParser, default: str) -> None:
    group = parser.add_argument_group("camera", f"By default {default}.")
    triple: dict[str, Any] = {"nargs": 3, "type": float, "metavar": ("X", "Y", "Z")}
    group.add_argument("--position", **triple, help="eye, world coordinates")
    group.add_argument("--focal-point", **triple, help="point looked at, world coordinates")
    group.add_argument("--view-up", **triple, help="direction that is up")
    group.add_argument("--view-angle", type=float, metavar="DEGREES", help="vertical, full")
    group.add_argument(
        "--parallel-scale",
        type=float,
        metavar="LENGTH",
        help="half the viewport's height in world units; makes the projection parallel",
    )
    group.add_argument("--camera-json", metavar="FILE", help="Camera.to_dict() as JSON")
    group.add_argument("--azimuth", type=float, default=0.0, metavar="DEGREES", help="turn by")
    group.add_argument("--elevation", type=float, default=0.0, metavar="DEGREES", help="lift by")


def _add_classification(parser: argparse.ArgumentParser, *, tables: bool = True) -> None:
    group = parser.add_argument_group(
        "classification", "Names, defaults and meaning are those of PyVista's add_volume."
    )
    group.add_argument(
        "--tf",
        choices=tuple(TRANSFER_FUNCTIONS),
        help="a standard transfer function; --cmap and --opacity change parts of it",
    )
    group.add_argument("--cmap", metavar="NAME", help="colour map")
    group.add_argument(
        "--opacity", type=_opacity, metavar="NAME|A,B,...", help="name, or values from 0 to 1"
    )
    group.add_argument("--clim", nargs=2, type=float, metavar=("LOW", "HIGH"))
    group.add_argument("--n-colors", type=int, metavar="N")
    group.add_argument("--flip-scalars", action="store_true", default=None)
    group.add_argument("--log-scale", action="store_true", default=None)
    group.add_argument("--opacity-unit-distance", type=float, metavar="LENGTH")
    group.add_argument("--scalars", metavar="NAME", help="which array")
    group.add_argument("--preference", choices=("point", "cell"))
    group.add_argument("--interpolation", choices=("nearest", "linear"))
    group.add_argument("--shade", action="store_true", default=None, help="lit by a headlight")
    for name in ("--ambient", "--diffuse", "--specular", "--specular-power"):
        group.add_argument(name, type=float, metavar="X", help="of a shaded volume")
    if tables:
        group.add_argument(
            "--transfer-function",
            metavar="FILE",
            help="TransferFunction.to_dict() as JSON, in place of the others; needs no PyVista",
        )


def _add_occlusion(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("ambient occlusion", "Either option below turns it on, too.")
    group.add_argument(
        "--ambient-occlusion",
        action="store_true",
        help="darken what is hidden from the light around it",
    )
    group.add_argument(
        "--occlusion-radius",
        type=float,
        metavar="LENGTH",
        help="how far something hides, model units (default: 0.05 of the bounds' diagonal)",
    )
    group.add_argument(
        "--occlusion-strength", type=float, metavar="S", help="0 to 1 (default: 0.1; 1 is darkest)"
    )


def _add_limits(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("limits")
    group.add_argument(
        "--max-supersegments", type=int, default=20, metavar="N", help="longest list (default: 20)"
    )
    group.add_argument(
        "--criterion",
        default="least-error",
        metavar="NAME",
        help="where lists are cut: least-error (default), homogeneity, length, "
        "transmittance or optical-depth",
    )
    group.add_argument(
        "--sample-distance",
        type=float,
        metavar="LENGTH",
        help="step along the ray, model units (default: half the smallest spacing)",
    )
    group.add_argument("--tolerance", type=float, default=0.0, help="error traded for length")
    group.add_argument(
        "--view-cone",
        type=float,
        default=60.0,
        metavar="DEGREES",
        help="half angle of the cone of new views to serve (default: 60)",
    )
    group.add_argument(
        "--memory-limit",
        type=_bytes,
        metavar="SIZE",
        help="most memory to take on the device, like 2GiB; a volume that does not fit goes there "
        "brick by brick (default: what the device has)",
    )


def _add_dial(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group(
        "dial",
        "Choose lists, their length and precision from a short measurement on this device; --size "
        "is then that of the pictures. Not with --max-supersegments, --tolerance or --precision.",
    )
    group.add_argument(
        "--quality",
        choices=tuple(QUALITIES),
        help="SSIM of "
        + ", ".join(f"{ssim:g} ({name})" for name, ssim in QUALITIES.items() if ssim is not None)
        + " against volume rendering; reference: what is made without a dial",
    )
    group.add_argument("--target-ssim", type=float, metavar="S", help="the same by a number")
    group.add_argument(
        "--target-fps", type=float, metavar="RATE", help="least full frames per second"
    )
    group.add_argument(
        "--max-bytes", type=float, metavar="N", help="most bytes on the device; files are smaller"
    )
    group.add_argument(
        "--target-angle",
        type=float,
        default=TARGET_ANGLE,
        metavar="DEGREES",
        help=f"turn of the view for which the SSIM is predicted (default: {TARGET_ANGLE:g})",
    )


def _add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--device", metavar="NAME", help="OpenCL device, see pyvista-vdi devices")


# -- types of options ------------------------------------------------------------------------------


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT, like 1280x720; got {text!r}")
    try:
        return check_window_size((int(match[1]), int(match[2])), name="the size")
    except InvalidArgumentError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"expected numbers with commas between them, like 0,5,30; got {text!r}"
        ) from error


def _bytes(text: str) -> int | None:
    try:
        return memory_limit_bytes(text)
    except InvalidArgumentError:
        raise argparse.ArgumentTypeError(
            f"expected a size such as 2GiB or 800MB; got {text!r}"
        ) from None


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number above 0; got {text!r}")
    return int(text)


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = -1.0
    if not 0 <= rate < float("inf"):
        raise argparse.ArgumentTypeError(f"expected frames per second, 0 or above; got {text!r}")
    return rate


def _opacity(text: str) -> str | list[float]:
    return list(_numbers(text)) if re.match(r"[-+.\d]", text) else text


def _color(text: str) -> tuple[float, ...]:
    if re.match(r"[-+.\d]", text):
        color = _numbers(text)
        if len(color) != 3 or not all(0 <= c <= 1 for c in color):
            raise argparse.ArgumentTypeError(f"expected R,G,B from 0 to 1; got {text!r}")
        return color
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no colour: give a name, #rrggbb or R,G,B from 0 to 1"
        ) from error
    return red / 255, green / 255, blue / 255
