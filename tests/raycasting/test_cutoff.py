"""``transmittance_cutoff``: what a ray that ends early loses is bounded by the cutoff."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from oracle import TOLERANCE

import pyvista_vdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF


def seen_from_beside(seed):
    """A VDI, and a view in which rays cross many lists: they end between two."""
    vdi = strategies.random_vdi(np.random.default_rng([seed, 900]))
    return vdi, vdi.camera.azimuth(50)


@pytest.mark.parametrize("seed", range(6))
def test_no_channel_loses_more_than_the_cutoff(runtime, seed):
    vdi, camera = seen_from_beside(seed)
    whole = render_vdi(vdi, camera, transmittance_cutoff=0, device=runtime)
    for cutoff in (1e-6, 0.004, 0.1, 0.9):
        image = render_vdi(vdi, camera, transmittance_cutoff=cutoff, device=runtime)
        lost = whole - image
        assert lost.max() <= cutoff + TOLERANCE  # that of sums, see tests/support/oracle.py
        assert lost.min() >= -TOLERANCE


def test_a_cutoff_changes_pictures_and_the_default_is_the_constant(runtime):
    changed = 0
    for seed in range(6):
        vdi, camera = seen_from_beside(seed)
        default = render_vdi(vdi, camera, device=runtime)
        same = render_vdi(vdi, camera, transmittance_cutoff=TRANSMITTANCE_CUTOFF, device=runtime)
        np.testing.assert_array_equal(default, same)
        rough = pyvista_vdi.render(vdi, camera, transmittance_cutoff=0.9, device=runtime)
        changed += int((rough != default).any())
    assert changed >= 3


def test_skipping_changes_nothing_with_a_cutoff(runtime):
    vdi, camera = seen_from_beside(1)
    pictures = [
        render_vdi(vdi, camera, transmittance_cutoff=0.1, skip_empty=skip, device=runtime)
        for skip in (False, True)
    ]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize("cutoff", [-0.1, 1, 2.0, np.nan, "much", None])
def test_cutoffs_that_are_none_are_refused(cutoff):
    vdi, camera = seen_from_beside(0)
    with pytest.raises(InvalidArgumentError, match="transmittance_cutoff must be a number from 0"):
        render_vdi(vdi, camera, transmittance_cutoff=cutoff)


def test_several_vdis_refuse_a_cutoff():
    vdi, camera = seen_from_beside(0)
    with pytest.raises(InvalidArgumentError, match="transmittance_cutoff is for a single VDI"):
        pyvista_vdi.render([vdi, vdi], camera, transmittance_cutoff=0.1)
