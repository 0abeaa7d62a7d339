"""``vtkVolumeProperty`` to :class:`~pyvista_vdi.TransferFunction`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, warn_external
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.model.transfer_function import GRADIENT_SHARE, TransferFunction
from pyvista_vdi.vtk_pipeline import vtk

#: Entries of a table that samples the property's functions, where nothing narrower than an entry
#: would be lost: a step in them becomes a ramp of one entry's width.
SAMPLED_ENTRIES = 4096

#: Longest table, 1 MiB: float32 tells 256 places apart between two of its entries.
MOST_ENTRIES = 65536

#: Entries of a gradient opacity's table: VTK's own has as many.
GRADIENT_ENTRIES = 1024

#: How far a node's value may lie from those that a table has on both its sides: a step of 8 bits.
_SEEN = 1 / 256

#: From which distance on a node is said to be lost.
_LOST = 1 / 16

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
        PyVista builds), and for a nearest volume of whole numbers; else sampled at 4096 scalars,
        or at up to 65536 where nodes lie too close for that. Values outside 0 to 1 are clipped
        after interpolation. Scalars outside the functions' nodes take the ends' values, the colours
        below and above the range where they are used, and nothing where clamping is off.

    Raises
    ------
    UnsupportedError
        If a label map, a 2D transfer function, an intensity of clipped voxels or cubic
        interpolation is on, or the components' dependence does not fit the volume.
    InvalidArgumentError
        If it is no volume property, or its functions have no points.

    Warns
    -----
    VDIWarning
        If nodes lie so close together that no table resolves them.
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
    functions = [
        _Function("colour", color_function(prop)),
        _Function("opacity", prop.GetScalarOpacity()),
    ]
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
    vtk.require_this_build(type(prop))
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
    function = _Function("gradient opacity", prop.GetGradientOpacity())
    if (function.values == 1).all() and not function.ends:
        return {}
    if (function.values > 1).any():
        warn_external("gradient opacity above 1 counts as 1: make the scalar opacity larger")
    high = float(function.x[-1])
    if function.ends:
        high += high / GRADIENT_ENTRIES
    if volume is not None:  # no gradient counts as more
        least, largest = _data_range(volume)
        high = min(high, GRADIENT_SHARE * (largest - least))
    high = max(high, float(np.finfo(np.float32).tiny))
    table = function.sampled(0.0, high, GRADIENT_ENTRIES)
    if function.lost(0.0, high, table) > _SEEN:
        table = function.resolved(0.0, high)
    return {"gradient_opacities": table[:, 0], "gradient_range": (0.0, high)}


class _Function:
    """A colour or an opacity function of VTK's.

    ``name``: what it is called in messages. ``x``, ``values``: its nodes' scalars, (n,), and what
    is there, (n, 1), or (n, 3) in RGB. ``ends``: whether it ends with its nodes: beyond them it is
    something else. ``linear``: whether it is linear between its nodes, within 0 to 1 and does not
    end.
    """

    def __init__(self, name: str, function: Any) -> None:
        self.name, self._function = name, function
        colored = isinstance(function, vtk.vtkColorTransferFunction)
        rows = np.empty((function.GetSize(), 6 if colored else 4))
        for i in range(len(rows)):
            function.GetNodeValue(i, rows[i])
        self.x, self.values = np.clip(rows[:, 0], -_FARTHEST, _FARTHEST), rows[:, 1:-2]
        self.ends, self._logarithmic = not function.GetClamping(), False
        straight = not colored and not function.GetUseLogScale()
        if colored:
            self.ends |= function.GetUseBelowRangeColor() or function.GetUseAboveRangeColor()
            # UsingLogScale is always false in VTK 9.4
            self._logarithmic = bool(function.GetScale() == _LOG10 and self.x[0] > 0)
            straight = function.GetColorSpace() == 0 and not self._logarithmic  # VTK_CTF_RGB
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

    def sampled(self, low: float, high: float, n: int) -> NDArray[np.float64]:
        """Return the values at n equidistant scalars, clipped to 0..1, (n, 1) or (n, 3)."""
        scalars = np.linspace(low, high, n)
        if self.linear:
            return self._interpolated(scalars)
        if self._logarithmic:
            return np.clip(self._colors_of_logarithms(scalars), 0, 1)
        return np.clip(self._table(self._function, scalars, self.x[0]), 0, 1)

    def exact(self, grid: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values on a grid that holds all nodes, or else all whole numbers."""
        if self.linear:
            return self._interpolated(grid)
        # VTK divides, which is exact by a power of two: no whole number falls short of a node
        n = 1 << (len(grid) - 1).bit_length()
        return self.sampled(grid[0], grid[0] + n, n + 1)[: len(grid)]

    def resolved(self, low: float, high: float) -> NDArray[np.float64]:
        """Return the longest table, and warn of nodes that it leaves out."""
        table = self.sampled(low, high, MOST_ENTRIES)
        if self.lost(low, high, table) > _LOST:
            warn_external(
                f"the volume property's {self.name} function has nodes closer together than "
                f"1/{MOST_ENTRIES} of the scalars from {low:g} to {high:g}, where something is: "
                "what lies between them is not drawn; clip the volume's scalars to a smaller "
                "range, or move the nodes apart"
            )
        return table

    def lost(
        self,
        low: float,
        high: float,
        table: NDArray[np.float64],
        whole: NDArray[np.float64] | None = None,
    ) -> float:
        """Return how far a table is at most from a node, or from all ``whole`` numbers.

        A node may have the value of an entry beside it: a step between two is a ramp.
        """
        grid = np.linspace(low, high, len(table))
        if whole is not None:
            at_whole = np.stack([np.interp(whole, grid, v) for v in table.T], axis=1)
            return float(np.abs(at_whole - self.exact(whole)).max())
        inside = (self.x >= low) & (self.x <= high)
        if high == low or len(self.x) == 1 or not inside.any():
            return 0.0
        x, values = self.x[inside], np.clip(self.values[inside], 0, 1)
        entry = (x - low) / (high - low) * (len(table) - 1)
        beside = np.stack([np.ceil(entry) - 1, np.floor(entry) + 1]).astype(int)
        of_table = np.stack([np.interp(x, grid, v) for v in table.T], axis=1)
        found = np.stack([of_table, *table[np.clip(beside, 0, len(table) - 1)]])
        return float(np.abs(found - values).max(axis=2).min(axis=0).max())

    def _interpolated(self, scalars: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.interp(scalars, self.x, v) for v in self.values.T], axis=1)

    def _table(
        self, function: Any, scalars: NDArray[np.float64], begin: float
    ) -> NDArray[np.float64]:
        """Return VTK's table at scalars, by one call; the first node is at ``begin``."""
        table = np.empty((len(scalars), self.values.shape[1]))
        function.GetTable(scalars[0], scalars[-1], len(scalars), table.reshape(-1))
        # Colours are 0 in VTK 9.7.2 where the first node is a sample, but not the first one
        first = np.abs(scalars - begin) <= 1e-14 * np.abs(scalars).max()
        table[first] = self.values[0]
        return table

    def _colors_of_logarithms(self, scalars: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what ``GetColor`` has: the same function of logarithms, on a linear scale.

        What ``GetTable`` has of a logarithmic scale differs between versions of VTK.
        """
        function, first, last = self._function, self.x[0], self.x[-1]
        within = vtk.vtkColorTransferFunction()
        within.DeepCopy(function)
        within.SetScaleToLinear()
        within.RemoveAllPoints()
        node = [0.0] * 6
        for k in range(function.GetSize()):
            function.GetNodeValue(k, node)
            within.AddRGBPoint(np.log(node[0]), *node[1:])
        within.SetUseBelowRangeColor(False)  # which a rounded end would have
        within.SetUseAboveRangeColor(False)
        within.SetClamping(True)
        logarithms = np.log(np.clip(scalars, first, last))
        places = np.linspace(logarithms[0], logarithms[-1], 4 * len(scalars))
        if places[0] == places[-1]:  # one node, or none within: of no length VTK has no table
            colors = np.tile(within.GetColor(places[0]), (len(scalars), 1))
        else:
            table = self._table(within, places, np.log(first))
            colors = np.stack([np.interp(logarithms, places, v) for v in table.T], axis=1)
        below, above = scalars < first, scalars > last
        if not function.GetClamping():
            colors[below | above] = 0
        if function.GetUseBelowRangeColor():
            colors[below] = function.GetBelowRangeColor()
        if function.GetUseAboveRangeColor():
            colors[above] = function.GetAboveRangeColor()
        return colors


def _tabulate(
    functions: Sequence[_Function], volume: Any, nearest: bool
) -> tuple[list[NDArray[np.float64]], tuple[float, float]]:
    """Return the functions' values at the same equidistant scalars, and the range of these."""
    linear = all(function.linear for function in functions)
    x = np.unique(np.concatenate([function.x for function in functions]))
    if linear and (volume is None or np.abs(x).max() <= _FAR):
        grid = _common_grid(x, SAMPLED_ENTRIES)
        if grid is not None:
            return [function.exact(grid) for function in functions], (x[0], x[-1])
    # Find the scalars between which functions vary, no wider than those of the volume
    nodes = np.concatenate([function.varying for function in functions])
    low, high = float(nodes.min()), float(nodes.max())
    if any(function.ends for function in functions):  # what is beyond has an entry, too
        beyond = (high - low) / SAMPLED_ENTRIES or 1e-6 * max(1.0, abs(low))
        low, high = low - beyond, high + beyond
    # Where chunks would have to be read for it, only if a table might not show all that there is
    apart = min(np.diff(function.varying).min(initial=np.inf) for function in functions)
    plain = linear and apart >= 64 * (high - low) / SAMPLED_ENTRIES
    if volume is not None and not (plain and getattr(volume, "chunked", False)):
        least, largest = _data_range(volume)
        low, high = min(max(low, least), largest), max(min(high, largest), least)
    whole = nearest and volume is not None and volume.array.dtype.kind in "iu"
    grid = None
    if whole:
        low, high = math.floor(low), math.ceil(high)
        if high - low < MOST_ENTRIES:
            grid = np.arange(low, high + 1, dtype=np.float64)
    elif linear:
        grid = _common_grid(np.array([low, *x[(x > low) & (x < high)], high]), MOST_ENTRIES)
    if grid is None or len(grid) > SAMPLED_ENTRIES:
        tables = [function.sampled(low, high, SAMPLED_ENTRIES) for function in functions]
        pairs = zip(functions, tables, strict=True)
        if all(f.lost(low, high, table, grid if whole else None) <= _SEEN for f, table in pairs):
            return tables, (low, high)
    if grid is None:
        return [function.resolved(low, high) for function in functions], (low, high)
    return [function.exact(grid) for function in functions], (low, high)


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
