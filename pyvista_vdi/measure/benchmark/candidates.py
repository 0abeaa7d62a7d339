"""Who is timed: our two raycasters without and with skipping, and VTK's mappers."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Profile, Runtime
from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.metrics import Comparison, compare_images
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import PreparedVDI
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

#: Who takes part, by the keys of the results, and what tables call them.
CANDIDATES: MappingProxyType[str, str] = MappingProxyType(
    {
        "vdi": "VDI, f",
        "vdi_skipping": "VDI, f_e",
        "volume": "render_volume",
        "volume_skipping": "render_volume, skipping",
        "vtk_gpu": "VTK GPU",
        "vtk_fixed_point": "VTK fixed point",
    }
)

#: Copies of the volume that VTK's GPU mapper makes on the host where there is no GPU: the texture,
#: and what it is filled from.
_VTK_COPIES = 2

Image = NDArray[np.float32]
Step = Callable[[], object]


class VolumeRenderers:
    """One volume in our raycaster and in VTK's mappers, for one window.

    Frames are timed with steps of one voxel and compared with steps of half a voxel, which is the
    step that VDIs are generated with.

    Parameters
    ----------
    runtime : Runtime
        Our device.
    volume : Volume
        What is drawn.
    table : TransferFunction
        How it looks.
    size : (int, int)
        Window, pixels.
    vtk : bool
        Whether VTK's mappers take part.

    Attributes
    ----------
    left_out : dict of str to str
        Candidates that cannot draw it, and why.
    """

    def __init__(
        self,
        runtime: Runtime,
        volume: Volume,
        table: TransferFunction,
        size: tuple[int, int],
        vtk: bool,
    ) -> None:
        self._runtime, self._size = runtime, size
        self.voxel = min(volume.spacing)
        self.step = self.voxel / 2
        self._accurate = DeviceVolume(runtime, volume, table, self.step)
        self._timed = {
            "volume": DeviceVolume(runtime, volume, table, self.voxel, skip_empty=False),
            "volume_skipping": DeviceVolume(runtime, volume, table, self.voxel),
        }
        self._references: dict[float, tuple[Image, dict[str, float] | None]] = {}
        self._peers: dict[str, Any] = {}
        self.left_out: dict[str, str] = {}
        self._open = ExitStack()
        if vtk:
            self._find_peers(volume, table)

    @property
    def opengl(self) -> str | None:
        """OpenGL renderer and version of VTK's GPU mapper, if it takes part."""
        return self._peers["vtk_gpu"].opengl if "vtk_gpu" in self._peers else None

    def image(self, camera: Camera) -> Image:
        """Draw at the accurate step, premultiplied RGBA (H, W, 4)."""
        return raycast_medium(self._runtime, self._accurate, camera, self._size)

    def reference(self, camera: Camera, angle: float) -> tuple[Image, dict[str, float] | None]:
        """Return our picture of a view, and how near VTK's is; both are kept for other VDIs.

        Raises
        ------
        InvalidArgumentError
            If it is black.
        """
        if angle not in self._references:
            image = self.image(camera)
            if not image.any():
                raise InvalidArgumentError(f"nothing is to be seen at {angle:g} degrees")
            theirs = self._vtk_image(camera)
            near = None if theirs is None else accuracy(image, theirs)
            self._references[angle] = (image, near)
        return self._references[angle]

    def _vtk_image(self, camera: Camera) -> Image | None:
        """Draw by VTK's GPU mapper at the accurate step, RGB (H, W, 3); ``None`` without it."""
        peer = self._peers.get("vtk_gpu")
        if peer is None:
            return None
        try:
            peer.set_sample_distance(self.step)
            image: Image = peer.image(camera)
            peer.set_sample_distance(self.voxel)
        except VDIError as error:
            self._leave_out("vtk_gpu", error)
            return None
        return image

    def frames(self, camera: Camera) -> dict[str, Step]:
        """Return what draws a frame, by candidate; ours ends with the picture on the host."""
        steps: dict[str, Step] = {
            name: partial(raycast_medium, self._runtime, medium, camera, self._size)
            for name, medium in self._timed.items()
        }
        for name, peer in self._peers.items():
            peer.set_sample_distance(self.voxel)
            steps[name] = partial(peer.render, camera)
        return steps

    def close(self) -> None:
        """Release VTK's windows."""
        self._open.close()
        self._peers.clear()

    def _find_peers(self, volume: Volume, table: TransferFunction) -> None:
        from pyvista_vdi.measure.vtk_baselines import (
            MAPPERS,
            PeerRenderer,
            property_from_transfer_function,
        )

        for mapper in MAPPERS:
            try:
                if mapper == "gpu":
                    require_free_memory(
                        _VTK_COPIES * volume.array.nbytes,
                        f"the volume {volume.name!r} in VTK's GPU mapper as well, beside ours,",
                        "take a smaller one, or a machine with more memory",
                    )
                prop = property_from_transfer_function(volume, table)
                peer = PeerRenderer(volume, prop, self._size, mapper, self.voxel)
            except VDIError as error:
                self.left_out[f"vtk_{mapper}"] = str(error)
                continue
            self._open.callback(peer.close)
            self._peers[f"vtk_{mapper}"] = peer

    def _leave_out(self, name: str, error: Exception) -> None:
        self.left_out[name] = str(error)
        del self._peers[name]


