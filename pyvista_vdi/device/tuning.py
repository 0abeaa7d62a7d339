"""Work-group sizes, timed on the first real launches of each kernel and kept in a file.

A kernel whose answer does not depend on the size of its work-groups is launched with several sizes
in turn while it does its work, so that nobody waits for a tuning. The size that was faster than the
kernel's own each time is used from then on, in later processes as well.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
import random
import statistics
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pyvista_vdi.device.devices import DeviceInfo, opencl
from pyvista_vdi.device.programs import Kernel
from pyvista_vdi.errors import VDIError

TUNING_VARIABLE = "PYVISTA_VDI_TUNING"

#: Work-items of a group that are tried, where the device and the compiled kernel allow them.
SIZES = (16, 32, 64, 128, 256, 512)
#: Groups of the largest size for each compute unit that a launch must have, to say anything.
_GROUPS_PER_UNIT = 4
#: Rounds of turns that must say the same, after one that wakes clocks and caches up.
ROUNDS = 3
#: Rounds after which a kernel keeps its own size in this process if they say nothing: its launches
#: do different work, or what else runs disturbs them.
MOST_ROUNDS = 12
#: Logarithm of what a size's two turns of a round may differ by, drift aside, if it is to count.
_SCATTER = 0.1
#: Share of the time with the kernel's own size that another must stay below in every round: what
#: is nearer repeats by chance.
LEAST_GAIN = 0.97
#: By how much the work-items of a round's launches may differ.
_LIKE = 1.25
#: Of the file's contents, and the bytes of it that are looked at.
_VERSION, _MOST_BYTES = 1, 2**20

_OFF = ("off", "0", "no", "false")
_ON = ("on", "1", "yes", "true")

_logger = logging.getLogger(__name__)


class Turn(NamedTuple):
    """A launch that is timed: which one of a round."""

    trial: _Trial
    number: int


def cache_folder() -> Path | None:
    """Return the folder for what can be made again, by the system's convention, if there is one."""
    try:
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            base = Path(local) if local else Path.home() / "AppData" / "Local"
            return base / "pyvista-vdi" / "Cache"
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "pyvista-vdi"
        named = Path(os.environ.get("XDG_CACHE_HOME", ""))
        return (named if named.is_absolute() else Path.home() / ".cache") / "pyvista-vdi"
    except RuntimeError:  # nobody's home
        return None


def tuner_of(device: Any, info: DeviceInfo) -> Tuner | None:
    """Return what chooses a device's work-group sizes; None where kernels keep their own.

    That is as ``PYVISTA_VDI_TUNING`` says: ``off``, ``on``, or ``redo``, which measures anew. By
    default GPUs alone are tuned: on CPUs there is nothing to choose (docs/performance.md).
    """
    wanted = os.environ.get(TUNING_VARIABLE, "").strip().lower()
    asked = wanted in (*_ON, "redo") or (info.kind == "GPU" and wanted not in _OFF)
    if not asked:
        return None
    folder = cache_folder()
    file = None if folder is None else folder / "work_groups.json"
    return Tuner(device, info, file, redo=wanted == "redo")


def tuned_sizes(info: DeviceInfo) -> dict[str, int]:
    """Return what the file says of a device: work-group sizes by kernel."""
    folder = cache_folder()
    everything = {} if folder is None else _read(folder / "work_groups.json")
    found = everything.get(_device_key(info), {})
    return {kernel.split(":")[-1]: entry["size"] for kernel, entry in sorted(found.items())}


