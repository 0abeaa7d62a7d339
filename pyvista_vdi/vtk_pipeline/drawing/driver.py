"""Draws the frames of a mapper, and answers whatever else VTK asks of it.

A frame is: VTK's event, what is seen of the scene, the decision, one raycast, a texture.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError, VDIError
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.decide import placeholder_share, ssim_of
from pyvista_vdi.quality.frame_state import FrameTook, PlaceholderTook, VDIAsked, ViewPicked
from pyvista_vdi.quality.pace import reduced
from pyvista_vdi.quality.records import replace
from pyvista_vdi.quality.render_mode import seconds_per_pixel
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification
from pyvista_vdi.raycasting.picking import FirstHit, Pick
from pyvista_vdi.raycasting.prepared import release_from_devices
from pyvista_vdi.vtk_pipeline.drawing.box import Box
from pyvista_vdi.vtk_pipeline.drawing.deciding import Deciding, number_of
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.frame import Drawn, Frame, Matrix, consumers, viewport
from pyvista_vdi.vtk_pipeline.drawing.grabbing import Grabbing
from pyvista_vdi.vtk_pipeline.drawing.images import NOTHING, Images
from pyvista_vdi.vtk_pipeline.drawing.overlap import Overlaps, overlapped
from pyvista_vdi.vtk_pipeline.drawing.refused import effects_without
from pyvista_vdi.vtk_pipeline.drawing.scissor import Scissor, shown_box
from pyvista_vdi.vtk_pipeline.drawing.selection import Selection
from pyvista_vdi.vtk_pipeline.drawing.shader import place_image
from pyvista_vdi.vtk_pipeline.drawing.texture import ImageTexture, NoDepth
from pyvista_vdi.vtk_pipeline.filters.inputs import Input, SourceInput
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of, renderer_view, size_of
from pyvista_vdi.vtk_pipeline.interaction.browser import SceneAtHand
from pyvista_vdi.vtk_pipeline.interaction.status import VDIStatus
from pyvista_vdi.vtk_pipeline.interaction.window import Met, Window, now
from pyvista_vdi.vtk_pipeline.vtk import vtkWeakReference, weakly

#: What is said where another volume has the mapper.
_BEHIND_ANOTHER = (
    "VDIMapper draws only behind its own VDIActor, and is behind another volume: use VDIActor in "
    "place of vtkVolume, also for copies (VDIActor().ShallowCopy(actor))"
)


class Driver(Deciding):
    """What happens behind a :class:`VDIMapper`; its observers call :meth:`begin` and :meth:`end`.

    It holds its actor and its windows weakly, so that nothing here keeps a scene alive.
    """

    def __init__(self) -> None:
        super().__init__()
        self.box = Box()
        self._actor: Callable[[], Any] = lambda: None
        self._active = vtkWeakReference()  # which renderer is between its start and its end
        self._watched = Met()
        self._view: View | None = None  # of the last frame
        self._texture, self._no_depth = ImageTexture(), NoDepth()
        self._scissor = Scissor()
        self._selection = Selection()
        self._images, self._last = Images(), NOTHING
        self._counted = self._generation = 0  # the VDI that was shown last, and how many were
        self.level: tuple[int, int] | None = None  # of a store, and of how many
        self._scene_at_hand = SceneAtHand(self._say_not_exported)
        self._trouble: BaseException | None = None
        self._astray = False  # whether something else than the actor draws

    # What is drawn, and how

    def set_actor(self, actor: Any) -> None:
        """Remember whose matrix and renderers count."""
        other = self._actor()
        if other is not None and other is not actor:
            raise InvalidArgumentError(
                "this VDIMapper is already behind another VDIActor: give each actor its own "
                "(the VDI itself can be shared)"
            )
        self._actor = weakly(actor)

    def leave_actor(self, actor: Any) -> None:
        """Forget that actor, if it is this one."""
        if self._actor() is actor:
            self._actor = lambda: None

    @property
    def actor(self) -> Any:
        """The actor that this draws for, whose matrix and renderers count; ``None`` without one."""
        return self._actor()

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        weak = weakref.ref(self)

        def changed(*_: Any) -> None:
            driver = weak()
            if driver is not None:
                driver.box.connect()

        super().set_input(source)
        if source is not None:
            source.watch(changed)
        self.box.show(source)
        self._last = NOTHING

    @property
    def proxy(self) -> Any:
        """The image whose box VTK draws in place of the VDI."""
        return self.box.image

    def release(self) -> None:
        """Free textures, images and what devices hold, and end what goes on; a frame begins anew.

        What lit the last frame stays.
        """
        held = [] if self.input is None else self.input.on_devices()
        if isinstance(self.input, SourceInput):
            self.input.keep_lights(self.renderers())
        super().release()
        release_from_devices(held)
        self._texture.release()
        self._no_depth.release()
        self._selection.release()
        self._images.clear()

    @property
    def holds_images(self) -> bool:
        """Whether images are kept, or a texture."""
        return self._images.any or self._texture.there

    # A frame

    def begin(self, mapper: Any) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        actor, renderer = self._actor(), self.renderer()
        # Else a copy of the actor by vtkVolume.ShallowCopy draws, in another window
        self._astray = renderer is None or not _is_drawing(renderer)
        if self._astray:
            self._warnings.warn(_BEHIND_ANOTHER)
            self.box.place((0.0,) * 6)  # nothing is seen of it
            if actor is not None:  # whose shader the copy has
                place_image(actor, 0, (0, 0), (1, 1))
            return
        origin, size = viewport(renderer)
        if min(size) == 0:  # beside the tile of a picture that is drawn
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if actor.GetProperty().GetIndependentComponents() else 4
        if self.box.components != components:
            self.box.give_components(components)
        window = renderer.GetRenderWindow()
        of_window = Window.of(window)
        self._window = weakref.ref(of_window)
        if renderer.GetSelector() is not None:
            self._select(mapper, renderer)
            return
        effects = effects_without(renderer)
        for text in effects.values():
            self._warnings.warn(text)
        peeled = "vtkDualDepthPeelingPass" in effects
        self._selection.leave(actor, occluded="vtkSSAOPass" in effects, peeled=peeled)
        with suppress(VDIError):  # which what is drawn says
            self.box.Update()
        drawn = self._last = self._guarded(self._paint, mapper, renderer) or self._last
        of_window.pace = of_window.pace.showed(drawn.preview)
        if window.GetInteractor() is not None:
            of_window.listen(window.GetInteractor(), Grabbing)
        unit = self._texture.show(window, drawn.image, drawn.number, smooth=drawn.smooth)
        place_image(actor, unit, origin, size)
        if drawn.smooth:
            self._scissor.narrow(window, shown_box(drawn.image, origin, size))
        self._no_depth.show(window, mapper)
        self.texts.write(renderer, self.status)
        self.follow(window)

    def end(self) -> None:
        """Release the texture unit, and draw everywhere again."""
        self._scissor.end()
        if self._astray:
            self.box.Modified()  # it has its bounds again
        self._texture.let_go()
        self._no_depth.let_go()
        self._selection.texture.let_go()

    def _paint(self, mapper: Any, renderer: Any) -> Drawn:
        """Return the frame's image."""
        frame = self._showing(Frame.current(renderer, self._actor(), mapper))
        if frame is None:
            return self._last
        if frame.volume is None:  # which has no lists to be merged by
            part = self.window.shared(Overlaps).part(frame)
            if part is not None:
                return part
        window = self.window
        depth = window.shared(OpaqueDepths).read([frame])
        frame = frame if depth is None else replace(frame, depth=depth)
        at_rest = reduced(frame.full_size, 1 / self.state.settings.image_distance**2)
        frame = frame.coarser(at_rest)
        drawn = self._images.get(frame)
        if drawn is not None:
            return drawn  # however the frame is to be: where it is there, full costs nothing
        few = frame
        many = window.pace.few_lists and window.single and window.previews(self.state.settings)
        if many and frame.vdi is not None and frame.view is not None:
            of = (frame.number, frame.vdi, frame.view.camera, self.device)
            few = replace(frame, few_lists=self._behind.fewer_lists(*of))
        size = self.preview_size(few)
        frame = (frame if size == frame.full_size else few).coarser(size)
        return (self._images.get(frame) if frame.preview else None) or self._raycast(frame)

    def _showing(self, frame: Frame) -> Frame | None:
        """Return the frame of what is to be seen, ``None`` if that is nothing."""
        window = Window.of(frame.renderer.GetRenderWindow())
        self._window, self._view = weakref.ref(window), frame.view
        if any(
            v.mapper is frame.mapper and v.driver is None for v in window.shown_in(frame.renderer)
        ):
            self._warnings.warn(_BEHIND_ANOTHER)
        seen = self.decided(frame, joint=overlapped(frame))
        if seen is not None:
            self.box.place(seen.bounds)
            if seen.volume is None and seen.number != self._counted:
                self._counted = seen.number
                self._generation += 1
            seen = self._lit_and_blended(seen)
        return seen

    def _lit_and_blended(self, frame: Frame) -> Frame:
        """Return the frame with the view whose light falls on it, and what it is blended of."""
        volume, settings = frame.volume, self.state.settings
        if volume is not None:
            # In a window the VDI's light, so that nothing jumps
            by_vdi = settings.draw != "volume" and self.window.watched_behind(settings)
            if volume.placeholder or by_vdi or not volume.shaded or frame.view is None:
                return frame
            return replace(frame, lit_from=frame.view.camera)
        parts = [] if self.input is None else self.input.parts()
        if len(parts) < 2 or parts[0][0] is not frame.vdi:
            return frame
        blend = tuple((number_of(vdi), weight) for vdi, weight in parts)
        return replace(frame, parts=tuple(parts), blend=blend)

    def preview_size(self, frame: Frame) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        settings, window, renderer = self.state.settings, self.window, frame.renderer
        pixels = math.prod(frame.full_size)
        floor = min(1.0, 1 / frame.mapper.GetMaximumImageSampleDistance() ** 2)
        share = 1.0
        if frame.volume is not None and frame.volume.placeholder:
            if settings.previews and not window.takes_picture(renderer):
                self.state, share = placeholder_share(self.state, pixels)
                share = max(share, floor)
        elif not window.previews(settings):
            window.knows(renderer.GetActiveCamera())
        elif not window.takes_picture(renderer):
            each = seconds_per_pixel(self.state.costs, "volume", 0.0)
            known = frame.volume is not None and each is not None
            window.pace, share = window.pace.share(
                window.rate(settings),
                pixels,
                floor,
                frame.cost,
                effort=frame.effort,
                expected=each * frame.covered if known else None,  # type: ignore[operator]
            )
        return reduced(frame.full_size, min(share, 1 / settings.image_distance**2))

    def _raycast(self, frame: Frame) -> Drawn:
        """Return the image, and tell what it took."""
        volume, window = frame.volume, self.window
        before = now()
        drawn = self._images.raycast(frame, self.device)
        seconds = now() - before
        if volume is not None and volume.placeholder:
            self.tell(PlaceholderTook(math.prod(frame.size), seconds))
        else:
            took = (frame.size, frame.full_size, seconds, frame.cost, frame.effort)
            window.pace = window.pace.drawn(*took)
        # A volume's first picture has kernels compiled and voxels sent to the device
        if frame.few_lists is None and (volume is None or volume.pictures > 1):
            self.tell(FrameTook(frame.way, frame.angle, frame.covered, seconds))
        return drawn

    def _guarded(self, draw: Callable[[Any, Any], Any], mapper: Any, renderer: Any) -> Any:
        """Return what a part of drawing returns, or ``None`` and say what went wrong."""
        try:
            return draw(mapper, renderer)
        except KeyboardInterrupt as interrupt:
            self._warnings.warn(
                "generating the VDI was interrupted: what was shown stays; call "
                "actor.regenerate() to try again"
            )
            self._note(interrupt)
        except Exception as error:  # VTK would swallow it
            if isinstance(error, InvalidVolumeError):  # as VTK's mappers: there is nothing to see
                self._last = NOTHING
                with suppress(VDIError):
                    self.box.place(None if self.input is None else self.input.bounds())
            self._warnings.warn(f"the VDI cannot be drawn: {type(error).__name__}: {error}", error)
            self._note(error)
        return None

    def raise_trouble(self) -> None:
        """Raise, once, what a frame could not be drawn for: VTK's renderer lets nothing through."""
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble

    def _note(self, error: BaseException) -> None:
        """Keep the first error for :meth:`raise_trouble`, without the frames that it came from."""
        if self._trouble is None:
            self._trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None

    # Picks, neighbours, exports and status

    def say_not_exported(self) -> None:
        """Warn once that a scene which is written for another renderer lacks the VDI.

        Not yet where trame has the scene at hand, and shows the pictures that are drawn here.
        """
        renderer = self.renderer()
        window = None if renderer is None else renderer.GetRenderWindow()
        if window is None or not self._scene_at_hand.is_all(window):
            self._say_not_exported()

    def _say_not_exported(self) -> None:
        self._warnings.warn(
            "the scene is being exported without its VDI: trame's export_html, export_vtksz and "
            "views that are rendered in the browser (client-side) get an empty box in its place; "
            "use plotter.vdi.export_html, screenshots, movies, or server-side rendering"
        )

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        last, view, window = self._last, self._view, self._window()
        vdi = None if self.input is None else self.input.last()
        player = None if self.input is None else self.input.player
        shown = None if vdi is None or view is None else (vdi, view.camera, view.size)
        wide, high = last.full_size or (0, 0)
        number = None if vdi is None else number_of(vdi)
        return VDIStatus(
            mode="none" if last.full_size is None else "preview" if last.preview else "full",
            samples=last.samples,
            full_samples=wide * high,
            fps=None if window is None else window.pace.fps,
            angle=None if shown is None else angle_from_generating_view(*shown[:2]),
            magnification=None if shown is None else magnification(*shown),
            coverage=None if shown is None else coverage(*shown),
            ssim=ssim_of(self.state, number, view),
            progress=self._behind.progress,
            generation=self._generation,
            vdi=vdi,
            stand_in=last.placeholder,
            drawn=last.way,
            time=None if player is None else player.time,
            level=self.level,
        )

    def between_frames(self) -> bool:
        """Take what was made behind the frames; whether there is another VDI to be drawn."""
        swapped = super().between_frames()
        if swapped:
            # Gone before the frame begins: freeing hundreds of megabytes takes its time
            self._images.clear()
        return swapped

    def vdi_asked_for(self) -> VDI | None:
        """Return the VDI, made now where there is none, or of what is no longer so.

        It is of the view that the first picture had, or that somebody chose; before the first
        picture, of the view that this would have now. ``None`` without an input, or a view.
        """
        source, seen = self.input, self._look_for_view()
        if not isinstance(source, SourceInput):
            if source is None or (source.last() is not None and source.prop is None):
                return None if source is None else source.last()
            return source.vdi()  # in the colours that its property has by now
        if source.has_view:
            self.tell(VDIAsked(source.last() is not None, source.stamp()))
        elif seen is not None and self.state.settings.automatic_view:
            return source.of_view(source.view_for(*seen))
        return source.last()

    def vdi_of_view(self, renderer: Any, matrix: Matrix) -> VDI | None:
        """Return a VDI of exactly what a renderer shows of an actor of that matrix, (4, 4).

        It is made beside the one that is there; without the volume, or where nobody but
        ``actor.regenerate()`` may make another, it is that one.
        """
        source = self.input
        if not isinstance(source, SourceInput) or self.state.settings.regenerate == "never":
            return self.vdi_asked_for()
        source.note_scene(self.renderers(), matrix)
        wanted = source.exact_request(renderer_view(renderer, matrix))
        made = source.source.GetCurrentRequest()
        same = made is not None and made.key == wanted.key
        return source.last() if same else source.source.MakeVDI(wanted)

    def values_asked_for(self) -> DeferredVDI | None:
        """Return the values that are classified, made now if they are not.

        ``None`` where there are none, or no view to make them of.
        """
        if self.input is None:
            return None
        self._look_for_view()
        return self.input.deferred

    def _look_for_view(self) -> tuple[Any, tuple[int, int], Any] | None:
        """Look at the scene between frames; return what the next picture sees the actor by."""
        source, actor, renderer = self.input, self._actor(), self.renderer()
        if source is None or actor is None:
            return None
        matrix = as_array(actor.GetMatrix())
        source.note_scene(self.renderers(), matrix)
        if renderer is None:
            return None
        seen = actor.camera_to_come(renderer), size_of(renderer), matrix
        if isinstance(source, SourceInput):
            return seen
        source.set_view_if_missing(*seen)
        if source.last() is None:
            source.look(camera_of(seen[0], matrix), self.device)
        return seen

    def vdi_to_pick(self, frame: Frame) -> VDI | None:
        """Return a VDI that has all of what a view shows; without the volume, that which is there.

        ``None`` where no picture was drawn yet.
        """
        vdi, view = self.vdi_asked_for(), frame.view
        if vdi is not None and view is not None and isinstance(self.input, SourceInput):
            shown = self.tell(ViewPicked(coverage(vdi, view.camera, view.size)), frame)
            return shown if isinstance(shown, VDI) else vdi
        return vdi

    def pick(self, actor: Any, renderer: Any, x: float, y: float) -> Pick | None:
        """Return what of an actor's VDI a renderer shows at a place of the window, in pixels."""
        kept = self.values_asked_for()
        return self._selection.pick(actor, renderer, x, y, self._first_hit, kept)

    @property
    def _first_hit(self) -> FirstHit:
        settings = self.state.settings
        return FirstHit.of(settings.picking_opacity, settings.picking_accumulated)

    def _select(self, mapper: Any, renderer: Any) -> None:
        """Draw what can be picked of what the last frame showed, or the first would show."""
        actor, selection = self._actor(), self._selection
        selection.enter(actor, renderer.GetSelector())
        seen = None
        try:
            frame = Frame.current(renderer, actor, mapper)
            vdi = self.vdi_to_pick(frame)
            if vdi is None:
                self._last = self._paint(mapper, renderer)
                vdi = self.vdi_to_pick(frame)
            if vdi is not None:
                seen = frame.showing(vdi, number_of(vdi))
            selection.show(actor, renderer, seen, self.device, self._first_hit)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            self._warnings.warn(f"the VDI cannot be picked: {type(error).__name__}: {error}", error)
            selection.show(actor, renderer, None, self.device, self._first_hit)
        self._no_depth.show(renderer.GetRenderWindow(), mapper)

    def beside(self, mapper: Any, renderer: Any, matrix: Matrix) -> Frame | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """

        def in_picture(mapper: Any, renderer: Any) -> Frame | None:
            bounds = None if self.input is None else self.input.bounds()
            frame = Frame.current(renderer, self._actor(), mapper, matrix)
            if bounds is None or frame.rectangle(bounds) is None:
                return None
            seen = self._showing(frame)
            return None if seen is None or seen.volume is not None else seen

        return self._guarded(in_picture, mapper, renderer)  # type: ignore[no-any-return]

    def renderer(self) -> Any:
        """Return the renderer that is drawing the actor; ``None`` if it has none."""
        renderers = self.renderers()
        if len(renderers) > 1:
            for candidate in renderers:
                self._watch(candidate)
            active = self._active.Get()
            if active in renderers:
                return active
            # The first frame that shows the actor twice: tell them apart by their windows, of which
            # one is drawing, and by their viewports
            drawing = [r for r in renderers if _is_drawing(r)]
            viewports = [r for r in drawing if _is_viewport(r)]
            renderers = viewports or drawing or renderers
        return renderers[0] if renderers else None

    def renderers(self) -> list[Any]:
        """Return all renderers that show the actor, by itself or as a part of an assembly."""
        there = consumers(self._actor())
        return list(dict.fromkeys(c for c in there if c.IsA("vtkRenderer")))

    def _watch(self, renderer: Any) -> None:
        """From now on, know which renderer is between its StartEvent and EndEvent."""
        if not self._watched.is_new(renderer):
            return
        active = self._active  # a VTK weak reference: no cycle through the observer
        renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
        renderer.AddObserver("EndEvent", lambda *_: active.Set(None))


def _is_drawing(renderer: Any) -> bool:
    window = renderer.GetRenderWindow()
    return window is not None and bool(window.CheckInRenderStatus())


def _is_viewport(renderer: Any) -> bool:
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    return viewport(renderer) == ((x[0], y[0]), (width[0], height[0]))
