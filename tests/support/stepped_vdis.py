"""VDIs of a scene that changes from step to step, as series have them."""

from __future__ import annotations

import numpy as np

import pyvista_vdi as pvdi

SIZE = (24, 14)


def stepped_vdi(seed=0, *, size=SIZE, metadata=None, step=0.0):
    """A VDI of lists whose faces lie at samples, half of them the same for every ``step``."""
    fixed, random = np.random.default_rng(seed), np.random.default_rng([seed, int(step * 97)])
    camera = pvdi.Camera((0, 0, 50), (0, 0, 0), (0, 1, 0))
    n_lists = size[0] * size[1]
    table = np.linspace(0, 1, 256)[:, np.newaxis] * (1.0, 0.5, 0.25)
    fronts, backs, entries, counts = [], [], [], []
    moves = fixed.random(n_lists) > 0.5
    for i in range(n_lists):
        generator = random if moves[i] else np.random.default_rng([seed, i])
        n = int(generator.integers(0, 9))
        faces = np.sort(generator.choice(80, n + 1, replace=False)) * 0.25 + 40.0 + i * 0.01
        media = generator.integers(0, 256, n)
        fronts.append(faces[:-1])
        backs.append(faces[1:])
        entries.append(media)
        counts.append(n)
    entries = np.concatenate(entries)
    front, back = np.concatenate(fronts), np.concatenate(backs)
    known = {"transfer_function": {"colors": table.tolist()}, "sample_distance": 0.25}
    return pvdi.VDI(
        camera,
        size,
        np.concatenate([[0], np.cumsum(counts)]),
        front,
        back,
        table[entries],
        (back - front) * (0.01 + entries / 256),
        (-10, 10, -10, 10, -10, 10),
        metadata=known if metadata is None else metadata,
    )


def same(one, other):
    """Whether two VDIs are alike to the last bit, and in what they say of themselves."""
    return one.equals(other) and one.precision == other.precision and one.metadata == other.metadata


def packed_steps(n, **options):
    """The first steps of a scene, packed."""
    return [stepped_vdi(step=k, **options).with_precision("8-byte") for k in range(n)]
