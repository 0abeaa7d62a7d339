"""How an image comes to the screen: texture, shader, and the pixels that OpenGL fills.

The fragment shader of VTK's ray caster is replaced by a lookup in the image of the viewport.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.vtk_pipeline.drawing.refused import OF_SHADERS, refusing
from pyvista_vdi.vtk_pipeline.vtk import (
    VTK_FLOAT,
    vtkHardwareSelector,
    vtkOpenGLShaderProperty,
    vtkTextureObject,
)

_GL_SCISSOR_BOX = 0x0C10

#: Left, bottom, width and height in pixels of the framebuffer.
Box = tuple[int, int, int, int]


class _Texture:
    """A texture that is made when it is first shown, and filled again in another window."""

    def __init__(self) -> None:
        self._texture: Any = None

    def _in_context(self, window: Any) -> bool:
        """Bind the texture to a window's current context; return whether it is filled there."""
        if self._texture is None:
            self._texture = vtkTextureObject()
            self._texture.SetWrapS(vtkTextureObject.ClampToEdge)
            self._texture.SetWrapT(vtkTextureObject.ClampToEdge)
        if self._texture.GetContext() is not window:
            self._texture.SetContext(window)
            return False
        return bool(self._texture.GetHandle() != 0)

    @property
    def there(self) -> bool:
        """Whether it was made, and not freed."""
        return self._texture is not None

    def let_go(self) -> None:
        """Release the texture unit."""
        if self._texture is not None:
            self._texture.Deactivate()

    def release(self) -> None:
        """Free it, for the next frame to fill it anew; a mapper may keep the object."""
        window = None if self._texture is None else self._texture.GetContext()
        if window is not None:
            self._texture.ReleaseGraphicsResources(window)


class ImageTexture(_Texture):
    """The image that the shader of an actor looks up."""

    _uploaded: int | None = None

    def show(
        self, window: Any, image: NDArray[np.float32], number: int | None, *, smooth: bool
    ) -> int:
        """Bind an image for the shader, in the window's context; return its texture unit.

        ``image`` is RGBA, float32 (H, W, 4), its rows in the order that the shader takes them in.
        Where ``number`` is that of last time it is not uploaded again. With ``smooth`` texels are
        interpolated linearly: a full frame's texels are the pixels.
        """
        filled = self._in_context(window)
        texture = self._texture
        kind = vtkTextureObject.Linear if smooth else vtkTextureObject.Nearest
        texture.SetMinificationFilter(kind)
        texture.SetMagnificationFilter(kind)
        if not filled or number is None or number != self._uploaded:
            height, width = image.shape[:2]
            texture.Create2DFromRaw(width, height, 4, VTK_FLOAT, image)
            self._uploaded = number
        texture.Activate()
        return int(texture.GetTextureUnit())

    def release(self) -> None:
        """Free the texture and its object."""
        super().release()
        self._texture = self._uploaded = None


class NoDepth(_Texture):
    """A depth texture of one texel, in place of the copy of the depth buffer that VTK would make.

    VTK's volume mapper copies the whole depth buffer in each frame, for the ray caster that our
    shader replaces: under MSAA that takes longer than to draw the image.
    """

    def show(self, window: Any, mapper: Any) -> None:
        """Bind it for a mapper in the frame that begins; the image's texture is active already."""
        if not self._in_context(window):
            far = np.ones(1, dtype=np.float32)  # window depth of nothing
            self._texture.CreateDepthFromRaw(1, 1, vtkTextureObject.Float32, VTK_FLOAT, far)
        mapper.SetSharedDepthTexture(self._texture)
        self._texture.Activate()


def shown_box(image: NDArray[np.float32], origin: tuple[int, int], size: tuple[int, int]) -> Box:
    """Return the pixels of a viewport that a smaller image may show something in.

    Parameters
    ----------
    image : ndarray of float32, shape (h, w, 4)
        Premultiplied RGBA, top row first, interpolated linearly to the viewport.
    origin, size : (int, int)
        The viewport's lower left corner and size, framebuffer pixels.

    Returns
    -------
    (int, int, int, int)
        Left, bottom, width and height in framebuffer pixels; zeros where nothing is shown.
    """
    there: NDArray[Any] = np.asarray(image.any(axis=2))
    box = []
    edges = np.any(there, axis=0), np.any(there[::-1], axis=1)
    for at_pixels, pixels, start in zip(edges, size, origin, strict=True):
        (at,) = np.nonzero(at_pixels)
        if len(at) == 0:
            return 0, 0, 0, 0
        # A texel reaches to the centres of its neighbours: half a texel beyond its edges
        n = len(at_pixels)
        low = max(0, int((at[0] - 0.5) * pixels / n) - 1)
        high = min(pixels, int((at[-1] + 1.5) * pixels / n) + 2)
        box += [(start + low, high - low)]
    (left, width), (bottom, height) = box
    return left, bottom, width, height


class Scissor:
    """The window's scissor box, narrowed while a mapper draws; VTK's renderer has it tested."""

    def __init__(self) -> None:
        self._before: tuple[Any, list[int]] | None = None  # OpenGL's state, and its scissor box

    def narrow(self, window: Any, box: Box) -> None:
        """Draw in this box alone, and within what was set, until :meth:`end`."""
        # What a frame that VTK broke off has left is not set again: each renderer sets its own box
        state, before = window.GetState(), [0, 0, 0, 0]
        state.vtkglGetIntegerv(_GL_SCISSOR_BOX, before)
        low = [max(a, b) for a, b in zip(before[:2], box[:2], strict=True)]
        high = [min(before[i] + before[i + 2], box[i] + box[i + 2]) for i in (0, 1)]
        state.vtkglScissor(*low, *(max(0, h - b) for b, h in zip(low, high, strict=True)))
        self._before = state, before

    def end(self) -> None:
        """Set what was set before."""
        before, self._before = self._before, None
        if before is not None:
            before[0].vtkglScissor(*before[1])


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
