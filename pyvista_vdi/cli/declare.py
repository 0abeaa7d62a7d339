"""The options of subcommands: what each is called, how its value is read, and what help says.

They are written as help shows them, a line each: name, value and text with two spaces or more
between them. What the value is called says how it is read; a name may have a default, ``size=8x6``,
and one that has not been given is ``None``. Options of the public functions need no line: they are
made of the records that declare them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import (
    Deferral,
    DrawingOptions,
    GenerationOptions,
    QualityTarget,
    RenderOptions,
)


def _numbers_as(
    called: str, kind: type, low: float = -math.inf, high: float = math.inf
) -> Callable[[str], Any]:
    """Return what reads a number between two, which is neither NaN nor infinite."""

    def read(text: str) -> Any:
        value = kind(text)
        if not (math.isfinite(as_float(value)) and low <= value <= high):
            raise ValueError
        return value

    read.__name__ = called  # argparse says: invalid number value: 'x'
    return read


NUMBER = _numbers_as("number", float)


def numbers(text: str) -> tuple[float, ...]:
    """Return numbers from ``0,5,30``."""
    return tuple(map(NUMBER, text.split(",")))


def size(text: str) -> tuple[int, int]:
    """Return width and height, pixels, from ``1280x720``."""
    width, height = map(int, text.lower().split("x"))
    return check_window_size((width, height))


def level(text: str) -> int | str:
    """Return ``auto``, or a level's number."""
    return text if text == "auto" else int(_numbers_as("level", int, 0)(text))


def opacity(text: str) -> str | tuple[float, ...]:
    """Return a name, or numbers from ``0,0.5,1``."""
    return numbers(text) if re.match(r"[-+.\d]", text) else text


def color(text: str) -> tuple[float, ...]:
    """Return RGB, each from 0 to 1, from a name or ``#rrggbb``."""
    from PIL import ImageColor

    return tuple(c / 255 for c in ImageColor.getrgb(text)[:3])


#: What reads a value, by what it is called: a text, where that is not here.
_READERS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("X", "X Y Z", "LOW HIGH", "DEGREES", "LENGTH", "S", "T"), NUMBER),
    "N": _numbers_as("whole number", int),
    "COUNT": _numbers_as("count", int, 1),
    "RATE": _numbers_as("rate", float, 0),
    "PORT": _numbers_as("port", int, 0, 65535),
    "WxH": size,
    "A,B,...": numbers,
    "COLOR": color,
    "auto|N": level,
    "N|NAME": lambda text: int(text) if text.isdecimal() else text,
    "NAME|A,B,...": opacity,
}
#: What values are called, by the types of options in the records; of others ``NAME``.
_CALLED = {
    "bool": "-",
    "OcclusionLike": "-",
    "int": "N",
    "float": "X",
    "RangeLike": "LOW HIGH",
    "OpacityLike": "NAME|A,B,...",
}
_RECORDS = (RenderOptions, DrawingOptions, Classification, Deferral, GenerationOptions)

_OPTIONS = """
output              FILE      .vdi, .exr or .html to write
size                WxH       window size in pixels
spacing             X Y Z     between voxels, in place of what the file says
origin              X Y Z     of its first voxel, in the same way
level               auto|N    of a multi-scale store: 0 is the finest; by default by the view
channel             N|NAME    of a file that holds several
series              N|NAME    of a DICOM folder or a TIFF file that holds several
time_index          N         which step of several
position            X Y Z     eye, world coordinates
focal_point         X Y Z     point looked at, world coordinates
view_up             X Y Z     direction that is up
view_angle          DEGREES   vertical, full
parallel_scale      LENGTH    half the viewport's height; makes the projection parallel
camera_json         FILE      Camera.to_dict() as JSON
azimuth=0           DEGREES   turn by
elevation=0         DEGREES   lift by
transfer_function   FILE      TransferFunction.to_dict() as JSON; needs no PyVista
memory_limit        N         bytes of the device; what does not fit goes there in bricks
compression         {lz4,zstd,deflate,none}  of .vdi, by default lz4; .html has deflate
compression_level   N         1 (fast) to 9 (small)
time                T         of a series, the step nearest in time (default: the first)
background          COLOR     a name or #rrggbb
scheduler           ADDRESS   of stores: that of Dask, whose workers make the VDIs
device              NAME      OpenCL device, see pyvista-vdi devices
json                -         print JSON
out=.               FOLDER    where the files go
angles              A,B,...   degrees from the generating view
no_vtk              -         leave out VTK's mappers
"""

#: Options that stand together in help, after their title and what is said of them.
_GROUPS = {
    "camera": """[camera] By default {}.
        position focal_point view_up view_angle parallel_scale camera_json azimuth elevation""",
    "look": """[classification] Names, defaults and meaning are those of PyVista's add_volume.
        cmap opacity clim n_colors opacity_unit_distance flip_scalars log_scale shade
        scalars preference interpolation ambient diffuse specular specular_power""",
    "values": """[classification] Of VDIs that store scalars.
        cmap opacity clim n_colors opacity_unit_distance flip_scalars log_scale
        transfer_function""",
    "deferral": """[classified afterwards] Scalars are stored; render, view, convert take looks.
        classification value_range""",
}
_GROUPS["table"] = f"{_GROUPS['look']} transfer_function"

