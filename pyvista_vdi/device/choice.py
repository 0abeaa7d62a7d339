"""Probing devices and choosing one: the way from a ``device=`` argument to a runtime."""

from __future__ import annotations

import os
import threading
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import devices
from pyvista_vdi.device.devices import Candidate, DeviceInfo, bytes_text
from pyvista_vdi.device.programs import KernelDeclaration
from pyvista_vdi.device.runtime import Runtime
from pyvista_vdi.errors import InvalidArgumentError, NoDeviceError, VDIError

PROBE = KernelDeclaration("lib/probe.cl", "probe")
PROBE_COUNT = 256
PROBE_GROUP = 32
# OpenCL 1.2 allows expm1 and exp 3 ulp, log1p 2 ulp (section 7.4); one ulp is at most 2^-23 of the
# value; the fourth is for the reference, which is rounded to single precision nowhere.
PROBE_RTOL = 4 * 2.0**-23

_lock = threading.RLock()
_probed: dict[tuple[int, int], tuple[DeviceInfo, Runtime | None]] = {}
_shared_contexts: dict[int, Runtime] = {}
_default: Runtime | None = None


def list_devices() -> list[DeviceInfo]:
    """Every device of every OpenCL platform, after a probe kernel has been tried on each.

    Returns
    -------
    list of DeviceInfo
        In the drivers' order; ``usable`` and ``reason`` say how the probe went.

    Raises
    ------
    MissingDependencyError
        If pyopencl cannot be imported.
    """
    candidates, _ = devices.find_candidates()
    return [_probe(candidate)[0] for candidate in candidates]


def get_runtime(device: Any = None) -> Runtime:
    """Return the runtime of a device, made once per process: the same object for the same device.

    ``device`` is a part of ``"platform / device"``, letter case ignored,
    ``"platform_index:device_index"``, a DeviceInfo, a Runtime, or pyopencl's Device or Context,
    which is shared and must have one device. By default it is what the environment variable
    ``PYVISTA_VDI_DEVICE`` says, and without it the best device that passes the probe: GPU, then CPU
    (Intel's runtime before PoCL).

    Raises NoDeviceError if there is no usable device, or the one asked for is absent, ambiguous or
    not usable; InvalidArgumentError for another type; MissingDependencyError without pyopencl;
    DeviceError in a fork of a process that had used or listed devices.
    """
    if devices.forked:
        devices.require_drivers()
    if isinstance(device, Runtime):
        return device
    origin = "device="
    if device is None:
        device = os.environ.get(devices.DEVICE_VARIABLE, "").strip() or None
        origin = f"{devices.DEVICE_VARIABLE}="
    if device is None and _default is not None:
        return _default
    with _lock:
        return _best() if device is None else _named(device, origin)


def default_device(infos: list[DeviceInfo]) -> DeviceInfo | None:
    """The device that is used when none is named, among probed ones; None if none is usable."""
    usable = [info for info in infos if info.usable]
    return min(usable, key=devices.preference) if usable else None


def describe_devices() -> str:
    """Every device found, which one is the default, and why the others are not used.

    Returns
    -------
    str
        Lines for ``pyvista-vdi devices``; with the remedy if nothing is usable.

    Raises
    ------
    MissingDependencyError
        If pyopencl cannot be imported.
    """
    _, notes = devices.find_candidates()
    infos = list_devices()
    best, variable = default_device(infos), devices.DEVICE_VARIABLE
    selector = os.environ.get(variable, "").strip()
    if selector:
        try:
            best = devices.select(infos, selector, f"{variable}=")
            last = f"Default: {best.full_name}, because {variable}={os.environ[variable]!r}."
            if not best.usable:
                last = f"No default: {_unusable(best, f'{variable}={selector!r}')}."
        except NoDeviceError as exc:
            best, last = None, f"No default: {exc}."
    elif best is not None:
        last = (
            f"Default: {best.full_name}; GPUs come first, then CPUs, Intel's before PoCL.\n"
            f"Choose another with device=, --device or {variable}."
        )
    else:
        last = devices.no_device_message(infos, []) + "."

    lines = []
    for info in infos:
        mark = "*" if best and best.usable and info.index == best.index else " "
        memory, most = bytes_text(info.global_memory), bytes_text(info.max_allocation)
        precision = "fp64" if info.has_fp64 else "no fp64"
        lines.append(f"{mark} [{info.platform_index}:{info.device_index}] {info.full_name}")
        lines.append(
            f"    {info.kind}, {info.compute_units} compute units, {memory} memory, "
            f"{most} per buffer, {precision}"
        )
        lines.append(f"    {info.version}, driver {info.driver}, selector {info.selector!r}")
        lines.append("    usable" if info.usable else f"    not used: {info.reason}")
    return "\n".join([*lines, last, *(f"Note: {note}." for note in notes if note not in last)])


