"""What is asked of an engine, carried whole: checked once, where a user's values come in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.checks import as_float, as_whole, memory_limit_bytes, one_of
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.volume import Volume

#: Most supersegments that a list may be allowed.
MAX_SUPERSEGMENTS = 4096

#: What may decide where a list is cut that must be shortened; ``docs/concepts.md`` says what each
#: means. The first is the default.
CRITERIA = ("least-error", "homogeneity")

_Options = TypeVar("_Options", bound="MediumOptions")


@dataclass(frozen=True, kw_only=True)
class MediumOptions:
    """How a classified volume is sampled: what generation and volume rendering both need.

    What is given is checked, and brought to the types that are stated.

    Attributes
    ----------
    sample_distance : float, optional
        Length of a step, model units; half the smallest spacing by default. What a volume allows
        is checked with the volume.
    lights : Lights
        What a shaded volume is lit by; one headlight by default. Whatever
        :meth:`Lights.from_any` takes may be given.
    ambient_occlusion : AmbientOcclusion, optional
        Darkens what is hidden from the light around it; whatever
        :meth:`AmbientOcclusion.from_any` takes may be given.
    memory_limit : int, optional
        Most bytes to take on the device, or a text such as ``"2 GiB"``; by default what the device
        has. A volume that does not fit goes there brick by brick, which takes more time and
        changes no bit.

    Raises
    ------
    InvalidArgumentError
        If a value is out of range.
    """

    sample_distance: float | None = None
    lights: Lights = field(default_factory=Lights)
    ambient_occlusion: AmbientOcclusion | None = None
    memory_limit: int | None = None

    def __post_init__(self) -> None:
        self._put("lights", Lights.from_any(self.lights))
        self._put("ambient_occlusion", AmbientOcclusion.from_any(self.ambient_occlusion))
        self._put("memory_limit", memory_limit_bytes(self.memory_limit))

    @classmethod
    def of(cls: type[_Options], options: _Options | None, changes: Mapping[str, Any]) -> _Options:
        """Return options with some of them changed; the defaults with changes, if there are none.

        Raises
        ------
        TypeError
            If one of the changes is no option.
        """
        return cls(**changes) if options is None else replace(options, **changes)

    def occlusion_bytes(self, volume: Volume) -> int:
        """Return what the grid of the ambient occlusion takes on the device, bytes."""
        if self.ambient_occlusion is None:
            return 0
        return OcclusionGrid.of(volume, self.ambient_occlusion).nbytes

    def _put(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True)
class GenerationOptions(MediumOptions):
    """How a VDI is made.

    What is given is checked, and brought to the types that are stated.

    Attributes
    ----------
    max_supersegments : int
        Most supersegments in a list, 1 to 4096; never exceeded, and nothing that is not
        transparent is dropped.
    criterion : {"least-error", "homogeneity"}
        What decides where a list is cut. ``"least-error"``: neighbours are merged at least error.
        ``"homogeneity"`` (the paper's, after Frey et al. 2013): a supersegment goes on while the
        medium is like its mean so far, by the least threshold that keeps the budget on this ray.
        It records up to 512 runs of a ray before unlike ones are merged, which takes more time
        and, in wide windows, memory. By both, neighbours within ``tolerance`` are merged.
    tolerance : float
        Neighbours are merged even under budget where this changes (opacity-weighted colour,
        opacity) per voxel, in the root of the sum of squares along the ray, by no more than this.
        0 merges only what is homogeneous.
    view_cone : float
        Half angle in degrees, 0 to 90, of the cone of views that must be served: what V_O cannot
        see at all counts ``1 - cos(view_cone)`` as much as what it sees when neighbours are merged
        at least error or within ``tolerance``. ``"homogeneity"`` cuts without regard to it.
    precision : {"exact", "16-byte", "8-byte"}
        What a supersegment takes; see :meth:`VDI.with_precision`.
    sample_distance, lights, ambient_occlusion, memory_limit
        As for :class:`MediumOptions`. The light is baked into the colours: it stays as it is where
        V_O has it. So is the occlusion, which is the same from every view.

    Raises
    ------
    InvalidArgumentError
        If a value is out of range.
    """

    max_supersegments: int = 20
    criterion: str = "least-error"
    tolerance: float = 0.0
    view_cone: float = 60.0
    precision: str = "exact"

    def __post_init__(self) -> None:
        self._put("max_supersegments", check_max_supersegments(self.max_supersegments))
        one_of(self.criterion, "criterion", CRITERIA)
        check_precision(self.precision)
        difference, angle = as_float(self.tolerance), as_float(self.view_cone)
        if not 0 <= difference < np.inf:
            raise InvalidArgumentError(f"tolerance must be a number >= 0; got {self.tolerance!r}")
        if not 0 <= angle <= 90:
            raise InvalidArgumentError(
                f"view_cone must be an angle between 0 and 90 degrees; got {self.view_cone!r}"
            )
        self._put("tolerance", difference)
        self._put("view_cone", angle)
        super().__post_init__()

    @property
    def hidden_weight(self) -> float:
        """Weight of what V_O cannot see at all when neighbours are merged, 0 to 1."""
        return float(1 - np.cos(np.radians(self.view_cone)))


#: The names of what :class:`GenerationOptions` takes, which tell it from a classification.
GENERATION_NAMES = tuple(each.name for each in fields(GenerationOptions))


def check_max_supersegments(max_supersegments: int) -> int:
    """Return ``max_supersegments`` as an int between 1 and :data:`MAX_SUPERSEGMENTS`."""
    limit = as_whole(max_supersegments)
    if not 1 <= limit <= MAX_SUPERSEGMENTS:
        raise InvalidArgumentError(
            f"max_supersegments must be a whole number from 1 to {MAX_SUPERSEGMENTS}; "
            f"got {max_supersegments!r}"
        )
    return int(limit)
