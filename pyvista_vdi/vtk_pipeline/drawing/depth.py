"""The depth of what is opaque, read where it can hide a VDI."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Image, consumers, depths_of
from pyvista_vdi.vtk_pipeline.vtk import (
    VTK_FLOAT,
    vtk_to_numpy,
    vtkActor2D,
    vtkFloatArray,
    vtkPixelBufferObject,
    vtkTextureObject,
    vtkVolume,
)

#: Pixels around a rectangle that are read as well: a pixel is drawn where its centre is inside.
_MARGIN = 2

#: Pixels whose depth is converted at a time, so that what is in between stays in the cache.
_BLOCK = 16384

_GL_DRAW_FRAMEBUFFER_BINDING = 0x8CA6


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
