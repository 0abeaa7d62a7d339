"""What a file says about its VDI in JSON: written and checked here for every format."""

from __future__ import annotations

import json
from typing import Any, NoReturn

import numpy as np

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.io.vdi_file.layout import FORMAT_NAME, MAX_DESCRIPTION_BYTES
from pyvista_vdi.model.vdi import VDI


def describe(vdi: VDI, version: int) -> dict[str, Any]:
    """Return the entries that all formats share, in their order; ``version`` is the format's."""
    return {
        "format": FORMAT_NAME,
        "version": version,
        "written_by": f"pyvista-vdi {__version__}",
        "window_size": list(vdi.window_size),
        "n_supersegments": vdi.n_supersegments,
        "camera": vdi.camera.to_dict(),
        "bounds": list(vdi.bounds),
        "depth_origin": vdi.depth_origin,
        "metadata": vdi.metadata,
    }


def to_json(description: dict[str, Any]) -> str:
    """Return a description as ASCII text; float64 come back from it to the last bit.

    Raises VDIFileError if the metadata hold what JSON cannot, or are too long.
    """
    try:
        text = json.dumps(description, allow_nan=False, default=plain_number)
    except (TypeError, ValueError, RecursionError) as error:
        raise VDIFileError(
            f"the VDI's metadata cannot be written: {error}; "
            "they may hold finite numbers, text, lists and dictionaries with text as keys"
        ) from error
    if len(text) > MAX_DESCRIPTION_BYTES:
        raise VDIFileError(
            f"the VDI's metadata take {len(text)} bytes as JSON; {MAX_DESCRIPTION_BYTES} are "
            "allowed: keep large arrays beside the VDI"
        )
    return text


def from_json(text: str | bytes) -> Any:
    """Return what the text says; ValueError or RecursionError where it is no JSON."""

    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is not a number of JSON")

    return json.loads(text, parse_constant=no_constant)


def number(value: object) -> float:
    """Return a JSON number as float; text and truth values are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is not a number")
    return float(value)


def plain_number(value: Any) -> Any:
    """Return NumPy's numbers and arrays as Python's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"a value of type {type(value).__name__} is not JSON")
