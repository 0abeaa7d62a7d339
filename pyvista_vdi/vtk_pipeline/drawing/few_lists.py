"""VDIs of every second list, for previews of few pixels; made behind the frames."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.list_subsampling import lists_crossed, subsampled_lists
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.raycasting.prepared import prepared_vdi

_log = logging.getLogger(__name__)

#: Lists that rays must cross along an edge for fewer of them to be worth it. Near V_O a ray's cost
#: is not that of the lists.
_OBLIQUE = 16.0

#: Every how-manieth list is taken along the window's width and height.
Steps = tuple[int, int]


def steps_for(vdi: VDI, camera: Camera) -> Steps | None:
    """Return along which edges every second list will do for a view; None near V_O.

    Along those that most lists are crossed along: the other edge's lists cost little and show.
    """
    crossed = lists_crossed(vdi, camera)
    if crossed.max() < _OBLIQUE:
        return None
    x, y = (2 if many >= crossed.max() / 2 else 1 for many in crossed)
    return (x, y) if all(k <= n for k, n in zip((x, y), vdi.window_size, strict=True)) else None


class FewLists:
    """What was made of the VDI that is drawn."""

    def __init__(self) -> None:
        self._worker = Worker("pyvista-vdi few lists")
        self._made: dict[Steps, VDI | None] = {}  # None: it cannot be made
        self._of: Callable[[], VDI | None] = lambda: None  # a weak reference

    def get(self, vdi: VDI, camera: Camera, device: Any) -> VDI | None:
        """Return a VDI of fewer lists for a view, if there is one already; else have it made."""
        if self._of() is not vdi:
            self._worker.clear()
            self._made.clear()
            self._of = weakref.ref(vdi)
        steps = steps_for(vdi, camera)
        if steps is None:
            return None
        if steps not in self._made and not self._worker.running:
            self._take()
            if steps not in self._made:
                self._worker.put(Job(_thinning(vdi, steps), device, steps))
        return self._made.get(steps)

    def _take(self) -> None:
        job = self._worker.job
        if job is None:
            return
        try:
            self._made[job.key] = self._worker.take()  # type: ignore[index]
        except VDIError:
            self._made[job.key] = None  # type: ignore[index]
            _log.debug("fewer lists cannot be had", exc_info=True)

    def clear(self) -> None:
        """Let go of everything."""
        self._worker.clear()
        self._worker.join()
        self._made.clear()
        self._of = lambda: None


def _thinning(vdi: VDI, steps: Steps) -> Callable[[Runtime, Callable[[float], None]], VDI]:
    def work(runtime: Runtime, _: Callable[[float], None]) -> VDI:
        with runtime.aside():  # hundreds of milliseconds where lists are many
            made = subsampled_lists(vdi, *steps)
        prepared_vdi(runtime, made)  # on the device before a frame waits for it
        return made

    return work
