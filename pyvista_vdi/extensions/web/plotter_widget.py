"""``PlotterWidget``: a plotter's scene in a notebook's output, with the plotter's camera."""

from __future__ import annotations

import asyncio
import secrets
import weakref
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Any

import ipywidgets
import numpy as np

from pyvista_vdi.extensions.web.camera import camera_of, viewer_camera
from pyvista_vdi.extensions.web.scene import Scene, look_of, part_of, scene_of, state_of
from pyvista_vdi.extensions.web.shown import png, with_still
from pyvista_vdi.extensions.web.widget import VDIWidget
from pyvista_vdi.vtk_pipeline.filters.view import aim, as_array

#: Seconds without a turn from which a view rests.
_REST = 0.2


class PlotterWidget(VDIWidget):
    """What ``plotter.show(jupyter_backend="vdi")`` shows of one renderer.

    What is turned in the browser turns its camera; after each ``plotter.render()`` the browser has
    its camera and background, its VDIs with their clipping planes, opacity multipliers and places,
    and its meshes, lines, points and texts. When a view rests the plotter is rendered in the
    kernel's event loop: its VDIs are kept up to date as in a window on a screen. A series plays in
    the browser; the step at which it is paused is the actor's, and the other way round.
    """

    def __init__(self, plotter: Any, renderer: Any, scene: Scene, picture: Any) -> None:
        self._plotter = weakref.ref(plotter)
        self._renderer = weakref.ref(renderer)  # another one may be active later
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

    @property
    def window(self) -> Any:
        """The plotter's render window, or ``None`` when it is gone or closed."""
        plotter = self._plotter()
        return None if plotter is None else plotter.render_window

    def draw(self) -> None:
        """Render the plotter, if it is there."""
        self._rest, plotter = None, self._plotter()
        if plotter is not None and plotter.render_window is not None:
            plotter.render()

    def _turn(self, change: Any) -> None:
        """Set the renderer's camera to the one that has changed in the browser, or here."""
        renderer = None if self.window is None else self._renderer()
        if renderer is None or _same(_camera_of(renderer), change.new):
            return
        aim(renderer.camera, camera_of(change.new))
        renderer.ResetCameraClippingRange()
        self._draw_later()

    def _play(self, change: Any) -> None:
        """Set the actor's time to the one that has changed in the browser, or here."""
        series = None if self._actor is None else self._actor.series
        if series is None or change.new is None or self.window is None:
            return
        if series.nearest(change.new) != series.nearest(self._actor.time):
            self._actor.time = change.new
            self._draw_later()

    def _draw_later(self) -> None:
        """Render the plotter when nothing has changed for a while."""

        def wait() -> None:
            if self._rest is not None:
                self._rest.cancel()
            self._rest = loop.call_later(_REST, self.draw)

        if (loop := self._loop) is not None:
            loop.call_soon_threadsafe(wait)  # messages may come in a thread of their own

    def _follow(self) -> None:
        """Take what the renderer has drawn; parts of a larger picture have other cameras."""
        renderer = None if self.window is None else self._renderer()
        if renderer is None or tuple(self.window.GetTileScale()) != (1, 1):
            return
        if not _same(camera := _camera_of(renderer), self.camera):
            self.camera = camera
        if self._known != state_of(renderer):
            self._take(renderer, scene_of(renderer, follow=True))
        elif self._actor is not None and self._actor.series is not None:
            self.time = self._actor.time

    def _accept(self, vdi: Any) -> Any:
        return None if vdi is None else super()._accept(vdi)  # subplots may have no VDI

    def _take(self, renderer: Any, scene: Scene) -> None:
        """Take a scene, and send what of it is another."""
        self._known, self._actor, actor = state_of(renderer), scene.actor, scene.actor
        self.background = renderer.background_color
        self._gradient = scene.background if "gradient" in scene.background else ""
        if scene.data != self._scene:
            self._scene = scene.data
        if actor is None:
            return
        self._placed, self.clipping_planes = as_array(actor.GetMatrix()), scene.planes
        self._opacity_multiplier = actor.opacity_multiplier
        if self._look != (look := look_of(actor)):
            self._look, self.vdi = look, scene.shown
        if actor.series is not None:
            self.time = actor.time

    def _still(self) -> str:
        return png(self._picture)


class SubplotsWidget(ipywidgets.GridBox):
    """What ``plotter.show(jupyter_backend="vdi")`` shows of several renderers, all of a plotter's.

    Attributes
    ----------
    children : tuple of PlotterWidget
        In the order of ``plotter.renderers``, each where its renderer is in the window. Linked
        ones turn together.
    """

    def __init__(self, plotter: Any, scenes: Sequence[Any], picture: Any) -> None:
        self._picture, self._key = picture, secrets.token_hex(8)
        width = plotter.render_window.GetSize()[0]
        places = [renderer.GetViewport() for renderer in plotter.renderers]
        # Lines of the grid: all edges, from the left, and from the top
        columns = sorted({edge for place in places for edge in place[::2]})
        rows = sorted({edge for place in places for edge in place[1::2]}, reverse=True)
        children = []
        for renderer, scene in zip(plotter.renderers, scenes, strict=True):
            child = PlotterWidget(plotter, renderer, scene, part_of(picture, renderer))
            camera = renderer.GetActiveCamera().GetAddressAsString("")
            child._key, child._link = self._key, f"{self._key}-{camera}"
            left, bottom, right, top = renderer.GetViewport()
            child.layout.grid_column = f"{columns.index(left) + 1} / {columns.index(right) + 1}"
            child.layout.grid_row = f"{rows.index(top) + 1} / {rows.index(bottom) + 1}"
            child.layout.margin = "0"
            children.append(child)
        widths = [f"{right - left:g}fr" for left, right in pairwise(columns)]
        layout = ipywidgets.Layout(
            grid_template_columns=" ".join(f"minmax(0, {each})" for each in widths),
            grid_gap="0",
            width="100%",
            max_width=f"{width}px",
        )
        super().__init__(children, layout=layout)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return the view, and a picture for where there can be no view."""
        return with_still(super()._repr_mimebundle_(**kwargs), png(self._picture), self)


def _camera_of(renderer: Any) -> dict[str, Any]:
    return viewer_camera(renderer.camera, renderer.GetSize())


def _same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Whether two views are the same but for rounding: VTK scales directions to length 1.

    A view that came back so would stop a hand that has moved on.
    """
    return set(one) == set(other) and all(
        np.allclose(one[name], other[name], rtol=1e-12, atol=1e-12) for name in one
    )
