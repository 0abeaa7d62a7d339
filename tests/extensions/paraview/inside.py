"""What ParaView's tests do inside ParaView: ``pvpython inside.py CASE FOLDER [more]``.

Each case writes what it made into FOLDER; test_plugin.py, in its own Python, judges it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from paraview import simple, smstate
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataObject

import pyvista_vdi
from pyvista_vdi.vtk_pipeline import vdi_from_image

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


def functions_of(array):
    return simple.GetColorTransferFunction(array), simple.GetOpacityTransferFunction(array)


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


def show_picture(picture, size, representation="Slice"):
    """Show a VDIToImage so that its pixels are the view's."""
    width, height = size
    view = black_view(size)
    shown = simple.Show(picture, view, "UniformGridRepresentation")
    shown.Representation = representation
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


def devices(folder):
    """Say which devices ParaView's Python finds."""
    found = [[info.platform, info.usable] for info in pyvista_vdi.list_devices()]
    (folder / "devices.json").write_text(json.dumps(found))


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
    (folder / "state.py").write_text(smstate.get_state())


def load(folder, name):
    """Load a state in a fresh ParaView."""
    path = folder / name
    if path.suffix == ".py":
        exec(compile(path.read_text(), str(path), "exec"), {})
    else:
        simple.LoadState(str(path))
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
    simple.SaveData(str(folder / "screen.vdi"), source)


def deferred(folder):
    """Edit the colours and opacities of values, from a file and from a source of them."""
    asked = json.loads((folder / "asked.json").read_text())
    reader = simple.OpenDataFile(str(folder / "kept.vdi"))
    simple.SaveData(str(folder / "again.vdi"), reader)
    picture = simple.VDIToImage(Input=reader)
    picture.UpdatePipeline()
    # What the colour map editor edits
    table, opacity = functions_of("v")
    found = {"range": [table.RGBPoints[0], table.RGBPoints[-4]]}
    table.ColorSpace = "RGB"

    source = brain_source()
    source.ColorFunction, source.OpacityFunction = table, opacity
    source.Classification = "deferred"
    source.ValueRange = [20, 133]
    simple.SaveData(str(folder / "source.vdi"), source)
    made = source.GetClientSideObject().GetOutputDataObject(0).GetMTime()
    of_source = simple.VDIToImage(Input=source)
    of_source.ColorFunction, of_source.OpacityFunction = table, opacity
    for i, look in enumerate(asked["looks"]):
        table.RGBPoints, opacity.Points = look
        for name, image in (("file", picture), ("source", of_source)):
            image.UpdatePipeline()
            save_pixels(image, folder / f"{name}_{i}.npy")
    found["idle"] = source.GetClientSideObject().GetOutputDataObject(0).GetMTime() == made
    (folder / "found.json").write_text(json.dumps(found))


def in_time(folder):
    """Return the source of a volume in several files, a time step each."""
    volume = simple.OpenDataFile([str(folder / f"ball_{step}.vti") for step in range(3)])
    source = simple.VDISource(Input=volume, WindowSize=SIZE, ScalarOpacityUnitDistance=0.2)
    source.ColorFunction = simple.GetColorTransferFunction("v")
    source.OpacityFunction = simple.GetOpacityTransferFunction("v")
    source.ColorFunction.RGBPoints = [0.0, 0.0, 0.2, 1.0, 255.0, 1.0, 0.5, 0.0]
    source.ColorFunction.ColorSpace = "RGB"
    source.OpacityFunction.Points = [0.0, 0.0, 0.5, 0.0, 255.0, 0.8, 0.5, 0.0]
    return source


