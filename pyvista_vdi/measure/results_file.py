"""A file of results: JSON that is whole after every row, and says what measured it and on what."""

from __future__ import annotations

import copy
import json
import os
from collections.abc import Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.results import rounded as without_infinities

#: What results may not be mixed over: they would hold other times, or other pictures.
_SAME_SYSTEM = ("device", "driver", "pyvista-vdi")

_File = TypeVar("_File", bound="ResultsFile")


class Plan(Protocol):
    """What a run measures, as results have it."""

    def to_dict(self) -> dict[str, Any]:
        """Return it in values that JSON can hold."""


class ResultsFile:
    """What was measured, as the JSON has it.

    Parameters
    ----------
    path : path-like, optional
        Its file; ``None`` for results that are not written.
    data : dict
        The JSON's content.
    """

    #: What the file says it is, and of which version; kinds of results have their own.
    form: ClassVar[str]
    version: ClassVar[int]
    #: Entries beside plan, system and dates, while nothing is measured.
    empty: ClassVar[Mapping[str, Any]]

    def __init__(self, path: str | os.PathLike[str] | None, data: dict[str, Any]) -> None:
        self._path = None if path is None else Path(path)
        self.data = data

    @classmethod
    def begun(
        cls: type[_File], path: str | os.PathLike[str] | None, plan: Plan, system: dict[str, str]
    ) -> _File:
        """Return what holds nothing yet."""
        head = {"format": cls.form, "version": cls.version, "plan": plan.to_dict()}
        dates = {"begun": _now(), "changed": _now()}
        return cls(path, {**head, "system": system, **dates, **copy.deepcopy(dict(cls.empty))})

    @classmethod
    def read(cls: type[_File], path: str | os.PathLike[str]) -> _File:
        """Read a file.

        Raises
        ------
        InvalidArgumentError
            If it cannot be read, or is something else.
        """
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InvalidArgumentError(
                f"{path} cannot be read: {error.strerror or error}"
            ) from error
        except (ValueError, RecursionError) as error:
            raise InvalidArgumentError(
                f"{path} is no JSON ({error}): name a file that {cls.form} has written"
            ) from error
        if not isinstance(data, dict) or data.get("format") != cls.form:
            raise InvalidArgumentError(
                f"{path} holds no results: name a file that {cls.form} has written"
            )
        if data.get("version") != cls.version:
            raise InvalidArgumentError(
                f"{path} is of version {data.get('version')!r}; this program reads version "
                f"{cls.version}: measure again, or use the program that wrote it"
            )
        missing = {"plan", "system", *cls.empty} - data.keys()
        if missing:
            raise InvalidArgumentError(f"{path} lacks {', '.join(sorted(missing))}: measure again")
        return cls(path, data)

    @classmethod
    def resumed(
        cls: type[_File], path: str | os.PathLike[str], plan: Plan, system: dict[str, str]
    ) -> _File:
        """Return what an earlier run of the same plan, on the same device, has left.

        Raises
        ------
        InvalidArgumentError
            If the file is no such results, or holds those of another plan or device.
        """
        found = cls.read(path)
        for name, value in sorted(plan.to_dict().items()):
            theirs = found.data["plan"].get(name)
            if theirs != value:
                raise InvalidArgumentError(
                    f"{found.path} holds results for {name} = {theirs}, not {value}: give the same "
                    "options to --resume, or choose another --out"
                )
        for name in _SAME_SYSTEM:
            if found.data["system"].get(name) != system.get(name):
                raise InvalidArgumentError(
                    f"{found.path} was measured on {name} {found.data['system'].get(name)}, and "
                    f"this is {system.get(name)}: choose another --out"
                )
        return found

    @property
    def path(self) -> Path:
        """The file."""
        if self._path is None:
            raise InvalidArgumentError("these results have no file: give them a path")
        return self._path

    def save(self) -> None:
        """Write the file, if there is one; a run that is stopped meanwhile leaves the old one."""
        self.data["changed"] = _now()
        if self._path is None:
            return
        with whole_file(self._path) as stream:
            text = json.dumps(without_infinities(self.data), indent=1, allow_nan=False)
            stream.write(text.encode() + b"\n")


def _now() -> str:
    """Return the date and time, UTC."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