_VDI = "a .vdi file, a series, .vdis, a set, .vdiset, an .exr deep image, or a page, .html"
_VOLUME = (
    "a file (.nii.gz, .nrrd, .mha, .tif, .h5, .vti, .npy, ...), a folder of slices "
    "(DICOM, TIFF, PNG), or a store of chunks (.ome.zarr, .zarr, x.h5::/path)"
)
_STEPS = "; several are time steps, step_2 before step_10, and so are those of a store"
#: What is read, by names for it: of which some may be a volume that is known by its name.
_FILES = {
    "VDI": _VDI,
    "VDIS": _VDI,
    "VOLUME": _VOLUME,
    "VOLUMES": _VOLUME + _STEPS,
    "VDI|VOLUME": f"{_VDI}; or a volume: {_VOLUME}",
    "VDIS|VOLUMES": f"VDIs; or volumes, each {_VOLUME}{_STEPS}",
}


def add(parser: Any, lines: str) -> None:
    """Add options that are written as help shows them.

    A line is an option; or the names of some that are known, of files (in capitals) and of groups,
    which end in a colon, behind which the rest of the line is put into their text; or the title of
    a group in brackets, to which those belong that follow.
    """
    into = parser
    for line in map(str.strip, lines.splitlines()):
        group, _, said = line.partition(": ")
        if line.startswith("["):
            title, _, said = line[1:].partition("]")
            into = parser.add_argument_group(title, said.strip() or None)
        elif said and "{}" in _GROUPS.get(group, ""):
            add(parser, _GROUPS[group].format(said))
        elif "  " in line:
            _add_option(into, *re.split(" {2,}", line, maxsplit=2))
        else:
            for name in line.split():
                if name in _FILES:
                    _add_files(parser, name)
                elif name.endswith(":"):
                    add(parser, _GROUPS[name[:-1]])
                else:
                    known, value, text = _KNOWN[name.partition("=")[0]]
                    _add_option(into, name if "=" in name else known, value, text)


def _add_files(parser: Any, what: str) -> None:
    """Add what a subcommand reads, which may be a volume that is known by its name."""
    several, called = "S" in what, "VOLUME" if what.startswith("VOLUME") else "FILE"
    how: dict[str, Any] = {"help": _FILES[what], "metavar": called}
    if "VOLUME" not in what or what == "VDIS|VOLUMES":
        parser.add_argument("files" if several else "file", nargs="+" * several or None, **how)
        return
    into = parser.add_mutually_exclusive_group(required=True)
    name, default = ("files", ()) if several else ("file", None)
    into.add_argument(name, nargs="*" if several else "?", default=default, **how)
    text = "a volume known by name: brain, ct and rayleigh_taylor are shipped, others are read from"
    text += " the folder that PYVISTA_VDI_DATA names"
    into.add_argument("--example", help=text, metavar="NAME")
    add(parser, "spacing origin level channel series time_index")


def _add_option(into: Any, name: str, value: str, text: str) -> None:
    """Add an option; one whose value has a ``+`` may be repeated."""
    name, _, default = name.partition("=")
    how: dict[str, Any] = {"help": f"{text} (default: {default})" if default else text}
    names, read = value.split(), _READERS.get(value, str)
    if value == "-":
        how |= {"action": "store_true", "default": None}
    elif value.startswith("{"):
        how |= {"choices": value[1:-1].split(","), "default": default or None}
    elif value.endswith((" ...", " +")):
        how |= {"metavar": names[0]}
        how |= {"nargs": "+"} if names[1] == "..." else {"action": "append"}
    else:
        how |= {"type": read, "metavar": tuple(names) if names[1:] else value}
        how |= {"nargs": len(names)} if names[1:] else {}
        how |= {"default": read(default)} if default else {}
    if name == "output":
        how["required"] = True
    short = ["-o"] if name == "output" else []
    into.add_argument(*short, f"--{name.replace('_', '-')}", **how)


def _known() -> dict[str, tuple[str, str, str]]:
    """Return the options that are known by their names: name and default, value, and text."""
    found = {}
    for told in [told for each in (*_RECORDS, QualityTarget) for told in each.declared.values()]:
        value = _CALLED.get(told.kind.removesuffix(" | None"), "NAME")
        value = "DEGREES" if "degrees" in told.what else value
        value = "{" + ",".join(told.choices) + "}" if told.choices else value
        text, usual = told.what.replace("``", ""), told.default
        plain = isinstance(usual, int | float) and not isinstance(usual, bool)
        text += f" (default: {usual:g})" if plain else ""
        text += f" (default: {usual})" if told.choices and usual else ""
        found[told.name] = told.name, value, text
    for line in _OPTIONS.strip().splitlines():
        name, value, text = re.split(" {2,}", line, maxsplit=2)
        found[name.partition("=")[0]] = name, value, text
    return found


_KNOWN = _known()
