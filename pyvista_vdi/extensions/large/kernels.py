"""The arguments of the kernels of ``opencl/large/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration
from pyvista_vdi.generation.kernels import RECORDING
from pyvista_vdi.volume.kernels import MEDIUM, VIEW

OPTICAL_DEPTHS = KernelDeclaration(
    "large/optical_depths.cl", "optical_depths", **MEDIUM, **VIEW, stride="int", depths="float*"
)
COPY_RUNS = KernelDeclaration(
    "large/runs.cl",
    "copy_runs",
    view=VIEW["view"],
    capacity="int",
    records="float*",
    counts="uint*",
    begins="uint*",
    runs="float*",
)
APPEND_RUNS = KernelDeclaration(
    "large/runs.cl",
    "append_runs",
    **VIEW,
    recording=RECORDING,
    window="int4",
    begins="uint*",
    runs="float*",
    records="float*",
    counts="uint*",
)
