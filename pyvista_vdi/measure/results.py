"""The file of every measurement: JSON with a row for each case, whole after every row."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.provenance import outdated, provenance
from pyvista_vdi.measure.report import describe_system

#: What every file says that it is, and of which version.
FORMAT, VERSION = "pyvista-vdi results", 2

#: Significant digits of a row's numbers that are not whole: more than any measurement has.
DIGITS = 5

#: What results may not be mixed over: they would hold other times, or other pictures.
_SAME_SYSTEM = ("device", "driver", "pyvista-vdi")

_HEAD = ("kind", "plan", "system", "measured", "extent", "begun", "changed", "rows")


class Results:
    """What was measured, as the JSON has it: see ``docs/results_schema.json``.

    Parameters
    ----------
    data : dict
        The JSON's content.
    path : path-like, optional
        Its file; ``None`` for results that are not written.
    """

    def __init__(self, data: dict[str, Any], path: str | os.PathLike[str] | None = None) -> None:
        self.data = data
        self._path = None if path is None else Path(path)

    @classmethod
    def begun(
        cls,
        kind: str,
        plan: Mapping[str, Any],
        *,
        path: str | os.PathLike[str] | None = None,
        rooms: Iterable[str] = (),
        extent: str = "whole",
        device: Any = None,
        resume: bool = False,
    ) -> Results:
        """Return what holds no rows yet, or what an earlier run has left.

        Parameters
        ----------
        kind, plan : str, mapping
            What is measured, such as ``"benchmark"``, and all that was chosen.
        path : path-like, optional
            The file to write, or with ``resume`` to go on with where there is one; it raises
            InvalidArgumentError if it is none, or of another plan, device or code.
        rooms : iterable of str
            Whose code decides the figures, see :func:`.provenance.provenance`.
        extent : {"whole", "sample"}
            Whether all cases are measured, or some drawn from them.
        device : optional
            The OpenCL device that measures.
        """
        plan = json.loads(json.dumps(plan))
        system = describe_system(device)
        if resume and path is not None and Path(path).exists():
            return cls.read(path, kind)._checked(plan, system, extent)
        head = {"format": FORMAT, "version": VERSION, "kind": kind, "plan": plan, "system": system}
        code = {"measured": provenance(rooms), "extent": extent}
        data = {**head, **code, "begun": now(), "changed": now(), "rows": []}
        return cls(data, path)

    @classmethod
    def read(cls, path: str | os.PathLike[str], kind: str | None = None) -> Results:
        """Read a file, which must be of a kind if one is given.

        What cannot be read, or is something else, raises InvalidArgumentError.
        """
        what = f"pyvista-vdi {kind}" if kind else "a measurement"
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InvalidArgumentError(
                f"{path} cannot be read: {error.strerror or error}"
            ) from error
        except (ValueError, RecursionError) as error:
            raise InvalidArgumentError(
                f"{path} is no JSON ({error}): name a file that {what} has written"
            ) from error
        form = data.get("format") if isinstance(data, dict) else None
        if not str(form).startswith("pyvista-vdi "):
            raise InvalidArgumentError(
                f"{path} holds no results: name a file that {what} has written"
            )
        if (form, data.get("version")) != (FORMAT, VERSION):
            raise InvalidArgumentError(
                f"{path} is of version {data.get('version')!r}; this program reads version "
                f"{VERSION}: measure again, or use the program that wrote it"
            )
        missing = [name for name in _HEAD if name not in data]
        if missing:
            raise InvalidArgumentError(f"{path} lacks {', '.join(missing)}: measure again")
        if kind is not None and data["kind"] != kind:
            raise InvalidArgumentError(
                f"{path} holds results of {data['kind']}: name a file that {what} has written"
            )
        return cls(data, path)

    @property
    def path(self) -> Path:
        """The file."""
        if self._path is None:
            raise InvalidArgumentError("these results have no file: give them a path")
        return self._path

    @property
    def plan(self) -> dict[str, Any]:
        """What was chosen."""
        plan: dict[str, Any] = self.data["plan"]
        return plan

    def rows(self, **having: Any) -> Iterator[dict[str, Any]]:
        """Yield the rows, those that have figures and those refused, whose case has these values.

        ``None`` asks for cases that lack a name.
        """
        for row in self.data["rows"]:
            if all(row["case"].get(name) == value for name, value in having.items()):
                yield row

    def row(self, case: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the row of a case, if it is there."""
        wanted = json.loads(json.dumps(dict(case)))
        return next((row for row in self.data["rows"] if row["case"] == wanted), None)

    def add(self, case: Mapping[str, Any], **figures: Any) -> dict[str, Any]:
        """Add a row, in place of the one that its case may have, and write the file.

        Numbers are rounded to :data:`DIGITS`, and infinite ones become null.
        """
        row: dict[str, Any] = json.loads(json.dumps({"case": dict(case), **rounded(figures)}))
        others = [other for other in self.data["rows"] if other["case"] != row["case"]]
        self.data["rows"] = [*others, row]
        self.save()
        return row

    def save(self) -> None:
        """Write the file, if there is one; a run that is stopped meanwhile leaves the old one."""
        self.data["changed"] = now()
        if self._path is None:
            return
        head = [f"{json.dumps(n)}: {json.dumps(v)}" for n, v in self.data.items() if n != "rows"]
        rows = [json.dumps(row, separators=(",", ":")) for row in self.data["rows"]]
        lines = [*head, '"rows": [' + "".join(f"\n{row}," for row in rows).rstrip(",") + "\n]"]
        with whole_file(self._path) as stream:
            stream.write(("{\n" + ",\n".join(lines) + "\n}\n").encode())

    def _checked(self, plan: Mapping[str, Any], system: Mapping[str, str], extent: str) -> Results:
        """Return these results, if a run may go on with them."""
        for name, value in sorted({**plan, "extent": extent}.items()):
            theirs = {**self.plan, "extent": self.data["extent"]}.get(name)
            if theirs != value:
                raise InvalidArgumentError(
                    f"{self.path} holds results for {name} = {theirs}, not {value}: give the same "
                    "options to --resume, or choose another --out"
                )
        for name in _SAME_SYSTEM:
            if self.data["system"].get(name) != system.get(name):
                raise InvalidArgumentError(
                    f"{self.path} was measured on {name} {self.data['system'].get(name)}, and "
                    f"this is {system.get(name)}: choose another --out"
                )
        if changed := outdated(self.data["measured"]):
            raise InvalidArgumentError(
                f"{self.path} was measured by other code in {', '.join(changed)}: choose another "
                "--out"
            )
        return self


def rounded(value: Any) -> Any:
    """Return a value with numbers of :data:`DIGITS`, and null for those that JSON does not have."""
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    return value


def now() -> str:
    """Return the date and time, UTC."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
