"""Runtimes of their own, and runtimes that are short of memory."""

from __future__ import annotations

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import DeviceMemoryError


def fresh_runtime(runtime):
    """Another runtime on the device of one: its peak of allocated memory is 0."""
    return Runtime(runtime.info)


def let_lack(monkeypatch, runtime, name):
    """Let a runtime have no memory for the buffer of this name."""
    for method in ("buffer", "result"):
        take = getattr(runtime, method)

        def scarce(*args, take=take, **options):
            if name in (*args, *options.values()):
                raise DeviceMemoryError(f"no room for {name}")
            return take(*args, **options)

        monkeypatch.setattr(runtime, method, scarce)
