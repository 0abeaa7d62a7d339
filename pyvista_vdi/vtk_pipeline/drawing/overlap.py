"""VDIs that overlap on the screen: drawn together, merged by depth, each pixel by one of them.

VTK draws the volumes of a renderer one after another and blends them in that order. So the first
of several VDIs that overlap has the picture of all raycast, and every pixel of it is shown by one
actor only: the first, in the renderer's order, that surely covers the pixel and contributes to it.
The others show nothing there. Which one it is cannot be seen.
"""

from __future__ import annotations

import itertools
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.multi_vdi import JointImage, PlacedVDI, joint_image
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, rectangle, sampled
from pyvista_vdi.vtk_pipeline.interaction.motion import WindowClock

#: Pictures kept: two eyes, and two more for other renderers.
_KEPT_PICTURES = 4

#: An actor's box must reach so far around a pixel's centre, in pixels along each axis, for the
#: pixel to be surely drawn, whole, whatever the rasteriser's rounding and anti-aliasing: half a
#: pixel, and 16 times the subpixel steps (1/256) of common rasterisers.
_MARGIN = 0.5 + 1 / 16

#: VDIs whose rectangles on the screen are so far apart, in pixels, share none.
_APART = 1.0

_of_windows: weakref.WeakKeyDictionary[WindowClock, Overlaps] = weakref.WeakKeyDictionary()
_numbers = itertools.count(-1, -1)


@dataclass(frozen=True)
class Sight:
    """A VDI in the frame that is being drawn.

    Attributes
    ----------
    painter, mapper, actor
        Whose it is.
    frame : Frame
        The view of it; its size is that of the image.
    clock : WindowClock
        Its window's.
    vdi : VDI
        What is seen.
    looks : dict
        Its cropping and its opacity multiplier, fields of a :class:`PlacedVDI`.
    """

    painter: Any
    mapper: Any
    actor: Any
    frame: Frame
    clock: WindowClock
    vdi: VDI
    looks: dict[str, Any]

    @property
    def planes(self) -> NDArray[np.float64] | None:
        """Clipping planes in the frame's world, (k, 6)."""
        return self.frame.clipping_planes(self.mapper.GetClippingPlanes(), self.vdi.bounds)

    @property
    def key(self) -> Any:
        """What it looks like, but for what hides it."""
        planes = self.planes
        cut = None if planes is None else planes.tobytes()
        looks = tuple(self.looks.values())
        return (weakref.ref(self.vdi), self.frame.camera, self.frame.size, cut, looks)

    @property
    def placed(self) -> PlacedVDI:
        """What the raycaster is to draw."""
        return PlacedVDI(self.vdi, self.frame.camera, self.planes, **self.looks)

    def coarser(self, size: tuple[int, int]) -> Sight:
        """Return the same with fewer pixels."""
        return self if size == self.frame.size else replace(self, frame=self.frame.coarser(size))


@dataclass(frozen=True)
class Part:
    """What one actor shows of a joint picture.

    Attributes
    ----------
    image : numpy.ndarray
        Premultiplied RGBA, float32 (H, W, 4), top row first; 0 where others show it.
    number : int
        By which an upload is known: below 0, and another for each.
    frame : Frame
        The view of its VDI, with the picture's size.
    full_size : (int, int)
        Width and height of the viewport in pixels.
    """

    image: NDArray[np.float32]
    number: int
    frame: Frame
    full_size: tuple[int, int]


@dataclass
class _Picture:
    """A joint picture, and what each actor shows of it."""

    joint: JointImage
    depth: NDArray[np.float32] | None
    parts: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    numbers: dict[int, int] = field(default_factory=dict)

    def part(self, index: int, sight: Sight, full_size: tuple[int, int]) -> Part:
        """Return what actor ``index`` shows."""
        number = self.numbers.setdefault(index, next(_numbers))
        if index not in self.parts:
            mine = self.joint.owner == index
            self.parts[index] = np.where(mine[..., np.newaxis], self.joint.image, np.float32(0))
        return Part(self.parts[index], number, sight.frame, full_size)


@dataclass
class _Group:
    """VDIs of a frame that overlap, in the renderer's order; drawn when the first is asked for."""

    sights: list[Sight]
    picture: _Picture | None = None
    size: tuple[int, int] = (0, 0)


