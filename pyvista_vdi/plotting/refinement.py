"""Which level of a store an actor shows: a finer one is read when the view comes nearer."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.host_memory import require_host_memory
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.convert import to_image_data
from pyvista_vdi.plotting.volumes import held
from pyvista_vdi.quality.background import Job, Worker
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods
from pyvista_vdi.vtk_pipeline.filters.view import as_array, camera_of
from pyvista_vdi.vtk_pipeline.interaction.status import Warnings
from pyvista_vdi.vtk_pipeline.interaction.timer import Timer
from pyvista_vdi.vtk_pipeline.vtk import weakly

_log = logging.getLogger(__name__)

#: Before the window's own observers: a frame begins with the level that it is to show.
_FIRST = 10.0


def load(volume: StoredVolume) -> Volume:
    """Read a level of a store and log which; DeviceMemoryError if the host lacks the memory."""
    remedy = "open a coarser level by pyvista_vdi.read_volume(path, level=...), or generate a VDI"
    require_host_memory(
        volume.array.nbytes, f"the volume in {volume.store.path}", remedy, free=True
    )
    _log.info("%s: %s", volume.store.path, volume.describe())
    return volume.load()


class Refinement:
    """Reads finer levels of a store for an actor, as its views require them.

    In a window that somebody watches they are read by a thread, and the frames go on; elsewhere
    before the frame that needs them, so that a picture depends on its view alone. Levels never
    become coarser: what was read is finer than required, and costs nothing more to show. Colours
    and opacities stay. ``shown`` is the level whose voxels the actor shows.
    """

    def __init__(self, actor: Any, renderer: Any, shown: StoredVolume) -> None:
        self.shown = shown
        self._actor, self._renderer = weakly(actor), weakly(renderer)
        self._worker = Worker("pyvista-vdi level")
        self._finest = 0  # finer ones could not be read
        self._warnings = Warnings()
        self._timer = Timer(self._look)
        window = renderer.GetRenderWindow()
        self._window = weakly(window)

        # The window keeps it, and it keeps nothing of VTK's
        self._observer = window.AddObserver("StartEvent", lambda *_: self._before_frame(), _FIRST)
        self._say()

    def stop(self) -> None:
        """Read no more: what is being read is dropped."""
        window = self._window()
        if window is not None and self._observer:
            window.RemoveObserver(self._observer)
        self._observer = 0
        self._timer.stop()
        self._worker.close()

    def _before_frame(self) -> None:
        actor, renderer, window = self._actor(), self._renderer(), self._window()
        if actor is None or renderer is None or not renderer.HasViewProp(actor):
            self.stop()
            return
        if _data_of(actor) is not self._data():  # somebody has set other data, or a VDI
            self.stop()
            actor._refinement = None
            if isinstance(actor.GetMapper(), VDIMapperMethods):
                actor.GetMapper().driver.level = None
            return
        self._take()
        if tuple(window.GetTileScale()) != (1, 1) or min(renderer.GetSize()) < 1:
            return  # a part of a picture
        camera = camera_of(renderer.GetActiveCamera(), as_array(actor.GetMatrix()))
        wanted = self.shown.in_view(camera, window_size=renderer.GetSize())
        if wanted.level < self._finest:
            wanted = wanted.at_level(self._finest)
        if wanted.level >= self.shown.level or not actor.GetVisibility():
            return
        if not _watched(window):
            self._worker.clear()
            if not self._show_or_warn(wanted, lambda: load(wanted)):
                self._before_frame()  # a coarser one, which is still finer than what is shown
            return
        if self._worker.job is None or self._worker.job.key != wanted.level:
            device = actor.GetMapper().GetDevice()

            def read(runtime: Runtime, _: Callable[[float], None]) -> Volume:
                with runtime.aside():
                    return load(wanted)

            self._worker.put(Job(read, device, wanted.level))
        # In each frame anew: the hand that turns the view has stopped it
        self._timer.start(window.GetInteractor(), in_loop=True)

    def _look(self) -> None:
        """Draw a level that was read, from the window's event loop."""
        if self._worker.running:
            return
        self._timer.stop()
        interactor = None if self._window() is None else self._window().GetInteractor()
        if interactor is not None and self._worker.job is not None:
            interactor.Render()

    def _take(self) -> None:
        """Show what the thread has read, if it has."""
        if self._worker.job is not None and not self._worker.running:
            level: Any = self._worker.job.key
            self._show_or_warn(self.shown.at_level(level), self._worker.take)

    def _say(self) -> None:
        """Tell the status, and remember whose voxels these are."""
        actor = self._actor()
        self._data = weakly(_data_of(actor))
        actor.GetMapper().driver.level = self.shown.level, len(self.shown.store.levels)

    def _show_or_warn(self, level: Any, read: Callable[[], Volume]) -> bool:
        """Show a level; where it cannot be read the picture stays, and it is not tried again."""
        actor = self._actor()
        try:
            image = held(to_image_data(read()))
            actor.GetMapper().own_source("its level").SetInputDataObject(image)
        except Exception as error:  # of the disk, of a network, of a codec
            self._finest = level.level + 1
            self._warnings.warn(
                f"level {level.level} of {level.store.path} cannot be read, and level "
                f"{self.shown.level} stays: {error}",
                error,
                cause="level",
            )
            return False
        self.shown = level
        self._say()
        return True


def _watched(window: Any) -> bool:
    """Whether somebody sees the frames of a window come."""
    return bool(window.GetShowWindow()) and window.GetInteractor() is not None


def _data_of(actor: Any) -> Any:
    """Return the grid that an actor's VDI is made of; ``None`` without one."""
    mapper = actor.GetMapper()
    source = mapper.GetSource() if isinstance(mapper, VDIMapperMethods) else None
    return None if source is None else source.GetInputDataObject(0, 0)
