"""Raycasts a VDI for exactly the frame that VTK is drawing, and hands VTK the image."""

from __future__ import annotations

import logging
import warnings
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkWeakReference
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingOpenGL2 import vtkTextureObject

from pyvista_vdi.errors import DeviceError, InvalidArgumentError, UnsupportedError, VDIWarning
from pyvista_vdi.raycast import render_vdi
from pyvista_vdi.vdi import VDI
from pyvista_vdi.vtk_pipeline.frame import Frame, as_array
from pyvista_vdi.vtk_pipeline.inputs import Input

#: Images kept: two eyes, and two more for other renderers or a picking pass.
_KEPT_IMAGES = 4

_log = logging.getLogger(__name__)

Image = NDArray[np.float32]


class Painter:
    """What happens behind a :class:`VDIMapper` while a frame is drawn.

    The mapper's observers call :meth:`begin` and :meth:`end`. It holds its actor weakly, so that
    nothing here keeps a scene alive.
    """

    def __init__(self) -> None:
        self.input: Input | None = None
        self.device: Any = None
        self.automatic_view = True
        self.proxy = make_proxy()
        self._actor = vtkWeakReference()
        self._active = vtkWeakReference()
        self._observed: set[str] = set()
        self._texture: Any = None
        self._uploaded: int | None = None
        self._drawn: VDI | None = None
        self._images: dict[Any, tuple[NDArray[np.float32] | None, Image, int]] = {}
        self._raycasts = 0
        self._last: Image = np.zeros((1, 1, 4), dtype=np.float32)
        self._warned: set[str] = set()
        self._failed_at: Any = None

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

    def set_input(self, source: Input | None) -> None:
        """Draw another VDI, and show its bounds to VTK at once."""
        bounds = None if source is None else source.bounds()  # refuses what is no VDI
        if self.input is not None:
            self.input.watch(None)
        self.input = source
        self._failed_at = None
        if source is not None:
            source.watch(_refresher(weakref.ref(self)))
        if bounds is not None:
            place_proxy(self.proxy, bounds)

    def refresh_bounds(self) -> None:
        """Give the proxy the bounds of what will be drawn."""
        bounds = None if self.input is None else self.input.bounds()
        if bounds is not None:
            place_proxy(self.proxy, bounds)

    def release(self) -> None:
        """Free the texture and the images kept; another frame makes them anew."""
        if self._texture is not None:
            window = self._texture.GetContext()
            if window is not None:
                self._texture.ReleaseGraphicsResources(window)
            self._texture = None
        self._uploaded = None
        self._images.clear()

    def retry(self) -> None:
        """Try again what failed before."""
        self._failed_at = None
        self._warned.clear()

    # -- a frame ---------------------------------------------------------------------------------

    def begin(self, mapper: Any) -> None:
        """Raycast and upload the image for the frame that has just begun."""
        renderer = self.renderer()
        if renderer is None:
            self._warn("VDIMapper draws only behind a VDIActor: use VDIActor in place of vtkVolume")
            return
        image, number = self._last, None
        try:
            image, number = self._paint(mapper, renderer)
            self._last = image
        except KeyboardInterrupt:
            self._warn(
                "generating the VDI was interrupted: what was shown stays; call "
                "actor.regenerate() to try again"
            )
        except Exception as error:  # VTK would swallow it
            self._warn(f"the VDI cannot be drawn: {type(error).__name__}: {error}")
            _log.debug("while drawing a VDI", exc_info=True)
        self._upload(renderer.GetRenderWindow(), image, number)

    def end(self) -> None:
        """Let go of the texture unit."""
        if self._texture is not None:
            self._texture.Deactivate()

    def _paint(self, mapper: Any, renderer: Any) -> tuple[Image, int | None]:
        """Return the frame's image and its number, by which an upload is known."""
        actor = self._actor.Get()
        model_transform = as_array(actor.GetMatrix())
        frame = Frame.current(renderer, model_transform)
        vdi = self._current_vdi(renderer, model_transform)
        if vdi is None:
            return self._last, None
        place_proxy(self.proxy, vdi.bounds)
        if mapper.GetCropping():
            raise UnsupportedError(
                "cropping (CroppingOn) is not honoured: use clipping planes (AddClippingPlane)"
            )
        planes = frame.clipping_planes(mapper.GetClippingPlanes(), vdi.bounds)
        depth = None
        if frame.sees_opaque_before(renderer, actor, vdi.bounds):
            depth = frame.opaque_depth(renderer)
            if np.isposinf(depth).all():
                depth = None
        if vdi is not self._drawn:
            self._images.clear()
            self._drawn = vdi
        key = (frame.camera, frame.size, None if planes is None else planes.tobytes())
        kept = self._images.get(key)
        if kept is not None and _same(kept[0], depth):
            return kept[1], kept[2]
        image = render_vdi(
            vdi,
            frame.camera,
            frame.size,
            opaque_depth=depth,
            clipping_planes=planes,
            device=self.device,
        )
        image = np.ascontiguousarray(image[::-1])  # a texture's first row is the bottom one
        self._images.pop(key, None)
        self._raycasts += 1
        self._images[key] = (depth, image, self._raycasts)
        while len(self._images) > _KEPT_IMAGES:
            del self._images[next(iter(self._images))]
        return image, self._raycasts

    def _current_vdi(self, renderer: Any, model_transform: NDArray[np.float64]) -> VDI | None:
        """Bring the input up to date, but do not repeat what failed until something changes."""
        if self.input is None:
            return None
        if self.automatic_view:
            self.input.set_view_if_missing(renderer, model_transform)
        stamp = self.input.stamp()
        if self._failed_at == stamp:
            return self.input.last()
        try:
            vdi = self.input.vdi()
        except BaseException:
            self._failed_at = self.input.stamp()
            raise
        self._failed_at = None
        return vdi

    def _upload(self, window: Any, image: Image, number: int | None) -> None:
        if self._texture is None:
            self._texture = vtkTextureObject()
            self._texture.SetMinificationFilter(vtkTextureObject.Nearest)
            self._texture.SetMagnificationFilter(vtkTextureObject.Nearest)
            self._texture.SetWrapS(vtkTextureObject.ClampToEdge)
            self._texture.SetWrapT(vtkTextureObject.ClampToEdge)
        texture = self._texture
        if texture.GetContext() is not window:
            texture.SetContext(window)
            self._uploaded = None
        if number is None or number != self._uploaded or texture.GetHandle() == 0:
            height, width = image.shape[:2]
            texture.Create2DFromRaw(width, height, 4, VTK_FLOAT, image)
            self._uploaded = number
        texture.Activate()
        # The sampler of the actor's shader keeps its default, unit 0: see actor.py
        if texture.GetTextureUnit() != 0:
            unit = texture.GetTextureUnit()
            texture.Deactivate()
            self._warn(
                f"the VDI cannot be drawn: {DeviceError.__name__}: OpenGL gave its image texture "
                f"unit {unit} in place of 0; another object leaves a texture active"
            )

    # -- which renderer --------------------------------------------------------------------------

    def renderer(self) -> Any:
        """Return the renderer that is drawing the actor; ``None`` if it has none."""
        actor = self._actor.Get()
        if actor is None:
            return None
        consumers = [actor.GetConsumer(i) for i in range(actor.GetNumberOfConsumers())]
        renderers = [c for c in consumers if c is not None and c.IsA("vtkRenderer")]
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

    def _watch(self, renderer: Any) -> None:
        """From now on, know which renderer is between its StartEvent and EndEvent."""
        address = renderer.GetAddressAsString("")
        if address in self._observed:
            return
        self._observed.add(address)
        active = self._active  # a VTK weak reference: no cycle through the observer
        renderer.AddObserver("StartEvent", lambda caller, _: active.Set(caller))
        renderer.AddObserver("EndEvent", lambda *_: active.Set(None))

    def _warn(self, message: str) -> None:
        """Say it once; an exception here would never reach the user."""
        if message in self._warned:
            return
        self._warned.add(message)
        try:
            warnings.warn(message, VDIWarning, stacklevel=3)
        except VDIWarning:  # warnings are errors: the log is what is left
            _log.error(message)


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


def place_proxy(proxy: vtkImageData, bounds: tuple[float, ...]) -> None:
    """Give the proxy these bounds, model frame."""
    low, high = np.asarray(bounds[::2]), np.asarray(bounds[1::2])
    spacing = np.maximum(high - low, np.finfo(np.float32).tiny)
    proxy.SetOrigin(*low)
    proxy.SetSpacing(*spacing)


def _is_viewport(renderer: Any) -> bool:
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    viewport = [0, 0, 0, 0]
    renderer.GetRenderWindow().GetState().vtkglGetIntegerv(0x0BA2, viewport)
    return viewport == [x[0], y[0], width[0], height[0]]


def _same(a: NDArray[np.float32] | None, b: NDArray[np.float32] | None) -> bool:
    if a is None or b is None:
        return a is b
    return np.array_equal(a, b)
