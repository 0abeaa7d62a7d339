"""A VDI in a frame: the rays in its list space, as kernels take them."""

import itertools
import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer
from pyvista_vdi.device.constants import BUNDLE, PLANE_FORMS
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import FrameRequest, RenderOptions
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.raycasting.packets import LANES, Packets, packets_of
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Width and height, in pixels, of a packet, if lists lie in bundles and if they do not.
_PACKET = {True: (LANES // BUNDLE, BUNDLE), False: (LANES, 1)}
#: Lists that a ray may be away from the centre of its own, of the half that it has.
_FARTHEST_FROM_CENTRE = 0.125
#: Pixels that list (0, 0) may be away from the window's first one.
_FARTHEST_ORIGIN = 2**24


class AlignedView(NamedTuple):
    """How a frame is drawn in which each ray stays in a list of its own."""

    origin: NDArray[np.int32]  # the pixel of list (0, 0), which may lie beside V_N's window
    items: int  # packets, in whole groups


def aligned_view(
    size: tuple[int, int],
    window: tuple[int, int],
    coordinates: NDArray[np.float64],
    depths: tuple[float, float],
    *,
    parallel: bool,
    in_bundles: bool,
) -> AlignedView | None:
    """Return how each pixel is drawn from a list of its own; None if a ray is in another one, too.

    ``window`` is V_O's in pixels, ``coordinates`` are the forms of (u, v, depth, denominator),
    float64 (4, 6), and ``depths`` the least and the largest t at which a ray may meet something.
    """
    first: list[int] = []
    # The corners, edges and middle speak for all: places depend on the pixel by a homography
    for x, y in itertools.product(*((0, pixels // 2, pixels - 1) for pixels in size)):
        # Value and slope of (u, v, depth, denominator) along the pixel's ray
        pixel = np.array([1.0, x + 0.5 - size[0] / 2, y + 0.5 - size[1] / 2])
        values, slopes = (coordinates.reshape(4, 2, 3) @ pixel).T
        for t in depths:
            u, v, _, w = (values + t * slopes).tolist()
            # V_O's depth grows along the ray
            if not (w > 0 and slopes[2 if parallel else 3] > 0):
                return None
            # Where list (0, 0) would be, if the ray met its own list in the middle
            origin_x = x + 0.5 - (u / w + window[0] / 2)
            origin_y = y + 0.5 - (v / w + window[1] / 2)
            if not first:
                if not max(abs(origin_x), abs(origin_y)) < _FARTHEST_ORIGIN:
                    return None
                first = [round(origin_x), round(origin_y)]
            away = max(abs(origin_x - first[0]), abs(origin_y - first[1]))
            if not away <= _FARTHEST_FROM_CENTRE:
                return None
    # Packets begin at multiples of their size, in lists
    wide, high = _PACKET[in_bundles]
    first_i, first_j = -first[0] // wide * wide, -first[1] // high * high
    packets_wide = -(-(size[0] - first[0] - first_i) // wide)
    packets_high = -(-(size[1] - first[1] - first_j) // high)
    packets = packets_wide * packets_high
    return AlignedView(np.array(first, np.int32), -(-packets // LANES) * LANES)


#: How many of a frame's forms are (u, v, depth, denominator).
_COORDINATE_FORMS = 4
#: Share of a window above which rays are cast through all of it: clearing it first costs as much.
_MOST_DRAWN = 0.9

#: A frame's forms and the ends of its rays, on the device.
OnDevice: TypeAlias = tuple[DeviceBuffer, DeviceBuffer | None]


@dataclass(frozen=True, eq=False)
class Scene:
    """A VDI on a device, and the frame that is asked of it."""

    prepared: PreparedVDI
    camera: Camera
    size: tuple[int, int]
    options: RenderOptions
    #: List coordinates, model direction and the planes to clip to, (n, 12); how many of them are
    #: planes, of which the first six are the bounds.
    forms: NDArray[np.float32]
    planes: int
    #: t at which each ray ends, (H, W), top row first; None if nothing opaque ends them.
    ends: NDArray[np.float32] | None
    reference_depth: float  # view depth of t = 0, world units
    regions: int  # that cropping keeps; 0 where clipping is enough
    #: What counts as a hit, where t of each ray's first one is asked for and no picture.
    hit: FirstHit | None = None
    #: Whether segments are asked for, to be merged with those of other VDIs.
    segments: bool = False
    #: The part in which rays are cast, and nothing is written beside it; None: the VDI decides.
    only: Rectangle | None = None

    @classmethod
    def of(
        cls,
        prepared: PreparedVDI,
        request: FrameRequest,
        hit: FirstHit | None = None,
        segments: bool = False,
    ) -> "Scene":
        """Make the rays of a frame."""
        camera, size, options = request.camera, request.window_size, request.options
        pixel_rays = rays.pixel_rays(camera, size, prepared.bounds)
        coordinates = [pixel_rays.form(row[:3], row[3]) for row in prepared.list_rows]
        # The opacity multiplier is in the lengths that kernels measure by these forms: a length
        # times m absorbs as m times the extinction
        direction = rays.direction_forms(pixel_rays, size, options.opacity_multiplier)
        cut, beyond, regions = rays.cropped(pixel_rays, options.cropping, prepared.bounds)
        # Keep what is in the bounds, in V_O's viewport and in front of its eye, and in the view
        u, v, _, denominator = coordinates
        wide, high = (edge / 2 * denominator for edge in prepared.window)
        planes = rays.box_planes(pixel_rays, prepared.bounds)
        planes += [wide + u, wide - u, high + v, high - v]
        if not prepared.parallel:
            planes.append(denominator - prepared.nearest * np.eye(6)[0])
        planes += rays.view_planes(camera, pixel_rays, options.clipping_planes)
        planes += cut
        forms = [*coordinates, *direction, *planes, *beyond]
        return cls(
            prepared,
            camera,
            size,
            options,
            rays.packed(forms),
            len(planes),
            rays.checked_opaque_depth(request.opaque_depth, size, pixel_rays),
            pixel_rays.reference_depth,
            regions,
            hit,
            segments,
        )

    @cached_property
    def one_list(self) -> bool:
        """Whether a picture's view is V_O's, exactly: each of its rays stays in one list."""
        prepared = self.prepared
        same = np.array_equal(prepared.list_space(self.camera), prepared.list_rows)
        return same and not self.segments

    @cached_property
    def part(self) -> Rectangle:
        """The part of the window in which rays are cast: nothing is met beside it."""
        if self.only is not None:
            return self.only
        whole = Rectangle(0, self.size[0], 0, self.size[1])
        if not self.options.skip_empty:
            return whole
        part = rays.pixels_of_points(self.camera, self.size, self.prepared.occupancy.corners)
        return whole if part.pixels > _MOST_DRAWN * whole.pixels else part

    @cached_property
    def aligned(self) -> AlignedView | None:
        """How each pixel is drawn from a list of its own; None if it cannot be."""
        prepared, camera = self.prepared, self.camera
        near, far = rays.depth_range(camera, prepared.bounds)
        if not camera.parallel_projection:
            near = max(near, rays.nearest_depth(camera, prepared.bounds))
        return aligned_view(
            self.size,
            prepared.window,
            self.forms[:_COORDINATE_FORMS, :6].astype(np.float64),
            (near - self.reference_depth, far - self.reference_depth),
            parallel=prepared.parallel,
            in_bundles=not prepared.packed,
        )

    @property
    def packets(self) -> Packets | None:
        """How the rays are dealt to packets; None if another kernel is faster."""
        forms = self.forms[:, :6].astype(np.float64)
        return packets_of(
            self.prepared.camera,
            self.camera,
            self.size,
            self.part,
            forms[:_COORDINATE_FORMS],
            forms[PLANE_FORMS : PLANE_FORMS + self.planes],
            self.prepared.lit,
            long_vectors=self.prepared.runtime.vector_floats >= 16,
        )

    @contextmanager
    def on_device(self) -> Iterator[OnDevice]:
        """Upload the forms and the ends of rays for a ``with`` block."""
        upload = partial(self.prepared.runtime.upload, brief=True)
        opaque: Any = nullcontext() if self.ends is None else upload(self.ends, "opaque depth")
        with opaque as ends, upload(self.forms, "rays") as forms:
            yield forms, ends

    def arguments(self, forms: DeviceBuffer, ends: DeviceBuffer | None) -> dict[str, Any]:
        """Return the arguments that every kernel takes which draws a frame."""
        prepared, cutoff = self.prepared, self.options.transmittance_cutoff
        occupancy = prepared.occupancy
        skips = self.options.skip_empty and occupancy.worthwhile
        looks = skips or self.options.preview_samples is not None
        return {
            "headers": prepared.headers,
            "faces": prepared.faces,
            "media": prepared.media,
            "forms": forms,
            "opaque_depth": ends,
            "masks": occupancy.masks if looks else None,
            "frame": {
                "lists_wide": prepared.window[0],
                "lists_high": prepared.window[1],
                "width": self.size[0],
                "height": self.size[1],
                "planes": self.planes,
                "depth_kind": prepared.depth_kind,
                "lists_near": prepared.double_float == 2,
                "depth_origin": prepared.depth_origin,
                "cutoff": -math.log(cutoff) if self.segments else cutoff,
                "first_depth": occupancy.first_depth,
                "slabs_per_depth": occupancy.slabs_per_depth,
                "depth_step": prepared.depth_step,
                "nearest_offset": prepared.nearest - prepared.depth_origin,
                "regions": self.regions,
                "one_list": self.one_list,
            },
        }
