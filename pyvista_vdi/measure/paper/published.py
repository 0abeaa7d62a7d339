"""The paper's own figures, read from ``paper_tables.json``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any


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
