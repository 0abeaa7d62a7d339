"""The subcommands ``compare`` and ``tradeoff``: tables, pictures and JSON of what was measured."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from dataclasses import asdict
from typing import Any

from pyvista_vdi.cli.inputs import (
    classification,
    given,
    output_files,
    read_volume,
    volume_name,
)
from pyvista_vdi.cli.text import write_text
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import write_png
from pyvista_vdi.measure.bench import as_json
from pyvista_vdi.measure.compare import contact_sheet, measure, table
from pyvista_vdi.measure.tradeoff import AXES, COSTS, DEFAULT_AXES, measure_tradeoff, sweep
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.plotting.progress import DelayedBar


def compare(options: argparse.Namespace) -> int:
    """Compare a volume's pictures, and write a table, a picture, a JSON file and the VDI."""
    look = classification(options)
    stem, volume = volume_name(options), read_volume(options)
    how = {n: getattr(options, n) for n in ("angles", "repeats", "device")}
    how |= {"vtk": not options.no_vtk, "name": stem, **given(options, GenerationOptions, flat=True)}
    with output_files(options, stem, "vdi", "png", "json") as files:
        with closing(DelayedBar(label="comparing")) as bar:
            report, vdi, images = measure(volume, look, options.size, progress=bar, **how)
        vdi.save(files["vdi"], compression=options.compression)
        report["sizes"]["file_bytes"] = files["vdi"].stat().st_size
        write_png(contact_sheet(report, images), files["png"])
        write_text(files["json"], json.dumps(as_json(report), indent=1) + "\n")
        print(table(report))
    return 0


def tradeoff(options: argparse.Namespace) -> int:
    """Measure what each setting costs and gives, and write JSON and tables."""
    look = classification(options)
    settings = sweep(dict(map(_axis, options.sweep or DEFAULT_AXES)))
    name, volume = volume_name(options), read_volume(options)
    how = {n: getattr(options, n) for n in ("angles", "repeats", "generations", "device")}
    how |= {"window_size": options.size, "vtk": not options.no_vtk, "name": name}
    with output_files(options, f"tradeoff-{name}", "json", "md", "png") as files:
        with closing(DelayedBar(label="tradeoff")) as bar:
            found = measure_tradeoff(volume, settings, progress=bar, **how, **look)
        for kind in COSTS:
            print(f"{kind} against SSIM: {'; '.join(found.front(kind))}")
        for worse, better in found.dominated().items():
            print(f"dominated: {worse} (by {better[0]})")
        write_text(files["json"], json.dumps(as_json(asdict(found)), indent=1) + "\n")
        write_text(files["md"], found.table())
        found.save_plot(files["png"])
    return 0


def _axis(text: str) -> tuple[str, tuple[Any, ...]]:
    """Return an axis and its values as ``--sweep`` has them: ``lists`` or ``lists=0.5,2``."""
    given, equals, values = text.partition("=")
    name = given.replace("-", "_")
    if name not in AXES:
        known = ", ".join(axis.replace("_", "-") for axis in AXES)
        raise InvalidArgumentError(f"--sweep knows no {given!r}: known are {known}")
    if not equals:
        return name, AXES[name]
    kind = type(AXES[name][0])
    read: Any = {"on": True, "off": False}.__getitem__ if kind is bool else kind
    try:
        return name, tuple(map(read, values.split(",")))
    except (KeyError, ValueError) as error:
        expected = {bool: "on or off", int: "whole numbers", float: "numbers"}[kind]
        raise InvalidArgumentError(f"--sweep {given} takes {expected}; got {values!r}") from error
