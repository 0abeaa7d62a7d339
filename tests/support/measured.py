"""Results of measurements: read after they were held to their schema, and made up."""

from __future__ import annotations

from pathlib import Path

from json_schema import read_checked

from pyvista_vdi.measure.results import FORMAT, VERSION, Results

SCHEMA = Path(__file__).parents[2] / "docs" / "results_schema.json"


def checked(path):
    """Read results after holding them to the schema."""
    return Results(read_checked(path, SCHEMA))


def made_up_results(kind, plan, rows):
    """The data of results that hold these rows."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "kind": kind,
        "plan": plan,
        "system": {"device": "a", "driver": "1", "python": "3", "system": "b"},
        "measured": {"commit": "abc", "sources": {}},
        "extent": "sample",
        "begun": "x",
        "changed": "y",
        "rows": rows,
    }
