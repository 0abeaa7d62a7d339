"""Lights, and how a shaded volume reflects them: what VTK's GPU volume mapper computes.

A sample's normal is the direction in which the scalar grows. What a VDI is lit by is baked into
its colours when it is generated (docs/dev/conventions.md, "Lighting").
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, Vector, unit
from pyvista_vdi.model.checks import Number, as_flag, as_vector, one_of


@dataclass(frozen=True)
class Shading:
    """How a volume reflects light: a ``vtkVolumeProperty``'s coefficients and defaults.

    Attributes
    ----------
    ambient, diffuse, specular : float
        Coefficients, 0 or above.
    specular_power : float
        Exponent of the highlight, 0 or above.
    """

    ambient: float = 0.1
    diffuse: float = 0.7
    specular: float = 0.2
    specular_power: float = 10.0

    def __post_init__(self) -> None:
        for name, value in vars(self).copy().items():
            object.__setattr__(self, name, Number()(value, name))


@dataclass(frozen=True)
class Light:
    """A light, as a ``vtkLight`` describes it.

    Attributes
    ----------
    kind : {"headlight", "camera", "scene"}
        A headlight stands at the eye; a camera light's position and focal point are relative to
        the camera, whose eye is (0, 0, 1) and whose focal point is (0, 0, 0) there; a scene
        light's are world coordinates.
    position, focal_point : (float, float, float)
        Where it is and where it shines to. A headlight's are not its own, since VTK writes the
        eye of each frame there: they are kept as the defaults.
    ambient, diffuse, specular : (float, float, float)
        Colours, each multiplied by ``intensity``.
    positional : bool
        Whether it shines from its position, or from infinitely far in one direction.
    attenuation : (float, float, float)
        Of a positional light: 1 / (a + b d + c d^2) at distance d, world units.
    cone_angle : float
        Half angle of a positional light's cone, degrees; above 90 it shines everywhere.
    exponent : float
        How a cone's light falls off towards its edge.
    intensity : float
        Of all three colours; VTK shades by a lone headlight its own way only where this is 1.
    """

    kind: str = "headlight"
    position: Vector = (0.0, 0.0, 1.0)
    focal_point: Vector = (0.0, 0.0, 0.0)
    ambient: Vector = (0.0, 0.0, 0.0)
    diffuse: Vector = (1.0, 1.0, 1.0)
    specular: Vector = (1.0, 1.0, 1.0)
    positional: bool = False
    attenuation: Vector = (1.0, 0.0, 0.0)
    cone_angle: float = 30.0
    exponent: float = 1.0
    intensity: float = 1.0

    def __post_init__(self) -> None:
        one_of(self.kind, "a light's kind", ("headlight", "camera", "scene"))
        put = object.__setattr__
        for name in ("position", "focal_point", "ambient", "diffuse", "specular", "attenuation"):
            put(self, name, as_vector(getattr(self, name), f"a light's {name}"))
        finite = Number(low=-math.inf, open_ended=True)
        for name in ("cone_angle", "exponent", "intensity"):
            put(self, name, finite(getattr(self, name), f"a light's {name}"))
        put(self, "positional", as_flag(self.positional, "a light's positional"))
        if self.kind == "headlight":  # wherever the eye is, it is the same light
            put(self, "position", Light.position)
            put(self, "focal_point", Light.focal_point)
        if self.position == self.focal_point:
            raise InvalidArgumentError(
                f"a light at {self.position} has its focal point there: it shines nowhere"
            )

    @classmethod
    def from_any(cls, light: Any) -> Light:
        """Return a ``Light``, ``vtkLight`` or ``pyvista.Light`` as a :class:`Light`."""
        if isinstance(light, Light):
            return light
        if not hasattr(light, "GetTransformedPosition"):
            raise InvalidArgumentError(
                "a light must be a Light, a vtkLight or a pyvista.Light; "
                f"got {type(light).__name__}"
            )
        of_camera = "camera" if light.LightTypeIsCameraLight() else "scene"
        kind = "headlight" if light.LightTypeIsHeadlight() else of_camera
        # The matrix of one that follows the camera is what VTK last made of the camera
        own = "Transformed" if kind == "scene" else ""
        names = [f"{own}Position", f"{own}FocalPoint"]
        names += ["AmbientColor", "DiffuseColor", "SpecularColor"]
        names += ["Positional", "AttenuationValues", "ConeAngle", "Exponent", "Intensity"]
        return cls(kind, *(getattr(light, f"Get{name}")() for name in names))

    def in_view(self, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position and unit direction of travel in view space, float64 (3,) each."""
        if self.kind == "headlight":
            return np.zeros(3), np.array([0.0, 0.0, 1.0])
        ends = np.array([self.position, self.focal_point])
        if self.kind == "scene":
            ends = (ends - camera.position) @ camera.axes.T
        else:
            distance = np.linalg.norm(np.subtract(camera.focal_point, camera.position))
            ends = distance * ((0, 0, 1) + ends * (1, 1, -1))
        return ends[0], unit(ends[1] - ends[0])


@dataclass(frozen=True)
class Lights:
    """What a volume is lit by.

    Attributes
    ----------
    lights : tuple of Light
        One headlight by default.
    two_sided : bool
        Whether a side that faces away from a light is lit as if it faced it (VTK's default).
    """

    lights: tuple[Light, ...] = (Light(),)
    two_sided: bool = True

    @classmethod
    def from_any(cls, lights: Any) -> Lights:
        """Return what a user calls lights.

        ``None`` is one headlight. Of a renderer, the lights that are switched on are taken as they
        are now, and a headlight where none is on, which is what VTK would make.
        """
        if lights is None:
            return cls()
        if isinstance(lights, Lights):
            return lights
        if hasattr(lights, "GetTwoSidedLighting"):
            on = tuple(Light.from_any(each) for each in lights.GetLights() if each.GetSwitch())
            made = (Light(),) if not on and lights.GetAutomaticLightCreation() else on
            return cls(made, bool(lights.GetTwoSidedLighting()))
        if not np.iterable(lights) or isinstance(lights, str | Mapping):
            raise InvalidArgumentError(
                "lights must be Light or vtkLight objects, or the renderer whose lights are "
                f"meant; got {type(lights).__name__}"
            )
        return cls(tuple(Light.from_any(light) for light in lights))

    @property
    def headlight_only(self) -> bool:
        """Whether there is one headlight and nothing else: VTK shades this case its own way.

        Of intensity 1; a dimmed one is a light like others to VTK, a positional one is not.
        """
        return [(light.kind, light.intensity) for light in self.lights] == [("headlight", 1.0)]

    @property
    def of_scene(self) -> bool:
        """Whether any light stands in the world, and does not follow the camera."""
        return any(light.kind == "scene" for light in self.lights)
