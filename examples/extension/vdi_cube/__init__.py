"""Adds Gaussian's cube files to pyvista-vdi, and a verb that prints a volume's histogram."""

from pyvista_vdi.registry import Extension, Verb

EXTENSION = Extension(
    readers={".cube": "vdi_cube.cube:read"},
    names={"read_cube": "vdi_cube.cube:read"},
    verbs=(
        Verb(
            "histogram",
            "print how often a volume has which values",
            "pyvista-vdi histogram water.cube --bins 8",
            options="vdi_cube.histogram:add_options",
            run="vdi_cube.histogram:run",
        ),
    ),
)
