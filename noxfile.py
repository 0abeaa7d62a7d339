"""What a developer runs: ``nox -s NAME``; ``nox -l`` lists the names.

Each session makes an environment of its own; ``.ci/run`` runs them in one that has the built wheel
(``nox --no-venv --no-install``).
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2024.4.15"
nox.options.default_venv_backend = "venv"
nox.options.reuse_existing_virtualenvs = True
nox.options.sessions = ["lint", "fast"]

CHECKOUT = Path(__file__).parent
#: Another version formats otherwise; also in pyproject.toml and .pre-commit-config.yaml.
CLANG_FORMAT = "clang-format==23.1.5"


@nox.session
def fast(session: nox.Session) -> None:
    """Run the fast tests: two minutes; arguments go to pytest."""
    session.install("-e", ".[test]")
    session.run("pytest", "-m", "fast", *session.posargs)


@nox.session
def tests(session: nox.Session) -> None:
    """Run the tests that every change must pass; arguments go to pytest."""
    session.install("-e", ".[test]")
    session.run("pytest", *session.posargs)


@nox.session
def coverage(session: nox.Session) -> None:
    """Run them and report the branch coverage of the package, all its processes counted."""
    session.install("-e", ".[test]", "coverage>=7.10")
    folder = Path(session.create_tmp())
    settings = folder / "coveragerc"
    settings.write_text(
        "[run]\nbranch = true\nparallel = true\nsource_pkgs = pyvista_vdi\npatch = subprocess\n"
        f"data_file = {folder / 'data'}\n"
        "[report]\nomit = */pytest-of-*/*\n"  # copies that tests of packaging make
    )
    rc = f"--rcfile={settings}"
    session.run("coverage", "run", rc, "-m", "pytest", *session.posargs)
    session.run("coverage", "combine", "-q", rc)
    session.run("coverage", "report", rc, "--skip-covered", "--sort=miss")


@nox.session
def lint(session: nox.Session) -> None:
    """Check style, formatting and spelling, as pre-commit does, and ceilings of size."""
    session.install("ruff>=0.15", "codespell[toml]>=2.3", CLANG_FORMAT)
    session.run("ruff", "check", "--no-cache", ".")
    session.run("ruff", "format", "--no-cache", "--check", ".")
    session.run("codespell")
    kernels = map(str, sorted(Path("opencl").rglob("*.cl")))
    session.run("clang-format", "--dry-run", "--Werror", *kernels)
    session.run("python", "tools/size.py")


@nox.session
def types(session: nox.Session) -> None:
    """Check types."""
    session.install("-e", ".[dev]")
    session.run("mypy", f"--cache-dir={session.create_tmp()}")


@nox.session
def javascript(session: nox.Session) -> None:
    """Check the viewer's JavaScript: ESLint, tsc, unit tests, axe-core; needs npm and Chromium."""
    session.install("-e", ".[test,browser]")
    folder = CHECKOUT / "tests" / "extensions" / "web" / "javascript"
    with session.chdir(folder):
        session.run("npm", "install", "--no-audit", "--no-fund", "--no-package-lock", external=True)
        session.run("npm", "run", "lint", external=True)
        session.run("npm", "run", "types", external=True)
        session.run("npm", "test", external=True)
    env = {"PYVISTA_VDI_AXE": str(folder / "node_modules" / "axe-core" / "axe.min.js")}
    axe = ("-q", "-n", "0", "-m", "slow or not slow", "-k", "axe")
    session.run("pytest", *axe, "tests/extensions/web", env=env)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the documentation, warnings as errors."""
    session.install("-e", ".[dev]")
    site = Path(os.environ.get("PYVISTA_VDI_SITE") or CHECKOUT / "docs" / "_build")
    session.run("sphinx-build", "-W", "--keep-going", "-q", "-b", "html", "docs", str(site))


@nox.session
def snippets(session: nox.Session) -> None:
    """Run the Python of the pages and of the docstrings."""
    session.install("-e", ".[dev]")
    folder = Path(session.create_tmp()) / "documented"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(CHECKOUT / "docs", folder / "docs", ignore=shutil.ignore_patterns("_build"))
    shutil.copy(CHECKOUT / "README.md", folder / "docs" / "readme.md")
    shutil.copy(CHECKOUT / "pyproject.toml", folder)
    with session.chdir(folder):
        session.run("pytest", "-q", "docs")
    # ParaView's plugin can be imported only in ParaView
    plugin = "--ignore-glob=/*/pyvista_vdi/extensions/paraview/plugin/*"
    session.run("pytest", "-q", "--doctest-modules", plugin, "--pyargs", "pyvista_vdi")


@nox.session
def bench(session: nox.Session) -> None:
    """Measure whole frames beside VTK's, as a sample; arguments go to the script."""
    session.install("-e", ".[cpu,plot]")
    session.run("python", "benchmarks/frames.py", *session.posargs)


@nox.session
def mutants(session: nox.Session) -> None:
    """Try which of a sample of mistakes the tests notice; arguments go to tools/mutants.py."""
    session.install("-e", ".[test]")
    session.run("python", "tools/mutants.py", *session.posargs)


@nox.session
def figures(session: nox.Session) -> None:
    """Name the published figures whose code has changed since they were measured."""
    session.run("python", "tools/figures.py", *session.posargs, success_codes=[0, 1])
