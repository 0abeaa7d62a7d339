"""opencl/raycasting/lists.cl: the first supersegment that a ray meets in a list, against a linear
scan.

The paper's Algorithm 1 as printed is not what is tested here, but what it is for; docs give the
errata. Supersegments (front, back) with depth growing away from V_O:

- List (1, 2), (4, 5); a ray goes away from V_O and is in the list from 3 to 4.5. It meets the
  second supersegment, whose front (4) lies before the exit (4.5). Line 16 as printed, "if f(S_j) >
  i_exit return j", is false for it: the answer is -1. For a ray in the list from 2.2 to 3 it
  returns the second supersegment, which begins behind the exit.
- The same list, entered at 3. ``BinS`` as defined gives j with b(S_j) < 3 < b(S_j+1), j = 0: the
  supersegment that the ray has passed. Entered at 0.5 or at 5.5 no such j exists.
- List (0, 1), (2, 3), (4, 5), (6, 7), guess p = 3, entered at 0.5: b(S_2) and b(S_1) are both
  behind the entry, so that neither line 4 nor line 7 holds and j is never set.
- All comparisons are those of a ray that goes away from V_O; one that comes back meets the last
  supersegment whose front lies before its entry.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

FILE = "list_functions.cl"


def linear_scan(faces, depth, away):
    """How many supersegments, from the first one on, the ray has nothing (more) to do with.

    Going away: those that end before or at ``depth``. Coming back: those that begin before it,
    which are the ones still ahead.
    """
    n = 0
    for front, back in faces:
        if not (back <= depth if away else front < depth):
            break
        n += 1
    return n


def counts(call, lists, queries):
    """``queries``: (list, depth, away, guess)."""
    stride = int(
        call(FILE, "lists_per_bundle", 1, call.empty(1, dtype=np.int32), OFFSET_T="int")[0]
    )
    faces = np.float32([face for faces in lists for face in faces]).reshape(-1, 2)
    flat = np.full((stride * len(faces) + 1, 2), np.nan, np.float32)  # nothing else is read
    flat[: stride * len(faces) : stride] = faces
    begin = np.cumsum([0, *(len(faces) for faces in lists)])
    which = np.array([q[0] for q in queries])
    places = np.column_stack([begin[which], [len(lists[w]) for w in which]]).astype(np.int32)
    how = np.array([(q[2], q[3]) for q in queries], np.int32)
    depths = np.array([q[1] for q in queries], np.float32)
    n = len(queries)
    results = call.empty(n, dtype=np.int32)
    return call(FILE, "counts_passing", n, flat, places, depths, how, results, OFFSET_T="int")


def check(call, lists, queries):
    """Compare each answer with the scan, made once for all guesses of a query."""
    expected = {
        key: linear_scan(lists[key[0]], key[1], key[2])
        for key in {(which, depth, away) for which, depth, away, _ in queries}
    }
    wanted = np.array([expected[q[:3]] for q in queries])
    found = counts(call, lists, queries)
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


@pytest.mark.parametrize("sign", [1, -1])
def test_long_lists(call, sign):
    """Lists of up to 300 random supersegments, at depths on, between and beyond the faces.

    Depth coordinates are negative with -1/Z and positive with Z.
    """
    rng = np.random.default_rng(11)
    lists, queries = [], []
    for which, n in enumerate([0, 1, 2, 3, 5, 17, 64, 65, 128, 255, 256, 299, 300]):
        faces = np.sort(rng.choice(100_000, 2 * n, replace=False).astype(np.float32) / 1000)
        faces = np.sort(sign * faces).reshape(n, 2)
        touching = rng.random(n) < 0.3  # begins where the one before ends
        touching[:1] = False
        faces[touching, 0] = faces[np.flatnonzero(touching) - 1, 1]
        lists.append(faces.tolist())
        on_faces = rng.choice(faces.ravel(), min(12, 2 * n), replace=False) if n else []
        middles = sign * rng.uniform(0, 100, 12).astype(np.float32)
        ends = [-np.inf, np.inf, -1e30, 1e30, 0.0]
        for depth in np.concatenate([on_faces, middles, ends]).astype(np.float32).tolist():
            guesses = rng.integers(0, n + 1, 8).tolist()
            for away in (False, True):
                near = linear_scan(lists[-1], depth, away) + np.arange(-3, 4)
                for guess in {*guesses, *near[near >= 0].tolist(), 0, n, n + 1, n + 1000}:
                    queries.append((which, depth, away, int(guess)))
    assert len(queries) > 4000
    check(call, lists, queries)


def test_every_guess_gives_the_same_answer(call):
    rng = np.random.default_rng(12)
    faces = np.sort(rng.random(80)).reshape(40, 2).astype(np.float32).tolist()
    depths = rng.random(20).astype(np.float32).tolist() + faces[7] + faces[39]
    queries = [
        (0, depth, away, guess)
        for depth in depths
        for away in (False, True)
        for guess in [*range(44), 2**31 - 1]
    ]
    check(call, [faces], queries)


@pytest.mark.parametrize(
    ("faces", "depth", "away", "guess", "expected"),
    [
        ([(1, 2), (4, 5)], 3, True, 0, 1),
        ([(1, 2), (4, 5)], 2.2, True, 1, 1),
        ([(1, 2), (4, 5)], 0.5, True, 2, 0),
        ([(1, 2), (4, 5)], 5.5, True, 0, 2),
        ([(0, 1), (2, 3), (4, 5), (6, 7)], 0.5, True, 3, 0),
        ([(1, 2), (4, 5)], 4.5, False, 0, 2),  # coming back, the second comes first
        ([(1, 2), (4, 5)], 4, False, 0, 1),  # entered on its front face: nothing of it is ahead
        ([(1, 2), (2, 3)], 2, True, 0, 1),  # on the face between two that touch
        ([(1, 2), (2, 3)], 2, False, 0, 1),
    ],
)
def test_cases_of_the_paper_by_hand(call, faces, depth, away, guess, expected):
    assert counts(call, [faces], [(0, depth, away, guess)]).tolist() == [expected]
