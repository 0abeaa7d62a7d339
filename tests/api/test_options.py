"""Each option is declared once: what the public functions write out is what is declared."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields

import pytest

import pyvista_vdi as pvdi
from pyvista_vdi import api
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion
from pyvista_vdi.model.classification import Classification, Look
from pyvista_vdi.model.lighting import Light, Lights
from pyvista_vdi.model.options import (
    GenerationOptions,
    MediumOptions,
    QualityTarget,
    declared,
)
from pyvista_vdi.model.render_options import DrawingOptions, RenderOptions

#: The functions, with the records whose options they take.
MADE = (Classification, GenerationOptions, QualityTarget)
FUNCTIONS = {
    "generate": (api.generate, MADE),
    "estimate": (api.estimate, MADE),
    "render": (api.render, (RenderOptions,)),
    "render_depth": (api.render_depth, (RenderOptions,)),
    "pick": (api.pick, (RenderOptions,)),
    "render_volume": (api.render_volume, (Classification, MediumOptions, RenderOptions)),
}


def add_vdi():
    pytest.importorskip("pyvista")
    from pyvista_vdi.plotting.adding import Placement
    from pyvista_vdi.plotting.classify import Looks
    from pyvista_vdi.plotting.component import AddVDI

    return AddVDI.__call__, (*MADE, Looks, DrawingOptions, Placement)


def of(name):
    return add_vdi() if name == "add_vdi" else FUNCTIONS[name]


def entries(function):
    """Yield the names, the type and the text of each entry of a docstring's parameters."""
    text = re.search(r"Parameters\n-+\n(.*?)\n\n\w+\n-+\n", inspect.getdoc(function), re.DOTALL)[1]
    for entry in re.split(r"\n(?=\S)", text):
        head, _, what = entry.partition("\n")
        names, _, kind = head.partition(" : ")
        yield names.split(", "), kind, " ".join(what.split())


@pytest.mark.parametrize("name", [*FUNCTIONS, "add_vdi"])
def test_signatures_have_the_defaults_that_are_declared(name):
    function, records = of(name)
    known = declared(*records)
    for each in inspect.signature(function).parameters.values():
        if each.name in known:
            assert each.default == known[each.name].default, each.name
    if name in ("generate", "render"):
        assert set(declared(*records)) <= set(inspect.signature(function).parameters)


@pytest.mark.parametrize("name", [*FUNCTIONS, "add_vdi"])
def test_docstrings_have_each_parameter_once_and_say_what_is_declared(name):
    function, records = of(name)
    known, found, mistakes = declared(*records), list(entries(function)), []
    documented = [each.lstrip("*") for names, _, _ in found for each in names]
    kinds = (inspect.Parameter.VAR_KEYWORD,) * (name != "add_vdi")
    parameters = inspect.signature(function).parameters.values()
    taken = [each.name for each in parameters if each.name != "self" and each.kind not in kinds]
    assert sorted(documented) == sorted(taken)
    for names, kind, text in found:
        told = known.get(names[0])
        if told is None or len(names) > 1 or re.match(r"(As (for|in)|The same|Likewise)\b", text):
            continue
        wanted = told.what[0].upper() + told.what[1:].partition(";")[0].partition(",")[0]
        choices = "{" + ", ".join(f'"{each}"' for each in told.choices) + "}"
        if not text.startswith(wanted) or (told.choices and not kind.startswith(choices)):
            mistakes.append(f"{names[0]} : {kind}: {text}, where {told.what}")
    assert not mistakes, "\n".join(mistakes)


def test_defaults_of_a_look_are_add_volume_s():
    theirs = inspect.signature(pytest.importorskip("pyvista").Plotter.add_volume).parameters
    for name, told in declared(Classification).items():
        if name not in ("interpolation", "volume_property", "transfer_function"):
            assert theirs[name].default == told.default, name


#: Of each option another value than the default, and what is kept of it.
OTHERS = {
    "scalars": "a", "preference": "cell", "clim": (0, 1), "n_colors": 7, "opacity": "geom",
    "cmap": "bone", "flip_scalars": True, "opacity_unit_distance": 3.0, "log_scale": True,
    "shade": True, "ambient": 0.1, "diffuse": 0.3, "specular": 0.4, "specular_power": 2.0,
    "interpolation": "linear", "max_supersegments": 5, "criterion": "homogeneity",
    "sample_distance": 0.25, "tolerance": 0.5, "view_cone": 30.0, "precision": "8-byte",
    "lights": (Light(intensity=0.5),), "ambient_occlusion": 4.0, "memory_limit": "1 GiB",
}  # fmt: skip
KEPT = {
    "lights": Lights((Light(intensity=0.5),)),
    "ambient_occlusion": AmbientOcclusion(4.0),
    "memory_limit": 2**30,
}


def test_each_argument_of_generate_reaches_its_option(monkeypatch):
    """Records are made of arguments in their order: none may be taken for another."""
    seen = {}

    def note(record):
        def made(*given, **named):
            made = record(*given, **named)
            seen.update({name: getattr(made, name) for name in declared(record)})
            return made

        return made

    def stop(*_):
        raise InterruptedError

    for record in (Classification, GenerationOptions, QualityTarget):
        monkeypatch.setattr(record, "checked", note(record))
    monkeypatch.setattr("pyvista_vdi.api.vdis.as_volume", stop)
    asked = {"target_ssim": 0.9, "target_fps": 5.0, "max_bytes": 10, "target_angle": 20.0}
    with pytest.raises(InterruptedError):
        pvdi.generate(None, None, None, **OTHERS, **asked)
    assert {name: seen[name] for name in OTHERS} == {**OTHERS, **KEPT}
    assert {name: seen[name] for name in asked} == asked


def test_each_argument_of_add_vdi_reaches_its_option(monkeypatch):
    pv = pytest.importorskip("pyvista")
    from pyvista_vdi.plotting import component

    monkeypatch.setattr(component, "added", lambda plotter, volume, asked, remember: asked)
    drawing = {"target_fps": 9.0, "adjust_multi_samples": False, "regenerate": "never"}
    drawing |= {"regenerate_below": 0.5, "draw": "vdi"}
    place = {"name": "n", "culling": "front", "reset_camera": False, "pickable": False}
    place |= {"render": False, "scalar_bar_args": {"title": "t"}, "show_scalar_bar": True}
    place |= {"status": True, "multi_colors": True}
    given = {name: value for name, value in OTHERS.items() if name != "lights"}
    plotter = pv.Plotter(off_screen=True)
    asked = plotter.add_vdi(None, **given, **drawing, **place, categories=3, annotations={1.0: "a"})
    plotter.close()
    wanted = {**given, **drawing, **place, **KEPT, "categories": 3, "annotations": {1.0: "a"}}
    del wanted["lights"]
    found = {}
    for record in (asked.array, asked.look, asked.options, asked.drawing, asked.place):
        found.update((each.name, getattr(record, each.name)) for each in fields(record))
    assert {name: found[name] for name in wanted} == wanted
    assert set(declared(Look)) <= set(given)


def test_what_is_made_twice_is_equal_and_what_is_given_is_told():
    assert GenerationOptions() == GenerationOptions(lights=Lights())
    assert GenerationOptions(tolerance=0.5).given == {"tolerance": 0.5}
    assert not QualityTarget("reference")
    assert QualityTarget(max_bytes=1e3).given == {"max_bytes": 1000}
    options = GenerationOptions()
    assert GenerationOptions.of(options, {}) is options
    assert GenerationOptions.of(options, {"view_cone": 5}).view_cone == 5
