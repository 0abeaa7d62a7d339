"""The devices that exist, what is known of each, and which one a selector or the default means.

Everything here but :func:`find_devices` works on plain :class:`DeviceInfo` lists and needs no
driver.
"""

import atexit
import contextlib
import ctypes
import importlib.metadata
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pyvista_vdi.errors import DeviceError, MissingDependencyError, NoDeviceError
from pyvista_vdi.model.user_cache import writable_cache

DEVICE_VARIABLE = "PYVISTA_VDI_DEVICE"

REMEDY = (
    'install a CPU runtime with  pip install "pyvista-vdi[cpu]"  (x86-64 Linux and Windows), or '
    "Debian's and Ubuntu's package pocl-opencl-icd, or your GPU's OpenCL driver; if that is "
    "installed, unset OCL_ICD_VENDORS, and use a device of pyvista_vdi before  import pyopencl"
)


@dataclass(frozen=True)
class DeviceInfo:
    """What is known of one OpenCL device.

    Attributes
    ----------
    name, platform, version, driver : str
        As the driver reports them; ``version`` is the device's OpenCL version.
    kind : str
        ``"GPU"``, ``"CPU"`` or ``"accelerator"``.
    compute_units : int
        Parallel compute units; hardware threads on a CPU.
    global_memory, max_allocation : int
        Bytes in all, and bytes that one buffer may have.
    usable : bool
        Whether the probe kernel ran on it and gave the right numbers.
    reason : str
        Why it is not used; empty when usable, or not yet tried.
    platform_index, device_index : int
        Position in the driver's lists.
    selector : str
        ``"platform_index:device_index"``, which selects exactly this device.
    unified_memory : bool
        Whether device and host share memory.
    """

    name: str
    platform: str
    version: str
    driver: str
    kind: str
    compute_units: int
    global_memory: int
    max_allocation: int
    usable: bool = False
    reason: str = ""
    platform_index: int = 0
    device_index: int = 0
    unified_memory: bool = False

    @property
    def full_name(self) -> str:
        """``"platform / device"``: the text that a selector is matched with."""
        return f"{self.platform} / {self.name}"

    @property
    def selector(self) -> str:
        """What selects exactly this device in this process."""
        return f"{self.platform_index}:{self.device_index}"


def preference(info: DeviceInfo) -> tuple[int, ...]:
    """Sort key of the default choice, best first.

    GPU before CPU before accelerator (an emulator as a rule); among GPUs those with memory of
    their own, then more compute units; among CPUs Intel's runtime, which was measured three times
    faster than PoCL on a plain volume raycaster, on AMD CPUs as well.
    """
    return (
        ("GPU", "CPU", "accelerator").index(info.kind),
        int(info.kind == "GPU" and info.unified_memory),
        int(info.kind == "CPU" and "intel" not in info.platform.lower()),
        -info.compute_units,
        info.platform_index,
        info.device_index,
    )


def select(infos: Sequence[DeviceInfo], selector: str, origin: str) -> DeviceInfo:
    """Return the one device that a selector means.

    It is ``"platform_index:device_index"``, or a part of ``"platform / device"`` or of the version.
    Letter case is ignored; an exact name beats a part of one, and a part of the platform beats one
    of the device. ``origin`` is where the selector came from, for messages: ``"device="``, say.
    NoDeviceError if it means none or several, with a list of what exists.
    """
    text = selector.strip().lower()
    ways: tuple[Callable[[DeviceInfo], bool], ...] = (
        lambda i: text in (i.selector, i.full_name.lower(), i.name.lower()),
        # "intel" is a platform before it is the processor that PoCL runs on; "pocl" is in versions
        lambda i: text in i.platform.lower(),
        lambda i: text in f"{i.full_name} {i.version} {i.driver}".lower(),
    )
    found = next((found for way in ways if (found := [i for i in infos if way(i)])), [])
    if len(found) == 1:
        return found[0]
    means = f"there is no such OpenCL device; there is {listing(infos)}"
    if found:
        means = f"it means {len(found)} devices, {listing(found)}: name one of them by its selector"
    raise NoDeviceError(f"{origin}{selector!r}: {means}{'' if infos else f'; {REMEDY}'}")


def listing(infos: Sequence[DeviceInfo]) -> str:
    """Return the devices in one sentence, for error messages."""
    found = []
    for info in infos:
        why = f", not usable: {info.reason}" if info.reason else ""
        found.append(f"{info.full_name} ({info.kind}, selected by {info.selector!r}{why})")
    return "; ".join(found) or "no device at all"


def bytes_text(nbytes: int) -> str:
    """Return a number of bytes for people: ``"1.50 GiB (1610612736 bytes)"``."""
    for unit, size in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if nbytes >= size:
            return f"{nbytes / size:.2f} {unit} ({nbytes} bytes)"
    return f"{nbytes} bytes"


_lock = threading.RLock()
_found: list[DeviceInfo] | None = None
#: The driver's own object of each device, by its selector.
handles: dict[str, Any] = {}
#: Whether drivers are here that the threads they work with did not follow into a fork.
forked = False


def _note_fork() -> None:
    global forked, _lock
    forked = forked or _found is not None
    _lock = threading.RLock()  # a thread that is not here may have held it


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)


def require_drivers() -> None:
    """Raise DeviceError where a driver would wait for ever: in a fork of a process that used one.

    No lock is taken before: another thread may have held it.
    """
    if forked:
        raise DeviceError(
            "this process was forked from one that had used OpenCL already, and drivers do not "
            'survive that: start processes by multiprocessing.get_context("spawn"), or fork '
            "before a device is used or listed; reading and writing files works in either"
        )


