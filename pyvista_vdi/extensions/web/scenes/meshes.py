"""VTK's actors as arrays that the viewer draws: triangles, lines and points with their colours.

What an actor looks like is asked of VTK's own pipeline: its mapper maps the scalars, and surfaces
of other data sets are those that VTK's mapper would extract. Where VTK's OpenGL renderer decides by
rules of its own (which primitives are lit, how polygons become triangles), the rules are repeated
here, so that pictures agree.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.web.placing import planes_of
from pyvista_vdi.vtk_pipeline.vtk import (
    mutable,
    vtk_to_numpy,
    vtkCellArray,
    vtkDataSetSurfaceFilter,
    vtkPolyData,
    vtkPolyDataMapper,
    vtkTriangleFilter,
)

Array = NDArray[Any]

#: Adds an array to those that are sent, and returns its number.
Keep = Callable[[Array], int]

_POINTS, _WIREFRAME, _SURFACE = range(3)  # vtkProperty's representations
_FLAT, _PBR = 0, 3  # its interpolations
_MAPPERS = ("vtkDataSetMapper", "vtkPolyDataMapper", "vtkOpenGLPolyDataMapper")
_COMPOSITE = "vtkCompositePolyDataMapper"

#: Clipping planes of a mapper, as in VTK.
_MOST_PLANES = 6

#: The part of the range of depths, -1 to 1, that a unit of VTK's offsets of polygons is.
_OFFSET_UNIT = 2 * 0.000016

#: The longest edge of a WebP picture.
_MOST_WEBP = 16383


class Cells(NamedTuple):
    """Cells of one kind: the points of each, one behind the other, and where they begin."""

    connectivity: Array
    offsets: Array

    @classmethod
    def of(cls, cells: Any) -> Cells:
        """Take a ``vtkCellArray``, however it is stored."""
        plain = vtkCellArray()
        plain.DeepCopy(cells)
        plain.ConvertTo64BitStorage()
        return cls(
            vtk_to_numpy(plain.GetConnectivityArray()), vtk_to_numpy(plain.GetOffsetsArray())
        )

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def pieces(self, fewer: int) -> tuple[Array, Array, Array]:
        """Divide each cell of n points into n - ``fewer`` pieces.

        Returns of each piece its cell, its number in the cell, and where its cell begins.
        """
        counts = np.maximum(np.diff(self.offsets) - fewer, 0)
        owner = np.repeat(np.arange(len(self)), counts)
        number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
        return owner, number, self.offsets[:-1][owner]

    def triangles(self) -> tuple[Array, Array, Array]:
        """Return a fan of each polygon, as VTK's mapper draws it: points (n, 3), polygons, edges.

        Of edges bits 0 to 2 are set where the sides 0-1, 1-2 and 2-0 are edges of the polygon.
        """
        owner, number, first = self.pieces(2)
        corners = [first, first + number + 1, first + number + 2]
        points = np.stack([self.connectivity[corner] for corner in corners], axis=1)
        last = number == np.diff(self.offsets)[owner] - 3
        edges = (number == 0) | np.uint8(2) | (last.astype(np.uint8) << 2)
        return points, owner, edges.astype(np.uint8)

    def segments(self, *, closed: bool = False) -> tuple[Array, Array]:
        """Return each line's segments, (n, 2), and its number; ``closed``: of polygons."""
        owner, number, first = self.pieces(0 if closed else 1)
        following = number + 1
        if closed:
            following = following % np.diff(self.offsets)[owner]
        points = [self.connectivity[first + number], self.connectivity[first + following]]
        return np.stack(points, axis=1), owner

    def points(self) -> tuple[Array, Array]:
        """Return all points, (n, 1), and the cell of each."""
        owner, number, first = self.pieces(0)
        return self.connectivity[first + number][:, np.newaxis], owner


