"""Makes the VDIs of a set: from views on a sphere, in a cone, or from those that are given."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.io.progress import Pieces
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, as_whole
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.types import CameraLike, DeviceLike, Progress, VolumeLike, WindowSize
from pyvista_vdi.model.view import bounds_corners, covering_view
from pyvista_vdi.quality.view_error import world_centre

#: Above this share of the length along the axis of a view's up direction another one is up.
_TOO_STEEP = 0.98


def generate_set(
    volume: VolumeLike,
    views: int | Iterable[CameraLike] = 32,
    window_size: WindowSize = (640, 360),
    *,
    camera: CameraLike | None = None,
    half_angle: float = 180.0,
    lists: float = 1.0,
    device: DeviceLike | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> VDISet:
    """Generate VDIs of a volume from several views: on a sphere, in a cone, or those given.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        As for :func:`pyvista_vdi.generate`. It is uploaded once; of a store, the finest level that
        one of the views requires is loaded.
    views : int or sequence of cameras, default: 32
        How many views V_O, which are spread evenly; or the V_Os. With 32 on the sphere none of its
        directions is farther than 27 degrees from one of them.
    window_size : (int, int)
        Width and height of the pictures, pixels.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        A view of the sphere: it tells how far the eye is from the centre of the volume, the lens,
        what is up, and where the axis of a cone is. By default the view that the volume just fills.
    half_angle : float, default: 180.0
        Degrees from ``camera``'s direction within which views are spread, 0 to 180: less than 180
        is a cone.
    lists : float, default: 1.0
        Lists along an edge over pixels, 0.05 to 8.
    device : str, DeviceInfo or Runtime, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with the finished fraction, 0 to 1; work stops if it returns ``False``.
    **options
        All else that :func:`pyvista_vdi.generate` takes, classification included, but for quality
        targets. ``precision`` is ``"8-byte"`` and the settings' ``view_cone`` 30 by default.

    Returns
    -------
    VDISet
        In memory.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If an argument is out of its range.
    Cancelled
        If ``progress`` returned ``False``.

    See Also
    --------
    generate : has the options, and the other errors.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> volume = pvdi.examples.load_brain(as_volume=True)
    >>> vdis = pvdi.generate_set(volume, window_size=(640, 360), cmap="bone")  # doctest: +SKIP
    >>> vdis.save("brain.vdiset")  # doctest: +SKIP
    """
    size = check_window_size(window_size)
    if not 0 < as_float(half_angle) <= 180:
        raise InvalidArgumentError(f"half_angle must be degrees, 0 to 180; got {half_angle!r}")
    if not 0.05 <= as_float(lists) <= 8:
        raise InvalidArgumentError(f"lists must be 0.05 to 8 per pixel; got {lists!r}")
    # Other V_O serve what is beyond the cone
    standard = {"precision": "8-byte", "view_cone": 30.0}
    records = GenerationOptions, Classification
    made, looks = records_of(options, "generate_set", *records, defaults=standard)
    read = as_volume(volume, looks.scalars, looks.preference)
    if not isinstance(views, int | str) and np.iterable(views):
        if camera is not None or half_angle != 180:
            raise InvalidArgumentError(
                "camera and half_angle are for a number of views: leave them out with cameras"
            )
        cameras = [Camera.from_any(view) for view in views]
        if not cameras:
            raise InvalidArgumentError("there is no view: pass at least one camera")
        begin = cameras[0]
    else:
        if not 1 <= as_whole(views) <= 10_000:
            raise InvalidArgumentTypeError(
                f"views must be how many, 1 to 10000, or a list of cameras; got {views!r}"
            )
        begin = filling_camera(read.bounds, size) if camera is None else Camera.from_any(camera)
        axis = np.subtract(begin.position, world_centre(begin, read.bounds))
        cameras = orbit(begin, read.bounds, spread(int(as_whole(views)), axis, half_angle))
    read = read.load(*cameras, window_size=size)
    table, done = looks.transfer_function_of(read), Pieces(progress, len(cameras))
    about = {"classification": looks.describe(), "scalars": read.name}
    edges = max(1, round(lists * size[0])), max(1, round(lists * size[1]))
    vdis = []
    for view in cameras:
        # All of the volume has lists, of the density that was asked for
        seen, shape = covering_view(view, edges, bounds_corners(read.bounds)) or (view, edges)
        request = GenerationRequest(read, table, seen, shape, made, device, metadata=about)
        vdis.append(generate_vdi(request))
        done()
    return VDISet(vdis, camera=begin, window_size=size)


def spread(n: int, axis: Sequence[float] | NDArray[Any], half_angle: float) -> NDArray[np.float64]:
    """Return n unit vectors, float64 (n, 3), evenly within degrees from an axis.

    They are a Fibonacci spiral's from the axis on; always the same.
    """
    towards = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    k = np.arange(n) + 0.5
    along = 1 - k / n * (1 - np.cos(np.radians(half_angle)))
    if half_angle < 180:  # a cone's first view is its axis
        along[0] = 1.0
    across, turn = np.sqrt(1 - along**2), np.pi * (1 + np.sqrt(5)) * k
    u = np.cross(towards, np.eye(3)[np.abs(towards).argmin()])
    u /= np.linalg.norm(u)
    v = np.cross(towards, u)
    return (  # type: ignore[no-any-return]
        along[:, None] * towards
        + (across * np.cos(turn))[:, None] * u
        + (across * np.sin(turn))[:, None] * v
    )


def orbit(camera: Camera, bounds: Sequence[float], directions: Any) -> list[Camera]:
    """Return views of a volume from directions, world coordinates, as far from it as a view is.

    They look at the centre of the bounds. Up is where ``camera`` has it, as well as that can be.
    """
    centre = world_centre(camera, bounds)
    distance = float(np.linalg.norm(np.asarray(camera.position) - centre))
    up = np.asarray(camera.view_up) / np.linalg.norm(camera.view_up)
    aside = camera.axes[2] - up * (up @ camera.axes[2])
    aside /= np.linalg.norm(aside)
    views = []
    for direction in np.asarray(directions, dtype=np.float64):
        steep = abs(direction @ up) > _TOO_STEEP
        views.append(
            camera.replace(
                position=centre + distance * direction,
                focal_point=centre,
                view_up=aside if steep else up,
                window_center=(0.0, 0.0),
            )
        )
    return views
