"""What a user calls a volume or a VDI, VTK's objects and PyVista's among it, as ours."""

import os
import reprlib
import weakref
from typing import Any

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVDIError, InvalidVolumeError, InvalidVolumeTypeError
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.volume import Volume

#: What was made of each VTK image last, by the image's id, until the image's end: what it was made
#: of, which changes with the image, and the volume.
_kept: dict[int, tuple[tuple[Any, ...], Volume]] = {}


def as_volume(volume: Any, scalars: Any = None, preference: str = "point") -> Volume:
    """Return what a user calls a volume as a :class:`Volume`; VTK is imported for its own only.

    ``scalars`` are the name of the array, the active one by default, or values per point;
    ``preference`` says which array is meant where points and cells have one of that name.
    """
    if isinstance(volume, str | os.PathLike):
        array = scalars if isinstance(scalars, str) else None
        volume = registry.method("Volume.read")(volume, array=array)
        scalars = None if array is not None else scalars
    if isinstance(volume, Volume):
        if scalars is not None and not (isinstance(scalars, str) and scalars == volume.name):
            raise InvalidVolumeError(
                f"the volume has no array {reprlib.repr(scalars)}: its only one is "
                f"{volume.name!r}; of other values make another, pyvista_vdi.Volume(array, "
                "spacing, origin)"
            )
        return volume
    if hasattr(volume, "GetClassName"):
        if scalars is not None and not isinstance(scalars, str):
            volume, scalars = registry.method("Volume.with_scalars")(volume, scalars, None)
        # What was made of the image last is the same until the image is told to be modified
        matrix = getattr(volume, "GetDirectionMatrix", None)
        made_of = (scalars, preference, volume.GetMTime(), matrix and matrix().GetMTime())
        kept = _kept.get(id(volume))
        if kept is not None and kept[0] == made_of:
            return kept[1]
        made = Volume.from_vtk(volume, scalars, preference)
        if kept is None:
            weakref.finalize(volume, _kept.pop, id(volume), None).atexit = False
        _kept[id(volume)] = made_of, made
        return made
    if isinstance(volume, np.ndarray):
        raise InvalidVolumeError(
            f"got a NumPy array of shape {volume.shape}, which has no spacing: "
            "wrap it as pyvista_vdi.Volume(array, spacing), indexed [z, y, x]"
        )
    raise InvalidVolumeTypeError(
        "expected a pyvista.ImageData, a vtkImageData, a pyvista_vdi.Volume or a file's path; "
        f"got {type(volume).__name__}"
    )


def as_vdi(vdi: Any) -> VDI:
    """Return a VDI, or its VTK form, as a :class:`VDI`; InvalidVDIError if it is neither."""
    if isinstance(vdi, VDI):
        return vdi
    if isinstance(vdi, DeferredVDI):
        raise InvalidVDIError(
            "a DeferredVDI has no colours yet: pass vdi.classified(cmap=..., opacity=...)"
        )
    if hasattr(vdi, "GetClassName"):
        return as_vdi(registry.method("VDI.from_image")(vdi))
    got = type(vdi).__name__
    if isinstance(vdi, str | os.PathLike):
        got = f"the path {os.fspath(vdi)!r}: read it by pyvista_vdi.read(path)"
    raise InvalidVDIError(f"expected a VDI or its VTK form (a vtkImageData); got {got}")
