"""Frozen records that are replaced many times in a frame."""

from __future__ import annotations

from typing import Any, TypeVar

T = TypeVar("T")


def replace(record: T, **values: Any) -> T:
    """Return a record with other values of some fields, as :func:`dataclasses.replace` does.

    That asks each field how it is to be made, which was a quarter of Python's part in a frame
    (docs/decisions/window_frames.md). This copies, and so is for records that check nothing when
    they are made; what a ``cached_property`` has kept is left out.
    """
    fields, there = type(record).__dataclass_fields__, record.__dict__  # type: ignore[attr-defined]
    if not values.keys() <= fields.keys():
        raise TypeError(f"{type(record).__name__} has no field {values.keys() - fields.keys()}")
    other = object.__new__(type(record))
    kept = there if len(there) == len(fields) else {name: there[name] for name in fields}
    other.__dict__.update(kept, **values)
    return other
