"""Cropping as ``vtkVolumeMapper`` has it: 27 regions, each kept or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_floats, as_whole

#: Names of VTK's sets of regions, and their flags (VTK_CROP_SUBVOLUME ...).
PRESETS = {
    "subvolume": 0x0002000,
    "fence": 0x2EBFEBA,
    "inverted_fence": 0x5140145,
    "cross": 0x0417410,
    "inverted_cross": 0x7BE8BEF,
}

#: Normals of planes across the axes of a frame.
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Cropping:
    """Regions of the data that are drawn.

    Two planes across each axis cut the data's own coordinates (the model frame) into 3 x 3 x 3
    regions. Region (i, j, k) is kept if bit ``i + 3 j + 9 k`` of ``regions`` is set: i = 0 before
    the first x plane, 1 between the two, 2 behind the second.

    ``vtkVolumeMapper`` has the planes of an image with a direction matrix across the image's own
    axes; ``normals`` says so, and :meth:`from_any` makes them of a mapper.

    Parameters
    ----------
    planes : (float, float, float, float, float, float)
        x_low, x_high, y_low, y_high, z_low, z_high, model units; infinity is allowed. Where a high
        plane lies below its low one, nothing is between them. (VTK's GPU mapper, and a
        ``VDIMapper`` with it, draws nothing at all then.)
    regions : int or str
        27 flags, or the name of one of VTK's sets: ``"subvolume"`` (the box between the planes,
        the default), ``"fence"``, ``"inverted_fence"``, ``"cross"``, ``"inverted_cross"``.
    normals : array_like of float, shape (3, 3), optional
        A point p of the model frame is placed among the planes of axis i by ``normals[i] @ p``;
        the axes of the model frame by default.

    Raises
    ------
    InvalidArgumentError
        If the planes are not six numbers, the regions no such set, or the normals not three
        independent directions.
    """

    planes: tuple[float, float, float, float, float, float]
    regions: int = PRESETS["subvolume"]
    normals: tuple[tuple[float, float, float], ...] = AXES

    def __post_init__(self) -> None:
        planes, normals = as_floats(self.planes), as_floats(self.normals)
        if planes.shape != (6,) or np.isnan(planes).any():
            raise InvalidArgumentError(
                "cropping takes six planes, x_low, x_high, y_low, y_high, z_low, z_high in the "
                "data's own coordinates, or a pair of those and the regions; got "
                f"{self.planes!r}"
            )
        regions: Any = self.regions
        flags = as_whole(PRESETS.get(regions, regions) if isinstance(regions, str) else regions)
        if not 0 <= flags < 2**27:
            raise InvalidArgumentError(
                f"the regions of cropping are 27 flags, 0 to {2**27 - 1:#x}, or one of "
                f"{', '.join(map(repr, PRESETS))}; got {self.regions!r}"
            )
        if normals.shape != (3, 3) or not np.isfinite(normals).all() or not np.linalg.det(normals):
            raise InvalidArgumentError(
                "the normals of cropping are three independent directions of the model frame, "
                f"(3, 3) finite numbers; got {self.normals!r}"
            )
        object.__setattr__(self, "planes", tuple(planes.tolist()))
        object.__setattr__(self, "regions", int(flags))
        object.__setattr__(self, "normals", tuple(map(tuple, normals.tolist())))

    @classmethod
    def from_any(cls, cropping: Any) -> Cropping | None:
        """Return what a user calls cropping; ``None`` where nothing is cropped.

        A mapper's cropping may be off, and has the planes as VTK's GPU mapper cuts the image at its
        input.
        """
        if cropping is None or isinstance(cropping, Cropping):
            return cropping
        if hasattr(cropping, "GetCroppingRegionFlags"):
            if not cropping.GetCropping():
                return None
            planes, image = cropping.GetCroppingRegionPlanes(), cropping.GetDataSetInput()
            normals: Any = AXES
            matrix = image.GetDirectionMatrix() if hasattr(image, "GetDirectionMatrix") else None
            if matrix is not None and not matrix.IsIdentity():
                # VTK's GPU mapper puts the planes' places into the image's bounds, takes each as a
                # point on its axis of the model frame, and cuts across the image's axis there
                elements = [[matrix.GetElement(i, j) for j in range(3)] for i in range(3)]
                normals = np.linalg.inv(np.array(elements))
                low, high = np.reshape(image.GetBounds(), (3, 2)).T[..., None]
                planes = np.clip(np.reshape(planes, (3, 2)), low, high) * np.diag(normals)[:, None]
                planes = planes.ravel()
            return cls(planes, cropping.GetCroppingRegionFlags(), normals)
        parts = list(cropping) if np.iterable(cropping) else []
        return cls(*parts) if len(parts) == 2 else cls(cropping)

    def parts_of_ray(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64], first: float, last: float
    ) -> NDArray[np.float64]:
        """Return the parts of a ray in kept regions, ascending: their ends' t, float64 (k, 2).

        Of P(t) = origin + t direction in the model frame, float64 (3,), from first to last.
        """
        planes = np.maximum.accumulate(np.reshape(self.planes, (3, 2)), axis=1)
        origin, direction = (np.asarray(self.normals) @ along for along in (origin, direction))
        with np.errstate(divide="ignore", invalid="ignore"):  # a plane that is never reached
            t = ((planes - origin[:, None]) / direction[:, None]).ravel()
        cuts = np.unique(np.concatenate([[first, last], t[(t > first) & (t < last)]]))
        middles = origin + (cuts[:-1] + cuts[1:])[:, None] / 2 * direction
        region = (middles[:, :, None] >= planes).sum(axis=2) @ (1, 3, 9)
        keeps = (self.regions >> region & 1) == 1
        return np.stack([cuts[:-1], cuts[1:]], axis=1)[keeps]

    def reach(self, bounds: Sequence[float]) -> NDArray[np.float64]:
        """Return between which places along each normal a box of the model frame lies, (3, 2)."""
        box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
        ends = np.asarray(self.normals)[:, :, None] * box  # normal, axis, low or high
        return np.stack([ends.min(axis=2).sum(axis=1), ends.max(axis=2).sum(axis=1)], axis=1)
