"""The verb ``tradeoff``: what each setting of a VDI costs and gives, as JSON, tables and a plot."""

from __future__ import annotations

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pyvista_vdi.cli.inputs import classification, read_volume, volume_name
from pyvista_vdi.cli.text import printable
from pyvista_vdi.cli.tradeoff_options import ANGLES, SIZES
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.io import check_writable, whole_file
from pyvista_vdi.measure.benchmark.datasets import look
from pyvista_vdi.measure.tradeoff import AXES, Setting, Tradeoff, measure_tradeoff, sweep
from pyvista_vdi.measure.tradeoff.report import describe, summary
from pyvista_vdi.measure.tradeoff.settings import DEFAULT_AXES, QUICK_AXES
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.progress import DelayedBar

#: How the volume looks where nothing is said: a ramp from transparent black to opaque white, which
#: needs no PyVista.
_DEFAULT_LOOK = "ramp"


def tradeoff(options: argparse.Namespace) -> int:
    """Measure and write."""
    arguments = classification(options)
    Classification(arguments, "tradeoff")  # refused before the volume is read
    settings = _settings(options)
    name = options.name or volume_name(options)
    if Path(name).name != name:
        raise InvalidArgumentError(f"--name becomes a file's, without a folder; got {name!r}")
    files = _checked_files(Path(options.out), f"tradeoff-{name}", resume=options.resume)
    volume = read_volume(options)
    for chosen in ("scalars", "preference"):  # the array is one of the file's by now
        arguments.pop(chosen, None)
    vtk = not options.no_vtk
    if vtk and find_spec("vtkmodules") is None:
        print("VTK is not installed: its mappers are left out", file=sys.stderr)
        vtk = False
    bar = DelayedBar(label="tradeoff")
    try:
        found = measure_tradeoff(
            volume,
            settings,
            window_size=options.size or SIZES[options.quick],
            angles=options.angles or ANGLES[options.quick],
            repeats=options.repeats,
            generations=options.generations,
            vtk=vtk,
            name=name,
            path=files["json"],
            resume=options.resume,
            device=options.device,
            progress=bar,
            **_looks(arguments, volume),
        )
    except KeyboardInterrupt:
        if files["json"].exists():
            print(
                f"\nWhat was measured is in {printable(files['json'])}: --resume goes on",
                file=sys.stderr,
            )
        raise
    finally:
        bar.close()
    print(summary(found))
    written = _write_tables(found, files)
    print("Written: " + ", ".join(printable(path) for path in written))
    return 0


def _settings(options: argparse.Namespace) -> tuple[Setting, ...]:
    """Return what the options ask to compare."""
    usual: dict[str, tuple[Any, ...]] = {
        name: QUICK_AXES.get(name, AXES[name]) if options.quick else AXES[name] for name in AXES
    }
    if options.sweep is None:
        axes = {n: usual[n] for n in (QUICK_AXES if options.quick else DEFAULT_AXES)}
    else:
        axes = dict(_axis(text, usual) for text in options.sweep)
    pairs = not (options.alone or options.quick)
    return sweep(axes, pairs=pairs, product=options.product)


def _axis(text: str, usual: dict[str, tuple[Any, ...]]) -> tuple[str, tuple[Any, ...]]:
    """Return an axis and its values as ``--sweep`` has them: ``lists`` or ``lists=0.5,2``."""
    given, equals, values = text.partition("=")
    name = given.replace("-", "_")
    if name not in usual:
        known = ", ".join(axis.replace("_", "-") for axis in usual)
        raise InvalidArgumentError(f"--sweep knows no {given!r}: known are {known}")
    if not equals:
        return name, usual[name]
    return name, tuple(_value(name, value) for value in values.split(","))


def _value(name: str, text: str) -> Any:
    kind = type(getattr(Setting(), name))
    try:
        if kind is bool:
            return {"on": True, "off": False}[text]
        return kind(text)
    except (KeyError, ValueError) as error:
        expected = {bool: "on or off", int: "a whole number", float: "a number"}[kind]
        raise InvalidArgumentError(
            f"--sweep {name.replace('_', '-')} takes {expected}; got {text!r}"
        ) from error


def _looks(arguments: dict[str, Any], volume: Volume) -> dict[str, Any]:
    """Return the classification; by default one that is the same without PyVista."""
    if set(arguments) - {"interpolation"} or volume.rgba:
        return arguments
    interpolation = arguments.get("interpolation", "nearest")
    return {"transfer_function": look(_DEFAULT_LOOK, volume.finite_range(), interpolation)}


def _checked_files(folder: Path, stem: str, *, resume: bool) -> dict[str, Path]:
    """Return where the files go, after finding that they can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise VDIFileError(
            f"the folder {folder} cannot be made: {error.strerror}; choose another --out"
        ) from error
    files = {kind: check_writable(folder / f"{stem}.{kind}") for kind in ("json", "md", "png")}
    if files["json"].exists() and not resume:
        raise InvalidArgumentError(
            f"{files['json']} is there already: --resume goes on with it, or choose another --out"
        )
    return files


def _write_tables(found: Tradeoff, files: dict[str, Path]) -> list[Path]:
    """Write the Markdown, and the plot where Matplotlib is installed."""
    with whole_file(files["md"]) as stream:
        stream.write(describe(found).encode())
    written = [files["json"], files["md"]]
    if find_spec("matplotlib") is not None and found.points:
        written.append(found.save_plot(files["png"]))
    return written
