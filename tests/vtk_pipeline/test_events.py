"""Each row of docs/dev/pipeline_events.md, against VTK's GPU mapper: pictures and bounds."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from pipelines import (
    Maker,
    Scene,
    array_of,
    assert_same,
    image_of,
    is_blank,
    property_of,
    values,
)

from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkExtractVOI,
    vtkGaussianSplatter,
    vtkImageChangeInformation,
    vtkImageShiftScale,
    vtkImplicitModeller,
    vtkResampleToImage,
    vtkRTAnalyticSource,
    vtkSphereSource,
    vtkTrivialProducer,
)

pytestmark = pytest.mark.gl

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])

#: What the table calls an event -> a function of a scene that yields where pictures are compared:
#: a remark, or (remark, "blank") where nothing is to be seen in either.
EVENTS = {}
#: Events of which the source makes no picture, or which frames with VDIs say.
WARNS = set()


def event(name, *, warns=False):
    def add(function):
        assert name not in EVENTS
        EVENTS[name] = function
        if warns:
            WARNS.add(name)
        return function

    return add


def shown(scene, what=None):
    """Show a volume whole; returns it."""
    volume = image_of(values()) if what is None else what
    scene.set_input(volume)
    scene.reset()
    return volume


def connect(filter_, before):
    filter_.SetInputConnection(before.GetOutputPort())  # a port alone does not keep its algorithm


def scaled(image):
    """A filter of an image that can be executed again."""
    scale = vtkImageShiftScale()
    scale.SetInputDataObject(image)
    return scale


def wavelet(extent=8):
    source = vtkRTAnalyticSource()
    source.SetWholeExtent(-extent, extent, -extent, extent, -extent, extent)
    return source


def sphere():
    source = vtkSphereSource()
    source.SetCenter(10, 3, 2)
    source.SetRadius(5)
    return source


def splatter():
    made = vtkGaussianSplatter()
    connect(made, sphere())
    made.SetSampleDimensions(14, 14, 14)
    made.ScalarWarpingOff()
    made.SetScaleFactor(255)
    return made


def modeller():
    made = vtkImplicitModeller()
    connect(made, sphere())
    made.SetSampleDimensions(14, 14, 14)
    made.SetMaximumDistance(0.3)
    made.ScaleToMaximumDistanceOn()
    made.SetOutputScalarTypeToUnsignedChar()
    return made


def resampled():
    made = vtkResampleToImage()
    connect(made, wavelet())
    made.SetSamplingDimensions(14, 14, 14)
    return made


def part():
    made = vtkExtractVOI()
    connect(made, wavelet())
    made.SetVOI(-6, 4, -8, 8, 0, 8)
    made.SetSampleRate(1, 2, 1)
    return made


def moved():
    made = vtkImageChangeInformation()
    connect(made, wavelet())
    made.SetOutputSpacing(2, 1, 0.5)
    made.SetOutputOrigin(-4, 50, 3)
    made.SetExtentTranslation(3, -2, 1)
    return made


def silent():
    image = image_of(values())
    image.SetSpacing(0.5, 1, 2)
    image.SetOrigin(7, 8, 9)
    return Maker(image, silent=True)


def produced():
    image, made = image_of(values()), vtkTrivialProducer()
    image.SetOrigin(7, 8, 9)
    made.SetOutput(image)
    return made


FIRST = [splatter, modeller, resampled, part, moved, silent, produced]


@event("bounds are asked before the first frame")
def bounds_first(scene):
    for make in FIRST:
        shown(scene, make())
        yield make.__name__


@event("a frame is drawn before there is an input, and the input is set then", warns=True)
def late_input(scene):
    yield "no input", "blank"
    shown(scene)
    yield "set"
    scene.turn(10)
    yield "turned"


@event("another input is set")
def replaced(scene):
    shown(scene)
    yield "first"
    scene.set_input(scaled(image_of(values(1, 10))))
    yield "an algorithm"
    scene.reset()
    yield "looked at"
    scene.set_input(image_of(values(2, 12)))
    yield "an image"


@event("the input is removed, and set again", warns=True)
def removed(scene):
    volume = shown(scene)
    yield "set"
    scene.set_input(None)
    yield "removed", "blank"
    scene.set_input(volume)
    yield "set again"


@event("an input has no points, or no scalars", warns=True)
def empty(scene):
    maker = shown(scene, Maker(image_of(values())))
    for what in ("nothing", "no scalars"):
        yield "whole"
        maker.do(what)
        yield what, "blank"
        maker.do("")
    yield "whole again"


@event("values are written in place, and array or image are `Modified()`")
def written(scene):
    image = shown(scene)
    yield "before"
    array_of(image)[:] = values(3).ravel()
    image.Modified()
    yield "image.Modified()"
    array_of(image)[:] = values(4).ravel()
    image.GetPointData().GetScalars().Modified()
    yield "array.Modified()"
    for z, y, x in np.ndindex(13, 13, 6):
        image.SetScalarComponentFromDouble(x, y, z, 0, 0.0)
    image.Modified()
    yield "SetScalarComponentFromDouble"
    image.GetPointData().SetScalars(image_of(values(5)).GetPointData().GetScalars())
    yield "another array"


@event("spacing, origin or extent of the input are set")
def placed(scene):
    image = shown(scene)
    yield "before"
    image.SetSpacing(1, 0.7, 1.3)
    yield "spacing"
    image.SetOrigin(1, 0, 2)
    yield "origin"
    image.SetExtent(2, 14, -3, 9, 0, 12)
    yield "extent"
    image.SetDirectionMatrix(0, 1, 0, -1, 0, 0, 0, 0, 1)
    scene.reset()
    yield "direction"


@event("a filter's setting is changed")
def setting(scene):
    scale = shown(scene, scaled(image_of(values())))
    yield "before"
    scale.SetScale(0.5)
    yield "scale"
    scale.SetShift(20)
    yield "shift"


@event("a filter executes again, and writes into the array that it gave before")
def again(scene):
    maker = shown(scene, Maker(image_of(values())))
    yield "before"
    array_of(maker.image)[:] = values(1).ravel()
    maker.Modified()
    yield "executed again"


@event("an algorithm upstream fails, and works again", warns=True)
def failed(scene):
    maker = Maker(image_of(values()))
    scale = vtkImageShiftScale()
    connect(scale, maker)
    shown(scene, maker)
    yield "before"
    maker.do("raise")
    scene.set_input(scale)
    yield "behind what fails from the first", "blank"
    maker.do("")
    for made, blank in ((maker, ["blank"]), (scale, [])):  # further up, the data before stay
        shown(scene, made)
        yield "whole"
        for how in ("return 0", "raise"):
            maker.do(how)
            yield how, *blank
            scene.reset()
            yield "still", *blank
            maker.do("")
            scene.reset()
            yield "works again"


@event("an algorithm upstream is aborted, and executes again", warns=True)
def aborted(scene):
    scale = shown(scene, scaled(image_of(values())))
    yield "whole"
    scale.SetAbortExecuteAndUpdateTime()
    yield "aborted, but not executed"
    scale.SetAbortExecute(0)
    scale.SetScale(0.6)
    scale.SetAbortExecuteAndUpdateTime()
    before = scene.picture()  # VTK draws memory that nothing was written into
    if scene.way != "vtk":
        assert not is_blank(before)
    scale.SetAbortExecute(0)
    yield "no longer"
    scale.SetScale(0.9)
    yield "changed"


@event("making the VDI is aborted", warns=True)
def generation_aborted(scene):
    image = shown(scene)
    ours = scene.way != "vtk"

    def stop(caller, _):
        caller.SetAbortExecute(1)

    def frame_aborted():
        if ours:
            tag = scene.first.AddObserver("ProgressEvent", stop)
            scene.picture()
            scene.first.RemoveObserver(tag)

    frame_aborted()
    scene.reset()
    yield "the first one"
    array_of(image)[:] = values(1).ravel()
    image.Modified()
    frame_aborted()
    yield "one after a change"


@event("the volume property's functions are changed, or another one is set")
def looks(scene):
    shown(scene)
    yield "before"
    scene.property.GetScalarOpacity().AddPoint(120, 0.0)
    yield "opacity"
    scene.property.GetRGBTransferFunction().AddRGBPoint(200, 0, 1, 0)
    yield "colour"
    scene.property.SetScalarOpacityUnitDistance(0.7)
    yield "unit distance"
    scene.set_property(property_of((0, 0.2), (255, 0.0), color=0.8))
    yield "another one"


@event("something is connected differently further up")
def connected(scene):
    scale = scaled(image_of(values()))
    last = vtkImageShiftScale()
    connect(last, scale)
    shown(scene, last)
    yield "before"
    connect(last, scaled(image_of(values(1, 11))))
    yield "another algorithm"
    connect(last, scale)
    yield "back"


@event("a filter gives another extent")
def extent(scene):
    voi = vtkExtractVOI()
    connect(voi, wavelet())
    voi.SetVOI(-8, 8, -8, 8, -8, 8)
    shown(scene, voi)
    yield "whole"
    voi.SetVOI(-3, 8, -8, 2, -8, 8)
    yield "a part"
    scene.reset()
    yield "the part, looked at"
    voi.SetVOI(-8, 8, -8, 8, -8, 8)
    yield "whole again"


@event("another consumer of the same port asks for a part of it")
def two_consumers(scene):
    source = shown(scene, wavelet())
    yield "alone"
    other = vtkExtractVOI()
    connect(other, source)
    other.SetVOI(-2, 2, -2, 2, -2, 2)
    other.Update()
    yield "the other has asked"
    other.UpdateExtent((-1, 1, -1, 1, -1, 1))
    yield "for less"


@event("another time is asked for")
def time(scene):
    maker = Maker(image_of(values()), (0.5, 1.0))
    shown(scene, maker)
    yield "none"
    for at in (0.5, 1.0, 0.5):
        maker.UpdateTimeStep(at)
        yield f"time {at}, upstream"
    for at in (1.0, 0.5):
        (maker if scene.way == "vtk" else scene.first).UpdateTimeStep(at)
        yield f"time {at}"


@event("the camera is reset or turned")
def camera(scene):
    shown(scene)
    yield "reset"
    scene.turn(8, 3)
    yield "turned"
    scene.reset()
    yield "reset again"


@event("the actor is hidden, and shown again")
def hidden(scene):
    image = shown(scene)
    yield "shown"
    scene.actor.VisibilityOff()
    yield "hidden", "blank"
    array_of(image)[:] = values(2).ravel()
    image.Modified()
    yield "changed", "blank"
    scene.actor.VisibilityOn()
    yield "shown again"


@pytest.mark.every(2)
@pytest.mark.parametrize("way", ["auto", "volume", "vdi", "watched"])
@pytest.mark.parametrize("name", EVENTS)
def test_it_is_as_with_vtks_mapper(name, way, expected_messages, recwarn):
    ours, judge = Scene(way), Scene("vtk")
    steps = [EVENTS[name](each) for each in (ours, judge)]
    for step in zip(*steps, strict=True):
        what, *blank = step[0] if isinstance(step[0], tuple) else (step[0],)
        picture = assert_same(ours, judge, what)
        assert is_blank(picture) == bool(blank), what
    said = [str(each.message) for each in recwarn if issubclass(each.category, VDIWarning)]
    assert not said or name in WARNS, said
    for each in (ours, judge):
        each.close()


def test_the_page_has_these_events():
    page = (CHECKOUT / "docs" / "dev" / "pipeline_events.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.+?) \|", page, re.MULTILINE)
    assert [row for row in rows if row not in ("event", "---")] == list(EVENTS)
