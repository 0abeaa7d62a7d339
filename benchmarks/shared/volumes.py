"""Volumes like the paper's, made from a seed: at its sizes, or ``@4`` at a quarter of each edge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import InvalidArgumentError, Volume
from pyvista_vdi.model.host_memory import require_host_memory

#: Exponent of the noise's amplitude by wave number: half of Kolmogorov's -5/3 and of the two
#: dimensions that the shells of wave numbers grow by.
TURBULENT = -11.0 / 6.0

Array = NDArray[Any]
Slab = Callable[[int], Array]


def _noise(rng: np.random.Generator, shape: tuple[int, ...], exponent: float) -> Array:
    """Return periodic noise of mean 0 and deviation 1 whose amplitude follows a power law."""
    # float64: transforms of float32 differ between versions of NumPy
    spectrum = np.fft.rfftn(rng.standard_normal(shape))
    axes = [np.fft.fftfreq(n, 1 / n) for n in shape[:-1]]
    axes.append(np.fft.rfftfreq(shape[-1], 1 / shape[-1]))
    squared = sum(np.square(k) for k in np.meshgrid(*axes, indexing="ij", sparse=True))
    squared[(0,) * len(shape)] = np.inf  # no mean
    field = np.fft.irfftn(spectrum * squared ** (exponent / 2), s=shape, axes=range(len(shape)))
    return np.asarray(field / field.std(), dtype=np.float32)


def _planes(
    rng: np.random.Generator, x: Array, y: Array, exponent: float, *, bent: bool = True
) -> Slab:
    """Return planes of periodic noise, bent along z where the periods would be seen."""
    edge = min(256, max(16, len(x) // 4))  # of the block that is repeated
    block = _noise(rng, (edge, edge, edge), exponent).ravel()
    in_plane = (np.arange(len(y)) % edge)[:, None] * edge + np.arange(len(x)) % edge
    bend = np.rint(edge * _noise(rng, (len(y), len(x)), -2.0)).astype(np.int32) if bent else 0
    return lambda k: block[(bend + k) % edge * edge**2 + in_plane]


def kingsnake(x: Array, y: Array, z: Array, rng: np.random.Generator) -> Slab:
    """A coiled body with a spine in an empty egg; lengths are shares of half the width."""
    pitch, body, spine, egg, widest = 0.20, 0.095, 0.024, 0.74, 0.88
    radius = np.hypot(x, y[:, None])
    turns = np.arctan2(y[:, None], x) / np.float32(2 * np.pi)
    noise = _planes(rng, x, y, -1.0, bent=False)

    def slab(k: int) -> Array:
        # The turn of the coil that is nearest in height, and its centre there
        along = np.rint(z[k] / pitch - turns) + turns
        height = pitch * along
        reach = np.maximum(1 - np.square(height / egg), 0)
        across, up = radius - widest * np.sqrt(reach), z[k] - height
        # How deep inside the skin, and inside the spine, in their radii
        tissue = np.clip(14 * (1 - np.hypot(across, up) / body), 0, 1) * (reach > 0)
        width = spine * (1 + 0.35 * np.sin(2 * np.pi * 60 * along))  # 60 vertebrae to a turn
        bone = np.clip(3 * (1 - np.hypot(across + 0.4 * body, up) / width), 0, 1) * (reach > 0)
        return tissue * (70 + 12 * noise(k)) + 150 * bone

    return slab


def beechnut(x: Array, y: Array, z: Array, rng: np.random.Generator) -> Slab:
    """A three-sided nut, shell and folded kernel, in the noise of a scanner."""
    outline = 0.8 * (1 + 0.12 * np.cos(3 * np.arctan2(y[:, None], x)))
    relative = np.hypot(x, y[:, None]) / outline
    noise, grain = _planes(rng, x, y, TURBULENT), _planes(rng, x, y, 0.0, bent=False)

    def slab(k: int) -> Array:
        profile = max(1 - (float(z[k]) / (0.96 * float(z[-1]))) ** 2, 1e-6) ** 0.5
        inside = relative / np.float32(profile)  # 1 at the outside of the shell
        shell = np.clip(40 * (1 - inside), 0, 1) * np.clip(40 * (inside - 0.9), 0, 1)
        folds = inside + 0.12 * noise(k)
        kernel = np.clip(25 * (0.78 - folds), 0, 1) * (0.75 + 0.25 * np.sin(26 * folds))
        return 4000 + 40000 * shell + 26000 * kernel + 1200 * grain(k)

    return slab


def richtmyer_meshkov(x: Array, y: Array, z: Array, rng: np.random.Generator) -> Slab:
    """Two fluids and the turbulent layer between them."""
    surface = 0.16 * _noise(rng, (len(y), len(x)), -2.0)
    noise = _planes(rng, x, y, TURBULENT)

    def slab(k: int) -> Array:
        from_middle = (z[k] - surface) / np.float32(0.5 * len(z) / len(x))
        mixing = np.maximum(1 - np.square(from_middle), 0)
        return 127.5 + 160 * from_middle + 75 * mixing * noise(k)

    return slab


#: Points along x, y, z at full size, type, and what makes a slab.
KINDS: dict[str, tuple[tuple[int, int, int], str, Callable[..., Slab]]] = {
    "kingsnake_like": ((1024, 1024, 795), "uint8", kingsnake),
    "beechnut_like": ((1024, 1024, 1546), "uint16", beechnut),
    "richtmyer_meshkov_like": ((2048, 2048, 1920), "uint8", richtmyer_meshkov),
}


def make(name: str, seed: int = 1) -> Volume:
    """Return one of :data:`KINDS`, or ``NAME@N``: 1 / N of its points along each edge."""
    kind, _, factor = name.partition("@")
    if kind not in KINDS or not (factor or "1").isdecimal():
        raise InvalidArgumentError(f"no volume is called {name!r}: made are {', '.join(KINDS)}")
    full, dtype, prepare = KINDS[kind]
    nx, ny, nz = (max(2, -(-n // int(factor or 1))) for n in full)
    largest = np.iinfo(dtype).max
    nbytes = nx * ny * nz * np.dtype(dtype).itemsize
    require_host_memory(nbytes + 2**30, f"making {name!r}", f"make {kind}@4", free=True)
    # -1 to 1 along x, the same scale along the others
    axes = [np.float32((np.arange(n) - (n - 1) / 2) / ((nx - 1) / 2)) for n in (nx, ny, nz)]
    slab, array = prepare(*axes, np.random.default_rng(seed)), np.empty((nz, ny, nx), dtype)
    for k in range(nz):
        array[k] = np.clip(slab(k) + np.float32(0.5), 0, largest)
    return Volume(array, name=name)
