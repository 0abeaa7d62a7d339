"""Wrong values of options: every door that takes one refuses it in the same words.

The command line's are in ``tests/cli/test_wrong_values.py``.
"""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIError

SIZE = (12, 9)
CAMERA = pvdi.Camera((3, 3, 30), (3, 3, 3), (0, 1, 0))
VOLUME = pvdi.Volume((np.arange(343.0, dtype=np.float32) % 11).reshape(7, 7, 7))
VDI = pvdi.VDI(CAMERA, (1, 1), [0, 1], [26], [32], [[1, 0, 0]], [1], (0, 6, 0, 6, 0, 6))
PLANES = r"clipping_planes must be \(k, 6\) finite"
EDGES = "from 1 to 65536 whole pixels each; got"

#: Options, a value of each that is wrong, and what is said.
WRONG = [
    ("window_size", (0, 9), rf"{EDGES} \(0, 9\)"),
    ("window_size", (12.5, 9), r"whole pixels each; got \(12.5, 9\)"),
    ("window_size", "ab", "whole pixels each; got 'ab'"),
    ("camera", "xyz", "expected a pyvista_vdi.Camera, a vtkCamera"),
    ("blending", "mip", "blending='mip' is not supported: .*Plotter.add_volume"),
    ("preference", "row", "preference must be 'point' or 'cell'"),
    ("clim", (2, 1), "clim must be two finite numbers, the smaller first"),
    ("n_colors", 0, "n_colors must be a whole number from 1 to 16384; got 0"),
    ("cmap", "viridys", "cmap='viridys'.*did you mean 'viridis'"),
    ("opacity", [-1e308, 1e308], "stretched to that range, .* different values"),
    ("opacity_unit_distance", "x", "opacity_unit_distance must be a length .* got 'x'"),
    ("interpolation", "cubic", "must be 'nearest' or 'linear'"),
    ("transfer_function", "bone", "must be a pyvista_vdi.TransferF"),
    ("max_supersegments", 4097, "1 to 4096; got 4097"),
    ("precision", "half", "precision must be .*'half'"),
    ("quality", "best", "quality must be .*'best'"),
    ("opaque_depth", np.ones(SIZE), r"have shape \(height, width\) = \(9, 12\); got \(12, 9\)"),
    ("opaque_depth", "near", "opaque_depth must have shape.*'near'"),
    ("clipping_planes", [[0, 0, 0, 0, np.nan, 1]], PLANES),
    ("clipping_planes", [[0, 0, 0, 0, 0, 0]], PLANES),
    ("clipping_planes", "x < 0", rf"{PLANES}.*'x < 0'"),
    ("cropping", (0, 1), "cropping"),
    ("opacity_multiplier", -1, "got -1"),
    ("opacity_threshold", 1, "opacity_threshold must be an .* from 0 to below 1; got 1"),
    ("sample_distance", 0, "sample_distance must be .*got 0$"),
    ("sample_distance", "small", "sample_distance must be .*got 'small'"),
    ("criterion", "homogenity", "did you mean 'homogeneity'"),
    ("tolerance", -1, "tolerance.*got -1"),
    ("view_cone", 91, "view_cone.*got 91"),
    ("memory_limit", "lots", "memory_limit.*got 'lots'"),
    ("regenerate_below", 1.5, "must be an SSIM .*got 1.5"),
    ("transmittance_cutoff", 1, "got 1"),
    ("target_fps", -1, "frames per second, 0 or above; got -1"),
    ("regenerate", "always", "regenerate must be .*'auto'.*'never'.*'always'"),
    ("draw", "both", "draw must be .*'both'"),
]


