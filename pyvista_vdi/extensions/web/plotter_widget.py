"""``PlotterWidget``: a plotter's scene in a notebook's output, with the plotter's camera."""

from __future__ import annotations

import asyncio
import weakref
from contextlib import suppress
from typing import Any

import numpy as np

from pyvista_vdi.extensions.web.scene import ShownScene, is_vdi, look_of, scene_of, state_of
from pyvista_vdi.extensions.web.shown import camera_of, png, viewer_camera
from pyvista_vdi.extensions.web.widget import VDIWidget
from pyvista_vdi.vtk_pipeline.filters.view import aim

#: Seconds without a turn from which a view rests.
_REST = 0.2


class PlotterWidget(VDIWidget):
    """What ``plotter.show(jupyter_backend="vdi")`` shows.

    What is turned in the browser turns the plotter's camera; after each ``plotter.render()`` the
    browser has its camera and background, its VDIs with their clipping planes, opacity multipliers
    and places, and its meshes, lines, points and texts. When a view rests its VDIs are made anew
    and it is rendered in the kernel's event loop. A series plays in the browser; the step at which
    it is paused is the actor's, and the other way round.
    """

    def __init__(self, plotter: Any, scene: ShownScene, picture: Any) -> None:
        renderer = plotter.renderer
        self._plotter = weakref.ref(plotter)
        self._picture = picture
        self._rest: asyncio.TimerHandle | None = None
        self._loop: Any = None
        with suppress(RuntimeError):  # none runs: then the plotter is rendered by who holds it
            self._loop = asyncio.get_running_loop()
        self._look = None if scene.actor is None else look_of(scene.actor)
        super().__init__(scene.shown, camera=renderer.camera)
        self._picture_size = list(renderer.GetSize())
        self._take(renderer, scene)
        self.observe(self._turn, "camera")
        self.observe(self._play, "time")
        me = weakref.ref(self)

        def drawn(*_: Any) -> None:
            if (widget := me()) is not None:
                widget._follow()

        renderer.AddObserver("EndEvent", drawn)

    def _shown(self) -> Any:
        """Return the plotter, or ``None`` when it is gone or closed."""
        plotter = self._plotter()
        return None if plotter is None or plotter.render_window is None else plotter

    def _draw(self) -> None:
        """Make VDIs of the present view, and render the plotter, if it is there."""
        self._rest = None
        if (plotter := self._shown()) is None:
            return
        for prop in plotter.renderer.GetViewProps():
            mapper = prop.GetMapper() if is_vdi(prop) and prop.GetVisibility() else None
            if mapper is None or mapper.GetSource() is None or mapper.GetRegenerate() == "never":
                continue
            prop.regenerate()
        plotter.render()

    def _turn(self, change: Any) -> None:
        """Set the renderer's camera to the one that has changed in the browser, or here."""
        plotter = self._shown()
        if plotter is None or _same(_camera_of(plotter.renderer), change.new):
            return
        aim(plotter.camera, camera_of(change.new))
        plotter.renderer.ResetCameraClippingRange()
        self._draw_later()

    def _play(self, change: Any) -> None:
        """Set the actor's time to the one that has changed in the browser, or here."""
        player = None if self._actor is None else self._actor.player
        if player is None or change.new is None or self._shown() is None:
            return
        if player.collection.nearest(change.new) != player.step:
            player.time = change.new
            self._draw_later()

    def _draw_later(self) -> None:
        """Render the plotter when nothing has changed for a while."""

        def wait() -> None:
            if self._rest is not None:
                self._rest.cancel()
            self._rest = loop.call_later(_REST, self._draw)

        if (loop := self._loop) is not None:
            loop.call_soon_threadsafe(wait)  # messages may come in a thread of their own

    def _follow(self) -> None:
        """Take what the renderer has drawn; parts of a larger picture have other cameras."""
        plotter = self._shown()
        if plotter is None or tuple(plotter.render_window.GetTileScale()) != (1, 1):
            return
        renderer = plotter.renderer
        if not _same(camera := _camera_of(renderer), self.camera):
            self.camera = camera
        if self._known != state_of(renderer):
            self._take(renderer, scene_of(plotter, None, follow=True))
        elif self._actor is not None and self._actor.player is not None:
            self.time = self._actor.player.time

    def _take(self, renderer: Any, scene: ShownScene) -> None:
        """Take a scene, and send what of it is another."""
        self._known, self._actor, actor = state_of(renderer), scene.actor, scene.actor
        self.background = renderer.background_color
        self._gradient = scene.background if "gradient" in scene.background else ""
        if scene.data != self._scene:
            self._scene = scene.data
        if actor is None:
            return
        self.clipping_planes = scene.planes
        if self._look != (look := look_of(actor)):
            self._look, self.vdi = look, scene.shown
        if actor.player is not None:
            self.time = actor.player.time

    def _still(self) -> str:
        return png(self._picture)


def _camera_of(renderer: Any) -> dict[str, Any]:
    return viewer_camera(renderer.camera, renderer.GetSize())


def _same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether two views are the same but for rounding: VTK scales directions to length 1.

    A view that came back so would stop a hand that has moved on.
    """
    return set(one) == set(other) and all(
        np.allclose(one[name], other[name], rtol=1e-12, atol=1e-12) for name in one
    )
