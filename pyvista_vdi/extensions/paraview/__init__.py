"""ParaView: the command that says where its plugin is; the plugin is a file of its own."""

from __future__ import annotations

from pyvista_vdi.registry import Extension, Verb

EXTENSION = Extension(
    verbs=(
        Verb(
            "paraview",
            "print the path of the plugin for ParaView",
            "pyvista-vdi paraview --environment",
            "pyvista_vdi.extensions.paraview.cli:OPTIONS",
            "pyvista_vdi.extensions.paraview.cli:paraview",
        ),
    ),
    requires=("series",),  # of which files with times are made
)
