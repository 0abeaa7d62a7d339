"""A renderer's scene as the viewer shows it: VDIs among meshes, lines, points and texts."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkActor,
    vtkAnnotatedCubeActor,
    vtkAxesActor,
    vtkProp3D,
    vtkPropAssembly,
    vtkPropCollection,
)
from pyvista_vdi.web.camera import viewer_camera
from pyvista_vdi.web.encode import encoded
from pyvista_vdi.web.placing import look_of, planes_of, thinned
from pyvista_vdi.web.scenes.annotations import annotations_of, described_text
from pyvista_vdi.web.scenes.meshes import shapes_of

#: The numbers of a scene's arrays in JavaScript: their names there, by NumPy's.
_KINDS = {
    "float32": "Float32Array",
    "int16": "Int16Array",
    "uint8": "Uint8Array",
    "uint32": "Uint32Array",
}

#: Planes that the viewer clips a VDI to; two more bound a slab of it.
_MOST_PLANES = 6

#: vtkLight's types.
_LIGHTS = {1: "head", 2: "camera", 3: "scene"}

#: Actors that turn or scale with the view, which the viewer's matrices do not.
_NOT_PLAIN = ("vtkFollower", "vtkProp3DFollower", "vtkAxisFollower")

_GRADIENTS = {0: "to top", 1: "to right"}  # vtkViewport's vertical and horizontal


@dataclass
class Scene:
    """What is shown of a renderer.

    Attributes
    ----------
    vdi : VDI or None
        The first one, if there is one.
    actors : list of VDIActor
        Those that show VDIs, the first one's first.
    state : tuple
        Of :func:`state_of`.
    data : bytes
        All the rest, as scene.js takes it.
    background : str
        As CSS has it.
    left_out : list of str
        What is not shown, by name.
    """

    vdi: VDI | None
    actors: list[Any]
    state: Any
    data: bytes
    background: str
    left_out: list[str]

    @property
    def actor(self) -> Any:
        """The first one's actor, or ``None``."""
        return next(iter(self.actors), None)


