"""Devices, kernel sources, programs and buffers: the only importer of pyopencl.

Importing this compiles nothing, prints nothing and touches no environment; drivers are looked for
when a device is first asked for.
"""

from __future__ import annotations

from pyvista_vdi.device.choice import describe_devices, get_runtime, list_devices
from pyvista_vdi.device.devices import DeviceInfo, bytes_text
from pyvista_vdi.device.launches import Launch, Runtime, padded
from pyvista_vdi.device.memory import DeviceBuffer, Keep, kept_together
from pyvista_vdi.device.programs import Kernel

__all__ = [
    "DeviceBuffer",
    "DeviceInfo",
    "Keep",
    "Kernel",
    "Launch",
    "Runtime",
    "bytes_text",
    "describe_devices",
    "get_runtime",
    "kept_together",
    "list_devices",
    "padded",
]
