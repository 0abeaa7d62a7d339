"""Scenes that are drawn twice, with ``add_volume`` and with ``add_vdi``, and what each must show.

A case is a function ``scene(plotter, add)`` as a user's script has it; ``add`` is the plotter's
``add_volume``, then its ``add_vdi``. It returns nothing, and the picture is a screenshot, or the
pictures that it took. The kinds of cases are the files ``test_*.py`` beside this one.
"""

import os
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from pyvista_vdi import compare_images
from pyvista_vdi.errors import VDIError, VDIWarning
from pyvista_vdi.vtk_pipeline.vtk import vtkOutputWindow, vtkStringOutputWindow

#: The issue's bound for a picture.
LEAST_SSIM = 0.98
#: Mean difference of a block of 8 x 8 pixels, of 255: SSIM alone would bear another colour in a
#: small part of the window. Voxels' edges, which two samplings meet differently, stay below.
LARGEST_BLOCK = 16.0
WINDOW = (200, 150)
CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
#: By how much the contrast within 4 x 4 pixels may differ: SSIM hardly sees missing detail. It is
#: compared where ``add_volume`` shows as much, of 255; below, rounding to bytes is a part of it.
CONTRAST, LEAST_CONTRAST = 0.1, 1.0
#: The page that make_page.py writes of all cases.
PAGE = CHECKOUT / "docs" / "drop_in.md"


@dataclass(frozen=True)
class Case:
    """One script, and what is expected of it."""

    name: str  # what the page calls it
    scene: Callable  # takes a plotter and an Add
    window: dict = field(default_factory=dict)  # arguments of the plotter
    #: A pattern of the error (or warning) by which a VDI refuses it, and the reason for it
    refused: tuple[str, str] | None = None
    #: ``add_volume`` raises, and so does ``add_vdi``: one of this package's errors, or the same
    both_refuse: bool = False
    warns: str | None = None  # a pattern of a VDIWarning that comes with the right picture
    #: Where ``add_volume`` is wrong: how, and what the picture is compared with instead
    note: str = ""
    quick: bool = False  # runs with every change, not only at night


def expectations(keywords):
    """Take what is said about a case, rather than given to ``add_volume``, out of keywords."""
    said = ("refused", "both_refuse", "warns", "note", "quick")
    return {name: keywords.pop(name) for name in said if name in keywords}


class Kind:
    """Cases of a kind, each a test of the module that names them."""

    def __init__(self, title):
        self.title, self.cases = title, []

    def add(self, name, scene, **how):
        assert name not in {case.name for case in self.cases}, name
        self.cases.append(Case(name, scene, **how))

    def case(self, name=None, **how):
        """Add the decorated function as a case, of its own name by default."""
        return lambda scene: self.add(name or scene.__name__.replace("_", " "), scene, **how)

    def test(self):
        """Return a test of all cases."""

        @pytest.mark.parametrize("way", ["auto", "vdi"])
        @pytest.mark.parametrize(
            "case", [pytest.param(case, id=case.name, marks=_marks(case)) for case in self.cases]
        )
        def test(case, way, default_runtime):
            found = outcome(case, way=way)
            assert not found.wrong, found.wrong

        return test


def _marks(case):
    marks = [pytest.mark.gl]
    if not case.quick:
        marks.append(pytest.mark.slow)
    return marks


class Add:
    """What a scene adds a volume with; VTK takes steps of half a voxel, ours is drawn ``way``."""

    def __init__(self, plotter, ours, way):
        self.plotter, self.ours, self.way = plotter, ours, way

    def __call__(self, volume, *arguments, to=None, **keywords):
        """Add a volume to the plotter, or to another one."""
        plotter = to or self.plotter
        if self.ours:
            return plotter.add_vdi(volume, *arguments, **{"draw": self.way, **keywords})
        actor = plotter.add_volume(volume, *arguments, **keywords)
        for each in actor if isinstance(actor, list) else [actor]:
            half_voxel_steps(each)
        return actor


def half_voxel_steps(actor):
    """Have VTK's mapper of an actor take steps of half the smallest spacing, in the world."""
    mapper = actor.mapper
    for switch in ("SetAutoAdjustSampleDistances", "SetInteractiveAdjustSampleDistances"):
        if hasattr(mapper, switch):
            getattr(mapper, switch)(0)
    if not isinstance(mapper.dataset, pv.ImageData):
        return
    scale = np.linalg.svd(pv.array_from_vtkmatrix(actor.GetMatrix())[:3, :3], compute_uv=False)
    step = min(mapper.dataset.spacing) * scale.min() / 2
    for name in ("SetSampleDistance", "SetInteractiveSampleDistance"):
        if hasattr(mapper, name):
            getattr(mapper, name)(step)
    if hasattr(mapper, "SetImageSampleDistance"):
        mapper.SetImageSampleDistance(1.0)


@dataclass
class Drawn:
    """What a scene gave one way: pictures or an error, and what was said."""

    pictures: list = field(default_factory=list)
    error: Exception | None = None
    said: list = field(default_factory=list)
    ours: list = field(default_factory=list)
    empty: np.ndarray | None = None


