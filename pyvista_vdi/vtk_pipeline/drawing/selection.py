"""Picking: how a VDI draws itself in the passes of VTK's hardware selector.

Such a pass draws numbers in place of colours. VTK's own volumes fill their box with theirs, write
no depth, and wipe out what lies behind the box. A VDI draws its number where a ray hits it, at the
depth of the hit, and nothing elsewhere; the z-buffer does the rest: a mesh in front of the hit
wins, and so does one behind a part that is transparent.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.raycasting.picking import FirstHit, Pick, pick_vdi
from pyvista_vdi.raycasting.raycast import render_first_hits
from pyvista_vdi.vtk_pipeline.drawing.frame import Area, Frame, Image
from pyvista_vdi.vtk_pipeline.drawing.screen import (
    ImageTexture,
    place_texture,
    show_first_hits,
    show_image,
)
from pyvista_vdi.vtk_pipeline.vtk import vtkDataObject, vtkInformation, vtkOpenGLActor


class Selection:
    """What happens behind a mapper in a selection's passes."""

    def __init__(self) -> None:
        self.texture = ImageTexture()
        self._drawn: tuple[Any, Image] | None = None
        self._uploads = 0
        self._picking = False
        self._seen: Frame | None = None

    def enter(self, actor: Any, selector: Any) -> None:
        """Make an actor draw hits, with their depth, in the pass that begins."""
        show_first_hits(actor, selector.GetCurrentPass())
        keys = actor.GetPropertyKeys()
        if keys is None:
            keys = vtkInformation()
            actor.SetPropertyKeys(keys)
        keys.Set(vtkOpenGLActor.GLDepthMaskOverride(), 1)

    def leave(self, actor: Any, *, occluded: bool, peeled: bool) -> None:
        """Make it draw its image in the frame that begins, whatever was drawn last.

        ``occluded`` and ``peeled`` are for :func:`show_image`.
        """
        show_image(actor, occluded=occluded, peeled=peeled)
        keys = actor.GetPropertyKeys()
        if keys is not None:
            keys.Remove(vtkOpenGLActor.GLDepthMaskOverride())

    def show(
        self, actor: Any, renderer: Any, seen: Frame | None, device: Any, hit: FirstHit
    ) -> None:
        """Raycast and bind the hits in the selector's area; none if nothing is seen."""
        window, selector = renderer.GetRenderWindow(), renderer.GetSelector()
        if self._picking:
            self._seen = seen
        # VTK draws volumes' numbers only where cells are selected: the points of what is around
        cells = selector.GetFieldAssociation() == vtkDataObject.FIELD_ASSOCIATION_CELLS
        if seen is None or seen.vdi is None or not cells:
            nothing = _packed((0, 0, 0, 0), np.empty((0, 0), np.float32))
            place_texture(actor, self.texture.show(window, nothing, None, smooth=False))
            return
        area = _area(seen, selector.GetArea())
        key = (seen.number, seen.key, area, hit)
        if self._drawn is None or self._drawn[0] != key:
            self._drawn = (key, _packed(area, self._depths(seen, area, device, hit)))
            self._uploads += 1
        unit = self.texture.show(window, self._drawn[1], self._uploads, smooth=False)
        place_texture(actor, unit)

    def release(self) -> None:
        """Free the texture."""
        self.texture.release()
        self._drawn = None

    def pick(
        self, actor: Any, renderer: Any, x: float, y: float, hit: FirstHit, kept: Any = None
    ) -> Pick | None:
        """Return what a renderer shows of an actor's VDI at (x, y) of the window, in pixels.

        ``None`` where nothing of it is hit, or something else is in front. ``kept``: the values
        that it was classified from.
        """
        # VTK's hardware selection sees nothing through render passes (SSAA, eye-dome lighting ...)
        render_pass = renderer.GetPass()
        renderer.SetPass(None)
        self._picking = True
        try:
            # Not PickProp, which picks from what a picker before has left (seen: VTK 9.7)
            path = renderer.PickPropFrom(x, y, None)
            seen = self._seen
        finally:
            renderer.SetPass(render_pass)
            self._picking, self._seen = False, None
        if path is None or path.GetLastNode().GetViewProp() is not actor or seen is None:
            return None
        left, bottom = seen.origin
        assert seen.vdi is not None
        picked = pick_vdi(
            seen.vdi,
            FrameRequest(seen.camera, seen.size, seen.options),
            (int(x) - left, int(y) - bottom),
            hit,
            kept,
        )
        if picked is None:  # at the threshold, by rounding
            return None
        # From the frame's world, whose origin is the eye, to the scene's
        px, py, pz, _ = np.linalg.solve(seen.to_view, [*picked.position, 1.0]).tolist()
        return replace(picked, position=(px, py, pz))

    def _depths(self, seen: Frame, area: Area, device: Any, hit: FirstHit) -> Image:
        """Return window depth of the hits in an area, (h, w), bottom row first; inf for none."""
        left, bottom, width, height = area
        if width == 0 or height == 0:
            return np.empty((0, 0), np.float32)
        corner = (
            left - seen.origin[0],
            seen.origin[1] + seen.size[1] - (bottom + height),  # from the top
        )
        assert seen.vdi is not None
        camera = seen.camera.tile(seen.size, corner, (width, height))
        request = FrameRequest(camera, (width, height), seen.options, device=device)
        depth = render_first_hits(seen.vdi, request, hit)
        return seen.window_depth(depth[::-1])


def _area(seen: Frame, selected: tuple[int, ...]) -> Area:
    """Return what of (x0, y0, x1, y1), both ends included, lies in the viewport.

    Lower left corner, width and height in pixels of the framebuffer; the latter may be 0.
    """
    (x, y), (width, height) = seen.origin, seen.size
    left, bottom = max(x, selected[0]), max(y, selected[1])
    right, top = min(x + width, selected[2] + 1), min(y + height, selected[3] + 1)
    return left, bottom, max(0, right - left), max(0, top - bottom)


def _packed(area: Area, depth: Image) -> Image:
    """Return the texture that the shader reads: see ``shader.py``."""
    height, width = depth.shape
    image = np.zeros((height + 1, max(1, width), 4), dtype=np.float32)
    image[0, 0] = area
    hit = np.isfinite(depth)
    image[1:, :width, 0][hit] = depth[hit]
    image[1:, :width, 3] = hit
    return image
