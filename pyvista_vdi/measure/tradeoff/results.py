"""The tradeoff's file, and what is asked of a run: both as JSON has them."""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.benchmark.results_file import ResultsFile
from pyvista_vdi.measure.tradeoff.settings import Setting
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.classification import IN_PLACE
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

#: What the file says it is; ``docs/tradeoff_schema.json`` describes it.
FORMAT = "pyvista-vdi tradeoff"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Plan:
    """What a run measures.

    Parameters
    ----------
    name : str
        What the volume is called.
    looks : dict
        The classification arguments, for people; :attr:`table` is what counts.
    table : TransferFunction
        How the volume looks.
    camera : Camera
        The generating view V_O.
    settings : tuple of Setting
        What is compared.
    window_size : (int, int)
        Of all frames, pixels.
    angles : tuple of float
        Degrees of ``Azimuth`` from V_O.
    repeats : int
        Timed frames of each setting at each angle.
    generations : int
        Timed generations of each VDI.
    vtk : bool
        Whether VTK's mappers take part.

    Raises
    ------
    InvalidArgumentError
        If a number is out of its range.
    """

    name: str
    looks: dict[str, Any]
    table: TransferFunction
    camera: Camera
    settings: tuple[Setting, ...]
    window_size: tuple[int, int] = (640, 360)
    angles: tuple[float, ...] = (5.0, 30.0, 60.0)
    repeats: int = 5
    generations: int = 5
    vtk: bool = True

    def __post_init__(self) -> None:
        for name in ("repeats", "generations"):
            value = getattr(self, name)
            if isinstance(value, bool) or not 1 <= value <= 1000:
                raise InvalidArgumentError(f"{name} must be from 1 to 1000; got {value!r}")
        if not self.angles or not all(math.isfinite(angle) for angle in self.angles):
            raise InvalidArgumentError(
                f"angles must be one or more numbers of degrees; got {self.angles!r}"
            )
        if len(set(self.angles)) < len(self.angles):
            raise InvalidArgumentError(f"an angle is given twice: {self.angles!r}")
        if min(check_window_size(self.window_size)) < SSIM_WINDOW:
            raise InvalidArgumentError(
                f"a window of {self.window_size[0]} x {self.window_size[1]} has no SSIM: each edge "
                f"must have {SSIM_WINDOW} pixels or more"
            )
        if not self.settings:
            raise InvalidArgumentError("there are no settings to compare: give one or more")

    def to_dict(self, volume: Volume) -> dict[str, Any]:
        """Return everything in values that JSON can hold, and the volume's own description."""
        own = [name for name in self.looks if name in IN_PLACE]
        described = {
            "volume": {
                "name": self.name,
                "dimensions": volume.dimensions,
                "spacing": volume.spacing,
                "dtype": volume.array.dtype.name,
                "bytes": volume.array.nbytes,
            },
            "looks": {**self.looks, **dict.fromkeys(own, "given")},
            "transfer_function": _digest(self.table.to_dict()),
            "interpolation": self.table.interpolation,
            "camera": self.camera.to_dict(),
            "window_size": self.window_size,
            "angles": self.angles,
            "repeats": self.repeats,
            "generations": self.generations,
            "vtk": self.vtk,
            "settings": [setting.to_dict() for setting in self.settings],
        }
        plain: dict[str, Any] = json.loads(json.dumps(described))
        return plain


class TradeoffFile(ResultsFile):
    """What was measured, as the JSON has it: see ``docs/tradeoff_schema.json``."""

    form, version = FORMAT, FORMAT_VERSION
    parts = frozenset({"baselines", "points", "findings"})

    @classmethod
    def begun(
        cls, path: str | os.PathLike[str] | None, plan: dict[str, Any], system: dict[str, str]
    ) -> TradeoffFile:
        """Return what holds nothing yet."""
        empty: dict[str, Any] = {"baselines": [], "left_out": {}, "points": [], "findings": None}
        return cls(path, cls.new(plan, system, empty))

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> TradeoffFile:
        """Read a file.

        Raises
        ------
        InvalidArgumentError
            If it cannot be read, or is something else.
        """
        return cls(path, cls.checked(path))

    def has(self, setting: Setting) -> bool:
        """Whether a setting was measured, or refused."""
        return any(point["name"] == setting.name for point in self.data["points"])


def _digest(value: dict[str, Any]) -> str:
    """Return what tells two transfer functions apart: the start of their JSON's SHA-256."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
