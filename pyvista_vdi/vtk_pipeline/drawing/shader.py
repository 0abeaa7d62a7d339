"""What takes the place of VTK's ray caster in the shaders of a VDI's actor."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.vtk_pipeline.drawing.refused import OF_SHADERS, refusing
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkHardwareSelector,
    vtkOpenGLShaderProperty,
)

_DECLARATION = "//VTK::Base::Dec\nuniform sampler2D vdiImage;\n"

#: A sampler takes the number of its texture unit, and VTK knows of no custom uniform of that kind:
#: it sets an integer, and declares it, which is no declaration of the sampler under another name.
_UNIFORMS = """
#define vdiImage vdiImageUnit
//VTK::CustomUniforms::Dec
#undef vdiImage
"""

#: Where the viewport is in the framebuffer, pixels: left edge, upper edge, 1 / width, -1 / height.
_VIEWPORT = "vdiViewport"

#: The image is premultiplied RGBA of the whole viewport, top row first. The pixel's place is taken
#: from its number: from a vertex position it would take three matrices, per pixel.
#: finalizeRayCast keeps picking and window/level.
_LOOKUP = f"""
  g_fragColor = texture(vdiImage, (gl_FragCoord.xy - {_VIEWPORT}.xy) * {_VIEWPORT}.zw);
  finalizeRayCast();
"""

#: Where volumes are peeled VTK has its ray caster draw what lies between two layers of translucent
#: geometry, again and again, and ``castRay`` is called from what stands in place of the call. The
#: picture cannot be taken apart: it is given whole to what begins at the near plane, and so lies
#: before all that is translucent, as without peeling of volumes.
_PEELED = f"""
#define castRay(zStart, zEnd) ((zStart) > 0.0 ? vec4(0.0) : \\
  (g_fragColor = texture(vdiImage, (gl_FragCoord.xy - {_VIEWPORT}.xy) * {_VIEWPORT}.zw)))
//VTK::CallWorker::Impl
#undef castRay
"""

#: Under screen-space ambient occlusion finalizeRayCast writes depth, place and normal of what VTK's
#: ray caster has hit: nothing, far away. A VDI leaves those that are there.
_UNSEEN = """
  gl_FragDepth = 0.0;
  fragOutput1 = vec4(0.0);
  fragOutput2 = vec4(0.0);
"""

#: For a selection's passes. Row 0 of the texture is one texel of numbers that no uniform can carry:
#: the area's lower left corner in the framebuffer and its size, pixels. Above it lie the area's
#: hits: (window depth, -, -, 1), or zeros for none.
_FIRST_HIT = """
  ivec4 area = ivec4(texelFetch(vdiImage, ivec2(0, 0), 0));
  ivec2 place = ivec2(gl_FragCoord.xy) - area.xy;
  if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, area.zw)))
    {
    discard;
    }
  vec4 hit = texelFetch(vdiImage, place + ivec2(0, 1), 0);
  if (hit.a == 0.0)
    {
    discard;
    }
  gl_FragDepth = hit.r;
"""

#: finalizeRayCast chooses the colour of the passes that ask which prop it is.
_PROP = """
  g_fragColor = vec4(1.0);
  finalizeRayCast();
"""

#: VTK would number the voxels from 1, and the only cell of the proxy is cell 0.
_CELL = """
  fragOutput0 = vec4(0.0, 0.0, 0.0, 1.0);
"""


#: For boxes that float32 cannot place: one about the origin, whose front or back face, whichever is
#: not culled, is made the viewport, at the near plane.
_FILL = """
  gl_Position = vec4(in_vertexPos.xy * {scale!r}, -0.999, 1.0);
