"""FITS cubes with world coordinates, by astropy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.axes import one_unit, to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the images of three axes; places are linear, as pictures of cubes have them."""
    from astropy.io import fits

    found = []
    with fits.open(file, memmap=False, lazy_load_hdus=False) as hdus:
        for number, hdu in enumerate(hdus):
            if not (hdu.is_image and len(hdu.shape) > 2):
                continue
            header = hdu.header
            scaled = header.get("BSCALE", 1) != 1 or header.get("BZERO", 0) != 0
            stored = np.dtype(fits.hdu.image.BITPIX2DTYPE[header["BITPIX"]])
            whole = header.get("BSCALE", 1) == 1 and header.get("BZERO", 0) in (32768, 2**31, -128)
            if whole:
                stored = np.dtype({1: "i1", 2: "u2", 4: "u4"}[stored.itemsize])
            elif scaled and stored.kind == "i":
                stored = np.dtype("f8" if stored.itemsize > 2 else "f4")

            def read(number: int = number) -> Any:
                with fits.open(file, memmap=False) as again:
                    hdu = again[number]
                    if 0 in (hdu.verify_checksum(), hdu.verify_datasum()):
                        raise InvalidVolumeError("its CHECKSUM is another: a byte was changed")
                    data = hdu.data
                return data.astype(data.dtype.newbyteorder("="))

            axes = "".join(_letter(header, i + 1) for i in range(3, len(hdu.shape)))[::-1] + "zyx"
            unit = one_unit([str(header.get(f"CUNIT{i}", "")).strip() for i in (1, 2, 3)])
            name = hdu.name or f"HDU {number}"
            array = Lazy(hdu.shape, stored, read)
            found.append(VolumeInFile(array, axes, _to_world(header), name, unit))
    return found


def _letter(header: Any, axis: int) -> str:
    return "t" if str(header.get(f"CTYPE{axis}", "")).upper().startswith("TIME") else "c"


def _to_world(header: Any) -> Any:
    """Return the linear part of the world coordinates, in the file's units."""
    from astropy.wcs import WCS

    # WCS gives SI units: keep what the header says
    def numbers(name: str, default: float) -> Any:
        return np.array([float(header.get(f"{name}{i}", default)) for i in (1, 2, 3)])

    cd = WCS(header, naxis=3).wcs.has_cd()
    name, pairs = "CD" if cd else "PC", [[(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)]
    steps = np.array(
        [[header.get(f"{name}{i}_{j}", 0.0 if cd else float(i == j)) for i, j in p] for p in pairs]
    )
    if not cd:
        delta = numbers("CDELT", 1.0)
        steps = np.where(delta == 0, 1.0, delta)[:, None] * steps
    return to_world(steps, numbers("CRVAL", 0.0) + steps @ (1 - numbers("CRPIX", 1.0)))
