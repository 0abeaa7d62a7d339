"""The kernels of ``opencl/large/``."""

from __future__ import annotations

from pyvista_vdi.device import KernelDeclaration

OPTICAL_DEPTHS = KernelDeclaration("large/optical_depths.cl", "optical_depths")
COPY_RUNS = KernelDeclaration("large/runs.cl", "copy_runs")
APPEND_RUNS = KernelDeclaration("large/runs.cl", "append_runs")
