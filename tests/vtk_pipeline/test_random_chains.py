"""Random chains of VTK's filters, and what happens to them: every frame as VTK's GPU mapper's."""

from __future__ import annotations

import numpy as np
import pytest
from pipelines import Maker, Scene, array_of, assert_same, image_of, property_of, values

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkExtractVOI,
    vtkImageCast,
    vtkImageChangeInformation,
    vtkImageConstantPad,
    vtkImageFlip,
    vtkImageMirrorPad,
    vtkImagePermute,
    vtkImageResample,
    vtkImageShiftScale,
    vtkRTAnalyticSource,
    vtkTrivialProducer,
)

pytestmark = pytest.mark.gl

#: How many are drawn; the slow tests draw all but a few. In 46 what is further up fails.
CHAINS, FEW = 60, (*range(8), 46)
MOST_FILTERS, MOST_EVENTS = 4, 8
WAYS = ("auto", "vdi", "volume")


class Chain:
    """A scene behind a source and filters, which were drawn at random; events are its methods."""

    def __init__(self, scene, rng):
        self.scene = scene
        self.elsewhere = []  # what else reads from the chain
        self.build(rng)
        scene.reset()

    def build(self, rng):
        """Draw another chain, and show it."""
        self.filters = [SOURCES[rng.integers(len(SOURCES))](rng)]
        self.maker = self.last if isinstance(self.last, Maker) else None
        for _ in range(rng.integers(MOST_FILTERS + 1)):
            self.last.Update()
            whole = self.last.GetOutputDataObject(0).GetExtent()
            made = FILTERS[rng.integers(len(FILTERS))](rng, whole)
            made.SetInputConnection(self.last.GetOutputPort())
            self.filters.append(made)
        self.scene.set_input(self.last)

    @property
    def last(self):
        return self.filters[-1]

    def execute_again(self, rng):
        self.filters[rng.integers(len(self.filters))].Modified()

    def write_in_place(self, rng):
        seed = int(rng.integers(100))
        if self.maker is None:
            self.last.Update()
            image = self.last.GetOutputDataObject(0)
            array_of(image)[::3] *= 0
            image.Modified()
        else:
            image = self.maker.image
            array_of(image)[:] = values(seed, image.GetDimensions()[0]).ravel()
            self.maker.Modified()

    def fail(self, rng):
        how = ["return 0", "raise"]
        if self.maker is self.last:  # some filters of VTK's crash behind what has no scalars
            how += ["nothing", "no scalars"]
        if self.maker is not None:
            self.maker.do(str(rng.choice(how)))

    def recover(self, rng):
        if self.maker is not None:
            self.maker.do("")

    def abort_once(self, rng):
        """Abort what is before the scene; it executes again as soon as it is no longer aborted."""
        self.last.Modified()
        self.last.SetAbortExecuteAndUpdateTime()
        self.scene.picture()  # VTK draws what is in the memory
        self.last.SetAbortExecute(0)
        self.last.Modified()

    def abort_the_vdi(self, rng):
        self.last.Modified()
        if self.scene.way != "vtk":
            stop = self.scene.first.AddObserver("ProgressEvent", lambda o, _: o.SetAbortExecute(1))
            self.scene.picture()
            self.scene.first.RemoveObserver(stop)

    def look_at_all(self, rng):
        self.scene.reset()

    def turn(self, rng):
        self.scene.turn(rng.uniform(-30, 30), rng.uniform(-10, 10))

    def change_opacity(self, rng):
        self.scene.property.GetScalarOpacity().AddPoint(rng.uniform(60, 200), rng.uniform(0, 0.5))

    def change_colours(self, rng):
        r, g, b = rng.uniform(0, 1, 3)
        self.scene.property.GetRGBTransferFunction().AddRGBPoint(rng.uniform(60, 200), r, g, b)

    def another_property(self, rng):
        nodes = [(at, rng.uniform(0, 0.5)) for at in (0, 90, 170, 255)]
        self.scene.set_property(property_of(*nodes, color=rng.uniform(), unit=rng.uniform(1, 4)))

    def disconnect(self, rng):
        self.scene.set_input(None)

    def reconnect(self, rng):
        self.scene.set_input(self.last)

    def another_chain(self, rng):
        self.build(rng)
        self.scene.reset()

    def as_a_data_object(self, rng):
        self.last.Update()
        self.scene.set_input(self.last.GetOutputDataObject(0))

    def insert_a_filter(self, rng):
        made = shifted_and_scaled(rng, None)
        made.SetInputConnection(self.last.GetOutputPort())
        self.filters.append(made)
        self.scene.set_input(made)

    def another_consumer(self, rng):
        voi = vtkExtractVOI()
        voi.SetInputConnection(self.last.GetOutputPort())
        self.last.Update()
        extent = self.last.GetOutputDataObject(0).GetExtent()
        voi.SetVOI(*(end + (1, -1)[i % 2] for i, end in enumerate(extent)))
        self.elsewhere.append(voi)
        voi.Update()

    def hide_and_show(self, rng):
        self.scene.actor.VisibilityOff()
        self.scene.picture()
        self.scene.actor.VisibilityOn()

    def move_the_actor(self, rng):
        self.scene.actor.SetPosition(rng.uniform(-2, 2, 3))

    def resize_the_window(self, rng):
        self.scene.window.SetSize(*(int(n) for n in rng.integers(60, 140, 2)))


