"""The subcommand ``generate``: a volume becomes a file that holds a VDI."""

from __future__ import annotations

import argparse
import sys
import time

from pyvista_vdi.api import generate as generate_vdi
from pyvista_vdi.cli.inputs import (
    PLACE,
    camera,
    classification,
    file_options,
    given,
    measuring,
    read_volume,
    refuse_with_values,
    say_vdi,
)
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.slices import estimate
from pyvista_vdi.io import checked_target
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget
from pyvista_vdi.model.standard_cases import ELEVATION, VIEW_ANGLE, filling_camera
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.targets import describe


def generate(options: argparse.Namespace) -> int:
    """Generate a VDI and write it."""
    # Refuse what cannot be before the volume is read
    path, file_arguments = checked_target(options.output), file_options(options)
    target, look = (
        QualityTarget(**given(options, QualityTarget, flat=True)),
        classification(options),
    )
    looks = Classification.composited(look, "generate")
    refuse_with_values(options)
    how = given(options, GenerationOptions, QualityTarget, Deferral)
    volume = read_volume(options, in_chunks=True)
    view = generating_view(options, volume)
    volume = as_seen(options, volume, view)
    # Say what is going to be made, and how much memory that may take
    if isinstance(volume, StoredVolume):
        print(volume.describe(), file=sys.stderr)
    (nx, ny, nz), (width, height) = volume.dimensions, options.size
    needed = f"{width} x {height} lists: block by block"
    if target and not volume.chunked:
        needed = f"pictures of {width} x {height}: settings are chosen by a measurement"
    elif not volume.chunked:
        deferred = options.classification == "deferred"
        table = None if deferred else looks.transfer_function_of(volume)
        flat = given(options, GenerationOptions, flat=True)
        flat |= {"transfer_function": table, "device": options.device}
        most = estimate(volume, options.size, **flat).total / 2**20
        needed = f"{width} x {height} lists: up to {most:.0f} MiB"
    print(f"{nx} x {ny} x {nz} points, {needed}", file=sys.stderr)
    start = time.perf_counter()
    how |= {"client": options.scheduler, "device": options.device, **look}
    with measuring("generating a VDI") as bar:
        vdi = generate_vdi(volume, view, options.size, progress=bar, **how)
    seconds = time.perf_counter() - start
    file_arguments.pop("precision", None)  # which it has
    with measuring("writing it") as bar:
        vdi.save(path, progress=bar, **file_arguments)
    say_vdi(options, vdi, f", {seconds:.1f} s")
    if (chosen := describe(vdi.metadata)) is not None:
        print(chosen)
    return 0


def as_seen(options: argparse.Namespace, volume: Volume, view: Camera) -> Volume:
    """Return a volume at the level that a view requires, where it is of a store with several."""
    if options.scheduler is not None and not volume.chunked:
        raise UnsupportedError("--scheduler is for stores of chunks, such as x.ome.zarr")
    if not isinstance(volume, StoredVolume):
        return volume
    return volume.in_view(view, window_size=options.size)


def generating_view(options: argparse.Namespace, volume: Volume) -> Camera:
    """Return V_O: the options' own view, or the one that the volume fills, turned as asked."""
    if any(getattr(options, name) is not None for name in PLACE):
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