def draw(case, ours, way="vdi"):
    """Draw a case one way."""
    drawn = Drawn()
    theme = pv.themes.Theme()
    theme.load_theme(pv.global_theme)
    output, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(output)
    plotter = pv.Plotter(off_screen=True, **{"window_size": WINDOW, **case.window})
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                pictures = list(case.scene(plotter, Add(plotter, ours, way)) or [])
                if not pictures:
                    pictures = [shot(plotter)]
                    drawn.empty = without_volumes(plotter)
                drawn.pictures = [np.asarray(each)[..., :3] for each in pictures]
            except Exception as error:
                drawn.error = error
    finally:
        plotter.close()
        pv.close_all()
        pv.global_theme.load_theme(theme)
        vtkOutputWindow.SetInstance(before)
    for each in caught:
        to = drawn.ours if issubclass(each.category, VDIWarning) else drawn.said
        to.append(f"{each.category.__name__}: {each.message}")
    if output.GetOutput():
        drawn.said.append(re.sub("0x[0-9a-f]+", "", output.GetOutput()))
    return drawn


def shot(plotter, **how):
    """Show a plotter, without handing control to its window, and return its picture."""
    if plotter.render_window.GetNeverRendered():
        plotter.show(auto_close=False)
    plotter.render()
    return np.array(plotter.screenshot(return_img=True, **how))


def without_volumes(plotter):
    """Return the picture without volumes, which says whether there were any in it."""
    for renderer in plotter.renderers:
        for prop in renderer.GetViewProps():
            if prop.IsA("vtkVolume") or prop.IsA("vtkAssembly") or prop.IsA("vtkPropAssembly"):
                prop.SetVisibility(False)
    return shot(plotter)[..., :3]


@dataclass
class Outcome:
    """How a case came out: what is wrong with it, if anything, and the least SSIM."""

    wrong: str = ""
    ssim: float | None = None


def outcome(case, way="vdi"):
    """Draw a case both ways and judge it."""
    ours = draw(case, True, way)
    if case.refused:
        said = [f"{ours.error}"] if isinstance(ours.error, VDIError) else ours.ours
        if any(re.search(case.refused[0], each) for each in said):
            return Outcome()
        return Outcome(f"is not refused by {case.refused[0]!r}: {ours.error!r}, {ours.ours}")
    theirs = draw(case, False)
    wrong = _errors(case, theirs, ours, case.warns if way in ("auto", "vdi") else None)
    return Outcome(wrong) if wrong or case.both_refuse else _compared(theirs, ours)


def _errors(case, theirs, ours, warns):
    if case.both_refuse:
        if theirs.error is None or not isinstance(ours.error, VDIError | type(theirs.error)):
            return f"add_volume: {theirs.error!r}; add_vdi: {ours.error!r}"
        return ""
    for who, drawn in (("add_volume", theirs), ("add_vdi", ours)):
        if drawn.error is not None:
            return f"{who}: {drawn.error!r}"
    expected = [each for each in ours.ours if warns and re.search(warns, each)]
    if warns and not expected:
        return f"no warning {warns!r}"
    unexpected = [each for each in ours.ours if each not in expected]
    unexpected += [each for each in ours.said if each not in theirs.said]
    return f"said {unexpected}" if unexpected else ""


def _compared(theirs, ours):
    shapes = [[each.shape for each in drawn.pictures] for drawn in (theirs, ours)]
    if shapes[0] != shapes[1]:
        return Outcome("pictures of {} and {}".format(*shapes))
    if theirs.empty is not None and np.ptp(theirs.empty - theirs.pictures[0].astype(int)) < 20:
        return Outcome("add_volume's own picture shows no volume")
    pairs = list(zip(ours.pictures, theirs.pictures, strict=True))
    ssim = min(compare_images(a / 255, b / 255).ssim for a, b in pairs)
    block = max(_largest_block(a, b) for a, b in pairs)
    if not ssim >= LEAST_SSIM:
        return Outcome(f"SSIM {ssim:.4f}", ssim)
    for a, b in pairs:
        own, wanted = contrast(a), contrast(b)
        if wanted > LEAST_CONTRAST and abs(own / wanted - 1) > CONTRAST:
            return Outcome(f"SSIM {ssim:.4f}, but contrast {own:.2f} for {wanted:.2f}", ssim)
    if block > LARGEST_BLOCK:
        return Outcome(f"SSIM {ssim:.4f}, but 8 x 8 pixels differ by {block:.1f} of 255", ssim)
    return Outcome(ssim=ssim)


def contrast(picture):
    """Return the mean standard deviation of a channel within 4 x 4 pixels, of 255."""
    return float(_blocks(picture.astype(float), 4).std(axis=(1, 3)).mean())


def _blocks(picture, n):
    height, width = (size // n * n for size in picture.shape[:2])
    return picture[:height, :width].reshape(height // n, n, width // n, n, 3)


def _largest_block(a, b):
    return float(np.abs(_blocks(a.astype(float) - b, 8).mean(axis=(1, 3))).max())
