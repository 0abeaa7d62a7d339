"""How kernels that march through a volume follow rays: in blocks on CPUs, wherever they can be."""

from __future__ import annotations

from collections.abc import Mapping

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.programs import Define
from pyvista_vdi.device.steps import Step

#: ``-D`` names of marches that follow rays in blocks; a value, where it must be that.
_IN_BLOCKS: Mapping[str, Define] = {
    "VOXEL_T": None,
    "INDEX_T": "uint",
    "NEAREST": None,
    "BY_SCALAR": None,
    "SKIP_EMPTY": None,
    "MACROCELL_SHIFT": None,
    "COMPENSATED": 1,
    "CROPPED": None,
    "GRID_PART": None,
    "OPACITY_MULTIPLIER": None,
    "SHADED": None,
    "HEADLIGHT": None,
    "POSITIONAL_LIGHTS": None,
    "GRADIENT_OPACITY": None,
    "BLANKED": None,
    "MAXIMUM": None,
    "MINIMUM": None,
    "AVERAGE": None,
    "ADDITIVE": None,
}


def march_step(runtime: Runtime, path: str, name: str, defines: Mapping[str, Define]) -> Step:
    """Return a kernel that marches, one that follows blocks of rays where it is written so.

    ``defines`` are those of the volume, the rays and the kernel. The bits are the same.
    """
    in_blocks = runtime.is_cpu and all(
        key in _IN_BLOCKS and _IN_BLOCKS[key] in (None, value) for key, value in defines.items()
    )
    return Step.of(runtime, path, name, defines, in_blocks=in_blocks)
