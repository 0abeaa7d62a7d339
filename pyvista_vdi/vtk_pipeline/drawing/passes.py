"""Render passes of a renderer that do not see a VDI as it is: what there is to be said of them.

They work on the depth buffer or draw meshes anew, and a VDI, like every volume, is drawn after what
is opaque and writes no depth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

#: What happens to a VDI under a pass of this class.
_EFFECTS = {
    "vtkSSAOPass": (
        "screen-space ambient occlusion (enable_ssao) does not see the VDI, which is as dark as "
        "what is behind it; ambient_occlusion= of add_vdi (VDISource.SetAmbientOcclusion) is its "
        "own. VTK's error that volumes must be shaded is about its own mappers"
    ),
    "vtkShadowMapPass": (
        "shadows (enable_shadows) are drawn with their meshes after the VDI, as after every "
        "volume: it is missing where a mesh is behind it, and casts no shadow; disable_shadows() "
        "shows it"
    ),
    "vtkDepthOfFieldPass": (
        "depth of field (enable_depth_of_field) does not see the VDI, which is as sharp as what "
        "is behind it; disable_depth_of_field() shows it"
    ),
}

#: What becomes of a VDI where volumes are peeled, and something in the scene is translucent.
PEELED = (
    "depth peeling of volumes (SetUseDepthPeelingForVolumes) cannot take a VDI's picture apart: it "
    "is drawn over all that is translucent, as without; for translucent meshes inside a volume "
    "draw that by VTK's own mapper (add_volume)"
)


def tell_effects(renderer: Any, warn: Callable[[str], None]) -> tuple[bool, bool]:
    """Look at what a renderer's passes do to a VDI, and warn of it.

    Returns whether one of them is of ambient occlusion, and whether volumes may be drawn between
    translucent layers.
    """
    names = _below(renderer.GetPass())
    for name, text in _EFFECTS.items():
        if name in names:
            warn(text)
    peeled = "vtkDualDepthPeelingPass" in names
    peeled = peeled or bool(
        renderer.GetUseDepthPeeling() and renderer.GetUseDepthPeelingForVolumes()
    )
    if peeled and shows_what_is_translucent(renderer):
        warn(PEELED)
    return "vtkSSAOPass" in names, peeled


def shows_what_is_translucent(renderer: Any) -> bool:
    """Whether a renderer shows translucent geometry."""
    props = renderer.GetViewProps()
    there = (props.GetItemAsObject(i) for i in range(props.GetNumberOfItems()))
    return any(p.GetVisibility() and p.HasTranslucentPolygonalGeometry() for p in there)


def _below(render_pass: Any) -> set[str]:
    if render_pass is None:
        return set()
    found = {render_pass.GetClassName()}
    if hasattr(render_pass, "GetDelegatePass"):
        found |= _below(render_pass.GetDelegatePass())
    members: Any = render_pass.GetPasses() if hasattr(render_pass, "GetPasses") else None
    for i in range(0 if members is None else members.GetNumberOfItems()):
        found |= _below(members.GetItemAsObject(i))
    return found
