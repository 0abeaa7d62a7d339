"""What is measured: profiles, and the cells that they come to."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.paper.datasets import DEFAULT_SEED, label_of
from pyvista_vdi.measure.session import check_angles, check_count

#: The paper's windows, supersegments and angles; and angles beyond the paper's.
SIZES = ((1280, 720), (1920, 1080))
LIMITS = (15, 30)
ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0, 180.0)

#: Frames of each kind at a view. Two runs of five are the fewest that ``--compare`` can tell apart.
REPEATS = 5


@dataclass(frozen=True)
class Plan:
    """What a run measures.

    Parameters
    ----------
    profile : str
        Name of what the rest began as.
    datasets : tuple of str
        Names that :func:`pyvista_vdi.measure.paper.find_dataset` knows.
    sizes : tuple of (int, int)
        Windows, pixels.
    limits : tuple of int
        Longest lists, the paper's N_S.
    angles : tuple of float
        Degrees of ``Azimuth`` from V_O.
    repeats : int
        Timed frames of each candidate at each view.
    generations : int
        Timed generations of each VDI.
    interpolation : {"nearest", "linear"}
        Of all volume renderers, and of generation.
    preview : tuple of (str, (int, int), int, float), optional
        Data set, window, N_S and angle of Table 2; ``None`` leaves it out.
    vtk : bool
        Whether VTK's mappers take part.
    seed : int
        Of the procedural volumes.

    Raises
    ------
    InvalidArgumentError
        If a number is out of its range.
    """

    profile: str
    datasets: tuple[str, ...]
    sizes: tuple[tuple[int, int], ...] = SIZES
    limits: tuple[int, ...] = LIMITS
    angles: tuple[float, ...] = ANGLES
    repeats: int = REPEATS
    generations: int = 3
    interpolation: str = "nearest"
    preview: tuple[str, tuple[int, int], int, float] | None = None
    vtk: bool = True
    seed: int = DEFAULT_SEED

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats)
        check_count("generations", self.generations)
        labels = [label_of(name) for name in self.datasets]
        twice = sorted({name for name in labels if labels.count(name) > 1})
        if twice:
            raise InvalidArgumentError(
                f"{twice[0]!r} is given twice: name files differently, as in kingsnake=FILE"
            )
        check_angles(self.angles)
        if self.seed < 0:
            raise InvalidArgumentError(f"seed must be 0 or above; got {self.seed!r}")

    def cells(self) -> Iterator[tuple[tuple[int, int], int]]:
        """Yield window and N_S of each VDI of a data set."""
        yield from product(self.sizes, self.limits)

    def to_dict(self) -> dict[str, Any]:
        """Return everything in values that JSON can hold; files without their folders."""
        described = asdict(self)
        described["datasets"] = [label_of(name) for name in self.datasets]
        if self.preview is not None:
            dataset, size, limit, angle = self.preview
            described["preview"] = {
                "dataset": label_of(dataset),
                "window_size": size,
                "max_supersegments": limit,
                "angle": angle,
            }
        plain: dict[str, Any] = json.loads(json.dumps(described))
        return plain


#: Arguments of :class:`Plan` by the name of a profile. ``full`` also takes every volume in the
#: folder that ``PYVISTA_VDI_DATA`` names.
PROFILES: Mapping[str, Mapping[str, Any]] = {
    # Sized for ten minutes on two cores
    "quick": {
        "datasets": (
            *("brain", "rayleigh_taylor"),
            *("kingsnake_like@4", "beechnut_like@4", "richtmyer_meshkov_like@8"),
        ),
        "sizes": SIZES[:1],
        "angles": (0.0, 5.0, 30.0),
        "generations": 1,
        "preview": ("beechnut_like@4", SIZES[0], 15, 30.0),
    },
    "full": {
        "datasets": ("kingsnake_like", "beechnut_like", "richtmyer_meshkov_like"),
        "preview": ("beechnut_like", SIZES[1], 15, 30.0),
    },
}
