"""VTK's own volume mappers, off-screen: the outside opinion that our pictures are compared with."""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import DeviceError, InvalidArgumentError, MissingDependencyError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.vtk_pipeline import vtk

#: VTK's mappers by the names that ``Plotter.add_volume(mapper=...)`` has for them.
MAPPERS = ("gpu", "fixed_point")


class VTKMapper:
    """One volume in one of VTK's mappers, "gpu" or "fixed_point", in an off-screen window.

    Steps along the ray are as long as they are said to be, world units. The framebuffer has eight
    bits per channel, so a picture is within half of 1/255 of what VTK computed. Its rays start half
    a step from ours at most; at converged steps this is invisible. Without an off-screen window
    MissingDependencyError names the system packages.
    """

    def __init__(
        self, volume: Volume, volume_property: Any, window_size: tuple[int, int], mapper: str
    ) -> None:
        if mapper not in MAPPERS:
            raise InvalidArgumentError(f"mapper must be one of {MAPPERS}; got {mapper!r}")
        from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image

        self.name = mapper
        self._window = _off_screen_window(check_window_size(window_size))
        opengl = vtk.vtkRenderingVolumeOpenGL2  # without it the other mapper crashes, too
        if mapper == "gpu":
            self._mapper = opengl.vtkOpenGLGPUVolumeRayCastMapper()
            self._mapper.SetUseJittering(False)
        else:
            self._mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        self._mapper.SetAutoAdjustSampleDistances(False)
        self._mapper.SetLockSampleDistanceToInputSpacing(False)
        self._mapper.SetImageSampleDistance(1.0)
        self._mapper.SetInputData(volume_to_image(volume))
        self._volume = vtk.vtkVolume()
        self._volume.SetMapper(self._mapper)
        self._volume.SetProperty(volume_property)
        #: Its lights shine on a shaded volume: a headlight by default.
        self.renderer = vtk.vtkRenderer()
        self.renderer.SetBackground(0, 0, 0)
        self.renderer.AddVolume(self._volume)
        self._window.AddRenderer(self.renderer)

    @property
    def opengl(self) -> str:
        """OpenGL renderer and version, as the driver reports them."""
        self._window.Render()
        lines = self._window.ReportCapabilities().splitlines()
        wanted = ("OpenGL renderer string", "OpenGL version string")
        return ", ".join(line.split(":", 1)[1].strip() for line in lines if line.startswith(wanted))

    def render(self, camera: Camera, sample_distance: float) -> None:
        """Draw a frame and wait until it is finished; nothing is read back."""
        self._mapper.SetSampleDistance(sample_distance)
        from pyvista_vdi.vtk_pipeline.filters.view import aim

        aim(self.renderer.GetActiveCamera(), camera, camera.model_transform)
        matrix = vtk.vtkMatrix4x4()
        matrix.DeepCopy(camera.model_transform.ravel().tolist())
        self._volume.SetUserMatrix(matrix)
        self.renderer.ResetCameraClippingRange()
        self._window.Render()
        self._window.WaitForCompletion()

    def image(self, camera: Camera, sample_distance: float) -> NDArray[np.float32]:
        """Return a frame: RGB over black, float32 (H, W, 3), top row first, in steps of 1/255.

        A blank one, in which VTK has drawn nothing, raises DeviceError.
        """
        self.render(camera, sample_distance)
        width, height = self._window.GetSize()
        pixels = vtk.vtkUnsignedCharArray()
        # Of the left eye; what has been drawn lies in the back buffer, off-screen as well
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        bottom_up = vtk.vtk_to_numpy(pixels).reshape(height, width, 3)
        if not bottom_up.any():
            raise DeviceError(
                f"VTK's {self.name} mapper drew nothing: every pixel is black; check that the "
                "transfer function is not transparent and that OpenGL works "
                f"({self._window.GetClassName()})"
            )
        return bottom_up[::-1].astype(np.float32) / np.float32(255)

    def close(self) -> None:
        """Release the window and its graphics resources."""
        self._window.RemoveRenderer(self.renderer)
        self._window.Finalize()


def property_of(volume: Volume, table: TransferFunction) -> Any:
    """Return the ``vtkVolumeProperty`` with which VTK draws a volume as our raycaster does."""
    color, prop = vtk.vtkColorTransferFunction(), vtk.vtkVolumeProperty()
    opacity, gradient = vtk.vtkPiecewiseFunction(), vtk.vtkPiecewiseFunction()
    # A node at each entry
    low, high = table.scalar_range
    n = len(table.opacities)
    color.BuildFunctionFromTable(low, high, n, table.colors.astype(np.float64).ravel())
    opacity.BuildFunctionFromTable(low, high, n, table.opacities.astype(np.float64))
    prop.SetColor(color)
    prop.SetScalarOpacity(opacity)
    # An RGBA volume has its opacity, and the distance that this is meant for, as component 3
    prop.SetIndependentComponents(not volume.rgba)
    distance = table.unit_distance or volume.default_unit_distance
    prop.SetScalarOpacityUnitDistance(3 if volume.rgba else 0, distance)
    prop.SetInterpolationType(table.interpolation == "linear")  # VTK_NEAREST_INTERPOLATION is 0
    if table.gradient_opacities is not None and table.gradient_range is not None:
        factors = table.gradient_opacities.astype(np.float64)
        gradient.BuildFunctionFromTable(*table.gradient_range, len(factors), factors)
        prop.SetGradientOpacity(gradient)
    if table.shading is not None:
        prop.ShadeOn()
        prop.SetAmbient(table.shading.ambient)
        prop.SetDiffuse(table.shading.diffuse)
        prop.SetSpecular(table.shading.specular)
        prop.SetSpecularPower(table.shading.specular_power)
    return prop


def _off_screen_window(size: tuple[int, int]) -> Any:
    """Return an off-screen window that can draw; EGL, then OSMesa, where there is no display."""
    opengl = vtk.vtkRenderingOpenGL2
    kinds = [vtk.vtkRenderWindow]
    chosen = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    if sys.platform.startswith("linux") and not chosen and not os.environ.get("DISPLAY"):
        # Asked by name: VTK's own search tries an X server first and warns that there is none
        names = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
        kinds = [getattr(opengl, n) for n in names if hasattr(opengl, n)]
    for kind in kinds:
        window = kind()
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)
        window.SetSize(*size)
        if window.SupportsOpenGL():
            return window
    raise MissingDependencyError(
        "VTK finds no OpenGL to render with: off-screen rendering needs EGL or OSMesa: on Debian "
        "and Ubuntu install 'libegl1 libgl1-mesa-dri' or 'libosmesa6', or leave VTK out with "
        "--no-vtk"
    )
