"""The devices that exist, what is known of each, and which one a selector or the default means.

Everything here but :func:`find_devices` works on plain :class:`DeviceInfo` lists and needs no
driver.
"""

import importlib
import os
import re
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

from pyvista_vdi.device.icd import (
    after_listing,
    drivers_visible,
    own_loader_bound,
    pocl_cache_at_hand,
)
from pyvista_vdi.errors import DeviceError, MissingDependencyError, NoDeviceError
from pyvista_vdi.model.user_cache import writable_cache

DEVICE_VARIABLE = "PYVISTA_VDI_DEVICE"

REMEDY = (
    'install a CPU runtime with  pip install "pyvista-vdi[cpu]"  (x86-64 Linux and Windows), or '
    "Debian's and Ubuntu's package pocl-opencl-icd, or your GPU's OpenCL driver"
)

#: Why a device that nobody has tried yet is not used.
NOT_PROBED = "not probed"

_KIND_RANK = {"GPU": 0, "CPU": 1, "accelerator": 2}


@dataclass(frozen=True)
class DeviceInfo:
    """What is known of one OpenCL device.

    Attributes
    ----------
    name, platform, vendor, version, driver : str
        As the driver reports them; ``version`` is the device's OpenCL version.
    kind : str
        ``"GPU"``, ``"CPU"`` or ``"accelerator"``.
    compute_units : int
        Parallel compute units; hardware threads on a CPU.
    global_memory, max_allocation : int
        Bytes in all, and bytes that one buffer may have.
    has_fp64 : bool
        Whether kernels may use ``double``.
    usable : bool
        Whether the probe kernel ran on it and gave the right numbers.
    reason : str
        Why it is not used; empty when usable.
    selector : str
        Short string that selects exactly this device.
    platform_index, device_index : int
        Position in the driver's lists; ``"platform_index:device_index"`` selects it too.
    unified_memory : bool
        Whether device and host share memory.
    """

    name: str
    platform: str
    vendor: str
    version: str
    driver: str
    kind: str
    compute_units: int
    global_memory: int
    max_allocation: int
    has_fp64: bool
    usable: bool = False
    reason: str = NOT_PROBED
    selector: str = ""
    platform_index: int = 0
    device_index: int = 0
    unified_memory: bool = False

    @property
    def full_name(self) -> str:
        """``"platform / device"``: the text that a selector is matched with."""
        return f"{self.platform} / {self.name}"

    @property
    def index(self) -> tuple[int, int]:
        """Platform index and device index: what identifies a device in this process."""
        return (self.platform_index, self.device_index)


def preference(info: DeviceInfo) -> tuple[int, ...]:
    """Sort key of the default choice, best first.

    GPU before CPU before accelerator (an emulator as a rule); among GPUs those with memory of
    their own, then more compute units; among CPUs Intel's runtime, which was measured three times
    faster than PoCL on a plain volume raycaster, on AMD CPUs as well.
    """
    return (
        _KIND_RANK.get(info.kind, len(_KIND_RANK)),
        int(info.kind == "GPU" and info.unified_memory),
        int(info.kind == "CPU" and "intel" not in info.platform.lower()),
        -info.compute_units,
        *info.index,
    )


def match(infos: Sequence[DeviceInfo], selector: str) -> list[DeviceInfo]:
    """Return the devices that a selector means: none, one, or several if it is ambiguous.

    It is ``"platform_index:device_index"``, ``"platform:device_index"``, or a part of
    ``"platform / device"`` or of the version. Letter case is ignored; an exact name beats a part of
    one, and a part of the platform beats one of the device.
    """
    text = re.sub(r"\s*:\s*", ":", selector.strip().lower())
    platform, _, number = text.rpartition(":")
    if platform.isdigit() and number.isdigit():
        return [info for info in infos if info.index == (int(platform), int(number))]
    ways: tuple[Callable[[DeviceInfo], bool], ...] = (
        lambda i: text in (i.full_name.lower(), i.name.lower(), i.selector.lower()),
        # "intel" is a platform before it is the processor that PoCL runs on; "pocl" is in versions
        lambda i: text in i.platform.lower(),
        lambda i: text in i.full_name.lower(),
        lambda i: text in f"{i.version} {i.driver}".lower(),
        lambda i: platform != "" and platform in i.platform.lower() and number == str(i.index[1]),
    )
    return next((found for way in ways if (found := [i for i in infos if way(i)])), [])


def with_selectors(infos: Sequence[DeviceInfo]) -> list[DeviceInfo]:
    """Return the same devices, each with the shortest kind of selector that means it alone."""
    platforms = {(info.platform.lower(), info.platform_index) for info in infos}
    names = [name for name, _ in platforms]
    return [
        replace(info, selector=f"{name if names.count(name) == 1 else number}:{info.device_index}")
        for info in infos
        for name, number in [(info.platform.lower(), info.platform_index)]
    ]


