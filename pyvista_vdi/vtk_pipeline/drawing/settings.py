"""What a user sets of a mapper: one record, from whose fields VTK's Set and Get follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.cropping import checked_opacity_multiplier
from pyvista_vdi.model.options import Options, option, record
from pyvista_vdi.model.render_options import (
    TRANSMITTANCE_CUTOFF,
    Policy,
    checked_bound,
    checked_draw,
    checked_policy,
    checked_rate,
    checked_transmittance_cutoff,
)
from pyvista_vdi.raycasting.picking import checked_opacity

_Class = TypeVar("_Class", bound=type)


def _image_distance(value: Any) -> float:
    distance = as_float(value)
    if isinstance(value, bool) or not 1 <= distance <= 100:
        raise InvalidArgumentError(
            f"the image sample distance must be a number from 1 to 100; got {value!r}"
        )
    return distance


def _or_none(check: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: None if value is None else check(value)


@record
@dataclass(frozen=True)
class Settings(Options):
    """What a user sets of a mapper; each text says what ``Set`` and the name in ``_NAMES`` do."""

    draw: Literal["auto", "vdi", "volume"] = option(
        "auto",
        'what is raycast where the volume is at hand. ``"auto"``: in windows that somebody '
        "watches, each frame by what is expected to give the better picture within the frame rate, "
        "and at rest by what is there sooner; a VDI is made at rest, where the volume's own full "
        "frames miss the rate or the device holds it brick by brick. Elsewhere the volume, until "
        "so many pictures of nearly the same view were taken that a VDI of it costs less, and then "
        "that as long as its picture is like the volume's (``SetRegenerateBelow``): pictures "
        'depend on scene, view and the pictures before, never on time. ``"vdi"``: always the VDI. '
        '``"volume"``: always the volume; a VDI is made only when one is asked for. Volumes that '
        "overlap in the picture are drawn by VDIs, off-screen by such as are of that view. In "
        "windows, a volume that the device holds brick by brick is drawn by its VDI",
        checked_draw,
    )
    regenerate: Policy = option(
        "auto",
        'what decides that a view needs a VDI of its own. ``"auto"``: an estimate of the view\'s '
        'error, where somebody watches the window. ``"never"``: only ``actor.regenerate()``. A '
        "callable gets a :class:`~pyvista_vdi.vtk_pipeline.VDIStatus` once per frame and says "
        "whether to regenerate; its ``ssim`` is ``None``, because it is asked in place of the "
        "estimate",
        checked_policy,
    )
    regenerate_below: float | None = option(
        None,
        'the estimated SSIM below which a VDI does not do for a view. ``SetRegenerate("auto")`` '
        'makes another of a view at rest in a watched window; ``SetDraw("auto")`` draws the volume '
        "in its place, where that is at hand. ``None`` is 0.95 for the former; for the latter it "
        "is 0.98, contrast within 4 x 4 pixels that differs by a tenth at most, and lists no wider "
        "than 1.25 pixels",
        _or_none(checked_bound),
    )
    automatic_view: bool = option(
        True, "whether the view of the first frame is taken for a source without camera"
    )
    opacity_multiplier: float = option(
        1.0,
        "the factor of the extinction of everything that is drawn. It acts on the next frame, "
        "without another VDI: 2 is twice as dense, 0 transparent. For what is not opaque it is the "
        "same as dividing the volume property's scalar opacity unit distance by it; changing that "
        "itself makes the VDI anew",
        checked_opacity_multiplier,
    )
    transmittance_cutoff: float = option(
        TRANSMITTANCE_CUTOFF,
        "the light below which rays end. No channel of the picture loses more than that. VTK's own "
        "volume mappers stop at about 1/255. VDIs that overlap are merged to the default, whatever "
        "is set here",
        checked_transmittance_cutoff,
    )
    image_distance: float = option(
        1.0,
        "for how many pixels along each edge a ray is cast, 1 to 100. The picture is interpolated "
        "linearly, as by VTK's mappers. Previews have fewer rays where the frame rate asks for it",
        _image_distance,
    )
    picking_opacity: float = option(
        0.05,
        "the opacity that a ray must reach in the VDI to pick it, at least 0 and less than 1; the "
        "default is that of VTK's pickers for volumes. What is compared says "
        "``SetPickingAccumulated``; see :func:`pyvista_vdi.pick`",
        checked_opacity,
    )
    picking_accumulated: bool = option(
        True, "whether the opacity from the ray's beginning is compared, or each supersegment's"
    )
    adjust: bool = option(
        True,
        "whether previews of fewer pixels are drawn while the view moves. Frames in a window whose "
        "desired update rate is at least ``GetInteractiveUpdateRate()`` are interactive: the "
        "window's interactor sets that rate while its style turns, pans or zooms. Frames at rest, "
        "screenshots, exports and off-screen windows are always full",
        bool,
    )
    adjust_multi_samples: bool = option(
        True,
        "whether previews are drawn without multisampling where that makes them late. Where OpenGL "
        "is software, multisampling takes most of a frame, and a VDI has no edges that it would "
        "smooth: so it is given up before rays are. Frames at rest, screenshots, exports and "
        "off-screen windows have the window's ``GetMultiSamples()``, which is left as it was set. "
        "With several VDIs in a window all of them must allow it",
        bool,
    )
    update_rate: float = option(
        1.0,
        "the window's desired update rate from which on a frame is interactive, 1/s; as in "
        "``vtkSmartVolumeMapper``",
        lambda rate: checked_rate("the interactive update rate", rate),
    )
    target: float | None = option(
        None,
        "the frames per second that previews keep. ``None`` means the window's desired update "
        "rate, which the interactor gives (``SetDesiredUpdateRate``: 15 in VTK, 30 in PyVista); 0 "
        "means that no rate is to be kept, so that every frame is full. Several VDIs in a window "
        "keep the highest of their targets",
        _or_none(lambda rate: checked_rate("the target frame rate", rate)),
    )
    off_screen: bool | None = option(
        None,
        "whether off-screen windows are treated as if somebody watched them. ``None``: those are "
        "that a browser shows through a remote view of trame, as in notebooks: previews are drawn, "
        "and VDIs are made in the background",
        _or_none(bool),
    )

    @property
    def previews(self) -> bool:
        """Whether a frame of a motion may have fewer rays."""
        return self.adjust and self.target != 0


#: What VTK's methods call the settings.
_NAMES = {
    "draw": "Draw",
    "regenerate": "Regenerate",
    "regenerate_below": "RegenerateBelow",
    "automatic_view": "AutomaticView",
    "opacity_multiplier": "OpacityMultiplier",
    "transmittance_cutoff": "TransmittanceCutoff",
    "image_distance": "ImageSampleDistance",
    "picking_opacity": "PickingOpacity",
    "picking_accumulated": "PickingAccumulated",
    "adjust": "AutoAdjustSampleDistances",
    "adjust_multi_samples": "AutoAdjustMultiSamples",
    "update_rate": "InteractiveUpdateRate",
    "target": "TargetFrameRate",
    "off_screen": "InteractiveOffScreen",
}


def with_settings(cls: _Class) -> _Class:
    """Give a class of mappers VTK's Set and Get of each setting."""
    for field, name in _NAMES.items():
        told = Settings.declared[field]
        for method in (_set(field, name, told), _get(field, name, told)):
            method.__qualname__ = f"{cls.__name__}.{method.__name__}"
            setattr(cls, method.__name__, method)
    return cls


def _set(field: str, name: str, told: Any) -> Callable[..., None]:
    def method(self: Any, value: Any) -> None:
        if self._driver is not None and self._driver.set(**{field: value}):
            self.Modified()  # PyVista's constructor sets some before there is a driver

    method.__name__ = f"Set{name}"
    refused = "\n\nRaises\n------\nInvalidArgumentError\n    If it is something else.\n"
    method.__doc__ = f"Set {told.what}; ``{told.standard!r}`` by default.{refused}"
    return method


def _get(field: str, name: str, told: Any) -> Callable[..., Any]:
    def method(self: Any) -> Any:
        return getattr(self.driver.settings, field)

    method.__name__ = f"Get{name}"
    method.__doc__ = f"Return {told.what.partition('. ')[0]}."
    return method
