"""The shipped volumes, and those in the folder that ``PYVISTA_VDI_DATA`` names.

Three volumes are part of the package: a brain (MRI), a phantom with pins of known density (CT) and
a turbulent mixing layer (simulation).
Their source and terms stand in ``pyvista_vdi/data/README.md``. The others listed by
:data:`VOLUMES` are well-known test data whose terms do not allow shipping them; they are read
from the folder that the environment variable ``PYVISTA_VDI_DATA`` names, where it has them.
"""

from __future__ import annotations

import os
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

#: The shipped volumes by name, each with its file and what a sample measures. The brain has
#: 181 x 217 x 181 points, 1 mm apart, x to the right, y to the front, z up; the mixing layer
#: 192 x 192 x 192; the phantom, a cylinder of plastic with pins of known density, 412 x 412 x 19,
#: 0.488 x 0.488 x 2.5 mm apart, in Hounsfield units from -1000 (air) to 1810, its axis along z: no
#: patient's scan may be copied.
SHIPPED = {
    "brain": ("brain_colin27_181x217x181_u8.nrrd", "intensity"),
    "ct": ("catphan_ct_412x412x19_i16.nrrd", "hounsfield"),
    "rayleigh_taylor": ("rayleigh_taylor_dns_192x192x192_u8.nrrd", "concentration"),
}
#: Those that are read from that folder.
VOLUMES = {
    **SHIPPED,
    "allen_mouse_brain": ("allen_mouse_brain_20um_660x400x570_u8.nrrd", "intensity"),
    "aneurism": ("aneurism_256_u8.nrrd", "intensity"),
    "berea": ("berea_sandstone_400_u8_binary.nrrd", "phase"),
    "bonsai": ("bonsai_256_u8.nrrd", "intensity"),
    "brain_half_mm": ("brain_colin27_301x370x316_u8.nrrd", "intensity"),
    "catphan": ("catphan_cbct_512x512x64_i16.nrrd", "hounsfield"),
    "embryo": ("embryo_256_u8.nrrd", "intensity"),
    "heptane": ("heptane_302_u8.nrrd", "intensity"),
    "hydrogen_atom": ("hydrogen_atom_128_u8.nrrd", "density"),
    "iguana_head": ("iguana_head_210x256x179_u8.nrrd", "intensity"),
    "isabel_wind": ("isabel_wind_125x125x25_f64.nrrd", "wind_speed"),
    "t1w_head": ("t1w_head_274x384x384_i16.nrrd", "intensity"),
    "tooth": ("tooth_103x94x161_u16.nrrd", "intensity"),
    "visible_female_head": ("visible_female_head_512x512x234_u8.nrrd", "intensity"),
}


def available() -> tuple[str, ...]:
    """Return the names that :func:`load_data` can load here and now.

    Returns
    -------
    tuple of str
        Names from :data:`VOLUMES` whose file exists, sorted.
    """
    return tuple(name for name in sorted(VOLUMES) if _file(name).is_file())


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
    if not isinstance(name, str) or name not in VOLUMES:
        raise InvalidArgumentError(
            f"no example volume is called {name!r}: choose one of {', '.join(sorted(VOLUMES))}"
        )
    file = _file(name)
    if not file.is_file():
        remedy = (
            "install pyvista-vdi again"
            if name in SHIPPED
            else f"put it into a folder, and set {DATA_VARIABLE} to that; now that names "
            f"{os.environ.get(DATA_VARIABLE)!r}"
        )
        raise DataNotFoundError(f"{file.name}, the volume {name!r}, is not here: {remedy}")
    return file


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
        named by what a sample measures.

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
    volume.name = VOLUMES[name][1]
    if as_volume:
        return volume
    from pyvista_vdi.plotting.volumes import to_image_data

    return to_image_data(volume, volume.name)


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


def _file(name: str) -> Path:
    """Return where a volume's file should be."""
    if name in SHIPPED:
        return Path(str(resources.files("pyvista_vdi.data") / SHIPPED[name][0]))
    return Path(os.environ.get(DATA_VARIABLE) or "/nonexistent", VOLUMES[name][0])