def listing(infos: Sequence[DeviceInfo]) -> str:
    """Return the devices in one sentence, for error messages."""
    return (
        "; ".join(
            f"{info.full_name} ({info.kind}, selected by {info.selector!r}"
            + (
                ""
                if info.usable or info.reason in ("", NOT_PROBED)
                else f", not usable: {info.reason}"
            )
            + ")"
            for info in infos
        )
        or "no device at all"
    )


def select(infos: Sequence[DeviceInfo], selector: str, origin: str) -> DeviceInfo:
    """Return the one device that a selector means, see :func:`match`.

    ``origin`` is where the selector came from, for messages: ``"device="``, say. NoDeviceError if
    it means none or several, with a list of what exists.
    """
    found = match(infos, selector)
    if len(found) == 1:
        return found[0]
    if found:
        raise NoDeviceError(
            f"{origin}{selector!r} means {len(found)} devices: {listing(found)}; "
            "name one of them by its selector"
        )
    raise NoDeviceError(
        f"{origin}{selector!r}: there is no such OpenCL device; there is {listing(infos)}"
        f"{'' if infos else f'; {advice}'}"
    )


def no_device_message(infos: Sequence[DeviceInfo], notes: Sequence[str]) -> str:
    """Return what was found where nothing can be used, why it failed, and what to do."""
    found = f"found {listing(infos)}" if infos else "no OpenCL driver lists a device"
    details = "".join(f"; {note}" for note in notes if note and note != advice)
    return f"no usable OpenCL device: {found}{details}. Remedy: {advice}"


def bytes_text(nbytes: int) -> str:
    """Return a number of bytes for people: ``"1.50 GiB (1610612736 bytes)"``."""
    for unit, size in (("GiB", 2**30), ("MiB", 2**20), ("KiB", 2**10)):
        if nbytes >= size:
            return f"{nbytes / size:.2f} {unit} ({nbytes} bytes)"
    return f"{nbytes} bytes"


_lock = threading.RLock()
_found: tuple[list[DeviceInfo], list[str]] | None = None
#: The driver's own object of each device, by its index.
handles: dict[tuple[int, int], Any] = {}
#: What to do where no device will do; what is installed already is not advised.
advice = REMEDY
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
    # There pyopencl keeps the Python code that it makes for kernels, and it fails where it cannot
    try:
        writable_cache("pytools", "pytools")
    except OSError:
        cl._PYOPENCL_NO_CACHE = True
    return cl


def find_devices() -> tuple[list[DeviceInfo], list[str]]:
    """Return every device of every platform, unprobed, in the drivers' order, listed once.

    Also notes on how they were looked for. MissingDependencyError if pyopencl cannot be imported,
    DeviceError in a fork of a process that had listed them.
    """
    global _found, advice
    require_drivers()
    if _found is not None:
        return _found  # likewise without a lock
    with _lock:
        if _found is None:
            with drivers_visible() as discovery, pocl_cache_at_hand():
                early = "pyopencl" in sys.modules
                cl = _import_pyopencl()
                infos, notes = _list(cl)
                discovery = after_listing(discovery) if early else discovery
            advice = discovery.note if discovery.hidden else REMEDY
            _found = infos, [discovery.note, *notes]
        return _found


def _list(cl: ModuleType) -> tuple[list[DeviceInfo], list[str]]:
    notes, infos = [], []
    try:
        platforms = cl.get_platforms()
    except cl.Error as exc:  # PLATFORM_NOT_FOUND_KHR: the loader knows no driver
        return [], [f"the OpenCL loader says: {exc}"]
    for platform_index, platform in enumerate(platforms):
        try:
            devices = platform.get_devices()
        except cl.Error as exc:
            notes.append(f"the platform {platform.name.strip()!r} lists no device: {exc}")
            continue
        for device_index, device in enumerate(devices):
            try:
                infos.append(_describe(cl, device, platform_index, device_index))
                handles[infos[-1].index] = device
            except cl.Error as exc:
                notes.append(f"device {platform_index}:{device_index} cannot be queried: {exc}")
    return with_selectors(infos), notes


def _describe(cl: ModuleType, device: Any, platform_index: int, device_index: int) -> DeviceInfo:
    kinds = {cl.device_type.GPU: "GPU", cl.device_type.CPU: "CPU"}
    return DeviceInfo(
        name=device.name.strip(),
        platform=device.platform.name.strip(),
        vendor=device.vendor.strip(),
        version=device.version.strip(),
        driver=device.driver_version.strip(),
        kind=next((name for bit, name in kinds.items() if device.type & bit), "accelerator"),
        compute_units=int(device.max_compute_units),
        global_memory=int(device.global_mem_size),
        max_allocation=int(device.max_mem_alloc_size),
        has_fp64="cl_khr_fp64" in device.extensions.split(),
        platform_index=platform_index,
        device_index=device_index,
        unified_memory=bool(device.host_unified_memory),
    )
