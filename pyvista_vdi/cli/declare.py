"""Declares options to a parser: those that several verbs have, any other, and their types."""

from __future__ import annotations

import argparse
import math
import re
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.checks import as_float, memory_limit_bytes
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import (
    QUALITIES,
    Deferral,
    GenerationOptions,
    QualityTarget,
    declared,
)
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.render_options import DrawingOptions, RenderOptions
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

#: More than any screen shows.
MOST_FRAMES_PER_SECOND = 1000

#: Where options go: a verb's parser, or a group of it.
Options = argparse._ActionsContainer

#: The options of the public functions: defaults, choices and texts are theirs.
_DECLARED = declared(
    Classification, Deferral, DrawingOptions, GenerationOptions, QualityTarget, RenderOptions
)

#: What the step along a ray is where none is given.
_HALF = " (default: half the smallest spacing)"

VDI_FILE = "a .vdi file, a series, .vdis, a set, .vdiset, an .exr deep image, or a page, .html"

VOLUME_FILE = (
    "a file (.nii.gz, .nrrd, .mha, .tif, .mrc, .h5, .vti, .npy, ...), a folder of slices (DICOM, "
    "TIFF or PNG), or a store of chunks (.ome.zarr, .zarr, x.h5::/path)"
)


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height, pixels, from ``1280x720``."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT, like 1280x720; got {text!r}")
    try:
        return check_window_size((int(match[1]), int(match[2])), name="the size")
    except InvalidArgumentError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def parse_number(text: str) -> float:
    """Return a number, which neither NaN nor infinity is."""
    number = as_float(text)
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"expected a number, like 0.5; got {text!r}")
    return number


def parse_whole(text: str) -> int:
    """Return a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number; got {text!r}") from None


def parse_numbers(text: str) -> tuple[float, ...]:
    """Return numbers from ``0,5,30``."""
    numbers = tuple(as_float(part) for part in text.split(","))
    if not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(
            f"expected numbers with commas between them, like 0,5,30; got {text!r}"
        )
    return numbers


def parse_bytes(text: str) -> int | None:
    """Return bytes from ``2GiB``, or from a plain number."""
    try:
        return memory_limit_bytes(text)
    except InvalidArgumentError:
        raise argparse.ArgumentTypeError(
            f"expected a size such as 2GiB or 800MB; got {text!r}"
        ) from None


def parse_count(text: str) -> int:
    """Return a whole number above 0."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number above 0; got {text!r}")
    return int(text)


def parse_level(text: str) -> int | str:
    """Return ``"auto"``, or a level's number."""
    if text != "auto" and not text.isdecimal():
        raise argparse.ArgumentTypeError(
            f"expected auto, or a level's number from 0, the finest; got {text!r}"
        )
    return text if text == "auto" else int(text)


def parse_channel(text: str) -> int | str:
    """Return a channel's number, or its name."""
    return int(text) if text.isdecimal() else text


def parse_port(text: str) -> int:
    """Return a port's number, 0 to 65535."""
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"a port is a number up to 65535; got {text!r}")
    return int(text)


def parse_rate(text: str) -> float:
    """Return frames per second."""
    try:
        rate = float(text)
    except ValueError:
        rate = -1.0
    if not 0 <= rate < float("inf"):
        raise argparse.ArgumentTypeError(f"expected frames per second, 0 or above; got {text!r}")
    return rate


def parse_frames_per_second(text: str) -> float:
    """Return frames per second of what moves."""
    rate = parse_rate(text)
    if not 0 < rate <= MOST_FRAMES_PER_SECOND:
        raise argparse.ArgumentTypeError(
            f"expected frames per second, above 0 and up to {MOST_FRAMES_PER_SECOND}; got {text!r}"
        )
    return rate


def parse_opacity(text: str) -> str | list[float]:
    """Return the name of a mapping, or opacities from ``0,0.2,1``."""
    return list(parse_numbers(text)) if re.match(r"[-+.\d]", text) else text


