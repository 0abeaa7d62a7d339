"""What is asked of the frames of a VDI in a renderer: their rate, and what is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.options import Options, option, record

#: When a view gets a VDI of its own; a function gets the actor's status.
Policy: TypeAlias = Literal["auto", "never"] | Callable[[Any], object]


def checked_rate(name: str, value: Any) -> float:
    """Return a rate in frames per second; 0 or above, finite."""
    rate = as_float(value)
    if isinstance(value, bool) or not 0 <= rate < math.inf:
        raise InvalidArgumentError(
            f"{name} must be a number of frames per second, 0 or above; got {value!r}"
        )
    return rate


def checked_policy(policy: Any) -> Policy:
    """Return ``"auto"``, ``"never"`` or a callable; refuse anything else."""
    if policy in ("auto", "never") or callable(policy):
        return policy  # type: ignore[no-any-return]
    raise InvalidArgumentError(
        "regenerate must be 'auto', 'never' or a callable that takes a VDIStatus and says whether "
        f"to regenerate; got {policy!r}"
    )


def checked_bound(ssim: Any) -> float:
    """Return an SSIM between 0 and 1."""
    bound = as_float(ssim)
    if isinstance(ssim, bool) or not 0 <= bound <= 1:
        raise InvalidArgumentError(
            f"regenerate_below must be an SSIM between 0 and 1; got {ssim!r}"
        )
    return bound


def checked_draw(draw: Any) -> Literal["auto", "vdi", "volume"]:
    """Return what is drawn, ``"auto"``, ``"vdi"`` or ``"volume"``; refuse anything else."""
    if draw in ("auto", "vdi", "volume"):
        return draw  # type: ignore[no-any-return]
    raise InvalidArgumentError(f"draw must be 'auto', 'vdi' or 'volume'; got {draw!r}")


@record
@dataclass(frozen=True)
class DrawingOptions(Options):
    """How frames are drawn, with the names and defaults of :meth:`AddVDI.__call__`."""

    target_fps: float | None = option(
        30.0,
        "frames per second to be kept while the view moves",
        lambda rate: None if rate is None else checked_rate("target_fps", rate),
    )
    adjust_multi_samples: bool = option(
        True, "go without multisampling while the view moves and frames would be late"
    )
    regenerate: Policy = option("auto", "when a view gets a VDI of its own", checked_policy)
    regenerate_below: float | None = option(
        None,
        "estimated SSIM, 0 to 1, below which a VDI does not do for a view",
        lambda ssim: None if ssim is None else checked_bound(ssim),
    )
    draw: Literal["auto", "vdi", "volume"] = option(
        "auto", "what is raycast where the volume is at hand", checked_draw
    )
