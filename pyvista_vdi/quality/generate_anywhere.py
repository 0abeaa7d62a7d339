"""Generates a VDI where its volume is: in memory, or in chunks that this or other hosts read."""

from __future__ import annotations

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.options import GenerationRequest, QualityTarget
from pyvista_vdi.model.types import ClientLike
from pyvista_vdi.model.vdi import VDI


def generate_anywhere(
    request: GenerationRequest, target: QualityTarget, client: ClientLike | None = None
) -> VDI:
    """Generate a VDI of a volume in memory, or of a chunked one in blocks, here or by workers.

    Errors are those of :func:`pyvista_vdi.generate`.
    """
    name = request.volume.name
    if request.volume.chunked:
        if target:
            raise UnsupportedError(
                "quality, target_ssim, target_fps and max_bytes measure the scene, and "
                f"{name!r} is chunked: give max_supersegments, or load a coarse level"
            )
        return registry.generator("blocks")(request, client)  # type: ignore[no-any-return]
    if client is not None:
        raise InvalidArgumentError(
            f"client is for chunked volumes, and {name!r} is in memory: give a Volume of a "
            "Dask array (dask.array.from_array), or leave client out"
        )
    if not target:
        return generate_vdi(request)
    from pyvista_vdi.quality.probe import generate_to_target

    return generate_to_target(request, target)
