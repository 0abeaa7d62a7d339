"""That the suite would notice an output that is not finite, whatever test drew it."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_vdi, render_vdi
from extreme_scenes import WINDOW, field_volume, transfer, view

pytestmark = pytest.mark.extremes


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_fails(runtime, value):
    with runtime.buffer((3, 4, 4), name="image") as image:
        values = np.zeros((3, 4, 4), np.float32)
        values[1, 2, 3] = value
        runtime.write(image, values)
        with pytest.raises(AssertionError, match=r"1 of 48 values of 'image' .* at \(1, 2, 3\)"):
            runtime.download(image)


def test_images_and_vdis_pass_through_it(runtime, monkeypatch):
    """The names that are looked for are those that the engine gives."""
    seen = set()

    def noting(download):
        def noted(self, buffer, *args, **kwargs):
            seen.add(buffer.name)
            return download(self, buffer, *args, **kwargs)

        return noted

    for name in ("download", "download_later"):  # which of them, the device decides
        monkeypatch.setattr(type(runtime), name, noting(getattr(type(runtime), name)))
    volume = field_volume()
    vdi = generate_vdi(volume, view(volume), WINDOW, transfer(), device=runtime)
    render_vdi(vdi, view(volume), device=runtime)
    assert len(vdi.front)  # on a GPU lists are there until they are asked for
    assert seen >= {
        "image",
        "front depths",
        "back depths",
        "supersegment colours",
        "optical depths",
    }