def settings(folder):
    """Say what the properties became, and what a change of them did."""
    scalars, color, _ = brain()
    source = simple.VDISource(Input=scalars)  # it follows the array's functions
    source.WindowSize = [60, 40]
    client = source.SMProxy.GetClientSideObject()
    progress, found = [], {}
    client.AddObserver("ProgressEvent", lambda caller, event: progress.append(caller.GetProgress()))

    source.UpdatePipeline()
    found["progress"] = len(progress) > 0 and progress[-1] == 1.0
    made = client.GetOutputDataObject(0).GetMTime()
    source.UpdatePipeline()
    found["idle"] = client.GetOutputDataObject(0).GetMTime() == made  # nothing was done again
    found["points before"] = fetched(source).GetNumberOfPoints()

    picture = simple.VDIToImage(Input=source)
    picture.UpdatePipeline()
    colored = fetched(picture).GetPointData().GetArray("premultiplied").GetRange(2)[1]
    color.RGBPoints = [0.0, 1.0, 0.0, 0.0, 133.0, 1.0, 0.0, 0.0]
    picture.UpdatePipeline()
    red = fetched(picture).GetPointData().GetArray("premultiplied").GetRange(2)[1]
    found["blue"] = [colored, red]

    source.MaxSupersegments = 3
    source.Shade = 1
    source.InterpolationType = "Nearest"
    source.Coverage = "bounds"
    source.View = "Camera"
    source.CameraPosition = [90, -200, 90]
    source.CameraFocalPoint = [90, 108, 90]
    source.CameraViewUp = [0, 0, 1]
    source.CameraParallelProjection = 1
    source.CameraParallelScale = 50
    source.Azimuth = 90
    source.UpdatePipeline()
    vdi = vdi_from_image(fetched(source))
    found["metadata"] = vdi.metadata
    found["longest"] = int(vdi.counts.max())
    found["camera"] = vdi.camera.to_dict()
    found["window"] = vdi.window_size
    (folder / "settings.json").write_text(json.dumps(found))


def animation(folder):
    """Show the steps of a series as pictures, as the animation's time goes."""
    reader = simple.OpenDataFile(str(folder / "ball.vdis"))
    picture = simple.VDIToImage(Input=reader, Azimuth=20)
    view = black_view(SIZE)
    shown = simple.Show(picture, view)
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    found = {
        "reader": reader.SMProxy.GetXMLName(),
        "times": list(reader.TimestepValues),
        "scene": list(scene.TimeKeeper.TimestepValues),
        "picture": [shown.Representation.GetData(), list(shown.ColorArrayName), shown.MapScalars],
        "shown": [],
    }
    for i, time in enumerate(json.loads((folder / "times.json").read_text())):
        scene.AnimationTime = time
        simple.Render(view)
        save_pixels(picture, folder / f"picture_{i}.npy")
        data = reader.GetClientSideObject().GetOutputDataObject(0).GetInformation()
        found["shown"].append(data.Get(vtkDataObject.DATA_TIME_STEP()))
    shown.MapScalars = 1  # stays as it is set
    simple.Show(reader, simple.CreateRenderView())
    found["set by hand"] = shown.MapScalars
    (folder / "animation.json").write_text(json.dumps(found))


def temporal(folder):
    """Make VDIs of a volume in several files, a time step each, as the animation goes."""
    source = in_time(folder)
    view = black_view(SIZE)
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = (5, 4, 3), (0, 0, 0), (0, 0, 1)
    simple.SetActiveView(view)
    source.SMProxy.InvokeCommand("TakeActiveView")
    for time in (2, 0, 1):
        source.UpdatePipeline(time)
        simple.SaveData(str(folder / f"made_{time}.vdi"), source)


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


def arrays(folder):
    """Use ParaView's own NumPy interface beside ours."""
    wavelet = simple.Wavelet()
    results = []
    for proxy in (
        simple.PythonCalculator(Input=wavelet, Expression="mag(gradient(RTData))"),
        simple.ProgrammableFilter(
            Input=wavelet, Script="output.PointData.append(inputs[0].PointData['RTData'], 'result')"
        ),
    ):
        proxy.UpdatePipeline()
        results.append(proxy.PointData["result"].GetRange())
    found = {"numpy": np.__version__, "from": np.__file__, "results": results}
    (folder / "arrays.json").write_text(json.dumps(found))


if __name__ == "__main__":
    case, where, *more = sys.argv[1:]
    globals()[case](Path(where), *more)
    print("all well")
