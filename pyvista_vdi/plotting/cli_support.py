"""What the command line and the comparison need of PyVista: a reader, a property, a window."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pyvista_vdi.errors import MissingDependencyError, VDIWarning
from pyvista_vdi.io import write_png
from pyvista_vdi.plotting.convert import to_image_data

if TYPE_CHECKING:
    from pyvista_vdi.model.vdi import VDI
    from pyvista_vdi.model.volume import Volume


def read_volume(path: str | os.PathLike[str]) -> Any:
    """Read a volume by PyVista's readers: see :func:`.volume_files.read_volume`.

    Parameters
    ----------
    path : path-like
        A file, or a folder of DICOM slices.

    Returns
    -------
    pyvista.ImageData
        The grid with its arrays.

    Raises
    ------
    MissingDependencyError
        If PyVista is not installed.
    """
    _pyvista()
    from pyvista_vdi.plotting.volume_files import read_volume as read

    return read(path)


def add_volume_property(volume: Volume, arguments: Mapping[str, Any]) -> Any:
    """Return the property that ``Plotter.add_volume`` makes of some arguments.

    Parameters
    ----------
    volume : Volume
        What would be added.
    arguments : mapping
        Arguments of ``add_volume``; and ``interpolation``, ``"nearest"`` or ``"linear"``.

    Returns
    -------
    vtkVolumeProperty
        Not connected to any plotter.
    """
    pv = _pyvista()
    arguments = dict(arguments)
    interpolation = arguments.pop("interpolation", "nearest")
    # VTK warns that there is no X server while it looks for a window that can do without
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=True)
    try:
        grid = to_image_data(volume)
        actor = plotter.add_volume(grid, show_scalar_bar=False, render=False, **arguments)
        prop = actor.prop
    finally:
        plotter.close()
    if interpolation == "linear":
        prop.SetInterpolationTypeToLinear()
    else:
        prop.SetInterpolationTypeToNearest()
    return prop


def show(
    vdi: VDI,
    window_size: tuple[int, int] | None = None,
    screenshot: str | None = None,
    **options: Any,
) -> None:
    """Open a plotter that shows a VDI from its own view, or write what it shows.

    Parameters
    ----------
    vdi : VDI
        What is shown.
    window_size : (int, int), optional
        Width and height of the window in pixels; the VDI's own by default.
    screenshot : str, optional
        File to write instead of opening a window.
    **options
        Keyword arguments of ``add_vdi``.

    Raises
    ------
    VDIError, KeyboardInterrupt
        If the picture cannot be drawn or is interrupted; no file is written then.
    """
    pv = _pyvista()
    view, size = vdi.camera, window_size or vdi.window_size
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=screenshot is not None, window_size=list(size))
    try:
        actor = plotter.add_vdi(vdi, **options)
        camera = plotter.camera
        camera.position, camera.focal_point, camera.up = (
            view.position,
            view.focal_point,
            view.view_up,
        )
        camera.SetUseHorizontalViewAngle(view.use_horizontal_view_angle)
        camera.view_angle = view.view_angle
        camera.parallel_projection = view.parallel_projection
        camera.parallel_scale = view.parallel_scale
        camera.SetWindowCenter(*view.window_center)
        plotter.renderer.reset_camera_clipping_range()
        if screenshot is None:
            plotter.show()
            return
        with warnings.catch_warnings():
            # The error itself is raised below
            warnings.filterwarnings("ignore", "the VDI cannot be drawn", VDIWarning)
            warnings.filterwarnings("ignore", "generating the VDI was interrupted", VDIWarning)
            picture = plotter.screenshot(return_img=True)
        actor.mapper.painter.raise_trouble()
        write_png(np.asarray(picture), screenshot)
    finally:
        plotter.close()


def _pyvista() -> Any:
    try:
        import pyvista as pv
    except ImportError as error:
        from pyvista_vdi.measure.vtk_baselines import explain_import_error

        if error.name == "pyvista":
            raise MissingDependencyError(
                'PyVista is not installed: install it by pip install "pyvista-vdi[plot]"'
            ) from error
        raise explain_import_error(error) from error
    return pv
