"""What a client of a server may say, checked before anything is done about it.

docs/web.md, "Served", has the protocol. Whatever is not in it raises :class:`BadMessageError`, and
ends the connection that it came by.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

from pyvista_vdi.errors import VDIError
from pyvista_vdi.extensions.web.camera import camera_of
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
        match json.loads(text):
            case {"type": "view", "camera": {**state}, "size": [_, _] as size, **rest} if not rest:
                camera = camera_of(state)
                lens = camera.parallel_scale if camera.parallel_projection else camera.view_angle
                places = (camera.position, camera.focal_point, camera.view_up, camera.window_center)
                _numbers("a camera", [*chain(*places), lens, 1 / lens])
                width, height = _numbers("size", size, 1, MAX_PICTURE_EDGE, whole=True)
                return replace(wish, view=View(camera, (width, height)))
            case {"type": "look", **look}:
                return replace(wish, look=_look(offer, **look))
            case {"type": "time", "step": step, **rest} if not rest:
                (step,) = _numbers("step", [step], 0, offer["steps"] - 1, whole=True)
                return replace(wish, step=step)
        raise BadMessageError(f"a view, a look or a time with its entries is one; got {text:.40}")
    # No JSON, not the entries of its type, or no camera
    except (KeyError, TypeError, ValueError, RecursionError, VDIError) as error:
        raise BadMessageError(f"the message is none of the protocol's: {error}") from None


def _look(
    offer: Mapping[str, Any], cmap: Any = None, opacity: Any = None, clim: Any = None
) -> tuple[tuple[str, Any], ...]:
    if not offer["cmaps"]:
        raise BadMessageError("the look is fixed")
    if isinstance(opacity, list) and 2 <= len(opacity) <= MAX_OPACITIES:
        opacity = _numbers("opacity", opacity, 0, 1)
    elif opacity not in (None, *offer["opacities"]):
        raise BadMessageError(
            f"opacity is a name that hello lists, or 2 to {MAX_OPACITIES} numbers"
        )
    if cmap not in (None, *offer["cmaps"]):
        raise BadMessageError("cmap is a name that hello lists")
    if clim is not None:
        low, high = clim = _numbers("clim", clim)
        if not low < high:
            raise BadMessageError("clim must be two numbers, the smaller first")
    said = {"cmap": cmap, "opacity": opacity, "clim": clim}
    return tuple((name, value) for name, value in said.items() if value is not None)


def _numbers(
    name: str, values: Any, low: float = -_LARGEST, high: float = _LARGEST, *, whole: bool = False
) -> tuple[Any, ...]:
    kinds = (int,) if whole else (int, float)  # neither booleans nor NaN
    if not all(type(value) in kinds and low <= value <= high for value in values):
        raise BadMessageError(f"{name} has numbers from {low:g} to {high:g}")
    return tuple(values) if whole else tuple(map(float, values))
