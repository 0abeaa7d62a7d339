"""Holds a JSON file to its schema, by the keywords that ours use and no others."""

from __future__ import annotations

import json
from pathlib import Path

TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "integer": int,
    "number": (int, float),
    "null": type(None),
}


def faults(value, schema, root, at="results"):
    """Yield where a value breaks a JSON Schema: the keywords that ours uses, and no others."""
    schema = dict(schema)
    for name in ("$schema", "$defs", "title", "description"):
        schema.pop(name, None)
    if "$ref" in schema:
        target = root
        for part in schema.pop("$ref").removeprefix("#/").split("/"):
            target = target[part]
        yield from faults(value, target, root, at)
    if "anyOf" in schema:
        branches = [list(faults(value, s, root, at)) for s in schema.pop("anyOf")]
        if all(branches):
            yield f"{at}: {branches[0][0]}"
    kinds = schema.pop("type", None)
    if kinds is not None:
        kinds = [kinds] if isinstance(kinds, str) else kinds
        wrong = isinstance(value, bool) and "boolean" not in kinds
        if wrong or not any(isinstance(value, TYPES[kind]) for kind in kinds):
            yield f"{at} is {value!r}, not {kinds}"
            return
    if "const" in schema and value != schema.pop("const"):
        yield f"{at} is {value!r}"
    if "enum" in schema and value not in schema.pop("enum"):
        yield f"{at} is {value!r}"
    known, others = schema.pop("properties", {}), schema.pop("additionalProperties", True)
    required, items = schema.pop("required", []), schema.pop("items", {})
    least, most = schema.pop("minItems", 0), schema.pop("maxItems", 10**9)
    assert schema.keys() <= {"const", "enum"}, f"{at}: the check knows no {sorted(schema)}"
    if isinstance(value, dict):
        yield from (f"{at} lacks {name}" for name in required if name not in value)
        for name, item in value.items():
            if name in known:
                yield from faults(item, known[name], root, f"{at}.{name}")
            elif others is False:
                yield f"{at} has {name}"
            elif others is not True:
                yield from faults(item, others, root, f"{at}.{name}")
    if isinstance(value, list):
        if not least <= len(value) <= most:
            yield f"{at} has {len(value)} items"
        for i, item in enumerate(value):
            yield from faults(item, items, root, f"{at}[{i}]")


def read_checked(path, schema_path):
    """Read a JSON file after holding it to the schema in another."""
    data = json.loads(Path(path).read_text())
    schema = json.loads(Path(schema_path).read_text())
    assert list(faults(data, schema, schema)) == []
    return data
