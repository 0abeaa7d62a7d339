"""Make OpenCL drivers that came from pip visible to the loader, while it lists its platforms.

The wheel ``intel-opencl-rt`` puts its library into ``sys.prefix/lib`` and a vendor file with a
build machine's path into ``sys.prefix/etc``, so no loader finds it. The loader that pyopencl's
Linux wheels bring reads the folder named by ``OCL_ICD_VENDORS`` in place of
``/etc/OpenCL/vendors``, once, when the platforms are first listed. :func:`drivers_visible` names a
temporary folder there that holds copies of the system's vendor files and one for Intel's library,
and puts the environment back afterwards.

A program that Python runs in may be linked to a loader itself, and may have asked it already: what
ParaView loads is, and hwloc asks it when MPI starts. pyopencl's calls would then go to that one,
which knows nothing of pip's driver any more. :func:`own_loader_bound` binds them to pyopencl's.
"""

import contextlib
import ctypes
import importlib.metadata
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pyvista_vdi.model.user_cache import user_cache, writable_cache

SYSTEM_VENDORS = Path("/etc/OpenCL/vendors")
"""Where Linux loaders look by default."""

USER_VARIABLES = ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES")
"""Set by a user who has decided which drivers are seen: then nothing is changed."""

INTEL_DISTRIBUTION = "intel-opencl-rt"
INTEL_LIBRARY = "libintelocl.so"


@dataclass(frozen=True)
class Discovery:
    """The driver library that was made visible, if any, and why, for :func:`describe_devices`.

    ``hidden``: pip's driver is installed, and ``note`` says what to do for it to be found.
    """

    added: Path | None
    note: str
    hidden: bool = False


def intel_library() -> Path | None:
    """Return the absolute path of pip's Intel CPU runtime, or None."""
    candidates = [Path(sys.prefix) / "lib" / INTEL_LIBRARY]
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        files = importlib.metadata.distribution(INTEL_DISTRIBUTION).files or []
        candidates[:0] = [Path(str(f.locate())) for f in files if f.name == INTEL_LIBRARY]
    return next((path.resolve() for path in candidates if path.resolve().is_file()), None)


def vendor_folders() -> list[Path]:
    """Return folders whose vendor files a loader would read if its search path were left alone."""
    folders = [SYSTEM_VENDORS, Path(sys.prefix) / "etc" / "OpenCL" / "vendors"]
    # The loader of pyopencl's wheels reads its own folder; pocl-binary-distribution installs there.
    spec = importlib.util.find_spec("pyopencl")
    return [*folders, Path(spec.origin).parent / ".libs"] if spec and spec.origin else folders


def libraries_in(folders: list[Path]) -> list[str]:
    """Return the libraries that vendor files name, each once.

    A bare library name is left to the dynamic linker; a path that does not exist is dropped.
    """
    found: list[str] = []
    for file in (file for folder in folders for file in sorted(folder.glob("*.icd"))):
        try:
            library = file.read_text(encoding="utf-8", errors="surrogateescape").strip()
        except OSError:
            continue  # unreadable for us, hence for the loader as well
        if library and (file.parent / library).is_file():
            library = str(file.parent / library)
        if library and (os.sep not in library or Path(library).is_file()) and library not in found:
            found.append(library)
    return found


def plan() -> tuple[list[str], Discovery]:
    """Return the libraries to show (none: leave the environment alone), and why."""
    if not sys.platform.startswith("linux"):
        return [], Discovery(None, "drivers are found by the system's own loader")
    library = intel_library()
    for variable in USER_VARIABLES:
        if os.environ.get(variable):
            note = f"{variable}={os.environ[variable]!r} is set and obeyed"
            unset = f": unset it to have {library} added" if library else ""
            return [], Discovery(None, note + unset, hidden=library is not None)
    if library is None:
        return [], Discovery(None, f"no {INTEL_LIBRARY} from pip in this environment")
    if any(Path(name).name.startswith(INTEL_LIBRARY) for name in libraries_in([SYSTEM_VENDORS])):
        return [], Discovery(None, "the system's vendor files name Intel's CPU runtime already")
    libraries = dict.fromkeys([*libraries_in(vendor_folders()), str(library)])
    return [*libraries], Discovery(library, f"added {library} to the loader's search path")


def after_listing(discovery: Discovery) -> Discovery:
    """Return what is true of a driver that was added when pyopencl had been imported already.

    A loader that had listed its drivers by then keeps to them. Call it when they are listed.
    """
    if discovery.added is None:
        return discovery
    try:
        ctypes.CDLL(str(discovery.added), mode=os.RTLD_NOLOAD)
    except OSError:
        note = (
            "move  import pyopencl  below the first use of a device by pyvista_vdi, "
            "pyvista_vdi.list_devices() for instance: an OpenCL loader had listed its drivers "
            f"before {discovery.added} was added to its search path"
        )
        return Discovery(None, note, hidden=True)
    return discovery


@contextlib.contextmanager
def drivers_visible() -> Iterator[Discovery]:
    """While inside, the loader sees the system's drivers and pip's; the environment is put back.

    Import pyopencl and list the platforms inside: the loader keeps what it found.
    """
    libraries, discovery = plan()
    with contextlib.ExitStack() as stack:
        if libraries:
            try:
                # mkdtemp creates with mode 0700: nobody else can slip a library in.
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="pyvista-vdi-icd-"))
                for number, library in enumerate(libraries):
                    text = os.fsencode(library + "\n")
                    Path(folder, f"{number:02d}.icd").write_bytes(text)
                stack.enter_context(_variable("OCL_ICD_VENDORS", folder))
            except OSError as exc:
                why = f"no temporary folder for the loader's vendor files: {exc}"
                discovery = Discovery(None, why)
        yield discovery


@contextlib.contextmanager
def pocl_cache_at_hand() -> Iterator[None]:
    """While inside, PoCL finds a folder where the user's cannot be written: else it has no device.

    List the platforms inside: it keeps what it found. The environment is put back.
    """
    folder = None
    try:
        writable_cache("pyvista-vdi")
    except OSError:
        folder = user_cache()
    if folder is None or os.environ.get("POCL_CACHE_DIR"):
        yield
        return
    with _variable("POCL_CACHE_DIR", str(folder / "pocl")):
        yield


@contextlib.contextmanager
def _variable(name: str, value: str) -> Iterator[None]:
    """Set a variable of the environment that is not set, for the block."""
    os.environ[name] = value
    try:
        yield
    finally:
        os.environ.pop(name, None)


@contextlib.contextmanager
def own_loader_bound() -> Iterator[None]:
    """While inside, pyopencl is imported with its own loader, whatever loader the process has.

    By default a library's symbols are looked for in the program and what that is linked to first,
    and only then in what the library itself brings. Nothing is done where the program has no
    OpenCL loader, nor where the C library knows no other order.
    """
    flags = getattr(os, "RTLD_DEEPBIND", 0)  # of glibc
    if not flags or not hasattr(ctypes.CDLL(None), "clGetPlatformIDs"):
        yield
        return
    before = sys.getdlopenflags()
    sys.setdlopenflags(before | flags)
    try:
        yield
    finally:
        sys.setdlopenflags(before)
