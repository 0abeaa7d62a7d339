"""What a mapper draws of a set: the VDI nearest to the view, or a blend of several."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.sets.selection import ViewSelection
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.inputs import Input


class SetInput(Input):
    """The VDI of a set that is nearest to the view."""

    def __init__(self, vdi_set: VDISet) -> None:
        super().__init__()
        self.selection, self.collection = ViewSelection(vdi_set), vdi_set

    def vdi(self) -> VDI | None:
        """Return the nearest VDI, decoded now if it is not ready."""
        self._vdi = self.selection.vdi
        return self._vdi

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds that all VDIs have."""
        return self.selection.vdi_set.bounds

    def stamp(self) -> Any:
        """Return which VDI it is."""
        return self.selection.nearest

    def shared(self) -> Input:
        """Return an input that looks at the same set by itself."""
        return SetInput(self.selection.vdi_set)

    def rest(self) -> None:
        """Leave no thread."""
        self.selection.close()

    def look(self, camera: Camera, device: Any, growth: str | None) -> None:
        """Choose what a view shows; where the picture lacks, grow the set."""
        self.selection.device = device
        self.selection.look(camera)
        if growth == "later":
            self.selection.stop_growing()
        elif growth == "behind":
            self.selection.grow()
        elif growth == "now":
            self.selection.grow_now()

    @property
    def busy(self) -> bool:
        """Whether the set grows."""
        return self.selection.growing

    def advance(self) -> bool:
        """Add what was made to the set; whether there is another VDI to be drawn."""
        return self.selection.advance()

    def parts(self) -> list[tuple[VDI, float]]:
        """Return the VDIs that a picture is blended of, with weights."""
        return self.selection.parts()

    def regenerated(self, camera: Camera | None, window_size: Any) -> VDI:
        """Add a VDI of a view to the set."""
        if camera is None:
            raise InvalidArgumentError(
                "nothing shows this actor, so there is no view: pass camera, or add the actor to "
                "a renderer first"
            )
        vdi_set = self.selection.vdi_set
        vdi = vdi_set.generate(camera)
        vdi_set.add(vdi)
        return vdi
