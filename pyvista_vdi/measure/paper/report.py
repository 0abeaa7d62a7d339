"""The results as Markdown: Table 1, what each VDI takes, Table 2."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pyvista_vdi.measure.clock import Times, median, spread
from pyvista_vdi.measure.paper.published import PaperCell, paper_cell, paper_tables
from pyvista_vdi.measure.report import (
    ABSENT,
    METRICS,
    across,
    closing,
    mebibytes,
    milliseconds,
    number,
    ratio,
    section,
    table,
)
from pyvista_vdi.measure.session import CANDIDATES

#: What a row is of; a VDI has no angle.
_ROW = ("data set", "window", "N_S", "angle")

#: Candidates whose kernels are ours.
_OURS = {name: label for name, label in CANDIDATES.items() if not name.startswith("vtk_")}

#: Columns of Table 1 beside the times.
_FIGURES = (
    *("speed-up f", "paper", "speed-up f_e", "paper", "f_e / faster VTK"),
    *("SSIM", "paper", "PSNR", "worst", "SSIM to VTK GPU"),
)

#: Columns of what a VDI takes.
_TAKEN = (
    *("lists not empty", "per list", "longest", "raw MiB", "saved MiB"),
    *("generation s", "by events s", "saving s"),
)


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
        *_explanation(data["plan"]),
        *section("Table 1"),
        *table((*_ROW, *CANDIDATES.values(), *_FIGURES), _table1(data)),
        "",
        *section(
            "The same by device events",
            "Milliseconds that our kernels ran, without transfers, launches and waiting.",
        ),
        *table((*_ROW, *_OURS.values(), "speed-up f", "speed-up f_e", "paper"), _by_events(data)),
        "",
        *section(
            "What each VDI takes",
            "Supersegments per list: the mean of lists that are not empty, and the longest. Raw: "
            "all arrays in memory; saved: a `.vdi` in the default compression.",
        ),
        *table((*_ROW[:3], *_TAKEN), _vdis(data)),
        "",
        *_table2(data),
        *_refused(data),
        *_datasets(data),
        *closing(data),
    ]
    return "\n".join(lines) + "\n"


def _explanation(plan: dict[str, Any]) -> Iterator[str]:
    yield (
        f"Medians of {plan['repeats']} frames of each kind, taken in turn after one that is not "
        "counted, and half of what lies between the shortest and the longest, in percent of the "
        "median; milliseconds by the clock. Our frames end with the picture on the host, VTK's in "
        f"its framebuffer. Steps of one voxel, {plan['interpolation']} sampling. A speed-up is "
        "over `render_volume` without skipping; the paper's, over its own volume rendering "
        f"({paper_tables()['device']})."
    )
    yield ""
    yield f"SSIM, PSNR (dB) and worst pixel (in 1/255) are of the VDI's picture against {METRICS}"
    yield ""


def _table1(data: dict[str, Any]) -> Iterator[list[str]]:
    for cell, row, paper in _rows(data):
        found, vtk = row["vdi_to_volume"], row["volume_to_vtk_gpu"]
        times = {name: median(taken) for name, taken in row["seconds"].items()}
        peers = [t for n, t in times.items() if n.startswith("vtk_") and t is not None]
        yield [
            *_named(cell, row),
            *(_with_spread(row["seconds"].get(name)) for name in CANDIDATES),
            ratio(times.get("volume"), times.get("vdi")),
            number(getattr(paper, "speed_up", None), ".1f"),
            ratio(times.get("volume"), times.get("vdi_skipping")),
            number(getattr(paper, "speed_up_skipping", None), ".1f"),
            ratio(min(peers, default=None), times.get("vdi_skipping")),
            number(found["ssim"], ".4f"),
            number(getattr(paper, "ssim", None), ".3f"),
            number(found["psnr"], ".1f"),
            number(found["worst_pixel"], ".1f"),
            number(vtk and vtk["ssim"], ".4f"),
        ]


def _by_events(data: dict[str, Any]) -> Iterator[list[str]]:
    """Give the times of our kernels alone, by the driver's events."""
    for cell, row, paper in _rows(data):
        times = {n: median(row["seconds"].get(n, {}), "device") for n in _OURS}
        yield [
            *_named(cell, row),
            *(milliseconds(times[name]) for name in _OURS),
            ratio(times["volume"], times["vdi"]),
            ratio(times["volume"], times["vdi_skipping"]),
            number(getattr(paper, "speed_up_skipping", None), ".1f"),
        ]


