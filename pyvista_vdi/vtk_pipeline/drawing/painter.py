"""Raycasts a VDI for exactly the frame that VTK is drawing, and hands VTK the image."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime, aligned_empty, get_runtime
from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError, VDIError
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF, FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification
from pyvista_vdi.raycasting.blend import blended
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.vtk_pipeline.drawing import passes
from pyvista_vdi.vtk_pipeline.drawing.box import Box
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.few_lists import FewLists
from pyvista_vdi.vtk_pipeline.drawing.frame import (
    Drawn,
    Frame,
    Image,
    Matrix,
    Recent,
    consumers,
    same_depth,
    viewport,
    volumes,
)
from pyvista_vdi.vtk_pipeline.drawing.grabbing import Grabbing
from pyvista_vdi.vtk_pipeline.drawing.overlap import Overlaps, touch
from pyvista_vdi.vtk_pipeline.drawing.selection import Selection
from pyvista_vdi.vtk_pipeline.drawing.shader import place_image
from pyvista_vdi.vtk_pipeline.drawing.texture import ImageTexture, NoDepth
from pyvista_vdi.vtk_pipeline.drawing.upkeep import Upkeep
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction.browser import SceneAtHand
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus, Warnings
from pyvista_vdi.vtk_pipeline.interaction.window_clock import (
    Interaction,
    Met,
    WindowClock,
    reduced,
)
from pyvista_vdi.vtk_pipeline.vtk import vtkVolume, vtkWeakReference

#: Frames per second that stand-ins keep where no rate is asked for: changes are followed by eye.
_STAND_IN_RATE = 30.0

#: What is said where another volume has the mapper.
_BEHIND_ANOTHER = (
    "VDIMapper draws only behind its own VDIActor, and is behind another volume: use VDIActor in "
    "place of vtkVolume, also for copies (VDIActor().ShallowCopy(actor))"
)


class Painter:
    """What happens behind a :class:`VDIMapper` while a frame is drawn.

    The mapper's observers call :meth:`begin` and :meth:`end`. It holds its actor weakly, so that
    nothing here keeps a scene alive.
    """

    def __init__(self) -> None:
        self.device: Any = None
        self.opacity_multiplier = 1.0
        self.transmittance_cutoff = TRANSMITTANCE_CUTOFF
        self.interaction = Interaction()
        self.texts = CornerTexts()
        self.image_distance = 1.0
        self.selection = Selection()
        self.box = Box()
        self._warnings = Warnings()
        self.upkeep = Upkeep(self.interaction, self._warnings, self.texts)
        self._actor = vtkWeakReference()
        self._active = vtkWeakReference()
        self._observed = Met()
        self._texture = ImageTexture()
        self._no_depth = NoDepth()
        self._few_lists = FewLists()
        self._drawn: Any = weakref.ref(self)  # what the images are of that are kept: of none yet
        self._counted: Any = self._drawn  # the VDI that was shown last
        self._generation = 0
        self._images: Recent[Drawn] = Recent()
        self._free: Image | None = None  # shown by no frame, not even the last
        self._raycasts = 0
        self._last = _nothing()
        self._scene: tuple[View, weakref.ref[WindowClock]] | None = None
        self._trouble: BaseException | None = None
        self._astray = False  # whether something else than the actor draws
        self._scene_at_hand = SceneAtHand(self._say_not_exported)

    def set_actor(self, actor: Any) -> None:
        """Remember whose matrix and renderers count."""
        other = self._actor.Get()
        if other is not None and other is not actor:
            raise InvalidArgumentError(
                "this VDIMapper is already behind another VDIActor: give each actor its own "
                "(the VDI itself can be shared)"
            )
        self._actor.Set(actor)

    def leave_actor(self, actor: Any) -> None:
        """Forget that actor, if it is this one."""
        if self._actor.Get() is actor:
            self._actor.Set(None)

    @property
    def actor(self) -> Any:
        """Whose matrix and renderers count; ``None`` if there is none."""
        return self._actor.Get()

    @property
    def input(self) -> Input | None:
        """What the VDI comes from."""
        return self.upkeep.input

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        weak = weakref.ref(self)

        def changed(*_: Any) -> None:
            painter = weak()
            if painter is not None:
                painter.box.connect()

        self.upkeep.set_input(source, changed)
        self.box.show(source)
        self._last = _nothing()

    @property
    def proxy(self) -> Any:
        """The image whose box VTK draws in place of the VDI."""
        return self.box.image

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

    def release(self) -> None:
        """Free the texture and the images kept, and end what goes on; a frame begins anew."""
        self.upkeep.close()
        self._few_lists.clear()
        self._texture.release()
        self._no_depth.release()
        self.selection.release()
        self._images.clear()
        self._free = None

    def take_settings(self, other: Painter) -> None:
        """Take over how dense another draws, what it allows and when it regenerates."""
        self.opacity_multiplier = other.opacity_multiplier
        self.image_distance = other.image_distance
        self.upkeep.draw = other.upkeep.draw
        self.upkeep.automatic_view = other.upkeep.automatic_view
        self.transmittance_cutoff = other.transmittance_cutoff
        vars(self.interaction).update(vars(other.interaction))
        mine, theirs = self.selection, other.selection
        mine.opacity, mine.accumulated = theirs.opacity, theirs.accumulated
        self.upkeep.regeneration.policy = other.upkeep.regeneration.policy
        self.upkeep.regeneration.bound = other.upkeep.regeneration.bound

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        vdi, last, view, fps = self.upkeep.vdi, self._last, None, None
        player = None if self.input is None else self.input.player
        if self._scene is not None:
            view, weak = self._scene
            clock = weak()
            fps = None if clock is None else clock.fps
        shown = None if vdi is None or view is None else (vdi, view.camera, view.size)
        wide, high = last.full_size or (0, 0)
        return VDIStatus(
            mode="none" if last.full_size is None else "preview" if last.preview else "full",
            samples=last.samples,
            full_samples=wide * high,
            fps=fps,
            angle=None if shown is None else angle_from_generating_view(*shown[:2]),
            magnification=None if shown is None else magnification(*shown),
            coverage=None if shown is None else coverage(*shown),
            ssim=self.upkeep.ssim(view),
            progress=self.upkeep.regeneration.progress,
            generation=self._generation,
            vdi=vdi,
            stand_in=last.stand_in,
            drawn=last.way,
            time=None if player is None else player.time,
        )

    def before_frame(self) -> None:
        """Take a VDI that was made in the background; between two frames of a window only."""
        if self.upkeep.collect():
            # Gone before the frame begins: freeing hundreds of megabytes takes its time
            self._images.clear()

    def runtime(self) -> Runtime:
        """Return the device that raycasts."""
        return get_runtime(self.device)

    def begin(self, mapper: Any) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        renderer = self.renderer()
        # Else a copy of the actor by vtkVolume.ShallowCopy draws, in another window
        self._astray = renderer is None or not _is_drawing(renderer)
        if self._astray:
            self._warnings.warn(_BEHIND_ANOTHER)
            self.box.place((0.0,) * 6)  # nothing is seen of it
            if self._actor.Get() is not None:  # whose shader the copy has
                place_image(self._actor.Get(), 0, (0, 0), (1, 1))
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if self.actor.GetProperty().GetIndependentComponents() else 4
        if self.box.components != components:
            self.box.give_components(components)
        if renderer.GetSelector() is not None:
            self._select(mapper, renderer)
            return
        names = passes.classes(renderer)
        for effect in passes.effects(names):
            self._warnings.warn(effect)
        peeled = passes.peels_volumes(renderer, names)
        if peeled and passes.shows_what_is_translucent(renderer):
            self._warnings.warn(passes.PEELED)
        occluded = "vtkSSAOPass" in names
        self.selection.leave(self._actor.Get(), occluded=occluded, peeled=peeled)
        with suppress(VDIError):  # which what is drawn says
            self.box.Update()
        self._last = self._guarded(self._paint, mapper, renderer) or self._last
        window, drawn = renderer.GetRenderWindow(), self._last
        clock = WindowClock.of(window)
        clock.showed(drawn.preview)
        clock.shared(Grabbing).join(self, window.GetInteractor())
        actor = self._actor.Get()
        unit = self._texture.show(window, drawn.image, drawn.number, smooth=drawn.smooth)
        place_image(actor, unit, *viewport(renderer))
        self._no_depth.show(window, mapper)
        self.texts.write(renderer, self.status)
        self.upkeep.tick(window)

    def end(self) -> None:
        """Release the texture unit."""
        if self._astray:
            self.box.Modified()  # it has its bounds again
        self._texture.let_go()
        self._no_depth.let_go()
        self.selection.texture.let_go()

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
                self._last = _nothing()
                with suppress(VDIError):
                    self.box.place(None if self.input is None else self.input.bounds())
            self._cannot_draw(error)
        return None

    def raise_trouble(self) -> None:
        """Raise, once, what a frame could not be drawn for: VTK's renderer lets nothing through."""
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble

    def _cannot_draw(self, error: Exception) -> None:
        self._warnings.warn(f"the VDI cannot be drawn: {type(error).__name__}: {error}", error)
        self._note(error)

    def _note(self, error: BaseException) -> None:
        """Keep the first error for :meth:`raise_trouble`, without the frames that it came from."""
        if self._trouble is None:
            self._trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None

    def _paint(self, mapper: Any, renderer: Any) -> Drawn:
        """Return the frame's image."""
        frame = self._frame(mapper, renderer)
        if frame is None:
            return self._last
        overlaps = frame.clock.shared(Overlaps)
        # A volume that stands in has no lists to be merged by
        part = overlaps.part(frame, _frames) if frame.stand_in is None else None
        if part is not None:
            return part
        frame = replace(frame, depth=frame.clock.shared(OpaqueDepths).read([frame]))
        frame = frame.coarser(self._size_at_rest(frame))
        drawn = self._kept(frame)
        if drawn is not None:
            return drawn  # however the frame is to be: where it is there, full costs nothing
        frame = self._preview(frame)
        return (self._kept(frame) if frame.preview else None) or self._raycast(frame)

    def _frame(self, mapper: Any, renderer: Any) -> Frame | None:
        """Return the frame of the VDI, brought up to date; ``None`` if there is no VDI."""
        frame = Frame.current(renderer, self._actor.Get(), mapper)
        frame.clock.join(self, renderer)
        self._scene = (frame.view, weakref.ref(frame.clock))
        shown = volumes(renderer)
        if any(each.GetMapper() is mapper and each is not frame.actor for each in shown):
            self._warnings.warn(_BEHIND_ANOTHER)
        joint = len(shown) > 1 and self._overlapped(frame, shown)
        seen = self.upkeep.current(frame, self.status, only=len(self.renderers()) == 1, joint=joint)
        if seen is None:
            return None
        self.box.place(seen.bounds)
        if seen is not self._drawn():
            self._images.clear()
            self._drawn = weakref.ref(seen)
        if isinstance(seen, VDI) and seen is not self._counted():
            self._counted = weakref.ref(seen)
            self._generation += 1
        return frame.showing(seen)

    def _overlapped(self, frame: Frame, shown: list[Any]) -> bool:
        """Whether one of the volumes that are shown is ours and lies where this one does."""
        rectangles: list[Matrix | None] = []
        for prop in shown:
            painter = getattr(prop.GetMapper(), "painter", None)
            source = painter.input if isinstance(painter, Painter) else None
            bounds = None if source is None or not prop.GetVisibility() else source.bounds()
            if bounds is not None:
                rectangle = Frame.current(frame.renderer, prop, None).rectangle(bounds)
                rectangles.insert(0 if painter is self else len(rectangles), rectangle)
        return any(touch(rectangles[0], other) for other in rectangles[1:])

    def beside(self, mapper: Any, renderer: Any) -> Frame | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """
        return self._guarded(self._frame_in_picture, mapper, renderer)  # type: ignore[no-any-return]

    def _frame_in_picture(self, mapper: Any, renderer: Any) -> Frame | None:
        actor = self._actor.Get()
        bounds = None if self.input is None else self.input.bounds()
        if actor is None or bounds is None:
            return None
        if Frame.current(renderer, actor, mapper).rectangle(bounds) is None:
            return None
        frame = self._frame(mapper, renderer)
        return None if frame is None or frame.stand_in is not None else frame

    def _select(self, mapper: Any, renderer: Any) -> None:
        """Draw what can be picked of what the last frame showed, or the first would show."""
        actor = self._actor.Get()
        self.selection.enter(actor, renderer.GetSelector())
        seen = None
        try:
            frame = Frame.current(renderer, actor, mapper)
            vdi = self.upkeep.to_pick(frame)
            if vdi is None:
                self._last = self._paint(mapper, renderer)
                vdi = self.upkeep.to_pick(frame)
            if vdi is not None:
                seen = frame.showing(vdi)
            self.selection.show(actor, renderer, seen, self.device)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            self._warnings.warn(f"the VDI cannot be picked: {type(error).__name__}: {error}", error)
            self.selection.show(actor, renderer, None, self.device)
        self._no_depth.show(renderer.GetRenderWindow(), mapper)

    def _preview(self, frame: Frame) -> Frame:
        """Return the frame as it is drawn now: with all pixels, or with fewer, of fewer lists."""
        few = frame
        if frame.vdi is not None and frame.clock.few_lists(self.interaction):
            lists = self._few_lists.get(frame.vdi, frame.view.camera, self.device)
            few = replace(frame, few_lists=lists)
        size = self.preview_size(few)
        return (frame if size == frame.full_size else few).coarser(size)

    def preview_size(self, frame: Frame) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        width, height = frame.full_size
        floor = min(1.0, 1 / frame.mapper.GetMaximumImageSampleDistance() ** 2)
        if frame.stand_in is None or frame.stand_in.lasting:
            share = frame.clock.share(
                frame.renderer,
                self.interaction,
                width * height,
                floor,
                frame.cost,
                effort=frame.effort,
                expected=self._expected(frame),
            )
        elif self._may_be_coarse(frame):
            rate = self.interaction.target or _STAND_IN_RATE
            share = max(frame.stand_in.share(rate, width * height), floor)
        else:
            share = 1.0
        return reduced(frame.full_size, min(share, 1 / self.image_distance**2))

    def _expected(self, frame: Frame) -> float | None:
        """Return the seconds that a full picture of the volume is expected to take."""
        each = self.upkeep.ways.seconds_per_pixel("volume", 0.0)
        if frame.way != "volume" or each is None:
            return None
        return each * frame.covered(frame.bounds)

    def _size_at_rest(self, frame: Frame) -> tuple[int, int]:
        return reduced(frame.full_size, 1 / self.image_distance**2)

    def _may_be_coarse(self, frame: Frame) -> bool:
        """Whether a stand-in, which is soon replaced, may be drawn with few rays."""
        allowed = self.interaction.adjust and self.interaction.target != 0
        return allowed and not frame.clock.takes_picture(frame.renderer)

    def _kept(self, frame: Frame) -> Drawn | None:
        """Return the image of exactly this frame, if there is one."""
        drawn = self._images.get(frame.key)
        return drawn if drawn is not None and same_depth(drawn.depth, frame.depth) else None

    def _raycast(self, frame: Frame) -> Drawn:
        """Return the image, and keep it; the memory of one that goes is for the next raycast."""
        before = time.perf_counter()
        pixels = self._pixels(frame.size)
        width, height = frame.size
        out = pixels[: height * width * 4].reshape(height, width, 4)
        request = FrameRequest(
            frame.camera, frame.size, frame.options, frame.depth, self.device, out
        )
        if frame.stand_in is not None:
            # In a window the VDI's light, so that nothing jumps
            behind = self.interaction.asynchronous(frame.renderer.GetRenderWindow())
            lasts = frame.stand_in.lasting and (self.upkeep.draw == "volume" or not behind)
            image = frame.stand_in.picture(request, frame.view.camera if lasts else None)
        else:
            assert frame.vdi is not None
            parts = self.upkeep.blended_parts(frame.vdi) if frame.few_lists is None else []
            if parts:
                image = blended(parts, request)
            else:
                image = render_vdi(frame.few_lists or frame.vdi, request)
        seconds = time.perf_counter() - before
        if frame.stand_in is not None:
            frame.stand_in.took(width * height, seconds)
        if frame.stand_in is None or frame.stand_in.lasting:
            frame.clock.drawn(frame.size, frame.full_size, seconds, frame.cost, frame.effort)
        # A volume's first picture has kernels compiled and voxels sent to the device
        if frame.few_lists is None and (frame.stand_in is None or frame.stand_in.pictures > 1):
            self.upkeep.ways.took(frame.way, frame.angle, frame.covered(frame.bounds), seconds)
        self._raycasts += 1
        drawn = Drawn(
            image,
            frame.full_size,
            frame.depth,
            self._raycasts,
            stand_in=frame.stand_in is not None and not frame.stand_in.lasting,
            way=frame.way,
            pixels=pixels,
        )
        gone = self._images.keep(frame.key, drawn)
        if gone is not None:
            self._free = gone.pixels
        return drawn

    def _pixels(self, size: tuple[int, int]) -> Image:
        """Return memory for an image of this size, 1D and maybe longer: what is free, if it does.

        Fresh memory costs a page fault for every 4096 bytes that are written.
        """
        wanted = size[0] * size[1] * 4
        free, self._free = self._free, None
        return aligned_empty(wanted, np.float32) if free is None or free.size < wanted else free

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
        there = consumers(self._actor.Get())
        return list(dict.fromkeys(c for c in there if c.IsA("vtkRenderer")))

    def _watch(self, renderer: Any) -> None:
        """From now on, know which renderer is between its StartEvent and EndEvent."""
        if not self._observed.is_new(renderer):
            return
        active = self._active  # a VTK weak reference: no cycle through the observer
        renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
        renderer.AddObserver("EndEvent", lambda *_: active.Set(None))


def _nothing() -> Drawn:
    """Return what a frame shows of which nothing can be drawn."""
    return Drawn(np.zeros((1, 1, 4), dtype=np.float32))


def _is_drawing(renderer: Any) -> bool:
    window = renderer.GetRenderWindow()
    return window is not None and bool(window.CheckInRenderStatus())


def _is_viewport(renderer: Any) -> bool:
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    return viewport(renderer) == ((x[0], y[0]), (width[0], height[0]))


def _frames(own: Frame) -> list[Frame]:
    """Return what the renderer shows of VDIs in this frame, in its order."""
    frames = []
    props = own.renderer.GetViewProps()
    for i in range(props.GetNumberOfItems()):
        prop = props.GetItemAsObject(i)
        if prop is own.actor:
            frames.append(own)
            continue
        mapper = prop.GetMapper() if isinstance(prop, vtkVolume) and prop.GetVisibility() else None
        painter = getattr(mapper, "painter", None)
        frame = painter.beside(mapper, own.renderer) if isinstance(painter, Painter) else None
        if frame is not None:
            frames.append(frame)
    return frames
