"""The subcommands of the core, and their options."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

from pyvista_vdi.cli.declare import COUNT, FPS, NUMBER, RATE, Option, add, numbers, parse_size
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import ANGLES, ELEVATION, WINDOW_SIZE

_FILLS = f"the view that the volume fills, {ELEVATION:g} degrees above its middle"
_FIRST = "the first view is the VDI's own, or one that the volume fills"


def _generate(parser: argparse.ArgumentParser) -> None:
    names = "volume output size camera: look: deferral: occlusion: limits: quality: file:"
    precision = "of .vdi: exact (default) or 8-byte; of .html: 8-byte by default"
    changes = {"size": WINDOW_SIZE, "camera": _FILLS, "precision": precision}
    add(parser, f"{names} scheduler device", **changes)


def _convert(parser: argparse.ArgumentParser) -> None:
    precision = "of the supersegments; by default as in the file, of .html 8-byte"
    add(parser, "vdi output file: values:", precision=precision)
    group = parser.add_argument_group("deep images of other programs")
    view = "the view that the image shows, where it does not say it: Camera.to_dict() as JSON"
    text = "world units, given to samples that have none (surfaces)"
    thickness = Option(text, "LENGTH", NUMBER)
    add(group, "camera_json thickness", camera_json=view, thickness=thickness)


def _render(parser: argparse.ArgumentParser) -> None:
    names = "vdis output size background transmittance_cutoff time camera: values: device"
    background = "blend over this: a name, #rrggbb or R,G,B from 0 to 1 (default: transparent)"
    changes = {"output": ".png to write", "background": background, "size": _OF_THE_VDI}
    add(parser, names, camera="the VDI's generating view", **changes)


#: Of what is shown again the size is kept.
_OF_THE_VDI = Option("window size in pixels", "WxH", parse_size, usual="the VDI's")


def _view(parser: argparse.ArgumentParser) -> None:
    screenshot = Option("write this .png, open no window", "FILE")
    add(parser, "vdi_or_volume size screenshot", size=_OF_THE_VDI, screenshot=screenshot)
    group = parser.add_argument_group("series", "The space bar plays and pauses, a slider seeks.")
    play, rate = Option("begin to play at once"), Option("steps per second", "RATE", FPS, usual=24)
    add(group, "play rate time", play=play, rate=rate)
    group = parser.add_argument_group("while the view moves")
    fps = "frames per second to be kept, by fewer pixels; 0: every frame is full"
    regenerate = "make the VDI anew where the view is beyond what it serves, or never"
    draw = "what is raycast where the volume is at hand; auto: what gives the better picture"
    status = "show in a corner how it is drawn: pixels, frames per second, angle"
    add(
        *(group, "target_fps regenerate draw status"),
        target_fps=Option(fps, "RATE", RATE, usual=30.0),
        regenerate=Option(regenerate, choices=("auto", "never"), usual="auto"),
        draw=Option(draw, choices=("auto", "vdi", "volume"), usual="auto"),
        status=Option(status),
    )
    add(parser, "look: device", transfer_function=False)


def _frames(parser: argparse.ArgumentParser, frames: str, **own: Option) -> None:
    names = f"vdi_or_volume output size background frames fps {' '.join(own)} camera: look: device"
    add(
        *(parser, names),
        output=".gif, .mp4 or .webm to write (pip install 'pyvista-vdi[movie]')",
        size=_OF_THE_VDI,
        background=(0.0, 0.0, 0.0),
        frames=Option(frames, "N", COUNT),
        fps=Option("frames per second", "RATE", FPS, default=25.0),
        camera=_FIRST,
        **own,
    )


def _turntable(parser: argparse.ArgumentParser) -> None:
    text = "turn by so many in all, about the view's up direction"
    degrees = Option(text, "DEGREES", NUMBER, default=360.0)
    _frames(parser, "of the whole turn (default: four seconds of them)", degrees=degrees)


def _movie(parser: argparse.ArgumentParser) -> None:
    text = "views to fly along, each Camera.to_dict() as JSON; two at least"
    parser.add_argument("--path", help=text, metavar="FILE", nargs="+")
    text = "turn by so many meanwhile, about the view's up direction"
    turn = Option(text, "DEGREES", NUMBER, default=0.0)
    _frames(
        parser, "in all (default: one a step of a series, 4 s to a path's next view)", turn=turn
    )


def _compare(parser: argparse.ArgumentParser) -> None:
    add(
        *(parser, "volume out size angles repeats no_vtk look: max_supersegments precision"),
        size=WINDOW_SIZE,
        angles=Option("degrees from V_O", "A,B,...", numbers, default=ANGLES),
        repeats=Option("timed frames of each kind", "N", COUNT, default=3),
        precision=Option("of the supersegments", choices=PRECISIONS, default="exact"),
        transfer_function=False,
    )
    add(parser, "compression sample_distance device", compression="lz4")


def _tradeoff(parser: argparse.ArgumentParser) -> None:
    window = "of all frames, pixels (default: 640x360; with --quick 320x180)"
    parser.add_argument("--size", "--window-size", type=parse_size, metavar="WxH", help=window)
    angles = "degrees from V_O (default: 5,30,60; with --quick 5,30)"
    add(
        *(parser, "volume out name quick angles repeats generations no_vtk look: device"),
        out="where tradeoff-NAME.json (every figure), .md (tables) and .png (plot) go",
        name=Option("in place of the volume's own, for several runs of one", "NAME"),
        quick=Option("fewer settings and angles in a smaller window"),
        angles=Option(angles, "A,B,...", numbers),
        repeats=Option("timed frames", "N", COUNT, default=5),
        generations=Option("timed generations of each VDI", "N", COUNT, default=3),
    )
    sweep = (
        "which settings, with values other than the usual ones: max-supersegments, tolerance, "
        "lists (along an edge, per pixel), precision, skip-empty, preview (share of the pixels "
        "along an edge); and on request criterion, view-cone, sample-distance (voxels)"
    )
    parser.add_argument("--sweep", help=sweep, metavar="AXIS[=A,B,...]", nargs="+")


class Verb(NamedTuple):
    """A subcommand: its module, what it does, an example, and what adds its options."""

    module: str
    summary: str
    example: str
    options: Callable[[argparse.ArgumentParser], None]


VERBS = {
    "devices": Verb(
        *("files", "list the OpenCL devices, and say why one is not used", "pyvista-vdi devices"),
        lambda parser: add(parser, "json"),
    ),
    "generate": Verb(
        *("generate", "generate a VDI of a volume and write it to a file"),
        "pyvista-vdi generate knee.nrrd -o knee.vdi --cmap bone --opacity sigmoid_6 --azimuth 30",
        _generate,
    ),
    "render": Verb(
        *("render", "render a VDI from a new view and write a picture"),
        "pyvista-vdi render knee.vdi -o knee.png --azimuth 20 --background white",
        _render,
    ),
    "view": Verb(
        *("render", "turn a VDI, or a volume by a VDI of it, in a window"),
        *("pyvista-vdi view knee.vdi", _view),
    ),
    "turntable": Verb(
        *("movie", "turn a VDI or a volume about itself: a moving picture"),
        *("pyvista-vdi turntable knee.vdiset -o knee.gif --frames 60", _turntable),
    ),
    "movie": Verb(
        *("movie", "play a series, or fly along a path: a moving picture"),
        *("pyvista-vdi movie run.vdis -o run.mp4 --turn 20", _movie),
    ),
    "info": Verb(
        *("files", "say what a file holds: a VDI or a volume", "pyvista-vdi info knee.vdi --json"),
        lambda parser: add(parser, "vdi_or_volume scalars preference json"),
    ),
    "compare": Verb(
        *("measured", "compare VTK's mappers, our raycaster and a VDI by pictures"),
        *("pyvista-vdi compare --example brain --tf soft --out out", _compare),
    ),
    "tradeoff": Verb(
        *("measured", "measure what each setting of a VDI costs and gives"),
        *("pyvista-vdi tradeoff --example brain --out out", _tradeoff),
    ),
    "convert": Verb(
        *("files", "write a VDI, a series or a set in another format"),
        *("pyvista-vdi convert knee.vdi -o knee.exr", _convert),
    ),
}
