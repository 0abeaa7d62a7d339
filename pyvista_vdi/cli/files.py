"""The verbs that report, ``devices`` and ``info``, and ``convert``."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pyvista_vdi.cli.text import mebibytes, printable

if TYPE_CHECKING:
    from pyvista_vdi.io import FileInfo


def devices(options: argparse.Namespace) -> int:
    """Print every OpenCL device; exit status 1 if none is usable."""
    from pyvista_vdi.device import describe_devices, list_devices

    infos = list_devices()
    if options.json:
        print(json.dumps([asdict(info) for info in infos], indent=1))
    else:
        print(describe_devices())
    return 0 if any(info.usable for info in infos) else 1


def info(options: argparse.Namespace) -> int:
    """Print what a file says about itself."""
    from pyvista_vdi.io import read_info

    about = read_info(options.file)
    state = {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}
    print(json.dumps(state, indent=1) if options.json else _text(about))
    return 0


def convert(options: argparse.Namespace) -> int:
    """Read a VDI and write it in the format of another name."""
    from pyvista_vdi.api import read
    from pyvista_vdi.cli.inputs import file_options, given_camera, say_vdi
    from pyvista_vdi.io import checked_target

    target = checked_target(options.output)
    file_arguments = file_options(options)
    foreign = {"camera": given_camera(options), "thickness": options.thickness}
    vdi = read(options.file, **{name: v for name, v in foreign.items() if v is not None})
    vdi.save(target, **file_arguments)
    say_vdi(options, vdi)
    return 0


def _text(about: FileInfo) -> str:
    width, height = about.window_size
    view = about.camera
    lens = (
        f"parallel scale {view.parallel_scale:g}"
        if view.parallel_projection
        else f"view angle {view.view_angle:g} degrees"
    )
    rows = {
        "file": f"{about.path}, {mebibytes(about.file_bytes)}, {about.codec}",
        "written by": f"{about.written_by}, format version {about.format_version}",
        "lists": f"{width} x {height}",
        "supersegments": f"{about.n_supersegments}, "
        f"{about.n_supersegments / (width * height):.2f} per list",
        "precision": about.precision,
        "in memory": mebibytes(about.memory_bytes),
        "eye": _vector(view.position),
        "looking at": f"{_vector(view.focal_point)}, up {_vector(view.view_up)}, {lens}",
        "bounds": _vector(about.bounds),
        "depth origin": f"{about.depth_origin:g}",
        **{name: _short(value) for name, value in about.metadata.items()},
    }
    column = max(len(name) for name in rows)
    return "\n".join(printable(f"{name:<{column}}  {value}") for name, value in rows.items())


def _vector(values: Any) -> str:
    return f"({', '.join(f'{v:g}' for v in values)})"


def _short(value: Any, longest: int = 100) -> str:
    """Return a metadata entry in one line; tables are left to ``--json``."""
    text = json.dumps(value)
    return text if len(text) <= longest else text[: longest - 4] + " ..."
