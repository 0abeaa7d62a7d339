"""The memory that making a VDI takes, before it is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.list_arrays import SUPERSEGMENT_BYTES
from pyvista_vdi.generation.slices import Slices
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.upload import volume_bytes, voxel_bytes


@dataclass(frozen=True)
class Estimate:
    """Memory that making a VDI takes, in bytes.

    Attributes
    ----------
    volume : int
        The volume on the device, or as many bricks of it as a memory limit leaves room for.
    vdi_worst_case : int
        The VDI with every list full; most are far shorter.
    working : int
        Buffers on the device while a slice of rays is made.
    occlusion : int
        The grid of the ambient occlusion on the device, while it is computed.
    total : int
        All of these.
    """

    volume: int
    vdi_worst_case: int
    working: int
    occlusion: int = 0

    @property
    def total(self) -> int:
        """Sum of them all, bytes."""
        return self.volume + self.vdi_worst_case + self.working + self.occlusion


def estimate(
    volume: Volume,
    window_size: Sequence[int],
    options: GenerationOptions | None = None,
    *,
    transfer_function: TransferFunction | None = None,
    device: Any = None,
    **changes: Any,
) -> Estimate:
    """State the memory that :func:`~pyvista_vdi.generation.generate.generate_vdi` takes.

    Scalars whose range is narrow for how far it is from 0 are taken relative to it, which takes 4
    bytes a voxel on the device, and as much on the host while they are scaled. Without a transfer
    function they are taken to be read as they are. A GPU makes larger slices of a VDI at a time.
    """
    options = GenerationOptions.of(options, changes)
    width, height = size = check_window_size(window_size)
    slices = Slices(get_runtime(device), size, options)
    nbytes = volume.array.size * voxel_bytes(volume, transfer_function)
    on_device, samples = volume_bytes(volume, nbytes, slices.room(volume))
    return Estimate(
        volume=on_device,
        vdi_worst_case=width * height * (options.max_supersegments * SUPERSEGMENT_BYTES + 8) + 8,
        working=slices.bytes + samples,
        occlusion=options.occlusion_bytes(volume),
    )
