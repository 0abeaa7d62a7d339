"""The verbs that show a VDI: ``render`` and ``view``."""

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
    is_series,
    is_volume,
    keeps_values,
    look_for,
    measuring,
    part,
    read_volume,
    refuse,
    require_vdi,
    settings,
)
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import UnsupportedError, VDIWarning
from pyvista_vdi.io import checked_png_target, to_bytes, write_png
from pyvista_vdi.io.files import holds
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import RATE, VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.standard_cases import WINDOW_SIZE, filling_camera
from pyvista_vdi.model.vdi import VDI, picture_view
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.imports import import_pyvista
from pyvista_vdi.plotting.screen import why_no_window

#: What has times.
_SERIES = "series, .vdis"


def render(options: argparse.Namespace) -> int:
    """Render a VDI from a new view and write the picture."""
    target = checked_png_target(options.output)
    if not any(holds(file) == "series" for file in options.files):
        refuse(options, ("time",), _SERIES)
    vdis, share = [], 0.5 / len(options.files)
    with measuring("rendering") as bar:
        for k, file in enumerate(options.files):
            require_vdi(file, "render")
            found = read(file, progress=part(bar, k * share, (k + 1) * share, "reading"))
            vdis.append(_at(found, options.time))
        # A look is for those that keep values, and is over the ranges of all of them
        asks = next((k for k, vdi in enumerate(vdis) if keeps_values(vdi)), 0)
        look = look_for(options, vdis[asks], options.files[asks])
        bar(0.5, "drawing")
        first = vdis[0]
        own, size = picture_view(first)
        view = camera(options, own)
        several = len(vdis) > 1
        transforms = [vdi.camera.model_transform for vdi in vdis]
        image = render_vdi(
            vdis if several else first,
            view,
            options.size or size,
            model_transforms=transforms if several else None,
            settings=settings(options),
            device=options.device,
            **look,
        )
    write_png(to_bytes(image, options.background), target)
    print(f"{printable(options.output)}: {image.shape[1]} x {image.shape[0]}")
    return 0


def view(options: argparse.Namespace) -> int:
    """Open a plotter on a VDI, or write what it shows."""
    screenshot = None
    if options.screenshot is not None:
        screenshot = str(checked_png_target(options.screenshot))
    if not is_series(options):
        refuse(options, ("play", "rate", "time"), _SERIES)
    shown: Any
    if is_volume(options):
        look = classification(options)
        shown = read_volume(options)
        size = options.size or WINDOW_SIZE
        first = filling_camera(shown.bounds, size)
    else:
        shown = read(options.file)
        vdi = _at(shown, options.time)
        first, own = picture_view(vdi)
        size = options.size or own
        look = look_for(options, shown, options.file)
    # Last: what is wrong with the file is said with and without a display
    if screenshot is None and (trouble := why_no_window()) is not None:
        raise UnsupportedError(
            f"no window can be opened: {trouble}; write a picture instead: --screenshot FILE.png"
        )
    _show(shown, first, size, look, options, screenshot)
    if screenshot is not None:
        print(f"{printable(options.screenshot)}: written")
    return 0


def _at(found: VDI | DeferredVDI | VDICollection, time: float | None) -> Any:
    """Return a VDI or a set, or of a series the step nearest in time, by default the first."""
    if isinstance(found, VDICollection) and found.times is not None:
        return found[0 if time is None else found.nearest(time)]
    return found


def _show(
    shown: VDI | DeferredVDI | VDICollection | Volume,
    camera: Camera,
    size: tuple[int, int],
    looks: dict[str, Any],
    options: argparse.Namespace,
    screenshot: str | None,
) -> None:
    """Open a plotter that shows one of these from a view, or write what it shows.

    No file is written where the picture cannot be drawn or is interrupted.
    """
    pv = import_pyvista()
    from pyvista_vdi.vtk_pipeline.filters.view import aim

    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=screenshot is not None, window_size=list(size))
    try:
        actor = plotter.add_vdi(
            shown,
            target_fps=options.target_fps,
            regenerate=options.regenerate,
            draw=options.draw,
            device=options.device,
            **looks,
        )
        if options.status:
            actor.show_status(plotter)
        if isinstance(shown, VDICollection) and shown.times is not None:
            _begin(actor, plotter, options, slider=screenshot is None)
        aim(plotter.camera, camera)
        plotter.renderer.reset_camera_clipping_range()
        if screenshot is None:
            plotter.show()
            return
        with warnings.catch_warnings():
            # The error itself is raised below
            warnings.filterwarnings("ignore", "the VDI cannot be drawn", VDIWarning)
            warnings.filterwarnings("ignore", "generating the VDI was interrupted", VDIWarning)
            picture = plotter.screenshot(return_img=True)
        actor.mapper.driver.raise_trouble()
        write_png(np.asarray(picture), screenshot)
    finally:
        plotter.close()


def _begin(actor: Any, plotter: Any, options: argparse.Namespace, *, slider: bool) -> None:
    """Show the step that is asked for, and in a window its slider; the space bar plays."""
    if options.time is not None:
        actor.time = options.time
    if not slider:
        return
    if len(actor.series) > 1:
        actor.add_time_slider(plotter)

    rate = RATE if options.rate is None else options.rate

    def play_or_pause() -> None:
        if actor.playing:
            actor.pause()
        else:
            actor.play(rate)

    plotter.add_key_event("space", play_or_pause)
    if options.play:
        actor.play(rate)
