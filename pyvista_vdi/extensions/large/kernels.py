"""The arguments of the kernels of ``opencl/large/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration
from pyvista_vdi.generation.kernels import PLACE, WEIGHTS
from pyvista_vdi.volume.kernels import MEDIUM, VIEW

OPTICAL_DEPTHS = KernelDeclaration(
    "large/optical_depths.cl",
    "optical_depths",
    **MEDIUM,
    **VIEW,
    **PLACE,
    stride="int",
    depths="float*",
)
COPY_RUNS = KernelDeclaration(
    "large/runs.cl",
    "copy_runs",
    records="float*",
    capacity="int",
    columns="int",
    rows="int",
    counts="uint*",
    begins="uint*",
    runs="float*",
)
APPEND_RUNS = KernelDeclaration(
    "large/runs.cl",
    "append_runs",
    width="int",
    height="int",
    **PLACE,
    forms="float*",
    capacity="int",
    **WEIGHTS,
    finest="float",
    window="int4",
    begins="uint*",
    runs="float*",
    all_records="float*",
    counts="uint*",
)
