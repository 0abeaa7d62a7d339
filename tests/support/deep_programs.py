"""What oiiotool (OpenImageIO) makes of our deep images, as tests have it.

Some of its files are recorded in ``tests/io/files``, so that they are read where it is not
installed. They were made of images with an older attribute of ours, which is not read: they are as
any program's.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

from pyvista_vdi import VDI, Camera

RECORDED = Path(__file__).parents[1] / "io" / "files"
VIEW = Camera((0.5, -0.25, 4), (0.5, 0, -1), (0, 1, 0), view_angle=40)
SIZE = (8, 6)
BOUNDS = {"a": (-1.9, 1.1, -1.2, 1.2, -1.0, 1.1), "b": (-0.2, 3.3, -1.4, 1.4, -1.7, 0.4)}

#: Arguments of oiiotool by what they do; a and b are those of ``pair``.
COMMANDS = {
    "rewritten": "a.exr",
    "tiled": "a.exr --tile 16 16",
    "upwards": "a.exr --attrib openexr:lineOrder decreasingY",
    "merged": "a.exr b.exr --deepmerge",
    "half": "a.exr -d half",
    "cropped": "a.exr --crop 3x4+1+2",
    "cut": "a.exr --cut 4x3+1+2",
    "resized": "a.exr --resample 16x12",
    "moved": "a.exr --origin +2+1",
    "flat": "a.exr --flatten",
}


def pair() -> tuple[VDI, VDI]:
    """Return two VDIs of one view whose media overlap; no box holds the other's."""
    return _half(0, 5, 0.0, 2.5, "a"), _half(3, 8, 0.7, 3.25, "b")


def _half(first: int, last: int, deeper: float, origin: float, name: str) -> VDI:
    """Return a VDI with three supersegments in each list of some columns."""
    rng = np.random.default_rng(first)
    counts = np.zeros(SIZE[::-1], int)
    counts[1:5, first:last] = 3
    n = int(counts.sum())
    front = np.tile([3.0, 3.5, 4.25], n // 3) + deeper + 0.2 * rng.random(n)
    back = front + np.tile([0.25, 0.5, 0.5], n // 3)
    tau = rng.random(n) * np.tile([0.5, 1.0, 2.0], n // 3) + 1e-3
    tau[5] = 12.0  # what opacities in float32 round
    return VDI(
        VIEW,
        SIZE,
        np.concatenate([[0], np.cumsum(counts.ravel())]),
        front - origin,
        back - origin,
        rng.random((n, 3)),
        tau,
        BOUNDS[name],
        depth_origin=origin,
        metadata={"name": name},
    )


def make(name: str, folder: Path, program: str) -> Path:
    """Have oiiotool make one of the files in a folder."""
    for vdi, letter in zip(pair(), "ab", strict=True):
        vdi.save(folder / f"{letter}.exr")
    output = f"oiiotool_{name}.exr"
    command = [program, *COMMANDS[name].split(), "-o", output]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / output
