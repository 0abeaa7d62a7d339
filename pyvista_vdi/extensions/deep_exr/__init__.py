"""VDIs as OpenEXR deep images."""

from __future__ import annotations

from pyvista_vdi.registry import Extension, FileFormat

EXTENSION = Extension(
    formats=(
        FileFormat(
            ".exr",
            "pyvista_vdi.extensions.deep_exr.files",
            read_options=("camera", "thickness"),
            needs='the package OpenEXR (pip install "pyvista-vdi[exr]"); or use .vdi files',
        ),
    )
)
