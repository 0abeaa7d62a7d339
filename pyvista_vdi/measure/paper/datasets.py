"""The volumes that are measured: shipped, in a folder, procedural, or files that the user names."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import examples
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io.volumes import read_volume
from pyvista_vdi.measure.paper.procedural import PROCEDURAL, make
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

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
