"""The plugin is for servers of one process."""

from __future__ import annotations

from typing import Any


def require_one_process(controller: Any) -> None:
    """Raise ImportError if ParaView's server has several ranks, by its controller."""
    count = 1 if controller is None else controller.GetNumberOfProcesses()
    if count > 1:
        raise ImportError(
            f"this server has {count} ranks, and the VDI plugin works with one: start pvserver or "
            "pvbatch without mpirun, or let the ranks of a simulation make the VDI, by "
            "pyvista_vdi.extensions.insitu.InSitu, and open its file"
        )
