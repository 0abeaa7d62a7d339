"""A renderer's scene as the viewer shows it: VDIs among meshes, lines, points and texts."""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.extensions.web.camera import MOST_PLANES, viewer_camera
from pyvista_vdi.extensions.web.placing import encoded, look_of, planes_of, thinned
from pyvista_vdi.extensions.web.scenes.annotations import annotations_of
from pyvista_vdi.extensions.web.scenes.meshes import shapes_of
from pyvista_vdi.extensions.web.scenes.names import Names, is_silhouette, passes_of, widgets_of
from pyvista_vdi.extensions.web.scenes.props import (
    MOST_LIGHTS,
    bounds_of,
    image_quad,
    lights_of,
    parts_of,
)
from pyvista_vdi.extensions.web.scenes.renderers import around, flat_of, others_of
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.vtk import vtkActor, vtkImageActor

#: The numbers of a scene's arrays in JavaScript: their names there, by NumPy's.
_KINDS = {
    "float32": "Float32Array",
    "int16": "Int16Array",
    "uint8": "Uint8Array",
    "uint32": "Uint32Array",
}

#: Actors that turn or scale with the view, which the viewer's matrices do not.
_NOT_PLAIN = ("vtkFollower", "vtkProp3DFollower", "vtkAxisFollower")

#: How gradients begin in CSS, by vtkViewport's modes.
_GRADIENTS = (
    "linear-gradient(to top",
    "linear-gradient(to right",
    "radial-gradient(farthest-side",
    "radial-gradient(farthest-corner",
)


@dataclass
class Scene:
    """What is shown of a renderer."""

    vdi: VDI | None  # the first one, if there is one
    actors: list[Any]  # those that show VDIs, the first one's first
    state: Any  # of :func:`state_of`, where the viewer goes on to follow the renderer
    data: bytes  # all the rest, as scene.js takes it
    background: str  # as CSS has it
    left_out: list[str]  # what is not shown, by name

    @property
    def actor(self) -> Any:
        """The actor of the first VDI, or ``None``."""
        return next(iter(self.actors), None)


