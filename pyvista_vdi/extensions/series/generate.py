"""Makes the VDIs of a series: one classification, one view, one volume after the other."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Sequence, Sized
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidArgumentTypeError,
    UnsupportedError,
    naming,
    warn_external,
    with_article,
)
from pyvista_vdi.extensions.series.series import Called, VDISeries, checked_times
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_range, check_callback
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.deferred import importance_points
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import (
    GENERATION_NAMES,
    Deferral,
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
    declared,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import CameraLike, ClientLike, DeviceLike, Progress, WindowSize
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import bytes_of, warn_missed
from pyvista_vdi.quality.probe import generate_anywhere

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from pyvista_vdi.extensions.series.keywords import SeriesOptions, VolumesLike

_DIAL = tuple(declared(QualityTarget))
_GRID = ("spacing", "origin")
_DEFERRAL = tuple(declared(Deferral))


def generate_series(
    volumes: VolumesLike,
    camera: CameraLike,
    window_size: WindowSize,
    times: Iterable[float] | None = None,
    *,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    client: ClientLike | None = None,
    progress: Progress | None = None,
    device: DeviceLike | None = None,
    **options: Unpack[SeriesOptions],
) -> VDISeries:
    """Generate the VDIs of a volume that changes in time, all from one view.

    The transfer function is made once, of the first step, and so is what a dial chooses: a colour
    stands for the same value in all steps. Pass ``clim`` where the first step does not have the
    range of the others, or ``value_range`` where ``classification`` is ``"deferred"``.

    Parameters
    ----------
    volumes : iterable or callable or array_like or VTK source
        The steps: each what :func:`pyvista_vdi.generate` takes, or an array indexed [z, y, x],
        for which ``spacing`` is given, so that a NumPy or Dask array indexed [step, z, y, x] will
        do. They are taken one by one. Or a function that returns step i; or a VTK or PyVista
        source that has time steps; or what :func:`pyvista_vdi.open_volume` returned for a store
        that has. Of a multi-scale store, steps are of the level that the view requires, unless
        another was asked for.
    camera : pyvista.Camera or vtkCamera or Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height in pixels.
    times : iterable of float, optional
        Of the steps, ascending; those of a source or a store, else 0, 1, 2 … by default. For a
        function they say how many steps there are.
    spacing, origin : (float, float, float), optional
        Of steps that are bare arrays, (x, y, z).
    client : distributed.Client, optional
        As for :func:`pyvista_vdi.generate`: of a Dask cluster, whose workers make the VDIs of
        chunked volumes. Dask arrays are chunked then, and else brought into memory step by step.
    progress : callable, optional
        Called with the finished fraction, 0 to 1, of the series where its length is known, else of
        each step; work stops if it returns ``False``.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    **options
        All else that :func:`pyvista_vdi.generate` takes, classification included. ``precision`` is
        ``"8-byte"`` by default.

    Returns
    -------
    VDISeries
        In memory. Its ``volumes`` are the steps' as :class:`Volume` where they can be had again:
        where ``volumes`` is a sequence, a function or a source. To write a series that need not
        fit in memory, see :class:`pyvista_vdi.SeriesWriter`.

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
    check_callback(progress)
    steps, known_times = _steps(volumes, times)
    make = StepMaker(
        "generate_series",
        camera,
        window_size,
        device=device,
        client=client,
        spacing=spacing,
        origin=origin,
        **options,
    )
    sized = steps if known_times is None else known_times
    total = len(sized) if isinstance(sized, Sized) else None
    vdis: list[VDI] = []
    for volume in steps:
        if known_times is not None and len(vdis) == len(known_times):
            raise InvalidArgumentError(f"there are more steps than the {len(vdis)} times")
        with naming(f"step {len(vdis)}"):
            vdis.append(make(volume, _part(progress, len(vdis), total)))
        warn_missed(vdis[-1])
    again: Sequence[Volume] | None = None
    if isinstance(steps, Sized) and hasattr(steps, "__getitem__"):
        again = Called(partial(_volume_at, make, steps), range(len(vdis)))
    if not vdis:
        raise InvalidArgumentError("there is no step: pass at least one volume")
    series = VDISeries(vdis, range(len(vdis)) if known_times is None else known_times, again)
    series._maker = make
    return series


def _volume_at(make: StepMaker, steps: Any, i: int) -> Volume:
    return make.volume(steps[i])


