"""The PyVista plugin: plotter component, accessor and reader; the only importer of pyvista."""

from __future__ import annotations
