"""What a person is told of a VDI on the screen, what may be set, and how far views are apart."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import LOOKS, soft_ball
from watched_windows import MOVING, STILL, frame, turned, watched

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError

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


def test_corner_text_is_of_the_frame_that_shows_it(plotter, coarsest):
    plotter.window_size = (241, 203)
    actor = watched(plotter)
    annotation = actor.show_status()
    turned(plotter, 20, MOVING)
    texts, pictures = [], []
    for rate in (MOVING, STILL):
        pictures.append(frame(plotter, rate)[:60, :120])
        texts.append(annotation.GetText(2))
    assert texts[0].startswith("preview: 6%")
    assert texts[1].startswith("full: 100%")
    assert "20° from" in texts[1]
    assert np.abs(pictures[0] - pictures[1]).max() > 100
    other = actor.show_status(corner="lower right")
    plotter.render()
    assert other.GetText(1).startswith("full")
    with pytest.raises(InvalidArgumentError, match="corner must be one of .*got 'middle'"):
        actor.show_status(corner="middle")
    lone = pvdi.VDIActor()
    lone.SetMapper(pvdi.VDIMapper())
    with pytest.raises(InvalidArgumentError, match="nothing shows this actor yet"):
        lone.show_status()
