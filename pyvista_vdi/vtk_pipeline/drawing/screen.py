"""How an image comes to the screen: a box that VTK draws, textures, and the box's shader.

The fragment shader of VTK's ray caster is replaced by a lookup in the image of the viewport.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.view import bounds_corners
from pyvista_vdi.vtk_pipeline.filters.algorithm import WHOLE_EXTENT, Algorithm
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.view import as_array
from pyvista_vdi.vtk_pipeline.vtk import VTK_FLOAT, vtkDataObject, vtkTextureObject

_EXTENT = (0, 1, 0, 1, 0, 1)
_EMPTY = (0, -1, 0, -1, 0, -1)

#: Diagonals from the origin beyond which a box fills the viewport instead: VTK places boxes in
#: float32, which rounds corners by a pixel in ten thousand there, and by more beyond.
_FAR = 1000.0

#: Edge of the box that VTK draws then, about the origin: so small that no eye is inside.
_EDGE = 2e-3


class Box(Algorithm):
    """What is before the mapper in VTK's pipeline: an image of 2 x 2 x 2 voxels.

    VTK's mappers bring their input up to date when they are asked for their bounds, as by
    ``ResetCamera()``, which calls no method in Python. So this is connected to whatever is before
    the source, executes whenever that does, and makes no VDI.

    Attributes
    ----------
    image : vtkImageData
        The output. It has no points where nothing is at the input.
    components : int
        Those of its scalars.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, nOutputPorts=1, outputType="vtkImageData")
        self._shown: Input | None = None
        self.components = 1
        self._stands = False
        self._far: tuple[Any, Any] | None = None  # origin and spacing, in a frame of what is far
        self.Update()
        self.image = self.GetOutputDataObject(0)

    def FillInputPortInformation(self, port: int, information: Any) -> int:
        """Take whatever the source is to refuse, or nothing."""
        information.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkDataObject")
        information.Set(self.INPUT_IS_OPTIONAL(), 1)
        return 1

    def show(self, shown: Input | None) -> None:
        """Take the bounds of another input from now on."""
        self._shown = shown
        self.connect()
        if shown is not None and self.GetNumberOfInputConnections(0) == 0:
            self.place(shown.bounds())
        self.Modified()

    def connect(self) -> None:
        """Follow what the input is made of, which may be something else by now."""
        port = None if self._shown is None else self._shown.port
        connected = self.GetNumberOfInputConnections(0) > 0
        if port is not (self.GetInputConnection(0, 0) if connected else None):
            self.SetInputConnection(port)
            self.place(None)  # what fails from the first has no bounds either

    def place(self, bounds: tuple[float, ...] | None) -> None:
        """Set the bounds, model frame; ``None``: none."""
        extent = _EMPTY if bounds is None else _EXTENT
        if self.image.GetExtent() != extent or self.image.GetPointData().GetScalars() is None:
            self.image.SetExtent(extent)
            self._allocate()
        if bounds is not None:
            low, high = np.asarray(bounds[::2]), np.asarray(bounds[1::2])
            self.image.SetDirectionMatrix(1, 0, 0, 0, 1, 0, 0, 0, 1)  # VTK passes on the input's
            self.image.SetOrigin(*low)
            self.image.SetSpacing(*np.maximum(high - low, np.finfo(np.float32).tiny))

    def begin(self, actor: Any) -> None:
        """Be what VTK can draw in a frame of an actor; between frames the bounds are the VDI's.

        VTK writes an error where there are no points, and float32 cannot place what is far from the
        origin: a box about the origin has the whole viewport drawn then, where the image that is
        looked up is transparent beside the VDI.
        """
        self.end()  # of a frame that VTK has broken off
        self._stands = self.image.GetNumberOfPoints() == 0
        if self._stands:
            self.place((0, 1, 0, 1, 0, 1))
        if actor is None:
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if actor.GetProperty().GetIndependentComponents() else 4
        if components != self.components:
            self.components = components
            self._allocate()
        model, matrix = bounds_corners(self.image.GetBounds()), as_array(actor.GetMatrix())
        # From the origin of the model frame, or of the world
        far = any(
            np.abs(at).max() > _FAR * np.linalg.norm(np.ptp(at, axis=0))
            for at in (model, model @ matrix[:3, :3].T + matrix[:3, 3])
        )
        fill_viewport(actor, _EDGE if far else None)
        if far:
            self._far = self.image.GetOrigin(), self.image.GetSpacing()
            self.image.SetOrigin([-_EDGE / 2] * 3)
            self.image.SetSpacing([_EDGE] * 3)

    def end(self) -> None:
        """Take the bounds again, or none."""
        if self._far is not None:
            (origin, spacing), self._far = self._far, None
            self.image.SetOrigin(origin)
            self.image.SetSpacing(spacing)
        if self._stands:
            self._stands = False
            self.place(None)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the voxels."""
        outputs.GetInformationObject(0).Set(WHOLE_EXTENT, _EXTENT, 6)
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self.image = vtkDataObject.GetData(outputs, 0)
        self.place(None if self._shown is None else self._shown.bounds())

    def _allocate(self) -> None:
        self.image.AllocateScalars(3, self.components)  # VTK_UNSIGNED_CHAR
        self.image.GetPointData().GetScalars().Fill(0)


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
