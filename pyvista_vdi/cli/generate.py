"""The subcommand ``generate``: a volume becomes a file that holds a VDI."""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import closing
from pathlib import Path

from pyvista_vdi.api import generate as generate_vdi
from pyvista_vdi.cli.inputs import (
    PLACE,
    camera,
    classification,
    file_options,
    given,
    read_volume,
)
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.io import checked_target
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget
from pyvista_vdi.model.standard_cases import ELEVATION, filling_camera
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.progress import DelayedBar
from pyvista_vdi.quality.targets import describe


def generate(options: argparse.Namespace) -> int:
    """Generate a VDI and write it."""
    # Refuse what cannot be before the volume is read
    path, file_arguments = checked_target(options.output), file_options(options)
    QualityTarget(**given(options, QualityTarget, flat=True))
    look = classification(options)
    how = given(options, GenerationOptions, QualityTarget, Deferral)
    volume = read_volume(options, in_chunks=True)
    view = generating_view(options, volume)
    volume = as_seen(options, volume, view)
    if isinstance(volume, StoredVolume):
        print(volume.describe(), file=sys.stderr)
    start = time.perf_counter()
    how |= {"client": options.scheduler, "device": options.device, **look}
    with closing(DelayedBar()) as bar:
        vdi = generate_vdi(volume, view, options.size, progress=bar, **how)
    seconds = time.perf_counter() - start
    with closing(DelayedBar(label="writing it")) as bar:
        vdi.save(path, progress=bar, **file_arguments)
    say_vdi(options, vdi, f", {seconds:.1f} s")
    if (chosen := describe(vdi.metadata)) is not None:
        print(chosen)
    return 0


def say_vdi(options: argparse.Namespace, vdi: object, more: str = "") -> None:
    """Print what was written to ``--output``, a VDI or several."""
    n_bytes = f"{Path(options.output).stat().st_size / 2**20:.1f} MiB"
    print(f"{printable(options.output)}: {vdi}, {n_bytes}{more}")


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
            f"--elevation lifts a view that is {ELEVATION:g} degrees above the volume's middle, "
            f"and must leave it below 90; got {options.elevation:g}"
        )
    turned = {"azimuth": options.azimuth, "elevation": ELEVATION + options.elevation}
    if options.view_angle is not None:
        turned["view_angle"] = options.view_angle
    return filling_camera(volume.bounds, options.size, **turned)
