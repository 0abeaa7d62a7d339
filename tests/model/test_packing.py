"""Packed supersegments: what packing keeps and loses for any VDI, and what devices draw of it."""

from __future__ import annotations

import numpy as np
import strategies
from hypothesis import given, settings
from hypothesis import strategies as st

from pyvista_vdi import VDI, Camera
from pyvista_vdi.io.vdi_file.reader import packed_of_stored
from pyvista_vdi.io.vdi_file.writer import stored_rows
from pyvista_vdi.model.packing import DEPTH_CODES, Packed8

BOUNDS = (-1, 1, -1, 1, -1, 1)
CAMERA = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0))


def hard_vdi(rng):
    """Lists of 0 to 200 supersegments, one ulp to 30 decades thick, touching and apart."""
    parallel = bool(rng.random() < 0.5)
    counts = rng.integers(0, rng.choice([2, 20, 200]), size=6) * (rng.random(6) < 0.7)
    origin = float(rng.choice([0.0, 0.1, 7.0, 1e6])) if rng.random() < 0.7 else 0.0
    lists = [np.zeros((0, 2), np.float32)]
    lists += [_hard_faces(rng, n, parallel, origin) for n in counts if n]
    front, back = np.concatenate(lists).T
    n = len(front)
    tau = 10.0 ** rng.uniform(-9, 6, size=n)
    tau[rng.random(n) < 0.1] = 0
    return VDI(
        CAMERA.replace(parallel_projection=parallel),
        (3, 2),
        np.concatenate([[0], np.cumsum(counts)]),
        front,
        back,
        np.where(rng.random((n, 3)) < 0.2, rng.integers(0, 2, size=(n, 3)), rng.random((n, 3))),
        tau,
        BOUNDS,
        depth_origin=origin,
    )


def _hard_faces(rng, n, parallel, origin):
    kind = rng.choice(["even", "ulp", "decades", "clustered"])
    if kind == "even":
        faces = np.sort(rng.uniform(0, 100, size=2 * n))
    elif kind == "decades":
        faces = np.sort(10.0 ** rng.uniform(-20, 10, size=2 * n))
    elif kind == "clustered":
        faces = np.sort(rng.choice([1.0, 50.0, 1000.0], size=2 * n) + rng.normal(size=2 * n) * 1e-5)
    else:
        faces = np.full(2 * n, 10.0 ** rng.uniform(-3, 3))
    # The eye's own plane is the nearest that anything may be
    low = np.float32(-1e3 if parallel else -origin)
    low = np.nextafter(low, np.float32(np.inf)) if float(low) < -origin else low
    faces = faces.astype(np.float32)
    if rng.random() < 0.3:
        faces = np.sort(np.maximum(faces - faces[n], low))
    for k in range(1, 2 * n):  # a back is behind its front, by an ulp where they are one
        thick = k % 2 == 1
        least = np.nextafter(faces[k - 1], np.float32(np.inf)) if thick else faces[k - 1]
        touches = not thick and rng.random() < 0.5
        faces[k] = faces[k - 1] if touches else max(faces[k], least)
    return faces.reshape(-1, 2)


def quanta(packed, counts):
    """World units between two codes of each supersegment's list."""
    return np.repeat(packed.strides * packed.step, counts)


@settings(max_examples=60)
@given(strategies.GENERATORS)
def test_packing_keeps_the_rules_of_any_vdi_and_loses_little(rng):
    vdi = hard_vdi(rng)
    form = vdi.with_precision("8-byte")  # a VDI is checked when it is made
    assert form.precision == "8-byte"
    assert form.with_precision("8-byte") is form
    assert form.with_precision("exact").equals(form)
    assert np.array_equal(form.offsets, vdi.offsets)
    # What touches still does
    touching = np.zeros(vdi.n_supersegments, bool)
    touching[1:] = vdi.back[:-1] == vdi.front[1:]
    first = vdi.offsets[:-1][vdi.counts.reshape(-1) > 0].astype(int)
    touching[first] = False
    k = np.flatnonzero(touching)
    assert (form.back[k - 1] == form.front[k]).all()

    # What is lost is within bounds
    packed, counts = form.packing, vdi.counts.reshape(-1)
    assert isinstance(packed, Packed8)
    quantum = quanta(packed, counts)
    # Half a code, and one more for each supersegment of the list that is thinner than a code
    thin = (vdi.back.astype(float) - vdi.front < quantum).astype(int)
    sums = np.concatenate([[0], np.cumsum(thin)])
    starts = vdi.offsets.astype(int)
    in_list = np.repeat(sums[starts[1:]] - sums[starts[:-1]], counts)
    for name in ("front", "back"):
        error = np.abs(getattr(form, name).astype(float) - getattr(vdi, name))
        assert (error <= (0.5 + in_list) * quantum + packed.step).all()
    # A code is the list's extent / 16383, rounded up to whole steps; those follow from all depths
    if vdi.n_supersegments:
        farthest = max(-float(vdi.front.min()), float(vdi.back.max()))
        assert packed.step <= max(farthest * 2 / (2**24 - 2**15), 2.0**-126)
        occupied = np.flatnonzero(counts)
        extent = vdi.back[starts[occupied + 1] - 1].astype(float) - vdi.front[starts[occupied]]
        most = (extent + packed.step) / DEPTH_CODES + packed.step
        assert (packed.strides[occupied] * packed.step <= most).all()
    tau, error = vdi.optical_depth.astype(float), np.abs(form.optical_depth - vdi.optical_depth)
    small = tau <= 16256
    assert (error <= np.maximum(tau * 2.0**-8, 2.0**-19))[small].all()
    assert (form.optical_depth[~small] == 16256).all()
    assert (form.optical_depth[tau == 0] == 0).all()
    assert np.abs(form.color - vdi.color).max(initial=0) <= 1 / 510 + 1e-7


@given(strategies.GENERATORS, st.integers(1, 50))
def test_gaps_and_thicknesses_give_the_codes_back(rng, rows):
    vdi = hard_vdi(rng).with_precision("8-byte")
    packed, n = vdi.packing, vdi.n_supersegments
    stored = {
        name: np.concatenate(
            [stored_rows(packed, name, k, min(k + rows, n)) for k in range(0, max(n, 1), rows)]
        )
        for name in ("front", "back", "color", "optical_depth")
    }
    stored |= {"origin": packed.origins, "stride": packed.strides}
    again = packed_of_stored(packed.step, vdi.offsets, stored, rows)
    assert np.array_equal(again.words, packed.words)
