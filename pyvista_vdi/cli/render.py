"""The subcommands that show a VDI: ``render`` and ``view``."""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np

from pyvista_vdi.api import read
from pyvista_vdi.api import render as render_vdi
from pyvista_vdi.cli.inputs import (
    camera,
    classification,
    given,
    is_volume,
    keeps_values,
    look_for,
    measuring,
    part,
    read_volume,
    refuse,
    require_vdi,
)
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import UnsupportedError, VDIWarning
from pyvista_vdi.io import check_writable, to_bytes, write_png
from pyvista_vdi.io.files import holds
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import RATE, VDICollection
from pyvista_vdi.model.render_options import DrawingOptions, RenderOptions
from pyvista_vdi.model.standard_cases import WINDOW_SIZE, filling_camera
from pyvista_vdi.model.vdi import picture_view
from pyvista_vdi.model.whole_file import as_path, with_suffix
from pyvista_vdi.plotting.imports import import_pyvista, why_no_window


def render(options: argparse.Namespace) -> int:
    """Render a VDI from a new view and write the picture."""
    target = check_writable(with_suffix(as_path(options.output), (".png",), "a picture"))
    if not any(holds(file) == "series" for file in options.files):
        refuse(options, ("time",), "series, .vdis")
    vdis, share = [], 0.5 / len(options.files)
    with measuring("rendering") as bar:
        for k, file in enumerate(options.files):
            require_vdi(file, "render")
            found = read(file, progress=part(bar, k * share, (k + 1) * share, "reading"))
            vdis.append(_at(found, options.time))
        # A look is for those that keep values, and is over the ranges of all of them
        asks = next((k for k, vdi in enumerate(vdis) if keeps_values(vdi)), 0)
        how = look_for(options, vdis[asks], options.files[asks])
        how |= {"device": options.device, **given(options, RenderOptions)}
        bar(0.5, "drawing")
        own, size = picture_view(vdis[0])
        shown: Any = vdis[0]
        if len(vdis) > 1:
            shown = vdis
            how["model_transforms"] = [vdi.camera.model_transform for vdi in vdis]
        image = render_vdi(shown, camera(options, own), options.size or size, **how)
    write_png(to_bytes(image, options.background), target)
    print(f"{printable(options.output)}: {image.shape[1]} x {image.shape[0]}")
    return 0


def view(options: argparse.Namespace) -> int:
    """Open a plotter on a VDI, or write what it shows."""
    off_screen = options.screenshot is not None
    target = options.screenshot
    if off_screen:
        target = check_writable(with_suffix(as_path(target), (".png",), "a picture"))
    if options.file is None or holds(options.file) != "series":
        refuse(options, ("play", "rate", "time"), "series, .vdis")
    if is_volume(options):
        shown: Any = read_volume(options)
        look, size = classification(options), options.size or WINDOW_SIZE
        first = filling_camera(shown.bounds, size)
    else:
        shown = read(options.file)
        first, own = picture_view(_at(shown, options.time))
        look, size = look_for(options, shown, options.file), options.size or own
    # Last: what is wrong with the file is said with and without a display
    if not off_screen and (trouble := why_no_window()) is not None:
        raise UnsupportedError(
            f"no window can be opened: {trouble}; write a picture instead: --screenshot FILE.png"
        )
    pv = import_pyvista()
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=off_screen, window_size=list(size))
    try:
        how = {"device": options.device, **given(options, DrawingOptions), **look}
        actor = plotter.add_vdi(shown, **how)
        _show(plotter, actor, first, options)
        if target is not None:
            with warnings.catch_warnings():
                # The error itself is raised below; no file is written then
                warnings.filterwarnings("ignore", "the VDI cannot be drawn", VDIWarning)
                warnings.filterwarnings("ignore", "generating the VDI was interr", VDIWarning)
                picture = plotter.screenshot(return_img=True)
            actor.mapper.driver.raise_trouble()
            write_png(np.asarray(picture), target)
            print(f"{printable(options.screenshot)}: written")
    finally:
        plotter.close()
    return 0


def _at(found: Any, time: float | None) -> Any:
    """Return a VDI or a set, or of a series the step nearest in time, by default the first."""
    if isinstance(found, VDICollection) and found.times is not None:
        return found[0 if time is None else found.nearest(time)]
    return found


def _show(plotter: Any, actor: Any, first: Camera, options: argparse.Namespace) -> None:
    """Show an actor from a view; of a series the step that is asked for, and in a window all."""
    from pyvista_vdi.vtk_pipeline.filters.view import aim

    aim(plotter.camera, first)
    plotter.renderer.reset_camera_clipping_range()
    if options.status:
        actor.show_status()
    if options.time is not None:
        actor.time = options.time
    if options.screenshot is not None:
        return
    if actor.series is not None:
        rate = RATE if options.rate is None else options.rate
        plotter.add_key_event("space", lambda: actor.pause() if actor.playing else actor.play(rate))
        if len(actor.series) > 1:
            times = actor.series.times[0], actor.series.times[-1]
            plotter.add_slider_widget(
                lambda time: setattr(actor, "time", time),
                times,
                title="time",
                interaction_event="always",
            )
        if options.play:
            actor.play(rate)
    plotter.show()
