"""What of VTK's mapper, actor and shader a VDI has no place for: refused when it is called."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from pyvista_vdi.errors import UnsupportedError

_Class = TypeVar("_Class", bound=type)

_COMPOSITE = (
    "a VDI stores what is composited along a ray, so only composite blending is supported: draw "
    "the volume itself by one of VTK's mappers for another"
)
_LIT = (
    "it lights a volume while it is drawn, and a VDI is lit when it is generated: use "
    "ambient_occlusion (VDISource.SetAmbientOcclusion), which darkens what is hidden"
)
_GRADIENT = (
    "a VDI is shaded by the gradient of its scalars, and when it is generated: leave "
    "ComputeNormalFromOpacity off"
)
_DEPTH = (
    "a VDI has no depth image of VTK's: VDIActor.pick(x, y) returns the place that is seen at a "
    "pixel"
)
_ISOSURFACES = (
    "a VDI has no isosurfaces: draw them beside it (vtkContourFilter), or the volume by VTK's "
    "mapper"
)
_STEP = (
    "the step of a VDI is half the smallest spacing, or what SetSampleDistance says: call that in "
    "its place"
)
_ONE_INPUT = "a VDIMapper draws one VDI: give each its own VDIMapper and VDIActor"

#: Methods of VTK's GPU volume mapper. What turns a thing off, or to nothing, is accepted.
OF_MAPPERS: Mapping[str, str] = {
    "SetBlendModeToMaximumIntensity": _COMPOSITE,
    "SetBlendModeToMinimumIntensity": _COMPOSITE,
    "SetBlendModeToAverageIntensity": _COMPOSITE,
    "SetBlendModeToAdditive": _COMPOSITE,
    "SetBlendModeToIsoSurface": _COMPOSITE,
    "SetBlendModeToSlice": _COMPOSITE,
    "SetBlendMode": _COMPOSITE,  # composite blending is 0
    "SetGlobalIlluminationReach": _LIT,
    "SetVolumetricScatteringBlending": _LIT,
    "SetComputeNormalFromOpacity": _GRADIENT,
    "ComputeNormalFromOpacityOn": _GRADIENT,
    "SetMaskInput": "a VDI cannot be masked when it is drawn: set masked voxels to a transparent "
    "value, or hide them (AllocatePointGhostArray), before it is generated",
    "SetUseDepthPass": _ISOSURFACES,
    "UseDepthPassOn": _ISOSURFACES,
    "SetClampDepthToBackface": _DEPTH,
    "ClampDepthToBackfaceOn": _DEPTH,
    "GetDepthImage": _DEPTH,
    "GetDepthTexture": _DEPTH,
    "SetLockSampleDistanceToInputSpacing": _STEP,
    "LockSampleDistanceToInputSpacingOn": _STEP,
    "CreateCanonicalView": "it draws VTK's own ray caster's picture: take one by "
    "vtkWindowToImageFilter, or by pyvista_vdi.render",
    "AddInputConnection": _ONE_INPUT,
    "AddInputDataObject": _ONE_INPUT,
}

_WORLD = (
    "a VDI is placed in the world: leave the coordinate system at WORLD, and move it by "
    "SetUserMatrix or SetPosition"
)
_SHADER = (
    "it changes VTK's ray caster, which a VDI takes the place of: set colours and opacities by the "
    "volume property, or draw the volume by a vtkVolume and VTK's mapper"
)

#: Methods of vtkVolume.
OF_ACTORS: Mapping[str, str] = {
    "SetCoordinateSystem": _WORLD,  # WORLD is 0
    "SetCoordinateSystemToPhysical": _WORLD,
    "SetCoordinateSystemToDevice": _WORLD,
    "SetCoordinateSystemDevice": _WORLD,
    "SetShaderProperty": _SHADER,
}

#: Methods of an actor's shader property.
OF_SHADERS: Mapping[str, str] = {
    **{f"Add{stage}ShaderReplacement": _SHADER for stage in ("Vertex", "Fragment", "Geometry")},
    **{f"Set{stage}ShaderCode": _SHADER for stage in ("Vertex", "Fragment", "Geometry")},
}

#: Render passes that work on depths, of which a VDI, like every volume, writes none, or that draw
#: meshes after it; and the volumes' own peeling. What of their effect cannot be had.
_EFFECTS: Mapping[str, str] = {
    "vtkSSAOPass": "screen-space ambient occlusion (enable_ssao) does not see the VDI, which is "
    "as dark as what is behind it; ambient_occlusion= of add_vdi (VDISource.SetAmbientOcclusion) "
    "is its own. VTK's error that volumes must be shaded is about its own mappers",
    "vtkShadowMapPass": "shadows (enable_shadows) are drawn with their meshes after the VDI, as "
    "after every volume: it is missing where a mesh is behind it, and casts no shadow",
    "vtkDepthOfFieldPass": "depth of field (enable_depth_of_field) does not see the VDI, which is "
    "as sharp as what is behind it",
    "vtkDualDepthPeelingPass": "depth peeling of volumes (SetUseDepthPeelingForVolumes) cannot "
    "take a VDI's picture apart: it is drawn over all that is translucent, as without; for "
    "translucent meshes inside a volume draw that by VTK's own mapper (add_volume)",
}


def effects_without(renderer: Any) -> dict[str, str]:
    """Return what a renderer's passes cannot do to a VDI, by the passes' classes."""
    found, pending = set(), [renderer.GetPass()]
    while pending:
        each = pending.pop()
        if each is not None:
            found.add(each.GetClassName())
            pending.append(each.GetDelegatePass() if hasattr(each, "GetDelegatePass") else None)
            members: Any = each.GetPasses() if hasattr(each, "GetPasses") else None
            count = 0 if members is None else members.GetNumberOfItems()
            pending += [members.GetItemAsObject(i) for i in range(count)]
    if renderer.GetUseDepthPeeling() and renderer.GetUseDepthPeelingForVolumes():
        found.add("vtkDualDepthPeelingPass")
    return {name: text for name, text in _EFFECTS.items() if name in found}


def refusing(methods: Mapping[str, str]) -> Callable[[_Class], _Class]:
    """Return a decorator of classes whose methods of these names raise, and say why."""

    def refusing_them(of: _Class) -> _Class:
        for name, reason in methods.items():
            setattr(of, name, _refusal(name, reason))
        return of

    return refusing_them


def _refusal(name: str, reason: str) -> Callable[..., None]:
    def refuse(self: Any, *args: Any) -> None:
        off = name.startswith("Set") and args and (args[-1] is None or args[-1] == 0)
        if not off:
            raise UnsupportedError(f"{name} is not for a VDI: {reason}")

    refuse.__name__ = refuse.__qualname__ = name
    refuse.__doc__ = f"Refuse: {reason}."
    return refuse
