"""Each option is declared once, and all else follows from what is declared."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import api
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import GenerationOptions, QualityTarget, declared

CAMERA = pvdi.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0))


def add_vdi(*arguments, **named):
    pv = pytest.importorskip("pyvista")
    plotter = pv.Plotter(off_screen=True)
    try:
        return plotter.add_vdi(*arguments, **named)
    finally:
        plotter.close()


def function(name):
    """Return a public function by its name, and how many arguments it has at most."""
    if name != "add_vdi":
        most = {"generate": 35, "render_volume": 30}
        return getattr(api, name), most.get(name, 30)
    pytest.importorskip("pyvista")
    from pyvista_vdi.plotting.component import AddVDI

    return AddVDI.__call__, 1 + 48  # self


@pytest.mark.parametrize("name", ["view_cone", "log_scale", "tolerance"])
def test_an_option_stands_in_one_place(name):
    """No other function or record of the package has it as an argument or a field."""
    places = []
    for path in Path(pvdi.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            of_function = isinstance(node, ast.arg) and node.arg == name
            of_record = isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == name
            places += [path.name] * (of_function or of_record)
    assert len(places) == 1, places


NAMES = ["estimate", "generate", "pick", "render", "render_depth", "render_volume", "add_vdi"]


@pytest.mark.parametrize("name", NAMES)
def test_docstrings_have_each_parameter_once(name):
    called, most = function(name)
    parameters = inspect.signature(called).parameters.values()
    assert len(parameters) <= most
    text = inspect.getdoc(called)
    section = re.search(r"Parameters\n-+\n(.*?)\n\n\w+\n-+\n", text, re.DOTALL)[1]
    heads = re.findall(r"^(?! )(.*?)(?: : .*)?$", section, re.MULTILINE)
    documented = [each.lstrip("*") for head in heads for each in head.split(", ")]
    taken = [each.name for each in parameters if each.name not in ("self", "look")]
    assert sorted(documented) == sorted(taken)


def test_add_vdi_begins_as_add_volume():
    theirs = inspect.signature(pytest.importorskip("pyvista").Plotter.add_volume).parameters
    ours = inspect.signature(function("add_vdi")[0]).parameters
    known = [each.name for each in theirs.values() if each.kind is each.POSITIONAL_OR_KEYWORD]
    assert [*ours][: len(known)] == known
    assert {n: ours[n].default for n in known} == {n: theirs[n].default for n in known}


def test_by_position_and_by_other_names_it_is_the_same():
    pv = pytest.importorskip("pyvista")
    ball = pv.Wavelet()
    one = add_vdi(ball, "RTData", (0, 100), None, "linear", 12, "bone")
    other = add_vdi(ball, scalars="RTData", rng=(0, 100), n_colors=12, colormap="bone")
    for actor in (one, other):
        assert actor.mapper.lookup_table.n_values == 12
        assert actor.mapper.scalar_range == (0, 100)
    with pytest.raises(TypeError, match=r"add_vdi\(\) multiple values for argument 'scalars'"):
        add_vdi(ball, "RTData", scalars="RTData")
    with pytest.raises(TypeError, match=r"generate\(\) missing a required argument: 'camera'"):
        pvdi.generate(ball)


@pytest.mark.parametrize(
    ("name", "given", "says"),
    [
        ("generate", {"tolerance": 0.1}, r"settings=pyvista_vdi\.Settings\(tolerance=\.\.\.\)"),
        ("generate", {"step": 0.1}, r"Settings\(sample_distance=\.\.\.\)"),
        ("generate", {"n_supersegments": 9}, "did you mean 'max_supersegments'"),
        ("generate", {"target_fps": 9}, "it is of add_vdi.*full_fps"),
        ("render_volume", {"precision": "exact"}, "how a VDI is made: give it to generate"),
        ("add_vdi", {"coverage": "view"}, r"Settings\(coverage=\.\.\.\)"),
        ("Settings", {"tolerence": 1}, "did you mean 'tolerance'"),
    ],
)
def test_what_has_moved_is_refused_with_its_new_place(name, given, says):
    called = add_vdi if name == "add_vdi" else getattr(pvdi, name)
    with pytest.raises(TypeError, match=says):
        called(**given)


def test_settings_that_mean_nothing_are_refused():
    with pytest.raises(pvdi.InvalidArgumentError, match="coverage of the settings means nothing"):
        pvdi.generate(None, CAMERA, (8, 8), settings=pvdi.Settings(coverage="view"))
    with pytest.raises(pvdi.InvalidArgumentError, match="settings must be a pyvista_vdi.Settings"):
        pvdi.generate(None, CAMERA, (8, 8), settings={"tolerance": 0.1})
    with pytest.raises(pvdi.InvalidArgumentError, match="did you mean 'homogeneity'"):
        pvdi.Settings(criterion="homogenity")


def test_what_is_made_twice_is_equal_and_what_is_given_is_told():
    assert GenerationOptions() == GenerationOptions(lights=Lights())
    assert GenerationOptions(tolerance=0.5).given == {"tolerance": 0.5}
    assert not QualityTarget("reference")
    assert QualityTarget(max_bytes=1e3).given == {"max_bytes": 1000}
    options = GenerationOptions()
    assert GenerationOptions.of(options, {}) is options
    assert GenerationOptions.of(options, {"view_cone": 5}).view_cone == 5
    assert set(declared(Classification)) <= set(inspect.signature(pvdi.generate).parameters)