EVENTS = [
    name for name in vars(Chain) if not name.startswith("_") and name not in ("build", "last")
]


# What follows returns an algorithm; filters are told the extent of what they get


def a_maker(rng):
    n = int(rng.integers(9, 15))
    image = image_of(values(int(rng.integers(100)), n))
    image.SetSpacing(rng.uniform(0.6, 1.5, 3))
    image.SetOrigin(rng.uniform(-5, 5, 3))
    return Maker(image)


def a_producer(rng):
    maker = a_maker(rng)
    made = vtkTrivialProducer()
    made.SetOutput(maker.image)
    return made


def a_wavelet(rng):
    made = vtkRTAnalyticSource()
    lows = rng.integers(-7, -3, 3)
    made.SetWholeExtent(*(int(n) for low in lows for n in (low, low + rng.integers(9, 13))))
    return made


def shifted_and_scaled(rng, whole):
    made = vtkImageShiftScale()
    made.SetShift(rng.uniform(-20, 20))
    made.SetScale(rng.uniform(0.7, 1.1))
    made.SetOutputScalarTypeToFloat()
    return made


def a_part(rng, whole):
    made = vtkExtractVOI()
    least = [int(n) for n in rng.integers(0, 3, 6)]
    made.SetVOI(*(end + n * (-1) ** i for i, (end, n) in enumerate(zip(whole, least, strict=True))))
    return made


def resampled(rng, whole):
    made = vtkImageResample()
    made.SetInterpolationModeToLinear()
    for axis in range(3):
        made.SetAxisMagnificationFactor(axis, rng.uniform(0.8, 1.6))
    return made


def flipped(rng, whole):
    made = vtkImageFlip()
    made.SetFilteredAxis(int(rng.integers(3)))
    made.SetFlipAboutOrigin(int(rng.integers(2)))
    return made


def permuted(rng, whole):
    made = vtkImagePermute()
    made.SetFilteredAxes(*(int(n) for n in rng.permutation(3)))
    return made


def cast(rng, whole):
    made = vtkImageCast()
    made.ClampOverflowOn()
    made.SetOutputScalarType(int(rng.choice([3, 4, 5, 6, 10, 11])))  # uchar .. int, float, double
    return made


def padded(rng, whole):
    made = rng.choice([vtkImageConstantPad, vtkImageMirrorPad])()
    made.SetOutputWholeExtent(*(end + (-2, 1)[i % 2] for i, end in enumerate(whole)))
    return made


def informed(rng, whole):
    made = vtkImageChangeInformation()
    made.SetOutputSpacing(rng.uniform(0.6, 1.5, 3))
    made.SetOutputOrigin(rng.uniform(-30, 30, 3))
    made.SetExtentTranslation(*(int(n) for n in rng.integers(-4, 5, 3)))
    return made


SOURCES = [a_maker, a_maker, a_producer, a_wavelet]
FILTERS = [shifted_and_scaled, a_part, resampled, flipped, permuted, cast, padded, informed]


@pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning")  # of what fails or is aborted
@pytest.mark.parametrize(
    "seed",
    [*FEW, *(pytest.param(n, marks=pytest.mark.slow) for n in range(CHAINS) if n not in FEW)],
)
def test_every_frame_is_as_with_vtks_mapper(seed, expected_messages):
    way = WAYS[seed % len(WAYS)]
    rng = np.random.default_rng(seed)
    start = int(rng.integers(2**31))
    chains = [Chain(Scene(each), np.random.default_rng(start)) for each in (way, "vtk")]
    ours, judge = (chain.scene for chain in chains)
    story = [f"seed {seed}, {way}: {[f.GetClassName() for f in chains[0].filters]}"]
    assert_same(ours, judge, story[0])
    for _ in range(rng.integers(3, MOST_EVENTS + 1)):
        name, drawn = str(rng.choice(EVENTS)), int(rng.integers(2**31))
        story.append(name)
        for chain in chains:
            getattr(chain, name)(np.random.default_rng(drawn))
        if way == "vdi" and ours.first.last is not None:  # it serves the view it is of
            ours.first.SetCamera(ours.renderer.GetActiveCamera())
            ours.first.SetWindowSize(ours.renderer.GetSize())
        assert_same(ours, judge, "; ".join(story))
    for each in (ours, judge):
        each.close()
