"""What a client of a server may say: its messages, checked before anything is done about them.

docs/web.md, "Served", has the protocol. Whatever is not in it raises :class:`BadMessageError`, and
ends the connection that it came by.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.view import View

#: Most bytes of a client's message.
MAX_MESSAGE = 16 * 1024
#: Longest edge of a client's picture, pixels.
MAX_PICTURE_EDGE = 8192
#: Most clipping planes, as many as VTK's mappers take.
MAX_PLANES = 6
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
    moving: bool = False  # whether the view is about to change
    look: Look = Look()  # the transfer function
    step: int = 0  # of the time steps
    #: Clipping planes: origin and normal of each, world coordinates
    planes: tuple[tuple[float, ...], ...] = ()
    #: How many messages the client had said by then. Equal wishes may differ in it
    said: int = field(default=0, compare=False)

    @property
    def content(self) -> tuple[Look, int]:
        """What a VDI is made of; a change of it needs another VDI, whatever the view."""
        return self.look, self.step


@dataclass(frozen=True)
class Offer:
    """What clients may choose from."""

    steps: int = 1  # how many time steps there are
    #: Names of colour maps and of opacity mappings; empty where the look is fixed
    cmaps: tuple[str, ...] = ()
    #: Names of colour maps and of opacity mappings; empty where the look is fixed
    opacities: tuple[str, ...] = ()


def wish_after(text: str, wish: Wish, offer: Offer) -> Wish:
    """Return what a client wants after a message of its."""
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise BadMessageError(f"the message is no JSON: {error}") from None
    if not isinstance(message, dict):
        raise BadMessageError("a message is an object")
    kind = message.pop("type", None)
    read = _READERS.get(kind) if isinstance(kind, str) else None
    if read is None:
        raise BadMessageError(f"type must be one of {', '.join(_READERS)}; got {kind!r:.40}")
    return replace(read(message, wish, offer), said=wish.said + 1)


def _view(message: dict[str, Any], wish: Wish, offer: Offer) -> Wish:
    _only(message, {"camera", "size"}, {"moving"})
    state, moving = message["camera"], message.get("moving", False)
    if not isinstance(moving, bool):
        raise BadMessageError("moving must be true or false")
    size = tuple(_whole("size", edge, 1, MAX_PICTURE_EDGE) for edge in _items("size", message, 2))
    if not isinstance(state, dict):
        raise BadMessageError("camera must be an object")
    _only(state, {"position", "focal_point", "view_up"}, {"view_angle", "parallel_scale"})
    vectors = {n: _vector(n, state, 3) for n in ("position", "focal_point", "view_up")}
    lens: dict[str, Any] = {
        n: _number(n, state[n], 1 / _LARGEST)
        for n in ("view_angle", "parallel_scale")
        if n in state
    }
    try:
        camera = Camera(**vectors, **lens, parallel_projection="parallel_scale" in lens)
    except InvalidCameraError as error:
        raise BadMessageError(str(error)) from None
    return replace(wish, view=View(camera, (size[0], size[1])), moving=moving)


def _look(message: dict[str, Any], wish: Wish, offer: Offer) -> Wish:
    _only(message, set(), {"cmap", "opacity", "clim"})
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
        clim = _vector("clim", message, 2)
        if not clim[0] < clim[1]:
            raise BadMessageError("clim must be two numbers, the smaller first")
    return replace(wish, look=Look(cmap, opacity, clim))


def _clip(message: dict[str, Any], wish: Wish, offer: Offer) -> Wish:
    _only(message, {"planes"})
    given = message["planes"]
    if not isinstance(given, list) or len(given) > MAX_PLANES:
        raise BadMessageError(f"planes must be a list of at most {MAX_PLANES}")
    planes = tuple(_vector("planes", {"planes": plane}, 6) for plane in given)
    if any(np.linalg.norm(plane[3:]) < 1 / _LARGEST for plane in planes):
        raise BadMessageError("a plane's normal is not zero")
    return replace(wish, planes=planes)


def _time(message: dict[str, Any], wish: Wish, offer: Offer) -> Wish:
    _only(message, {"step"})
    return replace(wish, step=_whole("step", message["step"], 0, offer.steps - 1))


_READERS = {"view": _view, "look": _look, "clip": _clip, "time": _time}


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no number")


def _only(message: Mapping[str, Any], needed: set[str], more: set[str] | None = None) -> None:
    names = set(message)
    if not needed <= names or names - needed - (more or set()):
        raise BadMessageError(
            f"a message has {sorted(names)!r:.80} in place of {sorted(needed | (more or set()))}"
        )


def _items(name: str, message: Mapping[str, Any], length: int) -> Sequence[Any]:
    values = message[name]
    if not isinstance(values, list) or len(values) != length:
        raise BadMessageError(f"{name} must be a list of {length} numbers")
    return values


def _vector(name: str, message: Mapping[str, Any], length: int) -> Any:
    return tuple(_number(name, value) for value in _items(name, message, length))


def _number(name: str, value: Any, low: float = -_LARGEST, high: float = _LARGEST) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadMessageError(f"{name} must be numbers")
    if not low <= value <= high or not math.isfinite(value):
        raise BadMessageError(f"{name} must be from {low:g} to {high:g}")
    return float(value)


def _whole(name: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise BadMessageError(f"{name} must be a whole number from {low} to {high}")
    return value
