"""One frame of a VTK renderer: its camera, its clipping planes and its opaque depth."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkFloatArray
from vtkmodules.vtkRenderingOpenGL2 import vtkPixelBufferObject, vtkTextureObject

from pyvista_vdi.device import aligned_empty
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners

Matrix = NDArray[np.float64]

#: Left, bottom, right and top in pixels of the viewport; right and top are outside.
Area = tuple[int, int, int, int]

#: Pixels whose depth is converted at a time.
_BLOCK = 16384

_GL_VIEWPORT = 0x0BA2
_GL_DRAW_FRAMEBUFFER_BINDING = 0x8CA6

#: Near and far planes further outside the bounds than this share of their depth cut nothing.
_PLANE_SLACK = 1e-9


@dataclass(frozen=True)
class Frame:
    """What a frame being drawn asks of a VDI.

    Attributes
    ----------
    size : (int, int)
        Width and height of the image in pixels, from OpenGL's viewport: under SSAA it is larger
        than the window's, in a tiled screenshot it is the tile's.
    origin : (int, int)
        The viewport's lower left corner in the framebuffer, pixels.
    camera : Camera
        The frame's view; its world is ``to_view @ world``, its model transform includes the
        actor's matrix.
    to_view : numpy.ndarray
        World coordinates to that camera's world (eye at the origin, looking along -z), (4, 4).
    projection : numpy.ndarray
        Rows 2 and 3 of the projection matrix: view space to normalised depth and its
        denominator, (2, 4).
    """

    size: tuple[int, int]
    origin: tuple[int, int]
    camera: Camera
    to_view: Matrix
    projection: Matrix

    @classmethod
    def current(cls, renderer: Any, model_transform: Matrix) -> Frame:
        """Read the frame that ``renderer`` is drawing."""
        (x, y), (width, height) = viewport(renderer)
        vtk_camera = renderer.GetActiveCamera()
        aspect = renderer.GetTiledAspectRatio()
        # Not GetCompositeProjectionTransformMatrix: that one turns stereo off
        projection = as_array(vtk_camera.GetProjectionTransformMatrix(aspect, -1, 1))
        composite = projection @ as_array(vtk_camera.GetModelViewTransformMatrix())
        to_view, lens = view_of(
            composite,
            width / height,
            eye=np.asarray(vtk_camera.GetPosition()),
            forward=np.asarray(vtk_camera.GetDirectionOfProjection()),
        )
        camera = Camera(
            (0, 0, 0), (0, 0, -1), (0, 1, 0), model_transform=to_view @ model_transform, **lens
        )
        return cls((width, height), (x, y), camera, to_view, projection[2:])

    @property
    def depth_range(self) -> tuple[float, float]:
        """View depth of the near and of the far plane, world units."""
        near, far = self.view_depth(np.array([0.0, 1.0]), background=False)
        return float(near), float(far)

    def view_depth(self, z: NDArray[Any], *, background: bool = True) -> NDArray[np.float32]:
        """Convert window depth, 0 to 1, to view depth in world units.

        Parameters
        ----------
        z : numpy.ndarray
            The z-buffer: 0 at the near plane, 1 at the far plane.
        background : bool
            Return infinity where z is 1 (nothing was drawn there).

        Notes
        -----
        With rows p and q of the projection matrix, normalised depth is
        n = (p_2 Z' + p_3) / (q_2 Z' + q_3) at view coordinate Z' = -Z, in perspective as well as
        in parallel projection; solved for Z' in float64.
        """
        n = 2.0 * z.astype(np.float64) - 1.0
        (p2, p3), (q2, q3) = self.projection[:, 2:]
        depth = -(p3 - n * q3) / (n * q2 - p2)
        return np.where(z >= 1.0, np.inf, depth) if background else depth

    def window_depth(self, depth: NDArray[Any]) -> NDArray[np.float32]:
        """Convert view depth to window depth: what :meth:`view_depth` undoes.

        Parameters
        ----------
        depth : numpy.ndarray
            World units; infinite where there is nothing, and so is the result.
        """
        (p2, p3), (q2, q3) = self.projection[:, 2:]
        there = np.isfinite(depth)
        z = -np.where(there, depth, 1.0).astype(np.float64)
        n = (z * p2 + p3) / (z * q2 + q3)
        return np.where(there, (n + 1.0) / 2.0, np.inf).astype(np.float32)

    def coarser(self, size: tuple[int, int]) -> Frame:
        """Return the same view with fewer pixels, which fill the viewport just as exactly.

        The centre of pixel i of n lies at (i + 1/2) / n of the viewport's width, where a linearly
        filtered texture puts it, so nothing is shifted. Where rounding has changed the aspect, the
        view's x is scaled by as much: the viewport's edges stay, and view depth does.
        """
        (width, height), (wide, high) = self.size, size
        stretch = np.diag([(wide / high) / (width / height), 1.0, 1.0, 1.0])
        camera = self.camera.replace(model_transform=stretch @ self.camera.model_transform)
        return replace(self, size=size, camera=camera, to_view=stretch @ self.to_view)

    def clipping_planes(self, planes: Any, bounds: tuple[float, ...]) -> Matrix | None:
        """Return all planes that cut the VDI, (k, 6), in the camera's world; ``None`` if none do.

        Parameters
        ----------
        planes : vtkPlaneCollection or None
            The mapper's, world coordinates.
        bounds : tuple of float
            The VDI's, model frame: the near and far planes count where they cut them, because
            VTK's own volumes end there.
        """
        rows = []
        inverse_transpose = np.linalg.inv(self.to_view[:3, :3]).T
        for i in range(planes.GetNumberOfItems() if planes is not None else 0):
            plane = planes.GetItem(i)
            origin = self.to_view[:3, :3] @ plane.GetOrigin() + self.to_view[:3, 3]
            rows.append([*origin, *(inverse_transpose @ plane.GetNormal())])
        nearest, farthest = self.depths_of(bounds)
        near, far = self.depth_range
        slack = _PLANE_SLACK * max(abs(nearest), abs(farthest))
        if near > nearest + slack:
            rows.append([0, 0, -near, 0, 0, -1])
        if far < farthest - slack:
            rows.append([0, 0, -far, 0, 0, 1])
        return np.array(rows, dtype=np.float64) if rows else None

    def in_world(self, planes: Matrix | None) -> Matrix | None:
        """Return planes of :meth:`clipping_planes` in world coordinates, (k, 6)."""
        if planes is None:
            return None
        origins = np.column_stack([planes[:, :3], np.ones(len(planes))])
        origins = origins @ np.linalg.inv(self.to_view).T
        return np.hstack([origins[:, :3], planes[:, 3:] @ self.to_view[:3, :3]])

    def depths_of(self, bounds: tuple[float, ...]) -> tuple[float, float]:
        """Return the least and the largest view depth of a box in the model frame."""
        return depths_of(self.camera.model_transform, bounds)

    def opaque_z(self, renderer: Any, area: Area) -> NDArray[np.float32]:
        """Read the window depth of what has been drawn in an area.

        Parameters
        ----------
        renderer : vtkRenderer
            It is drawing the frame.
        area : tuple of int
            Left, bottom, right and top in pixels of the viewport; right and top are outside.

        Returns
        -------
        numpy.ndarray
            float32 (h, w), bottom row first, 1 where nothing is.
        """
        window = renderer.GetRenderWindow()
        bound = [0]
        window.GetState().vtkglGetIntegerv(_GL_DRAW_FRAMEBUFFER_BINDING, bound)
        left, bottom, right, top = area
        corner, size = (
            (self.origin[0] + left, self.origin[1] + bottom),
            (right - left, top - bottom),
        )
        if bound[0] == window.GetRenderFramebuffer().GetFBOIndex():
            z = _window_depth(window, corner, size)
        else:
            z = _framebuffer_depth(window, corner, size)
        return z.reshape(size[::-1])

    def depth_image(self, z: NDArray[np.float32], area: Area) -> NDArray[np.float32] | None:
        """Return the view depth of what :meth:`opaque_z` has read, float32 (H, W), top row first.

        World units; infinite where nothing is. ``None`` if nothing is anywhere.
        """
        if z.min() >= 1.0:
            return None
        left, bottom, right, top = area
        depth = aligned_empty(self.size[::-1], np.float32)
        depth.fill(np.inf)
        there = depth[self.size[1] - top : self.size[1] - bottom, left:right]
        rows = max(1, _BLOCK // (right - left))
        for first in range(0, top - bottom, rows):  # so that what is in between stays in the cache
            there[first : first + rows] = self.view_depth(z[::-1][first : first + rows])
        return depth


def _window_depth(
    window: Any, corner: tuple[int, int], size: tuple[int, int]
) -> NDArray[np.float32]:
    (x, y), (width, height) = corner, size
    values = vtkFloatArray()
    window.GetZbufferData(x, y, x + width - 1, y + height - 1, values)
    return vtk_to_numpy(values)  # type: ignore[no-any-return]


def _framebuffer_depth(
    window: Any, corner: tuple[int, int], size: tuple[int, int]
) -> NDArray[np.float32]:
    """Copy the depth of a render pass's own framebuffer (SSAA, EDL, blur ...)."""
    width, height = size
    texture = vtkTextureObject()
    texture.SetContext(window)
    texture.AllocateDepth(width, height, vtkTextureObject.Float32)
    samples = window.GetMultiSamples()
    window.SetMultiSamples(0)  # or the copy resolves the window's framebuffer instead
    try:
        texture.CopyFromFrameBuffer(*corner, 0, 0, width, height)
    finally:
        window.SetMultiSamples(samples)
    pixels: vtkPixelBufferObject = texture.Download()
    z = np.empty(width * height, dtype=np.float32)
    pixels.Download2D(VTK_FLOAT, z, [width, height], 1, [0, 0])
    pixels.ReleaseMemory()
    pixels.UnBind()  # it binds itself to be released, and would catch VTK's next glReadPixels
    texture.ReleaseGraphicsResources(window)
    return z


