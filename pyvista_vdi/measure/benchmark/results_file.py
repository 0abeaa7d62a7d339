"""A file of results: JSON that is whole after every row, and says what measured it and on what."""

from __future__ import annotations

import json
import os
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, ClassVar

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.compare.measure import without_infinities

#: What results may not be mixed over: they would hold other times, or other pictures.
_SAME_SYSTEM = ("device", "driver", "pyvista-vdi")


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
    #: Entries beside plan, system and dates.
    parts: ClassVar[frozenset[str]]

    def __init__(self, path: str | os.PathLike[str] | None, data: dict[str, Any]) -> None:
        self._path = None if path is None else Path(path)
        self.data = data

    @property
    def path(self) -> Path:
        """The file."""
        if self._path is None:
            raise InvalidArgumentError("these results have no file: give them a path")
        return self._path

    @classmethod
    def new(
        cls, plan: dict[str, Any], system: dict[str, str], parts: dict[str, Any]
    ) -> dict[str, Any]:
        """Return the content of what holds nothing yet."""
        head = {"format": cls.form, "version": cls.version, "plan": plan, "system": system}
        return {**head, "begun": now(), "changed": now(), **parts}

    @classmethod
    def checked(cls, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Return the content of a file.

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
        missing = {"plan", "system", *cls.parts} - data.keys()
        if missing:
            raise InvalidArgumentError(f"{path} lacks {', '.join(sorted(missing))}: measure again")
        return data

    def require_same(self, plan: dict[str, Any], system: dict[str, str]) -> None:
        """Raise InvalidArgumentError where the file is of another plan or device."""
        theirs = self.data["plan"]
        other = sorted(name for name in plan if theirs.get(name) != plan[name])
        if other:
            name = other[0]
            raise InvalidArgumentError(
                f"{self.path} holds results for {name} = {theirs.get(name)}, not {plan[name]}: "
                "give the same options to --resume, or choose another --out"
            )
        for name in _SAME_SYSTEM:
            if self.data["system"].get(name) != system.get(name):
                raise InvalidArgumentError(
                    f"{self.path} was measured on {name} {self.data['system'].get(name)}, and "
                    f"this is {system.get(name)}: choose another --out"
                )

    def save(self) -> None:
        """Write the file, if there is one; a run that is stopped meanwhile leaves the old one."""
        self.data["changed"] = now()
        if self._path is None:
            return
        with whole_file(self._path) as stream:
            text = json.dumps(without_infinities(self.data), indent=1, allow_nan=False)
            stream.write(text.encode() + b"\n")


def now() -> str:
    """Return the date and time, UTC."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
