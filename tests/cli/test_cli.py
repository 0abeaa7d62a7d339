"""The command line: what each verb does, and that every mistake is one clear line."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import time

import nrrd
import numpy as np
import pytest
from command_line import complaint, run
from extension_marks import cases
from PIL import Image

import pyvista_vdi as pvdi
from pyvista_vdi import cli, io, registry
from pyvista_vdi.cli import parser
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.plotting import progress

NAMES = """
devices generate render view info convert serve series set compare tradeoff
paraview
"""
OF_EXTENSIONS = {"paraview": "paraview", "series": "series", "set": "sets", "serve": "web"}
VERBS = [n for n in NAMES.split() if OF_EXTENSIONS.get(n) in (None, *registry.extensions())]


@pytest.fixture(autouse=True)
def _no_debug(monkeypatch):
    monkeypatch.delenv(cli.DEBUG_VARIABLE, raising=False)


BOUNDS = (0, 7, 0, 9, 0, 11)
VIEW = filling_camera(BOUNDS, (24, 16))


def vdi_of(n, camera=VIEW, front=20.0, thickness=1.0, color=(1.0, 0.5, 0.0), metadata=None):
    """A VDI with one supersegment in each of its first n lists."""
    offsets = np.minimum(np.arange(24 * 16 + 1), n)
    faces = (np.full(n, front), np.full(n, front + thickness))
    media = (np.full((n, 3), color), np.full(n, 0.7))
    return pvdi.VDI(camera, (24, 16), offsets, *faces, *media, BOUNDS, metadata=metadata)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a volume, a transfer function, a camera, a VDI, a page of it, and rubbish."""
    path = tmp_path_factory.mktemp("cli")
    z, y, x = np.mgrid[:12, :10, :8]
    nrrd.write(str(path / "v.nrrd"), (x * y + z).astype(np.uint8), index_order="C")
    table = pvdi.TransferFunction([(0, 0, 0.2), (1, 0.5, 0)], [0, 0.5], (0, 74))
    (path / "tf.json").write_text(json.dumps(table.to_dict()))
    (path / "camera.json").write_text(json.dumps(VIEW.to_dict()))
    vdi = vdi_of(200, metadata={"criterion": "none"})
    vdi.save(path / "a.vdi")
    if "web" in registry.extensions():
        page = vdi.save(path / "a.html").read_bytes()
        (path / "cut.html").write_bytes(page[: page.rindex(b"</script>") - 101])
    return path


@pytest.mark.parametrize("verb", VERBS)
def test_each_verb_explains_itself_with_an_example(verb, capsys):
    out = run(capsys, verb, "--help")
    example = out.partition("Example:\n  pyvista-vdi ")[2].split()
    assert example[0] == verb
    assert parser.parse(example) is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("generat", "there is no subcommand 'generat': did you mean 'generate'?"),
        # Not "argument VOLUME: not allowed with argument --example" for the value behind it
        (
            "generate --example brain --qualty high -o a",
            "generate takes no argument '--qualty': did you mean '--quality'?",
        ),
        ("info a b", "info takes no argument 'b': known are --help, --example"),
        ("generate -o b", "one of the arguments VOLUME --example is required"),
        ("generate a --example b -o c", "not allowed with argument"),
        ("generate a -o b --position 1 2", "expected 3 arguments"),
    ],
)
def test_mistakes_in_the_arguments(arguments, message, capsys):
    assert re.search(
        message.replace("?", r"\?"), complaint(capsys, *shlex.split(arguments), status=2)
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    cases(
        ("info a.vdi --spacing 1 1 2", "--spacing=.*1.0, 2.0.* is for volumes, and a.vdi is a VDI"),
        (
            "view a.vdi --cmap bone --screenshot b.png",
            "--cmap=bone is for .*a.vdi has its look",
        ),
        ("render v.nrrd -o a.png", "v.nrrd is not a VDI file.*'pyvista-vdi generate'"),
        ("generate v.nrrd -o b.vti", "cannot be written as a VDI: the name must end in .vdi"),
        (
            "generate v.nrrd -o b.vdi --transfer-function tf.json --cmap bone",
            "transfer_function stands in place of cmap",
        ),
        ("view cut.html --screenshot b.png", "cut.html is damaged: .*copy it from its"),
        ("generate none.nrrd -o b.vdi", "none.nrrd does not exist: check .*, or .*--example"),
        ("generate a.vdi -o b.vdi", "a.vdi is a VDI, not a volume"),
        ("compare none.nrrd --out new", "none.nrrd"),
    ),
)
def test_mistakes_that_the_work_finds(arguments, message, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    assert re.search(message, complaint(capsys, *arguments.split()))
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (
            MemoryError("Unable to allocate 96.0 GiB"),
            1,
            r"not enough memory \(Unable to allocate 96.0 GiB\): lower --size",
        ),
        (KeyboardInterrupt(), 130, "interrupted; nothing was left half done$"),
    ],
)
def test_what_ends_the_work_is_one_line(folder, capsys, monkeypatch, error, status, message):
    def ends(*_, **__):
        raise error

    monkeypatch.setattr("pyvista_vdi.cli.render.render_vdi", ends)
    before = sorted(folder.iterdir())
    arguments = ("render", folder / "a.vdi", "-o", folder / "x.png")
    assert re.match(message, complaint(capsys, *arguments, status=status))
    assert sorted(folder.iterdir()) == before


