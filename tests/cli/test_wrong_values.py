"""Every option of every verb with wrong values: one sentence, and nothing is written."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import zlib

import numpy as np
import pytest
from extension_marks import cases

import pyvista_vdi as pvdi
from pyvista_vdi import cli

pytest.importorskip("pyvista")

#: What is right, of each verb: wrong values come behind it.
RIGHT = {
    "devices": "",
    "generate": "v.npy -o old.vdi --size 12x8 --shade",
    "render": "a.vdi -o old.png",
    "view": "v.npy --screenshot old.png --size 12x8 --shade",
    "serve": "v.npy --port 0 --shade",
    "info": "v.npy",
    "compare": "v.npy --out new --size 12x8 --angles 5 --repeats 1 --no-vtk --shade",
    "tradeoff": "v.npy --out new --no-vtk --shade",
    "convert": "a.vdi -o old.vdi",
    "series": "v.npy -o old.vdis --size 12x8 --shade",
    "set": "v.npy -o old.vdiset --size 16x12 --shade",
    "paraview": "",
}

NO_NUMBER = ("x", "''", "nan", "inf")
NO_WHOLE = ("x", "nan", "1.5", "1" + 400 * "0")
BELOW_0 = (*NO_NUMBER, "-1")
NOT_ABOVE_0 = ("x", "nan", "inf", "0")
NO_COUNT = (*NO_WHOLE, "-1", "0")
NO_XYZ = tuple(f"0 {number} 0" for number in NO_NUMBER)
NO_CHOICE = ("x", "''")
NO_JSON = ("none.json", "folder", "empty", "v.npy", "'[1]'", "list.json", "other.json")
NO_VOLUME = ("none.npy", "empty", "empty.npy", "empty.nrrd", "folder", "list.json", "old.png")
NO_VDI = ("none.vdi", "empty", "empty.vdi", "folder", "list.json", "v.npy")
#: Where nothing can be written: each with what is added to a name.
NO_TARGET = ("''", "old.txt", "folder{}", "none/a{}", "old.png/a{}")

#: Wrong values of options that are alike.
ALIKE = {
    NO_NUMBER: "azimuth elevation time",
    BELOW_0: "ambient diffuse specular specular-power tolerance view-cone transmittance-cutoff",
    NOT_ABOVE_0: "full-fps half-angle lists max-bytes memory-limit "
    "opacity-unit-distance parallel-scale sample-distance target-fps "
    "target-ssim thickness view-angle",
    NO_COUNT: "generations max-supersegments n-colors repeats views",
    NO_WHOLE: "compression-level port time-index level",
    NO_XYZ: "focal-point origin position spacing view-up",
    NO_CHOICE: "classification compression draw interpolation precision preference quality "
    "regenerate scalars",
    NO_JSON: "camera-json transfer-function",
    ("nothing", "''", "nan"): "cmap criterion example",
    ("x 1", "0 nan", "2 1"): "clim value-range",
}
#: Wrong values of each option.
WRONG = {
    **{f"--{name}": wrong for wrong, names in ALIKE.items() for name in names.split()},
    "--angles": ("x", "''", "5,nan"),
    "--background": ("x", "0,0", "0,0,2", "0,0,nan", "#12"),
    "--device": ("nothing", "99", "-1"),
    "--host": ("'no such host'", "999.1.1.1"),
    "--opacity": ("nothing", "''", "0,x", "0,nan", "0,1e999"),
    "--size": ("x", "''", "12", "0x3", "-1x3", "12xnan", "99999x3", "3x2x1"),
    "--sweep": ("nothing", "''", "lists=x", "lists=0", "precision=x", "skip-empty=1"),
    "--times": ("x", "''", "1,nan"),
    "--token": ("''",),
    # Of any text, or what depends on what is installed, or what a store of chunks refuses
    **dict.fromkeys(("--allow-host", "--series", "--channel", "--scheduler"), ()),
}
#: Where a verb's option is another than others'.
OF_A_VERB = {
    ("serve", "--lists"): WRONG["--size"],
    ("view", "--target-fps"): BELOW_0,
    ("convert", "--thickness"): NO_NUMBER,
    ("compare", "--out"): ("v.npy", "v.npy/a"),
    ("tradeoff", "--out"): ("v.npy", "v.npy/a"),
    ("view", "--screenshot"): tuple(name.format(".png") for name in NO_TARGET),
    **{
        (verb, "--output"): tuple(name.format(suffix) for name in NO_TARGET)
        for verb, suffix in {
            "generate": ".vdi",
            "convert": ".vdi",
            "render": ".png",
            "series": ".vdis",
            "set": ".vdiset",
        }.items()
    },
}
#: Files in place of the verb's first.
FILES = {
    **dict.fromkeys(("generate", "serve", "compare", "tradeoff", "set", "series"), NO_VOLUME),
    **dict.fromkeys(("info", "view"), (*NO_VOLUME, "none.vdi", "empty.vdi")),
    **dict.fromkeys(("render", "convert"), NO_VDI),
}
#: How messages may call an option, where not by the words of its name.
CALLED = {
    "--camera-json": "camera",
    "--clim": "clim|range",
    "--compression-level": "level",
    "--device": "OpenCL device",
    "--example": "example",
    "--host": "listen",
    "--out": "",
    "--output": "",
    "--scalars": "array|has no volume",
    "--screenshot": "",
    "--sweep": "sweep|lists|precision",
    "--view-angle": "view.angle",
    "": "",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what is right and what is wrong, and files that must stay as they are."""
    path = tmp_path_factory.mktemp("wrong")
    z, y, x = np.mgrid[:6, :5, :4]
    np.save(path / "v.npy", (x * y + z).astype(np.uint8))
    camera = pvdi.Camera((2, -30, 3), (2, 2, 2), (0, 0, 1))
    view = (camera, (2, 1), [0, 1, 1], [20.0], [21.0], [[1, 0.5, 0]], [0.7])
    pvdi.VDI(*view, (0, 3, 0, 4, 0, 5)).save(path / "a.vdi")
    (path / "camera.json").write_text(json.dumps(camera.to_dict()))
    (path / "list.json").write_text("[1]")
    (path / "other.json").write_text('{"a": 1}')
    (path / "folder").mkdir()
    for name in ("folder.vdi", "folder.png", "folder.gif", "folder.exr", "folder.vdis"):
        (path / name).mkdir()
    for name in ("folder.vdiset", "folder.json"):
        (path / name).mkdir()
    for name in ("", ".npy", ".nrrd", ".vdi"):
        (path / f"empty{name}").touch()
    for name in ("vdi", "png", "gif", "exr", "vdis", "vdiset", "txt"):
        (path / f"old.{name}").write_text("what was here before")
    for name in ("vdis", "vdiset"):
        (path / f"old.{name}").write_bytes(b"PK\5\6" + bytes(18))  # a ZIP, which may be replaced
    return path


