"""What users see by name is as it was reviewed: ``surface.txt``.

``python tests/api/test_surface.py`` writes it anew, to be read as a difference before it is kept.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import re
from pathlib import Path
from unittest import mock

import pytest

import pyvista_vdi
from pyvista_vdi import cli, registry

REVIEWED = Path(__file__).with_name("surface.txt")


def _parameters(thing):
    """Return names and defaults; annotations are those that a checker of types compares."""
    try:
        found = inspect.signature(thing).parameters.values()
    except (TypeError, ValueError):  # of VTK's own
        return "..."
    return ", ".join(str(each.replace(annotation=each.empty)) for each in found)


def surface():
    """Yield a line for each public function, class, member, verb and plotter's method."""
    import pyvista as pv

    for name in sorted(pyvista_vdi.__all__):
        thing = getattr(pyvista_vdi, name)
        if inspect.isfunction(thing):
            yield f"{name}({_parameters(thing)})"
        elif inspect.isclass(thing) and thing.__module__.startswith("pyvista_vdi"):
            ours = [base for base in thing.__mro__ if base.__module__.startswith("pyvista_vdi")]
            members = {key for base in ours for key in vars(base) if not key.startswith("_")}
            yield f"{name}({_parameters(thing)}): {' '.join(sorted(members))}"
    yield f"Plotter.add_vdi({_parameters(pv.Plotter.add_vdi.__call__)})"
    yield f"Plotter.vdi: {' '.join(name for name in dir(pv.Plotter.vdi) if name[0] != '_')}"
    overview = _help()
    yield " ".join(verbs := re.findall(r"^    ([a-z]+)\b", overview, re.MULTILINE))
    for verb in verbs:
        yield f"{verb}: {' '.join(sorted({*re.findall(r'--[a-z][a-z-]*', _help(verb))}))}"


def _help(*verb):
    said = io.StringIO()
    with mock.patch.dict(os.environ, COLUMNS="1000"), contextlib.redirect_stdout(said):
        cli.main([*verb, "--help"])
    return said.getvalue()


def test_names_arguments_and_options_are_those_that_were_reviewed():
    pytest.importorskip("pyvista")
    if len(registry.extensions()) < 7:
        pytest.skip("extensions are deleted, and their names with them")
    found, reviewed = list(surface()), REVIEWED.read_text(encoding="utf-8").splitlines()
    differ = [f"- {line}" for line in reviewed if line not in found]
    differ += [f"+ {line}" for line in found if line not in reviewed]
    assert not differ, "\n".join([*differ, f"if that is meant: python {__file__}"])


if __name__ == "__main__":
    REVIEWED.write_text("\n".join(surface()) + "\n", encoding="utf-8")