@pytest.mark.skipif(sys.platform != "linux", reason="file names of any bytes")
def test_a_bar_says_how_far_the_work_is(capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    bar = progress.DelayedBar(always=True, label="rendering")
    for fraction in (0.0, 0.25, 0.5):
        time.sleep(0.15)  # tqdm writes every tenth of a second
        bar(fraction, "drawing")
    assert "rendering: drawing:  50%" in capsys.readouterr().err.split("\r")[-1]
    bar.close()


def test_nothing_that_a_file_says_reaches_the_terminal_raw(capsys, tmp_path):
    """Names and text in a file may hold what moves the cursor, or what cannot be written."""
    path = tmp_path / "\udcff.vdi"  # a byte that is no UTF-8
    vdi_of(200, metadata={"\x1b[31mred\n": "\x1b]0;title\x07"}).save(path)
    out = run(capsys, "info", path)
    assert r"\udcff.vdi" in out
    assert r"\x1b[31mred\n" in out
    assert all(c.isprintable() for c in out.replace("\n", ""))
    run(capsys, "convert", path, "-o", tmp_path / "\udcfe.vdi")
    assert complaint(capsys, "info", tmp_path / "\x1b[2J.vdi").startswith(str(tmp_path))


def test_info(folder, capsys):
    out = run(capsys, "info", folder / "a.vdi")
    lines = dict(line.split("  ", 1) for line in out.splitlines())
    assert lines["window_size"].strip() == "[24, 16]"
    assert lines["n_supersegments"].strip() == "200"
    assert lines["criterion"].strip() == "none"
    out = run(capsys, "info", folder / "a.vdi", "--json")
    about = json.loads(out)
    assert about["n_supersegments"] == 200
    assert pvdi.Camera.from_dict(about["camera"]) == io.read(folder / "a.vdi").camera


def test_view_of_a_volume(folder, capsys, default_runtime, tmp_path):
    """A volume is shown as ``generate`` and ``view`` of its file show it."""
    pv = pytest.importorskip("pyvista")
    looks = ("--cmap", "bone", "--opacity", "linear", "--size", "40x30")
    direct, file, by_file = (tmp_path / name for name in ("a.png", "v.vdi", "b.png"))
    run(capsys, "view", folder / "v.nrrd", "--screenshot", direct, *looks)
    run(capsys, "generate", folder / "v.nrrd", "-o", file, *looks)
    run(capsys, "view", file, "--screenshot", by_file)
    one, other = (pv.read(name).active_scalars.astype(int) for name in (direct, by_file))
    below = one.reshape(30, 40, -1)[12:]  # scalar bars may differ in what they are told
    assert np.abs(below - other.reshape(30, 40, -1)[12:]).max() <= 1
    assert np.ptp(below) > 50


def test_generate_from_a_table_and_render(folder, capsys, default_runtime, tmp_path):
    target, picture = tmp_path / "b.vdi", tmp_path / "b.png"
    options = "--azimuth 30 --size 20x12 --max-supersegments 7 --compression lz4"
    options += " --criterion homogeneity --ambient-occlusion"
    table = ("--transfer-function", folder / "tf.json")
    out = run(capsys, "generate", folder / "v.nrrd", "-o", target, *table, *options.split())
    assert "20 x 12 lists" in out
    vdi = io.read(target)
    assert vdi.window_size == (20, 12)
    assert vdi.counts.max() <= 7
    assert vdi.metadata["criterion"] == "homogeneity"
    occlusion = vdi.metadata["ambient_occlusion"]
    assert occlusion["directions"] == 32
    assert vdi.camera == filling_camera(vdi.bounds, (20, 12), azimuth=30)
    out = run(capsys, "render", target, "-o", picture, "--size", "30x10")
    assert out == f"{picture}: 30 x 10\n"
    with Image.open(picture) as image:
        assert (image.mode, image.size) == ("RGBA", (30, 10))
        expected = io.to_bytes(pvdi.render(vdi, vdi.camera, (30, 10)))
        assert np.array_equal(np.asarray(image), expected)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.png", "b.vdi"]


def test_the_module_is_the_command():
    result = subprocess.run(
        [sys.executable, "-m", "pyvista_vdi", "generat"], capture_output=True, text=True
    )
    assert result.returncode == 2
    assert result.stderr.startswith("pyvista-vdi: error: there is no subcommand 'generat'")
