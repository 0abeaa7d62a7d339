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
from pathlib import Path

from pyvista_vdi.model.user_cache import user_cache, writable_cache

#: Set by a user who has decided which drivers are seen: then nothing is changed.
USER_VARIABLES = ("OCL_ICD_VENDORS", "OCL_ICD_FILENAMES")

INTEL_DISTRIBUTION, INTEL_LIBRARY = "intel-opencl-rt", "libintelocl.so"


def intel_library() -> Path | None:
    """Return the absolute path of pip's Intel CPU runtime, or None."""
    candidates = [Path(sys.prefix) / "lib" / INTEL_LIBRARY]
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        files = importlib.metadata.distribution(INTEL_DISTRIBUTION).files or []
        candidates[:0] = [Path(str(f.locate())) for f in files if f.name == INTEL_LIBRARY]
    return next((path.resolve() for path in candidates if path.resolve().is_file()), None)


def libraries_with(added: Path) -> list[str]:
    """Return the libraries that vendor files name, each once, and one more.

    A bare library name is left to the dynamic linker; a path that does not exist is dropped.
    """
    folders = [Path("/etc/OpenCL/vendors"), Path(sys.prefix) / "etc" / "OpenCL" / "vendors"]
    # The loader of pyopencl's wheels reads its own folder; pocl-binary-distribution installs there.
    spec = importlib.util.find_spec("pyopencl")
    folders += [Path(spec.origin).parent / ".libs"] if spec and spec.origin else []
    found: list[str] = []
    for file in (file for folder in folders for file in sorted(folder.glob("*.icd"))):
        with contextlib.suppress(OSError):  # unreadable for us, hence for the loader as well
            library = file.read_text(encoding="utf-8", errors="surrogateescape").strip()
            if library and (file.parent / library).is_file():
                library = str(file.parent / library)
            if library and (os.sep not in library or Path(library).is_file()):
                found.append(library)
    if not any(Path(library).name.startswith(INTEL_LIBRARY) for library in found):
        found.append(str(added))
    return list(dict.fromkeys(found))


@contextlib.contextmanager
def drivers_visible() -> Iterator[None]:
    """While inside, the loader sees the system's drivers and pip's; the environment is put back.

    Import pyopencl and list the platforms inside: the loader keeps what it found. PoCL finds a
    folder where the user's cannot be written: else it has no device.
    """
    library, variables = intel_library(), {}
    with contextlib.ExitStack() as stack:
        if library and sys.platform == "linux" and not any(map(os.environ.get, USER_VARIABLES)):
            with contextlib.suppress(OSError):  # no folder for temporary files
                # mkdtemp creates with mode 0700: nobody else can slip a library in.
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="pyvista-vdi-icd-"))
                for number, each in enumerate(libraries_with(library)):
                    Path(folder, f"{number:02d}.icd").write_bytes(os.fsencode(each + "\n"))
                variables["OCL_ICD_VENDORS"] = folder
        try:
            writable_cache("pyvista-vdi")
        except OSError:
            if (cache := user_cache()) and not os.environ.get("POCL_CACHE_DIR"):
                variables["POCL_CACHE_DIR"] = str(cache / "pocl")
        os.environ.update(variables)
        try:
            yield
        finally:
            for name in variables:
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
