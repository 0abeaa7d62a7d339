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

#: VTK's mappers by the names that ``Plotter.add_volume(mapper=...)`` has for them.
MAPPERS = ("gpu", "fixed_point")

#: How to get an off-screen render window.
_WINDOW_REMEDY = (
    "off-screen rendering needs EGL or OSMesa: on Debian and Ubuntu install 'libegl1 "
    "libgl1-mesa-dri' or 'libosmesa6', or leave VTK out with --no-vtk"
)

#: Debian's packages of the libraries that VTK's wheels link to and do not bring.
_PACKAGES = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libXcursor.so.1": "libxcursor1",
    "libXft.so.2": "libxft2",
    "libXt.so.6": "libxt6",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
}


def explain_import_error(error: ImportError) -> MissingDependencyError:
    """Return the error that tells how to make VTK importable.

    Parameters
    ----------
    error : ImportError
        What ``import vtk`` raised.

    Returns
    -------
    MissingDependencyError
        It names the Debian package of a system library that is missing, or VTK itself.
    """
    text = str(error)
    for library, package in _PACKAGES.items():
        if library in text:
            return MissingDependencyError(
                f"VTK cannot be loaded, because the system library {library} is missing: on "
                f"Debian and Ubuntu install '{package}' (and 'libegl1 libgl1-mesa-dri' to render "
                "off-screen)"
            )
    return MissingDependencyError(
        f'VTK cannot be loaded ({text}): install it by pip install "pyvista-vdi[plot]"'
    )


class PeerRenderer:
    """One volume in one of VTK's mappers, in an off-screen window of its own.

    Parameters
    ----------
    volume : Volume
        What is drawn.
    volume_property : vtkVolumeProperty
        How it looks.
    window_size : (int, int)
        Width and height in pixels.
    mapper : {"gpu", "fixed_point"}
        ``vtkGPUVolumeRayCastMapper`` or ``vtkFixedPointVolumeRayCastMapper``.
    sample_distance : float
        Length of a step along the ray, world units; VTK does not adjust it.

    Raises
    ------
    MissingDependencyError
        If VTK or an off-screen window cannot be had; the message names the system packages.
    InvalidArgumentError
        If the mapper is unknown or cannot draw the volume.

    Notes
    -----
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
        try:
            from vtkmodules.vtkRenderingCore import vtkRenderer, vtkVolume
        except ImportError as error:
            raise explain_import_error(error) from error
        self.name = mapper
        self._window = _off_screen_window(check_window_size(window_size))
        self._renderer = vtkRenderer()
        self._renderer.SetBackground(0, 0, 0)
        self._window.AddRenderer(self._renderer)
        self._mapper = _make_mapper(mapper)
        self._mapper.SetInputData(image_from_volume(volume))
        self.set_sample_distance(sample_distance)
        self._volume = vtkVolume()
        self._volume.SetMapper(self._mapper)
        self._volume.SetProperty(volume_property)
        self._renderer.AddVolume(self._volume)

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

    def set_sample_distance(self, sample_distance: float) -> None:
        """Set the length of a step along the ray, world units."""
        self._mapper.SetSampleDistance(sample_distance)

    def render(self, camera: Camera) -> None:
        """Draw a frame and wait until it is finished; nothing is read back."""
        self._look(camera)
        self._window.Render()
        self._window.WaitForCompletion()

    def image(self, camera: Camera) -> NDArray[np.float32]:
        """Draw a frame and read it.

        Parameters
        ----------
        camera : Camera
            The view.

        Returns
        -------
        numpy.ndarray
            RGB over black, float32 (H, W, 3), top row first, in steps of 1/255.

        Raises
        ------
        DeviceError
            If the picture is blank: VTK has drawn nothing.
        """
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        self.render(camera)
        width, height = self._window.GetSize()
        pixels = vtkUnsignedCharArray()
        front_buffer = 0  # what has been drawn lies in the back buffer, off-screen as well
        right_eye = 0
        self._window.GetPixelData(0, 0, width - 1, height - 1, front_buffer, pixels, right_eye)
        bottom_up = vtk_to_numpy(pixels).reshape(height, width, 3)
        if not bottom_up.any():
            raise DeviceError(
                f"VTK's {self.name} mapper drew nothing: every pixel is black; check that the "
                "transfer function is not transparent and that OpenGL works "
                f"({self._window.GetClassName()})"
            )
        return bottom_up[::-1].astype(np.float32) / np.float32(255)

    def close(self) -> None:
        """Release the window and its graphics resources."""
        self._window.RemoveRenderer(self._renderer)
        self._window.Finalize()

    def _look(self, camera: Camera) -> None:
        active = self._renderer.GetActiveCamera()
        active.SetPosition(camera.position)
        active.SetFocalPoint(camera.focal_point)
        active.SetViewUp(camera.view_up)
        active.SetUseHorizontalViewAngle(camera.use_horizontal_view_angle)
        active.SetViewAngle(camera.view_angle)
        active.SetParallelProjection(camera.parallel_projection)
        active.SetParallelScale(camera.parallel_scale)
        active.SetWindowCenter(*camera.window_center)
        self._volume.SetUserMatrix(_matrix(camera.model_transform))
        self._renderer.ResetCameraClippingRange()


def image_from_volume(volume: Volume) -> Any:
    """Return a volume as a ``vtkImageData`` that shares its memory.

    Parameters
    ----------
    volume : Volume
        Scalars, spacing, origin and direction.

    Returns
    -------
    vtkImageData
        The same grid; the scalars are its active point scalars.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(volume.dimensions)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin)
    image.SetDirectionMatrix(volume.direction.ravel().tolist())
    # x runs fastest in VTK's point order, as it does in a C-ordered [z, y, x] array
    scalars = numpy_to_vtk(volume.array.reshape((-1, 4) if volume.rgba else -1))
    scalars.SetName(volume.name)
    image.GetPointData().SetScalars(scalars)
    return image


