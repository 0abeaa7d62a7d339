"""Runs the command line in this process."""

from __future__ import annotations

from typing import Any

from pyvista_vdi import cli


def outcome(capsys: Any, *arguments: object) -> tuple[int, str, str]:
    """Run the command and return its status, what it prints, and the errors."""
    status = cli.main([str(argument) for argument in arguments])
    return status, *capsys.readouterr()


def run(capsys: Any, *arguments: object, status: int = 0) -> str:
    """Run the command and return what it prints; with another status the errors alone."""
    found, out, error = outcome(capsys, *arguments)
    assert found == status, error
    return out + error if status == 0 else error


def complaint(capsys: Any, *arguments: object, status: int = 1) -> str:
    """Run what must fail; return the message after checking that it is all, and one line."""
    found, out, error = outcome(capsys, *arguments)
    assert (found, out) == (status, "")
    assert error.count("\n") == 1, error
    prefix = "pyvista-vdi: error: "
    assert error.startswith(prefix)
    return error[len(prefix) :].strip()
