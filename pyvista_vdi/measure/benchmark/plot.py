"""The results as a picture: speed-up and SSIM by angle, with the paper's beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.benchmark.candidates import median
from pyvista_vdi.measure.benchmark.paper import paper_cell


def write_plot(data: dict[str, Any], target: Path) -> bool:
    """Write a PNG: a column per window and N_S, speed-up above, SSIM below.

    Parameters
    ----------
    data : dict
        What the JSON holds.
    target : pathlib.Path
        The file.

    Returns
    -------
    bool
        Whether there was anything to draw.

    Raises
    ------
    ImportError
        If Matplotlib is not installed.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    cells = [cell for cell in data["cells"] if cell["angles"]]
    kinds = list(
        dict.fromkeys((tuple(cell["window_size"]), cell["max_supersegments"]) for cell in cells)
    )
    if not kinds:
        return False
    figure = Figure(figsize=(1.5 + 3.6 * len(kinds), 6.0), layout="constrained")
    FigureCanvasAgg(figure)
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
    with whole_file(target) as stream:
        figure.savefig(stream, dpi=110, format="png")
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