def shapes_of(
    actor: Any, matrix: Array, keep: Keep, left_out: list[str]
) -> Iterator[dict[str, Any]]:
    """Describe what an actor that was drawn draws, as the viewer's ``scene.js`` takes it.

    ``matrix``: from its data to the world. What cannot be drawn is said in ``left_out``.
    """
    mapper = actor.GetMapper()
    name = None if mapper is None else mapper.GetClassName()
    if name not in _MAPPERS and name != _COMPOSITE:
        gaussian = mapper is not None and mapper.IsA("vtkPointGaussianMapper")
        left_out.append('style="points_gaussian"' if gaussian else f"what {name} draws")
        return
    mapper.Update()
    if name == _COMPOSITE:
        blocks = _blocks(mapper)
    else:
        blocks = iter([(mapper.GetInputDataObject(0, 0), {})])
    look = actor.GetProperty()
    if look.GetInterpolation() == _PBR:
        left_out.append("physically based shading")
    planes = planes_of(actor)
    if len(planes) > _MOST_PLANES:
        left_out.append(f"{len(planes) - _MOST_PLANES} of its clipping planes")
    nearer = offset_of(mapper)
    for data, changes in blocks:
        poly = _surface(data)
        if poly is None or poly.GetNumberOfPoints() == 0:
            continue
        shape = _shape(actor, poly, keep, left_out)
        if shape is None:
            continue
        shape["matrix"] = matrix.tolist()
        shape["material"].update(changes)
        if nearer:
            shape["nearer"] = nearer
        shape["translucent"] = bool(
            actor.HasTranslucentPolygonalGeometry() or changes.get("opacity", 1) < 1
        )
        yield shape


def offset_of(mapper: Any) -> float:
    """Return by how much a mapper draws its polygons nearer, of the range of depths."""
    if mapper.GetResolveCoincidentTopology() != 1:  # by offsets
        return 0.0
    factor, units = mutable(0.0), mutable(0.0)
    mapper.GetRelativeCoincidentTopologyPolygonOffsetParameters(factor, units)
    return float(units) * _OFFSET_UNIT


def _blocks(mapper: Any) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Yield the visible blocks of a composite mapper, and what is another material in each."""
    attributes = mapper.GetCompositeDataDisplayAttributes()
    pending: list[tuple[Any, dict[str, Any]]] = [(mapper.GetInputDataObject(0, 0), {})]
    while pending:
        data, changes = pending.pop(0)
        if data is None:
            continue
        if attributes is not None:
            if attributes.HasBlockVisibility(data) and not attributes.GetBlockVisibility(data):
                continue
            if attributes.HasBlockColor(data):
                color = [0.0, 0.0, 0.0]
                attributes.GetBlockColor(data, color)
                changes = {**changes, "ambientColor": color, "diffuseColor": color}
            if attributes.HasBlockOpacity(data):
                changes = {**changes, "opacity": attributes.GetBlockOpacity(data)}
        if hasattr(data, "GetNumberOfBlocks"):
            blocks = [data.GetBlock(i) for i in range(data.GetNumberOfBlocks())]
            pending = [(block, changes) for block in blocks] + pending
        else:
            yield data, changes


def _surface(data: Any) -> Any:
    """Return what VTK's mapper draws of a data set, without strips."""
    if data is None:
        return None
    if not isinstance(data, vtkPolyData):
        outside = vtkDataSetSurfaceFilter()
        outside.SetInputData(data)
        outside.Update()
        data = outside.GetOutput()
    if data.GetNumberOfStrips() > 0:
        triangles = vtkTriangleFilter()
        triangles.SetInputData(data)
        triangles.PassLinesOn()
        triangles.PassVertsOn()
        triangles.Update()
        data = triangles.GetOutput()
    return data


