"""The verb ``tradeoff``: what each setting of a VDI costs and gives, as JSON, tables and a plot."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.cli.inputs import (
    classification,
    has_vtk,
    measuring,
    output_files,
    read_volume,
    say_written,
    volume_name,
)
from pyvista_vdi.cli.text import write_text
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.bench import as_json
from pyvista_vdi.measure.tradeoff import AXES, COSTS, DEFAULT_AXES, measure_tradeoff, sweep
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.transfer_function import TransferFunction

#: Frames and views, without and with ``--quick``.
_SIZES = ((640, 360), (320, 180))
_ANGLES = ((5.0, 30.0, 60.0), (5.0, 30.0))


def tradeoff(options: argparse.Namespace) -> int:
    """Measure and write."""
    arguments = classification(options)
    Classification.composited(arguments, "tradeoff")  # refused before the volume is read
    # With --quick the last of an axis's usual values
    usual = {n: values[-1:] if options.quick else values for n, values in AXES.items()}
    axes = dict(_axis(text, usual) for text in options.sweep or DEFAULT_AXES)
    settings = sweep(axes, pairs=not options.quick)
    name = options.name or volume_name(options)
    if Path(name).name != name:
        raise InvalidArgumentError(f"--name becomes a file's, without a folder; got {name!r}")
    volume = read_volume(options)
    if not set(arguments) - {"interpolation"} and not volume.rgba:
        # A ramp from transparent black to opaque white, which needs no PyVista
        ramp = np.linspace(0.0, 1.0, 256)
        table = TransferFunction(np.stack([ramp] * 3, axis=1), ramp, volume.finite_range())
        table = table.replace(interpolation=arguments.get("interpolation", "nearest"))
        arguments = {"transfer_function": table}
    vtk = has_vtk(options)
    with (
        output_files(options, f"tradeoff-{name}", "json", "md", "png") as files,
        measuring("tradeoff") as bar,
    ):
        found = measure_tradeoff(
            volume,
            settings,
            window_size=options.size or _SIZES[options.quick],
            angles=options.angles or _ANGLES[options.quick],
            repeats=options.repeats,
            generations=options.generations,
            vtk=vtk,
            name=name,
            device=options.device,
            progress=bar,
            **arguments,
        )
    for kind in COSTS:
        print(f"{kind} against SSIM: {'; '.join(found.front(kind))}")
    for worse, better in found.dominated().items():
        print(f"dominated: {worse} (by {better[0]})")
    write_text(files["json"], json.dumps(as_json(asdict(found)), indent=1) + "\n")
    write_text(files["md"], found.table())
    if find_spec("matplotlib") is None or not found.points:
        del files["png"]
    else:
        found.save_plot(files["png"])
    say_written(files.values())
    return 0


def _axis(text: str, usual: Mapping[str, tuple[Any, ...]]) -> tuple[str, tuple[Any, ...]]:
    """Return an axis and its values as ``--sweep`` has them: ``lists`` or ``lists=0.5,2``."""
    given, equals, values = text.partition("=")
    name = given.replace("-", "_")
    if name not in usual:
        known = ", ".join(axis.replace("_", "-") for axis in usual)
        raise InvalidArgumentError(f"--sweep knows no {given!r}: known are {known}")
    if not equals:
        return name, usual[name]
    kind, chosen = type(AXES[name][0]), []
    for value in values.split(","):
        try:
            chosen.append({"on": True, "off": False}[value] if kind is bool else kind(value))
        except (KeyError, ValueError) as error:
            expected = {bool: "on or off", int: "a whole number", float: "a number"}[kind]
            raise InvalidArgumentError(
                f"--sweep {name.replace('_', '-')} takes {expected}; got {value!r}"
            ) from error
    return name, tuple(chosen)
