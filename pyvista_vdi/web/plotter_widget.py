"""``PlotterWidget``: a plotter's VDI in a notebook's output, with the plotter's camera."""

from __future__ import annotations

import weakref
from typing import Any

from pyvista_vdi.web.camera import viewer_camera
from pyvista_vdi.web.still import png
from pyvista_vdi.web.widget import VDIWidget


class PlotterWidget(VDIWidget):
    """What ``plotter.show(jupyter_backend="vdi")`` shows.

    What is turned in the browser turns the plotter's camera; after each ``plotter.render()`` the
    browser has the plotter's camera, background and VDI.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Rendered before; held weakly.
    actor : PlotterVDIActor
        Its VDI that is shown.
    picture : numpy.ndarray
        uint8 (H, W, 3), the plotter's picture, which is kept in a saved notebook.
    """

    def __init__(self, plotter: Any, actor: Any, picture: Any) -> None:
        self._plotter = weakref.ref(plotter)
        self._actor = actor
        self._picture = picture
        super().__init__(actor.vdi, camera=plotter.camera, background=plotter.background_color)
        self._picture_size = list(plotter.window_size)
        self.observe(self._turn, "camera")
        me = weakref.ref(self)

        def rendered(*_: Any) -> None:
            widget = me()
            if widget is not None:
                widget._follow()

        plotter.renderer.AddObserver("EndEvent", rendered)

    def _open_plotter(self) -> Any:
        """Return the plotter, or ``None`` when it is gone or closed."""
        plotter = self._plotter()
        return None if plotter is None or plotter.render_window is None else plotter

    def _turn(self, change: Any) -> None:
        """Give the plotter the camera that has changed in the browser, or here."""
        plotter = self._open_plotter()
        if plotter is None or viewer_camera(plotter.camera, plotter.window_size) == change.new:
            return
        state, camera = change.new, plotter.camera
        camera.position, camera.focal_point = state["position"], state["focal_point"]
        camera.up = state["view_up"]
        camera.parallel_projection = "parallel_scale" in state
        camera.parallel_scale = state.get("parallel_scale", camera.parallel_scale)
        if "view_angle" in state:
            camera.SetUseHorizontalViewAngle(False)
            camera.view_angle = state["view_angle"]
        plotter.renderer.ResetCameraClippingRange()

    def _follow(self) -> None:
        """Take what the plotter has drawn; parts of a larger picture have other cameras."""
        plotter = self._open_plotter()
        if plotter is None or tuple(plotter.render_window.GetTileScale()) != (1, 1):
            return
        self.camera = plotter.camera
        self.background = plotter.background_color
        if self._actor.vdi not in (None, self.vdi):
            self.vdi = self._actor.vdi

    def _still(self) -> str:
        return png(self._picture)
