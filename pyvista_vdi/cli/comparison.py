"""The verb ``compare``: a table, a picture, a JSON file and the VDI."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from pyvista_vdi.cli.inputs import (
    OF_ANY_VOLUME,
    classification,
    measuring,
    output_files,
    read_volume,
    refuse,
    require_new,
    say_written,
    volume_name,
)
from pyvista_vdi.io import write_png
from pyvista_vdi.measure.compare import Settings, contact_sheet, measure, table
from pyvista_vdi.measure.front import FrontPlan, left_out, measure_front, summary
from pyvista_vdi.measure.results import write_text
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

#: The transfer function that is compared where none is named.
_DEFAULT = "soft"


def compare(options: argparse.Namespace) -> int:
    """Compare a volume's pictures, or all volumes' fronts, and write what was found."""
    if options.front:
        return _front(options)
    refuse(options, ("quick", "resume"), "--front")
    if options.tf is None and options.cmap is None and options.opacity is None:
        options.tf = _DEFAULT
    arguments = classification(options)
    Classification.composited(arguments, "compare")  # refused before anything is read or written
    looks = options.tf or "custom"
    if options.tf and any(arguments[n] != v for n, v in TRANSFER_FUNCTIONS[options.tf].items()):
        looks = "custom"
    stem = f"{volume_name(options)}-{looks}"
    settings = Settings(
        classification=arguments,
        window_size=options.size,
        angles=options.angles,
        max_supersegments=options.max_supersegments,
        precision=options.precision,
        sample_distance=options.sample_distance,
        repeats=options.repeats,
        vtk=not options.no_vtk,
        device=options.device,
        name=stem,
    )
    volume = read_volume(options)
    with output_files(options, stem, "vdi", "png", "json") as files, measuring("comparing") as bar:
        report, vdi, images = measure(volume, settings, bar)
    vdi.save(files["vdi"], compression=options.compression)
    sizes = {**report.sizes, "file_bytes": files["vdi"].stat().st_size}
    report = replace(report, sizes=sizes)
    write_png(contact_sheet(report, images), files["png"])
    report.results(files["json"]).save()
    print(table(report))
    say_written(Path(options.out) / path.name for path in files.values())
    return 0


def _front(options: argparse.Namespace) -> int:
    """Measure fronts of time and accuracy."""
    of_one = (*OF_ANY_VOLUME, "sample_distance", "no_vtk")
    refuse(options, of_one, "one volume, and --front measures all")
    from pyvista_vdi import examples

    more = {"window_size": options.size, "repeats": options.repeats}
    plan = FrontPlan.quick(**more) if options.quick else FrontPlan(examples.WHOLE, **more)
    with (
        output_files(options, "front", "json", "md") as files,
        measuring("front", files["json"]) as bar,
    ):
        require_new(files["json"], options)
        found = measure_front(
            plan, files["json"], resume=options.resume, device=options.device, progress=bar
        )
    lines = summary(found)
    print("\n".join(lines))
    for what in left_out(found):
        print(f"left out: {what}", file=sys.stderr)
    write_text(files["md"], "\n".join([*lines, ""]))
    say_written(files.values())
    return 0
