"""Reports: Markdown tables and the sentences that they share, plots, and what figures depend on."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.io import whole_file
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