@dataclass
class _Packed:
    """Arrays one behind the other."""

    arrays: list[NDArray[Any]] = field(default_factory=list)

    def keep(self, array: NDArray[Any]) -> int:
        """Take an array, and return its number."""
        self.arrays.append(np.ascontiguousarray(array))
        return len(self.arrays) - 1

    def deflated(self, head: dict[str, Any]) -> bytes:
        """Return the scene: the length of a JSON text, the text, and the arrays; deflated."""
        described, at, parts = [], 0, []
        for array in self.arrays:
            # Planes of bytes: they deflate to about two thirds
            data = array.view(np.uint8).reshape(-1, array.itemsize).T.tobytes()
            described.append([_KINDS[array.dtype.name], at, array.size])
            data += b"\0" * (-len(data) % 4)
            parts.append(data)
            at += len(data)
        text = json.dumps({**head, "arrays": described}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        return zlib.compress(len(text).to_bytes(4, "little") + text + b"".join(parts), 6)


def scene_of(
    renderer: Any,
    names: dict[str, Any] | None = None,
    *,
    camera: bool = True,
    needs_vdi: bool = True,
) -> Scene:
    """Return what a renderer shows, for the viewer.

    Parameters
    ----------
    renderer : vtkRenderer
        It has been drawn, so that its VDIs are there.
    names : dict of str to vtkProp, optional
        What its props are called, for what is said of those that are left out.
    camera : bool
        Whether its view is that in which the viewer begins.
    needs_vdi : bool
        Whether a renderer without VDIs is refused.

    Raises
    ------
    UnsupportedError
        If it shows no VDI and needs one.
    """
    called = {prop: name for name, prop in (names or {}).items() if "(Addr" not in name}
    packed, left_out = _Packed(), _environment(renderer)
    shapes: list[dict[str, Any]] = []
    texts: list[dict[str, Any]] = []
    bodies: list[tuple[VDI, dict[str, Any]]] = []
    actors: list[Any] = []
    for prop, matrix in _props(renderer):
        missing: list[str] = []
        known = True
        if isinstance(prop, VDIActorMethods):
            if prop.vdi is not None:  # type: ignore[attr-defined]
                bodies.append(_body(prop, matrix, missing))
                actors.append(prop)
        elif isinstance(prop, vtkActor) and _is_plain(prop):
            shapes += shapes_of(prop, matrix, packed.keep, missing)
        else:
            described = annotations_of(prop, renderer, missing)
            known = described is not None
            group = len(texts)
            texts += [{**t, "alone": group + 1} if "alone" in t else t for t in described or []]
        title = called.get(prop, type(prop).__name__)
        if not known:
            left_out.append(title)
        left_out += [f"{what} ({title})" for what in missing]
    # The viewer plays the first one's series, and follows its set
    several = [actor.series is not None or actor.vdi_set is not None for actor in actors]
    if any(several):
        for those in (bodies, actors):
            those.insert(0, those.pop(several.index(True)))
    if not bodies and needs_vdi:
        raise UnsupportedError("the renderer shows no VDI, so there is nothing for the viewer")
    described = [{**more, "file": None} for _, more in bodies]
    for (vdi, _), entry in zip(bodies[1:], described[1:], strict=True):
        entry["file"] = packed.keep(np.frombuffer(encoded(vdi, coarse=True), np.uint8))
    marker = _marker(renderer, packed.keep, texts, left_out)
    head = {
        "camera": _camera(renderer) if camera else None,
        "size": list(renderer.GetSize()),
        "bounds": _bounds(renderer),
        "lights": list(_lights(renderer)),
        "shapes": shapes,
        "marker": marker,
        "texts": texts,
        "vdis": described,
    }
    background = _background(renderer, left_out)
    return Scene(
        vdi=bodies[0][0] if bodies else None,
        actors=actors,
        state=state_of(renderer),
        data=packed.deflated(head),
        background=background,
        left_out=list(dict.fromkeys(left_out)),
    )


def state_of(renderer: Any) -> tuple[Any, ...]:
    """Return what a scene depends on, but for its camera; another value asks for another scene."""
    states: list[Any] = []
    for prop in renderer.GetViewProps():
        state: list[Any] = [prop.GetAddressAsString(""), bool(prop.GetVisibility())]
        if isinstance(prop, VDIActorMethods):
            # The mapper is modified in each frame
            state += [*look_of(prop), *map(tuple, planes_of(prop))]
            state.append(Cropping.from_any(prop.GetMapper()))  # type: ignore[attr-defined]
        else:
            state.append(prop.GetRedrawMTime())
        states.append(tuple(state))
    lights = json.dumps(list(_lights(renderer)))
    return tuple(states), tuple(renderer.GetSize()), lights, _background(renderer, [])


def _props(renderer: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Give what is visible, the parts of assemblies by themselves, and where it is."""
    for prop in renderer.GetViewProps():
        if prop.GetVisibility():
            yield from _paths(prop)


def _paths(prop: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    """Give a prop, or the visible parts of an assembly, and where it is."""
    if not isinstance(prop, vtkProp3D) or prop.GetNumberOfPaths() <= 1:
        yield prop, _array(prop.GetMatrix() if hasattr(prop, "GetMatrix") else None)
        return
    paths = []
    prop.InitPathTraversal()
    while (path := prop.GetNextPath()) is not None:
        nodes = [path.GetItemAsObject(k) for k in range(path.GetNumberOfItems())]
        paths.append(([node.GetViewProp() for node in nodes], nodes[-1].GetMatrix()))
    for parts, matrix in paths:
        if all(part.GetVisibility() for part in parts):
            yield parts[-1], _array(matrix)


def _marker(
    renderer: Any, keep: Any, texts: list[dict[str, Any]], left_out: list[str]
) -> dict[str, Any] | None:
    """Describe the axes in a corner, which PyVista's renderers have, and add their letters."""
    widget = getattr(renderer, "axes_widget", None)
    if widget is None or not widget.GetEnabled() or renderer.GetRenderWindow() is None:
        return None
    marker = widget.GetOrientationMarker()
    layers = renderer.GetRenderWindow().GetRenderers()
    layers = [layers.GetItemAsObject(i) for i in range(layers.GetNumberOfItems())]
    own = next((layer for layer in layers if layer.HasViewProp(marker)), None)
    if own is None:
        return None
    missing: list[str] = []
    shapes = [
        shape
        for actor, matrix in _parts_of_marker(marker)
        if actor.GetVisibility() and isinstance(actor, vtkActor)
        for shape in shapes_of(actor, matrix, keep, missing)
    ]
    left_out += [f"{what} (the axes widget)" for what in missing]
    if isinstance(marker, vtkAxesActor) and marker.GetAxisLabels():
        for axis in "XYZ":
            caption = getattr(marker, f"Get{axis}AxisCaptionActor2D")()
            look = caption.GetTextActor().GetScaledTextProperty()
            text = described_text(caption.GetCaption(), (0, 0), look, own)
            place = {"at": list(caption.GetAttachmentPoint()), "shift": [caption.GetPadding(), 2]}
            texts.append({**text, **place, "marker": True, "across": "left", "along": "bottom"})
    camera, low, high = own.GetActiveCamera(), *np.reshape(renderer.GetViewport(), (2, 2))
    place = (np.reshape(own.GetViewport(), (2, 2)) - low) / (high - low)
    return {
        "place": place.ravel().tolist(),
        "camera": {**viewer_camera(camera, own.GetSize()), "distance": camera.GetDistance()},
        "bounds": _bounds(own),
        "lights": list(_lights(own)),
        "shapes": shapes,
    }


def _parts_of_marker(marker: Any) -> Iterator[tuple[Any, NDArray[np.float64]]]:
    if isinstance(marker, vtkPropAssembly):
        for part in marker.GetParts():
            yield from _parts_of_marker(part)
    elif isinstance(marker, vtkAxesActor):
        actors = vtkPropCollection()
        marker.GetActors(actors)
        for actor in actors:
            yield actor, _array(actor.GetMatrix())
    else:
        whole = marker.GetAssembly() if isinstance(marker, vtkAnnotatedCubeActor) else marker
        yield from _paths(whole)


def _array(matrix: Any) -> NDArray[np.float64]:
    if matrix is None:
        return np.eye(4)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def _is_plain(prop: Any) -> bool:
    shader = prop.GetShaderProperty()
    changed = shader is not None and (
        shader.GetNumberOfShaderReplacements() or shader.HasFragmentShaderCode()
    )
    return prop.GetMapper() is not None and not changed and not any(map(prop.IsA, _NOT_PLAIN))


def _body(actor: Any, matrix: Any, missing: list[str]) -> tuple[VDI, dict[str, Any]]:
    planes = planes_of(actor)
    cropping = Cropping.from_any(actor.GetMapper())
    if cropping is not None:
        sides = _sides(cropping, actor.vdi.bounds, matrix)
        if sides is None or len(planes) + len(sides) > _MOST_PLANES:
            missing.append("cropping")
        else:
            planes += sides
    if len(planes) > _MOST_PLANES:
        missing.append(f"{len(planes) - _MOST_PLANES} of its clipping planes")
    vdi = thinned(actor.vdi, actor.opacity_multiplier)
    return vdi, {"planes": planes[:_MOST_PLANES], "matrix": matrix.tolist()}


def _sides(
    cropping: Cropping, bounds: Sequence[float], matrix: NDArray[np.float64]
) -> list[list[float]] | None:
    """Return the planes of a box that is cropped to, world; ``None`` if it is another shape."""
    regions = [(i, j, k) for k in range(3) for j in range(3) for i in range(3)]
    if not all(cropping.keeps(*region) == (region == (1, 1, 1)) for region in regions):
        return None
    sides = []
    edges = cropping.reach(bounds).ravel()
    for number, (place, edge) in enumerate(zip(cropping.planes, edges, strict=True)):
        normal, sense = np.asarray(cropping.normals[number // 2]), 1 - 2 * (number % 2)
        if sense * (place - edge) <= 0:  # outside of what there is
            continue
        point = np.append(place * normal / (normal @ normal), 1.0)
        normal = sense * normal @ np.linalg.inv(matrix[:3, :3])
        sides.append([*(matrix @ point)[:3].tolist(), *normal.tolist()])
    return sides


def _camera(renderer: Any) -> dict[str, Any]:
    return viewer_camera(renderer.GetActiveCamera(), renderer.GetSize())


def _bounds(renderer: Any) -> list[float] | None:
    """Return the box by which VTK sets its clipping range, which translucent layers depend on."""
    bounds = renderer.ComputeVisiblePropBounds()
    return list(bounds) if bounds[0] <= bounds[1] else None


def _lights(renderer: Any) -> Iterator[dict[str, Any]]:
    for light in renderer.GetLights():
        if not light.GetSwitch():
            continue
        kind = _LIGHTS[light.GetLightType()]
        # Lights of the camera are given where it stands at (0, 0, 1) and looks at the origin
        yield {
            "kind": kind,
            "color": [channel * light.GetIntensity() for channel in light.GetDiffuseColor()],
            "position": list(light.GetPosition()) if kind != "head" else [0, 0, 1],
            "focalPoint": list(light.GetFocalPoint()) if kind != "head" else [0, 0, 0],
            "positional": bool(light.GetPositional()),
            "cone": light.GetConeAngle(),
            "exponent": light.GetExponent(),
            "attenuation": list(light.GetAttenuationValues()),
        }


def _environment(renderer: Any) -> list[str]:
    """Name what is drawn around a renderer's props, and cannot be shown."""
    left_out = []
    if renderer.GetPass() is not None:
        left_out.append(f"its render pass ({renderer.GetPass().GetClassName()})")
    if renderer.GetUseHiddenLineRemoval():
        left_out.append("hidden line removal")
    if renderer.GetUseShadows():
        left_out.append("shadows")
    return left_out


def _background(renderer: Any, left_out: list[str]) -> str:
    """Return a renderer's background as CSS."""
    if renderer.GetTexturedBackground():
        left_out.append("the background's texture")
    color = css(renderer.GetBackground())
    if not renderer.GetGradientBackground():
        return color
    direction = _GRADIENTS.get(renderer.GetGradientMode())
    if direction is None:
        left_out.append("the background's radial gradient")
        return color
    return f"linear-gradient({direction}, {color}, {css(renderer.GetBackground2())})"


def css(color: Sequence[float]) -> str:
    """Return RGB from 0 to 1 as CSS."""
    return f"rgb({' '.join(f'{100 * channel:g}%' for channel in color)})"
