"""Values that the CF conventions pack in arrays of HDF5 and zarr, unpacked part by part."""

import base64
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Packing(NamedTuple):
    """How stored numbers become values: ``stored * scale + offset``; ``missing`` ones become NaN.

    ``unsigned``: whether signed numbers are stored in place of unsigned ones.
    """

    scale: float
    offset: float
    missing: tuple[float, ...]
    unsigned: bool
    dtype: np.dtype[Any]

    def __call__(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Return the values of a part that was read."""
        numbers = stored
        if self.unsigned:
            numbers = stored.astype(stored.dtype.newbyteorder("=")).view(f"u{stored.itemsize}")
        values = numbers * np.float64(self.scale) + self.offset
        for number in self.missing:
            values[stored == number] = np.nan
        return values.astype(self.dtype)


def packing_of(array: Any) -> Packing | None:
    """Return how an array's attributes pack its values; None where they are stored as they are."""
    attributes = getattr(array, "attrs", None)
    if not isinstance(attributes, Mapping) or np.dtype(array.dtype).kind not in "iuf":
        return None
    scaled = "scale_factor" in attributes or "add_offset" in attributes
    found = [_number(attributes[n]) for n in ("_FillValue", "missing_value") if n in attributes]
    if scaled and not found and type(array).__module__.partition(".")[0] == "zarr":
        fill = getattr(array, "fill_value", None)  # where xarray keeps it in zarr 2
        found = [_number(fill)] if fill is not None else []
    missing = tuple(n for n in found if np.isfinite(n))
    unsigned = str(attributes.get("_Unsigned", "")).lower() == "true" and array.dtype.kind == "i"
    if not (scaled or missing or unsigned):
        return None
    scale = _number(attributes.get("scale_factor", 1.0))
    offset = _number(attributes.get("add_offset", 0.0))
    narrow = array.dtype.itemsize <= (4 if array.dtype.kind == "f" else 2)
    return Packing(scale, offset, missing, unsigned, np.dtype("f4" if narrow else "f8"))


def _number(said: Any) -> float:
    """Return an attribute's number; of floats in zarr's format 3 xarray writes the bytes."""
    if isinstance(said, str) and said.endswith("="):
        return float(np.frombuffer(base64.b64decode(said), "<f8")[0])
    return float(np.ravel(said)[0])
