"""Bad input to the plugin: refused where it is given, by name, with values and a remedy."""

from __future__ import annotations

import inspect
import re

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import soft_ball, vdi_of_one_list
from settings import with_settings

import pyvista_vdi as pvdi
from pyvista_vdi import errors

pytestmark = pytest.mark.gl


WINDOW = (60, 50)


VOLUME = soft_ball(8)
N = VOLUME.n_points
EMPTY_POINTS = pv.ImageData(dimensions=(4, 4, 4))


def grid_of(values):
    grid = pv.ImageData(dimensions=(4, 4, len(values) // 16))
    grid["v"] = np.asarray(values, dtype=float)
    return grid


#: Arguments with a good volume that are out of range.
ARGUMENTS = {
    "cmap": ({"cmap": "viridi"}, "cmap='viridi' is no colour map.*did you mean 'viridis'"),
    "opacity": ({"opacity": "sigmoit"}, "opacity='sigmoit'.*did you mean 'sigmoid'"),
    "opacity too long": ({"opacity": np.zeros(300)}, r"n_colors=256.*\(300,\)"),
    "clim": ({"clim": (3, 1)}, r"clim.*got \(3.0, 1.0\)"),
    "unit distance": ({"opacity_unit_distance": -1.0}, "opacity_unit_distance.*got -1.0"),
    "mapper": ({"mapper": "cpu"}, "mapper='cpu' is none of"),
    "too many": ({"max_supersegments": 4097}, "1 to 4096; got 4097"),
    "memory": ({"memory_limit": "lots"}, "memory_limit.*got 'lots'"),
    "coverage": ({"coverage": "all"}, "coverage.*got 'all'"),
}
#: Scalars and blending modes that a good volume cannot be drawn with.
SCALARS = {
    "unknown": ("w", errors.InvalidVolumeError, r"no array 'w': its arrays are \['v'\]"),
    "too few": (np.zeros(5), errors.InvalidVolumeError, r"per point \(512\).*\(5,\)"),
    "texts": (np.full(N, "a"), errors.InvalidVolumeError, "scalars must be numbers"),
    "RGBA": (np.zeros((N, 4), np.uint16), errors.UnsupportedError, "no RGBA colours.*or one scal"),
}
BLENDING = ("minimum", "maximum", 1)
INFINITE = grid_of(np.r_[np.zeros(63), np.inf])
UNEVEN = pv.RectilinearGrid([0.0, 1, 3], [0.0, 1], [0.0, 1])
#: The volumes, kinds of error and words of what is refused whatever the arguments.
VOLUMES = {
    "no scalars": (EMPTY_POINTS, errors.InvalidVolumeError, "no scalars: there is nothing"),
    "one plane": (grid_of(np.zeros(16)), errors.InvalidVolumeError, "only one plane.*at least two"),
    "empty": (pv.ImageData(), errors.InvalidVolumeError, "the volume is empty"),
    "all NaN": (grid_of([np.nan] * 64), errors.InvalidVolumeError, "every value is NaN"),
    "infinite": (INFINITE, errors.InvalidArgumentError, "from 0.0 to inf: give a finite"),
    "flat array": (np.zeros((3, 3)), errors.InvalidVolumeError, r"shape \(3, 3\)"),
    "RGBA array": (np.zeros((3, 3, 3, 4)), errors.UnsupportedError, "no RGBA colours"),
    "rectilinear": (UNEVEN, errors.UnsupportedError, "not a uniform grid.*resample"),
    "unstructured": (
        *(VOLUME.cast_to_unstructured_grid(), errors.UnsupportedError),
        "not a uniform.*resample",
    ),
    "blocks": (pv.MultiBlock([VOLUME, pv.Sphere()]), errors.UnsupportedError, "voxelise a surface"),
    "surface": (pv.Sphere(), errors.UnsupportedError, "voxelise a surface"),
    "a path": ("brain.nrrd", errors.InvalidVolumeError, "brain.nrrd does not exist"),
}
#: Volumes, arguments, kinds of error and words of the message.
ROWS = {
    "resolution": (
        *(np.zeros((3, 3, 3)), {"resolution": (1, 2)}, errors.InvalidArgumentError),
        r"three positive spacings; got \(1, 2\)",
    ),
    "camera": (VOLUME, {"camera": "xy"}, errors.InvalidCameraError, "vtkCamera.*got str"),
    "device": (VOLUME, {"device": "no such device"}, errors.NoDeviceError, "no such device"),
    "unknown keyword": (VOLUME, {"opcity": 1}, TypeError, "'opcity': did you mean 'opacity'"),
    "scalar": (VOLUME, {"scalar": "v"}, TypeError, "'scalar': did you mean 'scalars'"),
    **{name: (volume, {}, *rest) for name, (volume, *rest) in VOLUMES.items()},
    **{f"scalars: {k}": (VOLUME, {"scalars": v}, *rest) for k, (v, *rest) in SCALARS.items()},
    **{
        f"blending: {given}": (
            *(VOLUME, {"blending": given}, errors.UnsupportedError),
            f"blending={given!r}.*composite.*add_volume",
        )
        for given in BLENDING
    },
    **{
        name: (VOLUME, arguments, errors.InvalidArgumentError, message)
        for name, (arguments, message) in ARGUMENTS.items()
    },
}


@pytest.mark.parametrize(("volume", "arguments", "error", "message"), ROWS.values(), ids=ROWS)
def test_add_vdi_refuses(plotter, volume, arguments, error, message):
    with pytest.raises(error, match=re.compile(message, re.DOTALL)):
        plotter.add_vdi(volume, **with_settings(**arguments))
    assert not plotter.renderer.actors, "something was added although it was refused"
    assert not plotter.scalar_bars


ADD_VDI = inspect.signature(pv.Plotter(off_screen=True).add_vdi).parameters


@pytest.mark.parametrize("name", [n for n in ADD_VDI if n not in ("volume", "aliases")])
def test_a_wrong_value_of_any_argument_leaves_the_plotter_as_it_was(plotter, name):
    """Those that PyVista finds only after it has added the actor included."""
    plotter.add_mesh(pv.Sphere(), name="ball")
    wrong_ones = ("sideways", -3.5, object(), (1, 2), np.ones(3), {"bogus": 1}, {"n_labels": "x"})
    for wrong in wrong_ones:
        before = dict(plotter.actors)
        try:
            actor = plotter.add_vdi(VOLUME, **{name: wrong})
        except Exception:
            assert dict(plotter.actors) == before, wrong
            assert not plotter.scalar_bars, wrong
        else:  # what is wrong for one argument is right for another
            plotter.remove_actor(actor)


@pytest.mark.parametrize(
    "arguments",
    [
        {"cmap": "bone"},
        {"clim": (0, 1), "opacity": "linear_r"},
        {"max_supersegments": 5},
        {"ambient_occlusion": True},
        {"camera": pvdi.Camera((0, 0, 9), (0, 0, 0), (0, 1, 0))},
        {"scalars": np.zeros(3)},
    ],
    ids=lambda a: "+".join(a),
)
def test_a_vdi_has_its_classification_already(plotter, arguments):
    named = ", ".join(sorted(arguments))
    with pytest.raises(errors.UnsupportedError, match=f"{named} cannot be given with a VDI"):
        plotter.add_vdi(vdi_of_one_list(), **arguments)


@pytest.mark.parametrize("stored", [None, "ramp", {"colors": [1], "opacities": 0}])
def test_a_vdi_without_transfer_function_has_no_scalar_bar(plotter, stored):
    vdi = vdi_of_one_list()
    vdi.metadata["transfer_function"] = stored
    actor = plotter.add_vdi(vdi)
    assert not plotter.scalar_bars
    plotter.remove_actor(actor)
    with pytest.raises(errors.UnsupportedError, match="no transfer function.*show_scalar_bar"):
        plotter.add_vdi(vdi_of_one_list(), show_scalar_bar=True)


#: Arguments that ``add_volume`` refuses as well, each by a builtin that scripts catch.
REFUSED_BY_BOTH = [
    {"scalars": "w"},
    {"scalars": np.zeros(5)},
    {"clim": (1, 2, 3)},
    {"opacity": None},
    {"opacity": "sigmoit"},
    {"n_colors": 2.5},
    {"cmap": 5},
    {"mapper": "cpu"},
    {"culling": "sideways"},
    {"opcity": 1},
    {"volume": pv.Sphere()},
]


# Processes that share the tests must have one name for each: none with an address in it
@pytest.mark.parametrize("arguments", REFUSED_BY_BOTH, ids="-".join)
def test_errors_are_those_of_add_volume_too(plotter, arguments):
    arguments = {"volume": VOLUME.copy(), **arguments}
    raised = []
    for add in (plotter.add_volume, plotter.add_vdi):
        with pytest.raises(Exception) as caught:  # noqa: PT011 - which is compared below
            add(**arguments)
        raised.append(caught.value)
    vtks, ours = raised
    builtins = [kind for kind in (TypeError, KeyError, ValueError) if isinstance(vtks, kind)]
    assert builtins, f"add_volume raises {vtks!r}"
    assert isinstance(ours, tuple(builtins)), f"{ours!r} in place of {vtks!r}"
    assert isinstance(ours, errors.VDIError) or "keyword" in str(ours) or "culling" in arguments
    assert not str(ours).startswith(("'", '"')), "KeyError's quotes"
