"""Generates a VDI where its volume is: in memory, or in chunks that this or other hosts read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import Dial
from pyvista_vdi.quality.probe import generate_by_dial

Progress = Callable[[float], object]


def generate_anywhere(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    dial: Dial | None,
    options: GenerationOptions,
    *,
    client: Any = None,
    device: Any = None,
    progress: Progress | None = None,
    metadata: Mapping[str, Any] | None = None,
) -> VDI:
    """Generate a VDI of a volume in memory, or of a chunked one in blocks, here or by workers.

    Arguments and errors are those of :func:`pyvista_vdi.generate`.
    """
    scene = (volume, camera, window_size, transfer_function)
    made: dict[str, Any] = {"device": device, "progress": progress, "metadata": metadata}
    if volume.chunked:
        if dial is not None:
            raise UnsupportedError(
                "quality, target_ssim, target_fps and max_bytes measure the scene, and "
                f"{volume.name!r} is chunked: give max_supersegments, or load a coarse level"
            )
        generate_in_blocks = registry.generator("blocks")
        return generate_in_blocks(*scene, options, client=client, **made)  # type: ignore[no-any-return]
    if client is not None:
        raise InvalidArgumentError(
            f"client is for chunked volumes, and {volume.name!r} is in memory: give a Volume of a "
            "Dask array (dask.array.from_array), or leave client out"
        )
    return generate_by_dial(*scene, dial, options, **made)
