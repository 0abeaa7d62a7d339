"""Generate, read and classify a VDI: the public functions that need no picture."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError, warn_external
from pyvista_vdi.model.arguments import refuse_unknown, takes
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import (
    Deferral,
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
)
from pyvista_vdi.model.types import (
    CameraLike,
    ClientLike,
    DeviceLike,
    Progress,
    VolumeLike,
    WindowSize,
)
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.view import nearest_depth
from pyvista_vdi.raycasting.classified_values import classify_on_device


@takes(
    look=Classification,
    deferral=Deferral,
    target=QualityTarget,
    options=GenerationOptions,
    request=GenerationRequest,
)
def generate(
    volume: VolumeLike,
    camera: CameraLike,
    window_size: WindowSize,
    look: Classification,
    deferral: Deferral,
    target: QualityTarget,
    options: GenerationOptions,
    *,
    client: ClientLike | None = None,
    device: DeviceLike | None = None,
    progress: Progress | None = None,
) -> Any:
    """Generate a VDI: cut every pixel's ray through a classified volume into supersegments.

    Parameters
    ----------
    client : distributed.Client or str, optional
        Of a Dask cluster, or the address of its scheduler. Its workers make the VDI of a chunked
        volume (a :class:`Volume` of a Dask, zarr or h5py array, or of :func:`read_volume`), whose
        files all of them must find. Without it such a volume is made block by block on the local
        device. See docs/large_volumes.md.

    Returns
    -------
    VDI or DeferredVDI
        The supersegments of every list, with the view and what made them.

    Warns
    -----
    VDIWarning
        If a target cannot be reached (the nearest is made), or the camera sees no volume.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> from pyvista_vdi.model.standard_cases import filling_camera
    >>> volume = pvdi.examples.load_brain(as_volume=True)
    >>> camera = filling_camera(volume.bounds, (640, 360))
    >>> vdi = pvdi.generate(volume, camera, (640, 360), cmap="bone")  # doctest: +SKIP
    """
    read = as_volume(volume, look.scalars, look.preference)
    keeps = deferral.deferred
    if keeps:
        look.require_no_look()
        target.refuse_deferred()
    from pyvista_vdi.generation.deferred import generate_deferred, unclassified

    table = unclassified(look.interpolation) if keeps else look.transfer_function_of(read)
    view: Any = camera
    size: Any = window_size  # which the request checks, as the view
    about = {"classification": look.describe(), "scalars": read.name}
    request = GenerationRequest(read, table, view, size, options, device, progress, about)
    from pyvista_vdi.quality.targets import generate_anywhere, warn_missed

    make = partial(generate_anywhere, target=target, client=client)
    vdi: Any = generate_deferred(request, deferral, make) if keeps else make(request)
    warn_missed(vdi)
    if not vdi.n_supersegments and nearest_depth(read, request.camera, request.window_size) is None:
        warn_external(f"the VDI is empty: the camera sees nothing of the bounds {read.bounds}")
    return vdi


def read(path: str | os.PathLike[str], **options: Any) -> VDI | DeferredVDI | VDICollection:
    """Read a VDI from a file that :meth:`VDI.save` wrote, or any deep OpenEXR image.

    Or a series or a set of them.

    Parameters
    ----------
    path : path-like
        A ``.vdi`` file, an OpenEXR deep image, whose name ends in ``.exr``, or a page with a VDI in
        it, ``.html``. Or the series in a ``.vdis`` file, or the set in a ``.vdiset`` file, whose
        VDIs are read when they are asked for.
    **options
        For ``.exr`` files of other programs: ``camera``, the view that the image shows, where
        the file does not say it; ``thickness``, world units, given to samples that have none
        (surfaces). For all files ``progress``, called with the finished fraction, 0 to 1.

    Returns
    -------
    VDI or DeferredVDI or VDISeries or VDISet
        The same to the last bit if this package wrote the file, of ``.exr`` within float32's
        rounding (docs/files.md).

    Raises
    ------
    VDIFileError
        If the file is absent, foreign, of a newer version, truncated or damaged; the message
        says which.
    InvalidArgumentError
        If an option is not one of the file's format.

    Warns
    -----
    VDIWarning
        If an ``.exr`` file of ours was changed by another program, or has colours outside 0 to 1.
    """
    from pyvista_vdi.io import read as read_file

    return read_file(path, **options)


def classified(stored: DeferredVDI | VDICollection, look: Mapping[str, Any]) -> Any:
    """Return what the method ``classified`` of a VDI that keeps values, or of several, does."""
    ends, device = stored.value_range, look.get("device")
    if ends is None:
        raise InvalidVDIError(
            "these VDIs have colours already: a look is for those that keep values, which "
            "classification='deferred' makes"
        )
    refuse_unknown(look, "classified", (*Classification.declared, "device"))
    asked = Classification(**{name: value for name, value in look.items() if name != "device"})
    if said := asked.given.keys() & {"scalars", "preference", "interpolation"}:
        raise InvalidArgumentError(
            f"{', '.join(sorted(said))} was said where the values were kept: give it to "
            "pyvista_vdi.generate, and leave it out here"
        )
    # The range of the values stands for those of the volume
    values: Any = SimpleNamespace(array=np.array(ends), rgba=False, finite_range=lambda: ends)
    table = asked.transfer_function_of(values)
    made = partial(classify_on_device, transfer_function=table, device=device)  # is pickled
    return stored._mapped(made) if isinstance(stored, VDICollection) else made(stored)
