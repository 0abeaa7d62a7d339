"""What oiiotool (OpenImageIO) makes of our deep images, as tests have it.

Its files are recorded in ``tests/io/files``, so that they are read where it is not installed:

    python tests/support/deep_programs.py

records them anew.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from pyvista_vdi import VDI, Camera

RECORDED = Path(__file__).parents[1] / "io" / "files"
VIEW = Camera((0.5, -0.25, 4), (0.5, 0, -1), (0, 1, 0), view_angle=40)
SIZE = (8, 6)
#: What the lists reach to, as it is recorded: older NumPys round the last bit otherwise.
BOUNDS = {
    "a": (
        *(-1.865634867994233, 1.093995360536336, -1.1990590217254562, 1.184353253989413),
        *(-0.9861699904519705, 1.0235203963708956),
    ),
    "b": (
        *(-0.1806600402246696, 3.2164687445989415, -1.3294540887720905, 1.3757813758050832),
        *(-1.6712405773256478, 0.32057901335390204),
    ),
}

_COLORS = "A,B,G,R,Z,ZBack"
_OURS = "bits.back,bits.blue,bits.front,bits.green,bits.red,tau"

#: Arguments of oiiotool by what they do; a and b are those of ``pair``, s and t the same with the
#: standard channels alone.
COMMANDS = {
    "rewritten": "a.exr",
    "run_lengths": "a.exr --compression rle",
    "upwards": "a.exr --attrib openexr:lineOrder decreasingY",
    "tiled": "a.exr --tile 16 16",
    "parts": "a.exr b.exr --siappend",
    "no_matrices": "a.exr --eraseattrib world.*",
    "no_record": "a.exr --eraseattrib pyvista.*",
    "canvas": "a.exr --fullsize 20x10+0+0",
    "merged": "a.exr b.exr --deepmerge",
    "merged_standard": "s.exr t.exr --deepmerge",
    "merged_flat": "a.exr b.exr --deepmerge --flatten --ch R,G,B,A -d float",
    "half": "a.exr -d half",
    "cropped": "a.exr --crop 3x4+1+2",
    "cut": "a.exr --cut 4x3+1+2",
    "resized": "a.exr --resample 16x12",
    "moved": "a.exr --origin +2+1",
    "faded": f"a.exr --ch {_COLORS},{_OURS} --mulc .5,.5,.5,.5,1,1,1,1,1,1,1,1",
    "faded_standard": f"s.exr --ch {_COLORS} --mulc .5,.5,.5,.5,1,1",
    "darkened": f"a.exr --ch {_COLORS},{_OURS} --mulc 1,.5,.5,.5,1,1,1,1,1,1,1,1",
    "deeper": f"s.exr --ch {_COLORS} --addc 0,0,0,0,2,2",
    "swapped": f"a.exr --ch A,B=R,G,R=B,Z,ZBack,{_OURS}",
    "plain": "a.exr --ch R,G,B,A,Z,ZBack",
    "no_back": "s.exr --ch R,G,B,A,Z",
    "renamed": f"s.exr --ch {_COLORS} --chnames left.A,left.B,left.G,left.R,left.Z,left.ZBack",
    "flat": "s.exr --flatten",
    "linear_merged": "la.exr lb.exr --deepmerge",
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
    for vdi, letter, standard in zip(pair(), "ab", "st", strict=True):
        vdi.save(folder / f"{letter}.exr")
        vdi.save(folder / f"{standard}.exr", exact=False)
        vdi.save(folder / f"l{letter}.exr", linear=True)
    return operate(COMMANDS[name], folder, program, f"oiiotool_{name}.exr")


def operate(command: str, folder: Path, program: str, output: str) -> Path:
    """Run oiiotool in a folder, so that it notes no other paths in its files."""
    arguments = [program, *command.split(), "-o", output]
    subprocess.run(arguments, cwd=folder, check=True, capture_output=True)
    return folder / output


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        for each in sys.argv[1:] or COMMANDS:
            made = make(each, Path(name), shutil.which("oiiotool") or "oiiotool")
            shutil.copyfile(made, RECORDED / made.name)
