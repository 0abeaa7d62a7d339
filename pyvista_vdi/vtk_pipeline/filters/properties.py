"""``vtkVolumeProperty`` to :class:`~pyvista_vdi.TransferFunction`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.vtk_pipeline.vtk import (
    require_this_build,
    vtkColorTransferFunction,
    vtkPiecewiseFunction,
    vtkVolumeProperty,
)

#: Entries of the table where the property's nodes do not lie on a common equidistant grid: the
#: functions are sampled this often over the union of their ranges, and a step in them becomes a
#: ramp of one entry's width.
SAMPLED_ENTRIES = 4096

#: Entries of a gradient opacity's table: VTK's own has as many.
GRADIENT_ENTRIES = 1024

#: Component of an RGBA volume that opacity depends on; VTK takes its unit distance, too, while the
#: functions are the first component's.
RGBA_OPACITY = 3

#: VTK's interpolation types that a VDI can be made with (VTK_NEAREST_..., VTK_LINEAR_...).
_INTERPOLATION = {0: "nearest", 1: "linear"}


def transfer_function_from_property(
    prop: Any, *, n_entries: int = SAMPLED_ENTRIES, rgba: bool = False
) -> TransferFunction:
    """Return the transfer function of a volume property.

    Parameters
    ----------
    prop : vtkVolumeProperty or pyvista.VolumeProperty
        Colour and scalar opacity functions of its first component, its scalar opacity unit
        distance (model units), its interpolation (nearest or linear), its gradient opacity and,
        if it is shaded, its lighting coefficients are taken.
    n_entries : int
        Longest table. Nodes on a common equidistant grid no longer than this (which is what
        PyVista builds) give exactly that grid; any others are sampled at this many scalars.
    rgba : bool
        Whether the volume has colours of its own: the property's components must then be
        dependent, and its colours have no meaning.

    Returns
    -------
    TransferFunction
        Scalars outside the functions take the ends' values, as VTK's functions do while they
        clamp; where clamping is off, a node of zero opacity stands beside each end.

    Raises
    ------
    UnsupportedError
        If a label map, a 2D transfer function, an intensity of clipped voxels or cubic
        interpolation is on, or the components' dependence does not fit the volume.
    InvalidArgumentError
        If it is no volume property, or its functions have no points.
    """
    require_this_build(type(prop))
    if not isinstance(prop, vtkVolumeProperty):
        raise InvalidArgumentError(
            f"volume_property must be a vtkVolumeProperty; got {type(prop).__name__}"
        )
    _refuse_unsupported(prop, rgba)
    opacity = prop.GetScalarOpacity()
    color = color_function(prop)
    if opacity.GetSize() == 0 or color.GetSize() == 0:
        missing = "opacity" if opacity.GetSize() == 0 else "colour"
        raise InvalidArgumentError(
            f"the volume property's {missing} function has no points: add some (AddPoint)"
        )
    shading = None
    if prop.GetShade():
        reflected = (prop.GetAmbient(), prop.GetDiffuse(), prop.GetSpecular())
        shading = Shading(*reflected, prop.GetSpecularPower())
    colors, opacities, scalar_range = _tabulate(color, opacity, n_entries)
    return TransferFunction(
        np.clip(colors, 0, 1),
        np.clip(opacities, 0, 1),
        scalar_range,
        unit_distance=prop.GetScalarOpacityUnitDistance(RGBA_OPACITY if rgba else 0),
        interpolation=_INTERPOLATION[prop.GetInterpolationType()],
        shading=shading,
        **_gradient_opacity(prop),
    )


def color_function(prop: vtkVolumeProperty) -> Any:
    """Return the function that colours: RGB or grey.

    Asking a grey property for its RGB function would make it one of colour.
    """
    grey = prop.GetColorChannels() == 1
    return prop.GetGrayTransferFunction() if grey else prop.GetRGBTransferFunction()


def _refuse_unsupported(prop: vtkVolumeProperty, rgba: bool) -> None:
    reasons = []
    if rgba and prop.GetIndependentComponents():
        reasons.append("independent components of an RGBA volume (IndependentComponentsOff())")
    if not rgba and not prop.GetIndependentComponents():
        reasons.append("dependent components, which are for RGBA (IndependentComponentsOn())")
    if prop.GetTransferFunctionMode() == vtkVolumeProperty.TF_2D:
        reasons.append("a 2D transfer function (SetTransferFunctionModeTo1D())")
    if getattr(prop, "GetNumberOfLabels", lambda: 0)() > 0:
        reasons.append("a label map's functions (remove SetLabelColor, SetLabelScalarOpacity)")
    if prop.GetUseClippedVoxelIntensity():
        reasons.append("an intensity of clipped voxels (SetUseClippedVoxelIntensity(0))")
    if prop.GetInterpolationType() not in _INTERPOLATION:
        reasons.append("cubic interpolation (SetInterpolationTypeToLinear())")
    if reasons:
        raise UnsupportedError(
            f"the volume property has {' and '.join(reasons)}, which a VDI cannot honour"
        )


def _gradient_opacity(prop: vtkVolumeProperty) -> dict[str, Any]:
    if prop.GetDisableGradientOpacity() or not prop.HasGradientOpacity():
        return {}
    function = prop.GetGradientOpacity()
    nodes = _nodes(function)
    if (nodes[:, 1] == 1.0).all():
        return {}
    low, high = 0.0, max(float(nodes[:, 0].max()), float(np.finfo(np.float32).tiny))
    grid = np.linspace(low, high, GRADIENT_ENTRIES)
    opacities = np.array([function.GetValue(x) for x in grid])
    return {"gradient_opacities": np.clip(opacities, 0, 1), "gradient_range": (low, high)}


def _nodes(function: Any) -> NDArray[np.float64]:
    """Return a function's nodes as rows: x, values, midpoint, sharpness."""
    width = 6 if isinstance(function, vtkColorTransferFunction) else 4
    rows = np.empty((function.GetSize(), width))
    for i in range(len(rows)):
        function.GetNodeValue(i, rows[i])
    return rows


