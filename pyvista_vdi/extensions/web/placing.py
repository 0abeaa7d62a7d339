"""VDIs as viewers are sent them, and a plotter's as one that knows of no actors can show it."""

from __future__ import annotations

import copy
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io.vdi_file.writer import write_to
from pyvista_vdi.model.vdi import VDI

#: Largest departure of a rotation from one, by rounding of its matrix.
_RIGID = 1e-9


def look_of(actor: Any) -> tuple[Any, ...]:
    """Return what :func:`as_shown` depends on; another value asks for another VDI."""
    return actor.vdi, actor.opacity_multiplier, array_of(actor.GetMatrix()).tobytes()


def as_shown(actor: Any) -> VDI:
    """Return an actor's VDI, thinned or thickened by its multiplier, and where the actor is.

    A VDI moves with its generating view. So it can be where the actor has been moved and turned
    to, but not where it has been stretched: that takes a scene.
    """
    vdi, multiplier = actor.vdi, actor.opacity_multiplier
    motion = _motion(actor)
    camera = vdi.camera
    if motion is not None and not np.array_equal(motion, np.eye(4)):
        position, focal_point = (
            (motion @ (*point, 1))[:3] for point in (camera.position, camera.focal_point)
        )
        camera = camera.replace(
            position=position,
            focal_point=focal_point,
            view_up=motion[:3, :3] @ camera.view_up,
            model_transform=array_of(actor.GetMatrix()),
        )
    return thinned(vdi, multiplier, camera)


def thinned(vdi: VDI, multiplier: float, camera: Any = None) -> VDI:
    """Return a VDI with its optical depths multiplied, seen from another camera if one is given."""
    camera = vdi.camera if camera is None else camera
    if camera is vdi.camera and multiplier == 1:
        return vdi
    return VDI(
        camera,
        vdi.window_size,
        vdi.offsets,
        vdi.front,
        vdi.back,
        vdi.color,
        vdi.optical_depth * np.float32(multiplier),
        vdi.bounds,
        depth_origin=vdi.depth_origin,
        metadata=vdi.metadata,
    )


def planes_of(actor: Any) -> list[list[float]]:
    """Return the clipping planes of an actor's mapper, origin and normal of each, world."""
    planes = actor.GetMapper().GetClippingPlanes()
    items = [planes.GetItem(i) for i in range(0 if planes is None else planes.GetNumberOfItems())]
    return [[*plane.GetOrigin(), *plane.GetNormal()] for plane in items]


def _motion(actor: Any) -> Any:
    """Return the motion of an actor since its VDI was made, (4, 4); ``None`` if it is none."""
    motion = array_of(actor.GetMatrix()) @ np.linalg.inv(actor.vdi.camera.model_transform)
    turn = motion[:3, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0:
        return None
    return motion


def array_of(matrix: Any) -> NDArray[np.float64]:
    """Return a ``vtkMatrix4x4``, or the identity for ``None``."""
    if matrix is None:
        return np.eye(4)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


#: Of deflate: files are a hundredth longer than by 6, its default, in half the time.
EFFORT = 4


def bare(vdi: VDI) -> VDI:
    """Return a VDI in the 8-byte form without metadata, of which a page need know nothing.

    A table of 4096 colours would be longer than a small VDI.
    """
    bare = copy.copy(vdi.with_precision("8-byte"))
    bare.metadata = {}
    return bare


def encoded(vdi: VDI, *, coarse: bool = False) -> bytes:
    """Return the file of a bare VDI, deflated, with or without its coarse level."""
    stream = io.BytesIO()
    write_to(stream, bare(vdi), "deflate", EFFORT, coarse=coarse)
    return stream.getvalue()


def several_of(actor: Any) -> VDISeries | VDISet | None:
    """Return the series or the set that an actor shows, as it shows it; ``None`` of one VDI."""
    shown, multiplier = (actor.series or actor.vdi_set), actor.opacity_multiplier
    if shown is not None and shown.value_range is not None:  # pages show colours
        shown = shown.classified(volume_property=actor.GetProperty())
    if shown is None or multiplier == 1:
        return shown
    return shown._mapped(lambda vdi: thinned(vdi, multiplier))
