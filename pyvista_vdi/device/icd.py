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
    candidates = []
    try:
        files = importlib.metadata.distribution(INTEL_DISTRIBUTION).files or []
        candidates = [Path(str(f.locate())) for f in files if f.name == INTEL_LIBRARY]
    except importlib.metadata.PackageNotFoundError:
        pass
    candidates.append(Path(sys.prefix) / "lib" / INTEL_LIBRARY)
    return next((path.resolve() for path in candidates if path.resolve().is_file()), None)


def vendor_folders() -> list[Path]:
    """Folders whose vendor files a loader would read if its search path were left alone."""
    folders = [SYSTEM_VENDORS, Path(sys.prefix) / "etc" / "OpenCL" / "vendors"]
    # The loader of pyopencl's wheels reads its own folder; pocl-binary-distribution installs there.
    spec = importlib.util.find_spec("pyopencl")
    if spec is not None and spec.origin is not None:
        folders.append(Path(spec.origin).parent / ".libs")
    return folders


def read_vendor_files(folders: list[Path]) -> dict[str, str]:
    """Vendor files that name a loadable library: a file name that is free, and the library.

    A bare library name is left to the dynamic linker; a path that does not exist is dropped,
    as is a library that an earlier file names.
    """
    libraries: dict[str, str] = {}
    for folder in folders:
        if not folder.is_dir():
            continue
        for file in sorted(folder.glob("*.icd")):
            try:
                library = file.read_text(encoding="utf-8", errors="surrogateescape").strip()
            except OSError:
                continue  # unreadable for us, hence for the loader as well
            beside = folder / library
            if library and os.sep not in library and beside.is_file():
                library = str(beside)
            missing = os.sep in library and not Path(library).is_file()
            if not library or missing or library in libraries.values():
                continue
            libraries[f"{len(libraries):02d}-{file.name}"] = library
    return libraries


def plan() -> tuple[dict[str, str] | None, Discovery]:
    """Return the vendor files to show (None: leave the environment alone), and why."""
    if not sys.platform.startswith("linux"):
        return None, Discovery(None, "drivers are found by the system's own loader")
    library = intel_library()
    for variable in USER_VARIABLES:
        if os.environ.get(variable):
            note = f"{variable}={os.environ[variable]!r} is set and obeyed"
            unset = f": unset it to have {library} added" if library else ""
            return None, Discovery(None, note + unset, hidden=library is not None)
    if library is None:
        return None, Discovery(None, f"no {INTEL_LIBRARY} from pip in this environment")
    system = read_vendor_files([SYSTEM_VENDORS])
    if any(Path(entry).name.startswith(INTEL_LIBRARY) for entry in system.values()):
        return None, Discovery(None, "the system's vendor files name Intel's CPU runtime already")

    files = read_vendor_files(vendor_folders())
    if str(library) not in files.values():
        files["zz-pyvista-vdi-intel.icd"] = str(library)
    return files, Discovery(library, f"added {library} to the loader's search path")


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
    files, discovery = plan()
    if files is None:
        yield discovery
        return
    with contextlib.ExitStack() as stack:
        try:
            # mkdtemp creates with mode 0700: nobody else can slip a library in.
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="pyvista-vdi-icd-"))
            for name, library in files.items():
                Path(folder, name).write_text(
                    library + "\n", encoding="utf-8", errors="surrogateescape"
                )
        except OSError as exc:
            yield Discovery(None, f"no temporary folder for the loader's vendor files: {exc}")
            return
        os.environ["OCL_ICD_VENDORS"] = folder
        try:
            yield discovery
        finally:
            os.environ.pop("OCL_ICD_VENDORS", None)


@contextlib.contextmanager
def pocl_cache_at_hand() -> Iterator[None]:
    """While inside, PoCL finds a folder where the user's cannot be written: else it has no device.

    List the platforms inside: it keeps what it found. The environment is put back.
    """
    try:
        writable_cache("pyvista-vdi")
        folder = None
    except OSError:
        folder = user_cache()
    if folder is None or os.environ.get("POCL_CACHE_DIR"):
        yield
        return
    os.environ["POCL_CACHE_DIR"] = str(folder / "pocl")
    try:
        yield
    finally:
        os.environ.pop("POCL_CACHE_DIR", None)


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
