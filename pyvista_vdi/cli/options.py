"""Options that several verbs have, and their types."""

from __future__ import annotations

import argparse
import re
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.checks import memory_limit_bytes
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.quality.dial import QUALITIES, TARGET_ANGLE


def add_volume(parser: argparse.ArgumentParser) -> None:
    """Add the volume: a file's name, or one that is known."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "volume",
        metavar="VOLUME",
        nargs="?",
        help="a file that PyVista reads as a uniform grid (.nrrd, .mha, .nii, .vti, ...), .npy, "
        "a raw file named like x_1024x1024x795_uint8.raw, or a folder of DICOM slices",
    )
    source.add_argument("--example", metavar="NAME", help="a volume known by name, e.g. brain")


def add_size(parser: argparse.ArgumentParser, default: tuple[int, int] | None) -> None:
    """Add the window's size, pixels; the VDI's own without a default."""
    shown = "the VDI's" if default is None else f"{default[0]}x{default[1]}"
    parser.add_argument(
        "--size",
        type=parse_size,
        metavar="WxH",
        default=default,
        help=f"window size in pixels (default: {shown})",
    )


def add_camera(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the view; ``default`` says in words what it is without these options."""
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


def add_classification(parser: argparse.ArgumentParser, *, tables: bool = True) -> None:
    """Add how the volume looks; ``tables``: also its transfer function as a file."""
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
        "--opacity", type=parse_opacity, metavar="NAME|A,B,...", help="name, or values from 0 to 1"
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


def add_occlusion(parser: argparse.ArgumentParser) -> None:
    """Add ambient occlusion."""
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


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Add how much a VDI may hold, and how finely the volume is sampled."""
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
        type=parse_bytes,
        metavar="SIZE",
        help="most memory to take on the device, like 2GiB; a volume that does not fit goes there "
        "brick by brick (default: what the device has)",
    )


def add_dial(parser: argparse.ArgumentParser) -> None:
    """Add goals, from which the limits are chosen."""
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


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add the OpenCL device."""
    parser.add_argument("--device", metavar="NAME", help="OpenCL device, see pyvista-vdi devices")


# -- types of options ------------------------------------------------------------------------------


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height, pixels, from ``1280x720``."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT, like 1280x720; got {text!r}")
    try:
        return check_window_size((int(match[1]), int(match[2])), name="the size")
    except InvalidArgumentError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def parse_numbers(text: str) -> tuple[float, ...]:
    """Return numbers from ``0,5,30``."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"expected numbers with commas between them, like 0,5,30; got {text!r}"
        ) from error


def parse_bytes(text: str) -> int | None:
    """Return bytes from ``2GiB``."""
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


def parse_rate(text: str) -> float:
    """Return frames per second."""
    try:
        rate = float(text)
    except ValueError:
        rate = -1.0
    if not 0 <= rate < float("inf"):
        raise argparse.ArgumentTypeError(f"expected frames per second, 0 or above; got {text!r}")
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