class VDIRenderer:
    """One VDI on the device, drawn without and with skipping of empty space.

    Parameters
    ----------
    runtime : Runtime
        The device.
    prepared : PreparedVDI
        The VDI there.
    size : (int, int)
        Window, pixels.
    """

    def __init__(self, runtime: Runtime, prepared: PreparedVDI, size: tuple[int, int]) -> None:
        self._runtime, self._prepared, self._size = runtime, prepared, size

    def image(
        self,
        camera: Camera,
        size: tuple[int, int] | None = None,
        *,
        skip_empty: bool = True,
        preview_samples: int | None = None,
    ) -> Image:
        """Draw a frame; premultiplied RGBA (H, W, 4) on the host."""
        width, height = size or self._size
        with self._runtime.result((height, width, 4), name="image") as image:
            self._prepared.render(
                camera,
                (width, height),
                image,
                skip_empty=skip_empty,
                preview_samples=preview_samples,
            )
            return self._runtime.download(image)

    def frames(self, camera: Camera) -> dict[str, Step]:
        """Return what draws a frame, by candidate."""
        return {
            "vdi": partial(self.image, camera, skip_empty=False),
            "vdi_skipping": partial(self.image, camera),
        }


def take_turns(
    runtime: Runtime,
    steps: Mapping[str, Step],
    repeats: int,
    *,
    warm_up: bool = True,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, dict[str, list[float]]]:
    """Time pieces of work, one after the other in turn.

    Parameters
    ----------
    runtime : Runtime
        Whose kernels are timed by the driver's events, too.
    steps : mapping of str to callable
        The work.
    repeats : int
        How often each is timed.
    warm_up : bool
        Do each once before, so that nothing is compiled or uploaded while it is timed.
    clock : callable
        Seconds; the wall's by default.

    Returns
    -------
    dict of str to dict
        By name, ``clock``: seconds of each repetition; ``device``: seconds that kernels ran in it,
        empty where none of ours did.
    """
    taken: dict[str, dict[str, list[float]]] = {n: {"clock": [], "device": []} for n in steps}
    if warm_up:
        for step in steps.values():
            step()
    profile = Profile()
    with runtime.queue_scope(profile):
        for _ in range(repeats):
            for name, step in steps.items():
                before = profile.kernel_seconds()
                begin = clock()
                step()
                taken[name]["clock"].append(clock() - begin)
                if (kernels := profile.kernel_seconds() - before) > 0:
                    taken[name]["device"].append(kernels)
    return taken


def median(taken: Mapping[str, list[float]], clock: str = "clock") -> float | None:
    """Return the median of a candidate's times, seconds; ``None`` where it has none."""
    return statistics.median(taken[clock]) if taken.get(clock) else None


def accuracy(image: Image, reference: Image) -> dict[str, float]:
    """Return what tables say of a picture beside another; the settings are those of ``metrics``."""
    found: Comparison = compare_images(image, reference)
    return {"ssim": found.ssim, "psnr": found.psnr, "worst_pixel": found.worst_pixel}
