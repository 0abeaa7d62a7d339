"""The file of every measurement: JSON with a row for each case, whole after every row."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.clock import outdated, provenance
from pyvista_vdi.model.metrics import SSIM_ARGUMENTS, SSIM_WINDOW

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What tables have where there is no figure.
ABSENT = "-"

#: What a figure may depend on, where it is installed.
_PACKAGES = ("pyvista-vdi", "numpy", "pyopencl", "scikit-image", "vtk", "pyvista")

#: What SSIM, PSNR and the worst pixel of a picture are.
METRICS = (
    "`render_volume` at steps of half a voxel, RGB over black, not quantised. SSIM: scikit-image, "
    + ", ".join(f"{name}={value}" for name, value in SSIM_ARGUMENTS.items())
    + f", window of {SSIM_WINDOW}."
)


def describe_system(device: Any = None) -> dict[str, str]:
    """Return the device, its driver and the versions that a measured figure depends on."""
    info = get_runtime(device).info
    described = {
        "device": info.full_name,
        "driver": info.driver,
        "compute units": str(info.compute_units),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }
    for name in _PACKAGES:
        try:
            described[name] = version(name)
        except PackageNotFoundError:
            continue
    return described


def closing(data: Mapping[str, Any]) -> list[str]:
    """Return the last lines of a report: when it was measured, of what code, and on what."""
    commit = data["measured"]["commit"]
    code = f", commit {commit}" if commit else ""
    part = " of a sample of the cases" if data["extent"] == "sample" else ""
    times = f"Measured from {data['begun']} to {data['changed']}{part}{code}"
    system = ", ".join(f"{name} {value}" for name, value in data["system"].items())
    return ["", f"{times} on: {system}."]


def section(title: str, *paragraphs: str) -> Iterator[str]:
    """Yield a heading and paragraphs, an empty line after each."""
    for text in (f"## {title}", *paragraphs):
        yield from (text, "")


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a Markdown table."""
    lines = [f"| {' | '.join(map(str, cells))} |" for cells in (heads, *rows)]
    return [lines[0], "|" + "---|" * len(heads), *lines[1:]]


def number(value: float | None, form: str) -> str:
    """Return a figure in a form such as ``.4f``."""
    return ABSENT if value is None else format(value, form)


def ratio(of: float | None, to: float | None) -> str:
    """Return how many times a figure is another."""
    return ABSENT if of is None or not to else f"{of / to:.1f}"


def milliseconds(seconds: float | None) -> str:
    """Return a time in milliseconds, to three digits or whole."""
    form = ".0f" if (seconds or 0) >= 0.1 else ".3g"
    return number(None if seconds is None else seconds * 1e3, form)


def mebibytes(n: float | None) -> str:
    """Return bytes in MiB."""
    return number(None if n is None else n / 2**20, ".2f")


def across(sizes: Iterable[int], between: str = "x") -> str:
    """Return sizes with something between them: ``1280x720``."""
    return between.join(str(n) for n in sizes)


def new_figure(size: tuple[float, float], **options: Any) -> Figure:
    """Return a figure of Matplotlib's that needs no display, inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, **options)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path, dpi: int = 110) -> None:
    """Write a figure as PNG; the file appears whole or not at all."""
    with whole_file(path) as stream:
        figure.savefig(stream, dpi=dpi, format="png")


def write_text(path: Path, text: str) -> None:
    """Write a report; the file appears whole or not at all."""
    with whole_file(path) as stream:
        stream.write(text.encode())


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
            Whose code decides the figures, see :func:`.clock.provenance`.
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
