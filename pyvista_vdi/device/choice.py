"""Probing devices and choosing one: the way from a ``device=`` argument to a runtime."""

from __future__ import annotations

import os
import threading
from dataclasses import replace
from typing import Any

import numpy as np

from pyvista_vdi.device import devices
from pyvista_vdi.device.devices import DeviceInfo, bytes_text
from pyvista_vdi.device.launches import Runtime
from pyvista_vdi.errors import InvalidArgumentError, NoDeviceError, VDIError

PROBE_COUNT, PROBE_GROUP = 256, 32
# OpenCL 1.2 allows expm1 and exp 3 ulp, log1p 2 ulp (section 7.4); one ulp is at most 2^-23 of the
# value; the fourth is for the reference, which is rounded to float32 nowhere.
PROBE_RTOL = 4 * 2.0**-23

_lock = threading.RLock()
_probed: dict[str, tuple[DeviceInfo, Runtime | None]] = {}


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
    return [_probe(info)[0] for info in devices.find_devices()]


def get_runtime(device: Any = None) -> Runtime:
    """Return the runtime of a device, made once per process: the same object for the same device.

    ``device`` is a part of ``"platform / device"``, letter case ignored,
    ``"platform_index:device_index"``, a DeviceInfo or a Runtime. By default it is what the
    environment variable ``PYVISTA_VDI_DEVICE`` says, and without it the best device that passes the
    probe: GPU, then CPU (Intel's runtime before PoCL).

    Raises NoDeviceError if there is no usable device, or the one asked for is absent, ambiguous or
    not usable; InvalidArgumentError for another type; MissingDependencyError without pyopencl;
    DeviceError in a fork of a process that had used or listed devices.
    """
    devices.require_drivers()
    if isinstance(device, Runtime):
        return device
    origin = "device="
    if device is None:
        device = os.environ.get(devices.DEVICE_VARIABLE, "").strip() or None
        origin = f"{devices.DEVICE_VARIABLE}="
    with _lock:
        infos = devices.find_devices()
        if device is None:
            # The first that passes the probe
            for info in sorted(infos, key=devices.preference):
                if (runtime := _probe(info)[1]) is not None:
                    return runtime
            found = devices.listing([_probe(info)[0] for info in infos])
            raise NoDeviceError(
                f"no usable OpenCL device: there is {found}. Remedy: {devices.REMEDY}"
            )
        if isinstance(device, DeviceInfo):
            device = device.selector
        if not isinstance(device, str):
            raise InvalidArgumentError(
                f"device={device!r} of type {type(device).__name__}: give a name, a DeviceInfo or "
                "a Runtime"
            )
        info, runtime = _probe(devices.select(infos, device, origin))
        if runtime is None:
            raise NoDeviceError(
                f"{origin}{device!r} means {info.full_name}, which is not usable: {info.reason}; "
                f"choose another device, or {devices.REMEDY}"
            )
        return runtime


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
    infos, variable = list_devices(), devices.DEVICE_VARIABLE
    selector, best = os.environ.get(variable, "").strip(), None
    why = f"because {variable}={selector!r}" if selector else "GPUs first, then Intel's CPU runtime"
    try:
        best = get_runtime().info
        last = f"Default: {best.full_name}, {why}."
        last += f"\nChoose another with device=, --device or {variable}."
    except NoDeviceError as error:
        last = f"No default: {error}."
    lines = [
        f"{'*' if info is best else ' '} [{info.platform_index}:{info.device_index}] "
        f"{info.full_name}\n"
        f"    {info.kind}, {info.compute_units} compute units, {bytes_text(info.global_memory)} "
        f"memory, {bytes_text(info.max_allocation)} per buffer\n"
        f"    {info.version}, driver {info.driver}, selector {info.selector!r}\n"
        f"    {'usable' if info.usable else f'not used: {info.reason}'}"
        for info in infos
    ]
    return "\n".join([*lines, last])


def _probe(info: DeviceInfo) -> tuple[DeviceInfo, Runtime | None]:
    """Run the probe kernel, once per device and process."""
    with _lock:
        if info.selector not in _probed:
            runtime, reason = None, ""
            try:
                runtime = Runtime(info)
                reason = run_probe(runtime)
            except VDIError as exc:
                reason = f"the probe kernel failed: {exc}"
            info = replace(info, usable=not reason, reason=reason)
            if runtime is not None:
                runtime.info = info
            _probed[info.selector] = (info, None if reason else runtime)
        return _probed[info.selector]


def run_probe(runtime: Runtime) -> str:
    """Run the probe kernel and return what is wrong with its numbers, if anything."""
    x = np.linspace(0.01, 0.99, PROBE_COUNT, dtype=np.float32)
    with (
        runtime.upload(x, name="probe input") as inputs,
        runtime.buffer((PROBE_COUNT, 4), np.float32, name="probe values") as values,
        runtime.buffer((1,), np.uint32, name="probe total") as total,
    ):
        runtime.fill(total, 0)
        launch = runtime.bind("lib/probe.cl", "probe", x=inputs, values=values, total=total)
        launch(PROBE_COUNT, PROBE_GROUP, shared=PROBE_GROUP)
        computed, whole = runtime.download(values), runtime.download(total)
    exact = x.astype(np.float64)
    fused = exact * exact - (x * x)  # exact in float64: 48 bits
    expected = np.stack([np.expm1(-exact), np.log1p(-exact), np.exp(-exact), fused], axis=1)
    right = np.allclose(computed, expected, rtol=PROBE_RTOL, atol=0)
    right = right and whole[0] == len(x) * (len(x) + 1) // 2
    return "" if right else "the probe kernel computes wrong numbers"
