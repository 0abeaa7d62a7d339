"""The results as Markdown, Table 1, what each VDI takes and Table 2, beside the paper's figures."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from pyvista_vdi.measure.clock import Times, median, spread
from pyvista_vdi.measure.harness import CANDIDATES
from pyvista_vdi.measure.results import (
    ABSENT,
    METRICS,
    Results,
    across,
    closing,
    mebibytes,
    milliseconds,
    number,
    ratio,
    section,
    table,
)

#: What a row is of; a VDI has no angle.
_ROW = ("data set", "window", "N_S", "angle")

#: Precisions of packed VDIs whose frames are enqueued, too.
PACKED = ("8-byte",)

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


@dataclass(frozen=True)
class PaperCell:
    """One cell of the paper's Table 1: frames per second, and SSIM to volume rendering.

    ``volume_fps`` are the paper's volume rendering's at this angle, ``fps`` and ``fps_skipping``
    the VDI's without and with skipping of empty space.
    """

    volume_fps: float
    fps: float
    fps_skipping: float
    ssim: float

    @property
    def speed_up(self) -> float:
        """Speed of the VDI without skipping over the paper's volume rendering."""
        return self.fps / self.volume_fps

    @property
    def speed_up_skipping(self) -> float:
        """Speed of the VDI with skipping over the paper's volume rendering."""
        return self.fps_skipping / self.volume_fps


@cache
def paper_tables() -> dict[str, Any]:
    """Return the data file: ``source``, ``device``, ``table1`` and ``table2``."""
    file = resources.files("pyvista_vdi.measure.paper") / "paper_tables.json"
    tables: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return tables


def paper_cell(
    dataset: str | None, window_size: Sequence[int], max_supersegments: int, angle: float
) -> PaperCell | None:
    """Return what the paper measured, or None where it has no such cell.

    ``dataset`` is ``"kingsnake"``, ``"beechnut"`` or ``"richtmyer_meshkov"``, ``max_supersegments``
    its N_S, ``angle`` in degrees from V_O.
    """
    for row in paper_tables()["table1"]:
        if (row["dataset"], row["window_size"]) == (dataset, list(window_size)):
            for cell in row["vdi"]:
                if (cell["max_supersegments"], cell["angle"]) == (max_supersegments, angle):
                    figures = (cell[name] for name in ("fps", "fps_skipping", "ssim"))
                    return PaperCell(row["volume_fps"][str(cell["angle"])], *figures)
    return None


def paper_targets() -> list[tuple[float, float]]:
    """Return Table 2: each target rate as a multiple of the full frame's rate, and the SSIM."""
    table = paper_tables()["table2"]
    return [(target["fps"] / table["full_fps"], target["ssim"]) for target in table["targets"]]


