"""What kernels that march through a volume are compiled for, and how many rays they follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import KernelDeclaration, Runtime
from pyvista_vdi.device.declarations import Define
from pyvista_vdi.device.work_order import BLOCK_RAYS, GROUP


@dataclass(frozen=True)
class Variant:
    """What changes the code of kernels that march through a volume.

    Attributes
    ----------
    voxel, index : str
        OpenCL's types of a voxel's component, and of a voxel's address.
    components : {1, 4}
        A scalar, or colours and a scalar.
    nearest, by_scalar : bool
        The nearest point is sampled; the medium of its scalar is looked up.
    shaded : {0, 1, 2}
        Samples are not lit, lit, or lit by one headlight and nothing else.
    gradient_opacity, part, cropped : bool
        Opacity depends on the gradient; voxels are part of a grid; what cropping keeps is no box.
    double_float, compensated
        Rays enter the volume so far from where they are formed that float32 does not hold it; how
        sums along a ray are kept (``lib/compositing.cl``).
    sharp : bool
        A specular power is so large that cosines round it off; no ``-D`` option.
    """

    voxel: str = "uchar"
    index: str = "uint"
    components: int = 1
    nearest: bool = False
    by_scalar: bool = False
    shaded: int = 0
    gradient_opacity: bool = False
    part: bool = False
    double_float: bool = False
    compensated: int = 0
    cropped: bool = False
    sharp: bool = False

    @property
    def defines(self) -> dict[str, Define]:
        """The ``-D`` options, all of them in every program."""
        return {
            "VOXEL_T": self.voxel,
            "INDEX_T": self.index,
            "COMPONENTS": self.components,
            "NEAREST": self.nearest,
            "BY_SCALAR": self.by_scalar,
            "SHADED": self.shaded,
            "GRADIENT_OPACITY": self.gradient_opacity,
            "GRID_PART": self.part,
            "DOUBLE_FLOAT_RAYS": self.double_float,
            "COMPENSATED": self.compensated,
            "CROPPED": self.cropped,
        }

    @property
    def one_by_one(self) -> bool:
        """Whether rays are followed one by one whatever the device."""
        return (
            self.index != "uint"
            or self.components > 1
            or self.double_float
            or self.compensated > 1
            or self.sharp
        )


class RayLaunch:
    """A launch of a kernel for rays: one for each work-item, or sixteen (``opencl/cpu16/``).

    CPUs follow sixteen, unless there is no way but ``one_by_one``; the bits are the same. Other
    arguments are those of :meth:`Runtime.bind`; a null pointer that the other form alone takes is
    left out.
    """

    def __init__(
        self,
        runtime: Runtime,
        one: KernelDeclaration,
        sixteen: KernelDeclaration,
        defines: Mapping[str, Define],
        *,
        one_by_one: bool = False,
        **arguments: Any,
    ) -> None:
        in_blocks = runtime.is_cpu and not one_by_one
        declaration, self._rays = (sixteen, BLOCK_RAYS) if in_blocks else (one, 1)
        if in_blocks and runtime.info.platform.startswith("Intel"):
            # PoCL rounds functions of a vector otherwise than of a number, in one of 10^5 values
            defines = {**defines, "VECTOR_FUNCTIONS": 1}
        given = {k: v for k, v in arguments.items() if v is not None or k in declaration.arguments}
        self._launch = runtime.bind(declaration, defines, **given)

    def __call__(self, rays: int, **arguments: Any) -> None:
        """Launch it for so many rays, a multiple of a group's."""
        self._launch(rays // self._rays, GROUP // self._rays, **arguments)