class Tuner:
    """Chooses work-group sizes for the kernels of one device; threads may share it.

    ``file`` is where sizes are kept, if anywhere; with ``redo`` those in it are measured anew.
    """

    def __init__(
        self, device: Any, info: DeviceInfo, file: Path | None, *, redo: bool = False
    ) -> None:
        self._device = device
        self._info = info
        self._file = file
        self._lock = threading.Lock()
        self._kept: Mapping[str, Any] | None = {} if redo else None
        self._chosen: dict[str, int] = {}
        self._trials: dict[str, _Trial] = {}
        self._allowed: dict[Kernel, tuple[int, ...]] = {}

    def size(
        self, kernel: Kernel, items: int, own: int, *, timed: bool = True
    ) -> tuple[int, Turn | None]:
        """Return the work-group size of a launch, and the turn that it is if it is to be timed.

        ``own`` is the size that the kernel has otherwise. A launch of too few ``items`` to fill the
        device, or one that is not to be ``timed``, is no turn.
        """
        with self._lock:
            allowed = self._allowed.get(kernel)
            if allowed is None:
                allowed = self._allowed[kernel] = self._sizes(kernel, own)
            name = f"{kernel.path}:{kernel.name}"
            chosen = self._chosen.get(name) or self._from_file(name, kernel)
            if chosen is not None:
                return (chosen if chosen in allowed else own), None
            enough = _GROUPS_PER_UNIT * self._info.compute_units * allowed[-1]
            if not timed or len(allowed) == 1 or items < enough:
                return own, None
            trial = self._trials.setdefault(name, _Trial())
            found = trial.next(kernel, allowed, items, own)
            if isinstance(found, Turn):
                return trial.order[found.number], found
            if found is not None:
                self._chosen[name] = found
                del self._trials[name]
                if trial.compared:
                    self._write(name, kernel, found)
            return found or own, None

    def timed(self, turn: Turn, event: Any) -> None:
        """Take the event of a launch that is a turn."""
        with self._lock:
            turn.trial.launched(turn.number, event)

    def _sizes(self, kernel: Kernel, own: int) -> tuple[int, ...]:
        """Return the sizes that a kernel may have, ascending, with its own."""
        of = opencl().kernel_work_group_info
        ask = kernel.object.get_work_group_info
        multiple = int(ask(of.PREFERRED_WORK_GROUP_SIZE_MULTIPLE, self._device))
        # The compiled kernel's limit counts its registers and its local memory
        most = min(
            int(ask(of.WORK_GROUP_SIZE, self._device)), int(self._device.max_work_group_size)
        )
        most = min(most, int(self._device.max_work_item_sizes[0]))
        tried = (n for n in SIZES if n <= most and n % max(multiple, 1) == 0)
        return tuple(sorted({own, *tried}))

    def _write(self, name: str, kernel: Kernel, size: int) -> None:
        if self._file is None:
            return
        entry = {"size": size, "source": _source_key(kernel)}
        try:
            _keep(self._file, _device_key(self._info), name, entry)
        except (OSError, VDIError) as exc:
            _logger.debug("the work-group size of %s is not kept: %s", name, exc)

    def _from_file(self, name: str, kernel: Kernel) -> int | None:
        if self._kept is None:
            everything = {} if self._file is None else _read(self._file)
            self._kept = everything.get(_device_key(self._info), {})
        entry = self._kept.get(name)
        if entry is None or entry["source"] != _source_key(kernel):
            return None
        self._chosen[name] = entry["size"]
        return self._chosen[name]


