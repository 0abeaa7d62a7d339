"""The options of subcommands: what each is called, how its value is read, and what help says.

Those of the public functions are made of the records that declare them. One that is not given is
``None``, unless a default stands here: what it means is then up to the function.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.checks import as_float, memory_limit_bytes
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget, declared
from pyvista_vdi.model.render_options import DrawingOptions, RenderOptions
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS


def number(
    what: str, low: float = -math.inf, high: float = math.inf, *, whole: bool = False
) -> Callable[[str], Any]:
    """Return what reads a number between two, which neither NaN nor infinity is."""

    def read(text: str) -> float:
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low <= value <= high):
            raise argparse.ArgumentTypeError(f"expected {what}; got {text!r}")
        return value

    return read


NUMBER = number("a number, like 0.5")
WHOLE = number("a whole number", whole=True)
COUNT = number("a whole number above 0", 1, whole=True)
RATE = number("frames per second, 0 or above", 0)
#: Of what moves: more than any screen shows is no rate.
FPS = number("frames per second, above 0 and up to 1000", math.ulp(0.0), 1000)


def numbers(text: str) -> tuple[float, ...]:
    """Return numbers from ``0,5,30``."""
    found = tuple(map(as_float, text.split(",")))
    if not all(map(math.isfinite, found)):
        raise argparse.ArgumentTypeError(
            f"expected numbers with commas between them, like 0,5,30; got {text!r}"
        )
    return found


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height, pixels, from ``1280x720``."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"a size is WIDTHxHEIGHT, like 1280x720; got {text!r}")
    try:
        return check_window_size((int(match[1]), int(match[2])), name="the size")
    except InvalidArgumentError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _bytes(text: str) -> int | None:
    try:
        return memory_limit_bytes(text)
    except InvalidArgumentError:
        message = f"expected a size such as 2GiB or 800MB; got {text!r}"
        raise argparse.ArgumentTypeError(message) from None


def _level(text: str) -> int | str:
    if text != "auto" and not text.isdecimal():
        raise argparse.ArgumentTypeError(
            f"expected auto, or a level's number from 0, the finest; got {text!r}"
        )
    return text if text == "auto" else int(text)


def _number_or_name(text: str) -> int | str:
    return int(text) if text.isdecimal() else text


def _opacity(text: str) -> str | list[float]:
    return list(numbers(text)) if re.match(r"[-+.\d]", text) else text


def color(text: str) -> tuple[float, ...]:
    """Return RGB, each from 0 to 1, from a name or numbers."""
    if re.match(r"[-+.\d]", text):
        found = numbers(text)
        if len(found) != 3 or not all(0 <= c <= 1 for c in found):
            raise argparse.ArgumentTypeError(f"expected R,G,B from 0 to 1; got {text!r}")
        return found
    from PIL import ImageColor

    try:
        return tuple(c / 255 for c in ImageColor.getrgb(text)[:3])
    except ValueError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no colour: give a name, #rrggbb or R,G,B from 0 to 1"
        ) from error


class Option(NamedTuple):
    """An option: its text in help, what its value is called there, and what reads it.

    ``value``: a name for each of several values; none for a switch, which has no value.
    ``default``: what it has where it is not given; ``usual``: what that means, if that is ``None``.
    """

    text: str
    value: str | tuple[str, ...] = ""
    read: Callable[[str], Any] | None = None
    choices: tuple[str, ...] = ()
    default: Any = None
    usual: Any = None


_XYZ, _RANGE = ("X", "Y", "Z"), ("LOW", "HIGH")
#: How values are given, by the types of options in the records.
_BY_KIND: dict[str, tuple[Any, ...]] = {
    "bool": ("", None),
    "OcclusionLike": ("", None),
    "int": ("N", WHOLE),
    "float": ("X", NUMBER),
    "MemoryLike": ("SIZE", _bytes),
    "RangeLike": (_RANGE, NUMBER),
    "ArrayLike": ("A,B,...", numbers),
    "OpacityLike": ("NAME|A,B,...", _opacity),
}


def _of_records() -> dict[str, Option]:
    """Return the options that the records declare."""
    found = {}
    records = (RenderOptions, DrawingOptions, Classification, Deferral)
    for name, told in declared(*records, GenerationOptions, QualityTarget).items():
        value, read = _BY_KIND.get(told.kind.removesuffix(" | None"), ("NAME", None))
        value = "DEGREES" if "degrees" in told.what else value
        number = isinstance(told.default, int | float) and not isinstance(told.default, bool)
        text, choices = told.what.replace("``", ""), told.choices
        usual = told.default if number or choices else None
        found[name] = Option(text, "" if choices else value, read, choices, usual=usual)
    return found


#: What is said of options of the records for people at a command line.
_SAID = {
    "opacity": "name, one opacity, or opacities, 0 to 1",
    "memory_limit": "most memory to take on the device, like 2GiB; what does not fit goes there in "
    "bricks (default: all)",
    "max_bytes": "most bytes of the VDI on the device, like 20MB",
    "transmittance_cutoff": "a ray ends where less light than this is left, 0 to below 1; for a "
    "single file (default: 0.000001)",
}

OPTIONS = _of_records()
OPTIONS |= {name: OPTIONS[name]._replace(text=text) for name, text in _SAID.items()}
OPTIONS["max_bytes"] = OPTIONS["max_bytes"]._replace(value="SIZE", read=_bytes)
OPTIONS |= {
    "output": Option(".vdi, .exr or .html to write", "FILE"),
    "size": Option("window size in pixels", "WxH", parse_size),
    "spacing": Option("between voxels, in place of what the file says", _XYZ, NUMBER),
    "origin": Option("of its first voxel, in the same way", _XYZ, NUMBER),
    "level": Option(
        "of a multi-scale store: 0 is the finest; auto (default): what the view requires",
        *("auto|N", _level),
    ),
    "channel": Option("of a file that holds several", "N|NAME", _number_or_name),
    "series": Option("of a DICOM folder or a TIFF file of several", "N|NAME", _number_or_name),
    "time_index": Option("which step of several", "N", WHOLE),
    "position": Option("eye, world coordinates", _XYZ, NUMBER),
    "focal_point": Option("point looked at, world coordinates", _XYZ, NUMBER),
    "view_up": Option("direction that is up", _XYZ, NUMBER),
    "view_angle": Option("vertical, full", "DEGREES", NUMBER),
    "parallel_scale": Option(
        "half the viewport's height in world units; makes the projection parallel",
        *("LENGTH", NUMBER),
    ),
    "camera_json": Option("Camera.to_dict() as JSON", "FILE"),
    "azimuth": Option("turn by", "DEGREES", NUMBER, default=0.0),
    "elevation": Option("lift by", "DEGREES", NUMBER, default=0.0),
    "tf": Option(
        "a standard transfer function; --cmap and --opacity change parts of it",
        choices=tuple(TRANSFER_FUNCTIONS),
    ),
    "transfer_function": Option("TransferFunction.to_dict() as JSON; needs no PyVista", "FILE"),
    "occlusion_radius": Option(
        "how far something hides, model units", "LENGTH", NUMBER, usual="0.05 of the diagonal"
    ),
    "occlusion_strength": Option("0 to 1, which is darkest", "S", NUMBER, usual=0.1),
    "compression": Option(
        "of .vdi: lz4 (default), zstd, deflate or none; of .html: deflate",
        choices=("lz4", "zstd", "deflate", "none"),
    ),
    "compression_level": Option("1 (fast) to 9 (small)", "N", WHOLE),
    "time": Option("of a series, the step nearest in time", "T", NUMBER, usual="the first"),
    "background": Option("a name, #rrggbb or R,G,B from 0 to 1", "COLOR", color),
    "scheduler": Option("of stores: Dask's scheduler, whose workers make the VDIs", "ADDRESS"),
    "device": Option("OpenCL device, see pyvista-vdi devices", "NAME"),
    "json": Option("print JSON"),
    "out": Option("where the files go", "FOLDER", default="."),
    "no_vtk": Option("leave out VTK's mappers"),
}

_LOOK = "tf cmap opacity clim n_colors opacity_unit_distance flip_scalars log_scale"
_OF_VOLUMES = "shade scalars preference interpolation ambient diffuse specular specular_power"
#: Options that stand together in help: title, what is said of them, and their names.
_GROUPS = {
    "camera": (
        *("camera", "By default {}."),
        "position focal_point view_up view_angle parallel_scale camera_json azimuth elevation",
    ),
    "look": (
        *("classification", "Names, defaults and meaning are those of PyVista's add_volume."),
        f"{_LOOK} {_OF_VOLUMES} transfer_function",
    ),
    "values": ("classification", "Of VDIs that keep values.", f"{_LOOK} transfer_function"),
    "deferral": (
        "classified afterwards",
        "Values are kept: convert, render and view then take the look.",
        "classification value_range importance",
    ),
    "occlusion": (
        *("ambient occlusion", "Either option below turns it on, too."),
        "ambient_occlusion occlusion_radius occlusion_strength",
    ),
    "limits": (
        *("limits", ""),
        "max_supersegments criterion sample_distance tolerance view_cone memory_limit",
    ),
    "quality": (
        "quality",
        "Lists and precision are chosen by a short measurement; --size is that of pictures.",
        "quality target_ssim full_fps max_bytes target_angle",
    ),
    "file": ("file", "", "compression compression_level precision"),
}

#: The arguments without a name: in help, and what they are; a volume may be one that is shipped.
_VDI = "a .vdi file, a series, .vdis, a set, .vdiset, an .exr deep image, or a page, .html"
_VOLUME = "a file (.nii.gz, .nrrd, .mha, .tif, .mrc, .h5, .vti, .npy, ...), a folder of slices "
_VOLUME += "(DICOM, TIFF or PNG), or a store of chunks (.ome.zarr, .zarr, x.h5::/path)"
_STEPS = "; several are time steps, step_2 before step_10, and so are those of a store or a .pvd"
_SOURCES = {
    "volume": ("VOLUME", _VOLUME),
    "volumes": ("VOLUME", _VOLUME + _STEPS),
    "vdi": ("FILE", _VDI),
    "vdis": ("FILE", _VDI),
    "vdi_or_volume": ("FILE", f"{_VDI}; or a volume: {_VOLUME}"),
    "vdis_or_volumes": ("FILE", f"VDIs; or volumes, each {_VOLUME}{_STEPS}"),
}


def add(parser: argparse._ActionsContainer, names: str, **changes: Any) -> None:
    """Add options, arguments, and groups of options, which end in a colon, in this order.

    ``changes``: of an option its text, its default or all of it, in place of what stands above, or
    ``False`` where it is left out; of a group what is put into its text.
    """
    for name in names.split():
        if name in _SOURCES:
            _add_source(parser, name)
        elif name.endswith(":"):
            title, text, inside = _GROUPS[name[:-1]]
            group = parser.add_argument_group(title, text.format(changes.get(name[:-1])) or None)
            add(group, inside, **changes)
        else:
            _add_option(parser, name, changes.get(name))


def _add_source(parser: argparse._ActionsContainer, name: str) -> None:
    """Add what a subcommand reads: files, or a volume that is known by its name."""
    called, text = _SOURCES[name]
    many = name in ("volumes", "vdis", "vdis_or_volumes")
    if "volume" not in name or name == "vdis_or_volumes":
        if many:
            parser.add_argument("files", help=text, metavar=called, nargs="+")
        else:
            parser.add_argument("file", help=text, metavar=called)
        return
    source = parser.add_mutually_exclusive_group(required=True)
    if many:
        source.add_argument("files", help=text, metavar=called, nargs="*", default=[])
    else:
        source.add_argument("file", help=text, metavar=called, nargs="?")
    example = "a volume known by name: brain, ct and rayleigh_taylor are shipped, others are read "
    example += "from the folder that PYVISTA_VDI_DATA names"
    source.add_argument("--example", help=example, metavar="NAME")
    add(parser, "spacing origin level channel series time_index")


def _add_option(parser: argparse._ActionsContainer, name: str, change: Any) -> None:
    if change is False:
        return
    option: Option = change if isinstance(change, Option) else OPTIONS[name]
    if isinstance(change, str):
        option = option._replace(text=change)
    elif change is not None and not isinstance(change, Option):
        option = option._replace(default=change)
    text, value, read, choices, default, usual = option
    usual = default if usual is None or default is not None else usual
    if usual is not None and "default" not in text:
        joined = "x" if name in ("size", "lists") else ","
        shown = usual if isinstance(usual, tuple) else (usual,)
        said = joined.join(n if isinstance(n, str) else f"{n:g}" for n in shown)
        text += f" (default: {said})"
    how: dict[str, Any] = {"help": text, "default": default}
    if not value and not choices:
        how["action"] = "store_true"
    else:
        how |= {"metavar": value or None, "type": read, "choices": choices or None}
        how |= {"nargs": len(value)} if isinstance(value, tuple) else {}
        how |= {"required": True} if name == "output" else {}
    flags = ["-o"] if name == "output" else []
    parser.add_argument(*flags, f"--{name.replace('_', '-')}", **how)
