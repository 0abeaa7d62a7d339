"""Which code a figure measured, and the check that names figures older than it."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure import clock

TOOL = Path(__file__).parents[2] / "tools" / "figures.py"

MODULE = '''"""A docstring."""

# a remark
def half(value):
    """Another."""
    return value / 2  # not "# this"
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with one room, in place of the installed one; returns the room's two folders."""
    rooms = tmp_path / "pyvista_vdi" / "room", tmp_path / "opencl" / "room"
    for room in rooms:
        room.mkdir(parents=True)
    places = {"pyvista_vdi": rooms[0].parent, "pyvista_vdi.opencl": rooms[1].parent}
    monkeypatch.setattr(clock, "files", places.get)
    (rooms[0] / "half.py").write_text(MODULE)
    (rooms[1] / "half.cl").write_text("float half_of(float x) { return x / 2; } // a remark\n")
    return rooms


@pytest.mark.parametrize(
    ("file", "old", "new", "counts"),
    [
        ("half.py", "# a remark", "# another", False),
        ("half.py", "A docstring.", "What it does.", False),
        ("half.py", '# not "# this"', "", False),
        ("half.py", "/ 2", "/ 3", True),
        ("half.cl", "// a remark", "/* none */", False),
        ("half.cl", "x / 2", "x * 2", True),
    ],
)
def test_code_counts_and_remarks_do_not(package, file, old, new, counts):
    before = {"sources": {"room": clock.room_hash("room")}}
    path = package[file.endswith(".cl")] / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    assert clock.outdated(before) == (["room"] if counts else [])


def test_a_room_that_is_gone_has_changed(package):
    before = {"sources": {"room": clock.room_hash("room")}}
    for folder in package:
        shutil.rmtree(folder)
    assert clock.outdated(before) == ["room"]
    with pytest.raises(InvalidArgumentError, match="'room' is no folder"):
        clock.room_hash("room")


def test_figures_hold_what_every_picture_passes_through():
    found = clock.provenance(["raycasting"])
    assert set(found["sources"]) == {"device", "lib", "model", "raycasting"}
    assert clock.outdated(found) == []
    place = Path(str(files("pyvista_vdi")))
    assert (found["commit"] is None) or (place.parent / ".git").exists()


@pytest.fixture
def tool():
    """tools/figures.py as a module."""
    if not TOOL.is_file():
        pytest.skip("tools/ is not beside the tests")
    specification = importlib.util.spec_from_file_location("figures", TOOL)
    tool = sys.modules["figures"] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(tool)
    return tool


def test_the_check_names_figures_older_than_what_they_measured(tool, tmp_path):
    measured = clock.provenance(["raycasting"])
    (tmp_path / "now.json").write_text(json.dumps({"measured": measured}))
    measured["sources"]["raycasting"] = "0" * 16
    (tmp_path / "old.json").write_text(json.dumps({"measured": measured}))
    (tmp_path / "silent.json").write_text("{}")
    (tmp_path / "README.md").write_text("<!-- figures: now.json -->\n\ntext\n% figures: old.md\n")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "a.md").write_text(
        "<!-- figures: silent.json -->\n<!-- figures: no.md -->"
    )
    (tmp_path / "docs" / "decisions").mkdir()
    (tmp_path / "docs" / "decisions" / "b.md").write_text("<!-- measured: 0abc volume -->\n")
    assert [each.place for each in tool.figures(tmp_path) if each.once] == ["docs/decisions/b.md:1"]
    found = {each.place: each.older_than for each in tool.figures(tmp_path)}
    assert found == {
        "README.md:1": (),
        "README.md:4": ("raycasting",),
        "docs/a.md:1": ("whatever it measured: its results do not say",),
        "docs/a.md:2": ("whatever it measured: its results are not kept",),
        "docs/decisions/b.md:1": ("volume",),  # of a commit that is not there
    }


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not there")
def test_a_figure_is_as_old_as_its_latest_sample(package, tool, tmp_path):
    def committed():
        git = ["git", "-C", tmp_path, "-c", "user.name=a", "-c", "user.email=a@b"]
        for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "a"]):
            subprocess.run([*git, *command], check=True)
        command = [*git, "rev-parse", "--short=9", "HEAD"]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    (tmp_path / "docs").mkdir()
    before = {"sources": {"room": clock.room_hash("room")}}
    (tmp_path / "old.json").write_text(json.dumps({"measured": before}))
    first = committed()
    kernel = package[1] / "half.cl"
    kernel.write_text(kernel.read_text().replace("x / 2", "x * .5f"))
    second = committed()
    kernel.write_text(kernel.read_text() + "// a remark more\n")
    marks = [
        f"measured: {first} room",
        f"measured: {second} room",
        f"measured: {first} room (a sample at {second}: SSIM within .0003)",
        f"measured: {second} room (a sample at {first}: SSIM within .0003)",
        "figures: old.json",
        f"figures: old.json (a sample at {second}: within 3 %)",
        "figures: old.json (needs a GPU)",
        f"measured: {second} room (a sample of two cases)",
    ]
    (tmp_path / "README.md").write_text("".join(f"<!-- {mark} -->\n" for mark in marks))
    found = list(tool.figures(tmp_path))
    assert [each.older_than for each in found[:-1]] == [
        *(("room",), (), (), ("room",)),
        *(("room",), (), ("room",)),
    ]
    assert "neither a sample nor" in found[-1].older_than[0]
    assert [each.needs_gpu for each in found] == [False] * 6 + [True, False]
