"""Makes the VDIs of a series: one classification, one view, one volume after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Sized
from itertools import islice
from typing import Any

import numpy as np

from pyvista_vdi.api import generate
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, naming
from pyvista_vdi.extensions.series.archive import Called
from pyvista_vdi.extensions.series.series import VDISeries, checked_times
from pyvista_vdi.io.progress import Pieces
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.classification import IN_PLACE, Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import Deferral, GenerationOptions
from pyvista_vdi.model.types import CameraLike, ClientLike, DeviceLike, Progress, WindowSize
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.volume import Volume


def generate_series(
    volumes: Any,
    camera: CameraLike,
    window_size: WindowSize,
    times: Iterable[float] | None = None,
    *,
    client: ClientLike | None = None,
    progress: Progress | None = None,
    device: DeviceLike | None = None,
    **options: Any,
) -> VDISeries:
    """Generate the VDIs of a volume that changes in time, all from one view.

    The transfer function is made once, of the first step: a colour stands for the same value in all
    steps. Pass ``clim`` where the first step does not have the
    range of the others, or ``value_range`` where ``classification`` is ``"deferred"``.

    Parameters
    ----------
    volumes : iterable
        The steps: each what :func:`pyvista_vdi.generate` takes. They are taken one by one. Or what
        :func:`pyvista_vdi.read_volume` returned for a store that has time steps. Of a multi-scale
        store, steps are of the level that the view requires, unless another was asked for.
    camera : pyvista.Camera or vtkCamera or Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height in pixels.
    times : iterable of float, optional
        Of the steps, ascending; those of a store, else 0, 1, 2 … by default.
    client : distributed.Client, optional
        As for :func:`pyvista_vdi.generate`: of a Dask cluster, whose workers make the VDIs of
        chunked volumes.
    progress : callable, optional
        Called after each step with the finished fraction, where the number of steps is known; work
        stops if it returns ``False``.
    device : str, DeviceInfo or Runtime, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    **options
        All else that :func:`pyvista_vdi.generate` takes, classification included, but for quality
        targets. ``precision`` is ``"8-byte"`` by default.

    Returns
    -------
    VDISeries
        In memory. To write a series that need not fit in memory, see
        :class:`pyvista_vdi.SeriesWriter`.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If times do not ascend, or are not as many as the steps, or an option cannot be used.
    InvalidVolumeError
        If a step is no volume, or has no value to render; the message says which.
    Cancelled
        If ``progress`` returned ``False``.

    See Also
    --------
    generate : has the options, and the other errors.
    """
    if isinstance(volumes, StoredVolume) and len(volumes.store.times) > 1:
        times = volumes.store.times if times is None else times
        volumes = Called(volumes.at_time, range(len(volumes.store.times)))
    known = None if times is None else checked_times(times)
    single = isinstance(volumes, Volume | str | bytes) or hasattr(volumes, "GetClassName")
    if single or not np.iterable(volumes):
        raise InvalidArgumentTypeError(
            f"volumes must be volumes, one for each step; got {type(volumes).__name__}: pass a list"
        )
    if known is not None and isinstance(volumes, Sized) and len(volumes) != len(known):
        raise InvalidArgumentError(f"there are {len(volumes)} steps and {len(known)} times")
    where = {"client": client, "device": device}
    make = StepMaker("generate_series", camera, window_size, **where, **options)
    sized: Any = volumes if known is None else known
    done = Pieces(progress, len(sized) if isinstance(sized, Sized) else 0)
    vdis: list[VDI] = []
    for volume in islice(volumes, None if known is None else len(known) + 1):  # one is too many
        with naming(f"step {len(vdis)}"):
            vdis.append(make(volume))
        done()
    return VDISeries(vdis, known)


class StepMaker:
    """Makes a VDI of each volume that it is called with, all by what the first one implied.

    ``options``: those of :func:`generate_series`. They are checked here, before a volume is read.
    """

    def __init__(
        self, function: str, camera: Any, window_size: Sequence[int], **options: Any
    ) -> None:
        self._camera, self._size = Camera.from_any(camera), check_window_size(window_size)
        self._where = {name: options.pop(name, None) for name in ("client", "device")}
        records = Classification, Deferral, GenerationOptions
        self._looks, deferral, _ = records_of(options, function, *records)
        self._described = self._looks.describe()
        if deferral.deferred:
            self._looks.require_no_look()
        options.setdefault("precision", "8-byte")
        self._scalars = options.pop("scalars", None), options.pop("preference", "point")
        self._options = options

    def __call__(self, volume: Any) -> VDI:
        """Return a step's VDI."""
        volume = as_volume(volume, *self._scalars)
        volume = volume.in_view(self._camera, window_size=self._size)
        in_place = {*IN_PLACE} & {*self._looks.given}
        if not in_place and self._options.get("classification") != "deferred":
            # A colour stands for the same value in all steps
            table = self._looks.transfer_function_of(volume)
            self._looks = Classification(transfer_function=table)
            kept = {n: v for n, v in self._options.items() if n not in Classification.declared}
            self._options = {**kept, "transfer_function": table}
        vdi: Any = generate(volume, self._camera, self._size, **self._where, **self._options)
        vdi.metadata["classification"] = self._described  # as the first step's was asked for
        if isinstance(vdi, DeferredVDI):
            self._options["value_range"] = vdi.value_range
        return vdi  # type: ignore[no-any-return]
