"""The shipped volumes, and those in the folder that ``PYVISTA_VDI_DATA`` names.

Three volumes are part of the package: a brain (MRI), a phantom with pins of known density (CT) and
a turbulent mixing layer (simulation).
Their source and terms stand in ``pyvista_vdi/data/README.md``. The others listed by
:data:`VOLUMES` are well-known test data whose terms do not allow shipping them; they are read
from the folder that the environment variable ``PYVISTA_VDI_DATA`` names, where it has them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from pyvista_vdi.errors import DataNotFoundError, InvalidArgumentError, MissingDependencyError
from pyvista_vdi.io.volumes import read_volume

if TYPE_CHECKING:
    import pyvista as pv

    from pyvista_vdi.model.volume import Volume

#: Environment variable that names the folder with the volumes that are not shipped.
DATA_VARIABLE = "PYVISTA_VDI_DATA"


@dataclass(frozen=True)
class ExampleVolume:
    """A known volume: where it is and what it shows.

    Parameters
    ----------
    file_name : str
        Name of its NRRD file.
    quantity : str
        What a sample measures: the name of the point array.
    description : str
        One phrase: method and subject.
    shipped : bool
        Whether it is part of the package.
    part_of : str
        Name of the volume that it is cut out of; empty if it is whole.
    """

    file_name: str
    quantity: str
    description: str
    shipped: bool = False
    part_of: str = ""


#: Every volume known by name. Of the shipped ones, the brain has 181 x 217 x 181 points, 1 mm
#: apart, x to the right, y to the front, z up; the mixing layer 192 x 192 x 192; the phantom, a
#: cylinder of plastic with pins of known density, 412 x 412 x 19, 0.488 x 0.488 x 2.5 mm apart, in
#: Hounsfield units from -1000 (air) to 1810, its axis along z: no patient's scan may be copied.
VOLUMES: dict[str, ExampleVolume] = {
    "allen_mouse_brain": ExampleVolume(
        "allen_mouse_brain_20um_660x400x570_u8.nrrd",
        "intensity",
        "serial two-photon tomography of mouse brains, average template, 20 um",
    ),
    "aneurism": ExampleVolume(
        "aneurism_256_u8.nrrd", "intensity", "CT angiography of the arteries of a head"
    ),
    "berea": ExampleVolume(
        "berea_sandstone_400_u8_binary.nrrd", "phase", "micro-CT of Berea sandstone, segmented"
    ),
    "bonsai": ExampleVolume("bonsai_256_u8.nrrd", "intensity", "CT of a bonsai tree"),
    "brain": ExampleVolume(
        "brain_colin27_181x217x181_u8.nrrd",
        "intensity",
        "MRI of a brain, mean of 27 scans of one person, 1 mm",
        shipped=True,
    ),
    "brain_half_mm": ExampleVolume(
        "brain_colin27_301x370x316_u8.nrrd",
        "intensity",
        "MRI of a brain, mean of 27 scans of one person, 0.5 mm",
    ),
    "catphan": ExampleVolume(
        "catphan_cbct_512x512x64_i16.nrrd",
        "hounsfield",
        "cone-beam CT of a CatPhan phantom, anisotropic",
    ),
    "ct": ExampleVolume(
        "catphan_ct_412x412x19_i16.nrrd",
        "hounsfield",
        "cone-beam CT of a CatPhan phantom, its slices with pins and line pairs",
        shipped=True,
        part_of="catphan",
    ),
    "embryo": ExampleVolume("embryo_256_u8.nrrd", "intensity", "scan of an embryo"),
    "heptane": ExampleVolume(
        "heptane_302_u8.nrrd", "intensity", "simulation of a burning jet of heptane"
    ),
    "hydrogen_atom": ExampleVolume(
        "hydrogen_atom_128_u8.nrrd", "density", "electron density of a hydrogen atom"
    ),
    "iguana_head": ExampleVolume(
        "iguana_head_210x256x179_u8.nrrd", "intensity", "X-ray CT of an iguana's head"
    ),
    "isabel_wind": ExampleVolume(
        "isabel_wind_125x125x25_f64.nrrd",
        "wind_speed",
        "simulation of hurricane Isabel, wind speed, float64",
    ),
    "rayleigh_taylor": ExampleVolume(
        "rayleigh_taylor_dns_192x192x192_u8.nrrd",
        "concentration",
        "direct numerical simulation of a Rayleigh-Taylor mixing layer",
        shipped=True,
    ),
    "t1w_head": ExampleVolume(
        "t1w_head_274x384x384_i16.nrrd", "intensity", "T1-weighted MRI of a head, defaced"
    ),
    "tooth": ExampleVolume("tooth_103x94x161_u16.nrrd", "intensity", "CT of a tooth, uint16"),
    "visible_female_head": ExampleVolume(
        "visible_female_head_512x512x234_u8.nrrd", "intensity", "CT of a head and shoulders"
    ),
}

#: Names of those that are not cut out of another: what tables of all volumes have.
WHOLE: tuple[str, ...] = tuple(name for name in sorted(VOLUMES) if not VOLUMES[name].part_of)


def available() -> tuple[str, ...]:
    """Return the names that :func:`load_data` can load here and now.

    Returns
    -------
    tuple of str
        Names from :data:`VOLUMES` whose file exists, sorted.
    """
    return tuple(name for name in sorted(VOLUMES) if _locate(VOLUMES[name]) is not None)


def path(name: str) -> Path:
    """Return where a volume's file is.

    Parameters
    ----------
    name : str
        A name from :data:`VOLUMES`.

    Returns
    -------
    pathlib.Path
        An existing NRRD file.

    Raises
    ------
    InvalidArgumentError
        If no volume has that name.
    DataNotFoundError
        If its file is not there; the message names the file and the variable.
    """
    try:
        example = VOLUMES[name]
    except (KeyError, TypeError):
        absent = ", ".join(sorted(set(VOLUMES) - set(available())))
        others = f"; the files of {absent} are not here, see {DATA_VARIABLE}" if absent else ""
        raise InvalidArgumentError(
            f"no example volume is called {name!r}: choose one of {', '.join(available())}{others}"
        ) from None
    file = _locate(example)
    if file is not None:
        return file
    if example.shipped:
        raise DataNotFoundError(
            f"pyvista_vdi/data/{example.file_name} is missing from the installed package: "
            "install pyvista-vdi again"
        )
    raise DataNotFoundError(
        f"the volume {name!r} is not shipped, and the folder that {DATA_VARIABLE} names, "
        f"{os.environ.get(DATA_VARIABLE)!r}, does not hold it: put {example.file_name} into a "
        "folder, and set the variable to that"
    )


@overload
def load_data(name: str, *, as_volume: Literal[False] = ...) -> pv.ImageData: ...
@overload
def load_data(name: str, *, as_volume: Literal[True]) -> Volume: ...
def load_data(name: str, *, as_volume: bool = False) -> pv.ImageData | Volume:
    """Load a volume by its name.

    Parameters
    ----------
    name : str
        A name from :data:`VOLUMES`; :func:`available` lists those that can be loaded here.
    as_volume : bool, default: False
        Return the engine's :class:`~pyvista_vdi.Volume`, which needs neither VTK nor PyVista.

    Returns
    -------
    pyvista.ImageData or Volume
        The volume in the units and along the axes of its source; the scalars are point data and
        named by :attr:`ExampleVolume.quantity`.

    Raises
    ------
    InvalidArgumentError
        If no volume has that name.
    DataNotFoundError
        If its file is not there.
    InvalidVolumeError
        If the file cannot be read.
    MissingDependencyError
        If PyVista is not installed and `as_volume` is false.

    Examples
    --------
    >>> from pyvista_vdi import examples
    >>> examples.load_data("brain", as_volume=True).dimensions
    (181, 217, 181)
    """
    file = path(name)
    if not as_volume and find_spec("pyvista") is None:
        raise MissingDependencyError(
            f"PyVista is not installed, so {name!r} cannot be a pyvista.ImageData: pass "
            'as_volume=True, or install PyVista by pip install "pyvista-vdi[plot]"'
        )
    volume = read_volume(file)
    volume.name = VOLUMES[name].quantity
    if as_volume:
        return volume
    from pyvista_vdi.plotting.volumes import to_image_data

    return to_image_data(volume, VOLUMES[name].quantity)


@overload
def load_brain(*, as_volume: Literal[False] = ...) -> pv.ImageData: ...
@overload
def load_brain(*, as_volume: Literal[True]) -> Volume: ...
def load_brain(*, as_volume: bool = False) -> pv.ImageData | Volume:
    """Load the shipped MRI of a brain (Colin27, skull removed).

    181 x 217 x 181 points, uint8, 1 mm apart; x to the right, y to the front, z up.

    Parameters
    ----------
    as_volume : bool, default: False
        Return the engine's :class:`~pyvista_vdi.Volume`, which needs neither VTK nor PyVista.

    Returns
    -------
    pyvista.ImageData or Volume
        The scan; its scalars are called ``"intensity"``, 0 to 133.

    Examples
    --------
    >>> from pyvista_vdi import examples
    >>> examples.load_brain(as_volume=True).spacing
    (1.0, 1.0, 1.0)
    """
    return load_data("brain", as_volume=as_volume)  # type: ignore[call-overload]


def _locate(example: ExampleVolume) -> Path | None:
    """Return the file, or None where there is none."""
    if example.shipped:
        file = Path(str(resources.files("pyvista_vdi.data") / example.file_name))
    elif folder := os.environ.get(DATA_VARIABLE):
        file = Path(folder) / example.file_name
    else:
        return None
    return file if file.is_file() else None
