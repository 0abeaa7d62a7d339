"""Lochmann et al. 2016: rays in the world that step through V_O's image by projection."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reference.raycast import Lists, near_limit

from pyvista_vdi.device import DeviceBuffer, KernelDeclaration, Runtime
from pyvista_vdi.device.constants import GROUP, block_items
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.vdi import VDI

KERNEL = KernelDeclaration(
    Path(__file__).with_name("world_rays.cl"),
    "world_rays",
    offsets="int*",
    faces="float2*",
    media="float4*",
    lists_wide="int",
    lists_high="int",
    forms="float*",
    planes="int",
    width="int",
    height="int",
    cutoff="float",
    image="float4*",
)


class WorldRays:
    """A VDI drawn by rays of the new view, every supersegment intersected as a pyramid's part.

    Theirs is of equal transmittance (``criteria.py``). ``binary``: whether a list's first
    supersegment is found by halving, not by looking from its beginning. The lists lie on the device
    one after the other, as view depths of faces less the depth origin, nothing behind V_O's eye,
    and as straight RGB and extinction per model length: in no list space.
    """

    def __init__(self, runtime: Runtime, vdi: VDI, *, binary: bool = True) -> None:
        self._runtime, self._vdi = runtime, vdi
        defines = {"BINARY_SEARCH": 1} if binary else {}
        self._wide, self._high = vdi.window_size
        self._parallel = vdi.camera.parallel_projection
        self._nearest = -np.inf if self._parallel else near_limit(vdi) - vdi.depth_origin
        in_float64 = Lists(vdi)
        faces = np.maximum(np.stack([vdi.front, vdi.back], axis=1), np.float32(self._nearest))
        with np.errstate(divide="ignore", over="ignore"):
            extinction = (in_float64.optical_depth / in_float64.length).astype(np.float32)
        extinction = np.minimum(extinction, np.finfo(np.float32).max)
        media = np.concatenate([vdi.color, extinction[:, None]], axis=1)
        # Model frame to (U d, V d, Z less the depth origin, d), where list (i, j) is
        # i <= U < i + 1, j <= V < j + 1, and d is Z, or 1 in parallel projection
        half = np.array([[self._wide / 2], [self._high / 2]])
        matrix = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
        self._to_lists = np.concatenate([half * (matrix[:2] + matrix[3]), matrix[2:]])
        self._to_lists[2, 3] -= vdi.depth_origin
        offsets = vdi.offsets.astype(np.int32)
        self.nbytes = offsets.nbytes + faces.nbytes + media.nbytes
        offsets, faces, media = map(self._upload, (offsets, faces, media))
        self._draw = runtime.bind(KERNEL, defines, offsets=offsets, faces=faces, media=media)
        self._draw.set(lists_wide=self._wide, lists_high=self._high, cutoff=TRANSMITTANCE_CUTOFF)

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.float32]:
        """Draw a frame; premultiplied RGBA (H, W, 4)."""
        runtime, (forms, planes) = self._runtime, self._rays(camera, size)
        with (
            runtime.upload(forms, "rays") as on_device,
            runtime.result((*size[::-1], 4), name="image") as image,
        ):
            width, height = size
            of_frame = {"forms": on_device, "planes": planes, "image": image}
            self._draw(block_items(*size), GROUP, width=width, height=height, **of_frame)
            return runtime.download(image)

    def _rays(self, camera: Camera, size: tuple[int, int]) -> tuple[NDArray[np.float32], int]:
        """Return a window's rays: coordinates, model direction, planes to clip to; and how many."""
        vdi = self._vdi
        pixel_rays = rays.pixel_rays(camera, size, vdi.bounds)
        u, v, depth, d = (pixel_rays.form(row[:3], row[3]) for row in self._to_lists)
        planes = [
            *rays.box_planes(pixel_rays, vdi.bounds),
            *(u, v, self._wide * d - u, self._high * d - v),
            *rays.eye_plane(camera, pixel_rays),
        ]
        if not self._parallel:
            planes.append(depth - self._nearest * np.eye(6)[0])
        direction = rays.direction_forms(pixel_rays, size)
        return rays.packed([u, v, depth, d, *direction, *planes]), len(planes)

    def _upload(self, array: NDArray[Any]) -> DeviceBuffer:
        """Bring an array to the device; one without elements as one that has some."""
        values = np.ascontiguousarray(array)
        return self._runtime.upload(values if values.size else np.zeros(4, values.dtype), "a list")
