"""Where a chunked volume's VDI is made: on the local device, or by the workers of a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidArgumentTypeError,
    MissingDependencyError,
    with_article,
)
from pyvista_vdi.extensions.large.generate import generate_chunked
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.types import ClientLike
from pyvista_vdi.model.vdi import VDI


def generate_in_blocks(request: GenerationRequest, client: ClientLike | None = None) -> VDI:
    """Make a VDI block by block on the local device, or on the workers of a cluster."""
    if client is None:
        return generate_chunked(request)
    if isinstance(client, str):
        with connected(client) as found:
            return generate_in_blocks(request, found)
    try:
        from distributed import Client

        from pyvista_vdi.extensions.large.on_dask import generate_on_dask
    except ImportError as error:
        raise _without_dask(error) from error
    if not isinstance(client, Client):
        raise InvalidArgumentTypeError(
            f"client must be a distributed.Client or the address of a scheduler; got "
            f"{with_article(type(client).__name__)}: give distributed.Client(cluster) for a cluster"
        )
    return generate_on_dask(request, client=client)


@contextmanager
def connected(address: str | None) -> Iterator[Any]:
    """Connect to the Dask scheduler at an address; ``None`` is the client of none."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise _without_dask(error) from error
    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(
            f"no Dask scheduler answers at {address!r} ({error}): `dask scheduler` starts one and "
            "says its address"
        ) from error
    with client:
        yield client


def _without_dask(error: ImportError) -> MissingDependencyError:
    return MissingDependencyError(
        f"a cluster needs dask.distributed ({error}): pip install 'pyvista-vdi[dask]'"
    )
