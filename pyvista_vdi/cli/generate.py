"""The verb ``generate``: a volume becomes a file that holds a VDI."""

from __future__ import annotations

import argparse
import sys
import time

from pyvista_vdi.api import generate as generate_vdi
from pyvista_vdi.cli.inputs import (
    ambient_occlusion,
    camera,
    classification,
    file_options,
    has_own_place,
    kept_values,
    measuring,
    read_volume,
    say_vdi,
    settings,
)
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.slices import estimate
from pyvista_vdi.io import checked_target
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.arguments import Settings
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, QualityTarget, declared
from pyvista_vdi.model.standard_cases import ELEVATION, VIEW_ANGLE, filling_camera
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.targets import describe


def generate(options: argparse.Namespace) -> int:
    """Generate a VDI and write it."""
    path = checked_target(options.output)
    file_arguments = file_options(options)
    precision = file_arguments.pop("precision", "exact")
    asked = {name: getattr(options, name) for name in declared(QualityTarget)}
    target = QualityTarget(**asked)  # refused before the volume is read, too
    arguments = classification(options)
    looks = Classification.composited(arguments, "generate")  # refused before the volume is read
    kept = kept_values(options)
    deferred = Deferral(**kept).deferred
    occlusion = ambient_occlusion(options)
    volume = read_volume(options, in_chunks=True)
    view = generating_view(options, volume)
    volume = as_seen(options, volume, view)
    if isinstance(volume, StoredVolume):
        print(volume.describe(), file=sys.stderr)
    nx, ny, nz = volume.dimensions
    width, height = options.size
    if volume.chunked:
        needed = f"{width} x {height} lists: block by block"
    elif target:
        needed = f"pictures of {width} x {height}: settings are chosen by a measurement"
    else:
        most = estimate(
            volume,
            options.size,
            max_supersegments=options.max_supersegments,
            criterion=options.criterion,
            ambient_occlusion=occlusion,
            memory_limit=options.memory_limit,
            transfer_function=None if deferred else looks.transfer_function_of(volume),
            device=options.device,
        )
        needed = f"{width} x {height} lists: up to {most.total / 2**20:.0f} MiB"
    print(f"{nx} x {ny} x {nz} points, {needed}", file=sys.stderr)
    start = time.perf_counter()
    with measuring("generating a VDI") as bar:
        vdi = generate_vdi(
            volume,
            view,
            options.size,
            max_supersegments=options.max_supersegments,
            precision=precision,
            **{name: value for name, value in asked.items() if name not in Settings.declared},
            **kept,
            ambient_occlusion=occlusion,
            settings=settings(options),
            client=options.scheduler,
            device=options.device,
            progress=bar,
            **arguments,
        )
    seconds = time.perf_counter() - start
    with measuring("writing it") as bar:
        vdi.save(path, progress=bar, **file_arguments)
    say_vdi(options, vdi, f", {seconds:.1f} s")
    chosen = describe(vdi.metadata)
    if chosen is not None:
        print(chosen)
    return 0


def as_seen(options: argparse.Namespace, volume: Volume, view: Camera) -> Volume:
    """Return a volume at the level that a view requires, where it is of a store with several."""
    if options.scheduler is not None and not volume.chunked:
        raise UnsupportedError("--scheduler is for stores of chunks, such as x.ome.zarr")
    if not isinstance(volume, StoredVolume):
        return volume
    return volume.at_level("auto" if options.level is None else options.level, view, options.size)


def generating_view(options: argparse.Namespace, volume: Volume) -> Camera:
    """Return V_O: the options' own view, or the one that the volume fills, turned as asked."""
    if has_own_place(options):
        return camera(options, filling_camera(volume.bounds, options.size))
    if not abs(ELEVATION + options.elevation) < 90:
        raise InvalidArgumentError(
            f"--elevation must lie between {-90 - ELEVATION:g} and {90 - ELEVATION:g} degrees, "
            f"both excluded, for a view that is {ELEVATION:g} degrees above the volume's middle "
            f"without it; got {options.elevation:g}: choose another, or give a --position"
        )
    return filling_camera(
        volume.bounds,
        options.size,
        azimuth=options.azimuth,
        elevation=ELEVATION + options.elevation,
        view_angle=VIEW_ANGLE if options.view_angle is None else options.view_angle,
    )
