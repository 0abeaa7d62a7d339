"""Draws the frames of a mapper, and answers whatever else VTK asks of it.

A frame is: VTK's event, what is seen of the scene, the plan, one raycast, a texture.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidVolumeError, VDIError
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.model.view import coverage
from pyvista_vdi.quality.plan import SETTLED
from pyvista_vdi.quality.rate import FLOOR, reduced
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification
from pyvista_vdi.raycasting.picking import FirstHit, Pick, pick_vdi
from pyvista_vdi.raycasting.prepared import release_from_devices
from pyvista_vdi.vtk_pipeline.drawing.box import Box
from pyvista_vdi.vtk_pipeline.drawing.depth import opaque_depth
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Matrix, tiled, viewport
from pyvista_vdi.vtk_pipeline.drawing.images import NOTHING, Drawn, raycast
from pyvista_vdi.vtk_pipeline.drawing.overlap import group_of
from pyvista_vdi.vtk_pipeline.drawing.planner import Planner
from pyvista_vdi.vtk_pipeline.drawing.screen import ImageTexture, NoDepth, place_image
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.interaction.status import VDIStatus
from pyvista_vdi.vtk_pipeline.interaction.timer import PERIOD, Timer
from pyvista_vdi.vtk_pipeline.interaction.window import Window, now

#: Pictures as coarse as previews that tell what a volume's rays take, of which the fastest counts:
#: what disturbs one by milliseconds has the volume seem too slow to be drawn.
_TRIALS = 5


class Driver(Planner):
    """What happens behind a :class:`VDIMapper`; its observers call :meth:`begin` and :meth:`end`.

    It holds its actor and its windows weakly, so that nothing here keeps a scene alive.
    """

    def __init__(self) -> None:
        super().__init__()
        self.box = Box()
        self._window: Callable[[], Window | None] = lambda: None  # of the last frame
        self.trouble: BaseException | None = None  # why a frame could not be drawn, the last time
        # What the last frame showed, and by what
        self._last, self._spare = NOTHING, NOTHING.pixels
        self._stand_in = False  # whether that was a volume whose VDI is to come
        self._texture, self._no_depth = ImageTexture(), NoDepth()
        self._counted: Any = None  # the VDI that was shown last, weakly
        self._generation = 0  # how many were
        self._timer = Timer(self._tick)

    # What is drawn, and how

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        if self.input is not None:
            self.input.drivers.discard(self)
            self.input.rest()
        self.input, self._last, self.failed = source, NOTHING, ()
        self.forget()
        if source is not None:
            source.drivers.add(self)
        self.box.show(source)

    def changed(self) -> None:
        """Look at what is before the input, which may be another by now, or play."""
        self.box.connect()
        self.follow()

    def release(self) -> None:
        """Free textures, images and what devices hold, and end what goes on; a frame begins anew.

        What lit the last frame stays.
        """
        held = [] if self.input is None else self.input.on_devices()
        if self._volume is not None:
            held.append(self._volume.request.volume)
        if isinstance(self.input, VDISource):
            self.input.keep_lights(self.renderers)
        self._timer.stop()
        if self.input is not None:
            self.input.rest()
        self.forget()
        self.worker.join()
        release_from_devices(held)
        self._texture.release()
        self._texture = ImageTexture()  # it holds the image as well
        self._no_depth.release()
        self._last, self._spare = replace(self._last, image=NOTHING.image, key=None), None

    # A frame

    def begin(self, mapper: Any) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        actor, renderer = self.actor(), self.renderer()
        if renderer is None or not _is_drawing(renderer):
            self.warn(
                "VDIMapper draws only behind its own VDIActor: use VDIActor in place of vtkVolume"
            )
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if actor.GetProperty().GetIndependentComponents() else 4
        if self.box.components != components:
            self.box.give_components(components)
        frame = self._guarded(Frame.current, renderer, actor, mapper)
        if frame is None:  # or beside the tile of a picture that is drawn
            return
        window, vtk_window = frame.window, renderer.GetRenderWindow()
        self._window = weakref.ref(window)
        # A selection draws numbers where the last frame showed something
        if renderer.GetSelector() is None:
            with suppress(VDIError):  # which what is drawn says
                self.box.Update()
            self._last = self._guarded(self._paint, frame) or self._last
        drawn = self._last
        window.pace.frame.preview |= drawn.preview
        # Pixels are interpolated, but not where the neighbours are another actor's
        smooth = drawn.preview and not drawn.joint
        unit = self._texture.show(vtk_window, drawn.image, smooth=smooth)
        place_image(actor, unit, frame.origin, frame.full_size)
        self._no_depth.show(vtk_window, mapper)
        self.follow(window)

    def end(self) -> None:
        """Release the texture units."""
        self._texture.let_go()
        self._no_depth.let_go()
        if self.seen is not None and self.seen.hand:
            self.worker.pause(SETTLED)  # from now on

    def _paint(self, frame: Frame) -> Drawn:
        """Return the frame's image: the last one, or a new one."""
        shown = self._seen_in(frame)
        self._stand_in = shown is not None and shown.stand_in
        if shown is None:
            return self._last
        frame, window = shown, shown.window
        if frame.volume is None and len(window.shown_in(frame.renderer)) > 1:
            part = group_of(frame).part(frame)
            if part is not None:
                return part
        frame = replace(frame, depth=opaque_depth([frame]))
        # However the frame is to be: where it is there, full costs nothing
        share = 1 / self.settings.image_distance**2
        for size in dict.fromkeys((reduced(frame.full_size, share), self.preview_size(frame))):
            sized = frame.coarser(size)
            if self._last.shows(sized):
                return self._last
        # Raycast, and note what that took
        began = now()
        drawn = raycast(sized, self.device, self._spare)
        seconds = now() - began
        self._spare = self._last.pixels
        window.pace.drawn(sized.size, sized.full_size, seconds, sized.way, sized.effort)
        # A volume's first picture has kernels compiled and voxels sent to the device
        if sized.volume is None or sized.volume.pictures > 1:
            of = (sized.way, sized.angle, sized.covered_by(sized.bounds), seconds)
            self.costs = self.costs.took(*of, gpu=not get_runtime(self.device).is_cpu)
        elif self.seen is not None and self.costs.volume is None:
            coarse, taken = frame.coarser(reduced(frame.full_size, FLOOR)), []
            for _ in range(_TRIALS):
                began = now()
                raycast(coarse, self.device, None)
                taken.append(now() - began)
            pixels = coarse.covered_by(coarse.bounds)
            self.costs = self.costs.took("volume", 0.0, pixels, min(taken))
        return drawn

    def _seen_in(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, and show its bounds to VTK."""
        shown = self.showing(frame)
        if shown is not None:
            self.box.place(shown.bounds)
            if shown.volume is None and shown.seen != self._counted:
                self._counted = shown.seen
                self._generation += 1
        return shown

    def preview_size(self, frame: Frame) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        settings, window, renderer, share = self.settings, frame.window, frame.renderer, 1.0
        if frame.full or not settings.previews:
            window.knows(renderer.GetActiveCamera())
        elif not window.takes_picture(renderer):
            each, expected = self.costs.volume, None
            if frame.volume is not None and each is not None:
                expected = each * frame.covered_by(frame.bounds) + self.costs.fixed
            share = window.pace.share(
                window.rate(settings),
                math.prod(frame.full_size),
                min(1.0, 1 / frame.mapper.GetMaximumImageSampleDistance() ** 2),
                frame.way,
                effort=frame.effort,
                expected=expected,
            )
        return reduced(frame.full_size, min(share, 1 / settings.image_distance**2))

    def beside(self, mapper: Any, renderer: Any, matrix: Matrix) -> Frame | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """

        def in_picture() -> Frame | None:
            bounds = None if self.input is None else self.input.bounds()
            frame = Frame.current(renderer, self.actor(), mapper, matrix)
            if bounds is None or frame is None or frame.rectangle(bounds) is None:
                return None
            self._window = weakref.ref(frame.window)
            seen = self._seen_in(frame)
            return None if seen is None or seen.volume is not None else seen

        return self._guarded(in_picture)  # type: ignore[no-any-return]

    # Between frames

    def follow(self, window: Window | None = None) -> None:
        """Start the event loop's timer, if something goes on and no hand moves."""
        window = self._window() if window is None else window
        if window is not None and self.goes_on and not window.moving:
            period = PERIOD if self.input is None else self.input.period or PERIOD
            self._timer.start(window.interactor, period)

    def _tick(self) -> None:
        """Look, from the event loop, at what goes on, and have shown what is new."""
        window = self._window()
        if window is None or window.drawing:
            return
        another = self.advance() or (self.unsettled and now() - self._moved_at >= SETTLED)
        if window.moving or not (another or self.goes_on):
            self._timer.stop()
        interactor = self._timer.interactor()
        if another and interactor is not None:
            interactor.Render()

    # Errors in a frame

    def _guarded(self, draw: Callable[..., Any], *of: Any) -> Any:
        """Return what a part of drawing returns, or ``None`` and say what went wrong."""
        try:
            return draw(*of)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            if isinstance(error, InvalidVolumeError):  # as VTK's mappers: there is nothing to see
                self._last = NOTHING
                with suppress(VDIError):
                    self.box.place(None if self.input is None else self.input.bounds())
            message = f"the VDI cannot be drawn: {type(error).__name__}: {error}"
            if isinstance(error, KeyboardInterrupt):
                message = (
                    "generating the VDI was interrupted: what was shown stays; call "
                    "actor.regenerate() to try again"
                )
            self.warn(message, error)
            # Without the frames that it came from, which hold buffers
            self.trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None
        return None

    # Status and picks

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        last, view, window = self._last, self.view, self._window()
        vdi = None if self.input is None else self.input.last()
        player = None if self.input is None else self.input.player
        shown = None if vdi is None or view is None else (vdi, view.camera, view.size)
        known = None if vdi is None else self.estimate
        return VDIStatus(
            mode="none" if last.full_size is None else "preview" if last.preview else "full",
            samples=0 if last.full_size is None else last.image.size // 4,
            full_samples=math.prod(last.full_size or (0, 0)),
            fps=None if window is None else window.pace.fps,
            angle=None if shown is None else angle_from_generating_view(*shown[:2]),
            magnification=None if shown is None else magnification(*shown),
            coverage=None if shown is None else coverage(*shown),
            ssim=known.ssim if known is not None and known.vdi() is vdi else None,
            progress=self.worker.progress if self.making is not None else None,
            generation=self._generation,
            vdi=vdi,
            stand_in=self._stand_in,
            drawn=last.way,
            time=None if player is None else player.time,
        )

    def pick(self, renderer: Any, x: float, y: float) -> Pick | None:
        """Return what of the VDI a renderer shows at a place of its window, in pixels."""
        kept, window = self.values_asked_for(), Window.of(renderer.GetRenderWindow())
        shown = [v for v in window.shown_in(renderer) if v.driver is self and v.visible]
        if not shown or not shown[0].actor.GetPickable():
            return None
        placed = shown[0]
        frame = Frame.current(renderer, placed.actor, placed.mapper, placed.matrix, drawing=False)
        vdi = None if frame is None else self.vdi_to_pick(frame)
        if frame is None or vdi is None:
            return None
        seen = frame.showing(vdi)
        (left, bottom), request = seen.origin, FrameRequest(seen.camera, seen.size, seen.options)
        hit = FirstHit.of(self.settings.picking_opacity, accumulated=True)
        picked = pick_vdi(vdi, request, (int(x) - left, int(y) - bottom), hit, kept)
        # What the last frame drew there may hide it
        drawn = not renderer.GetRenderWindow().GetNeverRendered()
        z = np.array([renderer.GetZ(int(x), int(y)) if drawn else 1.0])
        if picked is None or picked.depth > seen.view_depth(z)[0]:
            return None
        # From the frame's world, whose origin is the eye, to the scene's
        px, py, pz, _ = np.linalg.solve(seen.to_view, [*picked.position, 1.0]).tolist()
        return replace(picked, position=(px, py, pz))

    # Renderers

    def renderer(self) -> Any:
        """Return the renderer that is drawing the actor, or would; ``None`` if it has none."""
        renderers = self.renderers
        if len(renderers) < 2:
            return renderers[0] if renderers else None
        drawing = [each for each in renderers if _is_drawing(each)]
        for each in drawing:
            window = Window.of(each.GetRenderWindow())
            window.shown_in(each)  # from now on it is known which one draws
            if window.active.Get() is each:
                return each
        # The first frame that shows the actor twice: tell them apart by their viewports
        there = (each for each in drawing if viewport(each) == tiled(each))
        return next(there, (drawing or renderers)[0])


def _is_drawing(renderer: Any) -> bool:
    window = renderer.GetRenderWindow()
    return window is not None and bool(window.CheckInRenderStatus())
