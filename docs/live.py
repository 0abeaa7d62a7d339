"""The VDIs that turn on the site's pages, made when it is built: no file of them is committed.

Each is a page of its own, as ``VDI.save("x.html")`` writes it, and stands in an ``<iframe>``, which
browsers load when it comes near the screen. Where there is no WebGL 2 it is a still picture.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pyvista_vdi as pvdi
from pyvista_vdi import examples

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: The folder of the pages within the site.
FOLDER = "live"

#: Lists; a page has about four MB.
SIZE = (400, 300)

BACKGROUND = (0.1, 0.1, 0.15)


def make_brain(size: tuple[int, int]) -> pvdi.VDI:
    """Return the shipped brain, from its left and above, with dark furrows."""
    volume = examples.load_brain()
    x, y, z = volume.center
    camera = pvdi.Camera((x - 260, y + 260, z + 170), (x, y, z), (0, 0, 1))
    return volume.vdi.generate(
        camera,
        size,
        cmap="bone",
        opacity=[0, 0, 0, 0.6, 1, 1],
        ambient_occlusion=pvdi.AmbientOcclusion(strength=0.15),
        max_supersegments=10,
    )


def make_rayleigh_taylor(size: tuple[int, int]) -> pvdi.VDI:
    """Return the shipped mixing layer: both fluids are transparent, what is mixed is not."""
    volume = examples.load_data("rayleigh_taylor")
    x, y, z = volume.center
    camera = pvdi.Camera((x + 300, y - 380, z + 120), (x, y, z), (0, 0, 1))
    opacity = [0.0, 0.0, 0.02, 0.1, 0.3, 0.1, 0.02, 0.0, 0.0]
    return volume.vdi.generate(camera, size, cmap="coolwarm", opacity=opacity, max_supersegments=10)


#: What makes each page, by its file's name and the page's title.
PAGES = {
    "brain.html": ("A brain", make_brain),
    "rayleigh_taylor.html": ("A Rayleigh-Taylor mixing layer", make_rayleigh_taylor),
}


def make(folder: Path, size: tuple[int, int] = SIZE) -> list[Path]:
    """Write the pages into a folder, and return them."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        make_vdi(size).save(folder / name, title=title, background=BACKGROUND)
        for name, (title, make_vdi) in PAGES.items()
    ]


def _finish(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        make(Path(app.outdir) / FOLDER)


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the pages when the others are written."""
    app.connect("build-finished", _finish)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
