"""The volumes that are measured: shipped, in a folder, procedural, or files that the user names."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import examples
from pyvista_vdi.device import aligned_empty
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io.volumes import read_volume
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

#: Voxels along an edge of the largest periodic block of noise.
_NOISE_EDGE = 256

#: Exponent of the noise's amplitude by wave number: half of Kolmogorov's -5/3 and of the two
#: dimensions that the shells of wave numbers grow by.
_TURBULENT = -11.0 / 6.0

Plane = NDArray[np.float32]
#: Scalars of slab k as float32 (ny, nx), in units of the type's values.
Slab = Callable[[int], Plane]


@dataclass(frozen=True)
class Procedural:
    """How one volume is made.

    ``paper`` is the data set of the paper's that it stands in for, ``dimensions`` are points along
    x, y, z at full size; ``prepare(dimensions, rng)`` returns what makes a slab.
    """

    paper: str
    dimensions: tuple[int, int, int]
    dtype: str
    description: str
    prepare: Callable[[tuple[int, int, int], np.random.Generator], Slab]

    def reduced(self, factor: int) -> tuple[int, int, int]:
        """Return the dimensions at 1 / ``factor`` of the full size along each edge."""
        nx, ny, nz = (max(2, -(-n // factor)) for n in self.dimensions)
        return nx, ny, nz

    def nbytes(self, factor: int = 1) -> int:
        """Return the bytes of the volume."""
        nx, ny, nz = self.reduced(factor)
        return nx * ny * nz * np.dtype(self.dtype).itemsize


def make(kind: Procedural, factor: int, seed: int, name: str) -> Volume:
    """Make a volume at 1 / ``factor`` of the full size; equal seeds give equal volumes."""
    dimensions = kind.reduced(factor)
    nx, ny, nz = dimensions
    slab = kind.prepare(dimensions, np.random.default_rng(seed))
    array: NDArray[Any] = aligned_empty((nz, ny, nx), np.dtype(kind.dtype))
    largest = float(np.iinfo(kind.dtype).max)

    def fill(k: int) -> None:
        array[k] = np.clip(slab(k) + np.float32(0.5), 0, largest)

    # A few slabs at a time, so that an interrupt ends it soon
    workers = os.cpu_count() or 1
    with ThreadPoolExecutor(workers) as pool:
        for first in range(0, nz, 8 * workers):
            list(pool.map(fill, range(first, min(first + 8 * workers, nz))))
    return Volume(array, name=name)


def _coordinates(dimensions: tuple[int, int, int]) -> tuple[Plane, Plane, Plane]:
    """Return x, y, z of the points: -1 to 1 along x, the same scale along the others."""
    nx = dimensions[0]
    x, y, z = (
        ((np.arange(n) - (n - 1) / 2) / ((nx - 1) / 2)).astype(np.float32) for n in dimensions
    )
    return x, y, z


def _noise(rng: np.random.Generator, shape: tuple[int, ...], exponent: float) -> Plane:
    """Return periodic noise of mean 0 and deviation 1 whose amplitude follows a power law."""
    # float64: transforms of float32 differ between versions of NumPy
    spectrum = np.fft.rfftn(rng.standard_normal(shape))
    axes = [np.fft.fftfreq(n, 1 / n) for n in shape[:-1]]
    axes.append(np.fft.rfftfreq(shape[-1], 1 / shape[-1]))
    squared = sum(np.square(k) for k in np.meshgrid(*axes, indexing="ij", sparse=True))
    squared[(0,) * len(shape)] = np.inf  # no mean
    field = np.fft.irfftn(spectrum * squared ** (exponent / 2), s=shape, axes=range(len(shape)))
    return (field / field.std()).astype(np.float32)


class _NoiseBlock:
    """Periodic three-dimensional noise, read plane by plane.

    Where it is `bent`, the planes are bent along z, so that the periods along x and y are not
    seen; noise without structure needs none of it, and is read faster.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        dimensions: tuple[int, int, int],
        exponent: float,
        *,
        bent: bool,
    ) -> None:
        nx, ny, _ = dimensions
        edge = min(_NOISE_EDGE, max(16, nx // 4))
        self._edge = edge
        self._block = _noise(rng, (edge, edge, edge), exponent).ravel()
        rows, columns = np.arange(ny) % edge, np.arange(nx) % edge
        self._in_plane = (rows[:, None] * edge + columns).astype(np.int32)
        self._bend: NDArray[np.int32] | None = None
        if bent:
            self._bend = np.rint(edge * _noise(rng, (ny, nx), -2.0)).astype(np.int32)

    def plane(self, k: int) -> Plane:
        """Return plane k, (ny, nx): mean 0, deviation 1."""
        if self._bend is None:
            begin = k % self._edge * self._edge**2
            return self._block[begin : begin + self._edge**2][self._in_plane]
        planes = (self._bend + np.int32(k)) % np.int32(self._edge)
        return self._block[planes * np.int32(self._edge**2) + self._in_plane]


def _kingsnake(dimensions: tuple[int, int, int], rng: np.random.Generator) -> Slab:
    """A coiled body with a spine in an empty egg; lengths are shares of half the width."""
    pitch, body, spine, egg, widest = 0.20, 0.095, 0.024, 0.74, 0.88
    vertebrae = 60.0  # to a turn
    x, y, z = _coordinates(dimensions)
    radius = np.hypot(x, y[:, None])
    turns = np.arctan2(y[:, None], x) / np.float32(2 * np.pi)
    noise = _NoiseBlock(rng, dimensions, -1.0, bent=False)

    def slab(k: int) -> Plane:
        # The turn of the coil that is nearest in height, and its centre there
        turn = np.rint(z[k] / pitch - turns)
        along = turn + turns
        height = pitch * along
        reach = np.maximum(1 - np.square(height / egg), 0)
        across = radius - widest * np.sqrt(reach)
        up = z[k] - height
        # How deep inside the skin, and inside the spine, in their radii
        tissue = np.clip(14 * (1 - np.hypot(across, up) / body), 0, 1) * (reach > 0)
        width = spine * (1 + 0.35 * np.sin(2 * np.pi * vertebrae * along))
        bone = np.clip(3 * (1 - np.hypot(across + 0.4 * body, up) / width), 0, 1) * (reach > 0)
        return np.asarray(tissue * (70 + 12 * noise.plane(k)) + 150 * bone, dtype=np.float32)

    return slab


def _beechnut(dimensions: tuple[int, int, int], rng: np.random.Generator) -> Slab:
    """A three-sided nut, shell and folded kernel, in the noise of a scanner."""
    x, y, z = _coordinates(dimensions)
    tall = float(z[-1]) * 0.96
    radius = np.hypot(x, y[:, None])
    outline = 0.8 * (1 + 0.12 * np.cos(3 * np.arctan2(y[:, None], x)))
    relative = (radius / outline).astype(np.float32)
    noise = _NoiseBlock(rng, dimensions, _TURBULENT, bent=True)
    grain = _NoiseBlock(rng, dimensions, 0.0, bent=False)

    def slab(k: int) -> Plane:
        profile = max(1 - (float(z[k]) / tall) ** 2, 1e-6) ** 0.5
        inside = relative / np.float32(profile)  # 1 at the outside of the shell
        shell = np.clip(40 * (1 - inside), 0, 1) * np.clip(40 * (inside - 0.9), 0, 1)
        folds = inside + 0.12 * noise.plane(k)
        kernel = np.clip(25 * (0.78 - folds), 0, 1) * (0.75 + 0.25 * np.sin(26 * folds))
        scalars = 4000 + 40000 * shell + 26000 * kernel + 1200 * grain.plane(k)
        return np.asarray(scalars, dtype=np.float32)

    return slab


def _richtmyer_meshkov(dimensions: tuple[int, int, int], rng: np.random.Generator) -> Slab:
    """Two fluids and the turbulent layer between them."""
    nx, ny, nz = dimensions
    _, _, z = _coordinates(dimensions)
    surface = 0.16 * _noise(rng, (ny, nx), -2.0)
    noise = _NoiseBlock(rng, dimensions, _TURBULENT, bent=True)
    half_layer = 0.5 * nz / nx

    def slab(k: int) -> Plane:
        from_middle = (z[k] - surface) / np.float32(half_layer)
        mixing = np.maximum(1 - np.square(from_middle), 0)
        return 127.5 + 160 * from_middle + 75 * mixing * noise.plane(k)

    return slab


#: The stand-ins by the names that ``--datasets`` takes.
PROCEDURAL: dict[str, Procedural] = {
    "kingsnake_like": Procedural(
        "kingsnake", (1024, 1024, 795), "uint8", "a coiled body in empty space", _kingsnake
    ),
    "beechnut_like": Procedural(
        "beechnut", (1024, 1024, 1546), "uint16", "a nut with a folded kernel", _beechnut
    ),
    "richtmyer_meshkov_like": Procedural(
        "richtmyer_meshkov",
        (2048, 2048, 1920),
        "uint8",
        "two fluids and the turbulent layer between them",
        _richtmyer_meshkov,
    ),
}


#: Seed of the procedural volumes where none is given.
DEFAULT_SEED = 1

#: Noise and planes while a procedural volume is made, bytes: at most.
_WORKING_BYTES = 2**30

#: Entries of the transfer functions, as ``add_volume`` has them by default.
_ENTRIES = 256

#: Opacity at equidistant scalars, by look.
_OPACITIES: Mapping[str, tuple[float, ...]] = {
    # What add_volume's opacity="linear" is
    "ramp": (0.0, 1.0),
    # Air and its noise are transparent; tissue is translucent, bone is not
    "empty below a fifth": (0.0, 0.0, 0.02, 0.05, 0.3, 0.8),
    # One fluid is transparent, the other translucent
    "one of two fluids": (0.0, 0.0, 0.0, 0.01, 0.05, 0.15, 0.05, 0.01, 0.005),
}

#: RGB at equidistant scalars: black, blue-grey, white.
_COLORS = ((0.0, 0.0, 0.0), (0.25, 0.3, 0.45), (0.7, 0.7, 0.6), (1.0, 1.0, 1.0))

#: Looks of the paper's data sets.
_LOOKS = {
    "kingsnake": "empty below a fifth",
    "beechnut": "empty below a fifth",
    "richtmyer_meshkov": "one of two fluids",
}


def look(name: str, scalar_range: tuple[float, float], interpolation: str) -> TransferFunction:
    """Return a transfer function by its name: a key of the opacities above."""

    def resampled(nodes: tuple[float, ...]) -> NDArray[np.float64]:
        at = np.linspace(0, len(nodes) - 1, _ENTRIES)
        return np.interp(at, np.arange(len(nodes)), nodes)

    colors = np.stack([resampled(channel) for channel in zip(*_COLORS, strict=True)], axis=1)
    opacities = resampled(_OPACITIES[name])
    return TransferFunction(colors, opacities, scalar_range, interpolation=interpolation)


@dataclass(frozen=True)
class Dataset:
    """A volume to be measured, and how it looks.

    ``source`` is "example", "procedural" or "file"; ``paper`` the paper's data set that it is, or
    stands in for; ``look`` the name of its transfer function; ``nbytes`` is ``None`` where it is
    not known before the volume is there, which ``load`` returns.
    """

    name: str
    source: str
    paper: str | None
    description: str
    look: str
    nbytes: int | None
    load: Callable[[], Volume]

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


def find_dataset(name: str, seed: int = DEFAULT_SEED) -> Dataset:
    """Return a data set by its name; what nothing is called raises InvalidArgumentError.

    They are names of :data:`pyvista_vdi.examples.VOLUMES`; ``kingsnake_like``, ``beechnut_like`` or
    ``richtmyer_meshkov_like``, made from a seed at the paper's size or with ``@4`` at a quarter of
    it along each edge; or a file, as ``FILE`` or as ``NAME=FILE``, where a NAME of ``kingsnake``,
    ``beechnut`` or ``richtmyer_meshkov`` says which of the paper's it is.
    """
    base, at, text = name.partition("@")
    if base in PROCEDURAL:
        if at and not (text.isdecimal() and 1 <= int(text) <= 128):
            raise InvalidArgumentError(
                f"{name!r} does not say how much smaller: write a whole number from 1 to 128 "
                "behind the @, as in kingsnake_like@4"
            )
        kind, factor = PROCEDURAL[base], int(text or 1)
        nbytes = kind.nbytes(factor)

        def create() -> Volume:
            size = " x ".join(str(n) for n in kind.reduced(factor))
            require_free_memory(
                nbytes + _WORKING_BYTES,
                f"making the volume {name!r}, {size} of {kind.dtype},",
                f"take '{base}@{2 * factor}', half as large along each edge, or another machine",
            )
            return make(kind, factor, seed, name)

        made, looks = f"{kind.description} (made from seed {seed})", _LOOKS[kind.paper]
        return Dataset(name, "procedural", kind.paper, made, looks, nbytes, create)
    if name in examples.VOLUMES:
        described = examples.VOLUMES[name].description
        load = partial(examples.load_data, name, as_volume=True)
        return Dataset(name, "example", None, described, "ramp", None, load)
    label, file = _named_file(name)
    if not name or not os.path.exists(file):  # noqa: PTH110 - pathlib's raises for a name that is too long
        known = ", ".join([*sorted(examples.VOLUMES), *PROCEDURAL])
        raise InvalidArgumentError(
            f"no volume is called {name!r}, and there is no such file: choose one of {known}, or "
            "name a file"
        )
    paper = label if label in _LOOKS else None
    looks = _LOOKS.get(label, "ramp")
    return Dataset(
        *(label, "file", paper, file.name, looks, None),
        lambda: read_volume(file),
    )


def label_of(name: str) -> str:
    """Return what the results call a data set: its name, without the folder of a file."""
    if name.partition("@")[0] in PROCEDURAL or name in examples.VOLUMES:
        return name
    return _named_file(name)[0]


def _named_file(name: str) -> tuple[str, Path]:
    """Return label and file of ``FILE`` or ``NAME=FILE``; a file's own name may have a = in it."""
    label, equals, path = name.partition("=")
    if not equals or os.path.exists(name):  # noqa: PTH110 - as above
        label, path = "", name
    return label or Path(path).name.split(".")[0], Path(path)