def _tabulate(
    color: Any, opacity: vtkPiecewiseFunction, n_entries: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float]]:
    color_nodes, opacity_nodes = _nodes(color), _nodes(opacity)
    x = np.union1d(color_nodes[:, 0], opacity_nodes[:, 0])
    low, high = float(x[0]), float(x[-1])
    if all(_is_piecewise_linear(f, n) for f, n in ((color, color_nodes), (opacity, opacity_nodes))):
        grid = _common_grid(x, n_entries)
        if grid is not None:
            channels = color_nodes[:, 1:-2].T
            rgb = np.array([np.interp(grid, color_nodes[:, 0], c) for c in channels]).T
            opacities = np.interp(grid, opacity_nodes[:, 0], opacity_nodes[:, 1])
            return _rgb(rgb), opacities, (low, high)
    step = (high - low) / n_entries
    clamped = opacity.GetClamping() and color.GetClamping()
    if not clamped:
        low, high = low - step, high + step
    grid = np.linspace(low, high, n_entries)
    opacities = np.array([opacity.GetValue(x) for x in grid])
    if isinstance(color, vtkColorTransferFunction):
        table = [color.GetColor(x) for x in grid]
    else:
        table = [[color.GetValue(x)] for x in grid]
    return _rgb(np.array(table)), opacities, (low, high)


def _rgb(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.broadcast_to(values, (len(values), 3))  # a grey function has one column


def _is_piecewise_linear(function: Any, nodes: NDArray[np.float64]) -> bool:
    plain = bool(
        function.GetClamping()
        and (nodes[:, -2] == 0.5).all()
        and (nodes[:, -1] == 0.0).all()
        and (np.diff(nodes[:, 0]) > 0).all()
        and not getattr(function, "GetUseLogScale", lambda: 0)()
    )
    if isinstance(function, vtkColorTransferFunction):
        rgb, linear = 0, 0  # VTK_CTF_RGB, VTK_CTF_LINEAR
        return bool(plain and function.GetColorSpace() == rgb and function.GetScale() == linear)
    return plain


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
