"""The subcommand ``series`` and its options."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from contextlib import closing
from functools import partial
from itertools import pairwise
from pathlib import Path

from pyvista_vdi.cli.generate import as_seen, generating_view, say_vdi
from pyvista_vdi.cli.inputs import (
    LOOK,
    OF_VOLUMES,
    PLACE,
    classification,
    file_options,
    given,
    refuse,
)
from pyvista_vdi.cli.steps import Step, in_order, steps_of_volumes
from pyvista_vdi.errors import InvalidArgumentError, naming
from pyvista_vdi.extensions.series.archive import Called
from pyvista_vdi.extensions.series.generate import StepMaker
from pyvista_vdi.extensions.series.series import VDISeries, check_range
from pyvista_vdi.io import read, read_info
from pyvista_vdi.io.files import holds
from pyvista_vdi.model.checks import as_number
from pyvista_vdi.model.options import Deferral, GenerationOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import check_writable, with_suffix
from pyvista_vdi.plotting.progress import DelayedBar

#: Options that are for volumes alone.
_OF_VOLUMES = (*OF_VOLUMES, *LOOK, *PLACE, "view_angle", "sample_distance", "memory_limit")


def series(options: argparse.Namespace) -> int:
    """Write a series of the files that are named: VDIs or volumes."""
    files = in_order(options.files)
    kinds = {holds(file) for file in files}
    of_vdis = kinds == {"VDI"}
    if len(kinds) > 1:
        raise InvalidArgumentError("the files are VDIs or volumes, and not some of each")
    if of_vdis:
        refuse(options, (*_OF_VOLUMES, "scheduler", *Deferral.declared), "volumes")
        known = (as_number(read_info(file).metadata.get("time")) for file in files)
        steps = [Step(f, t, partial(read, f)) for f, t in zip(files, known, strict=True)]
    else:
        steps = steps_of_volumes(files, options, in_chunks=True)

    def vdi_of(i: int) -> VDI:
        with naming(f"{steps[i].name}: step {i}"):
            found = steps[i].read() if i else first
            if not of_vdis:
                return make(as_seen(options, found, view))
            check_range(found, getattr(first, "value_range", None), steps[i].name)
            return found  # type: ignore[no-any-return]

    # Refuse what cannot be before a volume is read
    times = _times(steps) if options.times is None else options.times
    vdis = VDISeries(Called(vdi_of, range(len(steps))), times)
    how = classification(options) | given(options, GenerationOptions, Deferral)
    check_writable(with_suffix(Path(options.output), (".vdis",), "a series"))
    with closing(DelayedBar(label="writing a series")) as bar:
        with naming(steps[0].name):
            first = steps[0].read()
        if not of_vdis:
            view = generating_view(options, first)
            how |= {"device": options.device, "client": options.scheduler}
            make = StepMaker("series", view, options.size, **how)
        vdis.save(options.output, progress=bar, **file_options(options))
    say_vdi(options, f"{len(vdis)} steps")
    return 0


def _times(steps: Sequence[Step]) -> Sequence[float]:
    """Return the times that the files have where these ascend, else numbers."""
    known = [t for t in (step.time for step in steps) if t is not None and not math.isnan(t)]
    if len(known) == len(steps) and all(a < b for a, b in pairwise(known)):
        return known
    if known:
        print("Times in the files do not ascend, or some lack: steps are numbered", file=sys.stderr)
    return range(len(steps))


OPTIONS = """
VDIS|VOLUMES
output  FILE     .vdis to write
times   A,B,...  of the steps, ascending (default: those in the files, else 0,1,2,...)
[file]
compression  {zstd,lz4,deflate,none}  by default zstd
compression_level
precision=8-byte  {8-byte,exact}  of the supersegments
[volumes] What VDIs are made of them; not for VDIs.
spacing origin level channel series time_index size=1280x720 max_supersegments sample_distance
memory_limit scheduler
camera: the view that the first volume fills
table: deferral: device
"""
