"""The textures of a VDI's actor: the image that its shader looks up, and no depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import VTK_FLOAT
from vtkmodules.vtkRenderingOpenGL2 import vtkTextureObject

from pyvista_vdi.errors import DeviceError

#: Window depth of nothing: 1 is the far plane.
_FAR = np.ones(1, dtype=np.float32)


class ImageTexture:
    """Made with the first image, and again in another window."""

    def __init__(self) -> None:
        self._texture: Any = None
        self._uploaded: int | None = None

    def show(
        self, window: Any, image: NDArray[np.float32], number: int | None, *, smooth: bool
    ) -> None:
        """Bind an image for the shader, in the window's context, which is current.

        ``image`` is RGBA, float32 (H, W, 4), its rows in the order that the shader takes them in.
        Where ``number`` is that of last time it is not uploaded again. With ``smooth`` texels are
        interpolated linearly: a full frame's texels are the pixels. DeviceError is raised if OpenGL
        binds it where the shader does not look.
        """
        if self._texture is None:
            self._texture = vtkTextureObject()
            self._texture.SetWrapS(vtkTextureObject.ClampToEdge)
            self._texture.SetWrapT(vtkTextureObject.ClampToEdge)
        texture = self._texture
        if texture.GetContext() is not window:
            texture.SetContext(window)
            self._uploaded = None
        kind = vtkTextureObject.Linear if smooth else vtkTextureObject.Nearest
        texture.SetMinificationFilter(kind)
        texture.SetMagnificationFilter(kind)
        if number is None or number != self._uploaded or texture.GetHandle() == 0:
            height, width = image.shape[:2]
            texture.Create2DFromRaw(width, height, 4, VTK_FLOAT, image)
            self._uploaded = number
        texture.Activate()
        # The sampler of the actor's shader keeps its default, unit 0: see actor.py
        if texture.GetTextureUnit() != 0:
            unit = texture.GetTextureUnit()
            texture.Deactivate()
            raise DeviceError(
                f"OpenGL gave its image texture unit {unit} in place of 0; another object leaves "
                "a texture active"
            )

    def let_go(self) -> None:
        """Give the texture unit back."""
        if self._texture is not None:
            self._texture.Deactivate()

    def release(self) -> None:
        """Free the texture."""
        if self._texture is not None:
            window = self._texture.GetContext()
            if window is not None:
                self._texture.ReleaseGraphicsResources(window)
        self._texture = self._uploaded = None


class NoDepth:
    """A depth texture of one texel, in place of the copy of the depth buffer that VTK would make.

    VTK's volume mapper copies the whole depth buffer in each frame, for the ray caster that our
    shader replaces: under MSAA that takes longer than to draw the image.
    """

    def __init__(self) -> None:
        self._texture: Any = None

    def show(self, window: Any, mapper: Any) -> None:
        """Give it to a mapper for the frame that begins; the image's texture is active already."""
        if self._texture is None:
            self._texture = vtkTextureObject()
        texture = self._texture
        if texture.GetContext() is not window:
            texture.SetContext(window)
        if texture.GetHandle() == 0:
            texture.CreateDepthFromRaw(1, 1, vtkTextureObject.Float32, VTK_FLOAT, _FAR)
        mapper.SetSharedDepthTexture(texture)
        texture.Activate()

    def let_go(self) -> None:
        """Give the texture unit back."""
        if self._texture is not None:
            self._texture.Deactivate()

    def release(self) -> None:
        """Free it. The mapper keeps the object, which the next frame fills anew."""
        window = None if self._texture is None else self._texture.GetContext()
        if window is not None:
            self._texture.ReleaseGraphicsResources(window)
