"""A VDI in a frame: the rays in its list space, as kernels take them."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Keep
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import FrameRequest, RenderOptions
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Share of a window above which rays are cast through all of it: clearing it first costs as much.
_MOST_DRAWN = 0.9


@dataclass(frozen=True, eq=False)
class Scene:
    """A VDI on a device, and the frame that is asked of it."""

    prepared: PreparedVDI
    camera: Camera
    size: tuple[int, int]
    options: RenderOptions
    #: List coordinates, model direction and the planes to clip to: value and slope for (1, a, b),
    #: (n, 2, 3), as float32 has them; how many of them are planes, and the forms for kernels.
    forms: NDArray[np.float64]
    planes: int
    rays: DeviceBuffer
    #: t at which each ray ends, (H, W), top row first; None if nothing opaque ends them.
    ends: DeviceBuffer | None
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
        keep: Keep,
        hit: FirstHit | None = None,
        segments: bool = False,
    ) -> "Scene":
        """Make the rays of a frame, in buffers that are kept until it is drawn."""
        camera, size, options = request.camera, request.window_size, request.options
        pixel_rays = rays.pixel_rays(camera, size, prepared.bounds)
        coordinates = pixel_rays.forms(prepared.list_rows)
        # The opacity multiplier is in the lengths that kernels measure by these forms: a length
        # times m absorbs as m times the extinction
        direction = rays.direction_forms(pixel_rays, size, options.opacity_multiplier)
        cut, beyond, regions = rays.cropped(pixel_rays, options.cropping, prepared.bounds)
        # Keep what is in the bounds, in V_O's viewport and in front of its eye, and in the view
        u, v, _, denominator = coordinates
        wide, high = (edge / 2 * denominator for edge in prepared.window)
        planes = [*rays.box_planes(pixel_rays, prepared.bounds)]
        planes += [wide + u, wide - u, high + v, high - v]
        if not prepared.parallel:
            planes.append(denominator - prepared.nearest * np.eye(6)[0])
        planes += [*rays.view_planes(camera, pixel_rays, options.clipping_planes), *cut]
        forms = rays.packed([*coordinates, *direction, *planes, *beyond])
        upload, ends = prepared.runtime.upload, None
        opaque = rays.checked_opaque_depth(request.opaque_depth, size, pixel_rays)
        if opaque is not None:
            ends = keep(upload(opaque, "opaque depth", brief=True))
        return cls(
            prepared,
            camera,
            size,
            options,
            forms[:, :6].astype(np.float64).reshape(-1, 2, 3),
            len(planes),
            keep(upload(forms, "rays", brief=True)),
            ends,
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

    def arguments(self) -> dict[str, Any]:
        """Return the arguments that every kernel takes which draws a frame."""
        prepared, cutoff = self.prepared, self.options.transmittance_cutoff
        occupancy = prepared.occupancy
        skips = self.options.skip_empty and occupancy.worthwhile
        looks = skips or self.options.preview_samples is not None
        return {
            "headers": prepared.headers,
            "faces": prepared.faces,
            "media": prepared.media,
            "forms": self.rays,
            "opaque_depth": self.ends,
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
