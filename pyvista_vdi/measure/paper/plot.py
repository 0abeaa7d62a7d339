"""The results as a picture: speed-up and SSIM by angle, with the paper's beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pyvista_vdi.measure.clock import median
from pyvista_vdi.measure.paper.published import paper_cell
from pyvista_vdi.measure.report import new_figure, save_figure


def write_plot(data: dict[str, Any], target: Path) -> bool:
    """Write a PNG: a column per window and N_S, speed-up above, SSIM below.

    Returns whether there was anything to draw; without Matplotlib ImportError is raised.
    """
    cells = [cell for cell in data["cells"] if cell["angles"]]
    kinds = list(
        dict.fromkeys((tuple(cell["window_size"]), cell["max_supersegments"]) for cell in cells)
    )
    if not kinds:
        return False
    figure = new_figure((1.5 + 3.6 * len(kinds), 6.0), layout="constrained")
    panels = figure.subplots(2, len(kinds), squeeze=False, sharex=True, sharey="row")
    names = list(dict.fromkeys(cell["dataset"] for cell in cells))
    for (speed, ssim), (size, limit) in zip(panels.T, kinds, strict=True):
        for cell in cells:
            if (tuple(cell["window_size"]), cell["max_supersegments"]) == (size, limit):
                _draw(cell, data, names.index(cell["dataset"]), speed, ssim)
        speed.set(title=f"{size[0]}x{size[1]}, N_S {limit}", yscale="log")
        ssim.set(xlabel="degrees from V_O")
        for panel in (speed, ssim):
            panel.grid(alpha=0.3, which="both")
    panels[0][0].set_ylabel("speed-up over render_volume\nwithout skipping (x: the paper's)")
    panels[1][0].set_ylabel("SSIM to render_volume")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize="small")
    save_figure(figure, target)
    return True


def _draw(cell: dict[str, Any], data: dict[str, Any], colour: int, speed: Any, ssim: Any) -> None:
    style = {"color": f"C{colour}", "marker": "."}
    rows = cell["angles"]
    angles = [row["angle"] for row in rows]
    ratios = [
        (median(row["seconds"]["volume"]) or 0) / (median(row["seconds"]["vdi_skipping"]) or 1)
        for row in rows
    ]
    speed.plot(angles, ratios, label=cell["dataset"], **style)
    ssim.plot(angles, [row["vdi_to_volume"]["ssim"] for row in rows], **style)
    of_paper = data["datasets"][cell["dataset"]]["paper"]
    for angle in angles:
        paper = paper_cell(of_paper, cell["window_size"], cell["max_supersegments"], angle)
        if paper is not None:
            mark = {"color": f"C{colour}", "marker": "x"}
            speed.plot([angle], [paper.speed_up_skipping], **mark)
            ssim.plot([angle], [paper.ssim], **mark)
