"""Where a chunked volume's VDI is made: on the local device, or by the workers of a cluster."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import MissingDependencyError
from pyvista_vdi.large.generate import generate_chunked
from pyvista_vdi.model.vdi import VDI


def generate_in_blocks(*arguments: Any, client: Any = None, **options: Any) -> VDI:
    """Make a VDI by :func:`~pyvista_vdi.large.generate.generate_chunked`, or on a cluster.

    Raises
    ------
    MissingDependencyError
        If ``client`` is given and dask.distributed is not installed.
    """
    if client is None:
        return generate_chunked(*arguments, **options)
    try:
        from pyvista_vdi.large.on_dask import generate_on_dask
    except ImportError as error:
        raise MissingDependencyError(
            f"a cluster needs dask.distributed ({error}): pip install 'pyvista-vdi[dask]'"
        ) from error
    return generate_on_dask(*arguments, client=client, **options)
