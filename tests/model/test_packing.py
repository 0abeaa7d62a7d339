"""Packed supersegments: what packing keeps and loses for any VDI, and what devices draw of it."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import render_first_hits, render_vdi
from extreme_scenes import slabs_vdi
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import assert_explained, total

from pyvista_vdi import VDI, Camera, render
from pyvista_vdi.io.vdi_file.reader import packed_of_stored
from pyvista_vdi.io.vdi_file.writer import stored_rows
from pyvista_vdi.model.packing import DEPTH_CODES, Packed8
from pyvista_vdi.raycasting.prepared import PreparedVDI

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
def test_packing_keeps_the_rules_of_any_vdi(rng):
    vdi = hard_vdi(rng)
    packed = vdi.with_precision("8-byte")  # a VDI is checked when it is made
    assert packed.precision == "8-byte"
    assert packed.with_precision("8-byte") is packed
    assert packed.with_precision("exact").equals(packed)
    assert packed.offsets is vdi.offsets or np.array_equal(packed.offsets, vdi.offsets)
    # What touches still does
    touching = np.zeros(vdi.n_supersegments, bool)
    touching[1:] = vdi.back[:-1] == vdi.front[1:]
    first = vdi.offsets[:-1][vdi.counts.reshape(-1) > 0].astype(int)
    touching[first] = False
    k = np.flatnonzero(touching)
    assert (packed.back[k - 1] == packed.front[k]).all()


@settings(max_examples=60)
@given(strategies.GENERATORS)
def test_the_8_byte_form_is_within_its_bounds(rng):
    vdi = hard_vdi(rng)
    form = vdi.with_precision("8-byte")
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


@pytest.mark.parametrize("count", [4096, DEPTH_CODES])
def test_long_lists_and_one_ulp_each(count):
    """All thinner than a code, behind one another: each keeps a thickness of one code."""
    ulps = 2**23 + np.arange(count + 1)
    faces = np.ldexp(ulps.astype(np.float32), -23)
    touching = np.column_stack([faces[:-1], faces[1:]])
    vdi = slabs_vdi(CAMERA, touching, 1.0, bounds=BOUNDS)
    form = vdi.with_precision("8-byte")  # every ulp has a code of its own
    assert np.array_equal(form.front, vdi.front)
    assert np.array_equal(form.back, vdi.back)
    # All but the last are thinner than a code
    touching[-1, 1] = 1e6
    wide = slabs_vdi(CAMERA, touching, 1.0, bounds=BOUNDS)
    codes = wide.with_precision("8-byte").packing.codes(slice(None))
    assert (codes.back - codes.front).min() == 1


@pytest.mark.every(11)
@pytest.mark.parametrize("kind", strategies.VIEWS)
@pytest.mark.parametrize("dealt", strategies.DEALT)
def test_every_pixel_is_that_of_the_unpacked_vdi(runtime, monkeypatch, dealt, kind):
    """Random VDIs against the oracle of what the packed form holds."""
    strategies.deal_rays(monkeypatch, runtime, dealt)
    parts = []
    for case in range(4):
        seed = [case, strategies.VIEWS.index(kind), 8]
        rng = np.random.default_rng(seed)
        vdi = strategies.random_vdi(rng).with_precision("8-byte")
        camera, size = strategies.random_view(rng, vdi, kind)
        image = render_vdi(vdi, camera, size, device=runtime)
        parts.append(assert_explained(vdi, camera, size, image, name=f"seed {seed}, {kind}"))
    assert total(parts).drawn > total(parts).pixels / 10


@pytest.mark.every(5)
@pytest.mark.parametrize("kind", ["near", "beside", "parallel", "inside"])
def test_every_mode_draws_as_with_the_unpacked_vdi(runtime, kind):
    """Skipping, previews and first hits; extinctions are rounded otherwise, by 4 roundings."""
    rng = np.random.default_rng([strategies.VIEWS.index(kind), 9])
    packed = strategies.random_vdi(rng, max_window=(40, 40)).with_precision("8-byte")
    exact = packed.with_precision("exact")
    camera, size = strategies.random_view(rng, packed, kind)
    for options in ({"skip_empty": False}, {"skip_empty": True}, {"preview_samples": 50}):
        images = [render_vdi(v, camera, size, device=runtime, **options) for v in (packed, exact)]
        assert np.abs(images[0] - images[1]).max() <= 2e-5
    hits = [render_first_hits(v, camera, size, device=runtime) for v in (packed, exact)]
    same = np.isclose(hits[0], hits[1], rtol=1e-5) | (np.isinf(hits[0]) & np.isinf(hits[1]))
    assert same.all()


def test_packed_and_exact_vdis_are_merged(runtime):
    rng = np.random.default_rng(4)
    bounds = strategies.random_bounds(rng)
    pair = [strategies.random_vdi(rng, bounds=bounds) for _ in range(2)]
    pair[0] = pair[0].with_precision("8-byte")
    view = strategies.camera_around(rng, bounds, np.eye(4), parallel=False)
    images = [
        render([first, pair[1]], view, (16, 12), device=runtime)
        for first in (pair[0], pair[0].with_precision("exact"))
    ]
    assert images[0][..., 3].max() > 0.1
    assert np.abs(images[0] - images[1]).max() <= 2e-5


def test_nothing_and_faces_on_the_eye_s_plane(runtime):
    camera = Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), view_angle=60)
    for faces in ([], [(0, 1), (1, 2)]):
        vdi = slabs_vdi(camera, faces, 1.0, bounds=(-2, 2, -2, 2, 0, 2)).with_precision("8-byte")
        image = render_vdi(vdi, camera, (5, 5), device=runtime)
        assert np.abs(image - reference.render(vdi, camera, (5, 5))).max() <= 2e-5
        assert image.any() == bool(faces)


def test_what_the_forms_take_on_a_device(runtime):
    rng = np.random.default_rng(3)
    vdi = strategies.random_vdi(rng, max_window=(24, 18))
    n, lists, occupied = vdi.n_supersegments, vdi.counts.size, np.count_nonzero(vdi.counts)
    taken = {p: PreparedVDI(runtime, vdi.with_precision(p)).list_bytes for p in ("exact", "8-byte")}
    # Lists of 2 x 2 are as long as the longest of them, and begin with 8 bytes
    height, width = vdi.counts.shape
    padded = np.pad(vdi.counts, ((0, height % 2), (0, width % 2)))
    longest = np.maximum.reduce([padded[y::2, x::2] for y in (0, 1) for x in (0, 1)])
    entries = 4 * longest.sum()
    assert taken["exact"] == 8 * longest.size + 24 * entries
    assert taken["8-byte"] == 4 * (lists + 1) + 8 * n + 16 * occupied
