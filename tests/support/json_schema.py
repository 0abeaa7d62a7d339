"""Holds a JSON file to its schema."""

from __future__ import annotations

import json
from pathlib import Path

from jsonschema import Draft202012Validator


def faults(value, schema):
    """What breaks the schema, each with its place in the file."""
    found = Draft202012Validator(schema).iter_errors(value)
    return [f"{error.json_path}: {error.message}" for error in found]


def read_checked(path, schema_path):
    """Read a JSON file after holding it to the schema in another."""
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    assert faults(data, json.loads(Path(schema_path).read_text(encoding="utf-8"))) == []
    return data
