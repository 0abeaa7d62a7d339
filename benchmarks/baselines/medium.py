"""What the baselines share: a VDI in plain arrays, and the rays and the eye of a new view."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Kernel, Runtime, padded
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.arguments import Argument
from pyvista_vdi.device.work_order import GROUP, block_items
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.reference.raycast import Lists, near_limit

Floats = NDArray[np.float64]

KERNELS = Path(__file__).with_name("baselines.cl")


class Eye(NamedTuple):
    """The eye of a new view, as V_O sees it.

    The list in which its image lies, the epipole, beyond the lists at most by one; view depth less
    the depth origin; whether it is behind V_O's, so that rays come towards the epipole.
    """

    i: int
    j: int
    depth: float
    behind: bool


class Medium:
    """A VDI's lists, one after the other: faces in depth and extinctions, and no list space.

    ``faces``: view depths less the depth origin, nothing behind V_O's eye. ``media``: straight RGB
    and extinction per model length. ``to_lists``: model frame to (U d, V d, Z less the depth
    origin, d), where list (i, j) is i <= U < i + 1, j <= V < j + 1, and d is Z, or 1 in parallel
    projection.
    """

    def __init__(self, vdi: VDI) -> None:
        self.vdi, self.wide, self.high = vdi, *vdi.window_size
        self.parallel = vdi.camera.parallel_projection
        self.nearest = -np.inf if self.parallel else near_limit(vdi) - vdi.depth_origin
        self.offsets = vdi.offsets.astype(np.int32)
        counts = np.diff(self.offsets)
        self.list_of = np.repeat(np.arange(counts.size, dtype=np.int32), counts)
        in_float64 = Lists(vdi)
        self.faces = np.maximum(np.stack([vdi.front, vdi.back], axis=1), np.float32(self.nearest))
        with np.errstate(divide="ignore", over="ignore"):
            extinction = (in_float64.optical_depth / in_float64.length).astype(np.float32)
        extinction = np.minimum(extinction, np.finfo(np.float32).max)
        self.media = np.concatenate([vdi.color, extinction[:, None]], axis=1)
        half = np.array([[self.wide / 2], [self.high / 2]])
        matrix = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
        self.to_lists = np.concatenate([half * (matrix[:2] + matrix[3]), matrix[2:]])
        self.to_lists[2, 3] -= vdi.depth_origin

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays that a renderer reads."""
        return self.offsets.nbytes + self.faces.nbytes + self.media.nbytes

    def from_lists(self, camera: Camera) -> Floats:
        """Return (U d, V d, Z less the origin, 1) to the view space of a new view, (4, 4)."""
        own = self.vdi.camera
        half_width, half_height = own.half_extent(self.vdi.window_size)
        depth, one = np.array([0, 0, 1.0, self.vdi.depth_origin]), np.array([0, 0, 0, 1.0])
        d = one if self.parallel else depth
        across = np.array([[2 / self.wide, 0, 0, 0], [0, 2 / self.high, 0, 0]])
        centre = np.asarray(own.window_center)
        x, y = ([[half_width], [half_height]]) * (across + (centre - 1)[:, None] * d)
        to_view = camera.model_to_view @ rays.inverse_affine(own.model_to_view)
        matrix: Floats = to_view @ np.stack([x, y, depth, one])
        return matrix

    def eye(self, camera: Camera) -> Eye:
        """Return where the eye of a new view is; at infinity in parallel projection."""
        inverse = rays.inverse_affine(camera.model_to_view)
        point = inverse @ ([0, 0, -1.0, 0] if camera.parallel_projection else [0, 0, 0, 1.0])
        u, v, depth, d = self.to_lists @ point
        if camera.parallel_projection and depth != 0:
            depth = np.copysign(np.inf, depth)
        if d == 0:
            d = np.finfo(np.float64).tiny
        with np.errstate(over="ignore"):
            at = np.floor(np.clip(np.array([u, v]) / d, -1, [self.wide, self.high]))
        return Eye(int(at[0]), int(at[1]), float(depth), bool(d < 0))

    def order(self, camera: Camera) -> NDArray[np.int32]:
        """Return the supersegments in an order in which none hides an earlier one, nearest first.

        A ray of the new view moves away from its eye's image in V_O, or towards it: lists by their
        distance in steps along both axes. Within a list, supersegments by their distance in depth:
        rays that begin between two of them run either way.
        """
        eye = self.eye(camera)
        steps = np.abs(np.arange(self.high) - eye.j)[:, None] + np.abs(np.arange(self.wide) - eye.i)
        lists = np.argsort((-steps if eye.behind else steps).ravel(), kind="stable")
        begins, counts = self.offsets[:-1], np.diff(self.offsets)
        # Those that begin before the eye come first, backwards
        before = np.zeros(len(self.faces) + 1, np.int32)
        np.cumsum(self.faces[:, 0] < eye.depth, out=before[1:])
        split = (before[self.offsets[1:]] - before[begins])[lists]
        counts, begins = counts[lists], begins[lists]
        ends = np.cumsum(counts)
        rank = np.arange(len(self.faces), dtype=np.int32) - np.repeat(ends - counts, counts)
        split = np.repeat(split, counts)
        found = np.repeat(begins, counts) + np.where(rank < split, split - 1 - rank, rank)
        return found.astype(np.int32)


