"""A VDI on a device, in the form that the raycaster reads: uploaded once, kept while it lives."""

from __future__ import annotations

import contextlib
import functools
import threading
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, kept_together, padded
from pyvista_vdi.device.constants import BUNDLE, FIRST_BITS, LIST_HEADER
from pyvista_vdi.device.work_order import GROUP
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import lists_are_far
from pyvista_vdi.model.packing import Packed8, Packed16
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.kernels import PREPARE_LISTS, PREPARE_PACKED
from pyvista_vdi.raycasting.occupancy import OccupancyGrid
from pyvista_vdi.raycasting.packets import share_lit

#: Far depth over near depth up to which a lens counts as long, and depth is kept relative.
_LONG_LENS = 2.0

_prepared: weakref.WeakKeyDictionary[VDI, dict[Runtime, _Preparation]] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


class _Preparation:
    """The place of a prepared VDI: whoever comes first makes it, others wait for that one only."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.prepared: PreparedVDI | None = None


def prepared_vdi(runtime: Runtime, vdi: VDI) -> PreparedVDI:
    """Return the VDI on the device, made once and kept as long as the VDI lives."""
    with _lock:
        places = _prepared.setdefault(vdi, {})
        place = places.get(runtime) or places.setdefault(runtime, _Preparation())
    with runtime.holding(place.lock):
        if place.prepared is None:
            place.prepared = PreparedVDI(runtime, vdi)
        return place.prepared


class PreparedVDI:
    """A VDI on a device, in the form that the raycaster reads; the VDI itself is not kept."""

    #: Where there is something to see, and where not.
    occupancy: OccupancyGrid
    #: Where lists begin, by their bundles or, of 8-byte supersegments, each; the supersegments,
    #: which are in one array if they are packed.
    headers: DeviceBuffer
    faces: DeviceBuffer
    media: DeviceBuffer
    #: World units of a step of depth of 8-byte supersegments.
    depth_step: float
    #: Whether offsets take 64 bits.
    long_offsets: bool

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        self.runtime = runtime
        self.window = vdi.window_size
        self.bounds = vdi.bounds
        self.depth_origin = vdi.depth_origin
        self.camera = vdi.camera
        self.parallel = vdi.camera.parallel_projection
        near, far = depths = rays.depth_range(vdi.camera, vdi.bounds)
        rays.check_list_space(vdi.camera, vdi.bounds)
        #: Least view depth that is in front of V_O's eye, world units.
        self.nearest = rays.nearest_depth(vdi.camera, vdi.bounds)
        self.lit = share_lit(vdi, near, far)
        # An origin much closer than the data costs the coordinate the digits that it is to save
        closest = min(near, self.depth_origin)
        #: Whether the depth coordinate is that of a long lens.
        self.shifted = not self.parallel and 0 < far <= _LONG_LENS * closest
        #: About how many supersegments a ray may meet: it crosses a border from list to list.
        self.most_media = sum(vdi.window_size) + int(vdi.counts.max(initial=0))
        #: Whether float32 has too few digits for rays, whose forms are double-floats then: 1 where
        #: the lists lie at the far end of the bounds' depths, 2 at the near one.
        self.double_float = self._double_float(vdi, depths)
        self.list_rows = self.list_space(vdi.camera)
        #: Bytes of a packed supersegment; 0 where they are exact.
        self.packed = {Packed16: 16, Packed8: 8}.get(type(vdi.packing), 0)
        self.depth_step = 1.0
        self._upload(vdi)

    def _double_float(self, vdi: VDI, depths: tuple[float, float]) -> int:
        """Return ``double_float``: lists may be thin for where they lie in the bounds' depths."""
        offsets, occupied = vdi.offsets.view(np.int64), np.flatnonzero(vdi.counts)
        first, last = offsets[occupied], offsets[occupied + 1] - 1
        near, far = (depth - self.depth_origin for depth in depths)
        front, back = (
            np.clip(vdi._media_at(rows, occupied, face)[face].astype(np.float64), near, far)
            for face, rows in (("front", first), ("back", last))
        )
        rounded = np.maximum(np.abs(front), np.abs(back))
        if not (self.parallel or self.shifted):
            rounded = back + self.depth_origin
        thickness = (back - front).max(initial=0.0)
        if not lists_are_far(rounded.max(initial=0.0), thickness, far - near):
            return 0
        return 2 if back.max() - near < far - front.min() else 1

    @property
    def list_bytes(self) -> int:
        """Bytes of the lists on the device: headers and supersegments."""
        return sum(buffer.nbytes for buffer in {self.headers, self.faces, self.media})

    @property
    def switches(self) -> dict[str, int | str]:
        """``-D`` names of kernels that read the lists, and their values."""
        switches: dict[str, int | str] = {
            "OFFSET_T": "long" if self.long_offsets else "int",
            "DEPTH": "PARALLEL" if self.parallel else "SHIFTED" if self.shifted else "RECIPROCAL",
            "PACKED": self.packed,
        }
        if self.double_float:
            switches["DOUBLE_FLOAT_RAYS"] = self.double_float
        return switches

    def list_space(self, camera: Camera) -> NDArray[np.float64]:
        """Model frame to homogeneous list coordinates, float64 (4, 4).

        Rows give u and v in pixels from the window's centre, the depth coordinate, and the
        denominator that all three are divided by (1 in parallel projection).
        """
        viewport = camera.viewport_matrix(self.window) @ camera.model_to_view
        half = np.asarray(self.window, dtype=np.float64) / 2
        u, v, depth, denominator = viewport
        if self.parallel or self.shifted or self.double_float:
            coordinate = depth.copy()
            coordinate[3] -= self.depth_origin
        else:
            coordinate = np.array([0.0, 0.0, 0.0, -1.0])  # -1 / Z
        return np.stack([half[0] * u, half[1] * v, coordinate, denominator])

    def _upload(self, vdi: VDI) -> None:
        """Bring the lists to the device, exact or packed, and build the occupancy grid."""
        runtime, packing = self.runtime, vdi.packing
        # Where lists begin: by their bundles or, of 8-byte supersegments, each
        if self.packed == 8:
            lengths = vdi.counts + LIST_HEADER * (vdi.counts > 0)
        else:
            lengths = _longest(vdi.counts) * BUNDLE**2
        begins = np.zeros(lengths.size + 1, np.int64)
        np.cumsum(lengths, out=begins[1:])
        entries = int(begins[-1])
        # Kernels count words of 8 bytes, of which an entry takes up to two, by signed numbers
        self.long_offsets = 2 * entries >= 2**31
        offset_type = np.int64 if self.long_offsets else np.int32
        if self.packed == 8:
            headers: NDArray[Any] = begins.astype(offset_type)
        else:
            longest = lengths.reshape(-1) // BUNDLE**2
            headers = (begins[:-1] | longest << FIRST_BITS).view(np.uint64)
        # Direction of a centre ray per unit of view depth, in the model frame
        centre = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction
        with kept_together() as keep, contextlib.ExitStack() as stack:

            def upload(array: NDArray[Any], name: str) -> DeviceBuffer:
                return stack.enter_context(runtime.upload(array, name))

            def made(shape: tuple[int, ...], dtype: type[np.generic], name: str) -> DeviceBuffer:
                # On a CPU device memory of our own, which systems give in large pages: a driver's
                # comes in pages of 4 KiB, each of which the kernel is interrupted for where it
                # first writes
                return keep(runtime.result(shape, dtype, name, lasting=True))

            self.headers = keep(runtime.upload(headers, "list headers"))
            starts = upload(vdi.offsets.astype(offset_type), "list offsets")
            common = {
                "starts": starts,
                "headers": self.headers,
                "width": self.window[0],
                "height": self.window[1],
                "centre_ray": upload(centre.astype(np.float32), "centre rays"),
            }
            if isinstance(packing, Packed8):
                # Lists begin with their scales
                self.depth_step = packing.step
                self.faces = self.media = made((max(1, entries), 2), np.uint32, "supersegments")
                words = packing.words if len(packing.words) else np.zeros((1, 2), np.uint32)
                faces = {
                    "origins": upload(packing.origins, "origins of lists"),
                    "strides": upload(packing.strides, "strides of lists"),
                    "words": upload(words, "stored supersegments"),
                    "step": packing.step,
                }
                stored = {**faces, "stored": faces["words"], "words": self.faces}
                prepare = runtime.bind(PREPARE_PACKED, self.switches, **common, **stored)
            else:
                # Depth coordinates and extinctions, 24 or 16 bytes, by bundles of lists
                faces = {
                    "fronts": upload(vdi.front, "front depths"),
                    "backs": upload(vdi.back, "back depths"),
                }
                if isinstance(packing, Packed16):
                    self.faces = self.media = made((entries, 4), np.uint32, "supersegments")
                    colors: NDArray[Any] = packing.color
                else:
                    self.faces = made((entries, 2), np.float32, "supersegment faces")
                    self.media = made((entries, 4), np.float32, "supersegment media")
                    colors = vdi.color
                prepare = runtime.bind(
                    PREPARE_LISTS,
                    self.switches,
                    **common,
                    **faces,
                    colors=upload(colors, "supersegment colours"),
                    optical_depths=upload(vdi.optical_depth, "optical depths"),
                    depth_origin=self.depth_origin,
                    nearest=self.nearest,
                    faces=self.faces,
                    media=self.media,
                )
            self.occupancy = OccupancyGrid(
                runtime,
                vdi,
                {"offsets": starts, **faces},
                nearest=self.nearest,
                shifted=self.shifted,
                long_offsets=self.long_offsets,
            )
            keep(self.occupancy.counts), keep(self.occupancy.masks)
            prepare(padded(self.window[0] * self.window[1], GROUP), GROUP)
            runtime.finish()  # the buffers above may be host memory in use


def _longest(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the length of the longest list of each bundle; ``counts`` are (height, width)."""
    height, width = counts.shape
    longest = np.pad(counts, ((0, -height % BUNDLE), (0, -width % BUNDLE)))
    longest = functools.reduce(np.maximum, (longest[n::BUNDLE] for n in range(BUNDLE)))
    return functools.reduce(np.maximum, (longest[:, n::BUNDLE] for n in range(BUNDLE)))
