"""A device and the context in which everything on it is made; what its driver's errors mean."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.device.buffers import bytes_text
from pyvista_vdi.device.devices import Candidate, DeviceInfo, opencl
from pyvista_vdi.errors import DeviceError, DeviceMemoryError


class Device:
    """A device with a context on it.

    Parameters
    ----------
    candidate : Candidate
        The device.
    context : pyopencl.Context, optional
        A context to share; one of its own by default.

    Attributes
    ----------
    info : DeviceInfo
        What is known of the device.
    is_cpu : bool
        Whether it is the host's processor.
    cl : module
        pyopencl.
    """

    _allocated = 0  # bytes that its buffers hold

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        self.info: DeviceInfo = candidate.info
        self.is_cpu = candidate.info.kind == "CPU"
        self._device = candidate.device
        self.cl: Any = opencl()
        try:
            self._context = context or self.cl.Context([self._device])
        except self.cl.Error as exc:
            raise self.failure(exc, "making a context") from exc

    def __repr__(self) -> str:
        return f"<{type(self).__name__} on {self.info.full_name}>"

    def failure(self, error: Any, doing: str) -> DeviceError | DeviceMemoryError:
        """Return the package's error for one of the driver's, naming what was being done."""
        codes = self.cl.status_code
        code = getattr(error, "code", None)  # what pyopencl raises by itself has none
        if code in (
            codes.MEM_OBJECT_ALLOCATION_FAILURE,
            codes.OUT_OF_RESOURCES,
            codes.OUT_OF_HOST_MEMORY,
            codes.INVALID_BUFFER_SIZE,
        ):
            return DeviceMemoryError(
                f"{self.info.full_name!r} ran out of memory or resources while {doing} "
                f"({error}); it has {bytes_text(self.info.global_memory)}, of which this "
                f"process holds {bytes_text(self._allocated)}: use a smaller volume, window "
                "size or max_supersegments, or another device"
            )
        remedy = "try again, or use another device"
        if code in (
            codes.DEVICE_NOT_AVAILABLE,
            codes.INVALID_COMMAND_QUEUE,
            codes.INVALID_CONTEXT,
            codes.INVALID_DEVICE,
        ):
            remedy = (
                "it may be lost (unplugged, or reset by its driver): start the program again, or "
                "use another device"
            )
        return DeviceError(
            f"{self.info.full_name!r} failed while {doing}: {error}; {remedy} (device=, or the "
            "environment variable PYVISTA_VDI_DEVICE; pyvista-vdi devices lists them)"
        )
