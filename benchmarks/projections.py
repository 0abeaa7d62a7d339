"""What lists could give of maximum and additive projections: docs/decisions/projections.md.

    python benchmarks/projections.py brain aneurism

A prototype in NumPy, on volumes of 96 points along an edge: parallel lists along z, in each of
which neighbours are merged at least error until K are left (each keeps the greatest, or the mean,
of its scalars), seen from angles about y. SSIM is against the picture of the volume itself, taken
at the same steps between the same points, so that the lists alone make the difference.
"""

from __future__ import annotations

import argparse
import heapq

import numpy as np
from scipy.ndimage import map_coordinates, zoom
from skimage.metrics import structural_similarity

from pyvista_vdi import examples

ANGLES, LONGEST, EDGE = (0, 10, 30, 60), (5, 20, 50), 96
#: Scalars that are nearer than this are one to begin with, of 255.
STEP = 8


def value(kind, a, b):
    """Value of two neighbouring segments (start, end, value) as one."""
    if kind == "maximum":
        return max(a[2], b[2])
    return (a[2] * (a[1] - a[0]) + b[2] * (b[1] - b[0])) / (b[1] - a[0])


def cost(kind, a, b):
    """By how much the values of two segments change if they become one, times length."""
    merged = value(kind, a, b)
    power = 1 if kind == "maximum" else 2
    return sum(abs(merged - s[2]) ** power * (s[1] - s[0]) for s in (a, b))


def shortened(column, longest, kind):
    """A column of scalars, piecewise constant in at most so many pieces; and how many are left."""
    starts = np.r_[0, np.flatnonzero(np.diff(column)) + 1]
    ends = np.r_[starts[1:], len(column)]
    segments = [[s, e, column[s]] for s, e in zip(starts, ends, strict=True)]
    after = [*range(1, len(segments)), -1]
    before = [*range(-1, len(segments) - 1)]
    version, left = [0] * len(segments), len(segments)

    def push(i):
        j = after[i]
        heapq.heappush(heap, (cost(kind, segments[i], segments[j]), i, version[i], version[j]))

    heap: list[tuple[float, int, int, int]] = []
    for i in range(len(segments) - 1):
        push(i)
    while left > longest:
        _, i, mine, its = heapq.heappop(heap)
        j = after[i]
        if version[i] != mine or j < 0 or version[j] != its:
            continue
        segments[i][1:] = segments[j][1], value(kind, segments[i], segments[j])
        version[i], version[j], after[i] = version[i] + 1, -1, after[j]
        left -= 1
        if after[j] >= 0:
            before[after[j]] = i
            push(i)
        if before[i] >= 0:
            push(before[i])
    result = np.empty(len(column))
    i = 0
    while i >= 0:
        result[segments[i][0] : segments[i][1]] = segments[i][2]
        i = after[i]
    return result, left


def projected(field, angle, kind, samples_per_voxel=2):
    """The picture of a field [x, y, z], z in half voxels, from an angle about y."""
    centre = (np.array(field.shape) / (1, 1, samples_per_voxel) - 1) / 2
    turn, reach = np.radians(angle), int(0.75 * EDGE)
    u = np.arange(-reach, reach + 1.0)
    picture = np.zeros((len(u), len(u)))
    for along in np.arange(-reach, reach, 0.5):
        x = centre[0] + u * np.cos(turn) + along * np.sin(turn)
        z = centre[2] - u * np.sin(turn) + along * np.cos(turn)
        at = np.broadcast_arrays(x[:, None], centre[1] + u[None], samples_per_voxel * z[:, None])
        sample = map_coordinates(field, at, order=0)
        picture = np.maximum(picture, sample) if kind == "maximum" else picture + 0.5 * sample
    return picture


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("volumes", nargs="+", metavar="VOLUME", choices=sorted(examples.VOLUMES))
    names = parser.parse_args().volumes
    print("| volume | projection | K | mean length | " + " | ".join(f"{a}°" for a in ANGLES) + " |")
    print("|---" * (4 + len(ANGLES)) + "|")
    for name in names:
        volume = examples.load_data(name, as_volume=True).array.astype(float)
        small = zoom(volume, EDGE / max(volume.shape), order=1).transpose(2, 1, 0)
        small = 255 * (small - small.min()) / np.ptp(small)
        field = zoom(small, (1, 1, 2), order=1)
        for kind in ("maximum", "additive"):
            truth = {a: projected(field, a, kind) for a in ANGLES}
            for longest in LONGEST:
                lists = np.empty_like(field)
                lengths = []
                for column in np.ndindex(field.shape[:2]):
                    rounded = STEP * np.round(field[column] / STEP)
                    lists[column], length = shortened(rounded, longest, kind)
                    lengths.append(length)
                found = [
                    structural_similarity(
                        truth[a], projected(lists, a, kind), data_range=np.ptp(truth[a])
                    )
                    for a in ANGLES
                ]
                print(
                    f"| {name} | {kind} | {longest} | {np.mean(lengths):.1f} | "
                    + " | ".join(f"{ssim:.3f}" for ssim in found)
                    + " |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
