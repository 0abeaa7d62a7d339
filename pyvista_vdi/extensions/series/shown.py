"""What a mapper draws of a series: the step that a player shows."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.extensions.series.player import Player
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input
from pyvista_vdi.vtk_pipeline.interaction.timer import period_of


class SeriesInput(Input):
    """The step of a series that a player shows."""

    player: Player

    def __init__(self, series: VDISeries) -> None:
        super().__init__()
        self.player, self.collection = Player(series), series
        self._kept: DeferredInput | None = None  # of the step, where it keeps values

    def vdi(self) -> VDI | None:
        """Return the step's VDI, decoded now if it is not ready."""
        step: Any = self.player.vdi
        if isinstance(step, DeferredVDI) and self.prop is not None:
            if self._kept is None or (self._kept.deferred, self._kept.prop) != (step, self.prop):
                self._kept = DeferredInput(step, self.prop)
            step = self._kept.vdi()
        self._vdi = as_vdi(step)  # refuses what has no colours
        return self._vdi

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The step's values, where it keeps them."""
        step: Any = self.player.vdi
        return step if isinstance(step, DeferredVDI) else None

    def classified_by(self, prop: Any) -> Input:
        """Set the property that classifies the values of all steps from now on."""
        self.prop = prop
        return self

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the step that was shown last, or of the first."""
        return self.player.series.bounds if self._vdi is None else self._vdi.bounds

    def stamp(self) -> Any:
        """Return the step, and the time stamp of what classifies it."""
        return self.player.step, self.prop and (id(self.prop), self.prop.GetMTime())

    def shared(self) -> Input:
        """Return an input that shows the same step, and plays by itself."""
        other = SeriesInput(self.player.series)
        other.player.step, other.prop = self.player.step, self.prop
        return other

    def on_devices(self) -> list[Any]:
        """Return the steps that are decoded, and what was classified of that which is shown."""
        return [self._vdi, *self.player.decoded]

    def rest(self) -> None:
        """Pause, and leave no thread."""
        self.player.close()

    def look(self, camera: Camera, device: Any) -> None:
        """Decode for a device."""
        self.player.device = device

    @property
    def busy(self) -> bool:
        """Whether it plays."""
        return self.player.playing

    @property
    def period(self) -> int:  # type: ignore[override]
        """Milliseconds between two looks at what goes on."""
        return period_of(self.player.rate)

    def advance(self) -> bool:
        """Show the step that is due; whether it is another one."""
        return self.player.advance()

    def complaint(self, error: BaseException) -> str:
        """Return that a step is left out."""
        return f"a step is left out: {type(error).__name__}: {error}"