class Overlaps:
    """The joint pictures of a window."""

    def __init__(self) -> None:
        self._kept: dict[Any, _Picture] = {}

    @classmethod
    def of(cls, clock: WindowClock) -> Overlaps:
        """Return those of a window, made on first use."""
        overlaps = _of_windows.get(clock)
        if overlaps is None:
            overlaps = _of_windows[clock] = cls()
        return overlaps

    def part(
        self, own: Sight, renderer: Any, others: Callable[[Sight, Any], Sequence[Sight]]
    ) -> Part | None:
        """Return what an actor shows of the joint picture; ``None`` if it overlaps no other.

        Parameters
        ----------
        own : Sight
            The actor's VDI.
        renderer : vtkRenderer
            It is drawing the frame.
        others : callable
            Gives all VDIs that the renderer shows, ``own`` among them, in its order; given
            ``own`` and the renderer. Called once for all of them, as long as each is drawn once.
        """
        # Where the frame's VDIs have been looked at already; once each, for a frame may have passes
        groups = own.clock.of_frame.setdefault(("overlaps", renderer.GetAddressAsString("")), {})
        key, group = groups.pop(id(own.painter), (None, None))
        if group is None or key != own.key:
            sights = others(own, renderer)
            if len(sights) == 1:
                return None
            for members in _overlapping(sights):
                together = _Group(members)
                groups.update({id(sight.painter): (sight.key, together) for sight in members})
            _, group = groups.pop(id(own.painter), (None, _Group([own])))
        if len(group.sights) == 1:
            return None
        if group.picture is None:
            self._draw(group, renderer)
        assert group.picture is not None
        index = next(i for i, s in enumerate(group.sights) if s.painter is own.painter)
        return group.picture.part(index, own.coarser(group.size), own.frame.size)

    def _draw(self, group: _Group, renderer: Any) -> None:
        """Give a group its picture: one that is kept, or a new one."""
        sights = group.sights
        full = sights[0].frame.size
        depth = _depth(sights, renderer)
        # In full if it is there: that costs nothing
        picture, group.size = self._known(sights, full, depth), full
        if picture is None:
            group.size = max(
                s.painter.preview_size(s.mapper, renderer, s.clock, full) for s in sights
            )
            if group.size != full:
                sights = [sight.coarser(group.size) for sight in sights]
                depth = None if depth is None else sampled(depth, group.size)
                picture = self._known(sights, full, depth)
        if picture is None:
            picture = _Picture(_raycast(sights, full, depth), depth)
            key = _key(sights, full)
            self._kept.pop(key, None)
            self._kept[key] = picture
            while len(self._kept) > _KEPT_PICTURES:
                del self._kept[next(iter(self._kept))]
        for other in self._kept.values():
            if other is not picture:
                other.parts.clear()  # made anew where needed: they take more than the picture
        group.picture = picture

    def _known(
        self, sights: Sequence[Sight], full: tuple[int, int], depth: NDArray[np.float32] | None
    ) -> _Picture | None:
        picture = self._kept.get(_key(sights, full))
        return picture if picture is not None and same_depth(picture.depth, depth) else None


def same_depth(a: NDArray[np.float32] | None, b: NDArray[np.float32] | None) -> bool:
    """Whether rays end at the same depths; ``None`` where none end early."""
    if a is b or a is None or b is None:
        return a is b
    return np.array_equal(a, b)


def _key(sights: Sequence[Sight], full: tuple[int, int]) -> Any:
    return (full, *((id(sight.painter), sight.key) for sight in sights))


def _depth(sights: Sequence[Sight], renderer: Any) -> NDArray[np.float32] | None:
    """Return where rays end, read once for all; ``None`` if nothing opaque is in the way."""
    depths = OpaqueDepths.of(sights[0].clock)
    return depths.read(renderer, [(sight.frame, sight.vdi.bounds) for sight in sights])


def _raycast(
    sights: Sequence[Sight], full: tuple[int, int], depth: NDArray[np.float32] | None
) -> JointImage:
    before = time.perf_counter()
    # One device draws them all, and the same in whatever order they were added
    devices = {repr(sight.painter.device): sight.painter.device for sight in sights}
    size = sights[0].frame.size
    joint = joint_image(
        [sight.placed for sight in sights],
        size,
        opaque_depth=depth,
        margin=_MARGIN,
        device=devices[min(devices)],
    )
    seconds = time.perf_counter() - before
    for sight in sights:  # as if each had drawn its own
        sight.clock.drawn(size, full, seconds / len(sights))
    return joint


def _overlapping(sights: Sequence[Sight]) -> list[list[Sight]]:
    """Divide VDIs into groups whose rectangles on the screen overlap, directly or by others."""
    rectangles = [rectangle(sight.frame, sight.vdi.bounds) for sight in sights]
    groups: list[set[int]] = []
    for i, own in enumerate(rectangles):
        touched = [g for g in groups if any(_touch(own, rectangles[j]) for j in g)]
        groups = [g for g in groups if g not in touched]
        groups.append({i}.union(*touched))
    return [[sights[i] for i in sorted(group)] for group in groups]


def _touch(a: NDArray[np.float64] | None, b: NDArray[np.float64] | None) -> bool:
    if a is None or b is None:
        return False
    return bool((a[0] <= b[1] + _APART).all() and (b[0] <= a[1] + _APART).all())
