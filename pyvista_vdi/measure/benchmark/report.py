"""The results as Markdown: Table 1, what each VDI takes, Table 2."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pyvista_vdi.measure.benchmark.candidates import CANDIDATES, median
from pyvista_vdi.measure.benchmark.paper import PaperCell, paper_cell, paper_tables
from pyvista_vdi.model.metrics import SSIM_ARGUMENTS, SSIM_WINDOW

_ABSENT = "-"


def describe(data: dict[str, Any]) -> str:
    """Return the tables as Markdown.

    Parameters
    ----------
    data : dict
        What the JSON holds.

    Returns
    -------
    str
        Ends with a newline.
    """
    lines = [
        f"# Benchmark, profile {data['plan']['profile']}",
        "",
        *_explanation(data),
        *_table1(data),
        *_device_table(data),
        *_vdi_table(data),
        *_table2(data),
        *_refused(data),
        *_datasets(data),
        "",
        f"Measured from {data['begun']} to {data['changed']} on: "
        + ", ".join(f"{name} {value}" for name, value in data["system"].items())
        + ".",
    ]
    return "\n".join(lines) + "\n"


def _explanation(data: dict[str, Any]) -> Iterator[str]:
    plan = data["plan"]
    ssim = ", ".join(f"{name}={value}" for name, value in SSIM_ARGUMENTS.items())
    yield (
        f"Medians of {plan['repeats']} frames of each kind, taken in turn after one that is not "
        "counted, and half of what lies between the shortest and the longest, in percent of the "
        "median; milliseconds by the clock. Our frames end with the picture on the host, VTK's in "
        f"its framebuffer. Steps of one voxel, {plan['interpolation']} sampling. A speed-up is "
        "over `render_volume` without skipping; the paper's, over its own volume rendering "
        f"({paper_tables()['device']})."
    )
    yield ""
    yield (
        "SSIM, PSNR (dB) and worst pixel (in 1/255) are of the VDI's picture against "
        "`render_volume` at steps of half a voxel, RGB over black, not quantised. "
        f"SSIM: scikit-image, {ssim}, window of {SSIM_WINDOW}."
    )
    yield ""


def _table1(data: dict[str, Any]) -> Iterator[str]:
    yield "## Table 1"
    yield ""
    yield _row(
        "data set",
        "window",
        "N_S",
        "angle",
        *CANDIDATES.values(),
        "speed-up f",
        "paper",
        "speed-up f_e",
        "paper",
        "f_e / faster VTK",
        "SSIM",
        "paper",
        "PSNR",
        "worst",
        "SSIM to VTK GPU",
    )
    yield "|" + "---|" * 20
    for cell, row in _rows(data):
        paper = _paper(data, cell, row["angle"])
        found, vtk = row["vdi_to_volume"], row["volume_to_vtk_gpu"]
        times = {name: median(taken) for name, taken in row["seconds"].items()}
        peers = [t for n, t in times.items() if n.startswith("vtk_") and t is not None]
        yield _row(
            cell["dataset"],
            "x".join(str(n) for n in cell["window_size"]),
            str(cell["max_supersegments"]),
            f"{row['angle']:g}",
            *(_with_spread(row["seconds"].get(name)) for name in CANDIDATES),
            _ratio(times.get("volume"), times.get("vdi")),
            _number(getattr(paper, "speed_up", None), ".1f"),
            _ratio(times.get("volume"), times.get("vdi_skipping")),
            _number(getattr(paper, "speed_up_skipping", None), ".1f"),
            _ratio(min(peers, default=None), times.get("vdi_skipping")),
            _number(found["ssim"], ".4f"),
            _number(getattr(paper, "ssim", None), ".3f"),
            _number(found["psnr"], ".1f"),
            _number(found["worst_pixel"], ".1f"),
            _number(vtk and vtk["ssim"], ".4f"),
        )
    yield ""


def _device_table(data: dict[str, Any]) -> Iterator[str]:
    """Give the times of our kernels alone, by the driver's events."""
    ours = [name for name in CANDIDATES if not name.startswith("vtk_")]
    yield "## The same by device events"
    yield ""
    yield "Milliseconds that our kernels ran, without transfers, launches and waiting."
    yield ""
    yield _row(
        "data set",
        "window",
        "N_S",
        "angle",
        *(CANDIDATES[name] for name in ours),
        "speed-up f",
        "speed-up f_e",
        "paper",
    )
    yield "|" + "---|" * (7 + len(ours))
    for cell, row in _rows(data):
        paper = _paper(data, cell, row["angle"])
        times = {n: median(row["seconds"][n], "device") for n in ours if n in row["seconds"]}
        yield _row(
            cell["dataset"],
            "x".join(str(n) for n in cell["window_size"]),
            str(cell["max_supersegments"]),
            f"{row['angle']:g}",
            *(_milliseconds(times.get(name)) for name in ours),
            _ratio(times.get("volume"), times.get("vdi")),
            _ratio(times.get("volume"), times.get("vdi_skipping")),
            _number(getattr(paper, "speed_up_skipping", None), ".1f"),
        )
    yield ""


