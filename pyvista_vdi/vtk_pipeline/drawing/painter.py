"""Raycasts a VDI for exactly the frame that VTK is drawing, and hands VTK the image."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkWeakReference
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkVolume

from pyvista_vdi.device import Runtime, aligned_empty, get_runtime
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import angle_from_generating_view
from pyvista_vdi.raycasting.raycast import TRANSMITTANCE_CUTOFF, render_vdi
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, as_array, rectangle, sampled, viewport
from pyvista_vdi.vtk_pipeline.drawing.overlap import Overlaps, Sight, same_depth
from pyvista_vdi.vtk_pipeline.drawing.selection import Seen, Selection
from pyvista_vdi.vtk_pipeline.drawing.shader import place_image
from pyvista_vdi.vtk_pipeline.drawing.texture import ImageTexture, NoDepth
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.interaction.motion import Interaction, WindowClock, reduced
from pyvista_vdi.vtk_pipeline.interaction.status import CornerTexts, VDIStatus
from pyvista_vdi.vtk_pipeline.interaction.upkeep import Scene, Upkeep
from pyvista_vdi.vtk_pipeline.interaction.warnings import Voice

#: Images kept: two eyes, and two more for other renderers or a picking pass.
_KEPT_IMAGES = 4

Image = NDArray[np.float32]


@dataclass(frozen=True)
class Task:
    """An image to be raycast.

    Attributes
    ----------
    frame : Frame
        The view, and the image's size.
    planes : numpy.ndarray or None
        Clipping planes in the frame's world, (k, 6).
    depth : numpy.ndarray or None
        View depth at which rays end, float32 (H, W), top row first.
    full_size : (int, int)
        Width and height of the viewport in pixels; the image of a preview is smaller.
    cropping : Cropping or None
        Regions of the model frame that are drawn.
    opacity_multiplier : float
        Factor of the extinction.
    transmittance_cutoff : float
        Rays end where less light than this is left.
    """

    frame: Frame
    planes: NDArray[np.float64] | None
    depth: NDArray[np.float32] | None
    full_size: tuple[int, int]
    cropping: Cropping | None = None
    opacity_multiplier: float = 1.0
    transmittance_cutoff: float = TRANSMITTANCE_CUTOFF

    @property
    def key(self) -> Any:
        """What its image is known by; the quality is in it as the two sizes."""
        planes = None if self.planes is None else self.planes.tobytes()
        looks = (self.cropping, self.opacity_multiplier, self.transmittance_cutoff)
        return (self.frame.camera, self.frame.size, self.full_size, planes, looks)

    @property
    def preview(self) -> bool:
        """Whether the image is to have fewer pixels than the viewport."""
        return self.frame.size != self.full_size


@dataclass(frozen=True)
class Drawn:
    """An image, premultiplied RGBA, float32 (H, W, 4), top row first.

    Attributes
    ----------
    image : numpy.ndarray
        The pixels.
    task : Task or None
        What it was raycast for; ``None`` for the empty image before the first.
    number : int or None
        By which an upload is known.
    joint : bool
        Whether it is a part of a picture that other actors show the rest of.
    pixels : numpy.ndarray or None
        The memory that the image begins, 1D: another image may be raycast into it when this one is
        kept no longer.
    """

    image: Image
    task: Task | None = None
    number: int | None = None
    joint: bool = False
    pixels: Image | None = None

    @property
    def preview(self) -> bool:
        """Whether it has fewer pixels than the viewport."""
        return self.task is not None and self.task.preview

    @property
    def smooth(self) -> bool:
        """Whether its pixels are interpolated: not where the neighbours are another actor's."""
        return self.preview and not self.joint


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
        self.selection = Selection()
        self.proxy = make_proxy()
        self._voice = Voice()
        self.upkeep = Upkeep(self.interaction, self._voice, self.texts)
        self._actor = vtkWeakReference()
        self._active = vtkWeakReference()
        self._observed: set[str] = set()
        self._texture = ImageTexture()
        self._no_depth = NoDepth()
        self._drawn: Any = weakref.ref(self)  # the VDI whose images are kept: none yet
        self._generation = 0
        self._images: dict[Any, Drawn] = {}
        self._free: Image | None = None  # shown by no frame, not even the last
        self._raycasts = 0
        self._last = Drawn(np.zeros((1, 1, 4), dtype=np.float32))
        self._scene: tuple[Camera, weakref.ref[WindowClock]] | None = None
        self._trouble: BaseException | None = None

    # -- what is drawn ---------------------------------------------------------------------------

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
    def input(self) -> Input | None:
        """What the VDI comes from."""
        return self.upkeep.input

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        bounds = None if source is None else source.bounds()  # refuses what is no VDI
        self.upkeep.set_input(source, _refresher(weakref.ref(self)))
        if bounds is not None:
            place_proxy(self.proxy, bounds)

    def refresh_bounds(self) -> None:
        """Give the proxy the bounds of what will be drawn."""
        bounds = None if self.input is None else self.input.bounds()
        if bounds is not None:
            place_proxy(self.proxy, bounds)

    def say_not_exported(self) -> None:
        """Say once that a scene which is written for another renderer lacks the VDI."""
        self._voice.warn(
            "the scene is being exported without its VDI: export_html, export_vtksz and views that "
            "are rendered in the browser (client-side) get an empty box in its place; use "
            "screenshots, movies, or server-side rendering"
        )

    def release(self) -> None:
        """Free the texture and the images kept, and end what goes on; a frame begins anew."""
        self.upkeep.close()
        self._texture.release()
        self._no_depth.release()
        self.selection.release()
        self._images.clear()
        self._free = None

    def take_settings(self, other: Painter) -> None:
        """Take over how dense another draws, what it allows and when it regenerates."""
        self.opacity_multiplier = other.opacity_multiplier
        self.transmittance_cutoff = other.transmittance_cutoff
        vars(self.interaction).update(vars(other.interaction))
        self.selection.take_settings(other.selection)
        self.upkeep.regeneration.policy = other.upkeep.regeneration.policy
        self.upkeep.regeneration.bound = other.upkeep.regeneration.bound

    def status(self) -> VDIStatus:
        """Return how the last frame was drawn, and what goes on."""
        vdi, task, angle, fps = self.upkeep.vdi, self._last.task, None, None
        if self._scene is not None:
            camera, weak = self._scene
            clock = weak()
            fps = None if clock is None else clock.fps
            angle = None if vdi is None else angle_from_generating_view(vdi, camera)
        width, height = (0, 0) if task is None else task.frame.size
        wide, high = (0, 0) if task is None else task.full_size
        return VDIStatus(
            mode="none" if task is None else "preview" if task.preview else "full",
            samples=width * height,
            full_samples=wide * high,
            fps=fps,
            angle=angle,
            ssim=self.upkeep.regeneration.ssim(vdi),
            progress=self.upkeep.regeneration.progress,
            generation=self._generation,
            vdi=vdi,
        )

    # -- a frame ---------------------------------------------------------------------------------

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
        if renderer is None:
            self._voice.warn(
                "VDIMapper draws only behind a VDIActor: use VDIActor in place of vtkVolume"
            )
            return
        if renderer.GetSelector() is not None:
            self._select(mapper, renderer)
            return
        self.selection.leave(self._actor.Get())
        self._last = self._guarded(self._paint, mapper, renderer) or self._last
        window, drawn = renderer.GetRenderWindow(), self._last
        WindowClock.of(window).showed(drawn.preview)
        try:
            self._texture.show(window, drawn.image, drawn.number, smooth=drawn.smooth)
            self._no_depth.show(window, mapper)
            place_image(self._actor.Get(), *viewport(renderer))
        except DeviceError as error:
            self._cannot_draw(error)
        self.texts.write(renderer, self.status)
        self.upkeep.tick(window)

    def end(self) -> None:
        """Let go of the texture unit."""
        self._texture.let_go()
        self._no_depth.let_go()
        self.selection.let_go()

    def _guarded(self, draw: Callable[[Any, Any], Any], mapper: Any, renderer: Any) -> Any:
        """Return what a part of drawing returns, or ``None`` and say what went wrong."""
        try:
            return draw(mapper, renderer)
        except KeyboardInterrupt as interrupt:
            self._voice.warn(
                "generating the VDI was interrupted: what was shown stays; call "
                "actor.regenerate() to try again"
            )
            self._note(interrupt)
        except Exception as error:  # VTK would swallow it
            self._cannot_draw(error)
        return None

    def raise_trouble(self) -> None:
        """Raise, once, what a frame could not be drawn for: nothing passes through VTK's renderer.

        Raises
        ------
        KeyboardInterrupt, Exception
            The first such error since the last call.
        """
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble

    def _cannot_draw(self, error: Exception) -> None:
        self._voice.warn(f"the VDI cannot be drawn: {type(error).__name__}: {error}", error)
        self._note(error)

    def _note(self, error: BaseException) -> None:
        """Keep the first error for :meth:`raise_trouble`, without the frames that it came from."""
        if self._trouble is None:
            self._trouble = error.with_traceback(None)
            error.__cause__ = error.__context__ = None

    def _paint(self, mapper: Any, renderer: Any) -> Drawn:
        """Return the frame's image."""
        sight = self._sight(mapper, renderer)
        if sight is None:
            return self._last
        part = Overlaps.of(sight.clock).part(sight, renderer, _sights)
        if part is not None:
            return Drawn(
                part.image, Task(part.frame, None, None, part.full_size), part.number, joint=True
            )
        vdi, frame, clock = sight.vdi, sight.frame, sight.clock
        depth = OpaqueDepths.of(clock).read(renderer, [(frame, vdi.bounds)])
        looks = {**sight.looks, "transmittance_cutoff": self.transmittance_cutoff}
        task = Task(frame, sight.planes, depth, frame.size, **looks)
        drawn = self._kept(task)
        if drawn is not None:
            return drawn  # however the frame is to be: where it is there, full costs nothing
        size = self.preview_size(mapper, renderer, clock, frame.size)
        if size == frame.size:
            return self._raycast(vdi, task, clock)
        sight = sight.coarser(size)
        depth = None if depth is None else sampled(depth, size)
        task = Task(sight.frame, sight.planes, depth, task.full_size, **looks)
        return self._kept(task) or self._raycast(vdi, task, clock)

    def _sight(self, mapper: Any, renderer: Any) -> Sight | None:
        """Return the VDI as the frame is to show it, brought up to date; ``None`` if none is."""
        actor = self._actor.Get()
        clock = WindowClock.of(renderer.GetRenderWindow())
        clock.join(self, renderer)
        model_transform = as_array(actor.GetMatrix())
        frame = Frame.current(renderer, model_transform)
        view = _view_of(renderer, model_transform, frame)
        self._scene = (view.camera, weakref.ref(clock))
        only = len(self.renderers()) == 1
        looks = self._looks(mapper)
        shown = {"clipping_planes": self._world_planes(mapper, frame), **looks}
        scene = Scene(renderer, model_transform, view, clock, only, shown)
        vdi = self.upkeep.current(scene, self.status)
        if vdi is None:
            return None
        place_proxy(self.proxy, vdi.bounds)
        if vdi is not self._drawn():
            self._images.clear()
            self._drawn = weakref.ref(vdi)
            self._generation += 1
        return Sight(self, mapper, actor, frame, clock, vdi, looks)

    def beside(self, mapper: Any, renderer: Any) -> Sight | None:
        """Return the VDI as it is to be seen beside another one; ``None`` if it is not.

        Never raises. What is out of the picture is not brought up to date.
        """
        return self._guarded(self._sight_in_picture, mapper, renderer)  # type: ignore[no-any-return]

    def _sight_in_picture(self, mapper: Any, renderer: Any) -> Sight | None:
        actor = self._actor.Get()
        bounds = None if self.input is None else self.input.bounds()
        if actor is None or bounds is None:
            return None
        if rectangle(Frame.current(renderer, as_array(actor.GetMatrix())), bounds) is None:
            return None
        return self._sight(mapper, renderer)

    def _looks(self, mapper: Any) -> dict[str, Any]:
        """Return the cropping and the opacity multiplier, arguments of whatever raycasts."""
        return {
            "cropping": Cropping.from_any(mapper),
            "opacity_multiplier": self.opacity_multiplier,
        }

    def _world_planes(self, mapper: Any, frame: Frame) -> NDArray[np.float64] | None:
        """Return what cuts the VDI made last, world coordinates: for the estimate of its error."""
        vdi = self.upkeep.vdi
        if vdi is None:
            return None
        return frame.in_world(frame.clipping_planes(mapper.GetClippingPlanes(), vdi.bounds))

    def _select(self, mapper: Any, renderer: Any) -> None:
        """Draw what can be picked of what the last frame showed, or the first would show."""
        actor, selector = self._actor.Get(), renderer.GetSelector()
        window = renderer.GetRenderWindow()
        self.selection.enter(actor, selector)
        seen = None
        try:
            if not isinstance(self._drawn(), VDI):
                self._last = self._paint(mapper, renderer)
            vdi = self._drawn()
            if isinstance(vdi, VDI):
                frame = Frame.current(renderer, as_array(actor.GetMatrix()))
                planes = frame.clipping_planes(mapper.GetClippingPlanes(), vdi.bounds)
                seen = Seen(vdi, frame, planes, self._looks(mapper))
            self.selection.show(window, selector, seen, self.device)
        except (Exception, KeyboardInterrupt) as error:  # VTK would swallow it
            self._voice.warn(f"the VDI cannot be picked: {type(error).__name__}: {error}", error)
            self.selection.show(window, selector, None, self.device)
        self._no_depth.show(window, mapper)

    def preview_size(
        self, mapper: Any, renderer: Any, clock: WindowClock, full: tuple[int, int]
    ) -> tuple[int, int]:
        """Return the size of this frame's image: that of the viewport, or less."""
        floor = min(1.0, 1 / mapper.GetMaximumImageSampleDistance() ** 2)
        return reduced(full, clock.share(renderer, self.interaction, full[0] * full[1], floor))

    def _kept(self, task: Task) -> Drawn | None:
        """Return the image of exactly this view, if there is one."""
        drawn = self._images.get(task.key)
        if drawn is None or drawn.task is None or not same_depth(drawn.task.depth, task.depth):
            return None
        return drawn

    def _raycast(self, vdi: VDI, task: Task, clock: WindowClock) -> Drawn:
        """Return the image, and keep it."""
        before = time.perf_counter()
        pixels = self._pixels(task.frame.size)
        width, height = task.frame.size
        image = render_vdi(
            vdi,
            task.frame.camera,
            task.frame.size,
            opaque_depth=task.depth,
            clipping_planes=task.planes,
            cropping=task.cropping,
            opacity_multiplier=task.opacity_multiplier,
            transmittance_cutoff=task.transmittance_cutoff,
            device=self.device,
            out=pixels[: height * width * 4].reshape(height, width, 4),
        )
        clock.drawn(task.frame.size, task.full_size, time.perf_counter() - before)
        self._raycasts += 1
        drawn = Drawn(image, task, self._raycasts, pixels=pixels)
        self._keep(task.key, drawn)
        return drawn

    def _keep(self, key: Any, drawn: Drawn) -> None:
        """Keep an image; the memory of one that goes is for the next raycast."""
        gone = self._images.pop(key, None)
        self._images[key] = drawn
        if len(self._images) > _KEPT_IMAGES:
            gone = self._images.pop(next(iter(self._images)))
        if gone is not None:
            self._free = gone.pixels

    def _pixels(self, size: tuple[int, int]) -> Image:
        """Return memory for an image of this size, 1D and maybe longer: what is free, if it does.

        Fresh memory costs a page fault for every 4096 bytes that are written.
        """
        wanted = size[0] * size[1] * 4
        free, self._free = self._free, None
        return aligned_empty(wanted, np.float32) if free is None or free.size < wanted else free

    # -- which renderer --------------------------------------------------------------------------

    def renderer(self) -> Any:
        """Return the renderer that is drawing the actor; ``None`` if it has none."""
        renderers = self.renderers()
        if len(renderers) > 1:
            for candidate in renderers:
                self._watch(candidate)
            active = self._active.Get()
            if active in renderers:
                return active
            # The first frame that shows the actor twice: tell them apart by their viewports
            drawing = [r for r in renderers if r.GetRenderWindow() is not None and _is_viewport(r)]
            renderers = drawing or renderers
        return renderers[0] if renderers else None

    def renderers(self) -> list[Any]:
        """Return all renderers that show the actor."""
        actor = self._actor.Get()
        if actor is None:
            return []
        consumers = [actor.GetConsumer(i) for i in range(actor.GetNumberOfConsumers())]
        return [c for c in consumers if c is not None and c.IsA("vtkRenderer")]

    def _watch(self, renderer: Any) -> None:
        """From now on, know which renderer is between its StartEvent and EndEvent."""
        address = renderer.GetAddressAsString("")
        if address in self._observed:
            return
        self._observed.add(address)
        active = self._active  # a VTK weak reference: no cycle through the observer
        renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
        renderer.AddObserver("EndEvent", lambda *_: active.Set(None))


