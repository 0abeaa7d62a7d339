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


def scene(folder):
    """Show a VDI in a scene in place of ParaView's own volume, and take it away again."""
    source = brain_source()
    other = black_view(SIZE)
    view = black_view(SIZE)
    show_volume(source, view)
    ball = simple.Show(simple.Sphere(Center=[90, 20, 90], Radius=40), view)
    ball.Ambient, ball.Diffuse = 1, 0
    take_view(source, view)

    def shot(name, where=view):
        simple.SaveScreenshot(str(folder / f"{name}.png"), where, ImageResolution=SIZE)

    in_scene = simple.VDIInScene(Input=source)
    for name, turn in (("own", 0), ("turned", 10)):
        view.GetActiveCamera().Azimuth(turn)
        simple.Hide(in_scene, view)
        simple.Show(source.Input, view)
        shot(f"volume_{name}")
        simple.Hide(source.Input, view)
        shot(f"nothing_{name}")
        outline = simple.Show(in_scene, view)
        outline.Opacity = 0
        shot(f"scene_{name}")
    shot("other", other)
    simple.Delete(other)
    simple.Delete(in_scene)
    del in_scene, outline
    shot("deleted")


def deferred(folder):
    """Edit the colours and opacities of values, from a file and from a source of them."""
    asked = json.loads((folder / "asked.json").read_text())
    reader = simple.OpenDataFile(str(folder / "kept.vdi"))
    simple.SaveData(str(folder / "again.vdi"), reader)
    in_scene = simple.VDIInScene(Input=reader)

    def show():
        view = black_view(SIZE)
        shown = simple.Show(in_scene, view)
        shown.Opacity = 0
        view.CameraPosition = asked["camera"]["position"]
        view.CameraFocalPoint = asked["camera"]["focal_point"]
        view.CameraViewUp = asked["camera"]["view_up"]
        view.CameraViewAngle = asked["camera"]["view_angle"]
        return view, shown

    view, shown = show()
    picture = simple.VDIToImage(Input=reader)
    table = shown.LookupTable  # what the colour map editor edits
    ends = [table.RGBPoints[0], table.RGBPoints[-4]]
    found = {"array": list(shown.ColorArrayName), "range": ends}
    table.ColorSpace = "RGB"

    source = brain_source()
    source.ColorFunction, source.OpacityFunction = table, table.ScalarOpacityFunction
    source.Classification = "deferred"
    source.ValueRange = [20, 133]
    simple.SaveData(str(folder / "source.vdi"), source)
    made = source.GetClientSideObject().GetOutputDataObject(0).GetMTime()
    of_source = simple.VDIToImage(Input=source)
    of_source.ColorFunction, of_source.OpacityFunction = table, table.ScalarOpacityFunction
    for i, look in enumerate(asked["looks"]):
        table.RGBPoints, table.ScalarOpacityFunction.Points = look
        simple.SaveScreenshot(str(folder / f"scene_{i}.png"), view, ImageResolution=SIZE)
        for name, image in (("file", picture), ("source", of_source)):
            image.UpdatePipeline()
            save_pixels(image, folder / f"{name}_{i}.npy")
    found["idle"] = source.GetClientSideObject().GetOutputDataObject(0).GetMTime() == made
    (folder / "found.json").write_text(json.dumps(found))

    # Another view with a colour map of its own; and both again, from a state
    _, other = show()
    of_array = ("POINTS", found["array"][1])
    simple.ColorBy(other, of_array, separate=True)
    own = simple.GetColorTransferFunction(of_array[1], other, separate=True)
    opacity = simple.GetOpacityTransferFunction(of_array[1], other, separate=True)
    own.ColorSpace = "RGB"
    own.RGBPoints, opacity.Points = asked["looks"][0]
    simple.SaveState(str(folder / "state.pvsm"))
    simple.ResetSession()
    simple.LoadState(str(folder / "state.pvsm"))
    for name, view in zip(("last", "first"), simple.GetRenderViews(), strict=True):
        view.UseFXAA = 0  # no part of ParaView's states
        simple.SaveScreenshot(str(folder / f"{name}.png"), view, ImageResolution=SIZE)


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
    scalars, color, opacity = brain()
    source = simple.VDISource(Input=scalars)
    source.WindowSize = [60, 40]
    client = source.SMProxy.GetClientSideObject()
    progress, found = [], {}
    client.AddObserver("ProgressEvent", lambda caller, event: progress.append(caller.GetProgress()))

    source.UpdatePipeline()
    vdi = vdi_from_image(fetched(source))
    found["grey by default"] = bool((vdi.color[:, :1] == vdi.color).all() and len(vdi.color))
    found["progress"] = len(progress) > 0 and progress[-1] == 1.0
    made = client.GetOutputDataObject(0).GetMTime()
    source.UpdatePipeline()
    found["idle"] = client.GetOutputDataObject(0).GetMTime() == made  # nothing was done again
    found["points before"] = fetched(source).GetNumberOfPoints()

    source.SMProxy.InvokeCommand("TakeTransferFunctions")
    found["functions"] = [
        source.ColorFunction.SMProxy is color.SMProxy,
        source.OpacityFunction.SMProxy is opacity.SMProxy,
    ]
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


