"""What a user sets of a mapper: one record, and VTK's Set and Get of each of its fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pyvista_vdi.model.checks import Number, as_flag
from pyvista_vdi.model.options import (
    TRANSMITTANCE_CUTOFF,
    DrawingOptions,
    Option,
    RenderOptions,
    declared,
)
from pyvista_vdi.model.types import Draw, Policy


@dataclass(frozen=True)
class MapperSettings:
    """What a user sets of a mapper: see :data:`SETTINGS`."""

    draw: Draw = "auto"
    regenerate: Policy = "auto"
    regenerate_below: float | None = None
    opacity_multiplier: float = 1.0
    transmittance_cutoff: float = TRANSMITTANCE_CUTOFF
    target_fps: float | None = None  # the window's desired update rate
    image_distance: float = 1.0
    adjust: bool = True
    off_screen: bool = False

    @property
    def previews(self) -> bool:
        """Whether a frame of a motion may have fewer rays."""
        return self.adjust and self.target_fps != 0


_DECLARED = declared(RenderOptions, DrawingOptions)

#: The settings, by VTK's names.
SETTINGS: Mapping[str, Option] = {
    "Draw": _DECLARED["draw"],
    "Regenerate": _DECLARED["regenerate"],
    "RegenerateBelow": _DECLARED["regenerate_below"],
    "OpacityMultiplier": _DECLARED["opacity_multiplier"],
    "TransmittanceCutoff": _DECLARED["transmittance_cutoff"],
    "TargetFrameRate": _DECLARED["target_fps"],
    "ImageSampleDistance": Option(
        "image_distance",
        1.0,
        "for how many pixels along each edge a ray is cast, 1 to 100",
        "The picture is interpolated linearly, as by VTK's mappers.",
        check=Number("a number from 1 to 100", 1, 100, name="the image sample distance"),
    ),
    "AutoAdjustSampleDistances": Option(
        "adjust",
        True,
        "whether previews of fewer pixels are drawn while the view moves",
        "That is where the window's desired update rate is at least 1 per second. Frames at rest, "
        "screenshots, exports and off-screen windows are always full.",
        check=partial(as_flag, name="AutoAdjustSampleDistances"),
    ),
    "InteractiveOffScreen": Option(
        "off_screen",
        False,
        "whether off-screen windows are treated as if somebody watched them",
        check=partial(as_flag, name="InteractiveOffScreen"),
    ),
}


def add_settings(of: type) -> None:
    """Add to a class of mappers VTK's Set and Get of each setting."""
    for name, told in SETTINGS.items():
        for verb, method in zip(("Set", "Get"), _pair(told), strict=True):
            method.__name__ = f"{verb}{name}"
            method.__qualname__ = f"{of.__name__}.{method.__name__}"
            setattr(of, method.__name__, method)


def _pair(told: Option) -> tuple[Callable[..., None], Callable[..., Any]]:
    def setter(self: Any, value: Any) -> None:
        value, driver = told.check(value) if told.check else value, self.driver
        if driver is not None and getattr(driver.settings, told.name) != value:
            driver.settings = replace(driver.settings, **{told.name: value})
            self.Modified()

    def getter(self: Any) -> Any:
        return getattr(self.driver.settings, told.name)

    setter.__doc__ = f"Set {told.what}.\n\n{told.more}".rstrip()
    getter.__doc__ = f"Return {told.what}."
    return setter, getter
