"""The verb ``compare``: a table, a picture, a JSON file and the VDI."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pyvista_vdi.cli.inputs import (
    classification,
    measuring,
    output_files,
    read_volume,
    say_written,
    volume_name,
)
from pyvista_vdi.cli.text import write_text
from pyvista_vdi.io import write_png
from pyvista_vdi.measure.bench import as_json
from pyvista_vdi.measure.compare import contact_sheet, measure, table
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

#: The transfer function that is compared where none is named.
_DEFAULT = "soft"


def compare(options: argparse.Namespace) -> int:
    """Compare a volume's pictures, and write what was found."""
    if options.tf is None and options.cmap is None and options.opacity is None:
        options.tf = _DEFAULT
    arguments = classification(options)
    Classification.composited(arguments, "compare")  # refused before anything is read or written
    looks = options.tf or "custom"
    if options.tf and any(arguments[n] != v for n, v in TRANSFER_FUNCTIONS[options.tf].items()):
        looks = "custom"
    stem = f"{volume_name(options)}-{looks}"
    volume = read_volume(options)
    with output_files(options, stem, "vdi", "png", "json") as files, measuring("comparing") as bar:
        report, vdi, images = measure(
            volume,
            arguments,
            options.size,
            angles=options.angles,
            max_supersegments=options.max_supersegments,
            precision=options.precision,
            sample_distance=options.sample_distance,
            repeats=options.repeats,
            vtk=not options.no_vtk,
            device=options.device,
            name=stem,
            progress=bar,
        )
    vdi.save(files["vdi"], compression=options.compression)
    report["sizes"]["file_bytes"] = files["vdi"].stat().st_size
    write_png(contact_sheet(report, images), files["png"])
    write_text(files["json"], json.dumps(as_json(report), indent=1) + "\n")
    print(table(report))
    say_written(Path(options.out) / path.name for path in files.values())
    return 0
