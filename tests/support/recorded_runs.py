"""Records of runs as the kernels hold them, for the tests of what shortens them."""

from __future__ import annotations

import numpy as np
from reference import compositing
from reference.compositing import Segment

EPS = 2.0**-24  # unit roundoff of float32
FRONT, BACK, TAU, TRANSMITTANCE = range(4)
COLOR, OPACITY = slice(4, 7), 7


def as_runs(segments):
    """Segments of one ray as the kernels hold them: float32 (n, 8)."""
    before = np.concatenate([[0.0], np.cumsum([s.optical_depth for s in segments])])
    runs = np.empty((len(segments), 8))
    for run, s, tau in zip(runs, segments, before[:-1], strict=True):
        alpha = compositing.opacity(s.optical_depth)
        run[:4] = s.front, s.back, s.optical_depth, np.exp(-tau)
        run[COLOR], run[OPACITY] = s.color * alpha, alpha
    return runs.astype(np.float32)


def random_segments(rng, n, *, gaps=0.3, thickest=3.0):
    """n neighbours of unlike media; some touch, some are apart."""
    apart = np.where(rng.random(n) < gaps, rng.uniform(0.1, 2, n), 0)
    ends = np.cumsum(np.stack([apart, rng.uniform(0.2, 2, n)], axis=1).ravel()).reshape(n, 2)
    ends = ends.astype(np.float32)
    ends[1:, 0] = np.where(apart[1:] == 0, ends[:-1, 1], ends[1:, 0])
    return [
        Segment(float(front), float(back), rng.random(3), thickest * 10 ** -rng.uniform(0, 3))
        for front, back in ends
    ]


def random_records(seed, n, most, least=1):
    rng = np.random.default_rng(seed)
    return [random_segments(rng, int(k)) for k in rng.integers(least, most + 1, n)]


def disjoint(record):
    return (record[:, FRONT] < record[:, BACK]).all() and (
        record[:-1, BACK] <= record[1:, FRONT]
    ).all()


def extreme_records():
    """Finite inputs that overflow, underflow or tie."""
    rng = np.random.default_rng(48)
    n = 40
    faces = np.arange(n, dtype=np.float32)

    def record(front, back, tau, transmittance=1.0, color=0.5):
        runs = np.empty((n, 8), np.float32)
        tau = np.broadcast_to(np.float64(tau), n)
        runs[:, FRONT], runs[:, BACK], runs[:, TAU] = front, back, tau
        alpha = np.maximum(-np.expm1(-tau), np.finfo(np.float32).tiny)
        runs[:, TRANSMITTANCE] = transmittance
        runs[:, COLOR], runs[:, OPACITY] = color * alpha[:, None], alpha
        return runs

    tiny, huge = 1e-44, 3e38 / n
    return {
        "all equal": record(faces, faces + 1, 0.1),
        "all equal, apart": record(faces, faces + 0.5, 0.1),
        "opaque": record(faces, faces + 1, 30.0),
        "opaque, unlike": record(faces, faces + 1, 30.0, 0.0, rng.random((n, 3))),
        "denormal optical depth": record(faces, faces + 1, tiny),
        "huge optical depth": record(faces, faces + 1, huge),
        "mixed optical depth": record(faces, faces + 1, np.where(np.arange(n) % 2, tiny, huge)),
        "denormal lengths": record(faces * 1e-44, (faces + 1) * 1e-44, 1.0),
        "huge lengths": record(faces * 5e36, faces * 5e36 + 4e36, rng.random(n)),
        "huge gaps": record(faces * 5e36, faces * 5e36 + 1e30, rng.random(n)),
        "far away": record(1e6 + faces, 1e6 + faces + 1, rng.random(n)),
        "denormal transmittance": record(faces, faces + 1, rng.random(n), tiny),
        "black": record(faces, faces + 1, rng.random(n), 1.0, 0.0),
    }


EXTREMES = extreme_records()