def _refresher(weak: weakref.ref[Painter]) -> Callable[..., None]:
    """Return an observer that does not keep the painter alive."""

    def refresh(*_: Any) -> None:
        painter = weak()
        if painter is not None:
            painter.refresh_bounds()

    return refresh


def make_proxy() -> vtkImageData:
    """Return the 2 x 2 x 2 image whose box VTK draws in place of the VDI."""
    proxy = vtkImageData()
    proxy.SetDimensions(2, 2, 2)
    proxy.AllocateScalars(3, 1)  # VTK_UNSIGNED_CHAR
    proxy.GetPointData().GetScalars().Fill(0)
    return proxy


def make_proxy_rgba(proxy: vtkImageData) -> None:
    """Give the proxy four components, which VTK asks of a property of dependent ones."""
    proxy.AllocateScalars(3, 4)  # VTK_UNSIGNED_CHAR
    proxy.GetPointData().GetScalars().Fill(0)


def place_proxy(proxy: vtkImageData, bounds: tuple[float, ...]) -> None:
    """Give the proxy these bounds, model frame."""
    low, high = np.asarray(bounds[::2]), np.asarray(bounds[1::2])
    spacing = np.maximum(high - low, np.finfo(np.float32).tiny)
    proxy.SetOrigin(*low)
    proxy.SetSpacing(*spacing)


def _is_viewport(renderer: Any) -> bool:
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    return viewport(renderer) == ((x[0], y[0]), (width[0], height[0]))


def _sights(own: Sight, renderer: Any) -> list[Sight]:
    """Return what the renderer shows of VDIs in this frame, in its order."""
    sights = []
    props = renderer.GetViewProps()
    for i in range(props.GetNumberOfItems()):
        prop = props.GetItemAsObject(i)
        if prop is own.actor:
            sights.append(own)
            continue
        mapper = prop.GetMapper() if isinstance(prop, vtkVolume) and prop.GetVisibility() else None
        painter = getattr(mapper, "painter", None)
        sight = painter.beside(mapper, renderer) if isinstance(painter, Painter) else None
        if sight is not None:
            sights.append(sight)
    return sights


def _view_of(renderer: Any, model_transform: NDArray[np.float64], frame: Frame) -> View:
    """Return the renderer's view, between the two eyes of a stereo pair if there are."""
    try:
        return View.of(renderer, model_transform)
    except UnsupportedError:  # a shear, an off-axis projection: drawn all the same
        return View(frame.camera, frame.size)
