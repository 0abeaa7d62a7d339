"""Kernel sources of pyvista_vdi: OpenCL C 1.2 text, no Python.

``#include "folder/file.cl"`` takes a path relative to this folder and is expanded by
:mod:`pyvista_vdi.opencl_runtime.sources`, once per file and with ``#line`` marks.

Map of the files
----------------
``common/probe.cl``
    ``probe``: the kernel that a device must run correctly before it is used.
"""