def _vdi_table(data: dict[str, Any]) -> Iterator[str]:
    yield "## What each VDI takes"
    yield ""
    yield (
        "Supersegments per list: the mean of lists that are not empty, and the longest. Raw: all "
        "arrays in memory; saved: a `.vdi` in the default compression."
    )
    yield ""
    yield _row(
        "data set",
        "window",
        "N_S",
        "lists not empty",
        "per list",
        "longest",
        "raw MiB",
        "saved MiB",
        "generation s",
        "by events s",
        "saving s",
    )
    yield "|" + "---|" * 11
    for cell in data["cells"]:
        vdi = cell["vdi"]
        if vdi is None:
            continue
        yield _row(
            cell["dataset"],
            "x".join(str(n) for n in cell["window_size"]),
            str(cell["max_supersegments"]),
            f"{vdi['occupied_lists'] / vdi['lists']:.0%}",
            f"{vdi['mean_length']:.1f}",
            str(vdi["longest_list"]),
            _mebibytes(vdi["bytes_raw"]),
            _mebibytes(vdi["bytes_saved"]),
            _number(median(vdi["generation_seconds"]), ".2f"),
            _number(median(vdi["generation_seconds"], "device"), ".2f"),
            _number(vdi["save_seconds"], ".2f"),
        )
    yield ""


def _table2(data: dict[str, Any]) -> Iterator[str]:
    for entry in data["previews"]:
        size = "x".join(str(n) for n in entry["window_size"])
        yield "## Table 2"
        yield ""
        yield (
            f"Previews of {entry['dataset']}, {size}, N_S {entry['max_supersegments']}, "
            f"{entry['angle']:g} degrees, at the paper's rates as multiples of the full frame's "
            "(40 to 80 over 24 frames per second). Fewer pixels is what `add_vdi` does; samples "
            "per ray is the paper's. SSIM to the full frame and to `render_volume`."
        )
        yield ""
        if entry["refused"] is not None:
            yield f"Refused: {entry['refused']}"
            yield ""
            continue
        full = median(entry["full"]["seconds"])
        yield (
            f"The full frame takes {_milliseconds(full)} ms; its SSIM to `render_volume` is "
            f"{_number(entry['full']['to_volume']['ssim'], '.4f')}."
        )
        yield ""
        yield _row("way", "target", "reached", "share", "SSIM to full", "paper", "SSIM to volume")
        yield "|" + "---|" * 7
        for row in entry["rows"]:
            yield _row(
                row["way"],
                f"{row['target_speed_up']:.2f}x",
                _ratio(full, median(row["seconds"])),
                f"{row['share']:.3f}",
                _number(row["to_full"]["ssim"], ".4f"),
                _number(row["paper_ssim"], ".4f"),
                _number(row["to_volume"]["ssim"], ".4f"),
            )
        yield ""


def _refused(data: dict[str, Any]) -> Iterator[str]:
    """Name what was not measured, and why."""
    refused = [cell for cell in data["cells"] if cell["refused"] is not None]
    left_out = {
        (cell["dataset"], name, reason)
        for cell in data["cells"]
        for name, reason in cell.get("left_out", {}).items()
    }
    if not refused and not left_out:
        return
    yield "## Not measured"
    yield ""
    for cell in refused:
        yield f"- `{cell['name']}`: {cell['refused']}"
    for dataset, name, reason in sorted(left_out):
        yield f"- {CANDIDATES[name]} with {dataset}: {reason}"
    yield ""


def _datasets(data: dict[str, Any]) -> Iterator[str]:
    yield "## Data sets"
    yield ""
    for name, found in data["datasets"].items():
        stands = ""
        if found["paper"] is not None:
            of_paper = found["source"] == "file"
            stands = f"; {'is' if of_paper else 'stands in for'} the paper's {found['paper']}"
        size = " x ".join(str(n) for n in found["dimensions"])
        yield f"- {name}: {size} {found['dtype']}, {found['description']}{stands}"


def _rows(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    for cell in data["cells"]:
        for row in cell["angles"]:
            yield cell, row


def _paper(data: dict[str, Any], cell: dict[str, Any], angle: float) -> PaperCell | None:
    dataset = data["datasets"][cell["dataset"]]["paper"]
    return paper_cell(dataset, cell["window_size"], cell["max_supersegments"], angle)


def _with_spread(taken: dict[str, list[float]] | None) -> str:
    middle = None if taken is None else median(taken)
    if taken is None or not middle:
        return _ABSENT
    spread = (max(taken["clock"]) - min(taken["clock"])) / 2 / middle
    return f"{_milliseconds(middle)} ±{spread:.0%}"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _milliseconds(seconds: float | None) -> str:
    if seconds is None:
        return _ABSENT
    return f"{seconds * 1e3:.0f}" if seconds >= 0.1 else f"{seconds * 1e3:.3g}"


def _ratio(of: float | None, to: float | None) -> str:
    return _ABSENT if of is None or not to else f"{of / to:.1f}"


def _number(value: float | None, form: str) -> str:
    return _ABSENT if value is None else format(value, form)


def _mebibytes(n: int | None) -> str:
    return _ABSENT if n is None else f"{n / 2**20:.2f}"
