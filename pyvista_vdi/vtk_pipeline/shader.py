"""What takes the place of VTK's ray caster in the fragment shader of a VDI's actor.

The sampler is never set: VTK allows no uniform to be set in the frame that builds the shader, and
its default is texture unit 0, where the mapper puts a texture.
"""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkRenderingCore import vtkHardwareSelector

_DECLARATION = "//VTK::Base::Dec\nuniform sampler2D vdiImage;\n"

#: The image is premultiplied RGBA of the whole viewport, bottom row first. finalizeRayCast keeps
#: picking and window/level.
_LOOKUP = """
  vec4 clip = in_projectionMatrix * in_modelViewMatrix * in_volumeMatrix[0]
            * vec4(ip_vertexPos, 1.0);
  g_fragColor = texture(vdiImage, clip.xy / clip.w * 0.5 + 0.5);
  finalizeRayCast();
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


def show_image(actor: Any) -> None:
    """Have an actor's shader look its colours up in an image of the viewport."""
    actor.GetShaderProperty().AddFragmentShaderReplacement(
        "//VTK::Base::Dec", True, _DECLARATION, False
    )
    _cast_rays_by(actor, _LOOKUP)


def show_first_hits(actor: Any, selection_pass: int) -> None:
    """Have it draw first hits, at their depth, in place of the image.

    Parameters
    ----------
    actor : vtkVolume
        The VDI's.
    selection_pass : int
        What ``vtkHardwareSelector::GetCurrentPass`` says.
    """
    cells = (vtkHardwareSelector.CELL_ID_LOW24, vtkHardwareSelector.CELL_ID_HIGH24)
    which = _CELL if selection_pass in cells else _PROP
    _cast_rays_by(actor, _FIRST_HIT + which)


def _cast_rays_by(actor: Any, text: str) -> None:
    actor.GetShaderProperty().AddFragmentShaderReplacement(
        "//VTK::CallWorker::Impl", True, text, False
    )
