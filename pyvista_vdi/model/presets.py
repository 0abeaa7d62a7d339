"""Looks for CT and MRI by name: ``pl.add_vdi(volume, **pvdi.presets["ct-bone"])``.

The control points are this project's own. CT's stand in Hounsfield units, so a scan must be
calibrated, as DICOM files are; MRI has no unit, and its points are shares of the values' range.
"""

import difflib
from typing import Any, NamedTuple

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError

#: Entries of the tables that are made of the control points.
_ENTRIES = 256


class _Look(NamedTuple):
    """What one look shows, and its control points: value, colour, opacity of a voxel."""

    shows: str
    in_hounsfield: bool
    points: str

    @property
    def nodes(self) -> list[tuple[float, str, float]]:
        """The control points, values rising."""
        found = (point.split() for point in self.points.split(", "))
        return [(float(value), color, float(opacity)) for value, color, opacity in found]


_LOOKS = {
    "ct-bone": _Look(
        "bone alone",
        True,
        "150 #a0522d 0, 300 #d9a577 0.1, 700 #f2e3c6 0.5, 1600 #ffffff 0.9",
    ),
    "ct-skin": _Look(
        "the surface against air",
        True,
        "-500 #8a5a44 0, -250 #d9a184 0.2, 0 #eec0a4 0.5, 400 #f7ead9 0.7, 1500 #ffffff 0.9",
    ),
    "ct-muscle": _Look(
        "muscle, faintly, around bone",
        True,
        "-20 #7a2a20 0, 30 #b5493a 0.1, 80 #cf6a55 0.16, "
        "180 #dfa97c 0.12, 600 #f2e3c6 0.5, 1500 #ffffff 0.9",
    ),
    "ct-angiography": _Look(
        "vessels filled with contrast medium, and bone",
        True,
        "130 #5c0a0a 0, 220 #b01818 0.15, 350 #e8442e 0.5, 600 #f2d7b8 0.4, 1500 #ffffff 0.7",
    ),
    "mri-brain": _Look(
        "a brain whose skull has been removed",
        False,
        "0.25 #5e3c3a 0, 0.4 #a67f78 0.15, 0.6 #d8bfb4 0.5, 1 #fff6ec 0.9",
    ),
    "mri-skin": _Look(
        "the surface of whatever gives signal",
        False,
        "0.08 #7a4b3a 0, 0.2 #c98e74 0.35, 0.5 #eec0a4 0.7, 1 #fff4ea 0.9",
    ),
    "mri-muscle": _Look(
        "tissue of middling signal, translucent",
        False,
        "0.15 #4a1512 0, 0.35 #93372b 0.05, 0.55 #c4604a 0.1, 0.75 #e6b59c 0.03, 1 #fff4ea 0.02",
    ),
    "mri-angiography": _Look(
        "the brightest signal: blood that flows, in time-of-flight scans",
        False,
        "0.55 #5c0a0a 0, 0.7 #c02020 0.2, 0.85 #f06040 0.6, 1 #ffd9b8 0.9",
    ),
}


def _arguments(look: _Look) -> dict[str, Any]:
    values, colors, opacities = zip(*look.nodes, strict=True)
    rgb = [[int(color[i : i + 2], 16) for i in (1, 3, 5)] for color in colors]
    first = values[0] if look.in_hounsfield else 0.0
    at = np.linspace(first, values[-1], _ENTRIES)
    channels = [np.interp(at, values, channel) for channel in np.transpose(rgb)]
    table = np.rint(np.stack(channels, axis=1)).astype(int)
    alpha = np.rint(255 * np.interp(at, values, opacities)).astype(int)
    return {
        "cmap": ["#{:02x}{:02x}{:02x}".format(*color) for color in table],
        "opacity": alpha.tolist(),  # bytes: as long as n_colors, taken as it is
        "clim": (float(first), float(values[-1])) if look.in_hounsfield else None,
        "n_colors": _ENTRIES,
        "shade": True,
    }


class Presets(dict[str, dict[str, Any]]):
    """Arguments of ``add_vdi``, ``add_volume`` and :func:`pyvista_vdi.generate`, by name.

    Each look is a dictionary of ``cmap``, ``opacity``, ``clim``, ``n_colors`` and ``shade``;
    ``presets["ct-bone"] | {"shade": False}`` changes a part of it.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> pvdi.presets["ct-bone"]["clim"]
    (150.0, 1600.0)
    """

    def __missing__(self, name: object) -> Any:
        near = difflib.get_close_matches(str(name), self, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(self)}"
        raise InvalidArgumentError(f"no preset is called {name!r}: {hint}")

    def __repr__(self) -> str:
        width = max(map(len, _LOOKS))
        lines = []
        for name, look in _LOOKS.items():
            low, high = look.nodes[0][0], look.nodes[-1][0]
            share = f"from {low:.0%} of the range of values"
            values = f"{low:g} to {high:g} HU" if look.in_hounsfield else share
            lines.append(f"{name:{width}}  {look.shows}; {values}")
        return "\n".join(lines)


#: The looks.
presets = Presets({name: _arguments(look) for name, look in _LOOKS.items()})
