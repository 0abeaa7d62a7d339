"""What frames take beside a view: memory for the picture, a cutoff."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import render_vdi
from oracle import TOLERANCE
from ray_scenes import reciprocal_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.model.host_memory import aligned_empty

SIZE = (31, 17)


def seen_from_beside(seed):
    """A VDI, and a view in which rays cross many lists: they end between two."""
    vdi = reciprocal_vdi(np.random.default_rng([seed, 900]))
    return vdi, vdi.camera.azimuth(50)


@pytest.mark.parametrize("aligned", [True, False])
def test_the_picture_in_the_callers_memory_is_the_same(runtime, aligned):
    vdi, view = seen_from_beside(1)
    expected = render_vdi(vdi, view, SIZE, device=runtime)
    out = aligned_empty((17, 31, 4), np.float32)
    if not aligned:
        out = np.empty(17 * 31 * 4 + 1, np.float32)[1:].reshape(17, 31, 4)
    for _ in range(2):
        out[...] = np.nan
        assert render_vdi(vdi, view, SIZE, device=runtime, out=out) is out
        np.testing.assert_array_equal(out, expected)
    assert expected.max() > 0.1


def test_no_channel_loses_more_than_the_cutoff(runtime):
    changed = 0
    for seed in range(6):
        vdi, camera = seen_from_beside(seed)
        whole = render_vdi(vdi, camera, transmittance_cutoff=0, device=runtime)
        for cutoff in (1e-6, 0.004, 0.1, 0.9):
            image = render_vdi(vdi, camera, transmittance_cutoff=cutoff, device=runtime)
            lost = whole - image
            assert lost.max() <= cutoff + TOLERANCE  # that of sums, see tests/support/oracle.py
            assert lost.min() >= -TOLERANCE
        default = render_vdi(vdi, camera, device=runtime)
        same = render_vdi(vdi, camera, transmittance_cutoff=1e-6, device=runtime)
        np.testing.assert_array_equal(default, same)
        rough = pvdi.render(
            vdi, camera, settings=pvdi.Settings(transmittance_cutoff=0.9), device=runtime
        )
        changed += int((rough != default).any())
    assert changed >= 3