def opencl() -> ModuleType:
    """Return the module pyopencl, imported when first needed with pip's drivers made visible.

    MissingDependencyError if it, or the OpenCL loader that it needs, cannot be imported.
    """
    find_devices()
    # Once it is there without the import system, whose locks a finalizer that frees device memory
    # must not ask for in the middle of an import (Python 3.10 raises KeyError)
    return sys.modules.get("pyopencl") or _import_pyopencl()


def _import_pyopencl() -> ModuleType:
    try:
        with own_loader_bound():
            cl: Any = importlib.import_module("pyopencl")
    except ImportError as exc:
        raise MissingDependencyError(
            f"pyopencl cannot be imported ({exc}); install it with  pip install --upgrade pyopencl"
            "  (its wheels bring an OpenCL loader; a build from source needs libOpenCL)"
        ) from exc
    try:
        writable_cache("pytools", "pytools")  # for the Python code that it makes for kernels
    except OSError:
        cl._PYOPENCL_NO_CACHE = True
        with contextlib.suppress(OSError):  # PoCL has no device without a folder of its own
            if not os.environ.get("POCL_CACHE_DIR"):
                os.environ["POCL_CACHE_DIR"] = own = tempfile.mkdtemp(prefix="pyvista-vdi-pocl-")
                atexit.register(shutil.rmtree, own, ignore_errors=True)
    return cl


def find_devices() -> list[DeviceInfo]:
    """Return every device of every platform, unprobed, in the drivers' order, listed once.

    MissingDependencyError if pyopencl cannot be imported, DeviceError in a fork of a process that
    had listed them.
    """
    global _found
    require_drivers()
    if _found is not None:
        return _found  # likewise without a lock
    with _lock:
        if _found is None:
            with drivers_visible():
                _found = _list(_import_pyopencl())
        return _found


def _list(cl: ModuleType) -> list[DeviceInfo]:
    infos = []
    with contextlib.suppress(cl.Error):  # PLATFORM_NOT_FOUND_KHR: the loader knows no driver
        for platform_index, platform in enumerate(cl.get_platforms()):
            with contextlib.suppress(cl.Error):  # a platform without a device, or a broken one
                for device_index, device in enumerate(platform.get_devices()):
                    infos.append(_describe(cl, device, platform_index, device_index))
                    handles[infos[-1].selector] = device
    return infos


def _describe(cl: ModuleType, device: Any, platform_index: int, device_index: int) -> DeviceInfo:
    kinds = {cl.device_type.GPU: "GPU", cl.device_type.CPU: "CPU"}
    return DeviceInfo(
        name=device.name.strip(),
        platform=device.platform.name.strip(),
        version=device.version.strip(),
        driver=device.driver_version.strip(),
        kind=next((name for bit, name in kinds.items() if device.type & bit), "accelerator"),
        compute_units=int(device.max_compute_units),
        global_memory=int(device.global_mem_size),
        max_allocation=int(device.max_mem_alloc_size),
        platform_index=platform_index,
        device_index=device_index,
        unified_memory=bool(device.host_unified_memory),
    )


INTEL_LIBRARY = "libintelocl.so"


@contextlib.contextmanager
def drivers_visible() -> Iterator[None]:
    """While inside, the loader sees the system's drivers and pip's; the environment is put back.

    Import pyopencl and list the platforms inside: the loader keeps what it found. The wheel
    ``intel-opencl-rt`` comes with a vendor file that has a build machine's path, so that no loader
    finds its library. That of pyopencl's Linux wheels reads the folder ``OCL_ICD_VENDORS`` in place
    of ``/etc/OpenCL/vendors``: here a temporary one, with the system's vendor files and one more.
    """
    library = None
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        files = importlib.metadata.files("intel-opencl-rt") or []
        paths = [Path(str(each.locate())).resolve() for each in files if each.name == INTEL_LIBRARY]
        library = next((path for path in paths if path.is_file()), None)
    # Who has set the variable has decided which drivers are seen
    if library is None or sys.platform != "linux" or os.environ.get("OCL_ICD_VENDORS"):
        yield
        return
    # Read the vendor files. A bare name is left to the dynamic linker; a path must lead somewhere
    found: list[str] = []
    for place in ("/etc/OpenCL/vendors", Path(sys.prefix, "etc", "OpenCL", "vendors")):
        for file in sorted(Path(place).glob("*.icd")):
            with contextlib.suppress(OSError):  # unreadable for us, hence for the loader as well
                each = file.read_text(encoding="utf-8", errors="surrogateescape").strip()
                if each and (os.sep not in each or Path(each).is_file()):
                    found.append(each)
    if not any(Path(each).name.startswith(INTEL_LIBRARY) for each in found):
        found.append(str(library))
    # The folder has mode 0700: nobody else can slip a library in
    with tempfile.TemporaryDirectory(prefix="pyvista-vdi-icd-") as folder:
        for number, each in enumerate(dict.fromkeys(found)):
            Path(folder, f"{number:02d}.icd").write_bytes(os.fsencode(each + "\n"))
        os.environ["OCL_ICD_VENDORS"] = folder
        try:
            yield
        finally:
            os.environ.pop("OCL_ICD_VENDORS", None)


@contextlib.contextmanager
def own_loader_bound() -> Iterator[None]:
    """While inside, pyopencl is imported with its own loader, whatever loader the process has.

    A program that Python runs in may have asked its own already, which then knows nothing of pip's
    driver: what ParaView loads does, and hwloc when MPI starts.
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
