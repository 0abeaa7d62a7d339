"""What is no number is refused by the one who asked for it, and never by Python or NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pyvista_vdi import AmbientOcclusion, Cropping, Light
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_number, as_whole
from pyvista_vdi.model.options import GenerationOptions, MediumOptions
from pyvista_vdi.model.render_options import RenderOptions

pytestmark = pytest.mark.fast

#: An integer that is beyond float64, and an array where a number is wanted.
HUGE, TWO = 10**400, np.array([1, 2])
PLANES = (0, 1, 0, 1, 0, 1)


def test_numbers_are_told_from_texts_and_truth_values():
    assert as_number(np.float32(0.5)) == 0.5
    assert as_whole(np.int64(3)) == as_whole(3.0) == 3
    for none in ("3", True, np.True_, None, HUGE, TWO, math.nan):
        assert math.isnan(as_number(none))
    assert math.isnan(as_whole(2.5))
    assert math.isnan(as_whole(math.inf))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: AmbientOcclusion.from_any(HUGE), "radius of ambient occlusion must be"),
        (lambda: AmbientOcclusion(strength=TWO), "strength of ambient occlusion must be"),
        (lambda: Cropping((HUGE,) * 6), "cropping takes six planes"),
        (lambda: Cropping(PLANES, math.inf), "27 flags, .* got inf"),
        (lambda: Cropping(PLANES, TWO), "27 flags, .* got array"),
        (lambda: RenderOptions(clipping_planes=[[HUGE] * 6]), "clipping_planes must be"),
        (lambda: RenderOptions(preview_samples=TWO), "preview_samples must be a whole number"),
        (lambda: RenderOptions(preview_samples="8"), "preview_samples must be .* got '8'"),
        (lambda: RenderOptions(opacity_multiplier=HUGE), "opacity_multiplier is a finite factor"),
        (lambda: GenerationOptions(max_supersegments=TWO), "max_supersegments must be a whole"),
        (lambda: GenerationOptions(max_supersegments="8"), "max_supersegments must be .* got '8'"),
        (lambda: MediumOptions(memory_limit=HUGE), "memory_limit must be a number of bytes"),
        (lambda: Light(position=(HUGE, 0, 0)), "a light's position must be three finite numbers"),
    ],
)
def test_what_is_no_number_is_refused_by_name(make, message):
    with pytest.raises(InvalidArgumentError, match=message):
        make()
