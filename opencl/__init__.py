"""Kernel sources of pyvista_vdi: OpenCL C 1.2 text, no Python.

``#include "folder/file.cl"`` takes a path relative to this folder and is expanded by
:mod:`pyvista_vdi.device.programs`, once per file and with ``#line`` marks. The first lines of each
file say what it is; ``docs/dev/where_is_what.md`` leads from each step of the paper to its kernel.

``lib``
    Formulas that the others share, of one ray or of sixteen (``lib/lanes.cl``).
``volume``
    What lies in a volume along a ray, drawn (the baseline) or handed on to generation.
``generation``
    From a volume to lists of supersegments: sampled, merged, fitted, packed.
``raycasting``, ``multi_vdi``
    From one VDI (paper, sections 3 to 5), or several, to a picture from any view.
``large``
    Volumes in blocks: an extension's.
"""
