"""Checkers of types are told the arguments that options bring: the stubs are those of the records.

``python tests/api/test_stubs.py`` writes them anew.
"""

from __future__ import annotations

import collections.abc
import inspect
import re
import textwrap
import typing
from pathlib import Path

import numpy.typing as npt

import pyvista_vdi
from pyvista_vdi import api
from pyvista_vdi.model import types
from pyvista_vdi.model.arguments import Settings

PACKAGE = Path(pyvista_vdi.__file__).parent
#: Modules that names in annotations are imported from; else it is where the class is.
HOMES = (collections.abc, typing, npt, types)
CLASSES = {
    "AmbientOcclusion": "model.ambient_occlusion",
    "DeferredVDI": "model.vdi",
    "Pick": "raycasting.picking",
    "Settings": "api",
    "TransferFunction": "model.transfer_function",
    "VDI": "model.vdi",
    "VDICollection": "model.collection",
}
WIDTH = 100
#: What a function returns, by the values of an option.
RETURNS = {"generate": ("classification", {"baked": "VDI", "deferred": "DeferredVDI"})}
OTHERS = {"np.": "import numpy as np", "os.": "import os", "pv.": "import pyvista as pv"}


def definition(thing, name, required=(), margin="", **kinds):
    """Yield a definition with a signature; ``kinds`` are types in place of what it has."""
    arguments, star = [], False
    signature = inspect.signature(thing)
    for each in signature.parameters.values():
        if each.kind is each.KEYWORD_ONLY and not star:
            arguments, star = [*arguments, "*"], True
        kind = kinds.get(each.name, each.annotation)
        text = "**" * (each.kind is each.VAR_KEYWORD) + each.name
        text += "" if each.name == "self" else f": {kind}"
        if each.default is not each.empty and each.name not in required:
            text += f" = {each.default!r}"
        arguments.append(text)
    made = kinds.get("return", signature.return_annotation)
    return wrapped(f"def {name}(", ", ".join(arguments), f") -> {made}: ...", margin)


def wrapped(head, text, tail, margin=""):
    """Return a text between others, in lines of which none is too long."""
    if len(margin + head + text + tail) < WIDTH:
        return f"{margin}{head}{text}{tail}\n"
    inner = margin + "    "
    body = textwrap.fill(text, WIDTH, initial_indent=inner, subsequent_indent=inner)
    return f"{margin}{head}\n{body},\n{margin}{tail}\n"


def overloads(function, name):
    """Return the definitions of a function, where an option says what it returns."""
    option, kinds = RETURNS[name]
    standard = inspect.signature(function).parameters[option].default
    return "".join(
        "@overload\n"
        + definition(
            function,
            name,
            required=() if value == standard else (option,),
            **{option: f"Literal[{value!r}]", "return": made},
        )
        for value, made in kinds.items()
    )


def stub(about, text):
    """Return a stub: its imports, and a text."""
    lines = [line for used, line in OTHERS.items() if used in text]
    found = {}
    for word in sorted({*re.findall(r"(?<![\w.\"'])[A-Za-z]\w*", text)}):
        home = next((each.__name__ for each in HOMES if word in vars(each)), None)
        if word in CLASSES and f"class {word}:" not in text:
            found.setdefault(f"pyvista_vdi.{CLASSES[word]}", []).append(word)
        elif home and (word == "overload" or word[0].isupper()):
            found.setdefault(home, []).append(word)
    for home, words in sorted(found.items()):
        lines.append(wrapped(f"from {home} import (", ", ".join(words), ")").rstrip())
    head = f'"""{about}, written by tests/api/test_stubs.py."""\n# fmt: off\n# ruff: noqa: I001'
    return "\n".join([head, "", *lines, "", text])


def stubs():
    """Yield files and what is to be in them."""
    text = ""
    for name, function in sorted(vars(api).items()):
        if inspect.isfunction(function):
            text += (overloads if name in RETURNS else definition)(function, name)
    made = inspect.signature(Settings)
    made = made.replace(parameters=[inspect.Parameter("self", 0), *made.parameters.values()])
    text += "class Settings:\n    given: dict[str, Any]\n"
    text += "".join(f"    {name}: {told.kind}\n" for name, told in Settings.declared.items())
    maker = type("", (), {"__signature__": made})
    text += definition(maker, "__init__", margin="    ", **{"return": None})
    yield "api/__init__.pyi", stub("The public functions and their options", text)


def test_stubs_are_those_of_the_records():
    for file, text in stubs():
        found = (PACKAGE / file).read_text(encoding="utf-8")
        assert found == text, f"{file} is not of the records: python {__file__}"


def test_docstrings_describe_every_parameter():
    for function in (api.generate, api.render, api.pick, api.render_volume, Settings):
        told = re.findall(r"^(\w[\w, ]*)(?: : .*)?\n    [\w`]", function.__doc__, re.MULTILINE)
        named = {*inspect.signature(function).parameters} - {"look"}
        assert named <= {*", ".join(told).split(", ")}


if __name__ == "__main__":
    for file, text in stubs():
        (PACKAGE / file).write_text(text, encoding="utf-8")
