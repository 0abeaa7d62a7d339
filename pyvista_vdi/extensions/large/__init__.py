"""Volumes in blocks: of chunked stores, on the workers of a Dask cluster, on ranks of MPI."""

from __future__ import annotations

from pyvista_vdi.registry import Extension

EXTENSION = Extension(
    methods={"generating by blocks": "pyvista_vdi.extensions.large.generate:generate_in_blocks"}
)
