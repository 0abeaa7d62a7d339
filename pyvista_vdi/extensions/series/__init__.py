"""Series: the VDIs of a scene at several times, their files, and what plays them."""

from __future__ import annotations

from pyvista_vdi.registry import Extension, FileFormat, Verb

EXTENSION = Extension(
    names={
        "SeriesWriter": "pyvista_vdi.extensions.series.writer:SeriesWriter",
        "VDISeries": "pyvista_vdi.extensions.series.series:VDISeries",
        "generate_series": "pyvista_vdi.extensions.series.generate:generate_series",
    },
    formats=(
        FileFormat(".vdis", "pyvista_vdi.extensions.series.series", "series", head="series.json"),
    ),
    verbs=(
        Verb(
            "series",
            "write VDIs, or those of volumes, that are time steps",
            "pyvista-vdi series density_*.nrrd -o run.vdis --cmap bone --clim 0 255",
            "pyvista_vdi.extensions.series.cli:OPTIONS",
            "pyvista_vdi.extensions.series.cli:series",
        ),
    ),
    methods={"VDICollection.save": "pyvista_vdi.extensions.series.archive:save"},
)
