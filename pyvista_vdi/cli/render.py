"""The subcommands that show a VDI: ``render`` and ``view``."""

from __future__ import annotations

import argparse
import warnings
from contextlib import closing
from typing import Any

import numpy as np

from pyvista_vdi.api import read
from pyvista_vdi.api import render as render_vdi
from pyvista_vdi.cli.inputs import (
    camera,
    classification,
    given,
    is_volume,
    look_for,
    read_volume,
    refuse,
)
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import UnsupportedError, VDIWarning
from pyvista_vdi.io import check_writable, to_bytes, write_png
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.options import DrawingOptions, RenderOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import picture_view
from pyvista_vdi.model.whole_file import as_path, with_suffix
from pyvista_vdi.plotting.imports import import_pyvista, why_no_window
from pyvista_vdi.plotting.progress import DelayedBar


def render(options: argparse.Namespace) -> int:
    """Render a VDI from a new view and write the picture."""
    target = check_writable(with_suffix(as_path(options.output), (".png",), "a picture"))
    with closing(DelayedBar(label="reading")) as bar:
        shown = _at(read(options.file, progress=bar), options)
    how = look_for(options, shown, options.file)
    how |= {"device": options.device, **given(options, RenderOptions)}
    own, size = picture_view(shown)
    image = render_vdi(shown, camera(options, own), options.size or size, **how)
    write_png(to_bytes(image, options.background), target)
    print(f"{printable(options.output)}: {image.shape[1]} x {image.shape[0]}")
    return 0


def view(options: argparse.Namespace) -> int:
    """Open a plotter on a VDI, or write what it shows."""
    from pyvista_vdi.vtk_pipeline.filters.view import aim

    target = options.screenshot
    if target is not None:
        target = check_writable(with_suffix(as_path(target), (".png",), "a picture"))
    if is_volume(options):
        refuse(options, ("time",), "series, .vdis")
        shown: Any = read_volume(options)
        look, size = classification(options), options.size or (1280, 720)
        first = filling_camera(shown.bounds, size)
    else:
        shown = read(options.file)
        first, own = picture_view(_at(shown, options))
        look, size = look_for(options, shown, options.file), options.size or own
    # Last: what is wrong with the file is said with and without a display
    if target is None and (trouble := why_no_window()) is not None:
        raise UnsupportedError(
            f"no window can be opened: {trouble}; write a picture instead: --screenshot FILE.png"
        )
    pv = import_pyvista()
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=target is not None, window_size=list(size))
    try:
        how = {"device": options.device, **given(options, DrawingOptions), **look}
        actor = plotter.add_vdi(shown, **how)
        aim(plotter.camera, first)
        plotter.renderer.reset_camera_clipping_range()
        if options.time is not None:
            actor.player.time = options.time
        if target is not None:
            with warnings.catch_warnings():
                # The error itself is raised below; no file is written then
                warnings.filterwarnings("ignore", "the VDI cannot be drawn", VDIWarning)
                picture = plotter.screenshot(return_img=True)
            if (trouble := actor.mapper.driver.trouble) is not None:
                raise trouble
            write_png(np.asarray(picture), target)
            print(f"{printable(options.screenshot)}: written")
            return 0
        if (player := actor.player) is not None and len(player.collection) > 1:
            play, pause = player.play, player.pause
            plotter.add_key_event("space", lambda: pause() if player.playing else play())
        plotter.show()
    finally:
        plotter.close()
    return 0


def _at(found: Any, options: argparse.Namespace) -> Any:
    """Return a VDI or a set, or of a series the step nearest in time, by default the first."""
    if isinstance(found, VDICollection) and found.times is not None:
        return found[0 if options.time is None else found.nearest(options.time)]
    refuse(options, ("time",), "series, .vdis")
    return found
