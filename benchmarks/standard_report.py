"""The results of ``standard_table.py`` as Markdown tables and as a plot."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pyvista_vdi.measure.compare.bounds import CONVERGED_STEPS, SSIM_FROM_NEW_VIEWS
from pyvista_vdi.measure.report import new_figure, save_figure, system_line, table, write_text

Results = dict[str, Any]

#: Markers and colours of the transfer functions in the plot.
_STYLES = {"soft": ("o", "C0"), "steep": ("^", "C1"), "nearly-opaque": ("s", "C3")}

_PARTS = ("accuracy", "converged", "timings")

#: 1 - SSIM below this is drawn here: equal to the eye, and the axis is logarithmic.
_LEAST_DISTANCE = 1e-5


def write_tables(results: Results, target: Path) -> None:
    """Write everything that was measured as Markdown."""
    width, height = results["window_size"]
    longest = results["max_supersegments"]
    lines = [
        f"{width} x {height} lists and pixels, at most {longest} supersegments in a list, steps of",
        "half the smallest spacing; *reach* is the bound; bold: a bound is missed.",
        "",
    ]
    for interpolation in ("nearest", "linear"):
        cases = _cases(results, "accuracy", interpolation)
        if cases:
            lines += [f"**VDI against our volume raycaster, `{interpolation}`**", ""]
            lines += [*_vdi_table(cases), ""]
            lines += [
                f"**Our volume raycaster against VTK's GPU mapper, `{interpolation}`** (in",
                "brackets: VTK's fixed-point mapper against VTK's GPU mapper)",
                "",
            ]
            lines += [*_vtk_table(cases, "accuracy"), ""]
        converged = _cases(results, "converged", interpolation)
        if converged:
            lines += [f"**The same at {CONVERGED_STEPS} steps a voxel**, where two missed", ""]
            lines += [*_vtk_table(converged, "converged"), ""]
        timed = _cases(results, "timings", interpolation)
        if timed:
            lines += [f"**Times, `{interpolation}`** (ratios within one run)", ""]
            lines += [*_timing_table(timed), ""]
    lines += _missed(results)
    lines += _failed(results)
    lines += _systems(results)
    write_text(target, "\n".join(lines).rstrip() + "\n")


def write_plot(results: Results, target: Path) -> None:
    """Plot 1 - SSIM of the VDI from new views, a row per angle and a column per interpolation."""
    columns = {i: _cases(results, "accuracy", i) for i in ("nearest", "linear")}
    columns = {name: cases for name, cases in columns.items() if cases}
    if not columns:
        return
    figure = new_figure((5.5 * len(columns), 7))
    axes = figure.subplots(2, len(columns), sharey=True, squeeze=False)
    for column, (interpolation, cases) in enumerate(columns.items()):
        names = sorted({entry["case"]["volume"] for entry in cases})
        for row, angle in enumerate((5.0, 30.0)):
            _plot_panel(axes[row][column], cases, names, angle)
            axes[row][column].set_title(f"{interpolation}, {angle:g} degrees from V_O")
    axes[0][0].legend(fontsize=8)
    for row in axes:
        row[0].set_ylabel("1 - SSIM")
    figure.tight_layout()
    save_figure(figure, target, 90)


def _plot_panel(axes: Any, cases: list[Any], names: list[str], angle: float) -> None:
    for look, (marker, color) in _STYLES.items():
        points = [
            (names.index(entry["case"]["volume"]), _at(entry["accuracy"], angle))
            for entry in cases
            if entry["case"]["transfer_function"] == look
        ]
        distances = [max(_LEAST_DISTANCE, 1 - a["vdi_to_raycaster"]["ssim"]) for _, a in points]
        axes.scatter([x for x, _ in points], distances, marker=marker, color=color, label=look)
    for look, style in (("soft", ":"), ("nearly-opaque", "--")):
        bound = 1 - SSIM_FROM_NEW_VIEWS[angle, look]
        axes.axhline(bound, color=_STYLES[look][1], linestyle=style, linewidth=1)
    axes.set_yscale("log")
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=8)
    axes.grid(axis="y", alpha=0.3)


def _vdi_table(cases: list[Any]) -> list[str]:
    heads = ["volume", "transfer function", "V_O SSIM", "V_O worst /255"]
    heads += ["5° SSIM (reach)", "5° PSNR", "30° SSIM (reach)", "30° PSNR"]
    heads += ["brightness 5°, 30°", "per list", "VDI MiB", "volume MiB"]
    rows = []
    for entry in cases:
        part, held = entry["accuracy"], _held(entry["accuracy"])
        start, near, far = (_at(part, a)["vdi_to_raycaster"] for a in (0, 5, 30))
        sizes = part["sizes"]
        cells = [
            *_names(entry),
            _marked(f"{start['ssim']:.5f}", held.get("SSIM at V_O")),
            _marked(f"{start['worst_pixel']:.3f}", held.get("worst pixel at V_O")),
            _bounded(near["ssim"], held.get("SSIM at 5 degrees")),
            _decibels(near["psnr"]),
            _bounded(far["ssim"], held.get("SSIM at 30 degrees")),
            _decibels(far["psnr"]),
            ", ".join(
                _marked(
                    f"{found['mean_brightness_ratio']:.4f}",
                    held.get(f"brightness error at {angle} degrees"),
                )
                for angle, found in ((5, near), (30, far))
            ),
            f"{sizes['supersegments'] / max(1, sizes['occupied_lists']):.1f}",
            f"{sizes['vdi_bytes'] / 2**20:.1f}",
            f"{sizes['volume_bytes'] / 2**20:.1f}",
        ]
        rows.append(cells)
    return table(heads, rows)


def _vtk_table(cases: list[Any], part: str) -> list[str]:
    rows = []
    for entry in cases:
        held = _held(entry[part])
        cells = [*_names(entry)]
        for figure in ("ssim", "psnr"):
            for angle in (0, 5, 30):
                found = _at(entry[part], angle)
                ours, theirs = found["raycaster_to_gpu"], found["fixed_point_to_gpu"]
                kinds = ("SSIM", "1 - SSIM") if figure == "ssim" else ("PSNR", "RMS")
                checks = [held.get(f"{kind} to VTK at {angle} degrees") for kind in kinds]
                check = next((c for c in checks if c), None)
                text = {"ssim": "{:.4f} ({:.4f})", "psnr": "{:.1f} ({:.1f})"}[figure]
                cells.append(
                    _marked(text.format(_number(ours[figure]), _number(theirs[figure])), check)
                )
        rows.append(cells)
    heads = [f"{angle}° {figure}" for figure in ("SSIM", "PSNR") for angle in (0, 5, 30)]
    return table(("volume", "transfer function", *heads), rows)


def _timing_table(cases: list[Any]) -> list[str]:
    heads = ["volume", "transfer function", "generation / full raycast"]
    heads += ["5° frame / faster VTK mapper", "frame / our raycaster"]
    heads += ["VDI ms", "raycaster ms", "VTK GPU ms", "VTK fixed-point ms"]
    rows = []
    for entry in cases:
        part, held = entry["timings"], _held(entry["timings"])
        (found,) = part["angles"]
        cells = [
            *_names(entry),
            _marked(f"{part['generation_ratio']:.2f}", held.get("generation / raycast")),
            _marked(f"{found['ratio_to_vtk']:.2f}", held.get("frame / VTK at 5 degrees")),
            f"{found['ratio_to_raycaster']:.2f}",
            *(
                f"{found['seconds'][name]['median'] * 1e3:.0f}"
                for name in ("vdi", "raycaster", "gpu", "fixed_point")
            ),
        ]
        rows.append(cells)
    return table(heads, rows)


def _missed(results: Results) -> Iterator[str]:
    checks = [
        (key, check)
        for key, entry in results["cases"].items()
        for part in _PARTS
        for check in entry.get(part, {}).get("checks", ())
        # Superseded by the comparison at converged steps
        if part != "accuracy" or "converged" not in entry or "to VTK" not in check["name"]
    ]
    missed = [(key, check) for key, check in checks if not check["passed"]]
    yield f"Bounds: {len(checks)} checked, {len(missed)} missed."
    yield ""
    for key, check in missed:
        yield (
            f"- `{key}`: {check['name']} {check['value']:.5g}, to be {check['sense']} "
            f"{check['bound']:.5g}"
        )
    yield ""


def _failed(results: Results) -> Iterator[str]:
    for key, entry in results["cases"].items():
        for part in _PARTS:
            if "error" in entry.get(part, {}):
                yield f"- `{key}` was not measured: {entry[part]['error']}"
    yield ""


def _systems(results: Results) -> Iterator[str]:
    """Say on what it was measured; more than one line where that changed between runs."""
    seen: dict[str, int] = {}
    for entry in results["cases"].values():
        for part in _PARTS:
            if system := entry.get(part, {}).get("system"):
                text = system_line(system)
                seen[text] = seen.get(text, 0) + 1
    for text, n in seen.items():
        yield f"Measured ({n} runs) on: {text}."


def _cases(results: Results, part: str, interpolation: str) -> list[Any]:
    """Return the entries that were measured, by volume and in the order of measurement."""
    entries = [
        entry
        for entry in results["cases"].values()
        if entry["case"]["interpolation"] == interpolation and "angles" in entry.get(part, {})
    ]
    order = list(_STYLES)
    return sorted(
        entries,
        key=lambda e: (e["case"]["volume"], order.index(e["case"]["transfer_function"])),
    )


def _names(entry: Any) -> tuple[str, str]:
    return entry["case"]["volume"], entry["case"]["transfer_function"]


def _at(part: Any, angle: float) -> Any:
    return next(found for found in part["angles"] if found["angle"] == angle)


def _held(part: Any) -> dict[str, Any]:
    return {check["name"]: check for check in part["checks"]}


def _marked(text: str, check: Any) -> str:
    return f"**{text}**" if check and not check["passed"] else text


def _bounded(value: float, check: Any) -> str:
    bound = f" ({check['bound']:g})" if check else ""
    return _marked(f"{value:.4f}{bound}", check)


def _number(value: float | None) -> float:
    """JSON has no infinity: a PSNR of equal pictures is null there."""
    return float("inf") if value is None else value


def _decibels(value: float | None) -> str:
    return f"{_number(value):.1f}"
