"""The set of VDIs, one for each of many sides; and its files, ``.vdiset`` and pages."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVDIError,
    VDIError,
)
from pyvista_vdi.extensions.series.archive import Archive
from pyvista_vdi.extensions.series.series import Several, as_steps
from pyvista_vdi.extensions.sets import EXTENSION
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, as_vector
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import eye_from_centre

#: Degrees by which a V_O may be farther than the nearest and still be seen.
BLEND = 6.0
#: Tangent of half the angle of VTK's lens.
_LENS = math.tan(math.radians(15))
#: Most V_Os that a picture is blended of.
MOST_BLENDED = 3


class VDISet(Several):
    """The VDIs of one scene from many views V_O: a sequence of :class:`VDI`.

    Made by :func:`pyvista_vdi.generate_set`, by :func:`pyvista_vdi.read` from a ``.vdiset`` file,
    whose VDIs are read when they are asked for, or from VDIs at hand; one that was read is pickled
    as its path.
    :func:`pyvista_vdi.render`, :func:`pyvista_vdi.pick` and ``Plotter.add_vdi`` take it as they
    take a VDI, and look at that which was made nearest to the view.

    Parameters
    ----------
    views : iterable of VDI
        One per V_O, or their VTK form; at least one, all of the same bounds. A sequence that is
        neither list nor tuple is asked for a VDI when that is needed.
    cameras : sequence of Camera, optional
        Their views, where they are known without the VDIs.
    window_size : (int, int), optional
        Width and height of the pictures that it is for; by default the first VDI's.
    bounds : sequence of float, optional
        Of the VDIs, in the model frame; by default the first one's.
    camera : Camera, optional
        The view to begin with; by default the first V_O.

    Raises
    ------
    InvalidArgumentError
        If there is no VDI, or cameras are not as many.
    InvalidVDIError
        If one is no VDI, or they are of other bounds than the first.
    InvalidCameraError
        If an eye is farther from the centre of the bounds than float64 can say.

    Attributes
    ----------
    cameras : tuple of Camera
        The generating view V_O of each VDI.
    camera : Camera
        The view to begin with, for pictures of ``window_size``.
    window_size, picture_size : (int, int)
        As above; the second is its name for a VDI.
    bounds : tuple of float
        As above.
    blend : float
        Degrees by which a V_O may be farther than the nearest and still be blended in, 6 by
        default: the farther, the less it counts, so that nothing jumps when another one becomes
        the nearest. 0 shows the nearest alone.
    """

    kind, drawn_by = EXTENSION.formats[0], "pyvista_vdi.extensions.sets.shown:SetInput"

    def __init__(
        self,
        views: Iterable[VDI],
        cameras: Sequence[Camera] | None = None,
        *,
        window_size: Sequence[int] | None = None,
        bounds: Sequence[float] | None = None,
        camera: Any = None,
    ) -> None:
        self._vdis = as_steps(views, "a set")
        if cameras is None:
            cameras = [vdi.camera for vdi in as_steps(list(self._vdis), "a set")]
        elif not np.iterable(cameras):
            raise InvalidArgumentTypeError(f"cameras must be one for each VDI; got {cameras!r}")
        self.cameras = tuple(Camera.from_any(camera) for camera in cameras)
        if not len(self) == len(self.cameras) > 0:
            raise InvalidArgumentError(
                f"a set has a camera for each VDI, and at least one; got {len(self)} VDIs "
                f"and {len(self.cameras)} cameras"
            )
        size = self[0].picture_size if window_size is None else window_size
        self.window_size = self.picture_size = check_window_size(size)
        given = self[0].bounds if bounds is None else bounds
        self.bounds: tuple[float, ...] = as_vector(given, "bounds", 6)
        for i, vdi in enumerate(self if bounds is None else ()):
            if vdi.bounds != self.bounds:
                raise InvalidVDIError(
                    f"the VDIs of a set are of one scene: number {i} has the bounds "
                    f"{vdi.bounds}, the first {self.bounds}"
                )
        self.camera = self.cameras[0] if camera is None else Camera.from_any(camera)
        self._places = self._places_of(self.cameras)
        self.blend = BLEND

    @property
    def about(self) -> dict[str, Any]:
        """What a file says of it beside its VDIs."""
        return {
            "views": [view.to_dict() for view in self.cameras],
            "camera": self.camera.to_dict(),
            "picture_size": list(self.window_size),
            "bounds": list(self.bounds),
        }

    @overload
    def __getitem__(self, index: int) -> VDI: ...
    @overload
    def __getitem__(self, index: slice) -> list[VDI]: ...
    def __getitem__(self, index: int | slice) -> VDI | list[VDI]:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        return self._vdis[self._place(index, "VDIs")]  # type: ignore[no-any-return]

    def distances(self, camera: Any) -> NDArray[np.float64]:
        """Return how far each V_O's eye is from that of a view, degrees, float64 (n,).

        The angle between both as seen from the centre of the bounds; where they are not as far
        from it, together with the logarithm of the ratio, by Pythagoras: what an eye has moved by
        over how far it is away.

        Parameters
        ----------
        camera : Camera or vtkCamera or pyvista.Camera
            The view; its model transform places the set.
        """
        [here], places = self._places_of([Camera.from_any(camera)]), self._places
        cross = np.linalg.norm(np.cross(places[:, :3], here[:3]), axis=1)
        angle = np.arctan2(cross, places[:, :3] @ here[:3])
        return np.asarray(np.degrees(np.hypot(angle, places[:, 3] - here[3])))

    def nearest(self, camera: Any) -> int:
        """Return the index of the VDI whose V_O is nearest to a view; of two, the earlier.

        Parameters
        ----------
        camera : Camera or vtkCamera or pyvista.Camera
            The view.
        """
        return int(self.distances(camera).argmin())

    def weights(self, camera: Any) -> list[tuple[int, float]]:
        """Return what a picture is blended of: indices and weights, the nearest first.

        The weights fall linearly with the distance beyond the nearest one's, to 0 at :attr:`blend`,
        and add up to 1.

        Parameters
        ----------
        camera : Camera or vtkCamera or pyvista.Camera
            The view.
        """
        if not 0 <= (blend := as_float(self.blend)) <= 180:
            raise InvalidArgumentError(f"blend must be degrees, 0 to 180; got {self.blend!r}")
        distances = self.distances(camera)
        order = np.argsort(distances, kind="stable")[: MOST_BLENDED + 1]
        beyond = distances[order] - distances[order[0]]
        # Continuous where another one comes in for the last, too
        reach = min(blend, beyond[-1]) if len(order) > MOST_BLENDED else blend
        shares = np.maximum(0.0, 1.0 - beyond[1:] / reach) if reach > 0 else np.zeros(0)
        shares = np.append(1.0, shares[shares > 0])
        return [(int(i), float(w)) for i, w in zip(order, shares / shares.sum(), strict=False)]

    def parts(self, camera: Any) -> list[tuple[VDI, float]]:
        """Return the VDIs of which a view's picture is blended, with weights, the nearest first.

        Parameters
        ----------
        camera : Camera or vtkCamera or pyvista.Camera
            The view.
        """
        return [(self[i], weight) for i, weight in self.weights(camera)]

    def __repr__(self) -> str:
        width, height = self.window_size
        return f"VDISet({len(self)} VDIs, for pictures of {width} x {height})"

    def _places_of(self, cameras: Sequence[Camera]) -> NDArray[np.float64]:
        """Return the direction of each eye from the centre, and the logarithm of its distance.

        float64 (n, 4). Directions are those of the model as the first V_O's transform shows it.
        """
        shown = self.cameras[0].model_transform[:3, :3]
        towards, lengths = zip(
            *(eye_from_centre(view, self.bounds, shown) for view in cameras), strict=True
        )
        # Of a parallel view, which is infinitely far: where a lens shows as much of the height
        away = [
            view.parallel_scale / _LENS if view.parallel_projection else length
            for view, length in zip(cameras, lengths, strict=True)
        ]
        return np.column_stack([towards, np.log(away)])


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISet:
    """Read a set; its VDIs are read when they are asked for."""
    vdis = Archive(path, VDISet.kind)
    try:
        vdi_set = VDISet(
            vdis,
            [Camera.from_dict(view) for view in vdis.about["views"]],
            camera=Camera.from_dict(vdis.about["camera"]),
            window_size=vdis.about["picture_size"],
            bounds=vdis.about["bounds"],
        )
    except (VDIError, KeyError, TypeError, ValueError) as error:
        vdis.refuse(f"its {VDISet.kind.head} is incomplete or wrong ({error!r})")
    Pieces(progress, 1)()
    return vdi_set


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a set says about itself, without its arrays: errors as for :func:`read`."""
    return Archive(path, VDISet.kind).info()