def property_from_transfer_function(volume: Volume, table: TransferFunction) -> Any:
    """Return the property with which VTK's mappers draw a volume as our raycaster does.

    Parameters
    ----------
    volume : Volume
        What is drawn; it gives the unit distance where the table has none.
    table : TransferFunction
        Without shading and gradient opacity.

    Returns
    -------
    vtkVolumeProperty
        With a node at every entry of the table.

    Raises
    ------
    MissingDependencyError
        If VTK cannot be loaded.
    """
    try:
        from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
        from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolumeProperty
    except ImportError as error:
        raise explain_import_error(error) from error
    low, high = table.scalar_range
    n = len(table.opacities)
    color, opacity, prop = vtkColorTransferFunction(), vtkPiecewiseFunction(), vtkVolumeProperty()
    color.BuildFunctionFromTable(low, high, n, table.colors.astype(np.float64).ravel())
    opacity.BuildFunctionFromTable(low, high, n, table.opacities.astype(np.float64))
    prop.SetColor(color)
    prop.SetScalarOpacity(opacity)
    prop.SetScalarOpacityUnitDistance(table.unit_distance or volume.default_unit_distance)
    if table.interpolation == "linear":
        prop.SetInterpolationTypeToLinear()
    return prop


def _make_mapper(name: str) -> Any:
    try:
        from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
        from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper
    except ImportError as error:
        raise explain_import_error(error) from error
    if name == "gpu":
        gpu = vtkOpenGLGPUVolumeRayCastMapper()
        gpu.SetAutoAdjustSampleDistances(False)
        gpu.SetLockSampleDistanceToInputSpacing(False)
        gpu.SetUseJittering(False)
        gpu.SetImageSampleDistance(1.0)
        return gpu
    fixed_point = vtkFixedPointVolumeRayCastMapper()
    fixed_point.SetAutoAdjustSampleDistances(False)
    fixed_point.SetLockSampleDistanceToInputSpacing(False)
    fixed_point.SetImageSampleDistance(1.0)
    return fixed_point


def _off_screen_window(size: tuple[int, int]) -> Any:
    """Return an off-screen window that can draw; EGL, then OSMesa, where there is no display."""
    try:
        from vtkmodules import vtkRenderingOpenGL2
        from vtkmodules.vtkRenderingCore import vtkRenderWindow
    except ImportError as error:
        raise explain_import_error(error) from error
    kinds = [vtkRenderWindow]
    chosen = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    if sys.platform.startswith("linux") and not chosen and not os.environ.get("DISPLAY"):
        # Asked by name: VTK's own search tries an X server first and warns that there is none
        names = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
        kinds = [getattr(vtkRenderingOpenGL2, n) for n in names if hasattr(vtkRenderingOpenGL2, n)]
    for kind in kinds:
        window = kind()
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)
        window.SetSize(*size)
        if window.SupportsOpenGL():
            return window
    raise MissingDependencyError(f"VTK finds no OpenGL to render with: {_WINDOW_REMEDY}")


def _matrix(values: NDArray[np.float64]) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = vtkMatrix4x4()
    matrix.DeepCopy(values.ravel().tolist())
    return matrix
