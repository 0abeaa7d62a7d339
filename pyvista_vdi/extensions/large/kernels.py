"""The arguments of the kernels of ``opencl/large/``, by name and type."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration
from pyvista_vdi.generation.kernels import RECORDING
from pyvista_vdi.volume.kernels import CLASSIFIED, RAYS

OPTICAL_DEPTHS = KernelDeclaration("large/optical_depths.cl", "optical_depths", CLASSIFIED, RAYS)
COPY_RUNS = KernelDeclaration("large/runs.cl", "copy_runs", RAYS)
APPEND_RUNS = KernelDeclaration("large/runs.cl", "append_runs", RAYS, RECORDING)