def parse_color(text: str) -> tuple[float, ...]:
    """Return RGB, each from 0 to 1, from a name or numbers."""
    if re.match(r"[-+.\d]", text):
        color = parse_numbers(text)
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


def option(
    options: Options,
    name: str,
    text: str | None,
    metavar: Any = None,
    kind: Any = None,
    **more: Any,
) -> None:
    """Add an option that takes a value, or an argument."""
    options.add_argument(name, help=text, metavar=metavar, type=kind, **more)


def known(
    options: Options,
    name: str,
    metavar: Any = None,
    kind: Any = None,
    more: str = "",
    *,
    default: Any = None,
    **others: Any,
) -> None:
    """Add an option of the public functions, of this name, by what is declared of it.

    ``more`` is put behind its text, and so is ``default``, if it is a number; ``...`` is the one
    that is declared.
    """
    told = _DECLARED[name]
    default = told.default if default is ... else default
    text = told.what.replace("``", "") + more
    if isinstance(default, int | float):
        text += f" (default: {default:g})"
    flag = f"--{name.replace('_', '-')}"
    option(options, flag, text, metavar, kind, default=default, **others)


def switch(options: Options, name: str, text: str | None = None, **more: Any) -> None:
    """Add an option that takes none."""
    options.add_argument(name, help=text, action="store_true", **more)


def vdi_file(options: Options) -> None:
    """Add the VDI to read."""
    option(options, "file", VDI_FILE, "FILE")


def output(options: Options, text: str = ".vdi, .exr or .html to write") -> None:
    """Add the file to write."""
    options.add_argument("-o", "--output", metavar="FILE", required=True, help=text)


def volume(options: Options) -> None:
    """Add the volume: a file's name, or one that is known; and where its voxels lie."""
    _file_or_example(options, "file", VOLUME_FILE, "VOLUME")


def volumes(options: Options) -> None:
    """Add volumes, the time steps of one."""
    text = (
        f"{VOLUME_FILE}; several are time steps, step_2 before step_10, and so are those of a "
        "store or a .pvd"
    )
    _file_or_example(options, "files", text, "VOLUME", nargs="*", default=[])


def vdi_or_volume(options: Options) -> None:
    """Add what to show: a VDI or a volume."""
    _file_or_example(options, "file", f"{VDI_FILE}; or a volume: {VOLUME_FILE}", "FILE")


def _file_or_example(
    options: Options,
    name: str,
    text: str,
    metavar: str,
    nargs: str = "?",
    **more: Any,
) -> None:
    source = options.add_mutually_exclusive_group(required=True)
    option(source, name, text, metavar, nargs=nargs, **more)
    option(
        source,
        "--example",
        "a volume known by name: brain, ct and rayleigh_taylor are shipped, others are read from "
        "the folder that PYVISTA_VDI_DATA names",
        "NAME",
    )
    grid(options)


def grid(options: Options) -> None:
    """Add where a volume's voxels lie, and what is taken of a store of chunks."""
    xyz = ("X", "Y", "Z")
    text = "between voxels, in place of what the volume's file says (1 where it says nothing)"
    option(options, "--spacing", text, xyz, parse_number, nargs=3)
    option(options, "--origin", "of its first voxel, in the same way", xyz, parse_number, nargs=3)
    text = "of a multi-scale store: 0 is the finest; auto (default): what the view requires"
    option(options, "--level", text, "auto|N", parse_level)
    text = "of a file that holds several (default of a store: 0)"
    option(options, "--channel", text, "N|NAME", parse_channel)
    text = "of a DICOM folder or a TIFF file that holds several"
    option(options, "--series", text, "N|NAME", parse_channel)
    text = "which step of several (default of a store: 0; of a series or a server all)"
    option(options, "--time-index", text, "N", parse_whole)


def array(options: Options) -> None:
    """Add which array of the volume is meant."""
    known(options, "scalars", "NAME")
    known(options, "preference", choices=_DECLARED["preference"].choices)


