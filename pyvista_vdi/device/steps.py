"""Kernels that follow one ray in a work-item, or a block of rays in vectors (``lib/lanes.cl``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device.programs import Define, Kernel
from pyvista_vdi.device.runtime import Runtime
from pyvista_vdi.device.work_order import BLOCK_RAYS, GROUP


@dataclass(frozen=True)
class Step:
    """A kernel, and how many rays a work-item of it follows: 1, or a block of 16."""

    kernel: Kernel
    rays: int = 1

    @classmethod
    def of(
        cls,
        runtime: Runtime,
        path: str,
        name: str,
        defines: Mapping[str, Define],
        *,
        in_blocks: bool = False,
    ) -> Step:
        """Return the step of a kernel, whose work-items follow blocks of rays if ``in_blocks``."""
        rays = BLOCK_RAYS if in_blocks else 1
        defines = {**defines, "LANES": rays}
        # PoCL rounds functions of a vector otherwise than of a number, in one of 10^5 values
        if in_blocks and runtime.info.platform.startswith("Intel"):
            defines["VECTOR_FUNCTIONS"] = 1
        return cls(runtime.kernel(path, name, defines), rays)

    def launch(self, runtime: Runtime, rays: int, *arguments: Any) -> None:
        """Launch it for so many rays, a multiple of a group's."""
        runtime.launch(self.kernel, rays // self.rays, GROUP // self.rays, *arguments)
