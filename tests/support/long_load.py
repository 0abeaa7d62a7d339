"""Thousands of frames of a plotter that is used as people use it, and what they leave behind.

    PYTHONPATH=tests python tests/support/long_load.py --frames 10000 --json long_load.json

Random views; windows that are resized; transfer functions that are edited; regenerations, in the
frame and in the background between previews; volumes that come and go. Memory of the process and of
the device, open files and threads are noted on the way; now and then a picture is held against the
float64 oracle.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import sys
import threading
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyvista as pv
import reference

import pyvista_vdi as pvdi
from pyvista_vdi.device import get_runtime

#: Largest error that a channel may have beyond the oracle's range (docs/dev/conventions.md).
BOUND = 5e-5
#: Share of the frames that is warm-up: every kernel has been compiled, every buffer was once there.
WARM_UP = 0.3
#: Resident bytes by which the last fifth may pass the first after the warm-up: the allocator's own.
#: 1 MiB is four times the arrays of one of these VDIs.
RESIDENT_GROWTH = 16 * 2**20

SIZES = ((96, 72), (64, 48), (120, 90), (33, 57), (150, 40))


@dataclass
class Sample:
    """What was held after a number of frames (or of volumes)."""

    frame: int
    resident: int
    device: int
    files: int
    threads: int


@dataclass
class Outcome:
    """What a run has seen."""

    frames: int
    resizes: int
    edits: int
    generations: int
    volumes: int
    checked: int
    worst_error: float
    seconds: float
    samples: list[Sample]
    between: list[Sample]

    def grown(self, name: str) -> tuple[int, int]:
        """What was held in the fifth of the run after the warm-up, and in its last fifth.

        The largest resident memory; of the others, which come and go with every VDI, the largest
        in the first and the smallest in the last: who leaks passes it.
        """
        values = [(s.frame / self.frames, getattr(s, name)) for s in self.samples]
        early = max(v for at, v in values if WARM_UP <= at <= WARM_UP + 0.2)
        choose = max if name == "resident" else min
        return early, choose(v for at, v in values if at >= 0.8)

    def troubles(self) -> list[str]:
        """What grew, or was wrong."""
        found = []
        for name in ("resident", "device", "files", "threads"):
            early, late = self.grown(name)
            if late > early + (RESIDENT_GROWTH if name == "resident" else 0):
                found.append(f"{name} grew from {early} to {late}")
        left = sorted({s.device for s in self.between})
        if left != [0]:
            found.append(f"{left} bytes stayed on the device when a volume was removed")
        if not self.worst_error <= BOUND:
            found.append(f"the error reached {self.worst_error:.3g}, the bound is {BOUND}")
        return found


def small_volume(rng: np.random.Generator, dtype: str) -> pv.ImageData:
    """A blurred ball of noise, 20 points along each edge, around the origin."""
    axis = np.linspace(-1, 1, 20)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    ball = np.clip(1.2 - np.sqrt(x**2 + y**2 + z**2), 0, 1) * rng.uniform(0.6, 1, x.shape)
    grid = pv.ImageData(dimensions=x.shape, spacing=(2 / 19,) * 3, origin=(-1, -1, -1))
    grid["values"] = (ball * 200).astype(dtype).ravel()
    return grid


class Load:
    """A plotter, and somebody who does not leave it alone.

    Parameters
    ----------
    frames : int
        How many are drawn.
    seed : int
        Of everything that is drawn by chance.
    """

    def __init__(self, frames: int, seed: int = 1) -> None:
        self.frames = frames
        self.rng = np.random.default_rng(seed)
        self.runtime = get_runtime()
        gc.collect()
        self.before = self.runtime.allocated
        self.outcome = Outcome(frames, 0, 0, 0, 0, 0, 0.0, 0.0, [], [])
        self.plotter = pv.Plotter(off_screen=True, window_size=SIZES[0])
        self.actor = None

    def run(self) -> Outcome:
        """Draw the frames."""
        began = time.perf_counter()
        steps = max(20, self.frames // 100)
        for frame in range(self.frames):
            self._disturb(frame)
            self._view()
            self.plotter.render()
            if frame % max(25, self.frames // 40) == 0:
                self._check()
            if frame % steps == steps - 1:
                self.outcome.samples.append(self._sample(frame + 1))
        self._remove()
        self.plotter.close()
        self.outcome.seconds = time.perf_counter() - began
        return self.outcome

    def _disturb(self, frame: int) -> None:
        outcome, rng = self.outcome, self.rng
        if frame % 500 == 0:
            self._show_another_volume()
        # A hundred frames of five hundred are drawn as for somebody who watches: previews, and
        # VDIs that are made in the background
        watched = frame % 500 >= 400
        self.actor.mapper.SetInteractiveOffScreen(watched)
        rate = self.rng.choice([15.0, 0.001]) if watched else 0.001
        self.plotter.render_window.SetDesiredUpdateRate(rate)
        if frame % 20 == 10:
            self.plotter.window_size = SIZES[rng.integers(len(SIZES))]
            outcome.resizes += 1
        if frame % 50 == 25:
            self._edit()
            outcome.edits += 1
        if frame % 100 == 75:
            self.actor.regenerate()

    def _show_another_volume(self) -> None:
        if self.actor is not None:
            self._remove()
        dtype = ("uint8", "float32", "int16", "float64")[self.outcome.volumes % 4]
        self.actor = self.plotter.add_vdi(
            small_volume(self.rng, dtype),
            cmap="viridis",
            opacity=[0, 0.1, 0.4],
            max_supersegments=int(self.rng.integers(2, 13)),
            draw="vdi",  # off-screen a volume would draw most of these views itself
            regenerate="auto",
            settings=pvdi.Settings(regenerate_below=0.9),
            show_scalar_bar=bool(self.rng.random() < 0.5),
        )
        if self.outcome.volumes == 0:
            self.plotter.show(auto_close=False)  # before that, PyVista draws nothing
        self.outcome.volumes += 1

    def _remove(self) -> None:
        """Take the actor away: of all that was on the device for it, nothing stays."""
        self.outcome.generations += self.actor.status.generation
        self.plotter.remove_actor(self.actor)
        self.plotter.volume = self.plotter.mapper = None  # PyVista keeps the last of each
        self.actor = None
        for _ in range(200):  # a VDI that is made in the background is given up soon, not at once
            gc.collect()
            if self.runtime.allocated <= self.before:
                break
            time.sleep(0.05)
        self.outcome.between.append(self._sample(self.outcome.volumes))

    def _edit(self) -> None:
        """Move a node of the opacity, or change how samples are interpolated."""
        opacity = self.actor.prop.GetScalarOpacity()
        opacity.RemoveAllPoints()
        middle, most = self.rng.uniform(60, 140), self.rng.uniform(0.1, 0.9)
        for scalar, value in ((0, 0.0), (middle, most / 3), (200, most)):
            opacity.AddPoint(scalar, value)
        linear = self.rng.random() < 0.5
        self.actor.prop.interpolation_type = "linear" if linear else "nearest"

    def _view(self) -> None:
        camera = self.plotter.camera
        direction = self.rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        inside = self.rng.random() < 0.1
        camera.position = direction * (self.rng.uniform(0.1, 0.8) if inside else 5)
        camera.focal_point = (0, 0, 0)
        camera.up = self.rng.normal(size=3)
        camera.view_angle = self.rng.uniform(15, 70)
        camera.parallel_projection = bool(self.rng.random() < 0.2)
        camera.parallel_scale = self.rng.uniform(0.5, 2)
        self.plotter.renderer.ResetCameraClippingRange()

    def _check(self) -> None:
        """Hold a picture of the VDI on the screen against the oracle, at some pixels."""
        vdi, size = self.actor.vdi, (24, 18)
        if vdi is None:
            return
        camera = pvdi.Camera.from_any(self.plotter.camera)
        image = pvdi.render(vdi, camera, size)
        pixels = [
            (int(self.rng.integers(size[0])), int(self.rng.integers(size[1]))) for _ in "1234"
        ]
        low, high = reference.render_range(vdi, camera, size, pixels)
        for (x, y), least, most in zip(pixels, low, high, strict=True):
            drawn = image[size[1] - 1 - y, x]
            error = float(np.maximum(np.maximum(least - drawn, drawn - most), 0).max())
            self.outcome.worst_error = max(self.outcome.worst_error, error)
            self.outcome.checked += 1
        if not np.isfinite(image).all():
            self.outcome.worst_error = float("nan")

    def _sample(self, number: int) -> Sample:
        gc.collect()
        files = Path("/proc/self/fd")
        return Sample(
            number,
            resident_bytes(),
            self.runtime.allocated - self.before,
            len(list(files.iterdir())) if files.exists() else 0,
            system_threads(),
        )


def resident_bytes() -> int:
    """Memory that the process has in RAM; 0 where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def system_threads() -> int:
    """Threads of the process, the drivers' included where the system counts them."""
    tasks = Path("/proc/self/task")
    return len(list(tasks.iterdir())) if tasks.exists() else threading.active_count()


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write every sample there")
    options = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pvdi.VDIWarning)
        outcome = Load(options.frames, options.seed).run()
    if options.json is not None:
        options.json.write_text(json.dumps(asdict(outcome), indent=1) + "\n")
    print(
        f"{outcome.frames} frames in {outcome.seconds:.0f} s: {outcome.resizes} resizes, "
        f"{outcome.edits} edits, {outcome.generations} VDIs of {outcome.volumes} volumes"
    )
    for name in ("resident", "device", "files", "threads"):
        early, late = outcome.grown(name)
        print(f"{name:<9} {early:>12} after the warm-up, {late:>12} at the end")
    print(
        f"worst error beyond the oracle's range: {outcome.worst_error:.3g} ({outcome.checked} rays)"
    )
    for trouble in outcome.troubles():
        print(f"BROKEN: {trouble}")
    return 1 if outcome.troubles() else 0


if __name__ == "__main__":
    sys.exit(main())
