"""Several VDIs to one image, on a device: merged by depth along each ray.

Each VDI's raycaster writes what a ray crosses into a pool, as segments between two view depths of
the new view; then the rays' streams of segments are merged and composited (docs/dev/conventions.md,
"Several VDIs"). Rays are taken in bands, so that the pool stays small. Where no two of the VDIs can
be met, each is drawn as it would be by itself.
"""

import contextlib
import hashlib
import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import DeviceBuffer, Launch, Runtime, get_runtime, padded
from pyvista_vdi.device.constants import CELL, CELL_ITEMS, GROUP, SEGMENT_SIZE, SPARE_SLOTS
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import FrameRequest, RenderOptions
from pyvista_vdi.model.ray_forms import Rectangle, pixels_of_points
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.choose import choose, choose_merge
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.raycasting.raycast import enqueue, render_vdi
from pyvista_vdi.raycasting.scene import Scene

_digests: weakref.WeakKeyDictionary[VDI, bytes] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class PlacedVDI:
    """A VDI and where it is in a scene.

    The ``model_transform`` of ``camera``, the new view, says where this VDI's model frame is.
    ``options`` say how it looks; several VDIs have neither previews nor another cutoff than the
    default.
    """

    vdi: VDI
    camera: Camera
    options: RenderOptions = field(default_factory=RenderOptions)


def placed_vdis(
    vdis: Sequence[VDI],
    camera: Camera,
    model_transforms: Sequence[ArrayLike] | None = None,
    clipping_planes: Any = None,
    cropping: Any = None,
    opacity_multiplier: float | Sequence[float] = 1.0,
    skip_empty: bool = True,
) -> list[PlacedVDI]:
    """Return VDIs with what :func:`pyvista_vdi.render` was given for all, or for each, of them.

    InvalidArgumentError if there is none, or there are not as many values as VDIs.
    """
    count = len(vdis)
    for vdi in vdis:
        if not isinstance(vdi, VDI):
            raise InvalidArgumentError(f"expected VDIs, got {type(vdi).__name__} among them")
    if not vdis:
        raise InvalidArgumentError("there is no VDI to render: the sequence is empty")
    cameras = [camera] * count
    if model_transforms is not None:
        matrices = list(model_transforms) if np.iterable(model_transforms) else []
        wanted = "model_transforms must have one matrix for each of the {} VDIs"
        matrices = _each(matrices, count, wanted, got=len(matrices))
        cameras = [camera.replace(model_transform=matrix) for matrix in matrices]
    croppings: Sequence[Any] = [None] * count
    if cropping is not None:
        wanted = "cropping must be a list with an entry for each of the {} VDIs, None where "
        wanted += "nothing is cropped"
        croppings = _each(cropping, count, wanted, got=cropping)
    multipliers: Sequence[Any] = [opacity_multiplier] * count
    if isinstance(opacity_multiplier, list | tuple):
        wanted = "opacity_multiplier must be a number, or one for each of the {} VDIs"
        multipliers = _each(opacity_multiplier, count, wanted, got=opacity_multiplier)
    planes = _planes_of_each(clipping_planes, count)
    each = zip(planes, croppings, multipliers, strict=True)
    options = [RenderOptions(*one, skip_empty=skip_empty) for one in each]
    return [PlacedVDI(*one) for one in zip(vdis, cameras, options, strict=True)]


def canonical_order(placed: Sequence[PlacedVDI], depths: Sequence[float]) -> list[int]:
    """Return the indices of VDIs in an order that does not depend on the one they are given in.

    Sums of floats depend on it where there are more than two, and so does where light is known to
    have ended: that of ``depths``, so that those behind end where those before are opaque.
    """
    tied = len(set(depths)) < len(depths)
    keys = [_key(one) if tied else () for one in placed]
    return sorted(range(len(placed)), key=lambda i: (depths[i], keys[i]))


def _key(placed: PlacedVDI) -> tuple[bytes, ...]:
    options = placed.options
    planes = np.asarray(options.clipping_planes, dtype=np.float64).tobytes()
    looks = repr((options.cropping, options.opacity_multiplier)).encode()
    return _digest(placed.vdi), placed.camera.model_transform.tobytes(), planes, looks


