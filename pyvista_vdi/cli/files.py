"""The subcommands that report, ``devices`` and ``info``, and ``convert``."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pyvista_vdi.cli.text import mebibytes, plain_number, printable, table, vector

if TYPE_CHECKING:
    from pyvista_vdi.io import FileInfo
    from pyvista_vdi.model.volume import Volume

#: What lengths and positions in tables are measured in: files of VDIs say no more.
_LENGTHS = "in the units of the volume's spacing, model units"


def devices(options: argparse.Namespace) -> int:
    """Print every OpenCL device; exit status 1 if none is usable."""
    from pyvista_vdi.device import describe_devices, list_devices

    infos = list_devices()
    shown = json.dumps([asdict(info) for info in infos], indent=1) if options.json else ""
    print(shown or describe_devices())
    return 0 if any(info.usable for info in infos) else 1


def info(options: argparse.Namespace) -> int:
    """Print what a file says about itself: a VDI, several, or a volume."""
    from pyvista_vdi.cli.inputs import is_volume, read_volume, volume_name
    from pyvista_vdi.io import read, read_info
    from pyvista_vdi.io.files import holds

    rows: dict[str, Any] = {}
    if options.file is not None and holds(options.file) in ("series", "set"):
        several, about = read(options.file), read_info(options.file)
        if several.times is None:
            rows = {"views": len(several), "pictures": "{} x {}".format(*several.window_size)}
            state = _state_of(about) | {"views": [camera.to_dict() for camera in several.cameras]}
        else:
            first, last = several.times[0], several.times[-1]
            rows = {"steps": f"{len(several)}, times {first:g} to {last:g}"}
            state = _state_of(about) | {"times": several.times}
        rows |= _rows_of(about)  # of the first
    elif is_volume(options):
        state = _of_volume(read_volume(options, in_chunks=True))
        rows = _rows_of_volume(options.file or volume_name(options), state)
    else:
        about = read_info(options.file)
        state, rows = _state_of(about), _rows_of(about)
    print(json.dumps(state, indent=1) if options.json else table(rows))
    return 0


def convert(options: argparse.Namespace) -> int:
    """Write a VDI, or a series or a set, in the format of another name."""
    from pyvista_vdi.api import read
    from pyvista_vdi.cli import inputs
    from pyvista_vdi.io import checked_target
    from pyvista_vdi.io.files import format_named, holds
    from pyvista_vdi.model.camera import Camera

    if (kind := holds(options.file)) in ("series", "set"):
        return _convert_several(options, str(kind))
    inputs.require_vdi(options.file, "convert")
    target, arguments, foreign = checked_target(options.output), inputs.file_options(options), {}
    if options.camera_json is not None:
        foreign["camera"] = inputs.from_json(options.camera_json, Camera.from_dict, "camera")
    if options.thickness is not None:
        foreign["thickness"] = options.thickness
    with inputs.measuring("converting") as bar:
        vdi: Any = read(options.file, progress=inputs.part(bar, 0.0, 0.5, "reading"), **foreign)
        page = inputs.keeps_values(vdi) and getattr(format_named(target), "page", False)
        colors = target.suffix != ".vdi" and not page
        look = inputs.look_for(options, vdi, options.file, colors=colors)
        if page:
            arguments |= look  # that the page begins with
        elif look:
            vdi = vdi.classified(**look)  # type: ignore[union-attr]
        vdi.save(target, progress=inputs.part(bar, 0.5, 1.0, "writing"), **arguments)
    inputs.say_vdi(options, vdi)
    return 0


def _convert_several(options: argparse.Namespace, kind: str) -> int:
    """Write a series or a set as one file, as a page, or each VDI to a file of its own."""
    from pyvista_vdi.cli import inputs
    from pyvista_vdi.io import check_write_options, checked_target, read
    from pyvista_vdi.io.files import format_named

    inputs.refuse(options, ("camera_json", "thickness"), f"deep images, .exr, and this is a {kind}")
    found, arguments = format_named(options.output), inputs.file_options(options)
    together = found is not None and (found.page or found.holds == kind)
    colors = found is not None and found.holds != kind and found.suffix != ".vdi"
    vdis = read(options.file)
    if look := inputs.look_for(options, vdis, options.file, colors=colors):
        vdis = vdis.classified(**look)
    with inputs.measuring("converting") as bar:
        if together:
            vdis.save(options.output, progress=inputs.part(bar, 0, 1, "writing"), **arguments)
            inputs.say_written([options.output])
            return 0
        # Name each by a number
        target, digits = checked_target(options.output), max(4, len(str(len(vdis) - 1)))
        stem, suffix = target.stem, target.suffix
        files = [target.with_name(f"{stem}_{i:0{digits}}{suffix}") for i in range(len(vdis))]
        check_write_options(files[0], arguments)
        for i, file in enumerate(files):
            vdis[i].save(file, **arguments)
            bar((i + 1) / len(files))
    print(f"Written: {printable(files[0])} to {printable(files[-1].name)}, {len(files)} files")
    return 0


def _of_volume(volume: Volume) -> dict[str, Any]:
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
        about["store"] = {
            "kind": store.kind,
            "axes": dict(zip(store.axes, store.levels[0].array.shape, strict=True)),
            "channels": store.channels,
            "chunks": volume.chunks.chunks[::-1] if volume.chunks else (),
            "levels": [
                {"path": one.path, "dimensions": one.grid.dimensions, "spacing": one.grid.spacing}
                for one in store.levels
            ],
        }
    return about


def _rows_of_volume(source: str, about: dict[str, Any]) -> dict[str, Any]:
    """Return the rows of a table of what is known of a volume."""
    ends = "{:g} to {:g}".format(*about["range"]) if about["range"] else "range not known yet"
    rows = {
        "volume": source,
        "points": _product(about["dimensions"]),
        "scalars": f"{about['scalars']}, {about['type']}, {ends}",
        "spacing": vector(about["spacing"]),
        "origin": vector(about["origin"]),
    }
    if about["direction"] != [[1, 0, 0], [0, 1, 0], [0, 0, 1]]:
        rows["axes"] = ", ".join(map(vector, zip(*about["direction"], strict=True)))
    rows["bounds"] = vector(about["bounds"])
    rows["lengths"] = f"in {about['unit']}" if about["unit"] else _LENGTHS
    rows["in memory"] = mebibytes(about["memory_bytes"])
    if store := about.get("store"):
        along = ", ".join(f"{count} along {axis}" for axis, count in store["axes"].items())
        rows |= {"store": f"{store['kind']}: {along}", "chunks": _product(store["chunks"])}
        rows |= {"channels": ", ".join(store["channels"])} if store["channels"] else {}
        for k, level in enumerate(store["levels"]):
            spacing = vector(level["spacing"])
            rows[f"level {k}"] = f"{_product(level['dimensions'])} points, spacing {spacing}"
    return rows


def _product(counts: Any) -> str:
    return " x ".join(map(str, counts))


def _state_of(about: FileInfo) -> dict[str, Any]:
    """Return what a file says about itself, as JSON can hold it."""
    return {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}


def _rows_of(about: FileInfo) -> dict[str, Any]:
    """Return the rows of a table of what a file says about itself."""
    (width, height), view, n = about.window_size, about.camera, about.n_supersegments
    lens = f"view angle {view.view_angle:g} degrees"
    if view.parallel_projection:
        lens = f"parallel scale {view.parallel_scale:g}"
    rows = {
        "file": f"{about.path}, {mebibytes(about.file_bytes)}, {about.codec}",
        "written by": f"{about.written_by}, format version {about.format_version}",
        "lists": f"{width} x {height}",
    }
    if about.deferred is not None:
        ends = "{:g} to {:g}".format(*about.deferred["value_range"])
        rows["kind"] = f"values from {ends}, classified afterwards"
    rows |= {
        "supersegments": f"{n}, {n / (width * height):.2f} per list",
        "precision": about.precision,
        "in memory": mebibytes(about.memory_bytes),
        "eye": vector(view.position),
        "looking at": f"{vector(view.focal_point)}, up {vector(view.view_up)}, {lens}",
        "bounds": vector(about.bounds),
        "depth origin": plain_number(about.depth_origin),
        "lengths": _LENGTHS,
    }
    for name, value in about.metadata.items():  # in one line; tables are left to --json
        text = json.dumps(value)
        rows[name] = text if len(text) <= 100 else f"{text[:96]} ..."
    return rows