@dataclass
class _Packed:
    """Arrays one behind the other."""

    arrays: list[NDArray[Any]] = field(default_factory=list)
    numbers: dict[tuple[str, bytes], int] = field(default_factory=dict)

    def keep(self, array: NDArray[Any]) -> int:
        """Take an array, and return its number."""
        array = np.ascontiguousarray(array)
        key = (array.dtype.name, array.tobytes())
        if key not in self.numbers:  # of parts that are alike once
            self.numbers[key] = len(self.arrays)
            self.arrays.append(array)
        return self.numbers[key]

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
    """Return what a renderer that has been drawn shows, for the viewer.

    ``names``: what its props are called. ``camera``: the viewer begins with its view, of which
    VDIs are made where their volumes are at hand.
    ``needs_vdi``: one without VDIs is refused by UnsupportedError.
    """
    called, packed, left_out = Names(names or {}, renderer), _Packed(), _environment(renderer)
    shapes: list[dict[str, Any]] = []
    texts: list[dict[str, Any]] = []
    bodies: list[tuple[VDI, dict[str, Any]]] = []
    actors: list[Any] = []
    others = list(others_of(renderer, packed.keep, texts, left_out))
    for prop in renderer.GetViewProps():
        # A scalar bar that can be moved is a prop of its own
        if not prop.GetVisibility() or prop.IsA("vtkScalarBarRepresentation"):
            continue
        missing = ["the outlines of other views than the first"] * is_silhouette(prop)
        known = True
        for part, matrix in parts_of(prop):
            if isinstance(part, VDIActorMethods):
                vdi = _vdi_of(part, renderer if camera else None, matrix)
                if vdi is not None:
                    bodies.append((vdi, _limits(part, vdi.bounds, matrix, missing)))
                    actors.append(part)
            elif (solid := _solid(part)) is not None:
                shapes += shapes_of(solid, matrix, packed.keep, missing)
            elif (written := annotations_of(part, renderer)) is not None:
                group = len(texts) + 1
                texts += [{**text, "alone": group} if "alone" in text else text for text in written]
            elif (flat := flat_of(part, renderer, packed.keep, missing)) is not None:
                others += [flat[0]] if flat[0] else []
                texts += flat[1]
            else:
                known = False
        if not known:
            left_out.append(called.of_missing(prop))
        left_out += [f"{what} ({called.of(prop)})" for what in missing]
    # The viewer plays the first one's series, and follows its set
    several = [actor.series is not None or actor.vdi_set is not None for actor in actors]
    if any(several):
        for those in (bodies, actors):
            those.insert(0, those.pop(several.index(True)))
    if not bodies and needs_vdi:
        raise UnsupportedError("the renderer shows no VDI, so there is nothing for the viewer")
    left_out += [f"the interaction of {method}" for method in widgets_of(renderer)]
    described = [{**more, "file": None} for _, more in bodies]
    for (vdi, _), entry in zip(bodies[1:], described[1:], strict=True):
        entry["file"] = packed.keep(np.frombuffer(encoded(vdi, coarse=True), np.uint8))
    if renderer.GetUseDepthPeeling() and any(shape["translucent"] for shape in shapes):
        left_out.append("enable_depth_peeling")
    lights, ground = list(lights_of(renderer)), _ground(renderer)
    if len(lights) > MOST_LIGHTS:
        left_out.append(f"{len(lights) - MOST_LIGHTS} of its lights (add_light)")
    head = {
        "camera": viewer_camera(renderer.GetActiveCamera(), renderer.GetSize()) if camera else None,
        "size": list(renderer.GetSize()),
        "ground": ground if renderer.GetGradientMode() == 0 else [np.mean(ground, 0).tolist()] * 2,
        "bounds": bounds_of(renderer),
        "lights": lights,
        "shapes": shapes,
        "renderers": others,
        "texts": texts,
        "vdis": described,
    }
    return Scene(
        vdi=bodies[0][0] if bodies else None,
        actors=actors,
        state=None if camera else state_of(renderer),
        data=packed.deflated(head),
        background=_background(renderer, left_out),
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
    others = [
        (other.GetAddressAsString(""), other.GetViewport(), *other.GetViewProps())
        for other in around(renderer)
    ]
    lights = json.dumps(list(lights_of(renderer)))
    background = _background(renderer, [])
    return tuple(states), tuple(renderer.GetSize()), lights, background, tuple(others)


def _solid(part: Any) -> Any:
    """Return the actor by which a part of a scene is drawn in space; ``None`` if by none."""
    if isinstance(part, vtkImageActor):
        return image_quad(part)
    return part if isinstance(part, vtkActor) and _is_plain(part) else None


def _is_plain(prop: Any) -> bool:
    shader = prop.GetShaderProperty()
    changed = shader is not None and (
        shader.GetNumberOfShaderReplacements() or shader.HasFragmentShaderCode()
    )
    return prop.GetMapper() is not None and not changed and not any(map(prop.IsA, _NOT_PLAIN))


def _vdi_of(actor: Any, renderer: Any, matrix: NDArray[np.float64]) -> VDI | None:
    """Return an actor's VDI as it is shown: of the renderer's view, if one is given."""
    mapper = actor.GetMapper()
    begins = renderer is not None and mapper is not None
    vdi = mapper.driver.vdi_of_view(renderer, matrix) if begins else actor.vdi
    return None if vdi is None else thinned(vdi, actor.opacity_multiplier)


def _limits(
    actor: Any, bounds: Sequence[float], matrix: NDArray[np.float64], missing: list[str]
) -> dict[str, Any]:
    """Return where a VDI is, and the planes that cut it."""
    planes = planes_of(actor)
    cropping = Cropping.from_any(actor.GetMapper())
    if cropping is not None:
        sides = _sides(cropping, bounds, matrix)
        if sides is None or len(planes) + len(sides) > MOST_PLANES:
            missing.append("cropping")
        else:
            planes += sides
    if len(planes) > MOST_PLANES:
        missing.append(f"{len(planes) - MOST_PLANES} of its clipping planes")
    return {"planes": planes[:MOST_PLANES], "matrix": matrix.tolist()}


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


def _environment(renderer: Any) -> list[str]:
    """Name what is drawn around a renderer's props, and cannot be shown."""
    left_out = list(passes_of(renderer))
    if renderer.GetUseHiddenLineRemoval():
        left_out.append("enable_hidden_line_removal")
    window = renderer.GetRenderWindow()
    if window is not None and window.GetStereoRender():
        left_out.append("enable_stereo_render")
    if renderer.GetUseShadows():
        left_out.append("enable_shadows")
    return left_out


def _background(renderer: Any, left_out: list[str]) -> str:
    """Return a renderer's background as CSS."""
    if renderer.GetTexturedBackground():
        left_out.append("the background's texture (set_environment_texture)")
    low, high = map(css, _ground(renderer))
    return low if low == high else f"{_GRADIENTS[renderer.GetGradientMode()]}, {low}, {high})"


def _ground(renderer: Any) -> list[list[float]]:
    """Return the colours at both ends of a renderer's background, the lower or inner one first."""
    if any(other.GetLayer() < renderer.GetLayer() for other in around(renderer)):
        return [[0.0, 0.0, 0.0]] * 2  # nothing clears the window but the lowest layer
    low, high = list(renderer.GetBackground()), list(renderer.GetBackground2())
    return [low, high if renderer.GetGradientBackground() else low]


def css(color: Sequence[float]) -> str:
    """Return RGB from 0 to 1 as CSS."""
    return f"rgb({' '.join(f'{100 * channel:g}%' for channel in color)})"
