"""Fuzz one target, or all in turn, guided by the coverage of the package's Python code.

    pip install "pyvista-vdi[fuzz]"
    python tests/fuzz/run.py --seconds 600
    python tests/fuzz/run.py vdi_members --seconds 3600 --corpus found/

An input that breaks a promise is written to ``--crashes`` and named; ``--replay FILE TARGET`` runs
it again. Put it into ``tests/fuzz/corpus/TARGET/`` when the bug is fixed: the test suite runs
everything that lies there.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
CORPUS = HERE / "corpus"

#: libFuzzer's options: one allocation, and all of them, in MiB; seconds that one input may take.
LIMITS = ("-malloc_limit_mb=1024", "-rss_limit_mb=8192", "-timeout=60")


#: Says that this process is the one that fuzzes.
HERE_ONLY = "--here"


def main() -> int:
    """Fuzz, each target in a process of its own."""
    sys.path[:0] = [str(HERE.parent), str(HERE.parent / "support")]
    if HERE_ONLY in sys.argv:
        _import_instrumented()
    options = _parse()
    if options.replay is not None:
        _targets()[options.targets[0]](options.replay.read_bytes())
        print(f"{options.replay}: no promise is broken")
        return 0
    if options.here:
        return _fuzz(options.targets[0], options)
    failed = []
    for name in options.targets:
        command = [sys.executable, __file__, name, HERE_ONLY, "--seconds", str(options.seconds)]
        command += ["--corpus", str(options.corpus)] if options.corpus else []
        print(f"-- {name}, {options.seconds} s", flush=True)
        if subprocess.run([*command, "--crashes", str(options.crashes)], check=False).returncode:
            failed.append(name)
    print(f"-- broken: {', '.join(failed) or 'none'}; inputs in {options.crashes}")
    return 1 if failed else 0


def _import_instrumented() -> None:
    """Import the targets, and with them the package, so that atheris sees which lines run."""
    try:
        import atheris
    except ImportError:
        raise SystemExit('atheris is not installed: pip install "pyvista-vdi[fuzz]"') from None
    with atheris.instrument_imports(include=["pyvista_vdi"]):
        import pyvista_vdi.plotting.classify  # noqa: F401


def _targets() -> dict[str, Callable[[bytes], None]]:
    from fuzz.targets import TARGETS

    return TARGETS


def _parse() -> argparse.Namespace:
    names = list(_targets())
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(names))
    parser.add_argument("--seconds", type=int, default=60, help="for each target (default: 60)")
    parser.add_argument("--corpus", type=Path, help="folder for inputs that reach new code")
    parser.add_argument("--crashes", type=Path, default=Path("fuzz_crashes"))
    parser.add_argument("--replay", type=Path, metavar="FILE", help="run TARGET on this input")
    parser.add_argument(HERE_ONLY, action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.targets = options.targets or names
    unknown = sorted(set(options.targets) - set(names))
    if unknown:
        parser.error(f"unknown targets {', '.join(unknown)}; there are {', '.join(names)}")
    return options


def _fuzz(name: str, options: argparse.Namespace) -> int:
    import atheris

    target = _targets()[name]
    options.crashes.mkdir(parents=True, exist_ok=True)
    folders = []
    if options.corpus or (CORPUS / name).is_dir():  # libFuzzer writes into the first, and reads all
        own = options.corpus / name if options.corpus else options.crashes / f"{name}.corpus"
        own.mkdir(parents=True, exist_ok=True)
        folders.append(str(own))
    if (CORPUS / name).is_dir():
        folders.append(str(CORPUS / name))
    arguments = [
        *(__file__, *LIMITS, f"-max_total_time={options.seconds}", "-max_len=2500"),
        *("-len_control=20", f"-artifact_prefix={options.crashes}/{name}-"),
    ]
    atheris.Setup([*arguments, *folders], target)
    atheris.Fuzz()  # ends the process
    return 0


if __name__ == "__main__":
    sys.exit(main())
