"""What ParaView's tests do inside ParaView: ``pvpython inside.py CASE FOLDER [more]``.

Each case writes what it made into FOLDER; test_plugin.py, in its own Python, judges it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from paraview import simple
from vtkmodules.util.numpy_support import vtk_to_numpy

import pyvista_vdi

SIZE = (240, 180)
#: Every third voxel of the shipped brain, along each axis.
STEP = 3
AZIMUTH = 15.0
#: Scalar, red, green, blue: linear in RGB; and scalar, opacity, midpoint, sharpness.
COLORS = [0.0, 0.1, 0.0, 0.4, 60.0, 0.9, 0.4, 0.2, 133.0, 1.0, 1.0, 0.8]
OPACITIES = [0.0, 0.0, 0.5, 0.0, 20.0, 0.0, 0.5, 0.0, 133.0, 0.8, 0.5, 0.0]
UNIT_DISTANCE = 10.0


def brain():
    """Return the volume, and ParaView's transfer functions of its array."""
    path = Path(pyvista_vdi.__file__).parent / "data" / "brain_colin27_181x217x181_u8.nrrd"
    reader = simple.OpenDataFile(str(path))
    volume = simple.ExtractSubset(Input=reader)
    volume.VOI = [0, 180, 0, 216, 0, 180]
    volume.SampleRateI = volume.SampleRateJ = volume.SampleRateK = STEP
    volume.UpdatePipeline()
    return volume, *functions()


def functions():
    color = simple.GetColorTransferFunction("ImageScalars")
    color.ColorSpace = "RGB"
    color.RGBPoints = COLORS
    color.ScalarRangeInitialized = 1
    opacity = simple.GetOpacityTransferFunction("ImageScalars")
    opacity.Points = OPACITIES
    return color, opacity


def brain_source(volume=None):
    volume, color, opacity = brain() if volume is None else (volume, *functions())
    source = simple.VDISource(Input=volume, ColorFunction=color, OpacityFunction=opacity)
    source.WindowSize = SIZE
    source.ScalarOpacityUnitDistance = UNIT_DISTANCE
    return source


def black_view(size):
    view = simple.CreateRenderView(ViewSize=list(size))
    view.UseColorPaletteForBackground = 0
    view.Background = [0, 0, 0]
    view.OrientationAxesVisibility = 0
    view.UseFXAA = 0  # it smooths edges of the finished picture
    return view


def show_picture(picture, size):
    """Show a VDIToImage so that its pixels are the view's."""
    width, height = size
    view = black_view(size)
    shown = simple.Show(picture, view, "UniformGridRepresentation")
    shown.Representation = "Slice"
    simple.ColorBy(shown, ("POINTS", "RGBA"))
    shown.MapScalars = 0
    view.CameraParallelProjection = 1
    view.CameraParallelScale = height / 2
    view.CameraFocalPoint = [(width - 1) / 2, (height - 1) / 2, 0]
    view.CameraPosition = [(width - 1) / 2, (height - 1) / 2, 1000]
    return view


def show_volume(source, view):
    """Show the volume of a source by ParaView itself, by the same transfer functions."""
    shown = simple.Show(source.Input, view, "UniformGridRepresentation")
    shown.Representation = "Volume"
    simple.ColorBy(shown, ("POINTS", "ImageScalars"))
    shown.LookupTable = source.ColorFunction
    shown.ScalarOpacityFunction = source.OpacityFunction
    shown.ScalarOpacityUnitDistance = UNIT_DISTANCE
    shown.SetScalarBarVisibility(view, False)


def take_view(source, view):
    view.CameraPosition = [380, -330, 300]
    view.CameraFocalPoint = [90, 108, 90]
    view.CameraViewUp = [0, 0, 1]
    view.CameraViewAngle = 28
    simple.SetActiveView(view)
    simple.Render(view)
    source.SMProxy.InvokeCommand("TakeActiveView")


def fetched(proxy):
    return simple.servermanager.Fetch(proxy)


def save_pixels(picture, path):
    array = fetched(picture).GetPointData().GetArray("premultiplied")
    np.save(path, vtk_to_numpy(array))


def pipeline(folder):
    """Read, generate, write, read, picture, screenshot, states."""
    scene = {
        "size": SIZE,
        "step": STEP,
        "azimuth": AZIMUTH,
        "colors": COLORS,
        "opacities": OPACITIES,
        "unit distance": UNIT_DISTANCE,
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    source = brain_source()
    simple.SaveData(str(folder / "brain.vdi"), source)
    simple.SaveData(str(folder / "small.vdi"), source, Precision="8-byte", Compression="zstd")
    reader = simple.OpenDataFile(str(folder / "brain.vdi"))
    simple.SaveData(str(folder / "again.vdi"), reader)
    picture = simple.VDIToImage(Input=source, Azimuth=AZIMUTH)
    view = show_picture(picture, SIZE)
    simple.SaveScreenshot(str(folder / "picture.png"), view, ImageResolution=SIZE)
    save_pixels(picture, folder / "pixels.npy")
    simple.SaveState(str(folder / "state.pvsm"))


def load(folder, name):
    """Load a state in a fresh ParaView."""
    simple.LoadState(str(folder / name))
    view = simple.GetRenderViews()[0]
    view.UseFXAA = 0  # no part of ParaView's states
    simple.SaveScreenshot(str(folder / f"{name}.png"), view, ImageResolution=SIZE)
    (picture,) = (s for (n, _), s in simple.GetSources().items() if n.startswith("VDIToImage"))
    save_pixels(picture, folder / f"{name}.npy")


def volume(folder):
    """Draw the volume by ParaView and by a VDI, from the view on the screen."""
    source = brain_source()
    view = black_view(SIZE)
    show_volume(source, view)
    take_view(source, view)
    simple.SaveScreenshot(str(folder / "volume.png"), view, ImageResolution=SIZE)
    picture = simple.VDIToImage(Input=source)
    flat = show_picture(picture, SIZE)
    simple.SaveScreenshot(str(folder / "vdi.png"), flat, ImageResolution=SIZE)


def mistakes(folder):
    """Do what cannot be done; ParaView says why, and goes on."""
    source = simple.VDISource(Input=simple.Wavelet())
    source.WindowSize = [30, 20]
    source.View = "Camera"
    source.CameraPosition = source.CameraFocalPoint = [1, 2, 3]
    source.UpdatePipeline()
    empty = source.GetDataInformation().GetNumberOfPoints()
    clipped = simple.VDISource(Input=simple.Clip(Input=source.Input))
    clipped.UpdatePipeline()
    source.View = 0
    source.UpdatePipeline()
    full = source.GetDataInformation().GetNumberOfPoints()
    simple.VDIToImage(Input=source.Input).UpdatePipeline()
    simple.VDIReader(FileName=str(folder / "absent.vdi")).UpdatePipeline()
    simple.SaveData(str(folder / "no folder" / "x.vdi"), source)
    (folder / "mistakes.json").write_text(json.dumps([empty, full]))


if __name__ == "__main__":
    case, where, *more = sys.argv[1:]
    globals()[case](Path(where), *more)
    print("all well")
