"""Volumes that change in time, for ``series.py``: made here, but for one that is read.

As a script it writes the steps of one as ``.npy`` files, for ``pyvista-vdi series``:

    python benchmarks/series_data.py plume --out plume/
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import Volume, examples

#: Edge of the volumes that are made, points.
EDGE = 96

Step = Callable[[int], Volume]


class Data(NamedTuple):
    """A volume that changes in time."""

    steps: int
    step: Step
    description: str


def rayleigh_taylor(i: int) -> Volume:
    """Return step i of the mixing layer in the folder of volumes."""
    return Volume(_rayleigh_taylor()[i])


@cache
def _rayleigh_taylor() -> NDArray[np.uint8]:
    folder = Path(os.environ[examples.DATA_VARIABLE])
    with np.load(folder / "rayleigh_taylor_series_25x96x96x96_u8.npz") as archive:
        return np.asarray(archive["density"])


def plume(i: int, edge: int = EDGE) -> Volume:
    """Return step i of a plume that rises in a wind, which grows with height."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, edge, dtype=np.float32),) * 3, indexing="ij")
    time, height = 0.04 * i, (z + 1) / 2
    along = x - (0.9 * height**2 - 0.35) * (1 + 0.15 * np.sin(3 * time))
    radius = 0.06 + 0.3 * height
    density = np.exp(-((along**2 + y**2) / radius**2)) * (1 - 0.6 * height)
    # Where the medium came from: risen, and carried along by a wind that grows with height
    texture = _noise(along - 0.5 * time * height, y, z - time)
    values = density * np.clip(0.75 + 0.8 * texture, 0, None) * (z < -1 + 0.3 + 3 * time)
    return Volume(np.clip(255 * values, 0, 255).astype(np.uint8))


def _noise(x: NDArray[np.float32], y: NDArray[np.float32], z: NDArray[np.float32]) -> NDArray:
    """Return a sum of waves from a third to a fifteenth of the volume long; always the same."""
    random = np.random.default_rng(20)
    found = np.zeros_like(x)
    for k in range(24):
        frequency = 2 * np.pi * 1.5 * 1.07**k
        direction = random.normal(size=3)
        direction *= frequency / np.linalg.norm(direction)
        phase = random.random() * 2 * np.pi
        wave = np.cos(direction[0] * x + direction[1] * y + direction[2] * z + np.float32(phase))
        found += wave.astype(np.float32) / np.float32(5 * 1.03**k)
    return found


def cut(i: int) -> Volume:
    """Return step i of a head that does not change, behind a cut that moves."""
    values = _brain().array.copy()
    values[:, :, : 2 * i] = 0
    return Volume(values, _brain().spacing)


def still(i: int) -> Volume:
    """Return any step of a head that does not change."""
    del i
    return _brain()


@cache
def _brain() -> Volume:
    whole = examples.load_brain(as_volume=True)
    half = np.ascontiguousarray(whole.array[::2, ::2, ::2])
    return Volume(half, [2 * spacing for spacing in whole.spacing])


#: By name.
SERIES = {
    "rayleigh_taylor": Data(25, rayleigh_taylor, "mixing of two fluids: all of the layer changes"),
    "plume": Data(25, plume, "a rising plume, sheared by a wind"),
    "cut": Data(25, cut, "a head behind a cut that moves"),
    "still": Data(100, still, "a head that does not change"),
}


def series_at_hand(names: Iterable[str]) -> list[str]:
    """Return those whose data are here, and say which are not."""
    here = list(names)
    if "rayleigh_taylor" in here and not os.environ.get(examples.DATA_VARIABLE):
        print(f"Left out, {examples.DATA_VARIABLE} is not set: rayleigh_taylor", file=sys.stderr)
        here.remove("rayleigh_taylor")
    return here


def main() -> None:
    """Write the steps of one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=SERIES)
    parser.add_argument("--out", type=Path, default=Path(), metavar="FOLDER")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    data = SERIES[options.name]
    for i in range(data.steps):
        np.save(options.out / f"{options.name}_{i:03}.npy", data.step(i).array)


if __name__ == "__main__":
    main()
