"""The subcommands that report, ``devices`` and ``info``, and ``convert``."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from dataclasses import asdict
from typing import Any

from pyvista_vdi.cli.text import printable

#: Longest value in a table; the whole is in JSON.
_LONGEST = 100


def devices(options: argparse.Namespace) -> int:
    """Print every OpenCL device; exit status 1 if none is usable."""
    from pyvista_vdi.device import describe_devices, list_devices

    infos = list_devices()
    shown = json.dumps([asdict(info) for info in infos], indent=1) if options.json else ""
    print(shown or describe_devices())
    return 0 if any(info.usable for info in infos) else 1


def info(options: argparse.Namespace) -> int:
    """Print what a file says about itself: a VDI, several, or a volume."""
    from pyvista_vdi.cli.inputs import is_volume, read_volume
    from pyvista_vdi.io import read, read_info
    from pyvista_vdi.io.files import holds

    if is_volume(options):
        state = _of_volume(read_volume(options, in_chunks=True))
    else:
        about = read_info(options.file)  # of several of the first
        state = {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}
        if holds(options.file) == "series":
            state["times"] = read(options.file).times
        elif holds(options.file) == "set":
            state["views"] = [view.to_dict() for view in read(options.file).cameras]
    print(json.dumps(state, indent=1) if options.json else _table(state))
    return 0


def _of_volume(volume: Any) -> dict[str, Any]:
    """Return what is known of a volume, as JSON can hold it."""
    about = {
        "dimensions": volume.dimensions,
        "scalars": volume.name,
        "type": f"{volume.array.dtype}{', RGBA' if volume.rgba else ''}",
        # What all chunks hold is not read for this: there may be terabytes
        "range": None if volume.chunked else volume.finite_range(),
        "spacing": volume.spacing,
        "origin": volume.origin,
        "direction": volume.direction.tolist(),
        "bounds": volume.bounds,
        "unit": volume.unit,
        "memory_bytes": volume.array.nbytes,
    }
    if (store := getattr(volume, "store", None)) is not None:
        about |= {
            "store": store.kind,
            "axes": dict(zip(store.axes, store.levels[0].array.shape, strict=True)),
            "channels": store.channels,
            "chunks": volume.array.chunks[::-1] if volume.chunked else (),
        }
        for k, level in enumerate(store.levels):
            about[f"level {k}"] = {"points": level.grid.dimensions, "spacing": level.grid.spacing}
    return about


def _table(state: dict[str, Any]) -> str:
    """Return what is known, an entry a line; metadata are entries like the others."""
    rows = {**state, **state.get("metadata", {})}
    rows.pop("metadata", None)
    lines, column = [], max(map(len, rows))
    for name, value in rows.items():
        text = value if isinstance(value, str) else json.dumps(value)
        text = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."
        lines.append(printable(f"{name:<{column}}  {text}"))
    return "\n".join(lines)


def convert(options: argparse.Namespace) -> int:
    """Write a VDI, or a series or a set, in the format of another name."""
    from pyvista_vdi.api import read
    from pyvista_vdi.cli import inputs
    from pyvista_vdi.cli.generate import say_vdi
    from pyvista_vdi.io import checked_target
    from pyvista_vdi.io.files import format_named, holds
    from pyvista_vdi.model.camera import Camera
    from pyvista_vdi.plotting.progress import DelayedBar

    arguments, foreign = inputs.file_options(options), {}
    target, of_several = format_named(options.output), holds(options.file) in ("series", "set")
    if not of_several:
        checked_target(options.output)
    if options.camera_json is not None:
        foreign["camera"] = inputs.from_json(options.camera_json, Camera.from_dict, "camera")
    if options.thickness is not None:
        foreign["thickness"] = options.thickness
    with closing(DelayedBar(label="converting")) as bar:
        found: Any = read(options.file, progress=bar, **foreign)
        page = getattr(target, "page", False)
        keeps = page or getattr(target, "values", False) or of_several
        look = inputs.look_for(options, found, options.file, colors=not keeps)
        if page:
            arguments |= look  # that the page begins with
        elif look:
            found = found.classified(**look)
        found.save(options.output, progress=bar, **arguments)
    say_vdi(options, found)
    return 0
