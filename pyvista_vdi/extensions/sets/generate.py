"""Makes the VDIs of a set: as many, and from where, as pictures of all directions need."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError
from pyvista_vdi.extensions.sets.placing import Placing, Progress
from pyvista_vdi.extensions.sets.sphere import orbit, spiral, spread
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.sets.view_maker import Growth, ViewMaker
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, check_callback
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.options import GENERATION_NAMES, GenerationOptions, check_max_supersegments
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.types import CameraLike, DeviceLike, VolumeLike, WindowSize

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from pyvista_vdi.extensions.series.keywords import SetOptions

#: What a set takes of generation: its precision is always "8-byte".
_OPTIONS = tuple(name for name in GENERATION_NAMES if name != "precision")

#: SSIM that every direction is to have.
TARGET_SSIM = 0.98
#: Directions of a sphere whose error is measured.
DIRECTIONS = 160
#: Most VDIs of a set.
MOST_VIEWS = 400
#: Half angle of the cone that a V_O of a set has to serve, degrees: others serve what is beyond.
VIEW_CONE = 30.0


def generate_set(
    volume: VolumeLike,
    views: str | Iterable[CameraLike] = "sphere",
    window_size: WindowSize = (640, 360),
    *,
    camera: CameraLike | None = None,
    target_ssim: float = TARGET_SSIM,
    max_bytes: int | None = None,
    max_views: int = MOST_VIEWS,
    lists: float | None = None,
    max_supersegments: int | None = None,
    device: DeviceLike | None = None,
    progress: Progress | None = None,
    **options: Unpack[SetOptions],
) -> VDISet:
    """Generate VDIs of a volume from as many views as pictures from all sides need.

    A few VDIs tell how lists are to be made and about how many V_Os it takes. Then the error of
    pictures between the V_Os is measured, and where it is largest another V_O is put, until each
    direction reaches the target.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        As for :func:`pyvista_vdi.generate`. It is uploaded once; of a store, the finest level that
        one of the views requires is loaded.
    views : "sphere" or sequence of cameras
        What is to be seen: the volume from all directions, or from these views. V_Os are put
        among these.
    window_size : (int, int)
        Width and height of the pictures, pixels.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        A view of the sphere: it tells how far the eye is from the centre of the volume, the lens
        and what is up. By default the view that the volume just fills.
    target_ssim : float
        SSIM against volume rendering that each direction is to have, 0 to 1.
    max_bytes : int, optional
        Most bytes of the file that :meth:`VDISet.save` writes by default; goes before the target.
    max_views : int
        Most VDIs.
    lists : float, optional
        Lists along an edge over pixels, for all V_Os; by default what takes the fewest bytes by a
        short measurement.
    max_supersegments : int, optional
        Longest list; by default by that measurement as well.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with about the finished fraction, 0 to 1; work stops if it returns ``False``.
    **options
        All else that :func:`pyvista_vdi.generate` takes, classification included, but for
        ``precision``, which is ``"8-byte"``, and a dial. ``view_cone`` is 30 by default.

    Returns
    -------
    VDISet
        In memory. ``about["reached"]`` says what was measured in the end.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If an argument is out of its range.
    Cancelled
        If ``progress`` returned ``False``.

    Warns
    -----
    VDIWarning
        If the target is not reached everywhere; if no VDI is small enough for ``max_bytes``.

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
    check_callback(progress)
    size = check_window_size(window_size)
    goal = as_float(target_ssim)
    if not 0 < goal < 1:
        raise InvalidArgumentError(f"target_ssim must be between 0 and 1; got {target_ssim!r}")
    if max_bytes is not None and not as_float(max_bytes) > 0:
        raise InvalidArgumentError(f"max_bytes must be above 0; got {max_bytes!r}")
    if not 1 <= as_float(max_views) < math.inf:
        raise InvalidArgumentError(f"max_views must be 1 or more; got {max_views!r}")
    if lists is not None and not 0.05 <= as_float(lists) <= 8:
        raise InvalidArgumentError(f"lists must be 0.05 to 8 per pixel; got {lists!r}")
    if max_supersegments is not None:
        max_supersegments = check_max_supersegments(max_supersegments)
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"a window of {size[0]} x {size[1]} pixels has no SSIM to place views by: it takes "
            f"{SSIM_WINDOW} along each edge"
        )
    given: dict[str, Any] = dict(options)
    chosen = {name: given.pop(name) for name in _OPTIONS if name in given}
    looks = Classification.composited(given, "generate_set", _OPTIONS)
    read = as_volume(volume, looks.scalars, looks.preference)
    if isinstance(views, str):
        if views != "sphere":
            raise InvalidArgumentError(f"views must be 'sphere' or cameras; got {views!r}")
        around = filling_camera(read.bounds, size) if camera is None else Camera.from_any(camera)
        probes = orbit(around, read.bounds, spiral(DIRECTIONS))
    else:
        if camera is not None:
            raise InvalidArgumentError("camera is for views='sphere': leave it out with cameras")
        if not np.iterable(views):
            raise InvalidArgumentTypeError(f"views must be 'sphere' or cameras; got {views!r}")
        probes = [Camera.from_any(view) for view in views]
        if not probes:
            raise InvalidArgumentError("there is no view: pass at least one camera")
    read = read.load_in_view(*probes, window_size=size)
    maker = ViewMaker(
        read,
        looks.transfer_function_of(read),
        size,
        GenerationOptions(**{"view_cone": VIEW_CONE, "precision": "8-byte", **chosen}),
        {"classification": looks.describe(), "scalars": read.name},
        device,
    )
    sphere = isinstance(views, str)
    placing = Placing(maker, probes, goal, max_bytes, int(max_views), progress)
    placing.measure(lists, max_supersegments, sphere=sphere)
    settings, vdi_set = placing.placed(
        lambda n: orbit(probes[0], read.bounds, spread(n)) if sphere else probes[:1],
        around if sphere else probes[0],
    )
    vdi_set._maker = Growth(maker, settings, goal)
    return vdi_set