def _digest(vdi: VDI) -> bytes:
    """Return a digest of all that a VDI's picture depends on; computed once."""
    known = _digests.get(vdi)
    if known is None:
        digest = hashlib.blake2b(digest_size=16)
        scalars = (vdi.camera, vdi.window_size, vdi.bounds, vdi.depth_origin)
        digest.update(repr(scalars).encode())
        digest.update(vdi.camera.model_transform.tobytes())
        for array in (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth):
            digest.update(array.data)
        known = _digests[vdi] = digest.digest()
    return known


def common_window_size(placed: Sequence[PlacedVDI]) -> tuple[int, int]:
    """Return the size of the pictures of VDIs, all of which must have the same."""
    sizes = {one.vdi.picture_size for one in placed}
    if len(sizes) > 1:
        raise InvalidArgumentError(
            f"the VDIs have different window sizes, {sorted(sizes)}: say which the image is to "
            "have (window_size=)"
        )
    return sizes.pop()


def _each(values: Any, count: int, wanted: str, *, got: object) -> list[Any]:
    """Return a list or a tuple with one value for each VDI; anything else is refused."""
    if not isinstance(values, list | tuple) or len(values) != count:
        raise InvalidArgumentError(f"{wanted.format(count)}; got {got!r}")
    return list(values)


def _planes_of_each(planes: Any, count: int) -> list[ArrayLike | None]:
    """Return each VDI's clipping planes: the same for all, or one entry for each."""
    if planes is None:
        return [None] * count
    try:
        shape = np.shape(np.asarray(planes, dtype=np.float64))
    except (
        TypeError,
        ValueError,
        OverflowError,
    ):  # None among them, or different numbers of planes
        shape = ()
    if len(shape) == 2:
        return [planes] * count
    wanted = "clipping_planes must be (k, 6), or have such an array or None for each of the {} VDIs"
    return _each(list(planes) if np.iterable(planes) else [], count, wanted, got=planes)


#: Bytes of the pool, unless the segments of a cell need more. A GPU needs more rays at a time; on a
#: CPU what is below 32 MiB is memory that the process has freed, without page faults (glibc).
_POOL_BYTES_CPU = 24 * 2**20
_POOL_BYTES = 256 * 2**20
#: Cells of a work-group, of which each work-item has a row.
_CELLS_OF_GROUP = 16
#: Segments of a ray that the first frame has room for; later ones go by the frame before.
_FIRST_SLOTS = 64
#: Room for so many times what the frame before needed.
_SPARE_SLOTS = 1.1

_slots: weakref.WeakKeyDictionary[VDI, int] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class OwnedImage:
    """The picture of several VDIs: premultiplied RGBA, float32 (H, W, 4), top row first.

    ``owner``: int16 (H, W), the index of the VDI to which each pixel belongs, -1 where there is
    none.
    """

    image: NDArray[np.float32]
    owner: NDArray[np.int16]


def render_vdis(placed: Sequence[PlacedVDI], request: FrameRequest) -> NDArray[np.float32]:
    """Raycast VDIs together: premultiplied RGBA, float32 (height, width, 4), top row first.

    Camera and options are those of each VDI; ``request`` has the rest.
    """
    if len(placed) == 1:
        (one,) = placed
        return render_vdi(one.vdi, request.replace(camera=one.camera, options=one.options))
    return owned_image(placed, request).image


