"""A trame app with a VDI that is made anew where the view is far from the one it was made for.

What one should see: open the URL that trame prints. A brain turns at the browser's own rate. After
it was turned far, or looked at from near, another VDI of that view takes the first one's place.

Arguments are trame's, as --port 8080 --server.
"""

from __future__ import annotations

import asyncio

from trame.app import get_server
from trame.ui.html import DivLayout

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.trame import VDIView
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera
from pyvista_vdi.quality.view_error import angle_from_generating_view, magnification

LISTS = (480, 270)
LOOK = TRANSFER_FUNCTIONS["soft"]
#: Degrees from the VDI's own view, and pixels per list, from which on another is made.
FAR, NEAR = 30, 1.5


class App:
    """The volume, and what the page is shown of it."""

    def __init__(self) -> None:
        self.server = get_server()
        self.volume = pvdi.examples.load_brain(as_volume=True)
        self.vdi = self.made_for(filling_camera(self.volume.bounds, LISTS))
        self.working = False
        with DivLayout(self.server, style="position: absolute; inset: 0; background: black"):
            self.view = VDIView(
                self.vdi,
                on_camera=lambda _: asyncio.ensure_future(self.follow()),
                style="width: 100%; height: 100%; aspect-ratio: auto",
                raw_attrs=['fit="1"'],  # narrow pages show all of it: the brain fits a square
            )

    def made_for(self, camera: pvdi.Camera) -> pvdi.VDI:
        """Generate a VDI of a view."""
        return pvdi.generate(self.volume, camera, LISTS, precision="8-byte", **LOOK)

    async def follow(self) -> None:
        """Make VDIs of the page's view until the one that it has will do."""
        if self.working:
            return
        self.working = True
        try:
            while not self.serves(self.view.camera):
                camera = self.view.camera
                self.vdi = await asyncio.to_thread(self.made_for, camera)
                self.view.update(self.vdi)
        finally:
            self.working = False

    def serves(self, camera: pvdi.Camera) -> bool:
        """Whether the VDI that the page has is near enough to a view."""
        turned = angle_from_generating_view(self.vdi, camera)
        return turned < FAR and magnification(self.vdi, camera, LISTS) < NEAR


if __name__ == "__main__":
    App().server.start(open_browser=False)
