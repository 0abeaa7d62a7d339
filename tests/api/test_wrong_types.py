"""Every public entry with values of wrong types: only the package's own errors come out.

And each argument that a message names is one of something public.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import inspect
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from extension_marks import cases

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main
from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import declared

PACKAGE = Path(pvdi.__file__).parent
ARRAY = np.random.default_rng(0).random((6, 5, 4), dtype=np.float32)
VOLUME = pvdi.Volume(ARRAY)
CAMERA = pvdi.Camera((1.5, -20, 3), (1.5, 2, 2.5), (0, 0, 1))
TABLE = pvdi.TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 1))
SIZE = (6, 5)


def wrong_values(vdi):
    """Return values of all kinds, of which some are right for some arguments."""
    return [
        None, True, -1, 2.5, float("nan"), float("inf"), 10**400, 1j, "x", "", b"x", object(),
        abs, int, [], (), {}, {"a": 1}, [1, 2, 3], ["a", "b"], (1, 2), (1,), [None, None],
        [[1, 2], [3]], np.zeros(3), np.zeros((2, 2)), np.array("x"), np.zeros((3, 3, 3), complex),
        Path("x"), slice(None), np.float32(0.5), range(3), iter([1, 2]), ARRAY, VOLUME, CAMERA,
        TABLE, vdi,
    ]  # fmt: skip


class OneRank:
    """A communicator of one."""

    rank, size = 0, 1

    def allgather(self, value):
        return [value]

    gather = allgather

    def alltoall(self, values):
        return values

    def scatter(self, values):
        return values[0]

    def bcast(self, value):
        return value


def in_situ(path, camera, window_size, dimensions, every, values, first, at, **options):
    InSitu = importlib.import_module("pyvista_vdi.extensions.insitu").InSitu
    with InSitu(path, camera, window_size, dimensions, every=every, **options) as show:
        show(values, first, at)


def write(path, step, time, **options):
    with pvdi.SeriesWriter(path, **options) as out:
        out.append(step, time)


def series_of(vdi):
    return pvdi.VDISeries([vdi, vdi])


MADE = {"volume": VOLUME, "camera": CAMERA, "window_size": SIZE}
TABLED = {**MADE, "transfer_function": TABLE}
LOOK = tuple(declared(Classification))
OF_GENERATE = [
    each.name
    for each in inspect.signature(pvdi.generate).parameters.values()
    if each.name not in (*MADE, *LOOK) and each.kind is not each.VAR_KEYWORD
]
#: Settings that generate has no use for.
_OF_PICTURES = ("transmittance_cutoff", "adjust_multi_samples", "regenerate_below", "coverage")
#: For each entry: the function, what is right, and further arguments.
ENTRIES = {
    "generate": lambda vdi: (pvdi.generate, TABLED, OF_GENERATE),
    "looks": lambda vdi: (
        pvdi.generate,
        MADE,
        LOOK[:-1],
    ),
    "estimate": lambda vdi: (
        pvdi.estimate,
        {"volume": VOLUME, "window_size": SIZE, "transfer_function": TABLE},
        ["max_supersegments", "settings", "device"],
    ),
    "render_volume": lambda vdi: (
        pvdi.render_volume,
        TABLED,
        [
            *("opaque_depth", "clipping_planes", "cropping", "lights"),
            *("early_termination", "opacity_multiplier", "settings"),
        ],
    ),
    "Settings": lambda vdi: (pvdi.Settings, {}, None),
    "Settings of a VDI": lambda vdi: (
        lambda **given: pvdi.generate(**TABLED, settings=pvdi.Settings(**given)),
        {},
        [name for name in pvdi.Settings.declared if name not in _OF_PICTURES],
    ),
    "render": lambda vdi: (pvdi.render, {"vdi": vdi, "camera": CAMERA}, None),
    "several": lambda vdi: (pvdi.render, {"vdi": [vdi, vdi], "camera": CAMERA}, None),
    "depth": lambda vdi: (pvdi.render_depth, {"vdi": vdi, "camera": CAMERA}, None),
    "pick": lambda vdi: (pvdi.pick, {"vdi": vdi, "camera": CAMERA, "pixel": (3, 3)}, None),
    "read": lambda vdi: (pvdi.read, {"path": "none.vdi"}, ["progress", "camera"]),
    "open_volume": lambda vdi: (pvdi.open_volume, {"path": "s.h5"}, None),
    "compare_images": lambda vdi: (
        pvdi.compare_images,
        {"image": np.zeros((20, 20, 4), "f4"), "reference": np.zeros((20, 20, 4), "f4")},
        None,
    ),
    "generate_series": lambda vdi: (
        pvdi.generate_series,
        {"volumes": [VOLUME], "camera": CAMERA, "window_size": SIZE, "transfer_function": TABLE},
        ["times", "spacing", "origin", "progress", "precision", "quality", "max_supersegments"],
    ),
    "generate_set": lambda vdi: (
        pvdi.generate_set,
        {"volume": VOLUME, "views": [CAMERA], "window_size": (16, 12), "lists": 0.5}
        | {"max_supersegments": 4, "transfer_function": TABLE},
        ["camera", "half_angle", "progress"],
    ),
    "SeriesWriter": lambda vdi: (
        write,
        {"path": "w.vdis", "camera": CAMERA, "window_size": SIZE, "transfer_function": TABLE}
        | {"step": VOLUME, "time": 0, "overwrite": True},
        ["precision", "compression", "level", "append", "quality"],
    ),
    "InSitu": lambda vdi: (
        in_situ,
        {"path": "i.vdis", "camera": CAMERA, "window_size": SIZE, "dimensions": (4, 5, 6)}
        | {"every": 1, "values": ARRAY, "first": (0, 0, 0), "at": 0.0, "overwrite": True}
        | {"comm": OneRank(), "transfer_function": TABLE},
        ["spacing", "origin", "append", "device", "max_supersegments"],
    ),
    "Volume": lambda vdi: (pvdi.Volume, {"array": ARRAY}, None),
    "Camera": lambda vdi: (
        pvdi.Camera,
        {"position": (0, 0, 9), "focal_point": (0, 0, 0), "view_up": (0, 1, 0)},
        None,
    ),
    "TransferFunction": lambda vdi: (
        pvdi.TransferFunction,
        {"colors": np.eye(3), "opacities": [0, 0.1, 0.2], "scalar_range": (0, 1)},
        None,
    ),
    "Cropping": lambda vdi: (pvdi.Cropping, {"planes": (0, 1, 0, 1, 0, 1)}, None),
    **{
        name: lambda vdi, name=name: (getattr(pvdi, name), {}, None)
        for name in ("Light", "Lights", "Shading")
    },
    "VDISeries": lambda vdi: (pvdi.VDISeries, {"steps": [vdi], "times": [0]}, None),
    "VDISeries.nearest": lambda vdi: (series_of(vdi).nearest, {"time": 0}, None),
    "VDISet": lambda vdi: (pvdi.VDISet, {"views": [vdi]}, None),
    "VDISet.nearest": lambda vdi: (pvdi.VDISet([vdi]).nearest, {"camera": CAMERA}, None),
    "VDI": lambda vdi: (
        pvdi.VDI,
        {name: getattr(vdi, name) for name in inspect.signature(pvdi.VDI).parameters},
        None,
    ),
    "VDI.with_precision": lambda vdi: (vdi.with_precision, {"precision": "exact"}, None),
    "VDI.list_at": lambda vdi: (vdi.list_at, {"x": 1, "y": 1}, None),
    "VDI.equals": lambda vdi: (vdi.equals, {"other": vdi}, None),
    "VDI.save": lambda vdi: (
        vdi.save,
        {"path": "v.vdi"},
        ["path", "precision", "compression", "level", "progress"],
    ),
    "VDISeries.save": lambda vdi: (
        series_of(vdi).save,
        {"path": "v.vdis"},
        ["path", "precision", "compression", "level", "progress"],
    ),
    "VDISet.save": lambda vdi: (
        pvdi.VDISet([vdi]).save,
        {"path": "v.vdiset"},
        ["precision", "compression", "level", "progress"],
    ),
    "Camera.azimuth": lambda vdi: (CAMERA.azimuth, {"degrees": 1}, None),
    "Camera.tile": lambda vdi: (
        CAMERA.tile,
        {"window_size": SIZE, "corner": (0, 0), "tile_size": (2, 2)},
        None,
    ),
    "Camera.from_dict": lambda vdi: (pvdi.Camera.from_dict, {"state": CAMERA.to_dict()}, None),
    "TransferFunction.from_dict": lambda vdi: (
        pvdi.TransferFunction.from_dict,
        {"state": TABLE.to_dict()},
        None,
    ),
}


@pytest.fixture
def vdi(default_runtime, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return pvdi.generate(**TABLED)


@pytest.mark.parametrize(
    "entry",
    [
        pytest.param(
            *case.values, marks=[*case.marks, *[pytest.mark.slow] * (name == "generate_set")]
        )
        for name, case in zip(ENTRIES, cases(*ENTRIES), strict=True)
    ],
)
def test_only_errors_of_the_package_come_out(entry, vdi, tmp_path):
    if entry == "open_volume":
        with pytest.importorskip("h5py").File(tmp_path / "s.h5", "w") as file:
            file["x"] = ARRAY
    if entry == "looks":
        pytest.importorskip("pyvista")  # its colour maps
    function, right, more = ENTRIES[entry](vdi)
    named = inspect.signature(function).parameters.values() if more is None else ()
    names = [p.name for p in named if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    escaped = []
    # A wrong communicator would begin MPI in this process: tests/extensions/insitu gives ranks one
    for name in dict.fromkeys(n for n in [*right, *names, *(more or ())] if n != "comm"):
        for value in wrong_values(vdi):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    function(**{**right, name: value})
            except (VDIError, IndexError) as error:  # of a place outside, as of sequences
                if len(str(error)) < 15:
                    escaped.append((name, value, "says nothing", str(error)))
            except Exception as error:
                escaped.append((name, repr(value)[:40], repr(error)[:120]))
    assert not escaped


def messages():
    """Yield where an error or a warning is made, the function that makes it, and its words."""
    for file in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(file.read_text())
        inside = {}
        for function in ast.walk(tree):  # outer ones first
            if isinstance(function, ast.FunctionDef):
                inside.update(dict.fromkeys(ast.walk(function), function))
        for node in ast.walk(tree):
            name = getattr(getattr(node, "func", None), "id", "")
            if isinstance(node, ast.Raise) or name == "warn_external" or name.endswith("Error"):
                words = [
                    part.value
                    for part in ast.walk(node)
                    if isinstance(part, ast.Constant) and isinstance(part.value, str)
                ]
                yield f"{file.relative_to(PACKAGE)}:{node.lineno}", inside.get(node), words


#: Words with an underscore, or before an equals sign, that are no names of Python's.
OTHER_WORDS = {
    *("element_size_um", "written_by", "full_name"),  # of files, a device
    *("frame_", "step_"),  # names of files
    *("kingsnake", "kingsnake_1024x1024x795_uint8", "kingsnake_like"),  # volumes
    *("x_low", "x_high", "y_low", "y_high", "z_low", "z_high"),  # of six numbers
    *("pyvista_vdi", "type", "writeable", "thickness"),  # of pages, NumPy and `read`'s options
}


def public_names():
    """Return the public names, and those of their methods and parameters."""
    things = [(name, getattr(pvdi, name)) for name in pvdi.__all__]
    things += vars(pvdi.examples).items()
    page = (PACKAGE.parent / "docs" / "api.md").read_text()
    for place in re.findall(r"auto(?:function|class|method):: (pyvista_vdi[\w.]+)", page):
        things.append((place.rpartition(".")[2], None))
    names = set()
    for name, thing in things:
        members = inspect.getmembers(thing) if inspect.isclass(thing) else []
        for each, value in [(name, thing), *members]:
            names.add(each)
            if callable(value) and not each.startswith("__"):
                try:
                    call = vars(value).get("__call__", value) if inspect.isclass(value) else value
                    names.update(inspect.signature(call).parameters)
                except (TypeError, ValueError):  # VTK's own
                    continue
    return names


def test_each_argument_that_a_message_names_is_there():
    """``block_bytes``, say, is an argument of nothing public."""
    if not (PACKAGE.parent / "docs" / "api.md").is_file():
        pytest.skip("the documentation is not beside the package")
    names = public_names() | OTHER_WORDS
    pattern = re.compile(r"(?<![\w.\-/<\"'])([a-z][a-z0-9]*(?:_[a-z0-9_]*)?)(=(?!=)|\b)")
    unknown = []
    for place, function, words in messages():
        arguments = function.args if function else None
        own = {a.arg for a in (*arguments.args, *arguments.kwonlyargs)} if arguments else set()
        for found in pattern.finditer(" ".join(words)):
            word = found[1]
            if ("_" in word or found[2] == "=") and word not in names | own:
                unknown.append((place, word))
    assert not unknown


#: Of pip, oiiotool and gdcmconv.
OPTIONS_OF_OTHERS = {"--upgrade", "--subimage", "--raw"}


def help_of(capsys, *verb):
    with contextlib.suppress(SystemExit):
        main([*verb, "--help"])
    return capsys.readouterr().out


def test_each_option_of_the_command_line_that_a_message_names_is_there(capsys):
    verbs = re.findall(r"^    (\w+) ", help_of(capsys), re.M)
    options = set(re.findall(r"--[a-z][a-z-]*", "".join(help_of(capsys, verb) for verb in verbs)))
    unknown = [
        (place, word)
        for place, _, words in messages()
        for word in re.findall(r"(?<![\w-])--[a-z][a-z-]*", " ".join(words))
        if word not in options | OPTIONS_OF_OTHERS
    ]
    assert "--scheduler" in options
    assert not unknown
