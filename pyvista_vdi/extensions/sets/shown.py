"""What a mapper draws of a set: the VDIs nearest to the view; others are read ahead."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.extensions.series.shown import ON_DEVICE, SeveralInput
from pyvista_vdi.extensions.sets.vdi_set import MOST_BLENDED, VDISet
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.inputs import Input


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

    def shared(self) -> Input:
        """Return an input that looks at the same set by itself."""
        other = SetInput(self.collection)
        other.prop = self.prop
        return other

    def look(self, camera: Camera, device: Any) -> None:
        """Choose what a view shows, and read what is near it."""
        distances = self.collection.distances(camera)
        with self._lock:
            self._weights = self.collection.weights(camera)
            self._order = [int(i) for i in distances.argsort(kind="stable")]
        super().look(camera, device)

    def parts(self) -> list[tuple[VDI, float]]:
        """Return what a picture is blended of, with weights; the nearest first."""
        return [(self._seen(i), weight) for i, weight in self._weights]

    def _coming(self) -> list[int]:
        """Return the nearest VDIs that there is memory for, and at least those that are drawn."""
        largest = max((1.0, *(v.nbytes * (1 + ON_DEVICE) for v in self._ready.values())))
        return self._order[: max(MOST_BLENDED, min(self.ahead, int(self.memory / largest)))]

    def _trim(self) -> None:
        """Drop what is farther away."""
        near = self._coming()
        self._ready = {k: vdi for k, vdi in self._ready.items() if k in near}
