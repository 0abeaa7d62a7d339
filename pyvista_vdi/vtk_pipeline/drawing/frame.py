"""One VDI in the frame that VTK is drawing: one record from the renderer's state to the raycast.

With it the depth of what is opaque, read where it can hide a VDI.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import bounds_corners
from pyvista_vdi.quality.plan import RenderMode
from pyvista_vdi.quality.view_error import angle_from_generating_view
from pyvista_vdi.vtk_pipeline.drawing.window import Window
from pyvista_vdi.vtk_pipeline.filters.view import View, as_array, camera_of, size_of
from pyvista_vdi.vtk_pipeline.vtk import (
    VTK_FLOAT,
    vtk_to_numpy,
    vtkActor2D,
    vtkFloatArray,
    vtkPixelBufferObject,
    vtkTextureObject,
    vtkVolume,
)

Matrix = NDArray[np.float64]
Image = NDArray[np.float32]
_GL_VIEWPORT, _GL_DRAW_FRAMEBUFFER_BINDING = 0x0BA2, 0x8CA6

#: Near and far planes further outside the bounds than this share of their depth cut nothing.
_PLANE_SLACK = 1e-9

#: Pixels around a rectangle that are read as well: a pixel is drawn where its centre is inside.
_MARGIN = 2

#: Pixels whose depth is converted at a time, so that what is in between stays in the cache.
_BLOCK = 16384


@dataclass(frozen=True, eq=False)
class Frame:
    """What a renderer's frame asks of a VDI. It lives no longer than the frame: it holds VTK's.

    Its camera's world is ``to_view @ world``: the eye is at the origin and looks along -z. Sizes
    are width and height in pixels, from OpenGL's viewport: under SSAA it is larger than the
    window's, in a tiled screenshot it is the tile's.
    """

    size: tuple[int, int]  # of the image
    origin: tuple[int, int]  # the viewport's lower left corner in the framebuffer, pixels
    camera: Camera  # its model transform includes the actor's matrix
    to_view: Matrix  # world coordinates to that camera's world, (4, 4)
    projection: Matrix  # its rows 2 and 3: view space to depth and denominator, (2, 4)
    renderer: Any
    window: Window
    actor: Any
    mapper: Any
    full_size: tuple[int, int]  # of the viewport; the image of a preview is smaller
    view: View  # the renderer's, between the two eyes of a stereo pair
    model_transform: Matrix  # the actor's matrix, (4, 4)
    vdi: VDI | None = None  # what is seen: see showing()
    volume: Any = None  # the VolumePicture that is seen in place of a VDI
    way: RenderMode = "vdi"  # what is raycast
    seen: Any = None  # a weak reference to that, by which it is known
    effort: float = 1.0  # what a ray is expected to take over one from the VDI's own view
    angle: float = 0.0  # between the view and that of the VDI, degrees; 0 for a volume
    parts: tuple[tuple[VDI, float], ...] = ()  # what the picture is blended of, with weights
    lit_from: Camera | None = None  # whose light falls on a shaded volume, in place of the VDI's
    full: bool = True  # whether every pixel gets a ray
    stand_in: bool = False  # whether the volume stands in for a VDI to come
    bounds: tuple[float, ...] = ()  # of what is seen, model frame
    options: RenderOptions = field(default_factory=RenderOptions)  # planes in the camera's world
    depth: Image | None = None  # window depth of what hides it, float32 (H, W), top row first

    @classmethod
    def current(
        cls,
        renderer: Any,
        actor: Any,
        mapper: Any,
        matrix: Matrix | None = None,
        *,
        drawing: bool = True,
    ) -> Frame | None:
        """Read the frame that ``renderer`` is drawing, or between two would draw.

        ``matrix`` is where an actor stands, (4, 4). ``None`` where nothing is to be drawn.
        """
        (x, y), (width, height) = viewport(renderer) if drawing else tiled(renderer)
        if min(width, height) == 0:
            return None
        matrix = as_array(actor.GetMatrix()) if matrix is None else matrix
        if not np.linalg.det(matrix[:3, :3]):  # VTK's cameras are NaN that were reset to it
            raise InvalidArgumentError(
                "the actor's matrix flattens space: give a user_matrix, or a scale, that can be "
                f"inverted; got {matrix.tolist()}"
            )
        vtk_camera = renderer.GetActiveCamera()
        aspect = renderer.GetTiledAspectRatio()
        # Not GetCompositeProjectionTransformMatrix: that one turns stereo off
        projection = as_array(vtk_camera.GetProjectionTransformMatrix(aspect, -1, 1))
        model_view = as_array(vtk_camera.GetModelViewTransformMatrix())
        scale = np.linalg.norm(model_view[2, :3])  # of the camera's model transform
        to_view, lens = view_of(projection @ model_view, width / height, model_view[2] / scale)
        projection[:, 2] *= scale
        camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), model_transform=to_view @ matrix, **lens)
        size = (width, height)
        try:
            view = View(camera_of(vtk_camera, matrix), size_of(renderer))
        except UnsupportedError:  # a shear, an off-axis projection: drawn all the same
            view = View(camera, size)
        of = (renderer, Window.of(renderer.GetRenderWindow()), actor, mapper, size, view, matrix)
        return cls(size, (x, y), camera, to_view, projection[2:], *of)

    def showing(self, seen: Any, **known: Any) -> Frame:
        """Return the frame of this VDI, or volume, with all that its mapper says of its looks."""
        settings, costs = self.mapper.driver.settings, self.mapper.driver.costs
        options = RenderOptions(
            clipping_planes=self._clipping_planes(seen.bounds),
            cropping=self.mapper,
            opacity_multiplier=settings.opacity_multiplier,
            transmittance_cutoff=settings.transmittance_cutoff,
        )
        known |= {"seen": weakref.ref(seen), "bounds": seen.bounds, "options": options}
        if not isinstance(seen, VDI):
            return replace(self, volume=seen, way="volume", **known)
        angle = angle_from_generating_view(seen, self.view.camera)
        return replace(self, vdi=seen, angle=angle, effort=costs.rise(angle), **known)

    @property
    def key(self) -> Any:
        """What its image is known by, but for the depth; the quality is in it as the two sizes."""
        blend = tuple((weakref.ref(vdi), weight) for vdi, weight in self.parts)
        of = (self.seen, self.camera, self.size, self.full_size, self.options)
        numbers = None if self.depth is None else self.projection.tobytes()
        return (*of, self.lit_from, blend, numbers)

    def coarser(self, size: tuple[int, int]) -> Frame:
        """Return the same view with fewer pixels, which fill the viewport just as exactly.

        The centre of pixel i of n lies at (i + 1/2) / n of the viewport's width, where a linearly
        filtered texture puts it, so nothing is shifted. Where rounding has changed the aspect, the
        view's x is scaled by as much: the viewport's edges stay, and view depth does.
        """
        if size == self.size:
            return self
        (width, height), (wide, high) = self.size, size
        stretch = np.diag([(wide / high) / (width / height), 1.0, 1.0, 1.0])
        camera = self.camera.replace(model_transform=stretch @ self.camera.model_transform)
        depth = self.depth
        if depth is not None:
            # The nearest: between a mesh and what is behind it nothing is
            edges = zip(size[::-1], depth.shape, strict=True)
            depth = depth[np.ix_(*((2 * np.arange(n) + 1) * full // (2 * n) for n, full in edges))]
        frame = replace(self, size=size, camera=camera, to_view=stretch @ self.to_view, depth=depth)
        planes = frame._clipping_planes(self.bounds)
        return replace(frame, options=self.options.replace(clipping_planes=planes))

    def _clipping_planes(self, bounds: tuple[float, ...]) -> list[list[float]]:
        """Return all planes that cut a VDI, (k, 6), in the camera's world.

        The mapper's, and the near and far planes where they cut these bounds, because VTK's own
        volumes end there.
        """
        rows: list[list[float]] = []
        if planes := planes_of(self.mapper):
            table, turn = np.array(planes), self.to_view[:3, :3]
            origins = table[:, :3] @ turn.T + self.to_view[:3, 3]
            rows = np.hstack([origins, table[:, 3:] @ np.linalg.inv(turn)]).tolist()
        nearest, farthest = depths_of(self.camera.model_transform, bounds)
        near, far = self.view_depth(np.array([0.0, 1.0])).tolist()
        slack = _PLANE_SLACK * max(abs(nearest), abs(farthest))
        if near > nearest + slack:
            rows.append([0, 0, -near, 0, 0, -1])
        if far < farthest - slack:
            rows.append([0, 0, -far, 0, 0, 1])
        return rows

    def rectangle(self, bounds: tuple[float, ...], margin: float = 0.0) -> Matrix | None:
        """Return what bounds cover of the viewport, pixels, float64 rows (low, high) by (x, y).

        From the lower left corner, and ``margin`` pixels wider on each side. All of it if they
        reach behind the eye; ``None`` if none of it.
        """
        camera, size = self.camera, np.asarray(self.size, dtype=np.float64)
        corners = np.column_stack([bounds_corners(bounds), np.ones(8)])
        u, v, _, w = camera.viewport_matrix(self.size) @ (camera.model_to_view @ corners.T)
        if not camera.parallel_projection and w.min() <= 0:
            return None if w.max() <= 0 else np.stack([0 * size, size])
        places = (np.stack([u, v]) / w + 1) / 2 * size[:, None]
        low, high = places.min(axis=1) - margin, places.max(axis=1) + margin
        if (high < 0).any() or (low > size).any():
            return None
        return np.stack([low, high])

    def covered_by(self, bounds: tuple[float, ...]) -> float:
        """Return how many of the image's pixels bounds may be seen in."""
        rectangle = self.rectangle(bounds)
        if rectangle is None:
            return 0.0
        low, high = np.clip(rectangle, 0, self.size)
        return float(np.prod(high - low))

    def view_depth(self, z: NDArray[Any]) -> NDArray[Any]:
        """Convert window depth, 0 (near) to 1 (far), to view depth in world units, of its dtype.

        With rows p and q of the projection matrix, normalised depth is
        n = (p_2 Z' + p_3) / (q_2 Z' + q_3) at view coordinate Z' = -Z, in perspective as well as in
        parallel projection; solved for Z' by 1 - z, which is exact where float32 is finest.
        """
        (p2, p3), (q2, q3) = self.projection[:, 2:].tolist()
        w = 1 - z
        return (q3 - p3 - 2 * q3 * w) / (q2 - p2 - 2 * q2 * w)


