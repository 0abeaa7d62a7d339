"""What a mapper draws of a set: the VDIs nearest to the view; others are read ahead."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.extensions.series.shown import ON_DEVICE, SeveralInput
from pyvista_vdi.extensions.sets.vdi_set import MOST_BLENDED, VDISet
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input


class SetInput(SeveralInput):
    """The VDI of a set that is nearest to the view, or a blend of several.

    :meth:`look` is told where the thread that draws looks from; what is nearest is read.
    """

    collection: VDISet
    ahead = 8

    def __init__(self, vdi_set: VDISet) -> None:
        super().__init__(vdi_set, "pyvista-vdi set")
        self._weights = vdi_set.weights(vdi_set.cameras[0])
        self._order = [i for i, _ in self._weights]  # all VDIs, the nearest first
        self._kept: dict[int, DeferredInput] = {}  # of what is drawn, where it keeps values

    def vdi(self) -> VDI | None:
        """Return the nearest VDI, read now if it is not ready."""
        self.last = self._seen(self._weights[0][0])
        return self.last

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The nearest VDI's values, where it keeps them."""
        nearest: Any = self._at(self._weights[0][0])
        return nearest if isinstance(nearest, DeferredVDI) else None

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
        """Return the VDIs that are ready, and what was classified of those that are drawn."""
        return [*super().on_devices(), *(one.last for one in self._kept.values())]

    def look(self, camera: Camera, device: Any) -> None:
        """Choose what a view shows, and read what is near it."""
        distances = self.collection.distances(camera)
        with self._lock:
            self._weights = self.collection.weights(camera)
            self._order = [int(i) for i in distances.argsort(kind="stable")]
        self._read_ahead(device)

    def parts(self) -> list[tuple[VDI, float]]:
        """Return what a picture is blended of, with weights; the nearest first."""
        return [(self._seen(i), weight) for i, weight in self._weights]

    def _seen(self, i: int) -> VDI:
        """Return a VDI, with the colours that the property gives it where it keeps values."""
        vdi: Any = self._at(i)
        if not isinstance(vdi, DeferredVDI) or self.prop is None:
            return as_vdi(vdi)  # refuses what has no colours
        kept = self._kept.get(i)
        if kept is None or (kept.deferred, kept.prop) != (vdi, self.prop):
            drawn = dict(self._weights)
            self._kept = {k: one for k, one in self._kept.items() if k in drawn}
            kept = self._kept[i] = DeferredInput(vdi, self.prop)
        return as_vdi(kept.vdi())

    def _fitting(self) -> list[int]:
        """Return the nearest VDIs that there is memory for, and at least those that are drawn."""
        largest = max((1.0, *(v.nbytes * (1 + ON_DEVICE) for v in self._ready.values())))
        return self._order[: max(MOST_BLENDED, min(self.ahead, int(self.memory / largest)))]

    def _wanted(self) -> int | None:
        with self._lock:
            known = self._ready.keys() | self._broken
            return next((i for i in self._fitting() if i not in known), None)

    def _trim(self) -> None:
        near = self._fitting()
        self._ready = {k: vdi for k, vdi in self._ready.items() if k in near}
