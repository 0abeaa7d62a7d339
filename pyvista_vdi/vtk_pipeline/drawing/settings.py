"""What a user sets of a mapper: one record, and VTK's Set and Get of each of its fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields
from typing import Any, TypeVar

from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.options import declared
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF, DrawingOptions, RenderOptions
from pyvista_vdi.model.types import Draw, Policy
from pyvista_vdi.raycasting.picking import checked_opacity

_Class = TypeVar("_Class", bound=type)

_DECLARED: Any = declared(RenderOptions, DrawingOptions)


def _setting(
    default: Any, name: str, what: str, more: str, check: Callable[[Any], Any] = bool
) -> Any:
    """Return a field: what it is called by VTK, what it is, and what it is checked by."""
    told = {"name": name, "what": what, "more": more, "check": check}
    return field(default=default, metadata=told)


@dataclass(frozen=True)
class MapperSettings:
    """What a user sets of a mapper."""

    draw: Draw = _setting(
        "auto",
        "Draw",
        'what is raycast where the volume is at hand: ``"auto"``, ``"vdi"`` or ``"volume"``',
        'By ``"auto"``, in windows that somebody watches, each frame is drawn by what is expected '
        "to give the better picture within the frame rate, and at rest by what is there sooner; "
        "elsewhere by the volume, or by a VDI that nearly the same view has already earned, never "
        "by time. Volumes that overlap in the picture are drawn by VDIs.",
        _DECLARED["draw"].check,
    )
    regenerate: Policy = _setting(
        "auto",
        "Regenerate",
        'what decides that a view needs a VDI of its own: ``"auto"`` or ``"never"``',
        'By ``"auto"`` an estimate of the view\'s error does, where somebody watches; by '
        '``"never"`` only ``actor.regenerate()``.',
        _DECLARED["regenerate"].check,
    )
    regenerate_below: float | None = _setting(
        None,
        "RegenerateBelow",
        "the estimated SSIM below which a VDI does not do for a view",
        "``None`` is 0.95 where another VDI is made for it, and 0.98 with the detail of the "
        "picture's pixels where the volume is drawn in its place.",
        _DECLARED["regenerate_below"].check,
    )
    opacity_multiplier: float = _setting(
        1.0,
        "OpacityMultiplier",
        "the factor of the extinction of everything that is drawn",
        "It acts on the next frame, without another VDI: 2 is twice as dense, 0 transparent.",
        _DECLARED["opacity_multiplier"].check,
    )
    transmittance_cutoff: float = _setting(
        TRANSMITTANCE_CUTOFF,
        "TransmittanceCutoff",
        "the light below which rays end, 0 to below 1",
        "No channel loses more than that. VTK's own volume mappers stop at about 1/255. VDIs that "
        "overlap are merged to the default.",
        _DECLARED["transmittance_cutoff"].check,
    )
    image_distance: float = _setting(
        1.0,
        "ImageSampleDistance",
        "for how many pixels along each edge a ray is cast, 1 to 100",
        "The picture is interpolated linearly, as by VTK's mappers.",
        Number("a number from 1 to 100", 1, 100, name="the image sample distance"),
    )
    picking_opacity: float = _setting(
        0.05,
        "PickingOpacity",
        "the opacity that a ray must reach in the VDI to pick it, 0 to below 1",
        "It is that from the ray's beginning on.",
        checked_opacity,
    )
    adjust: bool = _setting(
        True,
        "AutoAdjustSampleDistances",
        "whether previews of fewer pixels are drawn while the view moves",
        "That is where the window's desired update rate is at least 1 per second. Frames at rest, "
        "screenshots, exports and off-screen windows are always full.",
    )
    adjust_multi_samples: bool = _setting(
        True,
        "AutoAdjustMultiSamples",
        "whether previews go without multisampling where that makes them late",
        "All VDIs in a window must allow it; ``GetMultiSamples()`` stays as it was set.",
    )
    target: float | None = _setting(
        None,
        "TargetFrameRate",
        "the frames per second that previews keep",
        "``None`` means the window's desired update rate, 0 that every frame is full. Several VDIs "
        "in a window keep the highest of their targets.",
        _DECLARED["target_fps"].check,
    )
    off_screen: bool = _setting(
        False,
        "InteractiveOffScreen",
        "whether off-screen windows are treated as if somebody watched them",
        "",
    )

    @property
    def previews(self) -> bool:
        """Whether a frame of a motion may have fewer rays."""
        return self.adjust and self.target != 0


def with_settings(cls: _Class) -> _Class:
    """Add to a class of mappers VTK's Set and Get of each setting."""
    for each in fields(MapperSettings):
        for verb, method in zip(("Set", "Get"), _pair(each), strict=True):
            method.__name__ = f"{verb}{each.metadata['name']}"
            method.__qualname__ = f"{cls.__name__}.{method.__name__}"
            setattr(cls, method.__name__, method)
    return cls


def _pair(of: Field[Any]) -> tuple[Callable[..., None], Callable[..., Any]]:
    told = of.metadata

    def setter(self: Any, value: Any) -> None:
        # PyVista's constructor sets some before there is a driver
        if self._driver is not None and self._driver.set(**{of.name: told["check"](value)}):
            self.Modified()

    def getter(self: Any) -> Any:
        return getattr(self.driver.settings, of.name)

    what, more = told["what"], told["more"]
    setter.__doc__ = f"Set {what}; {of.default!r} by default.\n\n{more}".rstrip()
    getter.__doc__ = f"Return {what}."
    return setter, getter
