"""The verbs that report, ``devices`` and ``info``, and ``convert``."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pyvista_vdi.cli.text import LENGTHS, mebibytes, plain_number, table, vector
from pyvista_vdi.io.stores import StoredVolume

if TYPE_CHECKING:
    from pyvista_vdi.io import FileInfo
    from pyvista_vdi.model.volume import Volume


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
    """Print what a file says about itself: a VDI, or a volume."""
    from pyvista_vdi.cli.inputs import is_volume, read_volume, volume_name
    from pyvista_vdi.io import read_info

    if (own := _own_verbs(options.file)) is not None:
        return int(own.info(options))
    if is_volume(options):
        rows = _of_volume(read_volume(options, in_chunks=True))
        source = options.file or volume_name(options)
        print(json.dumps(rows, indent=1) if options.json else _volume_text(source, rows))
        return 0
    about = read_info(options.file)
    print(json.dumps(state_of(about), indent=1) if options.json else text_of(about))
    return 0


def convert(options: argparse.Namespace) -> int:
    """Read a VDI and write it in the format of another name."""
    from pyvista_vdi.api import read
    from pyvista_vdi.cli.inputs import (
        classification,
        file_options,
        given_camera,
        measuring,
        part,
        require_vdi,
        say_vdi,
        with_look,
    )
    from pyvista_vdi.io import checked_target
    from pyvista_vdi.io.files import format_named
    from pyvista_vdi.model.deferred import DeferredVDI

    if (own := _own_verbs(options.file)) is not None:
        return int(own.convert(options))
    require_vdi(options.file, "convert")
    target = checked_target(options.output)
    file_arguments = file_options(options)
    foreign = {"camera": given_camera(options), "thickness": options.thickness}
    given = {name: value for name, value in foreign.items() if value is not None}
    with measuring("converting") as bar:
        vdi = read(options.file, progress=part(bar, 0.0, 0.5, "reading"), **given)
        written_as = format_named(target)
        if written_as and written_as.page and isinstance(vdi, DeferredVDI):
            file_arguments |= classification(options)  # that the page begins with
        else:
            vdi = with_look(options, vdi, options.file, colors=target.suffix != ".vdi")
        vdi.save(target, progress=part(bar, 0.5, 1.0, "writing"), **file_arguments)
    say_vdi(options, vdi)
    return 0


def _own_verbs(file: str | None) -> Any:
    """Return the module with the verbs of a file's format, where it has its own."""
    from pyvista_vdi.io.files import format_of

    found = None if file is None else format_of(file)
    return import_module(found.verbs) if found is not None and found.verbs else None


def _of_volume(volume: Volume) -> dict[str, Any]:
    # What all chunks hold is not read for this: there may be terabytes
    rows = {
        "dimensions": volume.dimensions,
        "scalars": volume.name,
        "type": f"{volume.array.dtype}{', RGBA' if volume.rgba else ''}",
        "range": None if volume.chunked else volume.finite_range(),
        "spacing": volume.spacing,
        "origin": volume.origin,
        "direction": volume.direction.tolist(),
        "bounds": volume.bounds,
        "unit": volume.unit,
        "memory_bytes": volume.array.nbytes,
    }
    return {**rows, "store": _of_store(volume)} if isinstance(volume, StoredVolume) else rows


def _of_store(volume: StoredVolume) -> dict[str, Any]:
    store, array = volume.store, volume.chunks
    return {
        "kind": store.kind,
        "axes": dict(zip(store.axes, store.levels[0].array.shape, strict=True)),
        "channels": store.channels,
        "chunks": array.chunks[::-1] if array else (),
        "levels": [
            {"path": one.path, "dimensions": one.grid.dimensions, "spacing": one.grid.spacing}
            for one in store.levels
        ],
    }


def _volume_text(source: str, about: dict[str, Any]) -> str:
    """Return what is known of a volume."""
    turned = about["direction"] != [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    axes = zip(*about["direction"], strict=True)
    return table(
        {
            "volume": source,
            "points": " x ".join(str(n) for n in about["dimensions"]),
            "scalars": f"{about['scalars']}, {about['type']}, "
            + ("{:g} to {:g}".format(*about["range"]) if about["range"] else "range not known yet"),
            "spacing": vector(about["spacing"]),
            "origin": vector(about["origin"]),
            **({"axes": ", ".join(vector(axis) for axis in axes)} if turned else {}),
            "bounds": vector(about["bounds"]),
            **({"lengths": f"in {about['unit']}"} if about["unit"] else LENGTHS),
            "in memory": mebibytes(about["memory_bytes"]),
            **(_store_rows(about["store"]) if "store" in about else {}),
        }
    )


def _store_rows(store: dict[str, Any]) -> dict[str, str]:
    axes = ", ".join(f"{count} along {axis}" for axis, count in store["axes"].items())
    levels = {
        f"level {k}": f"{' x '.join(str(n) for n in level['dimensions'])} points, spacing "
        f"{vector(level['spacing'])}"
        for k, level in enumerate(store["levels"])
    }
    return {
        "store": f"{store['kind']}: {axes}",
        "chunks": " x ".join(str(n) for n in store["chunks"]),
        **({"channels": ", ".join(store["channels"])} if store["channels"] else {}),
        **levels,
    }


def state_of(about: FileInfo) -> dict[str, Any]:
    """Return what a file says about itself, as JSON can hold it."""
    return {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}


def text_of(about: FileInfo) -> str:
    """Return what a file says about itself, as a table."""
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
        **({} if about.deferred is None else of_values(about.deferred["value_range"])),
        "supersegments": f"{about.n_supersegments}, "
        f"{about.n_supersegments / (width * height):.2f} per list",
        "precision": about.precision,
        "in memory": mebibytes(about.memory_bytes),
        "eye": vector(view.position),
        "looking at": f"{vector(view.focal_point)}, up {vector(view.view_up)}, {lens}",
        "bounds": vector(about.bounds),
        "depth origin": plain_number(about.depth_origin),
        **LENGTHS,
        **{name: _short(value) for name, value in about.metadata.items()},
    }
    return table(rows)


def of_values(value_range: Sequence[float]) -> dict[str, str]:
    """Return what is known of lists that keep values."""
    low, high = value_range
    return {"kind": f"values from {low:g} to {high:g}, classified afterwards"}


def _short(value: Any, longest: int = 100) -> str:
    """Return a metadata entry in one line; tables are left to ``--json``."""
    text = json.dumps(value)
    return text if len(text) <= longest else text[: longest - 4] + " ..."