def owned_image(
    placed: Sequence[PlacedVDI], request: FrameRequest, *, margin: float = 0.0
) -> OwnedImage:
    """Raycast VDIs together, and say to which each pixel belongs.

    All are seen by the same eye: the cameras of ``placed`` differ in ``model_transform`` only, and
    those of ``request`` and its options are not used. A pixel belongs to the first VDI that it
    meets and whose bounds it meets ``margin`` pixels farther to all four corners, too; or else to
    the first that it meets. The picture is the same, to the last bit, in whatever order the VDIs
    are given.
    """
    runtime, scenes = get_runtime(request.device), []
    with contextlib.ExitStack() as stack:
        keep = stack.enter_context
        for one in placed:
            # All end at the same transmittance
            options = one.options.replace(
                transmittance_cutoff=RenderOptions.transmittance_cutoff, preview_samples=None
            )
            own = request.replace(camera=one.camera, options=options)
            scenes.append(Scene.of(prepared_vdi(runtime, one.vdi), own, keep, segments=True))
        order = canonical_order(placed, [scene.reference_depth for scene in scenes])
        width, height = request.window_size
        cells = _Cells.of(scenes, request.window_size)
        image = keep(runtime.result((height, width, 4), name="image"))
        owner = keep(runtime.result((height, width), np.int16, "owners"))
        _draw_alone(runtime, scenes, cells, image, owner)
        if len(cells.shared):
            slots = max(_slots.get(one.vdi, _FIRST_SLOTS) for one in placed)
            into = cells.shared, slots, image, owner
            needed = _draw_shared(runtime, scenes, order, margin, *into)
            for one in placed:
                _slots[one.vdi] = math.ceil(_SPARE_SLOTS * max(needed, 1))
        return OwnedImage(runtime.download(image), runtime.download(owner))