def consumers(prop: Any) -> list[Any]:
    """Return the renderers that show a prop, the assemblies that it is a part of, and theirs."""
    found, props = [], [] if prop is None else [prop]
    for each in props:
        for i in range(each.GetNumberOfConsumers()):
            consumer = each.GetConsumer(i)
            if consumer is not None:
                found.append(consumer)
                if consumer.IsA("vtkProp") and consumer not in props:
                    props.append(consumer)
    return found


def planes_of(mapper: Any) -> list[list[float]]:
    """Return origin and normal of each clipping plane of a mapper, world coordinates."""
    planes = mapper.GetClippingPlanes()
    there = () if planes is None else map(planes.GetItem, range(planes.GetNumberOfItems()))
    return [[*plane.GetOrigin(), *plane.GetNormal()] for plane in there]


def viewport(renderer: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return OpenGL's viewport while a renderer draws: lower left corner and size, pixels."""
    values = [0, 0, 0, 0]
    renderer.GetRenderWindow().GetState().vtkglGetIntegerv(_GL_VIEWPORT, values)
    x, y, width, height = values
    return (x, y), (width, height)


def tiled(renderer: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return lower left corner and size of what a renderer fills of its window, pixels."""
    width, height, x, y = [0], [0], [0], [0]
    renderer.GetTiledSizeAndOrigin(width, height, x, y)
    return (x[0], y[0]), (width[0], height[0])


def depths_of(to_view: Matrix, bounds: tuple[float, ...]) -> tuple[float, float]:
    """Return the least and the largest view depth of a box that a matrix brings to view space."""
    corners = bounds_corners(bounds)
    depth = -(corners @ to_view[2, :3] + to_view[2, 3])
    return float(depth.min()), float(depth.max())


def view_of(composite: Matrix, aspect: float, backward: Matrix) -> tuple[Matrix, dict[str, Any]]:
    """Split a projection matrix into a rigid transform and a lens.

    Whatever VTK put into the matrix (one eye of a stereo pair, a tile of a screenshot, a window
    centre, an off-axis or explicit projection) is in what is drawn, so the frame's view is taken
    from the matrix, ``composite``, world to normalised device coordinates, and not from the
    camera's settings. In parallel projection it does not tell where depth begins: ``backward``,
    world to the z of view coordinates, (4,), does. ``aspect`` is that of the viewport in pixels.

    Returns world to view coordinates (x right, y up, z backward), (4, 4), rotation and translation
    with whatever scale or shear is left in it, and the lens of a :class:`Camera` at the origin that
    looks along -z.
    """
    across, up, denominator = composite[0], composite[1], composite[3]
    scale = np.linalg.norm(denominator[:3])
    to_view = np.eye(4)
    if scale == 0.0:
        half = 1.0 / np.linalg.norm(up[:3] / denominator[3])
        to_view[0] = across / denominator[3] * half * aspect
        to_view[1] = up / denominator[3] * half
        to_view[2] = backward
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


def opaque_depth(frames: Sequence[Frame]) -> Image | None:
    """Return the depth of what may hide VDIs in the frame that is being drawn; ``None``: nothing.

    Window depth, float32 (H, W), top row first; 1 where nothing is. Nothing is read where nothing
    opaque is before the VDIs, and outside their rectangles on the screen.
    """
    frame = frames[0]
    rectangles = [r for own in frames if (r := own.rectangle(own.bounds)) is not None]
    if not rectangles or not _is_before(frames):
        return None
    low = np.floor(np.min([r[0] for r in rectangles], axis=0)).astype(int) - _MARGIN
    high = np.ceil(np.max([r[1] for r in rectangles], axis=0)).astype(int) + _MARGIN
    low, high = np.maximum(low, 0), np.minimum(high, frame.size)
    if (low >= high).any():
        return None
    (left, bottom), (right, top) = low.tolist(), high.tolist()

    # Read window depth, bottom row first
    window, bound = frame.renderer.GetRenderWindow(), [0]
    window.GetState().vtkglGetIntegerv(_GL_DRAW_FRAMEBUFFER_BINDING, bound)
    corner, size = (frame.origin[0] + left, frame.origin[1] + bottom), (right - left, top - bottom)
    if bound[0] == window.GetRenderFramebuffer().GetFBOIndex():
        values, last = vtkFloatArray(), (corner[0] + size[0] - 1, corner[1] + size[1] - 1)
        window.GetZbufferData(*corner, *last, values)
        z = vtk_to_numpy(values).reshape(size[::-1])
    else:
        z = _framebuffer_depth(window, corner, size)
    if z.min() >= 1.0:
        return None

    depth = np.ones(frame.size[::-1], dtype=np.float32)
    depth[frame.size[1] - top : frame.size[1] - bottom, left:right] = z[::-1]
    return depth


def ends_of_rays(frame: Frame) -> Image | None:
    """Return the view depth at which the rays of a frame end, inf where nothing hides a VDI."""
    if frame.depth is None:
        return None
    ends = aligned_empty(frame.depth.shape, np.float32)
    rows = max(1, _BLOCK // frame.size[0])
    for first in range(0, len(ends), rows):
        z = frame.depth[first : first + rows]
        ends[first : first + rows] = np.where(z < 1, frame.view_depth(z), np.inf)
    return ends


def _is_before(frames: Sequence[Frame]) -> bool:
    """Whether something opaque of a renderer may reach before the end of VDIs.

    What has no bounds counts, and so do the assemblies that are being drawn: they must not be
    asked, for an answer would end their walk through their parts. So does what a lower layer drew,
    if its depth was kept.
    """
    renderer = frames[0].renderer
    if renderer.GetPreserveDepthBuffer():
        return True
    props, drawing, farthest = renderer.GetViewProps(), None, 0.0
    for i in range(props.GetNumberOfItems()):
        prop = props.GetItemAsObject(i)
        if not prop.GetVisibility() or isinstance(prop, vtkActor2D | vtkVolume):
            continue
        if drawing is None:  # there is something else than volumes
            drawing = [thing for own in frames for thing in consumers(own.actor)]
            of = ((own.camera.model_transform, own.bounds) for own in frames)
            farthest = max(depths_of(*each)[1] for each in of)
        if prop in drawing:
            return True
        if prop.HasOpaqueGeometry():
            box = prop.GetBounds()
            known = box is not None and box[0] <= box[1]
            if not known or depths_of(frames[0].to_view, box)[0] < farthest:
                return True
    return False


def _framebuffer_depth(window: Any, corner: tuple[int, int], size: tuple[int, int]) -> Image:
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
    return z.reshape(height, width)
