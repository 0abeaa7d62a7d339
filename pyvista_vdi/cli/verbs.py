"""The verbs of the command line and their options."""

from __future__ import annotations

import argparse
from typing import Any

from pyvista_vdi.cli import declare
from pyvista_vdi.model.options import declared
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.render_options import DrawingOptions
from pyvista_vdi.model.standard_cases import ANGLES, ELEVATION, WINDOW_SIZE


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
    declare.deferral(parser)
    declare.occlusion(parser)
    declare.limits(parser)
    declare.target(parser)
    declare.file_format(parser)
    declare.scheduler(parser)
    declare.device(parser)


def _add_convert(parser: argparse.ArgumentParser) -> None:
    declare.vdi_file(parser)
    declare.output(parser)
    declare.file_format(parser)
    declare.look_of_values(parser)
    group = parser.add_argument_group("deep images of other programs")
    view = "the view that the image shows, where it does not say it: Camera.to_dict() as JSON"
    declare.option(group, "--camera-json", view, "FILE")
    thickness = "world units, given to samples that have none (surfaces)"
    declare.option(group, "--thickness", thickness, "LENGTH", declare.parse_number)


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
    more = (
        ", 0 to below 1 (0.000001): what a channel may lose; VTK's mappers stop at about 0.004. "
        "For a single file"
    )
    declare.known(parser, "transmittance_cutoff", "LIGHT", declare.parse_number, more)
    declare.time(parser)
    declare.camera(parser, "the VDI's generating view")
    declare.look_of_values(parser)
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
    rate = declared(DrawingOptions)["target_fps"]
    text = f"{rate.what}, by fewer pixels; 0: every frame is full (default: {rate.default:g})"
    declare.option(group, "--target-fps", text, "RATE", declare.parse_rate, default=rate.default)
    more = (
        ": auto (default), where the view is beyond what the VDI was made to serve, which is said "
        "once of a VDI that was opened without its volume; or never"
    )
    declare.known(group, "regenerate", more=more, default=..., choices=("auto", "never"))
    more = (
        ": vdi, volume, or auto (default), what is expected to give the better picture within the "
        "frame rate"
    )
    declare.known(group, "draw", more=more, default=..., choices=("auto", "vdi", "volume"))
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
        ".gif, .mp4 or .webm to write (pip install 'pyvista-vdi[movie]')",
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
    declare.volume(parser)
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
        "of the supersegments: exact (default, 24 bytes each) or 8-byte",
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


def _add_tradeoff(parser: argparse.ArgumentParser) -> None:
    declare.volume(parser)
    results = "where tradeoff-NAME.json (every figure), .md (tables) and .png (plot) go"
    declare.option(parser, "--out", results, "FOLDER", default=".")
    declare.option(parser, "--name", "in place of the volume's own, for several runs of one")
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
    generations = "timed generations of each VDI (default: 3)"
    declare.option(parser, "--generations", generations, "N", declare.parse_count, default=3)
    declare.no_vtk(parser)
    declare.classification(parser)
    declare.device(parser)


#: Of each verb its module, what it does, an example, and what adds its options.
VERBS: dict[str, tuple[str, str, str, Any]] = {
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
    "tradeoff": (
        "tradeoff",
        "measure what each setting of a VDI costs and gives, and draw the fronts",
        "pyvista-vdi tradeoff --example brain --out out",
        _add_tradeoff,
    ),
    "convert": (
        "files",
        "write a VDI, or each of a series or set, as .vdi, .exr; all of one as .vdis, .html",
        "pyvista-vdi convert knee.vdi -o knee.exr",
        _add_convert,
    ),
}
