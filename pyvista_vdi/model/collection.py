"""Several VDIs of one scene, shown as one: what extensions derive series and sets from."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pyvista_vdi import registry
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI, Lists

#: Steps per second at which those of several times are played.
RATE = 24.0

_Collection = TypeVar("_Collection", bound="VDICollection")


class VDICollection(Sequence[VDI]):
    """Several VDIs of one scene: of several ``times``, ascending, or of several views.

    One of several views has ``parts(camera)``, which returns the VDIs that a view's picture is
    blended of, with weights, the nearest first.
    """

    times: tuple[float, ...] | None = None
    #: The view to begin with.
    camera: Camera
    #: Place of the class of what a mapper draws of it.
    drawn_by: str
    #: Returns the index of the VDI that is nearest to a time, or to a view.
    nearest: Callable[[Any], int]
    #: Returns it with what a function makes of each VDI, when that is asked for.
    _mapped: Callable[[Callable[[VDI], VDI]], Any]

    def _place(self, index: int, what: str) -> int:
        """Return an index counted from the first; IndexError if there is no such VDI."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"[{index}] is out of range: there are {len(self)} {what}")
        return range(len(self))[index]

    @property
    def value_range(self) -> tuple[float, float] | None:
        """Least and largest value that its VDIs keep; ``None`` where they have colours."""
        return getattr(self[0], "value_range", None)

    def classified(self: _Collection, **look: Any) -> _Collection:
        """Return it with the colours that a transfer function makes of the values that it keeps.

        The look is as for :meth:`DeferredVDI.classified`; what is not given follows from the range
        of the first VDI's values, so that a colour stands for the same value in all of them. Each
        VDI is made when it is asked for. InvalidVDIError if they have colours.
        """
        return registry.method("DeferredVDI.classified")(self, look)  # type: ignore[no-any-return]

    def save(self, path: str | os.PathLike[str], **options: Any) -> Path:
        """Write all in one file that `pyvista_vdi.read` opens, or a page, whole or not at all.

        The target's name ends in ``.vdis`` for a series, in ``.vdiset`` for a set, or in ``.html``.
        The options are those of :meth:`VDI.save`; supersegments take 8 bytes by default, those of
        a series what its first step's take. Pages have ``title`` and ``background`` as well, and
        those of a series ``autoplay``.
        """
        return registry.method("VDICollection.save")(self, path, **options)  # type: ignore[no-any-return]

    _repr_mimebundle_ = Lists._repr_mimebundle_