def _vdis(data: dict[str, Any]) -> Iterator[list[str]]:
    for cell in data["cells"]:
        vdi = cell["vdi"]
        if vdi is None:
            continue
        yield [
            *_named(cell),
            f"{vdi['occupied_lists'] / vdi['lists']:.0%}",
            f"{vdi['mean_length']:.1f}",
            str(vdi["longest_list"]),
            mebibytes(vdi["bytes_raw"]),
            mebibytes(vdi["bytes_saved"]),
            number(median(vdi["generation_seconds"]), ".2f"),
            number(median(vdi["generation_seconds"], "device"), ".2f"),
            number(vdi["save_seconds"], ".2f"),
        ]


def _table2(data: dict[str, Any]) -> Iterator[str]:
    for entry in data["previews"]:
        yield from section(
            "Table 2",
            f"Previews of {entry['dataset']}, {across(entry['window_size'])}, "
            f"N_S {entry['max_supersegments']}, "
            f"{entry['angle']:g} degrees, at the paper's rates as multiples of the full frame's "
            "(40 to 80 over 24 frames per second). Fewer pixels is what `add_vdi` does; samples "
            "per ray is the paper's. SSIM to the full frame and to `render_volume`.",
        )
        if entry["refused"] is not None:
            yield from (f"Refused: {entry['refused']}", "")
            continue
        full = median(entry["full"]["seconds"])
        yield (
            f"The full frame takes {milliseconds(full)} ms; its SSIM to `render_volume` is "
            f"{number(entry['full']['to_volume']['ssim'], '.4f')}."
        )
        yield ""
        rows = (
            [
                row["way"],
                f"{row['target_speed_up']:.2f}x",
                ratio(full, median(row["seconds"])),
                f"{row['share']:.3f}",
                number(row["to_full"]["ssim"], ".4f"),
                number(row["paper_ssim"], ".4f"),
                number(row["to_volume"]["ssim"], ".4f"),
            ]
            for row in entry["rows"]
        )
        heads = ("way", "target", "reached", "share", "SSIM to full", "paper", "SSIM to volume")
        yield from (*table(heads, rows), "")


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
    yield from section("Not measured")
    for cell in refused:
        yield f"- `{cell['name']}`: {cell['refused']}"
    for dataset, name, reason in sorted(left_out):
        yield f"- {CANDIDATES[name]} with {dataset}: {reason}"
    yield ""


def _datasets(data: dict[str, Any]) -> Iterator[str]:
    yield from section("Data sets")
    for name, found in data["datasets"].items():
        stands = ""
        if found["paper"] is not None:
            of_paper = found["source"] == "file"
            stands = f"; {'is' if of_paper else 'stands in for'} the paper's {found['paper']}"
        size = across(found["dimensions"], " x ")
        yield f"- {name}: {size} {found['dtype']}, {found['description']}{stands}"


def _rows(
    data: dict[str, Any],
) -> Iterator[tuple[dict[str, Any], dict[str, Any], PaperCell | None]]:
    """Yield cell, row and what the paper has there."""
    for cell in data["cells"]:
        paper = data["datasets"][cell["dataset"]]["paper"] if cell["angles"] else None
        for row in cell["angles"]:
            limit = cell["max_supersegments"]
            yield cell, row, paper_cell(paper, cell["window_size"], limit, row["angle"])


def _named(cell: dict[str, Any], *rows: dict[str, Any]) -> Iterator[str]:
    yield from (cell["dataset"], across(cell["window_size"]), str(cell["max_supersegments"]))
    yield from (f"{row['angle']:g}" for row in rows)


def _with_spread(taken: Times | None) -> str:
    middle = None if taken is None else median(taken)
    if taken is None or not middle:
        return ABSENT
    return f"{milliseconds(middle)} ±{spread(taken['clock']):.0%}"
