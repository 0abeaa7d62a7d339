"""Sets: the VDIs of a scene from many views, their files, and what chooses among them."""

from __future__ import annotations

from pyvista_vdi.registry import Extension, FileFormat, Verb

EXTENSION = Extension(
    names={
        "VDISet": "pyvista_vdi.extensions.sets.vdi_set:VDISet",
        "generate_set": "pyvista_vdi.extensions.sets.generate:generate_set",
    },
    formats=(FileFormat(".vdiset", "pyvista_vdi.extensions.sets.vdi_set", "set", head="set.json"),),
    verbs=(
        Verb(
            "set",
            "write VDIs of a volume from several sides",
            "pyvista-vdi set knee.nrrd -o knee.vdiset --cmap bone --opacity sigmoid_6",
            "pyvista_vdi.extensions.sets.cli:OPTIONS",
            "pyvista_vdi.extensions.sets.cli:generate",
        ),
    ),
    requires=("series",),  # which are stored in the same way
)
