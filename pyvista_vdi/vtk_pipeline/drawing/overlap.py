"""VDIs that overlap on the screen: drawn together, merged by depth, each pixel by one of them.

VTK draws the volumes of a renderer one after another and blends them in that order. So the first
of several VDIs that overlap has the picture of all raycast, and every pixel of it is shown by one
actor only: the nearest that surely covers the pixel and contributes to it. The others show nothing
there. Which one it is cannot be seen.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.multi_vdi import OwnedImage, PlacedVDI, owned_image
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Image, Matrix
from pyvista_vdi.vtk_pipeline.drawing.images import Drawn, Recent, same_depth
from pyvista_vdi.vtk_pipeline.interaction.window import now

#: An actor's box must reach so far around a pixel's centre, in pixels along each axis, for the
#: pixel to be surely drawn, whole, whatever the rasteriser's rounding and anti-aliasing: half a
#: pixel, and 16 times the subpixel steps (1/256) of common rasterisers.
_MARGIN = 0.5 + 1 / 16

#: VDIs whose rectangles on the screen are so far apart, in pixels, share none.
_APART = 1.0

#: By which uploads are known: below 0, those of VDIs that are drawn alone being above.
_numbers = itertools.count(-1, -1)


@dataclass(frozen=True)
class _Levels:
    """What a mapper's final window and level make of straight colours: scale times them and bias.

    Of premultiplied ones VTK's shader makes scale times them and bias times their opacity. Sums of
    media keep that: so each VDI's colours can be changed before they are merged.
    """

    scale: float = 1.0
    bias: float = 0.0

    @classmethod
    def of(cls, mapper: Any) -> _Levels:
        window, level = mapper.GetFinalColorWindow(), mapper.GetFinalColorLevel()
        return cls(1 / window, 0.5 - level / window) if window else cls()

    def done(self, image: Image) -> Image:
        """Return premultiplied RGBA as the shader shows it."""
        return self._changed(image, self.scale, self.bias)

    def undone(self, image: Image) -> Image:
        """Return premultiplied RGBA that the shader shows as this one."""
        return self._changed(image, 1 / self.scale, -self.bias / self.scale)

    def _changed(self, image: Image, scale: float, bias: float) -> Image:
        if (scale, bias) == (1.0, 0.0):
            return image
        changed = np.float32(scale) * image + np.float32(bias) * image[..., 3:]
        changed[..., 3] = image[..., 3]
        return changed


@dataclass
class _Picture:
    """A joint picture, and the image that each actor shows of it."""

    joint: OwnedImage
    levels: list[_Levels]  # of each actor
    depth: Image | None
    parts: dict[int, Image] = field(default_factory=dict)
    numbers: dict[int, int] = field(default_factory=dict)

    def part(self, index: int, full_size: tuple[int, int]) -> Drawn:
        """Return what actor ``index`` shows: 0 where others do."""
        number = self.numbers.setdefault(index, next(_numbers))
        if index not in self.parts:
            mine = self.joint.owner == index
            part = np.where(mine[..., np.newaxis], self.joint.image, np.float32(0))
            self.parts[index] = self.levels[index].undone(part)  # as the shader is about to
        return Drawn(self.parts[index], full_size, number=number, joint=True)


@dataclass
class _Group:
    """VDIs of a frame that overlap, the nearest first; drawn when the first is asked for."""

    frames: list[Frame]
    picture: _Picture | None = None


class Overlaps:
    """The joint pictures of a window: ``window.shared(Overlaps)``."""

    def __init__(self) -> None:
        self._kept: Recent[_Picture] = Recent()

    def part(self, own: Frame) -> Drawn | None:
        """Return what an actor shows of the joint picture; ``None`` if it overlaps no other."""
        # Where the frame's VDIs have been looked at already; once each, for a frame may have passes
        place = ("overlaps", own.renderer.GetAddressAsString(""))
        groups = own.window.of_frame.setdefault(place, {})
        key, group = groups.pop(id(own.driver), (None, None))
        if group is None or key != _key(own):
            frames = _frames(own)
            if len(frames) == 1:
                return None
            for members in _overlapping(frames):
                together = _Group(members)
                groups.update({id(frame.driver): (_key(frame), together) for frame in members})
            _, group = groups.pop(id(own.driver), (None, _Group([own])))
        if len(group.frames) == 1:
            return None
        if group.picture is None:
            group.picture = self._picture(group.frames)
        index = next(i for i, f in enumerate(group.frames) if f.driver is own.driver)
        return group.picture.part(index, own.full_size)

    def _picture(self, frames: Sequence[Frame]) -> _Picture:
        """Return the picture of a group: one that is kept, or a new one."""
        # Read once for all
        depth = frames[0].window.shared(OpaqueDepths).read(frames)
        frames = [replace(frame, depth=depth) for frame in frames]
        picture = self._known(frames)  # in full if it is there: that costs nothing
        if picture is None:
            size = max(frame.driver.preview_size(frame) for frame in frames)
            first = frames[0].coarser(size)  # which samples the depth
            frames = [first, *(replace(f, depth=None).coarser(size) for f in frames[1:])]
            picture = self._known(frames) if first.preview else None
        if picture is None:
            levels = [_Levels.of(frame.mapper) for frame in frames]
            picture = _Picture(_raycast(frames, levels), levels, frames[0].depth)
            self._kept.keep(_key(*frames), picture)
        for other in self._kept.values():
            if other is not picture:
                other.parts.clear()  # made anew where needed: they take more than the picture
        return picture

    def _known(self, frames: Sequence[Frame]) -> _Picture | None:
        picture = self._kept.get(_key(*frames))
        same = picture is not None and same_depth(picture.depth, frames[0].depth)
        return picture if same else None


def _key(*frames: Frame) -> Any:
    """Return what VDIs look like together, but for what hides them."""
    return tuple((id(f.driver), f.number, f.key, _Levels.of(f.mapper)) for f in frames)


def _raycast(frames: Sequence[Frame], levels: Sequence[_Levels]) -> OwnedImage:
    before = now()
    vdis, all_levels = _leveled([frame.vdi for frame in frames if frame.vdi], levels)
    # One device draws them all, and the same in whatever order they were added
    devices = {repr(frame.driver.device): frame.driver.device for frame in frames}
    device, first = devices[min(devices)], frames[0]
    joint = owned_image(
        [PlacedVDI(v, f.camera, f.options) for v, f in zip(vdis, frames, strict=True)],
        FrameRequest(first.camera, first.size, opaque_depth=first.depth, device=device),
        margin=_MARGIN,
    )
    seconds = now() - before
    for frame in frames:  # as if each had drawn its own
        took = (frame.size, frame.full_size, seconds / len(frames))
        frame.window.pace.drawn(*took, effort=frame.effort)
    return OwnedImage(all_levels.done(joint.image), joint.owner)


def _leveled(vdis: Sequence[VDI], levels: Sequence[_Levels]) -> tuple[Sequence[VDI], _Levels]:
    """Return VDIs in the colours of their levels, and what their picture is to be changed by.

    Colours of VDIs are 0 to 1: what leaves that is brought there with all others, and back after.
    """
    if set(levels) == {_Levels()}:
        return vdis, _Levels()
    ends = [end for each in levels for end in (each.bias, each.scale + each.bias)]
    low, high = min(ends), max(ends)
    leveled = []
    for vdi, each in zip(vdis, levels, strict=True):
        color = (np.float64(each.scale) * vdi.color + (each.bias - low)) / (high - low)
        of = (vdi.camera, vdi.window_size, vdi.offsets, vdi.front, vdi.back, np.clip(color, 0, 1))
        leveled.append(VDI(*of, vdi.optical_depth, vdi.bounds, depth_origin=vdi.depth_origin))
    return leveled, _Levels(high - low, low)


def _frames(own: Frame) -> list[Frame]:
    """Return what the renderer shows of VDIs in this frame, in its order."""
    frames = []
    for each in own.window.shown_in(own.renderer):
        if each.driver is own.driver:
            frames.append(own)
        elif each.driver is not None and each.visible:
            frame = each.driver.beside(each.mapper, own.renderer, each.matrix)
            frames += [] if frame is None else [frame]
    return frames


def overlapped(own: Frame) -> bool:
    """Whether the data of another VDI may be seen where those of this one are."""
    shown = [v for v in own.window.shown_in(own.renderer) if v.driver is not None and v.visible]
    # Look at all once in this view: two eyes have two
    place = (own.renderer.GetAddressAsString(""), own.origin, own.size, own.camera.window_center)
    joint = own.window.of_frame.get(("overlapped", place, own.to_view.tobytes()))
    if joint is None:
        joint = own.window.of_frame["overlapped", place, own.to_view.tobytes()] = set()
        rectangles: list[Matrix | None] = []
        for each in shown:
            mine = each.driver is own.driver  # whose matrix is that of the assembly by now
            to_view = own.to_view @ (own.model_transform if mine else each.matrix)
            frame = replace(own, camera=own.camera.replace(model_transform=to_view))
            bounds = None if each.driver.input is None else each.driver.input.bounds()
            rectangles.append(None if bounds is None else frame.rectangle(bounds))
        touched = _touching(rectangles).sum(axis=0) > 1
        joint.update(
            id(v.driver) for v, is_touched in zip(shown, touched, strict=True) if is_touched
        )
    return id(own.driver) in joint


def _overlapping(frames: Sequence[Frame]) -> list[list[Frame]]:
    """Divide VDIs into groups whose rectangles on the screen overlap, directly or by others."""
    touching = _touching([frame.rectangle(frame.bounds) for frame in frames])
    groups: list[set[int]] = []
    for i, touched_by in enumerate(touching):
        touched = [g for g in groups if touched_by[list(g)].any()]
        groups = [g for g in groups if g not in touched]
        groups.append({i}.union(*touched))
    # The nearest first: in samples of a pixel where a mesh hides its box, none is to be seen
    nearest = [frame.depths_of(frame.bounds)[0] for frame in frames]
    return [[frames[i] for i in sorted(g, key=lambda i: (nearest[i], i))] for g in groups]


def _touching(rectangles: Sequence[Matrix | None]) -> NDArray[np.bool_]:
    """Return which rectangles of the picture, see :meth:`Frame.rectangle`, share pixels: (n, n)."""
    nowhere = np.full((2, 2), np.nan)
    low, high = np.stack([nowhere if r is None else r for r in rectangles], axis=1)
    before = (low[:, None] <= high + _APART).all(axis=-1)
    return before & before.T
