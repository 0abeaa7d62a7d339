"""FITS cubes with world coordinates, by astropy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

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
                    data = again[number].data
                return data.astype(data.dtype.newbyteorder("="))

            extra = len(hdu.shape) - 3
            axes = "".join(_letter(header, i + 1) for i in range(3, len(hdu.shape)))[::-1] + "zyx"
            units = {str(header.get(f"CUNIT{i}", "")).strip() for i in (1, 2, 3)}
            unit = (
                units.pop()
                if len(units) == 1
                else ", ".join(str(header.get(f"CUNIT{i}", "")).strip() or "1" for i in (1, 2, 3))
            )
            name = hdu.name or f"HDU {number}"
            array = Lazy(hdu.shape, stored, read)
            found.append(VolumeInFile(array, axes, _to_world(header, extra), name, unit))
    return found


def _letter(header: Any, axis: int) -> str:
    return "t" if str(header.get(f"CTYPE{axis}", "")).upper().startswith("TIME") else "c"


def _to_world(header: Any, extra: int) -> Any:
    """Return the linear part of the world coordinates, in the file's units."""
    from astropy.wcs import WCS

    wcs = WCS(header, naxis=3)
    place = np.eye(4)
    # WCS gives SI units: keep what the header says
    step = [float(header.get(f"CDELT{i}", 1.0) or 1.0) for i in (1, 2, 3)]
    if wcs.wcs.has_cd():
        matrix = [[header.get(f"CD{i}_{j}", 0.0) for j in (1, 2, 3)] for i in (1, 2, 3)]
        place[:3, :3] = matrix
    else:
        turn = [[header.get(f"PC{i}_{j}", float(i == j)) for j in (1, 2, 3)] for i in (1, 2, 3)]
        place[:3, :3] = np.diag(step) @ np.array(turn)
    first = np.array([1.0 - float(header.get(f"CRPIX{i}", 1.0)) for i in (1, 2, 3)])
    value = np.array([float(header.get(f"CRVAL{i}", 0.0)) for i in (1, 2, 3)])
    place[:3, 3] = value + place[:3, :3] @ first
    return place
