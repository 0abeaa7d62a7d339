"""The device's raycaster against the float64 oracle: any VDI from any view, in every variant.

Every channel of every pixel lies within 2e-5 of the oracle's range over the ray moved by the
roundings of list coordinates (tests/support/oracle.py says why 2e-5): crossings of cropping planes
are found with as many roundings as the ends of a ray.
"""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import assert_explained, explain, total
from ray_scenes import generating_view, random_cropping, random_ends, rebuilt, with_lists

from pyvista_vdi.model.cropping import PRESETS
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.raycasting.prepared import OccupancyGrid

#: Share of pixels that may differ by more from the unmoved ray. At half size every ray runs along
#: borders: measured, 10 % of them there and at most 0.7 % otherwise.
MAX_SHARE = {"few lists": 0.2, "many lists": 0.015}

#: Views that generate VDIs, by how their lists keep depths; "thin media" are supersegments down to
#: a few ulps of their depth.
GENERATING = {
    "reciprocal": [
        "perspective",
        "inside",
        "zoomed in",
        "eye on the bounds",
        "any matrix",
        "far from origin",
        "tiny world",
        "huge world",
        "flat world",
        "thin media",
    ],
    "shifted": ["long lens", "very long lens"],
    "parallel": ["parallel"],
}

#: New views whose rays stay in one list, or run along borders of lists, and all others.
NEW = {"few lists": ["same", "half"], "many lists": strategies.VIEWS[2:]}

#: What a frame shows: all, what ends of rays leave, some of the regions of cropping.
SHOWN = ("all", "ends", "regions")


def check(runtime, form, dealt, precision, shown, skip, new, seed, n_cases=4):
    """Compare pictures of some VDIs with the oracle's."""
    parts = []
    for case in range(n_cases):
        rng = np.random.default_rng([seed, case])
        kind = GENERATING[form][(seed + case) % len(GENERATING[form])]
        name = NEW[new][(seed + case) % len(NEW[new])]
        bounds, own = generating_view(rng, kind)
        thinnest = 0.0 if kind == "thin media" else 2e-3
        vdi = strategies.random_vdi(
            rng, max_window=(18, 14), camera=own, bounds=bounds, thinnest=thinnest
        ).with_precision(precision)
        if skip:  # some tiles are emptied wholly
            vdi = with_lists(vdi, rng.random(vdi.counts.shape) < 0.3)
        camera, size = strategies.random_view(rng, vdi, name)
        options = {}
        if shown == "ends":
            options = random_ends(rng, vdi, camera, size, planes=case % 3)
        elif shown == "regions":
            regions = [*PRESETS, int(rng.integers(2**27 - 1))][rng.integers(len(PRESETS) + 1)]
            options["cropping"] = random_cropping(rng, vdi.bounds, regions)
            options["opacity_multiplier"] = float(2 ** rng.uniform(-3, 3))
        with pytest.MonkeyPatch.context() as patch:
            strategies.deal_rays(patch, runtime, dealt)
            patch.setattr(OccupancyGrid, "worthwhile", skip)
            image = render_vdi(vdi, camera, size, device=runtime, **options)
        what = f"case {case}, {kind}, {name}"
        parts.append(assert_explained(vdi, camera, size, image, name=what, **options))
    return total(parts)


@pytest.mark.parametrize(
    ("form", "dealt", "precision", "shown", "skip", "new"),
    [  # each two values of each two columns, by few programs, which the first three decide
        ("reciprocal", "one by one", "exact", "ends", True, "few lists"),
        ("reciprocal", "blocks", "8-byte", "all", True, "many lists"),
        ("reciprocal", "packets", "8-byte", "regions", False, "few lists"),
        ("shifted", "one by one", "8-byte", "all", False, "few lists"),
        ("shifted", "blocks", "exact", "regions", False, "many lists"),
        ("shifted", "packets", "exact", "ends", True, "many lists"),
        ("parallel", "one by one", "exact", "regions", True, "many lists"),
        ("parallel", "blocks", "8-byte", "ends", False, "few lists"),
        ("parallel", "blocks", "8-byte", "all", False, "few lists"),
        ("parallel", "packets", "exact", "all", True, "many lists"),
    ],
)
def test_every_pixel_is_within_the_range_of_the_moved_ray(
    runtime, form, dealt, precision, shown, skip, new
):
    result = check(runtime, form, dealt, precision, shown, skip, new, seed=len(form + shown))
    assert result.drawn > result.pixels / 50  # of nothing with nothing proves nothing
    assert result.moved <= MAX_SHARE[new] * result.pixels


@pytest.mark.slow
@settings(max_examples=150)
@given(
    form=st.sampled_from([*GENERATING]),
    dealt=st.sampled_from(strategies.DEALT),
    precision=st.sampled_from(PRECISIONS),
    shown=st.sampled_from(SHOWN),
    skip=st.booleans(),
    new=st.sampled_from([*NEW]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_scene(default_runtime, **scene):
    check(default_runtime, **scene, n_cases=2)


def test_the_comparison_sees_a_wrong_medium(runtime):
    """The oracle of a VDI whose optical depths are 0.1 % higher does not explain the image."""
    rng = np.random.default_rng([0, 400])
    vdi = strategies.random_vdi(rng)
    camera, size = strategies.random_view(rng, vdi, "near")
    image = render_vdi(vdi, camera, size, device=runtime)
    assert_explained(vdi, camera, size, image, name="right")
    wrong = rebuilt(vdi, optical_depth=vdi.optical_depth * np.float32(1.001))
    assert explain(wrong, camera, size, image, name="wrong", escalation=(0,)).failures
