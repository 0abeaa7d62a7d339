"""The volumes that are measured: shipped, in a folder, procedural, or files that the user names."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import examples
from pyvista_vdi.errors import InvalidArgumentError, InvalidVolumeError
from pyvista_vdi.measure.benchmark.paper import paper_tables
from pyvista_vdi.measure.benchmark.procedural import PROCEDURAL, Procedural, Progress, make
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import VOXEL_TYPES, Volume

#: Seed of the procedural volumes where none is given.
DEFAULT_SEED = 1

#: Noise and planes while a procedural volume is made, bytes: at most.
_WORKING_BYTES = 2**30

#: Entries of the transfer functions, as ``add_volume`` has them by default.
_ENTRIES = 256

#: Opacity at equidistant scalars, by look.
_OPACITIES: MappingProxyType[str, tuple[float, ...]] = MappingProxyType(
    {
        # What add_volume's opacity="linear" is
        "ramp": (0.0, 1.0),
        # Air and its noise are transparent; tissue is translucent, bone is not
        "empty below a fifth": (0.0, 0.0, 0.02, 0.05, 0.3, 0.8),
        # One fluid is transparent, the other translucent
        "one of two fluids": (0.0, 0.0, 0.0, 0.01, 0.05, 0.15, 0.05, 0.01, 0.005),
    }
)
#: What NumPy raises for files that are no arrays: their header is a Python expression.
_BAD_ARRAY = (ValueError, TypeError, SyntaxError, OverflowError, RecursionError, TokenError)

#: RGB at equidistant scalars: black, blue-grey, white.
_COLORS = ((0.0, 0.0, 0.0), (0.25, 0.3, 0.45), (0.7, 0.7, 0.6), (1.0, 1.0, 1.0))

_LOOKS = MappingProxyType(
    {
        "kingsnake": "empty below a fifth",
        "beechnut": "empty below a fifth",
        "richtmyer_meshkov": "one of two fluids",
    }
)


@dataclass(frozen=True)
class Dataset:
    """A volume to be measured, and how it looks.

    Parameters
    ----------
    name : str
        What the results call it.
    source : {"example", "procedural", "file"}
        Where it is from.
    paper : str or None
        The paper's data set that it is, or stands in for.
    description : str
        One phrase.
    look : str
        Name of its transfer function.
    nbytes : int or None
        Bytes of the volume, where they are known before it is there.
    load : callable
        ``load(progress)`` returns the volume.
    """

    name: str
    source: str
    paper: str | None
    description: str
    look: str
    nbytes: int | None
    load: Callable[[Progress | None], Volume]

    def transfer_function(self, volume: Volume, interpolation: str) -> TransferFunction:
        """Return its transfer function; it needs no PyVista, so that every run has the same."""
        scalar_range = volume.finite_range()
        if self.source == "procedural":  # its type's whole range, whatever the seed made of it
            limits = np.iinfo(volume.array.dtype.name)
            scalar_range = float(limits.min), float(limits.max)
        return look(self.look, scalar_range, interpolation)

    def describe(self, volume: Volume) -> dict[str, Any]:
        """Return what the results say of it."""
        return {
            "source": self.source,
            "description": self.description,
            "paper": self.paper,
            "look": self.look,
            "dimensions": list(volume.dimensions),
            "spacing": list(volume.spacing),
            "dtype": volume.array.dtype.name,
            "bytes": volume.array.nbytes,
        }


def look(name: str, scalar_range: tuple[float, float], interpolation: str) -> TransferFunction:
    """Return a transfer function by its name: a key of the opacities above."""
    return TransferFunction(
        np.stack([_resampled(channel) for channel in zip(*_COLORS, strict=True)], axis=1),
        _resampled(_OPACITIES[name]),
        scalar_range,
        interpolation=interpolation,
    )


def find_dataset(name: str, seed: int = DEFAULT_SEED) -> Dataset:
    """Return a data set by its name.

    Parameters
    ----------
    name : str
        A name of :data:`pyvista_vdi.examples.VOLUMES`; ``kingsnake_like``, ``beechnut_like`` or
        ``richtmyer_meshkov_like``, made at the paper's size or with ``@4`` at a quarter of it
        along each edge; or a file, as ``FILE`` or as ``NAME=FILE``, where a NAME of ``kingsnake``,
        ``beechnut`` or ``richtmyer_meshkov`` says which of the paper's it is.
    seed : int
        Of a procedural volume.

    Raises
    ------
    InvalidArgumentError
        If nothing has that name.
    """
    base, _, factor = name.partition("@")
    if base in PROCEDURAL:
        return _procedural(name, PROCEDURAL[base], _factor(name, factor), seed)
    if name in examples.VOLUMES:
        return Dataset(
            name,
            "example",
            None,
            examples.VOLUMES[name].description,
            "ramp",
            None,
            lambda progress: examples.load_data(name, as_volume=True),
        )
    file = Path(name.rpartition("=")[2])
    if not file.exists():
        known = ", ".join([*sorted(examples.VOLUMES), *PROCEDURAL])
        raise InvalidArgumentError(
            f"no volume is called {name!r}, and there is no such file: choose one of {known}, or "
            "name a file"
        )
    label = label_of(name)
    paper = label if label in {row["dataset"] for row in paper_tables()["table1"]} else None
    return Dataset(
        label,
        "file",
        paper,
        file.name,
        _LOOKS.get(label, "ramp"),
        None,
        lambda progress: read_file(file),
    )


def label_of(name: str) -> str:
    """Return what the results call a data set: its name, without the folder of a file."""
    if name.partition("@")[0] in PROCEDURAL or name in examples.VOLUMES:
        return name
    label, _, path = name.rpartition("=")
    return label or Path(path).name.split(".")[0]


def read_file(file: Path) -> Volume:
    """Read a volume of any format that can be read here.

    Raw files are those of the Open Scientific Visualization Datasets, whose names tell what they
    hold: ``kingsnake_1024x1024x795_uint8.raw``. NumPy's ``.npy`` holds scalars (nz, ny, nx). These
    and NRRD need no PyVista; other formats do.

    Parameters
    ----------
    file : pathlib.Path
        An existing file, or a folder of DICOM slices.

    Returns
    -------
    Volume
        The first array.

    Raises
    ------
    InvalidVolumeError
        If it cannot be read.
    MissingDependencyError
        If PyVista is needed and not installed.
    """
    suffix = file.suffix.lower()
    if suffix == ".raw":
        return _read_raw(file)
    if suffix == ".npy":
        return _read_npy(file)
    if suffix in (".nrrd", ".nhdr"):
        return examples.read_nrrd(file, "values")
    from pyvista_vdi.api import as_volume
    from pyvista_vdi.plotting.cli_support import read_volume

    return as_volume(read_volume(file), None, "point")


def _read_raw(file: Path) -> Volume:
    found = re.search(r"_(\d+)x(\d+)x(\d+)_([a-z]+\d+)\.raw$", file.name, re.IGNORECASE)
    if found is None or found[4].lower() not in VOXEL_TYPES:
        raise InvalidVolumeError(
            f"{file} does not say what it holds: name raw files like "
            f"kingsnake_1024x1024x795_uint8.raw, with a type of {', '.join(VOXEL_TYPES)}"
        )
    nx, ny, nz = (int(found[i]) for i in (1, 2, 3))
    dtype = np.dtype(found[4].lower()).newbyteorder("<")
    expected = nx * ny * nz * dtype.itemsize
    if file.stat().st_size != expected:
        raise InvalidVolumeError(
            f"{file} has {file.stat().st_size} bytes; {nx} x {ny} x {nz} of {found[4].lower()} "
            f"are {expected}"
        )
    require_free_memory(expected, f"the volume in {file.name}", "take a smaller one")
    array: NDArray[Any] = np.fromfile(file, dtype).reshape(nz, ny, nx)
    return Volume(array.astype(dtype.newbyteorder("="), copy=False))


def _read_npy(file: Path) -> Volume:
    try:
        # In place: what a header declares is held against the file's size, and objects are refused
        array = np.lib.format.open_memmap(file, mode="r")
    except OSError as error:
        raise InvalidVolumeError(f"{file} cannot be read: {error.strerror or error}") from error
    except _BAD_ARRAY as error:
        raise InvalidVolumeError(
            f"{file} cannot be read as an array ({error}): write one by numpy.save"
        ) from error
    return Volume(array)


def _procedural(name: str, kind: Procedural, factor: int, seed: int) -> Dataset:
    nbytes = kind.nbytes(factor)
    size = " x ".join(str(n) for n in kind.reduced(factor))

    def load(progress: Progress | None) -> Volume:
        smaller = f"{name.partition('@')[0]}@{2 * factor}"
        require_free_memory(
            nbytes + _WORKING_BYTES,
            f"making the volume {name!r}, {size} of {kind.dtype},",
            f"take {smaller!r}, half as large along each edge, or another machine",
        )
        return make(kind, factor, seed, name, progress)

    return Dataset(
        name,
        "procedural",
        kind.paper,
        f"{kind.description} (made from seed {seed})",
        _LOOKS[kind.paper],
        nbytes,
        load,
    )


def _factor(name: str, text: str) -> int:
    if not text:
        return 1 if "@" not in name else _refuse_factor(name)
    return int(text) if text.isdecimal() and 1 <= int(text) <= 128 else _refuse_factor(name)


def _refuse_factor(name: str) -> int:
    raise InvalidArgumentError(
        f"{name!r} does not say how much smaller: write a whole number from 1 to 128 behind the @, "
        "as in kingsnake_like@4"
    )


def _resampled(nodes: tuple[float, ...]) -> NDArray[np.float64]:
    at = np.linspace(0, len(nodes) - 1, _ENTRIES)
    return np.interp(at, np.arange(len(nodes)), nodes)


def require_allocation(runtime: Any, dataset: Dataset) -> None:
    """Let the engine refuse a volume that no buffer of the device can hold, before it is made.

    Raises
    ------
    DeviceMemoryError
        The engine's own.
    """
    if dataset.nbytes is not None:
        with runtime.buffer((dataset.nbytes,), np.uint8, f"volume {dataset.name!r}"):
            pass
