"""Each row of docs/dev/pipeline_events.md, against VTK's GPU mapper: pictures and bounds."""

from __future__ import annotations

import numpy as np
import pytest
from pipelines import Maker, Scene, array_of, assert_same, image_of, is_blank, values

from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkExtractVOI,
    vtkGaussianSplatter,
    vtkImageChangeInformation,
    vtkRTAnalyticSource,
    vtkSphereSource,
    vtkTrivialProducer,
)

pytestmark = pytest.mark.gl

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


def produced():
    image, made = image_of(values()), vtkTrivialProducer()
    image.SetOrigin(7, 8, 9)
    made.SetOutput(image)
    return made


FIRST = [splatter, part, moved, produced]


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


WAYS = ("auto", "volume", "vdi", "watched")


@pytest.mark.parametrize(
    ("name", "way"), [(name, WAYS[(n + k) % 4]) for n, name in enumerate(EVENTS) for k in (0, 2)]
)
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
