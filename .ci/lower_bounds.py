"""Print, as pip constraints, the lowest version of every dependency that pyproject.toml allows."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import tomllib

#: Extras whose lower bounds the test-suite exercises.
TESTED_EXTRAS = ("cpu", "dask", "exr", "files", "notebook", "plot", "test", "web")


def lower_bounds(pyproject: Path) -> list[str]:
    """Return ``name==lowest`` for each requirement of the engine and of the tested extras."""
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    requirements = list(project["dependencies"])
    for extra in TESTED_EXTRAS:
        requirements += project["optional-dependencies"][extra]
    bounds = []
    for requirement in requirements:
        if requirement.startswith(project["name"]):
            continue
        matched = re.fullmatch(r"([\w.-]+)>=([\w.]+)(;.*)?", requirement.replace(" ", ""))
        if matched is None:
            raise SystemExit(f"{pyproject}: {requirement!r} states no lower bound of the form >=")
        bounds.append(f"{matched[1]}=={matched[2]}")
    return bounds


if __name__ == "__main__":
    print("\n".join(lower_bounds(Path(sys.argv[1]))))
