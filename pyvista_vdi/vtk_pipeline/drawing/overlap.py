"""VDIs that overlap on the screen: drawn together, merged by depth, each pixel by one of them.

VTK draws the volumes of a renderer one after another and blends them in that order. So the first
of several VDIs that overlap has the picture of all raycast, and every pixel of it is shown by one
actor only: the nearest that surely covers the pixel and contributes to it. The others show nothing
there. Which one it is cannot be seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.raycasting.multi_vdi import OwnedImage, PlacedVDI, owned_image
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, depths_of, ends_of_rays, opaque_depth
from pyvista_vdi.vtk_pipeline.drawing.images import Drawn
from pyvista_vdi.vtk_pipeline.drawing.window import ShownVolume, now

#: An actor's box must reach so far around a pixel's centre, in pixels along each axis, for the
#: pixel to be surely drawn, whole, whatever the rasteriser's rounding and anti-aliasing: half a
#: pixel, and 16 times the subpixel steps (1/256) of common rasterisers.
_MARGIN = 0.5 + 1 / 16

#: VDIs whose rectangles on the screen are so far apart, in pixels, share none.
_APART = 1.0


@dataclass
class Group:
    """VDIs of a frame whose rectangles on the screen overlap, directly or by others.

    The picture is drawn when the first of them asks for its part.
    """

    members: list[ShownVolume]
    frames: list[Frame] = field(default_factory=list)  # those that are drawn, the nearest first
    picture: OwnedImage | None = None

    def part(self, own: Frame) -> Drawn | None:
        """Return what an actor shows of the picture of all; ``None`` where it is alone by now."""
        mine = [f for f in self.frames if f.mapper is own.mapper]
        if not mine or mine[0].key != own.key:
            self.picture = None
            seen = [
                own
                if each.mapper is own.mapper
                else each.driver.beside(each.mapper, own.renderer, each.matrix)
                for each in self.members
            ]
            # The nearest first: in samples of a pixel where a mesh hides its box none is seen
            self.frames = [frame for frame in seen if frame is not None]
            self.frames.sort(key=lambda f: depths_of(f.camera.model_transform, f.bounds)[0])
            mine = [own]
        if len(self.frames) == 1:
            return None
        if self.picture is None:
            self.picture = _drawn(self.frames)
        owned = self.picture.owner == self.frames.index(mine[0])
        image = np.where(owned[..., np.newaxis], self.picture.image, np.float32(0))
        return Drawn(image, own.full_size, joint=True)


def group_of(own: Frame) -> Group:
    """Return the VDIs that may be seen where one is, looked for once in each view of a frame."""
    shared = own.window.of_frame
    # Two eyes have two views
    view = (own.origin, own.size, own.camera.window_center, own.to_view.tobytes())
    place = (own.renderer.GetAddressAsString(""), *view)
    if place not in shared:
        shown = [v for v in own.window.shown_in(own.renderer) if v.driver is not None and v.visible]
        rectangles = np.full((len(shown), 2, 2), np.nan)
        for each, rectangle in zip(shown, rectangles, strict=True):
            mine = each.mapper is own.mapper  # whose matrix is that of the assembly by now
            to_view = own.to_view @ (own.model_transform if mine else each.matrix)
            frame = replace(own, camera=own.camera.replace(model_transform=to_view))
            bounds = None if each.driver.input is None else each.driver.input.bounds()
            seen = None if bounds is None else frame.rectangle(bounds)
            rectangle[:] = np.nan if seen is None else seen
        # Join those that touch
        low, high = rectangles[:, 0], rectangles[:, 1]
        before = (low[:, None] <= high + _APART).all(axis=-1)
        groups: list[set[int]] = []
        for i, touching in enumerate(np.asarray(before & before.T)):
            touched = [g for g in groups if touching[list(g)].any()]
            groups = [g for g in groups if g not in touched]
            groups.append({i}.union(*touched))
        shared[place] = [Group([shown[i] for i in sorted(g)]) for g in groups]
    found = [g for g in shared[place] if any(m.mapper is own.mapper for m in g.members)]
    return found[0] if found else Group([])


def _drawn(frames: list[Frame]) -> OwnedImage:
    """Raycast VDIs together; UnsupportedError where they are shown by different final colours."""
    levels = {(f.mapper.GetFinalColorWindow(), f.mapper.GetFinalColorLevel()) for f in frames}
    if len(levels) > 1:
        raise UnsupportedError(
            f"VDIs that overlap are drawn as one picture, and have the final colour windows and "
            f"levels {sorted(levels)}: set the same of all (SetFinalColorWindow, "
            "SetFinalColorLevel)"
        )
    size = max(frame.mapper.driver.preview_size(frame) for frame in frames)
    first = replace(frames[0], depth=opaque_depth(frames)).coarser(size)  # which samples the depth
    seen = [first, *(frame.coarser(size) for frame in frames[1:])]
    # One device draws them all, and the same in whatever order they were added
    devices = {repr(d): d for d in (frame.mapper.driver.settings.device for frame in frames)}
    began = now()
    picture = owned_image(
        [PlacedVDI(f.vdi, f.camera, f.options) for f in seen if f.vdi is not None],
        FrameRequest(
            first.camera, first.size, opaque_depth=ends_of_rays(first), device=devices[min(devices)]
        ),
        margin=_MARGIN,
    )
    seconds = now() - began
    for frame in seen:  # as if each had drawn its own
        took = (frame.size, frame.full_size, seconds / len(seen))
        first.window.pace.drawn(*took, effort=frame.effort)
    return picture
