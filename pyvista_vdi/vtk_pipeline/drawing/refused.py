"""What of VTK's mapper and actor a VDI has no place for: refused when it is called."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pyvista_vdi.errors import UnsupportedError

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

#: Methods of vtkVolume.
OF_ACTORS: Mapping[str, tuple[str, ...]] = {
    COPIES: ("ShallowCopy", "copy"),
    "a VDI is placed in the world: leave the coordinate system at WORLD, and move it by "
    "SetUserMatrix or SetPosition": (
        *("SetCoordinateSystem", "SetCoordinateSystemToPhysical", "SetCoordinateSystemToDevice"),
    ),
    "its shader shows the VDI: set colours and opacities by the volume property, or draw the "
    "volume by a vtkVolume and VTK's mapper": ("SetShaderProperty",),
}


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