def _shape(actor: Any, poly: Any, keep: Keep, left_out: list[str]) -> dict[str, Any] | None:
    look = actor.GetProperty()
    drawn = list(_parts(poly, look))
    if not drawn:
        return None
    points = vtk_to_numpy(poly.GetPoints().GetData()).astype(np.float64)
    # Only what is drawn: a grid's surface may be a small part of its points
    used, places = np.unique(
        np.concatenate([part["points"].ravel() for part in drawn]), return_inverse=True
    )
    points = points[used]
    finite = np.isfinite(points).all(axis=1)
    low = points[finite].min(axis=0, initial=np.inf)
    high = points[finite].max(axis=0, initial=-np.inf)
    if not (low <= high).all():
        return None
    middle = (low + high) / 2
    shape: dict[str, Any] = {
        "origin": middle.tolist(),
        "half": ((high - low) / 2).tolist(),
        "points": keep((points - middle).astype(np.float32)),
        "material": _material(look),
        "planes": planes_of(actor)[:_MOST_PLANES],
        "culling": [bool(look.GetFrontfaceCulling()), bool(look.GetBackfaceCulling())],
        "parts": [],
    }
    back = actor.GetBackfaceProperty()
    if back is not None:
        shape["back"] = _material(back)
    normals = poly.GetPointData().GetNormals()
    smooth = normals is not None and look.GetInterpolation() != _FLAT
    if smooth and look.GetLighting():
        unit = vtk_to_numpy(normals)[used].astype(np.float64)
        unit /= np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-30)
        shape["normals"] = keep(np.rint(np.nan_to_num(unit) * 32767).astype(np.int16))
    cell_colors = _colors(actor, poly, used, shape, keep)
    _texture(actor, poly, used, shape, keep, left_out)
    at = 0
    for part in drawn:
        count = part["points"].size
        sent = {
            "kind": part["kind"],
            "points": keep(places[at : at + count].astype(np.uint32)),
            "lit": bool(look.GetLighting()) and _is_lit(part["kind"], look, smooth),
        }
        at += count
        if cell_colors is not None:
            sent["colors"] = keep(cell_colors[part["cells"]])
        if part["kind"] == "faces" and look.GetEdgeVisibility():
            sent["edges"] = keep(part["edges"])
        shape["parts"].append(sent)
    if look.GetVertexVisibility():
        left_out.append("vertices that are shown on a mesh")
    return shape


def _parts(poly: Any, look: Any) -> Iterator[dict[str, Any]]:
    """Yield the primitives that are drawn: their kind, points, cells and edges."""
    before = 0
    representation = look.GetRepresentation()
    for cells, kind in (
        (poly.GetVerts(), "points"),
        (poly.GetLines(), "lines"),
        (poly.GetPolys(), "faces"),
    ):
        if cells.GetNumberOfCells() == 0:
            continue
        held = Cells.of(cells)
        part: dict[str, Any] = {"kind": kind}
        if kind == "points" or representation == _POINTS:
            part["kind"] = "points"
            part["points"], owner = held.points()
        elif kind == "lines":
            part["points"], owner = held.segments()
        elif representation == _WIREFRAME:
            part["kind"] = "wires"
            part["points"], owner = held.segments(closed=True)
        else:
            part["points"], owner, part["edges"] = held.triangles()
        part["cells"] = owner + before
        before += len(held)
        if len(owner):
            yield part


def _is_lit(kind: str, look: Any, smooth: bool) -> bool:
    """Whether VTK lights a primitive."""
    if kind == "points" and look.GetRenderPointsAsSpheres():
        return True
    if kind in ("lines", "wires") and look.GetRenderLinesAsTubes():
        return True
    if look.GetRepresentation() == _POINTS:
        return smooth
    return kind in ("faces", "wires") or smooth


