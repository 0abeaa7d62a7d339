"""Parses the command line, and says what was meant where something is wrong."""

from __future__ import annotations

import argparse
import re
from typing import Any, NoReturn

from pyvista_vdi import registry
from pyvista_vdi._version import __version__
from pyvista_vdi.cli.declare import add
from pyvista_vdi.cli.verbs import VERBS
from pyvista_vdi.model.checks import suggestion


class UsageError(Exception):
    """A mistake in the arguments; the message says which and what is right."""


class _Parser(argparse.ArgumentParser):
    """An argument parser that raises instead of leaving the process, and says one line."""

    def _parse_optional(self, arg_string: str) -> Any:
        # A value is -1.8e-15, too, and -1,0: argparse's own rule knows numbers like -1.5
        return None if re.match(r"-\.?\d", arg_string) else super()._parse_optional(arg_string)

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def parse(arguments: list[str]) -> argparse.Namespace | None:
    """Parse the command line; ``None`` if help or the version was asked for.

    Raises UsageError, which suggests what may have been meant.
    """
    added = (verb for each in registry.records() for verb in each.verbs)
    known = {verb.name: verb for verb in (*VERBS, *added)}
    name, *rest = arguments or ["--help"]
    if name in ("-h", "--help"):
        listed = "\n".join(f"    {verb.name:<11}{verb.summary}" for verb in known.values())
        print("usage: pyvista-vdi [--version] SUBCOMMAND ...\n")
        print(f"Volumetric Depth Images: generate, render, view and compare them.\n\n{listed}\n")
        print("Each explains itself: pyvista-vdi generate --help")
        return None
    if name == "--version":
        print(f"pyvista-vdi {__version__}")
        return None
    if name not in known:
        raise UsageError(f"there is no subcommand {name!r}: {suggestion(name, [*known], 0.5)}")
    verb = known[name]
    parser = _Parser(
        prog=f"pyvista-vdi {name}",
        description=f"{verb.summary[0].upper()}{verb.summary[1:]}.",
        epilog=f"Example:\n  {verb.example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add(parser, registry.load(verb.options))
    parser.set_defaults(run=_run, place=verb.run)
    # Name an option that is not known before its value
    options = [each for each in parser._option_string_actions if each.startswith("--")]
    names = (text.split("=")[0] for text in rest[: [*rest, "--"].index("--")])
    wrong = [text for text in names if text.startswith("--") and text not in options]
    try:
        found, unknown = (None, wrong) if wrong else parser.parse_known_args(rest)
    except SystemExit:  # after --help
        return None
    if unknown:
        argument = next(text for text in rest if text.startswith(unknown[0]))  # with its value
        hint = suggestion(argument.split("=")[0], options, 0.5)
        raise UsageError(f"{name} takes no argument {argument!r}: {hint}")
    return found


def _run(options: argparse.Namespace) -> int:
    """Import the subcommand's module, which brings what it needs, and run it."""
    function = registry.load(options.place)
    if getattr(options, "device", None) is not None:
        from pyvista_vdi.device import get_runtime

        get_runtime(options.device)  # a wrong name is said before minutes of reading
    return int(function(options))
