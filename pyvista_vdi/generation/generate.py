"""Volume to VDI, on a device: rays are marched, what they record is merged, and packed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pyvista_vdi._version import __version__
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.generation.list_arrays import growing_lists, require_room
from pyvista_vdi.generation.march import March
from pyvista_vdi.generation.records import Records
from pyvista_vdi.generation.slices import Slices
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import GridRays

Progress = Callable[[float], object]


def generate_vdi(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    options: GenerationOptions | None = None,
    *,
    device: Any = None,
    progress: Progress | None = None,
    metadata: Mapping[str, Any] | None = None,
    **changes: Any,
) -> VDI:
    """Make a VDI of a classified volume.

    Each list's ray is marched once. Neighbouring samples are merged while the medium stays
    homogeneous; what is recorded is then merged at least error, or cut by homogeneity,
    until the budget of supersegments is kept. Lists go on behind what V_O sees, because other
    views may see it.

    Parameters
    ----------
    volume : Volume
        The scalars.
    camera : Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height of V_O's window in pixels: one list each.
    transfer_function : TransferFunction
        Scalar to colour and opacity.
    options : GenerationOptions, optional
        How it is made.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the fraction done, 0 to 1, between slices of work; when it returns False the
        work is given up.
    metadata : mapping, optional
        Entries to add to ``vdi.metadata``.
    **changes
        Options by name, in place of those in ``options``.

    Returns
    -------
    VDI
        With the view, the arrays, and in its metadata what made it.

    Raises
    ------
    InvalidArgumentError
        If an argument is out of range.
    Cancelled
        If ``progress`` returned False.
    DeviceMemoryError
        If the device lacks the memory, see :func:`pyvista_vdi.estimate`, or the memory limit is too
        little even for one brick.
    """
    options = GenerationOptions.of(options, changes)
    camera = Camera.from_any(camera)
    width, height = size = check_window_size(window_size)
    require_room(0, size)
    report(progress, 0.0)  # first: a bar says that kernels are compiled
    runtime = get_runtime(device)
    slices = Slices(runtime, size, options)
    medium = DeviceVolume(runtime, volume, transfer_function, options, room=slices.room(volume))
    with (
        medium.giving_bricks_back(),
        Records(runtime, medium.rays, camera, size, slices, options) as records,
        March(records, medium, camera) as march,
        growing_lists(runtime, size, options.max_supersegments, slices.rows * width) as lists,
    ):
        for part in slices:
            records.begin(part)
            # Sample the rays' steps, merge what is alike, and make room in records that are full
            for chunk in march.chunks(part):
                march.advance(chunk)
                records.make_room(last=chunk.last)
            # Fit each record to the budget
            records.fit()
            if part.number > 0:
                lists.wait()  # for the slice before: the device has this one to go on with
                report(progress, part.first_row / height)
            # Pack the lists behind those made before
            records.pack(lists)
        offsets, front, back, color, optical_depth = lists.finished()
    report(progress, 1.0)

    made_by = made_from(volume, transfer_function, options, medium, runtime.info.name)
    return VDI(
        camera,
        size,
        offsets,
        front,
        back,
        color,
        optical_depth,
        volume.bounds,
        depth_origin=records.depth_origin,
        metadata={**made_by, **(metadata or {})},
    ).with_precision(options.precision)


def made_from(
    volume: Volume,
    transfer_function: TransferFunction,
    options: GenerationOptions,
    medium: DeviceVolume | GridRays,
    device: str,
) -> dict[str, Any]:
    """Return what made a VDI, for its metadata."""
    made_by = {
        "generator": f"pyvista-vdi {__version__}",
        "criterion": options.criterion,
        "max_supersegments": options.max_supersegments,
        "tolerance": options.tolerance,
        "view_cone": options.view_cone,
        "sample_distance": medium.sample_distance,
        "opacity_unit_distance": medium.unit_distance,
        "transfer_function": transfer_function.to_dict(),
        "volume": {
            "name": volume.name,
            "dimensions": list(volume.dimensions),
            "spacing": list(volume.spacing),
            "dtype": volume.array.dtype.name,
        },
        "device": device,
    }
    if transfer_function.shading is not None:
        made_by["lights"] = options.lights.to_dict()
    if options.ambient_occlusion is not None:
        made_by["ambient_occlusion"] = options.ambient_occlusion.to_dict(volume)
    return made_by


def report(progress: Progress | None, fraction: float) -> None:
    """Report how far generation is, and raise Cancelled if the answer is False."""
    if progress is not None and progress(fraction) is False:
        raise Cancelled(f"generation was cancelled at {fraction:.0%}")


__all__ = ["generate_vdi", "made_from", "report"]