def series(folder):
    """Write three VDIs, open them as one series, and show each step."""
    source = simple.VDISource(Input=simple.Wavelet(), WindowSize=[60, 40])
    for step, longest in enumerate((3, 5, 9)):
        source.MaxSupersegments = longest
        simple.SaveData(str(folder / f"x_{step}.vdi"), source)
    reader = simple.OpenDataFile([str(folder / f"x_{step}.vdi") for step in range(3)])
    picture = simple.VDIToImage(Input=reader, Azimuth=30)
    view = black_view((60, 40))
    shown = simple.Show(picture, view)
    found = {
        "times": list(reader.TimestepValues),
        "shown": [shown.Representation.GetData(), list(shown.ColorArrayName), shown.MapScalars],
        "longest": [],
    }
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    for time in range(3):
        scene.AnimationTime = time
        simple.Render(view)
        found["longest"].append(int(vdi_from_image(fetched(reader)).counts.max()))
        save_pixels(picture, folder / f"step_{time}.npy")
    shown.MapScalars = 1  # stays as it is set
    simple.Show(reader, simple.CreateRenderView())
    found["set by hand"] = shown.MapScalars
    one = simple.OpenDataFile(str(folder / "x_1.vdi"))
    found["times of one"] = list(one.TimestepValues)
    (folder / "series.json").write_text(json.dumps(found))


def animation(folder):
    """Play a series among the objects of a view, and as a picture; then one that grows."""
    reader = simple.OpenDataFile(str(folder / "ball.vdis"))
    picture = simple.VDIToImage(Input=reader, Azimuth=20)
    view = black_view(SIZE)
    outline = simple.Show(simple.VDIInScene(Input=reader), view)
    outline.Opacity = 0
    camera = json.loads((folder / "camera.json").read_text())
    view.CameraPosition = camera["position"]
    view.CameraFocalPoint = camera["focal_point"]
    view.CameraViewUp = camera["view_up"]
    view.CameraViewAngle = camera["view_angle"]
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    found = {
        "reader": reader.SMProxy.GetXMLName(),
        "times": list(reader.TimestepValues),
        "scene": list(scene.TimeKeeper.TimestepValues),
        "shown": [],
    }
    simple.SaveAnimation(str(folder / "played.png"), view, ImageResolution=SIZE)
    for i, time in enumerate(json.loads((folder / "times.json").read_text())):
        scene.AnimationTime = time
        simple.SaveScreenshot(str(folder / f"scene_{i}.png"), view, ImageResolution=SIZE)
        picture.UpdatePipeline(time)
        save_pixels(picture, folder / f"picture_{i}.npy")
        data = reader.GetClientSideObject().GetOutputDataObject(0).GetInformation()
        found["shown"].append(data.Get(vtkDataObject.DATA_TIME_STEP()))
    # The same with ParaView's outlines kept, so that nothing is executed again
    simple.GetSettingsProxy("GeneralSettings").CacheGeometryForAnimation = 1
    for name, time in (("kept", 0.5), ("kept", 4.0), ("kept_0", 0.5)):
        scene.AnimationTime = time
        simple.SaveScreenshot(str(folder / f"{name}.png"), view, ImageResolution=SIZE)
    (folder / "more.vdis").replace(folder / "ball.vdis")
    simple.ReloadFiles(reader)
    found["reloaded"] = list(reader.TimestepValues)
    (folder / "animation.json").write_text(json.dumps(found))


def temporal(folder):
    """Make VDIs of a volume in several files, a time step each, as the animation goes."""
    source = in_time(folder)
    view = black_view(SIZE)
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = (5, 4, 3), (0, 0, 0), (0, 0, 1)
    simple.SetActiveView(view)
    source.SMProxy.InvokeCommand("TakeActiveView")
    simple.Show(simple.VDIInScene(Input=source), view).Opacity = 0
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    (folder / "times.json").write_text(json.dumps(list(scene.TimeKeeper.TimestepValues)))
    for time in (2, 0, 1):
        scene.AnimationTime = time
        simple.SaveScreenshot(str(folder / f"scene_{time}.png"), view, ImageResolution=SIZE)
    simple.SaveData(str(folder / "usual.vdis"), source)
    simple.SaveData(str(folder / "made.vdis"), source, Precision="exact")


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