def _colors(actor: Any, poly: Any, used: Array, shape: dict[str, Any], keep: Keep) -> Any:
    """Add what VTK's mapper makes of scalars; return colours of cells, where they have some."""
    twin = vtkPolyDataMapper()
    twin.ShallowCopy(actor.GetMapper())
    twin.SetInputData(poly)
    # Scalars that the actor's own mapper has not been given are not shown, whatever is set
    of_cells = mutable(0)
    colors = twin.MapScalars(poly, 1.0, of_cells)
    coordinates = twin.GetColorCoordinates()
    table = twin.GetColorTextureMap()
    if coordinates is not None and table is not None:
        width, height, _ = table.GetDimensions()
        texels = vtk_to_numpy(table.GetPointData().GetScalars())
        shape["coordinates"] = keep(vtk_to_numpy(coordinates)[used].astype(np.float32))
        shape["table"] = {"size": [width, height], "texels": keep(_rgba(texels))}
    elif colors is not None:
        rgba = _rgba(vtk_to_numpy(colors))
        if int(of_cells):
            return rgba if len(rgba) > 1 else np.repeat(rgba, poly.GetNumberOfCells(), axis=0)
        shape["colors"] = keep(rgba[used])
    return None


def _texture(
    actor: Any, poly: Any, used: Array, shape: dict[str, Any], keep: Keep, left_out: list[str]
) -> None:
    texture, places = actor.GetTexture(), poly.GetPointData().GetTCoords()
    if texture is None or places is None:
        return
    texture.Update()
    image = texture.GetInput()
    scalars = None if image is None else image.GetPointData().GetScalars()
    texels = None if scalars is None else vtk_to_numpy(scalars)
    if texels is None or texels.dtype != np.uint8 or texture.GetCubeMap():
        left_out.append("a texture that is no image of bytes")
        return
    width, height, _ = image.GetDimensions()
    shape["places"] = keep(vtk_to_numpy(places)[used, :2].astype(np.float32))
    shape["texture"] = {
        "size": [width, height],
        "picture": keep(_packed(_rgba(texels).reshape(height, width, 4))),
        "repeat": bool(texture.GetRepeat()),
        "smooth": bool(texture.GetInterpolate()),
    }


def _packed(pixels: Array) -> Array:
    """Return the bytes of an image file of RGBA, which loses nothing."""
    from PIL import Image

    shown = pixels[..., :3] if (pixels[..., 3] == 255).all() else pixels
    image, stream = Image.fromarray(np.ascontiguousarray(shown)), io.BytesIO()
    if max(image.size) <= _MOST_WEBP:
        image.save(stream, format="webp", lossless=True, exact=True)
    else:
        image.save(stream, format="png")
    return np.frombuffer(stream.getvalue(), np.uint8)


def _rgba(colors: Array) -> Array:
    """Return bytes as RGBA, (n, 4), from grey, grey and alpha, RGB or RGBA."""
    colors = colors.reshape(len(colors), -1)
    opaque = np.full((len(colors), 1), 255, np.uint8)
    if colors.shape[1] <= 2:
        alpha = colors[:, 1:] if colors.shape[1] == 2 else opaque
        return np.hstack([np.repeat(colors[:, :1], 3, axis=1), alpha])
    return np.hstack([colors, opaque])[:, :4]


def _material(look: Any) -> dict[str, Any]:
    # VTK before 9.5 draws edges as wide as lines
    own_width = not getattr(look, "GetUseLineWidthForEdgeThickness", lambda: True)()
    edge = look.GetEdgeWidth() if own_width else look.GetLineWidth()
    return {
        "ambient": look.GetAmbient(),
        "ambientColor": list(look.GetAmbientColor()),
        "diffuse": look.GetDiffuse(),
        "diffuseColor": list(look.GetDiffuseColor()),
        "specular": look.GetSpecular(),
        "specularColor": list(look.GetSpecularColor()),
        "power": look.GetSpecularPower(),
        "opacity": look.GetOpacity(),
        "edge": [*look.GetEdgeColor(), look.GetEdgeOpacity()],
        "edgeWidth": edge,
        "lineWidth": look.GetLineWidth(),
        "pointSize": look.GetPointSize(),
        "spheres": bool(look.GetRenderPointsAsSpheres()),
        "tubes": bool(look.GetRenderLinesAsTubes()),
    }
