"""What a renderer's shapes are lit by, and the box that bounds them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

#: vtkLight's types.
_LIGHTS = {1: "head", 2: "camera", 3: "scene"}

#: Lights that the viewer looks at.
MOST_LIGHTS = 8


def bounds_of(renderer: Any) -> list[float] | None:
    """Return the box by which VTK sets its clipping range, which translucent layers depend on."""
    bounds = renderer.ComputeVisiblePropBounds()
    return list(bounds) if bounds[0] <= bounds[1] else None


def lights_of(renderer: Any) -> Iterator[dict[str, Any]]:
    """Return the lights that are on, as scene.js takes them."""
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
