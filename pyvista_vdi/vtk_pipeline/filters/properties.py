"""``vtkVolumeProperty`` to :class:`~pyvista_vdi.TransferFunction`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.model.transfer_function import GRADIENT_SHARE, TransferFunction
from pyvista_vdi.vtk_pipeline import vtk

#: Longest table of equidistant nodes that is taken as it is.
EXACT_ENTRIES = 4096

#: Entries of a table that samples the property's functions, 1 MiB: a step in them becomes a ramp of
#: one entry's width. float32 tells 256 places apart between two of them.
SAMPLED_ENTRIES = 65536

#: Entries of a gradient opacity's table: VTK's own has as many.
GRADIENT_ENTRIES = 1024

#: Places of nodes and ends of data beyond which they count as there, so that spans are finite.
_FARTHEST = 8e307

#: From here on nodes leave float32 too few digits for data in between.
_FAR = 1e30

#: Component of an RGBA volume that opacity depends on; VTK takes its unit distance, too, while the
#: functions are the first component's.
RGBA_OPACITY = 3

#: vtkColorTransferFunction's logarithmic scale, VTK_CTF_LOG10.
_LOG10 = 1

#: VTK's interpolation types that a VDI can be made with (VTK_NEAREST_..., VTK_LINEAR_...).
INTERPOLATION = {0: "nearest", 1: "linear"}


def transfer_function_from_property(
    prop: Any, volume: Any = None, *, rgba: bool = False
) -> TransferFunction:
    """Return the transfer function of a volume property.

    Parameters
    ----------
    prop : vtkVolumeProperty or pyvista.VolumeProperty
        Colour and scalar opacity functions of its first component, its scalar opacity unit
        distance (model units), its interpolation (nearest or linear), its gradient opacity and,
        if it is shaded, its lighting coefficients are taken.
    volume : Volume, optional
        What it classifies. Nodes that lie wider than its scalars then count for what they
        interpolate to within these alone, and a table that is exact for it may be so for no other.
    rgba : bool
        Whether the volume has colours of its own: the property's components must then be
        dependent, and its colours have no meaning.

    Returns
    -------
    TransferFunction
        Exact where the nodes lie on a common equidistant grid of up to 4096 entries (which is what
        PyVista builds), and for a nearest volume of whole numbers; else sampled at 65536 scalars.
        Values outside 0 to 1 are clipped after interpolation. Scalars outside the functions' nodes
        take the ends' values, the colours below and above the range where they are used, and
        nothing where clamping is off.

    Raises
    ------
    UnsupportedError
        If a label map, a 2D transfer function, an intensity of clipped voxels, cubic
        interpolation or a logarithmic scale of colours is on, or the components' dependence does
        not fit the volume.
    InvalidArgumentError
        If it is no volume property, or its functions have no points.
    """
    check_property(prop, rgba=rgba)
    for name, function in (("opacity", prop.GetScalarOpacity()), ("colour", color_function(prop))):
        if function.GetSize() == 0:
            raise InvalidArgumentError(
                f"the volume property's {name} function has no points: add some (AddPoint)"
            )
    shading = None
    if prop.GetShade():
        reflected = (prop.GetAmbient(), prop.GetDiffuse(), prop.GetSpecular())
        shading = Shading(*reflected, prop.GetSpecularPower())
    interpolation = INTERPOLATION[prop.GetInterpolationType()]
    functions = [_Function(color_function(prop)), _Function(prop.GetScalarOpacity())]
    (colors, opacities), scalar_range = _tabulate(functions, volume, interpolation == "nearest")
    return TransferFunction(
        np.broadcast_to(colors, (len(colors), 3)),  # a grey function has one column
        opacities[:, 0],
        scalar_range,
        unit_distance=prop.GetScalarOpacityUnitDistance(RGBA_OPACITY if rgba else 0),
        interpolation=interpolation,
        shading=shading,
        **_gradient_opacity(prop, volume),
    )


def check_property(prop: Any, *, rgba: bool = False) -> None:
    """Refuse what no table can have; functions may be filled with points later."""
    if not isinstance(prop, vtk.vtkVolumeProperty):
        raise InvalidArgumentError(
            f"volume_property must be a vtkVolumeProperty; got {type(prop).__name__}"
        )
    reasons = []
    if rgba and prop.GetIndependentComponents():
        reasons.append("independent components of an RGBA volume (IndependentComponentsOff())")
    if not rgba and not prop.GetIndependentComponents():
        reasons.append("dependent components, which are for RGBA (IndependentComponentsOn())")
    if prop.GetTransferFunctionMode() == vtk.vtkVolumeProperty.TF_2D:
        reasons.append("a 2D transfer function (SetTransferFunctionModeTo1D())")
    if getattr(prop, "GetNumberOfLabels", lambda: 0)() > 0:
        reasons.append("a label map's functions (remove SetLabelColor, SetLabelScalarOpacity)")
    if prop.GetUseClippedVoxelIntensity():
        reasons.append("an intensity of clipped voxels (SetUseClippedVoxelIntensity(0))")
    if prop.GetInterpolationType() not in INTERPOLATION:
        reasons.append("cubic interpolation (SetInterpolationTypeToLinear())")
    if reasons:
        raise UnsupportedError(
            f"the volume property has {' and '.join(reasons)}, which a VDI cannot honour"
        )


def color_function(prop: vtk.vtkVolumeProperty) -> Any:
    """Return the function that colours: RGB or grey.

    Asking a grey property for its RGB function would make it one of colour.
    """
    grey = prop.GetColorChannels() == 1
    return prop.GetGrayTransferFunction() if grey else prop.GetRGBTransferFunction()


def _gradient_opacity(prop: vtk.vtkVolumeProperty, volume: Any) -> dict[str, Any]:
    if prop.GetDisableGradientOpacity() or not prop.HasGradientOpacity():
        return {}
    function = _Function(prop.GetGradientOpacity())
    if (function.values == 1).all() and not function.ends:
        return {}
    high = float(function.x[-1])
    if function.ends:
        high += high / GRADIENT_ENTRIES
    if volume is not None:  # no gradient counts as more
        least, largest = _data_range(volume)
        high = min(high, GRADIENT_SHARE * (largest - least))
    high = max(high, float(np.finfo(np.float32).tiny))
    table = function.at(np.linspace(0.0, high, GRADIENT_ENTRIES))
    return {"gradient_opacities": table[:, 0], "gradient_range": (0.0, high)}


class _Function:
    """A colour or an opacity function of VTK's.

    ``x``, ``values``: its nodes' scalars, (n,), and what is there, (n, 1), or (n, 3) in RGB.
    ``ends``: whether it ends with its nodes: beyond them it is something else. ``linear``: whether
    it is linear between its nodes, within 0 to 1 and does not end.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        colored = isinstance(function, vtk.vtkColorTransferFunction)
        rows = np.empty((function.GetSize(), 6 if colored else 4))
        for i in range(len(rows)):
            function.GetNodeValue(i, rows[i])
        self.x, self.values = np.clip(rows[:, 0], -_FARTHEST, _FARTHEST), rows[:, 1:-2]
        self.ends = not function.GetClamping()
        if colored:
            self.ends |= function.GetUseBelowRangeColor() or function.GetUseAboveRangeColor()
            straight = function.GetColorSpace() == 0  # VTK_CTF_RGB
            if function.GetScale() == _LOG10:
                raise UnsupportedError(
                    "the volume property's colour function has a logarithmic scale, which differs "
                    "between versions of VTK: SetScaleToLinear(), with nodes that lie closer"
                )
        else:
            straight = not function.GetUseLogScale()
        self.linear = bool(
            straight
            and not self.ends
            and ((self.values >= 0) & (self.values <= 1)).all()
            and (rows[:, -2] == 0.5).all()  # midpoints
            and (rows[:, -1] == 0.0).all()  # sharpness
            and (np.diff(self.x) > 0).all()
        )

    @property
    def varying(self) -> NDArray[np.float64]:
        """The nodes' scalars without those before and behind which nothing changes."""
        if self.ends:
            return self.x
        changes = np.flatnonzero((np.diff(self.values, axis=0) != 0).any(axis=1))
        return self.x[changes[0] : changes[-1] + 2] if len(changes) else self.x[:1]

    def at(self, scalars: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at equidistant scalars, clipped to 0..1, (n, 1) or (n, 3)."""
        if self.linear:
            return np.stack([np.interp(scalars, self.x, v) for v in self.values.T], axis=1)
        table = np.empty((len(scalars), self.values.shape[1]))
        self._function.GetTable(scalars[0], scalars[-1], len(scalars), table.reshape(-1))
        # Colours are 0 in VTK 9.7.2 where the first node is a sample, but not the first one
        first = np.abs(scalars - self.x[0]) <= 1e-14 * np.abs(scalars).max()
        table[first] = self.values[0]
        return np.clip(table, 0, 1)


def _tabulate(
    functions: Sequence[_Function], volume: Any, nearest: bool
) -> tuple[list[NDArray[np.float64]], tuple[float, float]]:
    """Return the functions' values at the same equidistant scalars, and the range of these."""
    linear = all(function.linear for function in functions)
    x = np.unique(np.concatenate([function.x for function in functions]))
    if linear and (volume is None or np.abs(x).max() <= _FAR):
        grid = _common_grid(x, EXACT_ENTRIES)
        if grid is not None:
            return [function.at(grid) for function in functions], (x[0], x[-1])
    # Find the scalars between which functions vary, no wider than those of the volume
    nodes = np.concatenate([function.varying for function in functions])
    low, high = float(nodes.min()), float(nodes.max())
    if any(function.ends for function in functions):  # what is beyond has an entry, too
        beyond = (high - low) / SAMPLED_ENTRIES or 1e-6 * max(1.0, abs(low))
        low, high = low - beyond, high + beyond
    if volume is not None:
        least, largest = _data_range(volume)
        low, high = min(max(low, least), largest), max(min(high, largest), least)
    # Take whole numbers or the nodes, where these are few enough, or else sample
    if nearest and volume is not None and volume.array.dtype.kind in "iu":
        low, high = math.floor(low), math.ceil(high)
        if (n := high - low + 1) <= SAMPLED_ENTRIES:
            # VTK divides, which is exact by a power of two: no whole number falls short of a node
            longer = 1 << (n - 1).bit_length()
            whole = low + np.arange(longer + 1, dtype=np.float64)
            return [function.at(whole)[:n] for function in functions], (low, high)
    inside = np.array([low, *x[(x > low) & (x < high)], high])
    grid = _common_grid(inside, SAMPLED_ENTRIES) if linear else None
    if grid is None:
        grid = np.linspace(low, high, SAMPLED_ENTRIES)
    return [function.at(grid) for function in functions], (low, high)


def _data_range(volume: Any) -> tuple[float, float]:
    """Return the least and the largest scalar, finite; any where a rank's part is NaN alone."""
    least, largest = np.clip(np.nan_to_num(volume.finite_range()), -_FARTHEST, _FARTHEST)
    return float(least), float(largest)


def _common_grid(x: NDArray[np.float64], longest: int) -> NDArray[np.float64] | None:
    """Return the coarsest equidistant grid that holds all nodes, if it is no longer than that."""
    low, high = x[0], x[-1]
    if low == high:
        return x[:1]
    gaps = np.diff(x)
    whole = (gaps == np.round(gaps)).all() and high - low < longest
    step = np.gcd.reduce(gaps.astype(np.int64)) if whole else gaps.min()
    if high - low > step * (longest - 1):
        return None
    intervals = round((high - low) / step)
    position = (x - low) / (high - low) * intervals
    # A node this share of an entry off its place changes the table by as little
    if np.abs(position - np.round(position)).max() > 1e-6:
        return None
    grid = np.linspace(low, high, intervals + 1)
    grid[np.round(position).astype(int)] = x
    return grid
