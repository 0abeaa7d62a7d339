"""What a client of a server may say: its messages, checked before anything is done about them.

docs/web.md, "Served", has the protocol. Whatever is not in it raises :class:`BadMessageError`, and
ends the connection that it came by.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from typing import Any

from pyvista_vdi.errors import InvalidCameraError
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
class Look:
    """What a client may change of the classification; ``None``: as the server was started."""

    cmap: str | None = None
    opacity: str | tuple[float, ...] | None = None
    clim: tuple[float, float] | None = None


@dataclass(frozen=True)
class Wish:
    """What a client wants to see: the last that it has said of everything."""

    view: View | None = None  # its camera, and the size of its picture; ``None`` before it has said
    look: Look = Look()  # the transfer function
    step: int = 0  # of the time steps


@dataclass(frozen=True)
class Offer:
    """What clients may choose from."""

    steps: int = 1  # how many time steps there are
    cmaps: tuple[str, ...] = ()  # names of colour maps; empty where the look is fixed
    opacities: tuple[str, ...] = ()  # likewise, of opacity mappings


def wish_after(text: str, wish: Wish, offer: Offer) -> Wish:
    """Return what a client wants after a message of its."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadMessageError(f"the message is no JSON: {error}") from None
    kind = message.pop("type", None) if isinstance(message, dict) else None
    if kind == "view":
        _only(message, {"camera", "size"})
        return replace(wish, view=_view(message))
    if kind == "look":
        _only(message, set(), {"cmap", "opacity", "clim"})
        return replace(wish, look=_look(message, offer))
    if kind == "time":
        _only(message, {"step"})
        return replace(wish, step=_whole("step", message["step"], 0, offer.steps - 1))
    raise BadMessageError(f"a message is an object of type view, look or time; got {kind!r:.40}")


def _view(message: dict[str, Any]) -> View:
    state, size = message["camera"], message["size"]
    if not isinstance(size, list) or len(size) != 2:
        raise BadMessageError("size must be a list of 2 numbers")
    width, height = (_whole("size", edge, 1, MAX_PICTURE_EDGE) for edge in size)
    if not isinstance(state, dict):
        raise BadMessageError("camera must be an object")
    _only(state, {"position", "focal_point", "view_up"}, {"view_angle", "parallel_scale"})
    lenses = ("view_angle", "parallel_scale")
    values: dict[str, Any] = {
        name: _number(name, value, 1 / _LARGEST) if name in lenses else _vector(name, value, 3)
        for name, value in state.items()
    }
    try:
        camera = Camera(**values, parallel_projection="parallel_scale" in values)
    except InvalidCameraError as error:
        raise BadMessageError(str(error)) from None
    return View(camera, (width, height))


def _look(message: dict[str, Any], offer: Offer) -> Look:
    if not offer.cmaps:
        raise BadMessageError("the look is fixed")
    cmap, opacity, clim = (message.get(name) for name in ("cmap", "opacity", "clim"))
    if cmap is not None and cmap not in offer.cmaps:
        raise BadMessageError("cmap must be one of the names that hello lists")
    if isinstance(opacity, list) and 2 <= len(opacity) <= MAX_OPACITIES:
        opacity = tuple(_number("opacity", value, 0, 1) for value in opacity)
    elif opacity is not None and opacity not in offer.opacities:
        raise BadMessageError(
            f"opacity must be one of the names that hello lists, or 2 to {MAX_OPACITIES} numbers"
        )
    if clim is not None:
        clim = _vector("clim", clim, 2)
        if not clim[0] < clim[1]:
            raise BadMessageError("clim must be two numbers, the smaller first")
    return Look(cmap, opacity, clim)


def _only(
    message: Mapping[str, Any], needed: AbstractSet[str], more: AbstractSet[str] = frozenset()
) -> None:
    if not needed <= set(message) <= needed | more:
        raise BadMessageError(
            f"a message has {sorted(message)!r:.80} in place of {sorted(needed | more)}"
        )


def _vector(name: str, values: Any, length: int) -> Any:
    if not isinstance(values, list) or len(values) != length:
        raise BadMessageError(f"{name} must be a list of {length} numbers")
    return tuple(_number(name, value) for value in values)


def _number(name: str, value: Any, low: float = -_LARGEST, high: float = _LARGEST) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadMessageError(f"{name} must be numbers")
    if not low <= value <= high:  # nor NaN
        raise BadMessageError(f"{name} must be from {low:g} to {high:g}")
    return float(value)


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise BadMessageError(f"{name} must be a whole number from {low} to {high}")
    return value
