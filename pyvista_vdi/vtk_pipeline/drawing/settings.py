"""What a user sets of a mapper, with VTK's Set and Get, and what a VDI has no place for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.checks import Number, as_flag
from pyvista_vdi.model.options import DrawingOptions, Option, RenderOptions
from pyvista_vdi.model.types import Draw, Policy


@dataclass(frozen=True)
class MapperSettings:
    """What a user sets of a mapper: see :data:`SETTINGS`."""

    draw: Draw = "auto"
    regenerate: Policy = "auto"
    regenerate_below: float | None = None
    opacity_multiplier: float = 1.0
    transmittance_cutoff: float = RenderOptions.transmittance_cutoff
    target_fps: float | None = None  # the window's desired update rate; 0: no previews
    image_distance: float = 1.0
    adjust: bool = True
    off_screen: bool = False
    device: Any = None


_DECLARED = RenderOptions.declared | DrawingOptions.declared

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
        check=Number(low=1, high=100, name="the image sample distance"),
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
    "Device": Option("device", None, "the OpenCL device; ``None`` is the default one"),
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


#: Why nothing here is copied.
COPIES = (
    "a VDIMapper belongs to one VDIActor, and what it has drawn to it: add the volume, or its VDI "
    "(actor.vdi), once more, or put another VDIMapper and VDIActor behind the same VDISource"
)

#: Methods of VTK's GPU volume mapper by why they are refused. What turns a thing off is accepted.
OF_MAPPERS: Mapping[str, tuple[str, ...]] = {
    "a VDI stores what is composited along a ray, so only composite blending is supported: draw "
    "the volume itself by one of VTK's mappers for another": (
        *("SetBlendMode", "SetBlendModeToMaximumIntensity", "SetBlendModeToMinimumIntensity"),
        *("SetBlendModeToAverageIntensity", "SetBlendModeToAdditive", "SetBlendModeToIsoSurface"),
        "SetBlendModeToSlice",
    ),
    "it lights a volume while it is drawn, and a VDI is lit when it is generated: use "
    "ambient_occlusion (VDISource.SetAmbientOcclusion), which darkens what is hidden": (
        *("SetGlobalIlluminationReach", "SetVolumetricScatteringBlending"),
    ),
    "a VDI cannot be masked when it is drawn: set masked voxels to a transparent value, or hide "
    "them (AllocatePointGhostArray), before it is generated": ("SetMaskInput",),
    "the array is chosen by VDISource.SetScalars(name)": (
        *("SetScalarMode", "SetScalarModeToUsePointFieldData", "SetScalarModeToUseCellData"),
        *("SetScalarModeToUseCellFieldData", "SelectScalarArray", "SetArrayName", "SetArrayId"),
    ),
    COPIES: ("ShallowCopy", "copy"),
    "a VDIMapper draws one VDI: give each its own VDIMapper and VDIActor": ("AddInputConnection",),
}

_SHADER = (
    "its shader shows the VDI: set colours and opacities by the volume property, or draw the "
    "volume by a vtkVolume and VTK's mapper"
)

#: Methods of vtkVolume.
OF_ACTORS: Mapping[str, tuple[str, ...]] = {
    COPIES: ("ShallowCopy", "copy"),
    "a VDI is placed in the world: leave the coordinate system at WORLD, and move it by "
    "SetUserMatrix or SetPosition": (
        *("SetCoordinateSystem", "SetCoordinateSystemToPhysical", "SetCoordinateSystemToDevice"),
    ),
    _SHADER: ("SetShaderProperty",),
}

#: Methods of an actor's shader property.
OF_SHADERS = {_SHADER: ("AddFragmentShaderReplacement", "SetFragmentShaderCode")}


def refuse(of: type, methods: Mapping[str, tuple[str, ...]]) -> None:
    """Have methods of a class raise, and say why."""
    for reason, names in methods.items():
        for name in names:
            setattr(of, name, _refusal(name, reason))


def _refusal(name: str, reason: str) -> Callable[..., None]:
    def refused(self: Any, *args: Any, **named: Any) -> None:
        off = name.startswith("Set") and args and (args[-1] is None or args[-1] == 0)
        if not off:
            raise UnsupportedError(f"{name} is not for a VDI: {reason}")

    refused.__name__ = refused.__qualname__ = name
    refused.__doc__ = f"Refuse: {reason}."
    return refused