def _best() -> Runtime:
    """Find the first device that passes the probe, and remember it: the drivers' list is fixed."""
    global _default
    candidates, notes = devices.find_candidates()
    for candidate in sorted(candidates, key=lambda c: devices.preference(c.info)):
        _default = _probe(candidate)[1]
        if _default is not None:
            return _default
    infos = [_probe(candidate)[0] for candidate in candidates]
    raise NoDeviceError(devices.no_device_message(infos, notes))


def _named(device: Any, origin: str) -> Runtime:
    candidates, _ = devices.find_candidates()
    infos, context = [candidate.info for candidate in candidates], None
    there = f"there is {devices.listing(infos)}"
    if isinstance(device, str):
        info = devices.select(infos, device, origin)
    elif isinstance(device, DeviceInfo):
        if (device.index, device.full_name) not in [(i.index, i.full_name) for i in infos]:
            raise NoDeviceError(
                f"the device {device.full_name} does not exist in this process; {there}"
            )
        info = device
    elif hasattr(device, "int_ptr"):
        context = device if hasattr(device, "devices") else None
        if context is not None and len(context.devices) != 1:
            raise InvalidArgumentError(
                f"a context of {len(context.devices)} devices was given; it must have exactly one"
            )
        handle = device if context is None else context.devices[0]
        same = [each.info for each in candidates if each.device.int_ptr == handle.int_ptr]
        if not same:
            raise NoDeviceError(
                f"{device!r} is none of the devices that the drivers list (a sub-device?); {there}"
            )
        info = same[0]
    else:
        raise InvalidArgumentError(
            f"device={device!r} of type {type(device).__name__}: give a name, a DeviceInfo, a "
            "Runtime, a pyopencl.Device or a pyopencl.Context"
        )

    candidate = next(each for each in candidates if each.info.index == info.index)
    probed, runtime = _probe(candidate)
    if runtime is None:
        raise NoDeviceError(_unusable(probed, f"{origin}{device!r}"))
    if context is None:
        return runtime
    key = int(context.int_ptr)
    if key not in _shared_contexts:
        # The runtime keeps the context alive, so that its address cannot be given to another
        _shared_contexts[key] = Runtime(Candidate(probed, candidate.device), context)
    return _shared_contexts[key]


def _unusable(info: DeviceInfo, asked: str) -> str:
    return (
        f"{asked} means {info.full_name}, which is not usable: {info.reason}; "
        f"choose another device, or {devices.remedy()}"
    )


def _probe(candidate: Candidate) -> tuple[DeviceInfo, Runtime | None]:
    """Run the probe kernel, once per device and process."""
    with _lock:
        index = candidate.info.index
        if index not in _probed:
            runtime, reason = None, ""
            try:
                runtime = Runtime(candidate)
                reason = run_probe(runtime)
            except VDIError as exc:
                reason = f"the probe kernel failed: {exc}"
            info = replace(candidate.info, usable=not reason, reason=reason)
            if runtime is not None:
                runtime.info = info
            _probed[index] = (info, None if reason else runtime)
        return _probed[index]


def run_probe(runtime: Runtime) -> str:
    """Run the probe kernel and return what is wrong with its numbers, if anything."""
    x = np.linspace(0.01, 0.99, PROBE_COUNT, dtype=np.float32)
    groups = PROBE_COUNT // PROBE_GROUP
    with (
        runtime.upload(x, name="probe input") as inputs,
        runtime.buffer((PROBE_COUNT, 4), np.float32, name="probe values") as values,
        runtime.buffer((groups,), np.uint32, name="probe sums") as sums,
        runtime.buffer((1,), np.uint32, name="probe total") as total,
    ):
        runtime.fill(total, 0)
        launch = runtime.bind(PROBE, x=inputs, values=values, group_sum=sums, total=total)
        launch(PROBE_COUNT, PROBE_GROUP, shared=PROBE_GROUP)
        return _check_probe(x, *(runtime.download(b) for b in (values, sums, total)))


def _check_probe(x: Any, values: Any, sums: Any, total: Any) -> str:
    exact = x.astype(np.float64)
    square = (x * x).astype(np.float64)
    expected = {
        "expm1": np.expm1(-exact),
        "log1p": np.log1p(-exact),
        "exp": np.exp(-exact),
        "fma": exact * exact - square,  # exact in float64: 48 bits
    }
    for column, (name, wanted) in enumerate(expected.items()):
        rtol = 0.0 if name == "fma" else PROBE_RTOL
        error = np.abs(values[:, column] - wanted)
        if not np.all(error <= rtol * np.abs(wanted)):
            worst = int(np.nanargmax(np.where(np.isnan(error), np.inf, error)))
            return (
                f"the probe kernel's {name} of {x[worst]!r} is {values[worst, column]!r}, "
                f"not {wanted[worst]!r}"
            )
    group_sums = np.arange(len(x), dtype=np.uint32).reshape(len(sums), -1).sum(axis=1)
    if not np.array_equal(sums, group_sums):
        return f"the probe kernel's sums through local memory are {sums}, not {group_sums}"
    if total[0] != len(x) * (len(x) + 1) // 2:
        return f"the probe kernel's atomic sum is {total[0]}, not {len(x) * (len(x) + 1) // 2}"
    return ""
