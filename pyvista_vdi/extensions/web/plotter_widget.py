"""``PlotterWidget``: a plotter's scene in a notebook's output, with the plotter's camera."""

from __future__ import annotations

import asyncio
import weakref
from contextlib import suppress
from typing import Any

import numpy as np

from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.camera import MOST_PLANES, viewer_camera
from pyvista_vdi.extensions.web.placing import as_shown, look_of, planes_of
from pyvista_vdi.extensions.web.still import png
from pyvista_vdi.extensions.web.widget import RENDER, VDIWidget
from pyvista_vdi.vtk_pipeline.interaction import browser

#: Seconds without a turn from which a view rests.
_REST = 0.2


class PlotterWidget(VDIWidget):
    """What ``plotter.show(jupyter_backend="vdi")`` shows: the plotter's active renderer.

    What is turned in the browser turns its camera; after each ``plotter.render()`` the browser has
    its camera and background, its VDIs with their clipping planes, opacity multipliers and places,
    and its meshes, lines, points and texts. When a view rests the plotter is rendered in the
    kernel's event loop: its VDIs are kept up to date as in a window on a screen.
    """

    _esm = viewer_script(scene=True, module=True) + RENDER

    def __init__(self, plotter: Any, scene: Any, picture: Any) -> None:
        self._plotter, renderer = weakref.ref(plotter), plotter.renderer
        self._renderer = weakref.ref(renderer)  # another one may be active later
        self._actor = actor = scene.actor
        self._picture = picture
        self._rest: asyncio.TimerHandle | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        with suppress(RuntimeError):  # none runs: then the plotter is rendered by who holds it
            self._loop = asyncio.get_running_loop()
        self._look = look_of(actor)
        shown = as_shown(actor)
        super().__init__(shown, camera=renderer.camera, background=renderer.background_color)
        self.clipping_planes = planes_of(actor)[:MOST_PLANES]
        self._take(scene)
        self._picture_size = list(renderer.GetSize())
        self.observe(self._turn, "camera")
        me = weakref.ref(self)

        def rendered(*_: Any) -> None:
            widget = me()
            if widget is not None:
                widget._follow()

        renderer.AddObserver("EndEvent", rendered)
        browser.follow(self)

    @property
    def window(self) -> Any:
        """The plotter's render window, or ``None`` when it is gone or closed."""
        plotter = self._plotter()
        return None if plotter is None else plotter.render_window

    def draw(self) -> None:
        """Render the plotter, if it is there."""
        self._rest = None
        plotter = self._open_plotter()
        if plotter is not None:
            plotter.render()

    def _open_plotter(self) -> Any:
        """Return the plotter, or ``None`` when it is gone or closed."""
        plotter = self._plotter()
        return None if self.window is None else plotter

    def _open_renderer(self) -> Any:
        """Return what is shown, or ``None`` when the plotter is gone or closed."""
        return None if self.window is None else self._renderer()

    def _turn(self, change: Any) -> None:
        """Set the renderer's camera to the one that has changed in the browser, or here."""
        renderer = self._open_renderer()
        if renderer is None or _same(_camera_of(renderer), change.new):
            return
        state, camera = change.new, renderer.camera
        camera.position, camera.focal_point = state["position"], state["focal_point"]
        camera.up = state["view_up"]
        camera.parallel_projection = "parallel_scale" in state
        camera.parallel_scale = state.get("parallel_scale", camera.parallel_scale)
        if "view_angle" in state:
            camera.SetUseHorizontalViewAngle(False)
            camera.view_angle = state["view_angle"]
        renderer.ResetCameraClippingRange()
        if self._loop is not None:  # messages may come in a thread of their own
            self._loop.call_soon_threadsafe(self._wait_for_rest)

    def _wait_for_rest(self) -> None:
        if self._rest is not None:
            self._rest.cancel()
        assert self._loop is not None
        self._rest = self._loop.call_later(_REST, self.draw)

    def _follow(self) -> None:
        """Take what the renderer has drawn; parts of a larger picture have other cameras."""
        renderer = self._open_renderer()
        if renderer is None or tuple(self.window.GetTileScale()) != (1, 1):
            return
        camera = _camera_of(renderer)
        if not _same(camera, self.camera):
            self.camera = camera
        self.background = renderer.background_color
        self._take_if_new(renderer)
        self.clipping_planes = planes_of(self._actor)[:MOST_PLANES]
        if self._actor.vdi is not None and look_of(self._actor) != self._look:
            self._look = look_of(self._actor)
            self.vdi = as_shown(self._actor)

    def _take_if_new(self, renderer: Any) -> None:
        from pyvista_vdi.extensions.web.scenes.scene import scene_of, state_of

        if self._known != state_of(renderer):
            self._take(scene_of(renderer, camera=False))

    def _take(self, scene: Any) -> None:
        self._known, self._actor = scene.state, scene.actor
        if scene.data != self._scene:
            self._scene = scene.data
        self._gradient = scene.background if "gradient" in scene.background else ""

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
