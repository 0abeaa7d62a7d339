"""The verb ``tradeoff``: what each setting of a VDI costs and gives, as JSON, tables and a plot."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pyvista_vdi.cli.inputs import (
    classification,
    has_vtk,
    measuring,
    output_files,
    read_volume,
    require_new,
    say_written,
    volume_name,
)
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.paper.datasets import look
from pyvista_vdi.measure.results import write_text
from pyvista_vdi.measure.tradeoff import AXES, Setting, measure_tradeoff, sweep
from pyvista_vdi.measure.tradeoff.report import summary
from pyvista_vdi.measure.tradeoff.settings import DEFAULT_AXES, QUICK_AXES
from pyvista_vdi.model.classification import Classification

#: Frames and views, without and with ``--quick``.
_SIZES = ((640, 360), (320, 180))
_ANGLES = ((5.0, 30.0, 60.0), (5.0, 30.0))

#: How the volume looks where nothing is said: a ramp from transparent black to opaque white, which
#: needs no PyVista.
_DEFAULT_LOOK = "ramp"


def tradeoff(options: argparse.Namespace) -> int:
    """Measure and write."""
    arguments = classification(options)
    Classification.composited(arguments, "tradeoff")  # refused before the volume is read
    settings = _settings(options)
    name = options.name or volume_name(options)
    if Path(name).name != name:
        raise InvalidArgumentError(f"--name becomes a file's, without a folder; got {name!r}")
    volume = read_volume(options)
    if not set(arguments) - {"interpolation"} and not volume.rgba:
        # By default the same without PyVista
        interpolation = arguments.get("interpolation", "nearest")
        table = look(_DEFAULT_LOOK, volume.finite_range(), interpolation)
        arguments = {"transfer_function": table}
    vtk = has_vtk(options)
    with (
        output_files(options, f"tradeoff-{name}", "json", "md", "png") as files,
        measuring("tradeoff", files["json"]) as bar,
    ):
        require_new(files["json"], options)
        found = measure_tradeoff(
            volume,
            settings,
            window_size=options.size or _SIZES[options.quick],
            angles=options.angles or _ANGLES[options.quick],
            repeats=options.repeats,
            generations=options.generations,
            vtk=vtk,
            name=name,
            path=files["json"],
            resume=options.resume,
            device=options.device,
            progress=bar,
            **arguments,
        )
    print(summary(found.points))
    write_text(files["md"], found.table())
    if find_spec("matplotlib") is None or not found.points:
        del files["png"]
    else:
        found.save_plot(files["png"])
    say_written(files.values())
    return 0


def _settings(options: argparse.Namespace) -> tuple[Setting, ...]:
    """Return what the options ask to compare."""
    usual = {**AXES, **QUICK_AXES} if options.quick else AXES
    if options.sweep is None:
        axes = {n: usual[n] for n in (QUICK_AXES if options.quick else DEFAULT_AXES)}
    else:
        axes = dict(_axis(text, usual) for text in options.sweep)
    return sweep(axes, pairs=not options.quick)


def _axis(text: str, usual: Mapping[str, tuple[Any, ...]]) -> tuple[str, tuple[Any, ...]]:
    """Return an axis and its values as ``--sweep`` has them: ``lists`` or ``lists=0.5,2``."""
    given, equals, values = text.partition("=")
    name = given.replace("-", "_")
    if name not in usual:
        known = ", ".join(axis.replace("_", "-") for axis in usual)
        raise InvalidArgumentError(f"--sweep knows no {given!r}: known are {known}")
    if not equals:
        return name, usual[name]
    kind, chosen = type(getattr(Setting(), name)), []
    for value in values.split(","):
        try:
            chosen.append({"on": True, "off": False}[value] if kind is bool else kind(value))
        except (KeyError, ValueError) as error:
            expected = {bool: "on or off", int: "a whole number", float: "a number"}[kind]
            raise InvalidArgumentError(
                f"--sweep {name.replace('_', '-')} takes {expected}; got {value!r}"
            ) from error
    return name, tuple(chosen)
