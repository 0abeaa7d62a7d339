"""VDIs of a scene that changes from step to step, as series have them."""

from __future__ import annotations

import functools

import numpy as np

import pyvista_vdi as pvdi

SIZE = (24, 14)


def stepped_vdi(
    seed=0, *, size=SIZE, metadata=None, step=0.0, still=0.5, palette=True, partly=False
):
    """A VDI of lists whose faces lie at samples, some of them the same for every ``step``.

    ``partly``: of the lists that move, many supersegments stay where they were, and some of these
    change their colours; all lists move along their rays.
    """
    fixed, random = np.random.default_rng(seed), np.random.default_rng([seed, int(step * 97)])
    camera = pvdi.Camera((0, 0, 50), (0, 0, 0), (0, 1, 0))
    n_lists = size[0] * size[1]
    table = np.linspace(0, 1, 256)[:, np.newaxis] * (1.0, 0.5, 0.25)
    fronts, backs, entries, counts = [], [], [], []
    moves = fixed.random(n_lists) > still
    for i in range(n_lists):
        generator = random if moves[i] else np.random.default_rng([seed, i])
        n = int(generator.integers(0, 9))
        faces = np.sort(generator.choice(80, n + 1, replace=False)) * 0.25 + 40.0 + i * 0.01
        media = generator.integers(0, 256, n)
        if partly:
            generator = np.random.default_rng([seed, i])
            n = int(generator.integers(0, 15))
            faces = np.sort(generator.choice(80, n + 1, replace=False)) * 0.25
            faces += 40.0 + i * 0.01 + 0.25 * random.integers(0, 4)
            media = generator.integers(0, 256, n)
            media = np.where(random.random(n) < 0.2, random.integers(0, 256, n), media)
        there = random.random(n) < 0.8 if partly and moves[i] else np.ones(n, bool)
        fronts.append(faces[:-1][there])
        backs.append(faces[1:][there])
        entries.append(media[there])
        counts.append(np.count_nonzero(there))
    entries = np.concatenate(entries)
    front, back = np.concatenate(fronts), np.concatenate(backs)
    colors = table[entries] if palette else np.random.default_rng(1).random((len(entries), 3))
    known = {"transfer_function": {"colors": table.tolist()}, "sample_distance": 0.25}
    return pvdi.VDI(
        camera,
        size,
        np.concatenate([[0], np.cumsum(counts)]),
        front,
        back,
        colors,
        (back - front) * (0.01 + entries / 256),
        (-10, 10, -10, 10, -10, 10),
        metadata=known if metadata is None else metadata,
    )


def same(one, other):
    """Whether two VDIs are alike to the last bit, and in what they say of themselves."""
    return one.equals(other) and one.precision == other.precision and one.metadata == other.metadata


def packed_steps(n, **options):
    """The first steps of a scene, packed."""
    made = stepped_vdi if "metadata" in options else _kept
    return [made(step=k, **options).with_precision("8-byte") for k in range(n)]


_kept = functools.cache(stepped_vdi)
