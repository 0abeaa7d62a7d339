"""Volume to VDI, on a device: rays are marched, what they record is merged, and packed."""

from contextlib import ExitStack, nullcontext
from dataclasses import asdict
from typing import Any

from pyvista_vdi._version import __version__
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.generation.list_arrays import GrowingLists
from pyvista_vdi.generation.march import CHUNK_STEPS, March, Records, Slices
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.types import Progress
from pyvista_vdi.model.vdi import VDI, made_vdi
from pyvista_vdi.volume.bricks import SAMPLE_BYTES, Room
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import GridRays


def generate_vdi(request: GenerationRequest) -> VDI:
    """Make a VDI of a classified volume: the view, the arrays, and in its metadata what made it.

    Each list's ray is marched once. Neighbouring samples are merged while the medium stays
    homogeneous; what is recorded is then merged where the error is least, or cut by homogeneity,
    until the budget of supersegments is kept. Lists go on behind what V_O sees, because other views
    may see it.

    Raises InvalidArgumentError if an argument is out of range, Cancelled if the request's
    ``progress`` returned False, and DeviceMemoryError if the device lacks the memory, see
    :func:`pyvista_vdi.estimate`, or the memory limit is too little even for one brick.
    """
    volume, options, progress = request.volume, request.options, request.progress
    camera, size = request.camera, request.window_size
    width, height = size
    report(progress, 0.0)  # first: a bar says that kernels are compiled
    runtime = get_runtime(request.device)
    slices = Slices(runtime, size, options)
    beside = slices.bytes + options.occlusion_bytes(volume)
    samples = slices.items * CHUNK_STEPS * SAMPLE_BYTES
    room = Room(options.memory_limit, beside, samples, slices.text)
    medium = DeviceVolume(runtime, volume, request.transfer_function, options, room=room)
    limit, stay = options.max_supersegments, options.memory_limit is None
    with ExitStack() as stack:
        keep = stack.enter_context
        keep(medium.bricks or nullcontext())
        records = Records(runtime, medium.rays, camera, size, slices, options, keep)
        march = March(records, medium, camera, keep)
        lists = keep(GrowingLists(runtime, size, limit, slices.rows * width, stay=stay))
        for part in slices.parts:
            records.begin(part)
            # Sample the rays' steps, merge what is alike, and make room in records that are full
            for chunk in march.chunks(part):
                march.advance(chunk)
                records.make_room(last=chunk.stop >= march.most_steps)
            # Fit each record to the budget
            records.fit()
            # Pack the lists behind those made before
            records.pack(lists)
            report(progress, part.first_row / height)
        arrays = lists.finished()
    report(progress, 1.0)
    return made_vdi(
        arrays,
        camera=camera,
        window_size=size,
        bounds=volume.bounds,
        depth_origin=records.depth_origin,
        metadata={**made_from(request, medium.rays, runtime.info.name), **request.metadata},
    ).with_precision(options.precision)


def made_from(request: GenerationRequest, rays: GridRays, device: str) -> dict[str, Any]:
    """Return what made a VDI, for its metadata."""
    volume, options = request.volume, request.options
    transfer_function = request.transfer_function
    made_by = {
        "generator": f"pyvista-vdi {__version__}",
        "criterion": options.criterion,
        "max_supersegments": options.max_supersegments,
        "tolerance": options.tolerance,
        "view_cone": options.view_cone,
        "sample_distance": rays.sample_distance,
        "opacity_unit_distance": rays.unit_distance,
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
        made_by["lights"] = asdict(options.lights)
    if (occlusion := options.ambient_occlusion) is not None:
        made_by["ambient_occlusion"] = {**asdict(occlusion), "radius": occlusion.radius_in(volume)}
    return made_by


def report(progress: Progress | None, fraction: float) -> None:
    """Report how far generation is, and raise Cancelled if the answer is False."""
    if progress is not None and progress(fraction) is False:
        raise Cancelled(f"generation was cancelled at {fraction:.0%}")
