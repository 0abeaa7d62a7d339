"""The engine's VDIs, pictures and depths, with options by name as in public functions."""

from __future__ import annotations

from dataclasses import replace

from pyvista_vdi.generation import generate
from pyvista_vdi.model.chunked import ChunkedArray
from pyvista_vdi.model.options import (
    FrameRequest,
    GenerationOptions,
    GenerationRequest,
    MediumOptions,
    RenderOptions,
)
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting import multi_vdi, raycast
from pyvista_vdi.raycasting.scene import Scene
from pyvista_vdi.volume import render

#: What frames take beside options.
_OF_FRAMES = ("opaque_depth", "device", "out")


def request(
    volume, camera, window_size, transfer_function, options=None, *, device=None, progress=None,
    metadata=None, **changes
):  # fmt: skip
    """The request of a VDI."""
    made = replace(options or GenerationOptions(), **changes)
    return GenerationRequest(
        volume, transfer_function, camera, window_size, made, device, progress, metadata or {}
    )


def generate_vdi(*arguments, **options):
    """A VDI of a volume in memory."""
    return generate.generate_vdi(request(*arguments, **options))


class InChunks:
    """An array in memory with the manners of one of zarr."""

    def __init__(self, array, chunks):
        self.array, self.shape, self.dtype, self.chunks = array, array.shape, array.dtype, chunks

    def __getitem__(self, box):
        return self.array[box]


def generate_in_blocks(volume, *arguments, chunks=None, client=None, block_bytes=1, **options):
    """A VDI of a volume in blocks of a chunk each; of one in memory, in such chunks."""
    from pyvista_vdi.extensions.large.generate import generate_in_blocks

    if chunks is not None:
        array = ChunkedArray(InChunks(volume.array, chunks))
        volume = Volume(array, volume.spacing, volume.origin, volume.direction, name=volume.name)
    asked = request(volume, *arguments, **options)
    return generate_in_blocks(asked, client, block_bytes=block_bytes)


def frame(vdi, camera, size=None, **options):
    """The request of a frame, by default of the VDI's own size."""
    others = {name: options.pop(name) for name in _OF_FRAMES if name in options}
    size = vdi.window_size if size is None else size
    return FrameRequest(camera, size, RenderOptions(**options), **others)


def render_vdi(vdi, camera, size=None, **options):
    """The picture of a VDI."""
    return raycast.render_vdi(vdi, frame(vdi, camera, size, **options))


def draw(prepared, camera, size, image, *, first_hit=None, **options):
    """Draw a frame of a prepared VDI into an image on the device."""
    request = frame(None, camera, size, **options)
    raycast.enqueue(Scene.of(prepared, request, lambda kept: kept, first_hit), image)


def render_vdis(vdis, camera, size, *, opaque_depth=None, device=None, **options):
    """The picture of several VDIs."""
    request = FrameRequest(camera, size, opaque_depth=opaque_depth, device=device)
    return multi_vdi.render_vdis(multi_vdi.placed_vdis(vdis, camera, **options), request)


def owned_image(members, size, *, margin=0.0, opaque_depth=None, device=None):
    """The picture of several placed VDIs, and to which each pixel belongs."""
    request = FrameRequest(members[0].camera, size, opaque_depth=opaque_depth, device=device)
    return multi_vdi.owned_image(members, request, margin=margin)


def raycast_volume(volume, camera, size, transfer_function, *, early_termination=True, **options):
    """The picture of a volume."""
    names = MediumOptions.__dataclass_fields__
    sampling = {name: options.pop(name) for name in names if name in options}
    cutoff = RenderOptions.transmittance_cutoff if early_termination else 0.0
    request = frame(None, camera, size, transmittance_cutoff=cutoff, **options)
    return render.raycast_volume(volume, transfer_function, request, MediumOptions(**sampling))