def viewport(renderer: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return OpenGL's viewport while a renderer draws: lower left corner and size, pixels."""
    values = [0, 0, 0, 0]
    renderer.GetRenderWindow().GetState().vtkglGetIntegerv(_GL_VIEWPORT, values)
    x, y, width, height = values
    return (x, y), (width, height)


def sampled(depth: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Return the depth nearest to the centre of each pixel of a coarser image, float32 (H, W).

    Depths must not be averaged: between a mesh and what is behind it nothing is.
    """
    rows, columns = (
        ((2 * np.arange(n) + 1) * full) // (2 * n)
        for n, full in zip(size[::-1], depth.shape, strict=True)
    )
    return np.ascontiguousarray(depth[np.ix_(rows, columns)])


def view_of(
    composite: Matrix, aspect: float, *, eye: NDArray[Any], forward: NDArray[Any]
) -> tuple[Matrix, dict[str, Any]]:
    """Split a projection matrix into a rigid transform and a lens.

    Whatever VTK put into the matrix (one eye of a stereo pair, a tile of a screenshot, a window
    centre, an off-axis or explicit projection) is in what is drawn, so the frame's view is taken
    from the matrix and not from the camera's settings.

    Parameters
    ----------
    composite : numpy.ndarray
        World to normalised device coordinates, (4, 4).
    aspect : float
        Width over height of the viewport in pixels.
    eye, forward : numpy.ndarray
        The camera's position and direction; used in parallel projection, where the matrix does
        not tell where depth begins.

    Returns
    -------
    to_view : numpy.ndarray
        World to view coordinates (x right, y up, z backward), (4, 4): rotation and translation,
        with whatever scale or shear is left in it.
    lens : dict
        ``view_angle`` and ``window_center``, or ``parallel_projection`` and ``parallel_scale``,
        for a :class:`Camera` at the origin that looks along -z.
    """
    across, up, denominator = composite[0], composite[1], composite[3]
    scale = np.linalg.norm(denominator[:3])
    to_view = np.eye(4)
    if scale == 0.0:
        half = 1.0 / np.linalg.norm(up[:3] / denominator[3])
        to_view[0] = across / denominator[3] * half * aspect
        to_view[1] = up / denominator[3] * half
        to_view[2] = [*-forward, forward @ eye]
        return to_view, {"parallel_projection": True, "parallel_scale": half}
    depth = denominator / scale  # Z = depth . (x, y, z, 1): unit normal
    # u Z = across . p = X / t_x - c_x Z, and X has no component along the direction
    center = [-(row[:3] / scale) @ depth[:3] for row in (across, up)]
    x = across / scale + center[0] * depth
    y = up / scale + center[1] * depth
    half = 1.0 / np.linalg.norm(y[:3])
    to_view[0] = x * half * aspect
    to_view[1] = y * half
    to_view[2] = -depth
    return to_view, {
        "view_angle": math.degrees(2 * math.atan(half)),
        "window_center": center,
    }


def as_array(matrix: Any) -> Matrix:
    """Return a ``vtkMatrix4x4`` as float64 (4, 4)."""
    return np.array(matrix.GetData(), dtype=np.float64).reshape(4, 4)


def rectangle(
    frame: Frame, bounds: tuple[float, ...], *, margin: float = 0.0
) -> NDArray[np.float64] | None:
    """Return what bounds cover of the viewport, pixels, float64 rows (low, high) by (x, y).

    From the lower left corner, and ``margin`` pixels wider on each side. All of it if they reach
    behind the eye; ``None`` if none of it.
    """
    camera, size = frame.camera, np.asarray(frame.size, dtype=np.float64)
    corners = np.column_stack([bounds_corners(bounds), np.ones(8)])
    u, v, _, w = camera.viewport_matrix(frame.size) @ (camera.model_to_view @ corners.T)
    if not camera.parallel_projection and w.min() <= 0:
        return None if w.max() <= 0 else np.stack([0 * size, size])
    places = (np.stack([u, v]) / w + 1) / 2 * size[:, None]
    low, high = places.min(axis=1) - margin, places.max(axis=1) + margin
    if (high < 0).any() or (low > size).any():
        return None
    return np.stack([low, high])


def depths_of(to_view: Matrix, bounds: tuple[float, ...]) -> tuple[float, float]:
    """Return the least and the largest view depth of a box that a matrix brings to view space."""
    corners = bounds_corners(bounds)
    depth = -(corners @ to_view[2, :3] + to_view[2, 3])
    return float(depth.min()), float(depth.max())
