"""What a client of a server may say, checked before anything is done about it.

docs/web.md, "Served", has the protocol. Whatever is not in it raises :class:`BadMessageError`, and
ends the connection that it came by.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.view import View

#: Most bytes of a client's message.
MAX_MESSAGE = 16 * 1024
#: Longest edge of a client's picture, pixels.
MAX_PICTURE_EDGE = 8192
#: Most opacities of a mapping that is given by numbers.
MAX_OPACITIES = 64
#: Numbers are no larger than this, and lenses no smaller than its inverse: forms of rays are
#: products of a few of them.
_LARGEST = 1e12


class BadMessageError(ValueError):
    """A message that is none of the protocol's."""


@dataclass(frozen=True)
class Wish:
    """What a client wants to see: the last that it has said of everything."""

    view: View | None = None  # its camera, and the size of its picture; ``None`` before it has said
    look: tuple[tuple[str, Any], ...] = ()  # what it has changed of the transfer function
    step: int = 0  # of the time steps


def wish_after(text: str, wish: Wish, offer: Mapping[str, Any]) -> Wish:
    """Return what a client wants after a message; ``offer``: what hello lists."""
    try:
        message = json.loads(text)
        kind = message.pop("type")
        if kind == "view":
            return replace(wish, view=_view(**message))
        if kind == "look":
            return replace(wish, look=_look(offer, **message))
        if kind == "time":
            return replace(wish, step=_step(offer, **message))
        raise BadMessageError(f"a message is of type view, look or time; got {kind!r:.40}")
    except BadMessageError:
        raise
    # No JSON, no object, not the entries of its type, or no camera
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError, VDIError) as error:
        raise BadMessageError(f"the message is none of the protocol's: {error}") from None


def _view(camera: Any, size: Any) -> View:
    width, height = _numbers("size", size, (2,), 1, MAX_PICTURE_EDGE)
    if (width % 1, height % 1) != (0, 0):
        raise BadMessageError("size must be whole numbers")
    view = _camera(**camera)
    lens = view.parallel_scale if view.parallel_projection else view.view_angle
    if not 1 / _LARGEST <= lens <= _LARGEST:
        raise BadMessageError(f"lenses must be from {1 / _LARGEST:g} to {_LARGEST:g}")
    return View(view, (int(width), int(height)))


def _camera(position: Any, focal_point: Any, view_up: Any, **lens: Any) -> Camera:
    for name, point in (("position", position), ("focal_point", focal_point), ("view_up", view_up)):
        _numbers(name, point, (3,))
    if not set(lens) <= {"view_angle", "parallel_scale"}:
        raise BadMessageError("lenses are view_angle and parallel_scale")
    return Camera(
        position, focal_point, view_up, **lens, parallel_projection="parallel_scale" in lens
    )


def _look(
    offer: Mapping[str, Any], cmap: Any = None, opacity: Any = None, clim: Any = None
) -> tuple[tuple[str, Any], ...]:
    if not offer["cmaps"]:
        raise BadMessageError("the look is fixed")
    if cmap is not None and cmap not in offer["cmaps"]:
        raise BadMessageError("cmap must be one of the names that hello lists")
    if isinstance(opacity, list):
        opacity = _numbers("opacity", opacity, range(2, MAX_OPACITIES + 1), 0, 1)
    elif opacity is not None and opacity not in offer["opacities"]:
        raise BadMessageError("opacity must be numbers, or one of the names that hello lists")
    if clim is not None:
        clim = _numbers("clim", clim, (2,))
        if not clim[0] < clim[1]:
            raise BadMessageError("clim must be two numbers, the smaller first")
    said = {"cmap": cmap, "opacity": opacity, "clim": clim}
    return tuple((name, value) for name, value in said.items() if value is not None)


def _step(offer: Mapping[str, Any], step: Any) -> int:
    if type(step) is not int or not 0 <= step < offer["steps"]:
        raise BadMessageError(f"step must be a whole number from 0 to {offer['steps'] - 1}")
    return step


def _numbers(
    name: str, values: Any, lengths: Any, low: float = -_LARGEST, high: float = _LARGEST
) -> tuple[float, ...]:
    # Neither booleans nor NaN
    if not isinstance(values, list) or len(values) not in lengths:
        raise BadMessageError(f"{name} must be a list of {lengths[0]} to {lengths[-1]} numbers")
    if not all(type(value) in (int, float) and low <= value <= high for value in values):
        raise BadMessageError(f"{name} must be numbers from {low:g} to {high:g}")
    return tuple(map(float, values))
