"""Which code a figure measured, and the check that names figures older than it."""

from __future__ import annotations

import importlib.util
import json
import shutil
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


@pytest.mark.skipif(not TOOL.is_file(), reason="tools/ is not beside the tests")
def test_the_check_names_figures_older_than_what_they_measured(tmp_path):
    specification = importlib.util.spec_from_file_location("figures", TOOL)
    tool = sys.modules["figures"] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(tool)
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
