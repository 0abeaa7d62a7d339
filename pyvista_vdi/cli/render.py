"""The verbs that show a VDI: ``render`` and ``view``."""

from __future__ import annotations

import argparse

from pyvista_vdi.api import read
from pyvista_vdi.api import render as render_vdi
from pyvista_vdi.cli.inputs import camera
from pyvista_vdi.cli.text import printable
from pyvista_vdi.io import checked_png_target, to_bytes, write_png


def render(options: argparse.Namespace) -> int:
    """Render a VDI from a new view and write the picture."""
    target = checked_png_target(options.output)
    vdis = [read(file) for file in options.files]
    first = vdis[0]
    view = camera(options, first.camera)
    if len(vdis) == 1:
        image = render_vdi(
            first,
            view,
            options.size,
            transmittance_cutoff=options.transmittance_cutoff,
            device=options.device,
        )
    else:
        image = render_vdi(
            vdis,
            view,
            options.size or first.window_size,
            model_transforms=[vdi.camera.model_transform for vdi in vdis],
            transmittance_cutoff=options.transmittance_cutoff,
            device=options.device,
        )
    write_png(to_bytes(image, options.background), target)
    print(f"{printable(options.output)}: {image.shape[1]} x {image.shape[0]}")
    return 0


def view(options: argparse.Namespace) -> int:
    """Open a plotter on a VDI, or write what it shows."""
    screenshot = None
    if options.screenshot is not None:
        screenshot = str(checked_png_target(options.screenshot))
    vdi = read(options.file)
    from pyvista_vdi.plotting.cli_support import show

    show(
        vdi,
        options.size,
        screenshot,
        target_fps=options.target_fps,
        regenerate=options.regenerate,
        status=options.status,
    )
    if screenshot is not None:
        print(f"{printable(options.screenshot)}: written")
    return 0