def doors(name, value):
    """Yield each public function, and method of the VTK pipeline, that takes an option."""
    made = {"volume": VOLUME, "camera": CAMERA, "window_size": SIZE, "opacity": "linear"}
    drawn = {"vdi": VDI, "camera": CAMERA, "window_size": SIZE}
    of_names = {
        "generate": made,
        "render_volume": made,
        "render": drawn,
        "render_depth": drawn,
        "pick": {**drawn, "pixel": (0, 0)},
        "Settings": {},
    }
    for function, right in of_names.items():
        called = getattr(pvdi, function)
        if (function, name) in {("pick", "opaque_depth"), ("Settings", "sample_distance")}:
            continue  # it is the pixel's; it depends on the volume
        if name in inspect.signature(called).parameters:
            given = {**right, name: value}
            if name in ("transfer_function", "cmap"):
                given.pop("opacity", None)
            yield lambda called=called, given=given: called(**given)
    if name == "sample_distance":
        yield lambda: pvdi.generate(**made, settings=pvdi.Settings(sample_distance=value))
    pv = pytest.importorskip("pyvista")
    from pyvista_vdi.plotting.component import AddVDI
    from pyvista_vdi.vtk_pipeline.vtk import vtkGPUVolumeRayCastMapper

    plotter = pv.Plotter(off_screen=True)
    if name in inspect.signature(AddVDI.__call__).parameters:
        yield lambda: plotter.add_vdi(VOLUME, **{name: value})
    if name == "cropping":
        return  # a switch of VTK's mapper
    source, mapper = pvdi.VDISource(), pvdi.VDIMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    setter = f"Set{name.title().replace('_', '')}"
    for made_by in (source, mapper):
        if setter in dir(made_by) and setter not in dir(vtkGPUVolumeRayCastMapper):
            yield lambda made_by=made_by: getattr(made_by, setter)(value)


@pytest.mark.gl
@pytest.mark.parametrize(
    ("name", "value", "message"), WRONG, ids=[f"{name}-{k}" for k, (name, *_) in enumerate(WRONG)]
)
def test_every_door_refuses_it_in_the_same_words(name, value, message, default_runtime):
    found = [*doors(name, value)]
    assert found
    for door in found:
        with pytest.raises(VDIError, match=message):
            door()


@pytest.mark.parametrize("blending", ["maximum", "minimum", "average", "additive"])
def test_a_vdi_composites(blending):
    with pytest.raises(pvdi.UnsupportedError, match=f"'{blending}' is not .* by .*add_volume"):
        pvdi.generate(VOLUME, CAMERA, SIZE, blending=blending)


@pytest.mark.parametrize(
    ("function", "given", "message"),
    [
        (pvdi.generate, {"colormap": 1}, "did you mean 'cmap'"),
        (pvdi.render, {"vdi": VDI, "camera": CAMERA, "options": 1}, "argument 'options'"),
        (pvdi.generate, {"qqqq": 1}, "known are volume, camera"),
        (pvdi.generate, {"tolerance": 0.1}, r"settings=pyvista_vdi\.Settings\(tolerance=\.\.\.\)"),
        (pvdi.Settings, {"tolerence": 1}, "did you mean 'tolerance'"),
        (pvdi.render, {"vdi": VDI, "camera": CAMERA, "scalars": 1}, "this VDI's colours are fixed"),
    ],
)
def test_an_unknown_keyword_is_a_type_error(function, given, message):
    with pytest.raises(TypeError, match=message):
        function(**given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"volume_property": 3, "transfer_function": 4}, "in place of transfer_function"),
        ({"volume_property": 3, "cmap": "bone"}, "in place of cmap: leave"),
        ({"settings": {"tolerance": 0.1}}, "settings must be a pyvista_vdi.Settings"),
        ({"settings": pvdi.Settings(coverage="view")}, "coverage of the settings means nothing"),
    ],
)
def test_what_excludes_each_other_is_refused(given, message):
    with pytest.raises(VDIError, match=message):
        pvdi.generate(VOLUME, CAMERA, SIZE, **given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.zeros((4, 4, 4)), r"got a NumPy array of shape \(4, 4, 4\).*pyvista_vdi.Volume\(array"),
        ("knee.nrrd", "knee.nrrd does not exist: check the volume's path"),
        (None, "got NoneType"),
        (
            pvdi.Volume(np.full((3, 3, 3), np.nan), name="density"),
            "every value of 'density' is NaN",
        ),
    ],
)
def test_what_is_no_volume(given, message, default_runtime):
    for function in (pvdi.generate, pvdi.render_volume):
        for _ in range(2):  # nothing of the first is remembered as good
            with pytest.raises(pvdi.InvalidVolumeError, match=message):
                function(given, CAMERA, SIZE, cmap="bone")
