"""What a person is told of a VDI on the screen, what may be set, and how far views are apart."""

from __future__ import annotations

import pytest
from plugin_scenes import LOOKS, soft_ball
from watched_windows import frame

pytestmark = pytest.mark.gl


def test_status_from_before_the_first_frame_on(plotter, gate, coarsest):
    actor = plotter.add_vdi(soft_ball(), regenerate="never", **LOOKS)
    assert str(actor.status) == "no VDI drawn yet"
    assert (actor.status.vdi, actor.status.fps, actor.status.share) == (None, None, 0.0)
    actor.mapper.SetInteractiveOffScreen(True)
    plotter.show(auto_close=False)
    assert (actor.status.mode, actor.status.generation, actor.status.vdi) == ("full", 0, None)
    vdi = actor.vdi  # made now, and not when it comes from behind the frames
    frame(plotter)
    status = actor.status
    assert (status.mode, status.generation, status.vdi) == ("full", 1, vdi)
    assert (status.coverage, status.magnification) == (1.0, pytest.approx(1.0))
    assert status.fps > 0
    actor.mapper.SetDraw("vdi")  # else its own frames, which keep the rate, show changes
    actor.prop.interpolation_type = "linear"
    frame(plotter)
    text = str(actor.status)
    assert text.startswith("preview, the volume itself: ")
    assert actor.status.stand_in
    assert not status.stand_in
    assert "0° from the generating view, VDI no. 1, making the next: 0%" in text
    with pytest.raises(AttributeError):
        status.mode = "preview"
