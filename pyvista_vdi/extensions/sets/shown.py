"""What a mapper draws of a set: the VDIs nearest to the view, others decoded ahead, more made."""

from __future__ import annotations

import threading
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError
from pyvista_vdi.extensions.series.player import MEMORY, ON_DEVICE, Decoding, bring
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input

#: How many of the VDIs nearest to a view are decoded.
_AHEAD = 8
#: Degrees by which a view must have turned, or come nearer, until another is looked at to grow.
_MOVED = 1.0


class SetInput(Input):
    """The VDI of a set that is nearest to the view, or a blend of several.

    :meth:`look` is told where the thread that draws looks from, and :meth:`advance` is called
    between two frames. Another thread decodes what is nearest to the view, and brings it to the
    device, as far as there is memory; a third makes VDIs of views that do not reach the set's
    target.
    """

    collection: VDISet

    def __init__(self, vdi_set: VDISet) -> None:
        super().__init__()
        self.collection = vdi_set
        self.memory: float = MEMORY
        self._device: Any = None
        self._view: Camera = vdi_set.cameras[0]
        self._weights = vdi_set.weights(self._view)
        self._lock = threading.Lock()
        self._ready: dict[int, VDI] = {}
        self._bytes: dict[int, float] = {}
        self._broken: set[int] = set()
        self._decoder = Worker("pyvista-vdi set")
        self._grower = Worker("pyvista-vdi set's growth")
        self._grown_for: Camera | None = None
        self._kept: dict[int, DeferredInput] = {}  # of what is drawn, where it keeps values

    def vdi(self) -> VDI | None:
        """Return the nearest VDI, decoded now if it is not ready."""
        self._vdi = self._seen(self._weights[0][0])
        return self._vdi

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The nearest VDI's values, where it keeps them."""
        nearest: Any = self._at(self._weights[0][0])
        return nearest if isinstance(nearest, DeferredVDI) else None

    def classified_by(self, prop: Any) -> Input:
        """Set the property that classifies the values of all VDIs from now on."""
        self.prop = prop
        self._kept.clear()
        return self

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds that all VDIs have."""
        return self.collection.bounds

    def stamp(self) -> Any:
        """Return which VDI is nearest, and the time stamp of what classifies it."""
        return self._weights[0][0], self.prop and (id(self.prop), self.prop.GetMTime())

    def shared(self) -> Input:
        """Return an input that looks at the same set by itself."""
        other = SetInput(self.collection)
        other.prop = self.prop
        return other

    def on_devices(self) -> list[Any]:
        """Return the VDIs that are decoded, and what was classified of those that are drawn."""
        with self._lock:
            return [self._vdi, *self._ready.values(), *(one.last() for one in self._kept.values())]

    def rest(self) -> None:
        """Leave no thread; the next frame may begin anew."""
        for worker in (self._decoder, self._grower):
            worker.clear()
            worker.join()
        with self._lock:
            self._ready.clear()
            self._bytes.clear()

    def look(self, camera: Camera, device: Any, growth: str | None) -> None:
        """Choose what a view shows, and decode what is near it; grow where the picture lacks."""
        self._view, self._device = camera, device
        self._weights = self.collection.weights(camera)
        if not self._decoder.running and self._wanted() is not None:
            self._decoder.put(Decoding(lambda on, _report: self._decode(on), device))
        if growth == "later" and self._grower.running:
            self._grower.clear()
            self._grown_for = None
        elif growth == "behind":
            self._grow_behind()
        elif growth == "now":
            self._grow_now()

    @property
    def busy(self) -> bool:
        """Whether a VDI is being made, or was made and :meth:`advance` has not taken it."""
        return self._grower.job is not None

    def parts(self) -> list[tuple[VDI, float]]:
        """Return what a picture is blended of, with weights; the nearest first."""
        return [(self._seen(i), weight) for i, weight in self._weights]

    def _seen(self, i: int) -> VDI:
        """Return a VDI, with the colours that the property gives it where it keeps values."""
        vdi: Any = self._at(i)
        if not isinstance(vdi, DeferredVDI) or self.prop is None:
            return as_vdi(vdi)  # refuses what has no colours
        kept = self._kept.get(i)
        if kept is None or kept.deferred is not vdi:
            drawn = dict(self._weights)
            self._kept = {k: one for k, one in self._kept.items() if k in drawn}
            kept = self._kept[i] = DeferredInput(vdi, self.prop)
        return as_vdi(kept.vdi())

    def _at(self, i: int) -> VDI:
        with self._lock:
            known = self._ready.get(i)
        if known is None:
            known = self.collection[i]
            self._keep(i, known)
        return known

    def _grow_behind(self) -> None:
        """Generate a VDI of the view behind the frames, if its picture misses the target."""
        view, before = self._view, self._grown_for
        if self.busy or not self.collection.can_grow:
            return
        if before is not None and self.collection.apart(view, before) < _MOVED:
            return
        self._grown_for = view

        def make(runtime: Runtime, _report: Any) -> list[VDI]:
            vdi = self.collection.lacking(view)
            if vdi is not None:
                prepared_vdi(runtime, vdi)
            return [] if vdi is None else [vdi]

        self._grower.put(Job(make, self._device))

    def _grow_now(self) -> None:
        """Add a VDI of the view to the set, made first, if its picture misses the target."""
        view = self._view
        if view == self._grown_for or not self.collection.can_grow:
            return
        self._grown_for = view
        vdi = self.collection.lacking(view)
        if vdi is not None:
            self.collection.add(vdi)
            self._keep(len(self.collection) - 1, vdi)
            self._weights = self.collection.weights(view)

    def advance(self) -> bool:
        """Add what was made to the set; whether there is another VDI to be drawn."""
        made = self._grower.take()
        for vdi in made or ():
            self.collection.add(vdi)
            self._keep(len(self.collection) - 1, vdi)
        return bool(made)

    def regenerated(self, camera: Camera | None, window_size: Any) -> VDI:
        """Add a VDI of a view to the set."""
        if camera is None:
            raise InvalidArgumentError(
                "nothing shows this actor, so there is no view: pass camera, or add the actor to "
                "a renderer first"
            )
        vdi = self.collection.generate(camera)
        self.collection.add(vdi)
        return vdi

    def _order(self) -> list[int]:
        """Return all VDIs, the nearest to the view first."""
        return [int(i) for i in self.collection.distances(self._view).argsort(kind="stable")]

    def _wanted(self) -> int | None:
        """Return the next VDI to be decoded; None where enough are, or there is no memory."""
        with self._lock:
            order, drawn = self._order(), dict(self._weights)
            taken, each = sum(self._bytes.values()), max(self._bytes.values(), default=0.0)
            last = max((order.index(k) for k in self._ready if k not in drawn), default=-1)
            for rank, i in enumerate(order[:_AHEAD]):
                if i not in self._ready and i not in self._broken:
                    # In place of one that is farther, where memory is not enough
                    return i if taken + each <= self.memory or rank < last else None
        return None

    def _decode(self, runtime: Runtime) -> bool:
        while (i := self._wanted()) is not None and self._decoder.running:
            try:
                vdi = self.collection[i]
                bring(runtime, vdi)
            except Cancelled:
                raise
            except Exception:  # a frame that needs it says what is wrong
                with self._lock:
                    self._broken.add(i)
                continue
            self._keep(i, vdi)
        return True

    def _keep(self, i: int, vdi: VDI) -> None:
        """Keep a decoded VDI, and let go of the farthest where memory is not enough."""
        drawn = dict(self._weights)
        with self._lock:
            self._ready[i], self._bytes[i] = vdi, vdi.nbytes * (1 + ON_DEVICE)
            for k in reversed(self._order()):
                if sum(self._bytes.values()) <= self.memory:
                    break
                if k in self._ready and k not in drawn and k != i:
                    del self._ready[k], self._bytes[k]