class View(NamedTuple):
    """A new view's rays, as the baselines' kernels take them."""

    forms: NDArray[np.float32]
    planes: int
    reference_depth: float  # of t = 0


def view_of(medium: Medium, camera: Camera, size: tuple[int, int]) -> View:
    """Return the rays of a window: coordinates, model direction, and planes to clip to."""
    vdi = medium.vdi
    pixel_rays = rays.pixel_rays(camera, size, vdi.bounds)
    u, v, depth, d = (pixel_rays.form(row[:3], row[3]) for row in medium.to_lists)
    planes = [
        *rays.box_planes(pixel_rays, vdi.bounds),
        *(u, v, medium.wide * d - u, medium.high * d - v),
        *rays.eye_plane(camera, pixel_rays),
    ]
    if not medium.parallel:
        planes.append(depth - medium.nearest * np.eye(6)[0])
    direction = rays.direction_forms(pixel_rays, size)
    forms = rays.packed([u, v, depth, d, *direction, *planes])
    return View(forms, len(planes), pixel_rays.reference_depth)


class DeviceMedium(Medium):
    """The arrays on a device."""

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        super().__init__(vdi)
        self.runtime = runtime
        self.lists = (
            self.upload(self.offsets, np.int32),
            self.upload(self.faces, np.float32),
            self.upload(self.media, np.float32),
        )

    def upload(self, array: NDArray[np.generic], dtype: type) -> DeviceBuffer:
        """Bring an array to the device; one without elements as one that has some."""
        values: NDArray[Any] = np.ascontiguousarray(array, dtype)
        return self.runtime.upload(values if values.size else np.zeros(4, dtype), "a list's array")

    def draw(
        self,
        kernel: Kernel,
        view: View,
        size: tuple[int, int],
        before: Sequence[Argument],
        after: Sequence[Argument],
        items: int | None = None,
    ) -> NDArray[np.float32]:
        """Run a kernel on all pixels, by default in blocks; return the picture, top row first.

        ``before`` and ``after`` are its arguments on both sides of the view's own.
        """
        runtime = self.runtime
        with (
            runtime.upload(view.forms, "rays") as forms,
            runtime.result((*size[::-1], 4), name="image") as image,
        ):
            runtime.launch(
                kernel,
                block_items(*size) if items is None else padded(items, GROUP),
                GROUP,
                *before,
                forms,
                np.int32(view.planes),
                *map(np.int32, size),
                *after,
                image,
            )
            return runtime.download(image)
