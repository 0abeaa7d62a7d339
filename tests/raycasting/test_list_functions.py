"""The first supersegment that a ray meets in a list, against a linear scan.

The paper's Algorithm 1 as printed is not what is tested here, but what it is for; the
documentation gives the errata.
"""

from __future__ import annotations

import itertools

import numpy as np

from pyvista_vdi.device.programs import parameters_of

FILE = "list_functions.cl"


def linear_scan(faces, depth, away):
    """How many supersegments, from the first one on, the ray has nothing (more) to do with.

    Going away: those that end before or at ``depth``. Coming back: those that begin before it,
    which are the ones still ahead.
    """
    behind = [back <= depth if away else front < depth for front, back in faces]
    return len(list(itertools.takewhile(bool, behind)))


def check(call, lists, queries):
    """Compare answers with the scan. ``queries``: (list, depth, away, guess)."""
    stride = call(FILE, "lists_per_bundle", 1, call.empty(1, dtype=np.int32))[0]
    faces = np.float32([face for faces in lists for face in faces]).reshape(-1, 2)
    flat = np.full((stride * len(faces) + 1, 2), np.nan, np.float32)  # nothing else is read
    flat[: stride * len(faces) : stride] = faces
    begin = np.cumsum([0, *(len(faces) for faces in lists)])
    which, depths, away, guesses = (np.array(values) for values in zip(*queries, strict=True))
    counts = np.array([len(faces) for faces in lists])
    places = np.column_stack([begin[which], counts[which]]).astype(np.int32)
    how = np.column_stack([away, guesses]).astype(np.int32)
    results = call.empty(len(queries), dtype=np.int32)
    found = call(
        FILE, "counts_passing", len(queries), flat, places, np.float32(depths), how, results
    )
    # Made once for all guesses
    expected = {key: linear_scan(lists[key[0]], *key[1:]) for key in {q[:3] for q in queries}}
    wanted = np.array([expected[q[:3]] for q in queries])
    wrong = np.flatnonzero(found != wanted)
    assert not len(wrong), [
        (lists[queries[i][0]], queries[i][1:], int(found[i]), int(wanted[i])) for i in wrong[:3]
    ]


def test_small_lists_exhaustively(call):
    """Every list on six depths, touching supersegments included; every depth on and between."""
    lists = []
    for n in range(4):
        for depths in itertools.combinations_with_replacement(range(6), 2 * n):
            faces = [(float(a), float(b)) for a, b in zip(depths[::2], depths[1::2], strict=True)]
            if all(front < back for front, back in faces):
                lists.append(faces)
    assert len(lists) > 70
    assert [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)] in lists
    assert [] in lists
    queries = [
        (which, depth, away, guess)
        for which, faces in enumerate(lists)
        for depth in np.arange(-0.5, 6, 0.5).tolist()
        for away in (False, True)
        for guess in range(len(faces) + 4)
    ]
    check(call, lists, queries)


def test_a_frame_lies_on_the_device_as_on_the_host(call):
    frame = parameters_of("raycasting/raycast.cl", "raycast", {})["frame"].dtype
    expected = [*(frame.fields[name][1] for name in frame.names), frame.itemsize]
    found = call(FILE, "frame_layout", len(expected), call.empty(len(expected), dtype=np.int32))
    assert found.tolist() == expected