@dataclass(frozen=True)
class _Cells:
    """The cells of a window, by which VDIs may be met in them."""

    SHARED: ClassVar[int] = -1
    #: That of ``opencl/multi_vdi/cells.cl``.
    NOBODY: ClassVar[int] = -2

    #: (high, wide), bottom row first: the VDI that is the only one, or ``SHARED`` or ``NOBODY``.
    alone: NDArray[np.int16]
    #: Column and row of each in which several may be met, (n, 2), row by row.
    shared: NDArray[np.int32]

    @classmethod
    def of(cls, scenes: Sequence[Scene], size: tuple[int, int]) -> "_Cells":
        # Whether or not rays pass by what is empty: the picture is the same
        wide, high = (-(-edge // CELL) for edge in size)
        met = np.zeros((len(scenes), high, wide), np.bool_)
        for cells, scene in zip(met, scenes, strict=True):
            part = pixels_of_points(scene.camera, size, scene.prepared.occupancy.corners)
            rows = slice(part.y0 // CELL, -(-part.y1 // CELL))
            cells[rows, part.x0 // CELL : -(-part.x1 // CELL)] = True
        count = met.sum(axis=0)
        alone = np.choose(
            np.minimum(count, 2), [np.full_like(count, cls.NOBODY), met.argmax(axis=0), cls.SHARED]
        )
        shared = np.argwhere(count > 1)[:, ::-1]
        return cls(alone.astype(np.int16), np.ascontiguousarray(shared, dtype=np.int32))

    def part(self, vdi: int, size: tuple[int, int]) -> Rectangle:
        """Return the part of the window in which a VDI's cells are."""
        rows, columns = np.nonzero(self.alone == vdi)
        if not len(rows):
            return Rectangle(0, 0, 0, 0)
        return Rectangle(
            int(columns.min()) * CELL,
            min((int(columns.max()) + 1) * CELL, size[0]),
            int(rows.min()) * CELL,
            min((int(rows.max()) + 1) * CELL, size[1]),
        )


def _draw_alone(
    runtime: Runtime,
    scenes: Sequence[Scene],
    cells: _Cells,
    image: DeviceBuffer,
    owner: DeviceBuffer,
) -> None:
    """Draw the cells in which no two VDIs are met, as each would be by itself."""
    size = scenes[0].size
    wide = cells.alone.shape[1]
    group = (_CELLS_OF_GROUP, 1)
    items = padded((wide, size[1]), group)
    with contextlib.ExitStack() as stack:
        alone = stack.enter_context(runtime.upload(cells.alone, "cells", brief=True))
        window = {"alone": alone, "cells_wide": wide, "width": size[0], "height": size[1]}
        end_rays = runtime.bind("multi_vdi/cells.cl", "alone_ends", **window)
        take = runtime.bind("multi_vdi/cells.cl", "take_cells", **window, image=image, owner=owner)
        picture, ends = image, None  # others are drawn over the first one's picture
        for number, scene in enumerate(scenes):
            part = cells.part(number, size)
            if not part.pixels:
                continue
            if ends is None:
                ends = stack.enter_context(runtime.result(size[::-1], name="ends of rays"))
            elif picture is image:
                picture = stack.enter_context(runtime.result(image.shape, name="one's picture"))
            end_rays(items, group, vdi=number, opaque_depth=scene.ends, ends=ends)
            enqueue(replace(scene, segments=False, only=part, ends=ends), picture)
            take(items, group, vdi=number, picture=picture)
        if (cells.alone == cells.NOBODY).any():
            take(items, group, vdi=cells.NOBODY, picture=image)


def _draw_shared(
    runtime: Runtime,
    scenes: Sequence[Scene],
    order: Sequence[int],
    margin: float,
    cells: NDArray[np.int32],
    slots: int,
    image: DeviceBuffer,
    owner: DeviceBuffer,
) -> int:
    """Draw cells in which several VDIs are met, and return how many slots their rays have needed.

    ``order`` is that in which the scenes' streams of segments are written, and sums are formed;
    ``margin`` is :func:`owned_image`'s. Where ``slots`` are too few, cells are drawn again.
    """
    nearest = min(scene.reference_depth for scene in scenes)
    walks: list[tuple[Launch, int]] = []  # and how many rays a work-item follows
    for number, i in enumerate(order):
        scene, variant = scenes[i], choose(scenes[i])
        launch = runtime.bind(
            *variant.kernel,
            variant.switches,
            **scene.arguments(),
            number=number,
            depth_shift=scene.reference_depth - nearest,
            margin=margin,
        )
        walks.append((launch, variant.rays))
    variant, (width, height) = choose_merge(scenes), scenes[0].size
    window: dict[str, Any] = {"width": width, "height": height, "image": image, "owner": owner}
    window["transmittance_cutoff"] = RenderOptions.transmittance_cutoff
    merge = runtime.bind(*variant.kernel, variant.switches, **window)

    streams, places, needed = len(walks), np.argsort(order).astype(np.int32), 0
    room = _POOL_BYTES_CPU if runtime.is_cpu else _POOL_BYTES
    while len(cells):
        ray_bytes = 4 * SEGMENT_SIZE * (slots + SPARE_SLOTS)
        most = min(max(1, room // (CELL_ITEMS * ray_bytes)), len(cells))  # cells of a band
        rays = most * CELL_ITEMS
        with (
            runtime.result((rays * ray_bytes // 4,), name="segments") as pool,
            runtime.result((streams, rays), np.int32, "ends of the streams") as ends,
            runtime.result((streams, rays), np.uint8, "VDIs met") as contributes,
            runtime.result((rays,), name="ends of light") as dark,
            runtime.buffer((len(cells),), np.int32, "slots needed") as of_each,
            runtime.upload(cells, "cells", brief=True) as of_cells,
            runtime.upload(places, "order of the VDIs", brief=True) as streams_of,
        ):
            runtime.fill(of_each, np.int32(0))
            written = {"pool": pool, "ends": ends, "contributes": contributes}
            band = {"cells": of_cells, "capacity": slots, **written}
            for launch, _ in walks:
                launch.set(**band, band_rays=rays, dark=dark)
            merge.set(**band, rays=rays, streams_of=streams_of, needed=of_each)
            for first in range(0, len(cells), most):
                items = min(most, len(cells) - first) * CELL_ITEMS
                for launch, n in (*walks, (merge, variant.rays)):
                    launch(items // n, GROUP // n, first_cell=first)
            found = runtime.download(of_each)
        needed = max(needed, int(found.max()))
        cells, slots = cells[found > slots], needed
    return needed


def blended(parts: Sequence[tuple[VDI, float]], request: FrameRequest) -> NDArray[np.float32]:
    """Return the mean of what VDIs show, with their weights; float32 (H, W, 4), premultiplied."""
    (vdi, weight), *others = parts
    image: NDArray[Any] = render_vdi(vdi, request)
    if others:
        image *= np.float32(weight)
    for vdi, weight in others:
        image += np.float32(weight) * render_vdi(vdi, request.replace(out=None))
    return image