def size(options: Options, default: tuple[int, int] | None) -> None:
    """Add the window's size, pixels; the VDI's own without a default."""
    shown = "the VDI's" if default is None else f"{default[0]}x{default[1]}"
    text = f"window size in pixels (default: {shown})"
    option(options, "--size", text, "WxH", parse_size, default=default)


def time(options: Options) -> None:
    """Add which step of a series to show."""
    text = "of a series, the step nearest in time (default: the first)"
    option(options, "--time", text, "T", parse_number)


def angles(options: Options, text: str, default: tuple[float, ...] | None = None) -> None:
    """Add the new views."""
    option(options, "--angles", text, "A,B,...", parse_numbers, default=default)


def repeats(
    options: Options, text: str, default: int | None = None, metavar: str | None = "N"
) -> None:
    """Add how often frames are timed."""
    option(options, "--repeats", text, metavar, parse_count, default=default)


def no_vtk(options: Options) -> None:
    """Add the way to do without VTK."""
    switch(options, "--no-vtk", "leave out VTK's mappers")


def camera(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the view; ``default`` says in words what it is without these options."""
    group = parser.add_argument_group("camera", f"By default {default}.")
    for name, text in (
        ("--position", "eye, world coordinates"),
        ("--focal-point", "point looked at, world coordinates"),
        ("--view-up", "direction that is up"),
    ):
        option(group, name, text, ("X", "Y", "Z"), parse_number, nargs=3)
    option(group, "--view-angle", "vertical, full", "DEGREES", parse_number)
    parallel = "half the viewport's height in world units; makes the projection parallel"
    option(group, "--parallel-scale", parallel, "LENGTH", parse_number)
    option(group, "--camera-json", "Camera.to_dict() as JSON", "FILE")
    option(group, "--azimuth", "turn by", "DEGREES", parse_number, default=0.0)
    option(group, "--elevation", "lift by", "DEGREES", parse_number, default=0.0)


def classification(parser: argparse.ArgumentParser, *, tables: bool = True) -> None:
    """Add how the volume looks; ``tables``: also its transfer function as a file."""
    group = parser.add_argument_group(
        "classification", "Names, defaults and meaning are those of PyVista's add_volume."
    )
    _look(group)
    switch(group, "--shade", _DECLARED["shade"].what, default=None)
    array(group)
    known(group, "interpolation", choices=_DECLARED["interpolation"].choices)
    for name in ("ambient", "diffuse", "specular", "specular_power"):
        known(group, name, "X", parse_number)
    if tables:
        _table(group)


def look_of_values(parser: argparse.ArgumentParser) -> None:
    """Add how values look that were kept to be classified afterwards."""
    group = parser.add_argument_group("classification", "Of VDIs that keep values.")
    _look(group)
    _table(group)


def _look(group: Options) -> None:
    standard = "a standard transfer function; --cmap and --opacity change parts of it"
    option(group, "--tf", standard, choices=tuple(TRANSFER_FUNCTIONS))
    known(group, "cmap", "NAME")
    known(group, "opacity", "NAME|A,B,...", parse_opacity, ", 0 to 1")
    known(group, "clim", ("LOW", "HIGH"), parse_number, nargs=2)
    known(group, "n_colors", "N", parse_whole)
    known(group, "opacity_unit_distance", "LENGTH", parse_number)
    for name in ("flip_scalars", "log_scale"):
        switch(group, f"--{name.replace('_', '-')}", _DECLARED[name].what, default=None)


def _table(group: Options) -> None:
    text = "TransferFunction.to_dict() as JSON, in place of the others; needs no PyVista"
    option(group, "--transfer-function", text, "FILE")


def deferral(parser: argparse.ArgumentParser) -> None:
    """Add what is kept of the scalars, where they are classified afterwards."""
    group = parser.add_argument_group(
        "classified afterwards", "Values are kept: convert, render and view then take the look."
    )
    known(group, "classification", choices=_DECLARED["classification"].choices)
    known(group, "value_range", ("LOW", "HIGH"), parse_number, nargs=2)
    known(group, "importance", "A,B,...", parse_numbers)


def occlusion(parser: argparse.ArgumentParser) -> None:
    """Add ambient occlusion."""
    group = parser.add_argument_group("ambient occlusion", "Either option below turns it on, too.")
    switch(group, "--ambient-occlusion", "darken what is hidden from the light around it")
    radius = "how far something hides, model units (default: 0.05 of the bounds' diagonal)"
    option(group, "--occlusion-radius", radius, "LENGTH", parse_number)
    strength = "0 to 1 (default: 0.1; 1 is darkest)"
    option(group, "--occlusion-strength", strength, "S", parse_number)


def longest(options: Options, default: Any = ...) -> None:
    """Add how long lists may be."""
    known(options, "max_supersegments", "N", parse_whole, default=default)


def step(options: Options) -> None:
    """Add how finely the volume is sampled."""
    known(options, "sample_distance", "LENGTH", parse_number, _HALF)


def limits(parser: argparse.ArgumentParser) -> None:
    """Add how much a VDI may hold, and how finely the volume is sampled."""
    group = parser.add_argument_group("limits")
    longest(group)
    names = ": {} (default) or {}".format(*_DECLARED["criterion"].choices)
    known(group, "criterion", "NAME", more=names, default=...)
    step(group)
    known(group, "tolerance", kind=parse_number, default=...)
    known(group, "view_cone", "DEGREES", parse_number, default=...)
    memory_limit(group)


def memory_limit(options: Options) -> None:
    """Add how much memory of the device is taken."""
    more = (
        ", like 2GiB; a volume that does not fit goes there brick by brick (default: what the "
        "device has)"
    )
    known(options, "memory_limit", "SIZE", parse_bytes, more)


def target(parser: argparse.ArgumentParser) -> None:
    """Add goals, from which the limits are chosen."""
    group = parser.add_argument_group(
        "quality",
        "Choose lists, their length and precision from a short measurement on this device; --size "
        "is then that of the pictures. Not with --max-supersegments, --tolerance or --precision.",
    )
    goals = [f"{ssim:g} ({name})" for name, ssim in QUALITIES.items() if ssim is not None]
    named = f": an SSIM of {', '.join(goals)} against volume rendering; reference asks for nothing"
    known(group, "quality", more=named, choices=tuple(QUALITIES))
    known(group, "target_ssim", "S", parse_number)
    known(group, "full_fps", "RATE", parse_number)
    known(group, "max_bytes", "SIZE", parse_bytes, ", like 20MB")
    known(group, "target_angle", "DEGREES", parse_number, default=...)


def file_format(parser: argparse.ArgumentParser) -> None:
    """Add how a VDI is written."""
    group = parser.add_argument_group("file")
    option(
        group,
        "--compression",
        "of .vdi: lz4 (default), zstd, deflate (for pages) or none; of .html: deflate",
        choices=("lz4", "zstd", "deflate", "none"),
    )
    level = "1 (fast) to 9 (small); by default 9 for lz4, 6 for deflate, 1 for others"
    option(group, "--compression-level", level, "N", parse_whole)
    option(
        group,
        "--precision",
        "of .vdi: exact (24 bytes per supersegment before they are compressed; default of "
        "generate) or 8-byte; convert keeps what the file has; of .html: 8-byte by "
        "default",
        choices=PRECISIONS,
    )


def scheduler(options: Options) -> None:
    """Add the cluster."""
    text = "of stores: VDIs are made by the workers of the Dask cluster with this scheduler"
    option(options, "--scheduler", text, "ADDRESS")


def device(options: Options) -> None:
    """Add the OpenCL device."""
    option(options, "--device", "OpenCL device, see pyvista-vdi devices", "NAME")
