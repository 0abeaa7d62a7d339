"""Looks for CT and MRI by name: ``pl.add_vdi(volume, **pvdi.presets["ct-bone"])``.

The control points are this project's own. CT's stand in Hounsfield units, so a scan must be
calibrated, as DICOM files are; MRI has no unit, and its points are shares of the values' range.
"""

from typing import Any

import numpy as np

from pyvista_vdi.model.checks import suggestion

#: Entries of the tables that are made of the control points.
_ENTRIES = 256

#: Control points: value, colour, opacity of a voxel; values rising.
_POINTS = {
    "ct-bone": "150 #a0522d 0, 300 #d9a577 0.1, 700 #f2e3c6 0.5, 1600 #ffffff 0.9",
    # The surface against air
    "ct-skin": "-500 #8a5a44 0, -250 #d9a184 0.2, 0 #eec0a4 0.5, 400 #f7ead9 0.7, 1500 #ffffff 0.9",
    # Faintly, around bone
    "ct-muscle": "-20 #7a2a20 0, 30 #b5493a 0.1, 80 #cf6a55 0.16, "
    "180 #dfa97c 0.12, 600 #f2e3c6 0.5, 1500 #ffffff 0.9",
    # Vessels filled with contrast medium, and bone
    "ct-angiography": "130 #5c0a0a 0, 220 #b01818 0.15, 350 #e8442e 0.5, "
    "600 #f2d7b8 0.4, 1500 #ffffff 0.7",
    # Without the skull
    "mri-brain": "0.25 #5e3c3a 0, 0.4 #a67f78 0.15, 0.6 #d8bfb4 0.5, 1 #fff6ec 0.9",
    # The surface of whatever gives signal
    "mri-skin": "0.08 #7a4b3a 0, 0.2 #c98e74 0.35, 0.5 #eec0a4 0.7, 1 #fff4ea 0.9",
    # Tissue of middling signal, translucent
    "mri-muscle": "0.15 #4a1512 0, 0.35 #93372b 0.05, 0.55 #c4604a 0.1, "
    "0.75 #e6b59c 0.03, 1 #fff4ea 0.02",
    # Blood that flows, in time-of-flight scans
    "mri-angiography": "0.55 #5c0a0a 0, 0.7 #c02020 0.2, 0.85 #f06040 0.6, 1 #ffd9b8 0.9",
}


def _arguments(name: str) -> dict[str, Any]:
    """Return the arguments of a look: a table of colours and opacities of the control points."""
    nodes = [point.split() for point in _POINTS[name].split(", ")]
    values, opacities = (np.array([node[k] for node in nodes], np.float64) for k in (0, 2))
    rgb = np.array([[*bytes.fromhex(color[1:])] for _, color, _ in nodes])
    hounsfield = name.startswith("ct")
    at = np.linspace(values[0] if hounsfield else 0.0, values[-1], _ENTRIES)
    table = np.rint([np.interp(at, values, channel) for channel in rgb.T]).astype(int)
    alpha = np.rint(255 * np.interp(at, values, opacities)).astype(int)
    return {
        "cmap": ["#{:02x}{:02x}{:02x}".format(*color) for color in table.T],
        "opacity": alpha.tolist(),  # bytes: as long as n_colors, taken as it is
        "clim": (float(at[0]), float(at[-1])) if hounsfield else None,
        "n_colors": _ENTRIES,
        "shade": True,
    }


class _Presets(dict[str, dict[str, Any]]):
    """Presets by their names."""

    def __missing__(self, name: Any) -> Any:
        raise KeyError(f"there is no preset {name!r}: {suggestion(str(name), [*self])}")


#: Arguments of ``add_vdi``, ``add_volume`` and ``generate``, by the looks' names.
presets = _Presets({name: _arguments(name) for name in _POINTS})
