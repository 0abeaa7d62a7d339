"""Time steps in several files: the order of their names, and files that list them with times."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree as ET

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.model.checks import as_float

#: What files that list others are called: of ParaView's collections, and of its series in JSON.
_COLLECTION, _SERIES = ".pvd", ".series"
#: Digits of numbers in names, at most.
_DIGITS = 24


def natural_key(name: str) -> str:
    """Return the sort key by which step 10 comes after step 9."""
    return re.sub(r"\d+", lambda number: number[0].zfill(_DIGITS), name)


def in_step_order(names: Sequence[str]) -> list[str]:
    """Return names in natural order where they are in a shell's, and else as they were given."""
    for case in (str, str.casefold):
        if list(names) == sorted(names, key=case):
            return sorted(names, key=lambda name: natural_key(case(name)))
    return list(names)


def lists_steps(path: str | os.PathLike[str]) -> bool:
    """Whether a file lists others, by its name: ``.pvd``, ``.vti.series`` and the like."""
    return os.fspath(path).lower().endswith((_COLLECTION, _SERIES))


def listed_steps(path: str | os.PathLike[str]) -> list[tuple[Path, float]]:
    """Return the files that a file lists, and their times, which ascend.

    Raises InvalidVolumeError if it cannot be read, lists nothing, or several files for one time.
    """
    file = Path(path)
    try:
        if file.suffix.lower() == _COLLECTION:
            entries = [
                (each.attrib["file"], as_float(each.get("timestep", 0)))
                for each in ET.parse(file).iter("DataSet")
            ]
        else:
            listed = json.loads(file.read_text(encoding="utf-8"))["files"]
            entries = [(str(each["name"]), as_float(each["time"])) for each in listed]
    except OSError as error:
        raise InvalidVolumeError(f"{file} cannot be read: {error.strerror or error}") from error
    except (ET.ParseError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InvalidVolumeError(
            f"{file} is no list of time steps ({type(error).__name__}: {error}): name the steps' "
            "files themselves"
        ) from error
    if not entries or not all(abs(time) < float("inf") for _, time in entries):
        raise InvalidVolumeError(f"{file} lists no files with times: name the steps' files")
    entries.sort(key=lambda entry: entry[1])
    for time, group in groupby(entries, key=lambda entry: entry[1]):
        parts = [name for name, _ in group]
        if len(parts) > 1:
            raise InvalidVolumeError(
                f"{file} lists {len(parts)} files for the time {time:g}, {parts[0]} and "
                f"{parts[1]}: a step is one volume; merge its parts, or name one file for each step"
            )
    return [(file.parent / name, time) for name, time in entries]
