"""How an image comes to the screen: texture, shader, and the pixels that OpenGL fills.

The fragment shader of VTK's ray caster is replaced by a lookup in the image of the viewport.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.vtk_pipeline.vtk import VTK_FLOAT, vtkTextureObject


class Textures:
    """The image that the shader of an actor looks up, and a depth of one texel beside it.

    VTK's volume mapper copies the whole depth buffer in each frame, for the ray caster that our
    shader replaces: under MSAA that takes longer than to draw the image. The texel is in its place.
    """

    def __init__(self) -> None:
        self._image, self._depth = vtkTextureObject(), vtkTextureObject()
        self._uploaded: NDArray[np.float32] | None = None
        for texture in (self._image, self._depth):
            texture.SetWrapS(vtkTextureObject.ClampToEdge)
            texture.SetWrapT(vtkTextureObject.ClampToEdge)

    def show(self, window: Any, mapper: Any, image: NDArray[np.float32], *, smooth: bool) -> int:
        """Bind an image for the shader, in the window's context; return its texture unit.

        ``image`` is RGBA, float32 (H, W, 4), its rows in the order that the shader takes them in.
        The same object as last time is not uploaded again. With ``smooth`` texels are interpolated
        linearly: a full frame's texels are the pixels.
        """
        filled = _filled(self._image, window)
        kind = vtkTextureObject.Linear if smooth else vtkTextureObject.Nearest
        self._image.SetMinificationFilter(kind)
        self._image.SetMagnificationFilter(kind)
        if not filled or image is not self._uploaded:
            height, width = image.shape[:2]
            self._image.Create2DFromRaw(width, height, 4, VTK_FLOAT, image)
            self._uploaded = image
        self._image.Activate()
        if not _filled(self._depth, window):
            far = np.ones(1, dtype=np.float32)  # window depth of nothing
            self._depth.CreateDepthFromRaw(1, 1, vtkTextureObject.Float32, VTK_FLOAT, far)
        mapper.SetSharedDepthTexture(self._depth)
        self._depth.Activate()
        return int(self._image.GetTextureUnit())

    def let_go(self) -> None:
        """Release the texture units."""
        self._image.Deactivate()
        self._depth.Deactivate()

    def release(self) -> None:
        """Free them, for the next frame to fill them anew."""
        for texture in (self._image, self._depth):
            if texture.GetContext() is not None:
                texture.ReleaseGraphicsResources(texture.GetContext())


def _filled(texture: vtkTextureObject, window: Any) -> bool:
    """Bind a texture to a window's current context; return whether it is filled there."""
    if texture.GetContext() is not window:
        texture.SetContext(window)
        return False
    return bool(texture.GetHandle() != 0)


#: Where the viewport is in the framebuffer, pixels: left edge, upper edge, 1 / width, -1 / height.
_VIEWPORT = "vdiViewport"

#: What stands in place of VTK's ray caster, in whose shader VTK looks for tags whenever a headlight
#: moves: so short a text takes no time. The image is premultiplied RGBA of the whole viewport, top
#: row first. The pixel's place is taken from its number: from a vertex position it would take three
#: matrices, per pixel. Window and level, and selections, are as in VTK's.
#: A sampler takes the number of its texture unit, and VTK knows of no custom uniform of that kind:
#: it sets an integer, and declares it, which is no declaration of the sampler under another name.
#: VTK calls the three functions. Where volumes are peeled it has rays cast between two layers of
#: translucent geometry, again and again: the picture cannot be taken apart, and is given whole to
#: what begins at the near plane, and so lies before all that is translucent, as without peeling.
LOOKUP = f"""//VTK::System::Dec
//VTK::Output::Dec
vec4 g_fragColor = vec4(0.0);
uniform sampler2D vdiImage;
uniform float in_scale, in_bias;
//VTK::Picking::Dec
//VTK::DepthPeeling::Dec
#define vdiImage vdiImageUnit
//VTK::CustomUniforms::Dec
#undef vdiImage

// What VTK's calls name, for rays of its own
uniform vec2 in_inverseWindowSize;
const float g_opacityThreshold = 1.0;
mat4 g_texToView, in_projectionMatrix, in_modelViewMatrix;
mat4 in_volumeMatrix[1], in_textureDatasetMatrix[1];

void initializeRayCast() {{}}

vec4 castRay(const float zStart, const float zEnd)
{{
  if (zStart > 0.0)
    return vec4(0.0);
  g_fragColor = texture(vdiImage, (gl_FragCoord.xy - {_VIEWPORT}.xy) * {_VIEWPORT}.zw);
  return g_fragColor;
}}

void finalizeRayCast()
{{
  //VTK::Picking::Exit
  g_fragColor.rgb = g_fragColor.rgb * in_scale + in_bias * g_fragColor.a;
  gl_FragData[0] = g_fragColor;
  gl_FragData[1] = gl_FragData[2] = vec4(0.0);  // SSAO's place and normal stay
}}

void main()
{{
  //VTK::CallWorker::Impl
}}
"""

#: For boxes that float32 cannot place: one about the origin, whose front or back face, whichever is
#: not culled, is made the viewport, at the near plane.
_FILL = """
  gl_Position = vec4(in_vertexPos.xy * {scale!r}, -0.999, 1.0);
"""

_POSITION = "//VTK::ComputeClipPos::Impl"


def place_image(actor: Any, unit: int, origin: tuple[int, int], size: tuple[int, int]) -> None:
    """Set which texture unit the image is in, and which viewport it fills, framebuffer pixels."""
    (x, y), (width, height) = origin, size
    place = (float(x), float(y + height), 1 / max(1, width), -1 / max(1, height))
    uniforms = actor.GetShaderProperty().GetFragmentCustomUniforms()
    uniforms.SetUniformi("vdiImage", unit)
    uniforms.SetUniform4f(_VIEWPORT, place)


def fill_viewport(actor: Any, edge: float | None) -> None:
    """Fill the viewport with a cube about the origin, of that edge; ``None``: boxes are boxes.

    A property that is modified has the shader rebuilt, so what is in place is left.
    """
    shader = actor.GetShaderProperty()
    text = None if edge is None else _FILL.format(scale=2 / edge)
    if text == vars(shader).get("filled"):
        return
    vars(shader)["filled"] = text
    if text is None:
        shader.ClearVertexShaderReplacement(_POSITION, True)
    else:
        shader.AddVertexShaderReplacement(_POSITION, True, text, False)
