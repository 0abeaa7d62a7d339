"""Frey, Sadlo, Ertl 2013 by OpenGL, through VTK: frusta as geometry, blended in their order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkFloatArray, vtkPoints, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataObject, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLPolyDataMapper

from baselines.frusta import to_window
from baselines.medium import Floats, Medium, view_of
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.measure.vtk_baselines import OffScreenVolume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: Of the bounds' diagonal: w below which nothing is drawn.
_LEAST_W = 1e-4

_VERTEX = """//VTK::System::Dec
in vec4 vertexMC;
in vec2 faces;
in vec4 medium;
out vec2 listOf;
out vec2 facesOf;
out vec4 mediumOf;
void main() {
  listOf = vertexMC.xy;
  facesOf = faces;
  mediumOf = medium;
  gl_Position = vec4(0.0, 0.0, 0.0, 1.0);
}
"""

#: A point becomes a frustum: a strip of 12 triangles, of which those in front are culled, so that
#: each pixel is met once, and the eye may be inside. Depth is not written or asked for.
_GEOMETRY = """//VTK::System::Dec
layout(points) in;
layout(triangle_strip, max_vertices = 14) out;
//VTK::CustomUniforms::Dec
in vec2 listOf[];
in vec2 facesOf[];
in vec4 mediumOf[];
flat out vec2 listAt;
flat out vec2 facesAt;
flat out vec4 mediumAt;
void main() {
  for (int n = 0; n < 14; ++n) {
    vec2 side = vec2(0x287a >> n & 1, 0x02af >> n & 1);
    float z = (0x31e3 >> n & 1) == 1 ? facesOf[0].y : facesOf[0].x;
    float d = depthOrigin.y * z + depthOrigin.x;
    listAt = listOf[0];
    facesAt = facesOf[0];
    mediumAt = mediumOf[0];
    gl_Position = vec4((listOf[0] + side) * d, z, 1.0) * toClip;
    EmitVertex();
  }
  EndPrimitive();
}
"""

#: The length is that between entry into the frustum and exit, of the ray through the pixel.
_FRAGMENT = """//VTK::System::Dec
//VTK::Output::Dec
//VTK::CustomUniforms::Dec
flat in vec2 listAt;
flat in vec2 facesAt;
flat in vec4 mediumAt;
void keep(vec4 value, vec4 slope, inout float from, inout float to) {
  vec4 t = -value / slope;
  for (int k = 0; k < 4; ++k) {
    if (slope[k] > 0.0)
      from = max(from, t[k]);
    else if (slope[k] < 0.0)
      to = min(to, t[k]);
    else if (value[k] < 0.0)
      to = from - 1.0;
  }
}
void main() {
  vec4 pixel = vec4(1.0, gl_FragCoord.xy - windowHalf.xy, 0.0);
  vec4 value = pixel * values;
  vec4 slope = pixel * slopes;
  vec4 place = pixel * places;
  vec4 direction = pixel * directions;
  float from = windowHalf.z;
  float to = 3e38;
  keep(vec4(value.xy - listAt * value.w, (listAt + 1.0) * value.w - value.xy),
       vec4(slope.xy - listAt * slope.w, (listAt + 1.0) * slope.w - slope.xy), from, to);
  keep(vec4(value.z - facesAt.x, facesAt.y - value.z, halfBox.xy + place.xy),
       vec4(slope.z, -slope.z, direction.xy), from, to);
  keep(vec4(halfBox - place.xyz, halfBox.z + place.z), vec4(-direction.xyz, direction.z), from, to);
  if (!(from < to))
    discard;
  float tau = mediumAt.w * (to - from) * length(direction.xyz);
  float alpha = tau < 1e-2 ? tau * (1.0 - tau * (0.5 - tau / 6.0)) : 1.0 - exp(-tau);
  gl_FragData[0] = vec4(mediumAt.rgb, alpha);
}
"""


class OpenGLFrusta(OffScreenVolume):
    """A VDI drawn as frusta by OpenGL, farthest first, blended in float32.

    Parameters
    ----------
    vdi : VDI
        What to draw.
    size : (int, int)
        Window, pixels.
    float_buffer : bool
        Whether colours are blended in float32; otherwise, as on a screen, in steps of 1/255.

    Raises
    ------
    UnsupportedError
        If VTK is older than 9.5.
    """

    def __init__(self, vdi: VDI, size: tuple[int, int], *, float_buffer: bool = True) -> None:
        self.medium, self.size = Medium(vdi), size
        medium = self.medium
        self._arrays = (
            np.stack(
                [medium.list_of % medium.wide, medium.list_of // medium.wide, 0 * medium.list_of],
                axis=1,
            ).astype(np.float32),
            np.ascontiguousarray(medium.faces, np.float32),
            np.ascontiguousarray(medium.media, np.float32),
        )
        points, self._drawn = vtkPoints(), vtkPolyData()
        points.SetData(numpy_to_vtk(self._arrays[0]))
        self._drawn.SetPoints(points)
        self._mapper = vtkOpenGLPolyDataMapper()
        self._mapper.SetInputData(self._drawn)
        self._mapper.SetVBOShiftScaleMethod(0)
        self._mapper.SetStatic(True)
        for name, values in zip(("faces", "medium"), self._arrays[1:], strict=True):
            array = numpy_to_vtk(values)
            array.SetName(name)
            self._drawn.GetPointData().AddArray(array)
            of_points = vtkDataObject.FIELD_ASSOCIATION_POINTS
            self._mapper.MapDataArrayToVertexAttribute(name, name, of_points, -1)
        actor = vtkActor()
        actor.SetMapper(self._mapper)
        actor.ForceTranslucentOn()
        shaders = actor.GetShaderProperty()
        shaders.SetVertexShaderCode(_VERTEX)
        shaders.SetGeometryShaderCode(_GEOMETRY)
        shaders.SetFragmentShaderCode(_FRAGMENT)
        super().__init__("OpenGL", actor, size)
        if not hasattr(self.renderer, "SetUseOIT"):
            self.close()
            raise UnsupportedError(
                "frusta are blended in the order in which they come, which VTK "
                f"{vtkVersion.GetVTKVersion()} cannot: update it to 9.5 or newer"
            )
        self.renderer.GetCullers().RemoveAllItems()  # points are lists' numbers, no positions
        self.renderer.SetUseOIT(False)
        self._window.Render()
        if float_buffer:
            frame = self._window.GetRenderFramebuffer()
            frame.PopulateFramebuffer(*size, True, 1, VTK_FLOAT, True, 24, 0, False)

    @property
    def nbytes(self) -> int:
        """Bytes of vertices and of their order, a point for each supersegment."""
        return sum(array.nbytes for array in self._arrays) + 4 * len(self._arrays[0])

    def image(self, camera: Camera) -> NDArray[np.float32]:  # also empty ones
        """Draw a frame; premultiplied RGBA (H, W, 4), top row first."""
        self._arrange(camera)
        self._tell(camera)
        self._window.Render()
        (width, height), pixels = self.size, vtkFloatArray()
        back_buffer, right_eye = 0, 0
        self._window.GetRGBAPixelData(0, 0, width - 1, height - 1, back_buffer, pixels, right_eye)
        bottom_up: NDArray[np.float32] = vtk_to_numpy(pixels).reshape(height, width, 4)
        return bottom_up[::-1]

    def _arrange(self, camera: Camera) -> None:
        """Put the frusta in their order, farthest first."""
        order = self.medium.order(camera)[::-1]
        cells = vtkCellArray()
        whole = np.array([0, len(order)], np.int64)
        cells.SetData(
            numpy_to_vtk(whole, deep=True), numpy_to_vtk(order.astype(np.int64), deep=True)
        )
        self._drawn.SetVerts(cells)

    def _tell(self, camera: Camera) -> None:
        """Give the shaders the view, and say which side of a triangle is in front."""
        medium, (width, height), bounds = self.medium, self.size, self.medium.vdi.bounds
        view = view_of(medium, camera, self.size)
        x, y, w = to_window(medium, camera, self.size)
        least = _LEAST_W * np.linalg.norm(np.subtract(bounds[1::2], bounds[::2]))
        near = w - 2 * least * np.array([0, 0, 0, 1])  # nothing is clipped but where w < least
        clip = np.stack([2 / width * x - w, 2 / height * y - w, near, w])
        pixel_rays = rays.pixel_rays(camera, self.size, bounds)
        low, high = np.reshape(bounds, (3, 2)).T
        origin = pixel_rays.origin.copy()
        origin[0] -= (low + high) / 2
        forms = view.forms[:4].astype(np.float64)
        first_t = -3e38 if camera.parallel_projection else -view.reference_depth
        shaders = self._volume.GetShaderProperty()
        for uniforms in (shaders.GetFragmentCustomUniforms(), shaders.GetGeometryCustomUniforms()):
            for name, rows in (
                ("toClip", clip),
                ("values", forms[:, :3]),
                ("slopes", forms[:, 3:]),
                ("places", origin.T),
                ("directions", pixel_rays.direction.T),
            ):
                uniforms.SetUniformMatrix(name, _matrix(rows))
            uniforms.SetUniform3f("halfBox", ((high - low) / 2).tolist())
            uniforms.SetUniform3f("windowHalf", [width / 2, height / 2, first_t])
            depth = [1.0, 0.0] if medium.parallel else [medium.vdi.depth_origin, 1.0]
            uniforms.SetUniform2f("depthOrigin", depth)
        prop, mirrored = self._volume.GetProperty(), medium.is_mirrored(camera)
        prop.SetFrontfaceCulling(mirrored)
        prop.SetBackfaceCulling(not mirrored)


def _matrix(rows: Floats) -> Any:
    """Return rows as a ``vtkMatrix4x4``, zeros below and beside them."""
    whole = np.zeros((4, 4))
    whole[: rows.shape[0], : rows.shape[1]] = rows
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(whole.ravel().tolist())
    return matrix
