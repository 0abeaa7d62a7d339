"""Runs the command line in this process."""

from __future__ import annotations

from typing import Any

from pyvista_vdi import cli


def run(capsys: Any, *arguments: object, status: int = 0) -> str:
    """Run the command and return what it prints; with another status the errors alone."""
    assert cli.main([str(argument) for argument in arguments]) == status
    out, error = capsys.readouterr()
    return out + error if status == 0 else error