def contents(folder):
    return {
        path.relative_to(folder): path.is_file() and hashlib.sha256(path.read_bytes()).digest()
        for path in folder.rglob("*")
    }


def options_of(verb, capsys):
    """Return a verb's options that take values, and those that take none, as its help has them."""
    assert cli.main([verb, "--help"]) == 0
    lines = re.findall(r"^ +(?:-o.*?|)(--[a-z-]+)( \S|,|  |$)", capsys.readouterr().out, re.M)
    found = {True: [], False: []}
    for name, behind in lines:
        found[behind.startswith(" ") and not behind.isspace()].append(name)
    return found[True], found[False]


def wrong_values(verb, capsys):
    """Yield an option, or none for a file, one of its wrong values, and the whole command line.

    Of each option's values every third, beginning with another one in each verb.
    """
    right = shlex.split(RIGHT[verb])
    taking, others = options_of(verb, capsys)
    for option in taking:
        wrong = OF_A_VERB[verb, option] if (verb, option) in OF_A_VERB else WRONG[option]
        first = zlib.crc32((verb + option).encode()) % 3
        for value in wrong[first::3] or wrong[:1]:
            values = shlex.split(value)
            given = [option, *values] if len(values) > 1 else [f"{option}={values[0]}"]
            kept = right[1:] if option == "--example" and right[0] == "v.npy" else right
            yield option, value, [verb, *kept, *given]
    for option in others:
        yield option, "x", [verb, *right, f"{option}=x"]
    for file in FILES.get(verb, ()):
        yield "", file, [verb, file, *right[1:]]


def is_named(option, value, message):
    """Whether a message names the option and the value that is wrong."""
    message = message.replace(" x ", "x")
    words = option.strip("-").removesuffix("s").split("-")
    named = all(word in message.lower() for word in words)
    called = option in CALLED and re.search(CALLED[option], message)
    parts = re.split(r"[ ,=]", value.replace("camera.json ", "").strip("'"))
    if len(parts) > 1:
        parts = [part for part in parts if part not in ("0", "1")]  # which are right
    return (named or called) and all(part.lower() in message.lower() for part in parts)


@pytest.mark.parametrize("verb", cases(*RIGHT, by=lambda verb: f"{verb} {RIGHT[verb]}"))
def test_wrong_values_are_named_and_nothing_is_written(
    verb, folder, capsys, monkeypatch, default_runtime
):
    monkeypatch.delenv(cli.DEBUG_VARIABLE, raising=False)
    if verb == "serve":
        server = pytest.importorskip("pyvista_vdi.extensions.web.server", exc_type=ImportError)
        monkeypatch.setattr(server.Server, "wait", lambda server: server.close())  # accepted
    monkeypatch.chdir(folder)
    before, found = contents(folder), []
    for option, value, arguments in wrong_values(verb, capsys):
        try:
            status = cli.main(arguments)
        except Exception as error:
            found.append((option, value, repr(error)))
            continue
        out, err = capsys.readouterr()
        message = err.splitlines()[-1] if err else ""
        right = (
            status in (1, 2)
            and not out
            and message.startswith("pyvista-vdi: error: ")
            and "Traceback" not in err
            and is_named(option, value, message)
        )
        if not right:
            found.append((option, value, status, message, out))
        if contents(folder) != before:
            found.append((option, value, "writes"))
            before = contents(folder)
    assert not found, "\n".join(map(str, found))