class _Trial:
    """The turns of a kernel's candidates: rounds in which each has two, in orders that are drawn.

    What drifts from launch to launch, as under a camera that moves, is taken out. A round whose
    launches differ otherwise counts nothing; a fixed order could keep in step with those.
    """

    def __init__(self) -> None:
        self.order: list[int] = []
        self._kernel: Kernel | None = None
        self._items = 1  # of the round's first launch
        self._events: list[Any] = []
        self._shares: list[dict[int, float]] = []
        self._rounds = 0
        self._draw = random.Random(0)

    @property
    def compared(self) -> bool:
        """Whether there were enough rounds that say something."""
        return len(self._shares) == ROUNDS

    def next(
        self, kernel: Kernel, allowed: tuple[int, ...], items: int, own: int
    ) -> Turn | int | None:
        """Return the next launch's turn, or the size that won; None while times are awaited."""
        if self.order and len(self._events) == len(self.order):
            times = [_nanoseconds(event) for event in self._events]
            if None in times:
                return None
            self._end_round([time for time in times if time is not None], own)
            if self.compared:
                return self._winner(own)
            if self._rounds > MOST_ROUNDS:
                return own
        alike = self._kernel is kernel and 1 / _LIKE <= items / self._items <= _LIKE
        if not self.order or not alike:
            halves = (self._draw.sample(allowed, len(allowed)) for _ in range(2))
            self.order, self._events = [size for half in halves for size in half], []
            self._kernel, self._items = kernel, items
        return Turn(self, len(self._events))

    def launched(self, number: int, event: Any) -> None:
        """Take a turn's event, unless another thread was first or the round was given up."""
        if number == len(self._events) < len(self.order):
            self._events.append(event)

    def _end_round(self, times: list[int], own: int) -> None:
        order, self.order = np.array(self.order), []
        self._rounds += 1
        if self._rounds == 1 or min(times) == 0:
            return
        logs = np.log(times)
        turns = {size: np.flatnonzero(order == size) for size in order.tolist()}
        apart, grown = (
            np.array([some[second] - some[first] for first, second in turns.values()])
            for some in (np.arange(order.size), logs)
        )
        drift = (grown @ apart) / (apart @ apart)
        if np.abs(grown - drift * apart).max() <= _SCATTER:
            logs -= drift * np.arange(order.size)
            means = {size: logs[at].mean() for size, at in turns.items()}
            self._shares.append({n: math.exp(mean - means[own]) for n, mean in means.items()})

    def _winner(self, own: int) -> int:
        """Return the size that was faster than the kernel's own in every round, and by most."""
        better = {own: 1.0}
        for size in self._shares[0]:
            shares = [share.get(size, 1.0) for share in self._shares]
            if max(shares) < LEAST_GAIN:
                better[size] = statistics.median(shares)
        return min(better, key=lambda size: better[size])


def _nanoseconds(event: Any) -> int | None:
    """Return an event's device time; None if it has not ended, 0 if it failed."""
    cl = opencl()
    try:
        status = int(event.command_execution_status)
        if status > cl.command_execution_status.COMPLETE:
            return None
        return max(0, int(event.profile.end) - int(event.profile.start)) if status == 0 else 0
    except cl.Error:
        return 0


# -- the file ----------------------------------------------------------------------------------


def _device_key(info: DeviceInfo) -> str:
    return f"{info.full_name}, driver {info.driver}"


def _source_key(kernel: Kernel) -> str:
    return hashlib.sha256(kernel.source.encode()).hexdigest()[:16]


def _read(file: Path) -> dict[str, dict[str, Any]]:
    """Return what a file says by device and kernel, as far as it makes sense; {} if it does not."""
    try:
        with file.open("rb") as stream:
            contents = json.loads(stream.read(_MOST_BYTES))
        if contents["version"] != _VERSION:
            return {}
        return {
            device: {name: entry for name, entry in kernels.items() if _makes_sense(entry)}
            for device, kernels in contents["devices"].items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return {}


def _makes_sense(entry: dict[str, Any]) -> bool:
    size, source = entry["size"], entry["source"]
    return type(size) is int and size in SIZES and type(source) is str


def _keep(file: Path, device: str, name: str, entry: dict[str, Any]) -> None:
    """Put an entry into the file. What another process writes meanwhile is measured once more."""
    from pyvista_vdi.io import whole_file  # an upper layer's, for the few times that this happens

    file.parent.mkdir(parents=True, exist_ok=True)
    devices = _read(file)
    devices.setdefault(device, {})[name] = entry
    contents = {"version": _VERSION, "devices": devices}
    with whole_file(file) as stream:
        stream.write(json.dumps(contents, indent=1, sort_keys=True).encode())
