"""A solver and its pictures: smoke in a vortex, computed by MPI, and seen while it is computed.

What one should see: smoke that a vortex has wound into a spiral, orange where it is thick.

    mpirun --oversubscribe -n 4 python examples/insitu.py insitu.png

Each rank has a slab of the grid, and hands it to `InSitu` after every twentieth step. Rank 0
writes a series, insitu.vdis, which others may read meanwhile, and at the end a picture of its last
step.
What is printed says what the pictures cost beside the solver. It runs on one rank as well.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.insitu import InSitu
from pyvista_vdi.io.png import to_bytes, write_png

COMM = MPI.COMM_WORLD
POINTS, STEPS, EVERY, SIZE = 64, 120, 20, (480, 360)
SPACING, DIFFUSION = 2 / (POINTS - 1), 1e-3
STEP = 0.9 * SPACING  # of time: the fastest smoke moves by seven tenths of a cell


class Smoke:
    """A bar of smoke in a steady vortex, in slabs along z: Lax-Wendroff, axis by axis, in NumPy."""

    def __init__(self) -> None:
        cuts = np.linspace(0, POINTS, COMM.size + 1).astype(int)
        self.low, high = int(cuts[COMM.rank]), int(cuts[COMM.rank + 1])
        axis = np.linspace(-1, 1, POINTS)
        z, y, x = np.meshgrid(axis[self.low : high], axis, axis, indexing="ij")
        r = np.hypot(x, y)
        turning = 2 * np.exp(-2 * r**2)  # radians per unit of time
        self.velocity = {2: -y * turning, 1: x * turning, 0: 0.2 * np.cos(3 * r)}
        bar = np.exp(-(y**2) / 0.012 - (z + 0.1) ** 2 / 0.08) * (np.abs(x) < 0.85)
        self.values = bar.astype(np.float32)

    def advance(self) -> None:
        """Take a step; slabs exchange the planes on their faces."""
        for axis, velocity in self.velocity.items():
            u = self.values
            before, after = np.take(u, [0], axis), np.take(u, [-1], axis)
            if axis == 0:
                before, after = self.faces()
            whole = np.concatenate([before, u, after], axis)
            ahead = np.take(whole, range(2, whole.shape[axis]), axis)
            behind = np.take(whole, range(whole.shape[axis] - 2), axis)
            share = velocity * (STEP / SPACING)  # of a cell that the smoke moves by
            spread = share**2 / 2 + DIFFUSION * STEP / SPACING**2
            u = u - share / 2 * (ahead - behind) + spread * (ahead - 2 * u + behind)
            self.values = u.astype(np.float32)

    def faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the planes of the slabs below and above."""
        down, up = COMM.rank - 1, COMM.rank + 1
        down = down if down >= 0 else MPI.PROC_NULL
        up = up if up < COMM.size else MPI.PROC_NULL
        below, above = self.values[:1].copy(), self.values[-1:].copy()
        COMM.Sendrecv(self.values[-1:].copy(), up, recvbuf=below, source=down)
        COMM.Sendrecv(self.values[:1].copy(), down, recvbuf=above, source=up)
        return below, above


def main() -> None:
    """Compute, and show."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "insitu.png")
    camera = pvdi.Camera((2.2, -4.4, 3.0), (0, 0, -0.1), (0, 0, 1))
    smoke, solving = Smoke(), 0.0
    show = InSitu(
        target.with_suffix(".vdis"),
        camera,
        SIZE,
        (POINTS,) * 3,
        (SPACING,) * 3,
        (-1, -1, -1),
        comm=COMM,
        every=EVERY,
        overwrite=True,
        cmap="inferno",
        opacity="linear",
        clim=(0, 0.8),
        opacity_unit_distance=0.08,
        interpolation="linear",
    )
    with show:
        for step in range(STEPS + 1):
            show(smoke.values, (0, 0, smoke.low), step * STEP)
            start = time.perf_counter()
            smoke.advance()
            solving += time.perf_counter() - start
    in_situ = COMM.allreduce(sum(show.seconds[1:]), MPI.MAX) / (len(show.seconds) - 1)
    solving = COMM.allreduce(solving, MPI.MAX) / (STEPS + 1)
    if COMM.rank == 0:
        series = pvdi.read(target.with_suffix(".vdis"))
        picture = pvdi.render(series[-1], camera.azimuth(10))
        write_png(to_bytes(picture, (1, 1, 1)), target)
        print(f"{COMM.size} ranks, {POINTS}^3 points, a VDI of {SIZE[0]} x {SIZE[1]} lists")
        print(f"solver: {1e3 * solving:.0f} ms a step; in situ: {1e3 * in_situ:.0f} ms a VDI,")
        print(f"every {EVERY} steps: {in_situ / EVERY / solving:.2f} of the solver's time")
        print(f"written: {target}, {target.with_suffix('.vdis')}")


if __name__ == "__main__":
    main()
