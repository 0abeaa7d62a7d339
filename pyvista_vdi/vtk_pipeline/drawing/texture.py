"""The textures of a VDI's actor: the image that its shader looks up, and no depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.vtk_pipeline.vtk import VTK_FLOAT, vtkTextureObject


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
