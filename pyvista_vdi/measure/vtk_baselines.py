"""VTK's own volume mappers, off-screen: the outside opinion that our pictures are compared with."""

import os
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import DeviceError, InvalidArgumentError, MissingDependencyError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.imports import import_pyvista
from pyvista_vdi.vtk_pipeline import vtk

#: VTK's mappers by the names that ``Plotter.add_volume(mapper=...)`` has for them.
MAPPERS = ("gpu", "fixed_point")

#: How to get an off-screen render window.
_WINDOW_REMEDY = (
    "off-screen rendering needs EGL or OSMesa: on Debian and Ubuntu install 'libegl1 "
    "libgl1-mesa-dri' or 'libosmesa6', or leave VTK out with --no-vtk"
)


class OffScreenVolume:
    """A ``vtkVolume``, or what is one, in an off-screen window, over black.

    ``name`` says in messages who draws it. Without VTK or an off-screen window
    MissingDependencyError names the system packages.
    """

    def __init__(self, name: str, actor: Any, window_size: tuple[int, int]) -> None:
        self.name = name
        self._window = _off_screen_window(check_window_size(window_size))
        self._renderer = vtk.vtkRenderer()
        self._renderer.SetBackground(0, 0, 0)
        self._window.AddRenderer(self._renderer)
        self._volume = actor
        self._renderer.AddVolume(actor)

    @property
    def renderer(self) -> Any:
        """The ``vtkRenderer``, whose lights shine on a shaded volume: a headlight by default."""
        return self._renderer

    @property
    def opengl(self) -> str:
        """OpenGL renderer and version, as the driver reports them."""
        self._window.Render()
        lines = self._window.ReportCapabilities().splitlines()
        wanted = ("OpenGL renderer string", "OpenGL version string")
        found = [line.split(":", 1)[1].strip() for line in lines if line.startswith(wanted)]
        return ", ".join(found) or self._window.GetClassName()

    def render(self, camera: Camera) -> None:
        """Draw a frame and wait until it is finished; nothing is read back."""
        from pyvista_vdi.vtk_pipeline.filters.view import aim

        aim(self._renderer.GetActiveCamera(), camera, camera.model_transform)
        matrix = vtk.vtkMatrix4x4()
        matrix.DeepCopy(camera.model_transform.ravel().tolist())
        self._volume.SetUserMatrix(matrix)
        self._renderer.ResetCameraClippingRange()
        self._window.Render()
        self._window.WaitForCompletion()

    def image(self, camera: Camera) -> NDArray[np.float32]:
        """Return a frame: RGB over black, float32 (H, W, 3), top row first, in steps of 1/255.

        A blank one, in which VTK has drawn nothing, raises DeviceError.
        """
        self.render(camera)
        width, height = self._window.GetSize()
        pixels = vtk.vtkUnsignedCharArray()
        # Of the left eye; what has been drawn lies in the back buffer, off-screen as well
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        bottom_up = vtk.vtk_to_numpy(pixels).reshape(height, width, 3)
        if not bottom_up.any():
            raise DeviceError(
                f"{self.name} drew nothing: every pixel is black; check that the "
                "transfer function is not transparent and that OpenGL works "
                f"({self._window.GetClassName()})"
            )
        return bottom_up[::-1].astype(np.float32) / np.float32(255)

    def close(self) -> None:
        """Release the window and its graphics resources."""
        self._window.RemoveRenderer(self._renderer)
        self._window.Finalize()


class VTKBaseline(OffScreenVolume):
    """One volume in one of VTK's mappers, "gpu" or "fixed_point", in an off-screen window.

    ``sample_distance`` is the length of a step along the ray, world units; VTK does not adjust it.
    The framebuffer has eight bits per channel, so a picture is within half of 1/255 of what VTK
    computed. Its rays start half a step from ours at most; at converged steps this is invisible.
    """

    def __init__(
        self,
        volume: Volume,
        volume_property: Any,
        window_size: tuple[int, int],
        mapper: str,
        sample_distance: float,
    ) -> None:
        if mapper not in MAPPERS:
            raise InvalidArgumentError(f"mapper must be one of {MAPPERS}; got {mapper!r}")
        from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image

        actor = vtk.vtkVolume()
        opengl = vtk.vtkRenderingVolumeOpenGL2  # without it the other mapper crashes, too
        if mapper == "gpu":
            self._mapper = opengl.vtkOpenGLGPUVolumeRayCastMapper()
            self._mapper.SetUseJittering(False)
        else:
            self._mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        self._mapper.SetAutoAdjustSampleDistances(False)
        self._mapper.SetLockSampleDistanceToInputSpacing(False)
        self.set_image_sample_distance(1.0)
        self._mapper.SetInputData(volume_to_image(volume))
        self.set_sample_distance(sample_distance)
        actor.SetMapper(self._mapper)
        actor.SetProperty(volume_property)
        super().__init__(f"VTK's {mapper} mapper", actor, window_size)

    def set_sample_distance(self, sample_distance: float) -> None:
        """Set the length of a step along the ray, world units."""
        self._mapper.SetSampleDistance(sample_distance)

    def set_image_sample_distance(self, distance: float) -> None:
        """Cast a ray for every so many pixels along each edge."""
        self._mapper.SetImageSampleDistance(distance)


def property_from_transfer_function(volume: Volume, table: TransferFunction) -> Any:
    """Return the ``vtkVolumeProperty`` with which VTK draws a volume as our raycaster does.

    ``table`` is without shading and gradient opacity; the property has a node at each entry.
    """
    color, prop = vtk.vtkColorTransferFunction(), vtk.vtkVolumeProperty()
    opacity = vtk.vtkPiecewiseFunction()
    low, high = table.scalar_range
    n = len(table.opacities)
    color.BuildFunctionFromTable(low, high, n, table.colors.astype(np.float64).ravel())
    opacity.BuildFunctionFromTable(low, high, n, table.opacities.astype(np.float64))
    prop.SetColor(color)
    prop.SetScalarOpacity(opacity)
    prop.SetScalarOpacityUnitDistance(table.unit_distance or volume.default_unit_distance)
    prop.SetInterpolationType(table.interpolation == "linear")  # VTK_NEAREST_INTERPOLATION is 0
    return prop


def add_volume_property(volume: Volume, arguments: Mapping[str, Any]) -> Any:
    """Return the property that ``Plotter.add_volume`` makes of arguments and ``interpolation``."""
    pv = import_pyvista()
    from pyvista_vdi.plotting.convert import to_image_data

    arguments = dict(arguments)
    interpolation = arguments.pop("interpolation", "nearest")
    # VTK warns that there is no X server while it looks for a window that can do without
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=True)
    try:
        grid = to_image_data(volume)
        prop = plotter.add_volume(grid, show_scalar_bar=False, render=False, **arguments).prop
    finally:
        plotter.close()
    prop.SetInterpolationType(interpolation == "linear")  # VTK_NEAREST_INTERPOLATION is 0
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
    raise MissingDependencyError(f"VTK finds no OpenGL to render with: {_WINDOW_REMEDY}")