def describe(data: dict[str, Any]) -> str:
    """Return the tables of what the JSON holds as Markdown, ending with a newline."""
    plan = data["plan"]
    lines = [
        *(f"# Benchmark, profile {plan['profile']}", ""),
        *(line for text in _explanation(plan) for line in (text, "")),
        *section("Table 1"),
        *table((*_ROW, *CANDIDATES.values(), *_FIGURES), _table1(data)),
        "",
        *_queued(data),
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
    yield (f"SSIM, PSNR (dB) and worst pixel (in 1/255) are of the VDI's picture against {METRICS}")


def _table1(data: dict[str, Any]) -> Iterator[list[str]]:
    for row, paper in _views(data):
        found, vtk = row["vdi_to_volume"], row["volume_to_vtk_gpu"]
        times = {name: median(taken) for name, taken in row["seconds"].items()}
        peers = [t for n, t in times.items() if n.startswith("vtk_") and t is not None]
        yield [
            *_named(row),
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


def _queued(data: dict[str, Any]) -> Iterator[str]:
    """Yield frames per second of pictures that stay on the device, beside the paper's."""
    views = [(row, paper) for row, paper in _views(data) if "queued_seconds" in row]
    if not views:
        return
    yield from section(
        "Frames that stay on the device",
        f"Frames a second of {data['plan']['queued']} that are enqueued one after the other, each "
        "of another view; in brackets, milliseconds that the driver's events say for the kernels. "
        "8-byte: the VDI with packed supersegments, f_e. Over volume: the VDI's better "
        "rate over `render_volume` without skipping, and the paper's "
        f"({paper_tables()['device']}).",
    )
    ours = list(CANDIDATES)[:4]
    rows = []
    for row, paper in views:
        rates = {name: 1 / row["queued_seconds"][name] for name in ours}
        kernels = {name: median(row["seconds"][name], "device") for name in ours}
        packed = [row["queued_seconds"].get(f"vdi_{precision}") for precision in PACKED]
        rows.append(
            [
                *_named(row),
                *(f"{rates[name]:.0f} ({milliseconds(kernels[name])})" for name in ours),
                *(number(seconds and 1 / seconds, ".0f") for seconds in packed),
                number(getattr(paper, "fps_skipping", None), ".0f"),
                ratio(max(rates["vdi"], rates["vdi_skipping"]), rates["volume"]),
                number(getattr(paper, "speed_up_skipping", None), ".1f"),
            ]
        )
    columns = (*(CANDIDATES[name] for name in ours), *PACKED)
    heads = (*_ROW, *columns, "paper, f_e", "over volume", "paper")
    yield from (*table(heads, rows), "")


def _vdis(data: dict[str, Any]) -> Iterator[list[str]]:
    for row in measured(data, "vdi"):
        yield [
            *_named(row),
            f"{row['occupied_lists'] / row['lists']:.0%}",
            f"{row['mean_length']:.1f}",
            str(row["longest_list"]),
            mebibytes(row["bytes_raw"]),
            mebibytes(row["bytes_saved"]),
            number(median(row["generation_seconds"]), ".2f"),
            number(median(row["generation_seconds"], "device"), ".2f"),
            number(row["save_seconds"], ".2f"),
        ]


def _table2(data: dict[str, Any]) -> Iterator[str]:
    for row in measured(data, "preview"):
        case = row["case"]
        yield from section(
            "Table 2",
            f"Previews of {case['volume']}, {across(case['window_size'])}, "
            f"N_S {case['max_supersegments']}, "
            f"{case['angle']:g} degrees, at the paper's rates as multiples of the full frame's "
            "(40 to 80 over 24 frames per second). Fewer pixels is what `add_vdi` does; samples "
            "per ray is the paper's. SSIM to the full frame and to `render_volume`.",
            f"The full frame takes {milliseconds(median(row['seconds']))} ms; its SSIM to "
            f"`render_volume` is {number(row['to_volume']['ssim'], '.4f')}.",
        )
        rows = (
            [
                way["way"],
                f"{way['target_speed_up']:.2f}x",
                ratio(median(row["seconds"]), median(way["seconds"])),
                f"{way['share']:.3f}",
                number(way["to_full"]["ssim"], ".4f"),
                number(way["paper_ssim"], ".4f"),
                number(way["to_volume"]["ssim"], ".4f"),
            ]
            for way in row["ways"]
        )
        heads = ("way", "target", "reached", "share", "SSIM to full", "paper", "SSIM to volume")
        yield from (*table(heads, rows), "")


def _refused(data: dict[str, Any]) -> Iterator[str]:
    """Name what was not measured, and why; what a volume's reason explains is not repeated."""
    told: dict[str, str] = {}
    left_out = {}
    for row in data["rows"]:
        name, reason = name_of(row["case"]), row.get("refused")
        if reason and not any(name.startswith(n) and reason == r for n, r in told.items()):
            told[name] = reason
        for candidate, why in row.get("left_out", {}).items():
            left_out[f"{CANDIDATES[candidate]} with {row['case']['volume']}"] = why
    if told or left_out:
        yield from section("Not measured")
        yield from (f"- `{name}`: {reason}" for name, reason in told.items())
        yield from (f"- {name}: {reason}" for name, reason in sorted(left_out.items()))
        yield ""


def _datasets(data: dict[str, Any]) -> Iterator[str]:
    yield from section("Data sets")
    for row in measured(data, "volume"):
        stands = ""
        if row["paper"] is not None:
            of_paper = row["source"] == "file"
            stands = f"; {'is' if of_paper else 'stands in for'} the paper's {row['paper']}"
        size = across(row["dimensions"], " x ")
        yield f"- {row['case']['volume']}: {size} {row['dtype']}, {row['description']}{stands}"


def measured(data: dict[str, Any], what: str) -> Iterator[dict[str, Any]]:
    """Yield the rows that have figures of volumes, VDIs, views or previews."""
    return (row for row in Results(data).rows(what=what) if "refused" not in row)


def name_of(case: dict[str, Any]) -> str:
    """Return a short name: ``brain``, ``brain/1280x720/15``, ``brain/1280x720/15 at 5 degrees``."""
    if "window_size" not in case:
        return str(case["volume"])
    name = f"{case['volume']}/{across(case['window_size'])}/{case['max_supersegments']}"
    return f"{name} at {case['angle']:g} degrees" if "angle" in case else name


def _views(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], PaperCell | None]]:
    """Yield the rows of views, and what the paper has there."""
    of_paper = {row["case"]["volume"]: row["paper"] for row in measured(data, "volume")}
    for row in measured(data, "view"):
        case = row["case"]
        size, limit = case["window_size"], case["max_supersegments"]
        yield row, paper_cell(of_paper.get(case["volume"]), size, limit, case["angle"])


def _named(row: dict[str, Any]) -> Iterator[str]:
    case = row["case"]
    yield from (case["volume"], across(case["window_size"]), str(case["max_supersegments"]))
    if "angle" in case:
        yield f"{case['angle']:g}"


def _with_spread(taken: Times | None) -> str:
    middle = None if taken is None else median(taken)
    if taken is None or not middle:
        return ABSENT
    return f"{milliseconds(middle)} ±{spread(taken['clock']):.0%}"