class StepMaker:
    """Makes a VDI of each volume that it is called with, all by what the first one implied."""

    def __init__(
        self,
        function: str,
        camera: Any,
        window_size: Sequence[int],
        default_precision: str = "8-byte",
        *,
        device: Any = None,
        client: Any = None,
        **given: Any,
    ) -> None:
        self._camera = Camera.from_any(camera)
        self._size = self._pictures = check_window_size(window_size)
        self._device, self._client = device, client
        others = (*GENERATION_NAMES, *_DIAL, *_GRID, *_DEFERRAL)
        looks = {n: v for n, v in given.items() if n not in others}
        self._looks = Classification.composited(looks, function, others)
        self._target = QualityTarget(**{n: given[n] for n in _DIAL if n in given})
        self.deferral = Deferral(**{n: given[n] for n in _DEFERRAL if n in given})
        if self.deferral.deferred:
            self._looks.require_no_look()
            self.deferral.refuse_target(self._target)
            self._table: TransferFunction | None = unclassified(self._looks.interpolation)
        else:
            self._table = None
        options = {n: given[n] for n in GENERATION_NAMES if n in given}
        if not self._target:
            options.setdefault("precision", default_precision)
        self._options = GenerationOptions(**options)
        self.deferral = checked_deferral(self.deferral, self._options)
        self._grid = {n: given[n] for n in _GRID if given.get(n) is not None}
        self._chosen: dict[str, Any] = {}
        self._max_bytes = self._target.max_bytes

    def __call__(
        self,
        volume: Any,
        progress: Progress | None = None,
        *,
        camera: Any = None,
        window_size: Sequence[int] | None = None,
    ) -> VDI:
        """Return a step's VDI."""
        volume = self.volume(volume)
        # The first step's range is all steps', while a property's functions have theirs in each
        if self._table is None or self._looks.in_place:
            self._table = self._looks.transfer_function_of(volume)
        request = GenerationRequest(
            volume,
            self._table,
            self._camera if camera is None else Camera.from_any(camera),
            self._size if window_size is None else check_window_size(window_size),
            self._options,
            self._device,
            progress,
            {"classification": self._looks.describe(), "scalars": volume.name, **self._chosen},
        )
        if self.deferral.deferred:
            kept = generate_deferred(request, self.deferral, self._anywhere)
            self.deferral = dataclasses.replace(self.deferral, value_range=kept.value_range)
            return kept  # type: ignore[return-value]
        vdi = self._anywhere(request)
        if self._target:
            self._keep_the_choice(vdi)
        elif self._max_bytes is not None and bytes_of(vdi) > self._max_bytes:
            warn_external(
                f"max_bytes={self._max_bytes} is not kept by all steps: one has {bytes_of(vdi)} "
                "bytes on the device, with what was chosen for the first step; allow less, or "
                "begin with a step that has as much to show"
            )
            self._max_bytes = None  # told once
        return vdi

    def _anywhere(self, request: GenerationRequest) -> VDI:
        return generate_anywhere(request, self._target, self._client)

    def volume(self, volume: Any) -> Volume:
        """Return what a user calls a step's volume as a :class:`Volume`."""
        if self._grid and not hasattr(volume, "GetClassName") and not isinstance(volume, Volume):
            array = volume if self._client is not None else np.asarray(volume)
            volume = Volume(array, **self._grid)
        volume = as_volume(volume, self._looks.scalars, self._looks.preference)
        return volume.in_view(self._camera, window_size=self._pictures)

    def _keep_the_choice(self, vdi: VDI) -> None:
        """Take what the dial chose for the first step as the settings of all others."""
        self._target = QualityTarget()
        self._size = vdi.window_size
        # Missed targets are told once
        self._chosen = {"dial": {**vdi.metadata["dial"], "missed": []}}
        chosen = vdi.metadata["dial"]["chosen"]
        self._options = dataclasses.replace(
            self._options,
            max_supersegments=chosen["max_supersegments"],
            precision=chosen["precision"],
        )


def checked_deferral(deferral: Deferral, options: GenerationOptions) -> Deferral:
    """Return what is to be kept, or raise now what generation would raise of it for any volume."""
    if not deferral.deferred:
        return deferral
    if options.precision == "16-byte":
        raise UnsupportedError(
            "a DeferredVDI has no 16-byte supersegments: choose 'exact' or '8-byte'"
        )
    ends = deferral.value_range
    if ends is None:  # that of the first step: any that the points of importance lie in
        points = importance_points(deferral.importance, (0.0, 1.0)) or ((0.0, 1.0),)
        ends = points[0][0], max(points[-1][0], points[0][0] + 1)
    request = GenerationRequest(
        Volume(np.zeros((2, 2, 2), np.uint8), (1.0, 1.0, 1.0)),
        unclassified("nearest"),
        Camera((0, 0, 1), (0, 0, 0), (0, 1, 0)),
        (1, 1),
        options,
    )
    generate_deferred(request, dataclasses.replace(deferral, value_range=ends), lambda _: None)
    if deferral.value_range is None:
        return deferral
    return dataclasses.replace(deferral, value_range=as_range(ends))


def _steps(
    volumes: Any, times: Iterable[float] | None
) -> tuple[Iterable[Any], tuple[float, ...] | None]:
    """Return the steps' volumes, a sequence where they can be had again, and their times."""
    known = None if times is None else checked_times(times)
    if hasattr(volumes, "GetOutputPort") or hasattr(volumes, "time_values"):
        from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times

        volumes, own = steps_and_times(volumes)
        known = checked_times(own) if known is None else known
    elif callable(volumes):
        if known is None:
            raise InvalidArgumentError(
                "volumes is a function of the step's index: pass times, one for each step"
            )
        volumes = Called(volumes, range(len(known)))
    elif isinstance(volumes, StoredVolume) and len(volumes.store.times) > 1:
        own = volumes.store.times
        known = checked_times(own) if known is None else known
        volumes = Called(volumes.at_time, range(len(own)))
    elif isinstance(volumes, Volume) or hasattr(volumes, "GetClassName"):
        raise InvalidArgumentError(
            "volumes are the steps of a series, got one volume: pass a list, or call generate"
        )
    elif isinstance(volumes, str | bytes | os.PathLike) or not np.iterable(volumes):
        raise InvalidArgumentTypeError(
            "volumes must be an iterable of volumes, or a function; got "
            f"{with_article(type(volumes).__name__)}: open files by pyvista.read or "
            "pyvista_vdi.open_volume, one step after the other"
        )
    if known is not None and hasattr(volumes, "__len__") and len(volumes) != len(known):
        raise InvalidArgumentError(f"there are {len(volumes)} steps and {len(known)} times")
    return volumes, known


def _part(progress: Progress | None, step: int, total: int | None) -> Progress | None:
    """Return what reports a step's progress as the series'."""
    if progress is None or total is None:
        return progress
    return lambda fraction: progress((step + fraction) / total)
