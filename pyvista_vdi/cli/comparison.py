"""The verb ``compare``: a table, a picture, a JSON file and the VDI."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from pyvista_vdi.cli.inputs import classification, read_volume, volume_name
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.io import check_writable, whole_file, write_png
from pyvista_vdi.measure.compare import Report, Settings, contact_sheet, measure, table
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.plotting.progress import DelayedBar

#: The transfer function that is compared where none is named.
_DEFAULT = "soft"


def compare(options: argparse.Namespace) -> int:
    """Compare a volume's pictures, and write what was found."""
    if options.tf is None and options.cmap is None and options.opacity is None:
        options.tf = _DEFAULT
    arguments = classification(options)
    Classification(arguments, "compare")  # refused before anything is read or written
    looks = options.tf or "custom"
    if options.tf and any(arguments[n] != v for n, v in TRANSFER_FUNCTIONS[options.tf].items()):
        looks = "custom"
    stem = f"{volume_name(options)}-{looks}"
    files = _checked_files(Path(options.out), stem)
    volume = read_volume(options)
    for name in ("scalars", "preference"):  # the array has been chosen
        arguments.pop(name, None)
    settings = Settings(
        classification=arguments,
        window_size=options.size,
        angles=options.angles,
        max_supersegments=options.max_supersegments,
        sample_distance=options.sample_distance,
        repeats=options.repeats,
        vtk=not options.no_vtk,
        device=options.device,
        name=stem,
    )
    bar = DelayedBar(label="comparing")
    try:
        report, vdi, images = measure(volume, settings, bar)
    finally:
        bar.close()
    report = _with_file(report, vdi, files["vdi"])
    write_png(contact_sheet(report, images), files["png"])
    with whole_file(files["json"]) as stream:
        stream.write(json.dumps(report.to_dict(), indent=1).encode())
    print(table(report))
    print(
        "Written: " + ", ".join(printable(Path(options.out) / path.name) for path in files.values())
    )
    return 0


def _checked_files(folder: Path, stem: str) -> dict[str, Path]:
    """Return where the files go, after finding that they can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise VDIFileError(
            f"the folder {folder} cannot be made: {error.strerror}; choose another --out"
        ) from error
    return {kind: check_writable(folder / f"{stem}.{kind}") for kind in ("vdi", "png", "json")}


def _with_file(report: Report, vdi: VDI, path: Path) -> Report:
    """Write the VDI and add its size to the report."""
    vdi.save(path)
    sizes: dict[str, Any] = {**report.sizes, "file_bytes": path.stat().st_size}
    return replace(report, sizes=sizes)
