"""VDIs as OpenEXR deep images, exact or as other programs take them."""

from __future__ import annotations

from pyvista_vdi.registry import Extension, FileFormat

EXTENSION = Extension(
    formats=(
        FileFormat(
            ".exr",
            "pyvista_vdi.extensions.deep_exr.files",
            read_options=("camera", "thickness", "linear"),
            write_options=("exact", "linear"),
            compressions=("zips", "none"),
        ),
    )
)