"""

#: What in VTK's template calls its ray caster, and what declares custom uniforms.
_CUSTOM = "//VTK::CustomUniforms::Dec"
_CALL = "//VTK::CallWorker::Impl"
_POSITION = "//VTK::ComputeClipPos::Impl"

#: What only VTK's ray caster needs, and render passes would add to.
_UNUSED = (
    "//VTK::ComputeLighting::Dec",
    "//VTK::ComputeColor::Dec",
    "//VTK::Shading::Impl",
    "//VTK::RenderToImage::Impl",
)


@refusing(OF_SHADERS)
class VDIShaderProperty(vtkOpenGLShaderProperty):
    """The shader property of a VDI's actor: what is added to it by others is refused."""

    def ClearAllShaderReplacements(self, *args: Any) -> None:
        """Leave what shows the VDI: there are no others. So do all that follow."""

    ClearAllVertexShaderReplacements = ClearAllShaderReplacements
    ClearAllFragmentShaderReplacements = ClearAllShaderReplacements
    ClearAllGeometryShaderReplacements = ClearAllShaderReplacements
    ClearVertexShaderReplacement = ClearAllShaderReplacements
    ClearFragmentShaderReplacement = ClearAllShaderReplacements
    ClearGeometryShaderReplacement = ClearAllShaderReplacements


#: What the class above keeps from others, by VTK's own methods.
_add_fragment = vtkOpenGLShaderProperty.AddFragmentShaderReplacement
_add_vertex = vtkOpenGLShaderProperty.AddVertexShaderReplacement
_clear_vertex = vtkOpenGLShaderProperty.ClearVertexShaderReplacement


def show_image(actor: Any, *, occluded: bool = False, peeled: bool = False) -> None:
    """Make an actor's shader look its colours up in an image of the viewport.

    ``occluded`` says whether the frame has a pass of screen-space ambient occlusion, ``peeled``
    whether volumes are drawn by depth peeling.
    """
    shader = actor.GetShaderProperty()
    if _CALL not in _placed(shader):
        _add_fragment(shader, "//VTK::Base::Dec", True, _DECLARATION, False)
        _add_fragment(shader, _CUSTOM, True, _UNIFORMS, False)
        for unused in _UNUSED:
            _add_fragment(shader, unused, True, "", False)
    if peeled:
        _replace(shader, _PEELED)
    else:
        _replace(shader, _LOOKUP + _UNSEEN if occluded else _LOOKUP)


def place_image(actor: Any, unit: int, origin: tuple[int, int], size: tuple[int, int]) -> None:
    """Set which texture unit the image is in, and which viewport it fills, framebuffer pixels."""
    place_texture(actor, unit)
    (x, y), (width, height) = origin, size
    place = (float(x), float(y + height), 1 / max(1, width), -1 / max(1, height))
    actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniform4f(_VIEWPORT, place)


def fill_viewport(actor: Any, edge: float | None) -> None:
    """Fill the viewport with a cube about the origin, of that edge; ``None``: boxes are boxes."""
    shader = actor.GetShaderProperty()
    text = None if edge is None else _FILL.format(scale=2 / edge)
    if text == _placed(shader).get(_POSITION):
        return
    _placed(shader)[_POSITION] = text
    if text is None:
        _clear_vertex(shader, _POSITION, True)
    else:
        _add_vertex(shader, _POSITION, True, text, False)


def place_texture(actor: Any, unit: int) -> None:
    """Set which texture unit the image is in, in the frame that begins."""
    actor.GetShaderProperty().GetFragmentCustomUniforms().SetUniformi("vdiImage", unit)


def show_first_hits(actor: Any, selection_pass: int) -> None:
    """Draw first hits, at their depth, in place of the image.

    ``selection_pass`` is what ``vtkHardwareSelector::GetCurrentPass`` says.
    """
    cells = (vtkHardwareSelector.CELL_ID_LOW24, vtkHardwareSelector.CELL_ID_HIGH24)
    which = _CELL if selection_pass in cells else _PROP
    _replace(actor.GetShaderProperty(), _FIRST_HIT + which)


def _replace(shader: Any, text: str) -> None:
    """Put the text in place, unless it is: a property that is modified has the shader rebuilt."""
    if _placed(shader).get(_CALL) != text:
        _add_fragment(shader, _CALL, True, text, False)
        _placed(shader)[_CALL] = text


def _placed(shader: Any) -> dict[str, str | None]:
    """Return what is in place now, by its tag."""
    return vars(shader).setdefault("placed", {})  # type: ignore[no-any-return]
