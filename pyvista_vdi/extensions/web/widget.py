"""``VDIWidget``: the viewer in a notebook's output, which shares its camera with the kernel."""

from __future__ import annotations

import io
import os
import secrets
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError, MissingDependencyError
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.camera import MOST_PLANES, camera_of, viewer_camera
from pyvista_vdi.extensions.web.page import check_controls, edited, refuse_look, several
from pyvista_vdi.extensions.web.placing import EFFORT, bare
from pyvista_vdi.extensions.web.still import picture, stand_in, still
from pyvista_vdi.io import write_png
from pyvista_vdi.io.vdi_file.layout import DEFLATE
from pyvista_vdi.io.vdi_file.writer import write_to
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.packing import DEPTH_CODES
from pyvista_vdi.model.render_options import checked_planes
from pyvista_vdi.model.vdi import VDI, picture_view

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise MissingDependencyError(
        "a VDI is turned in a notebook by anywidget, which is not installed: "
        'pip install "pyvista-vdi[notebook]"'
    ) from error

#: What anywidget calls in the page: a view of the model that the kernel's widget is.
_RENDER = """
function render({ model, el }) {
  const viewer = document.createElement(NAME);
  const [width, height] = model.get("_picture_size");
  viewer.style.cssText =
    `display: block; width: 100%; max-width: ${width}px; aspect-ratio: ${width} / ${height}`;
  let known = ""; // the camera that both sides have, as text
  let told = 0; // the frame before which the kernel will be told
  const takeCamera = () => {
    const camera = model.get("camera");
    const text = JSON.stringify(camera);
    if (text === known) return;
    known = text;
    viewer.camera = camera;
  };
  const tellCamera = () => {
    told = 0;
    const text = JSON.stringify(viewer.camera);
    if (text === known) return;
    known = text;
    model.set("camera", JSON.parse(text));
    model.save_changes();
  };
  const onCamera = () => {
    told = told || requestAnimationFrame(tellCamera);
  };
  let timed = false; // whether there is a series, which begins at the kernel's time
  const takeTime = () => {
    const time = model.get("time");
    if (timed && time !== null && viewer.time !== time) viewer.time = time;
  };
  const onStep = () => {
    if (timed) return;
    timed = true;
    takeTime();
  };
  const tellTime = ({ detail }) => { // of a step that stays
    if (!timed || !detail.full || viewer.playing || viewer.time === model.get("time")) return;
    model.set("time", viewer.time);
    model.save_changes();
  };
  const takeBackground = () => {
    viewer.background = model.get("_gradient") || (model.get("background") ?? "transparent");
  };
  const takePlanes = () => {
    // A scene has its own
    const planes = model.get("_scene")?.byteLength ? [] : model.get("clipping_planes");
    viewer.clippingPlanes =
      planes.map((plane) => ({ origin: plane.slice(0, 3), normal: plane.slice(3) }));
  };
  const bytesOf = ({ buffer, byteOffset, byteLength }) =>
    new Uint8Array(buffer, byteOffset, byteLength);
  const takeControls = () => viewer.setAttribute("controls", model.get("controls"));
  const takeScene = () => {
    const packed = model.get("_scene"); // of a plotter
    if (packed?.byteLength) viewer.scene = new Scene(bytesOf(packed));
  };
  const takeFile = () => {
    const file = bytesOf(model.get("_file")); // of a subplot without VDIs there is none
    timed = false;
    if (file.length) viewer.showBytes(file).catch(() => {}); // the viewer says what is wrong
  };
  el.replaceChildren(viewer);
  const key = model.get("_key"); // what stands in for the viewer has it, too: still.py
  (globalThis.pyvistaVDIs ??= new Set()).add(key);
  document.querySelectorAll(`img[data-vdi="${key}"]`).forEach((picture) => picture.remove());
  const taken = {
    background: takeBackground, _gradient: takeBackground, clipping_planes: takePlanes,
    controls: takeControls, _scene: takeScene, _file: takeFile, camera: takeCamera, time: takeTime,
  };
  for (const [name, take] of Object.entries(taken)) {
    take();
    model.on(`change:${name}`, take);
  }
  viewer.addEventListener("camerachange", onCamera);
  viewer.addEventListener("vditime", onStep);
  viewer.addEventListener("framedrawn", tellTime);
  const link = model.get("_link");
  if (link) {
    viewer.dataset.link = link;
    turnTogether(viewer);
  }
  return () => {
    cancelAnimationFrame(told);
    for (const [name, take] of Object.entries(taken)) model.off(`change:${name}`, take);
    viewer.remove();
  };
}
export default { render };
"""


#: Another element: in the page there may already be one that can neither play nor edit.
_NAMED = """
const NAME = "vdi-viewer-of-%s";
if (!customElements.get(NAME)) customElements.define(NAME, class extends VDIViewer {});
"""

_PLAIN = 'const NAME = "vdi-viewer";\n'


class _CameraTrait(traitlets.TraitType[dict[str, Any], Any]):
    """A camera in the viewer's form; whatever is a camera becomes one."""

    def validate(self, obj: Any, value: Any) -> dict[str, Any]:
        return viewer_camera(value, obj._picture_size)


class _ColorTrait(traitlets.TraitType["str | None", Any]):
    """A colour as ``#rrggbb``, or ``None``."""

    def validate(self, obj: Any, value: Any) -> str | None:
        return None if value is None else _hex(value)


class _PlanesTrait(traitlets.TraitType[list[list[float]], Any]):
    """Clipping planes as lists of six numbers."""

    def validate(self, obj: Any, value: Any) -> list[list[float]]:
        planes = [list(plane) for plane in checked_planes(value)]
        if len(planes) > MOST_PLANES:
            raise InvalidArgumentError(
                f"clipping_planes: the viewer clips a VDI to {MOST_PLANES} planes at most; "
                f"got {len(planes)}"
            )
        return planes


class VDIWidget(anywidget.AnyWidget):
    """A VDI, a series or a set in a notebook's output, turned in the browser, where it plays.

    Its camera is one with the browser's: what is turned there is read here in another cell, and
    what is set here is seen there. Nothing is fetched from elsewhere: viewer and VDI are in the
    widget. The cell's output holds a picture besides, for what shows notebooks without running
    them.

    Parameters
    ----------
    vdi : VDI, DeferredVDI, VDISeries, VDISet or vtkImageData
        What to show, or a VDI's VTK form (``pyvista.read("x.vdi")``). All of a series or a set is
        sent to the browser. The transfer function of a deferred VDI is edited there.
    camera : Camera or pyvista.Camera or vtkCamera or dict, optional
        The first view; by default the VDI's own.
    background : str or (float, float, float), optional
        ``"white"``, ``"#204060"`` or RGB from 0 to 1; by default the page shows through.
    precision : {"8-byte", "exact"}, optional
        What a supersegment of a VDI takes on its way to the browser, see
        :meth:`pyvista_vdi.VDI.with_precision`; by default 8 bytes, or what it has where lists are
        too long for that. Series and sets take 8 bytes.
    controls : {"all", "none"}
        Whether there is a bar of buttons over the picture, which fades.
    **look
        What the transfer function of a deferred VDI begins with, as for
        :meth:`pyvista_vdi.DeferredVDI.classified`: ``cmap``, ``opacity``, ``clim`` and others.
        Pictures of the kernel, :meth:`screenshot` too, are by this one.

    Attributes
    ----------
    camera : dict
        ``position``, ``focal_point``, ``view_up`` (world units), and ``view_angle`` (vertical,
        degrees) or ``parallel_scale`` (world units). Any camera can be set:
        ``widget.camera = plotter.camera``. A traitlet: ``widget.observe(function, "camera")`` is
        told of each change.
    background : str or None
        ``#rrggbb``; whatever the argument takes can be set. A traitlet.
    clipping_planes : list of list of float
        Origin and normal of each plane, world coordinates; the side that the normal points to is
        kept. Anything of the shape (k, 6) can be set, or ``None``. A traitlet.
    time : float or None
        Of a series the time that is shown: that of the step at which it was paused in the browser,
        and the nearest to what is set here. A traitlet.
    controls : str
        As the argument. A traitlet.

    Raises
    ------
    InvalidVDIError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.
    UnsupportedError
        If a look is given to what has colours.

    Examples
    --------
    >>> from pyvista_vdi.extensions.web import VDIWidget  # doctest: +SKIP
    >>> widget = VDIWidget(vdi, background="white")  # doctest: +SKIP
    >>> widget  # doctest: +SKIP
    """

    _has_scene = False
    _file = traitlets.Bytes().tag(sync=True)
    _scene = traitlets.Bytes().tag(sync=True)  # what else a plotter shows
    _gradient = traitlets.Unicode("").tag(sync=True)  # CSS of a plotter's background
    _picture_size = traitlets.List(traitlets.Int(), [1, 1]).tag(sync=True)
    _key = traitlets.Unicode("").tag(sync=True)
    _link = traitlets.Unicode("").tag(sync=True)  # of those that turn together
    time = traitlets.Float(None, allow_none=True).tag(sync=True)
    camera = _CameraTrait(allow_none=False).tag(sync=True)
    background = _ColorTrait(None, allow_none=True).tag(sync=True)
    clipping_planes = _PlanesTrait([]).tag(sync=True)
    controls = traitlets.Enum(["all", "none"], "all").tag(sync=True)

    def __init__(
        self,
        vdi: Any,
        *,
        camera: Any = None,
        background: Any = None,
        precision: str | None = None,
        controls: str = "all",
        **look: Any,
    ) -> None:
        check_controls(controls)
        self._precision, self._first_look = precision, look
        self._vdi = shown = self._accept(vdi)
        if not isinstance(shown, DeferredVDI):
            refuse_look(look)
        self._esm = self._script(shown)
        super().__init__(
            _file=self._encoded(shown),
            _picture_size=_size_of(shown),
            _key=secrets.token_hex(8),
            camera=picture_view(shown)[0] if camera is None else camera,
            time=shown.times[0] if isinstance(shown, VDISeries) else None,
            background=background,
            controls=controls,
        )

    @property
    def vdi(self) -> Any:
        """The VDI, series or set that is shown; another takes its place whole, the camera stays."""
        return self._vdi

    @vdi.setter
    def vdi(self, vdi: Any) -> None:
        shown = self._accept(vdi)
        if isinstance(shown, VDISeries | VDISet | DeferredVDI):
            self._esm = self._script(shown)  # views are made anew where it is another
        self._file = self._encoded(shown, coarse=False)  # the one before is better meanwhile
        self._vdi = shown
        series = isinstance(shown, VDISeries)
        self.time = shown.times[shown.nearest(self.time or 0.0)] if series else None

    def screenshot(
        self,
        filename: str | os.PathLike[str] | None = None,
        window_size: Sequence[int] | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture of the present view, drawn by the kernel's OpenCL device.

        A cell that runs cannot wait for the browser; this does not need one.

        Parameters
        ----------
        filename : path-like, optional
            A ``.png`` to write it to.
        window_size : (int, int), optional
            Width and height in pixels; by default what the VDI was made for.

        Returns
        -------
        numpy.ndarray
            uint8 (H, W, 3) RGB over the background, or without one (H, W, 4) straight RGBA; top
            row first.

        Raises
        ------
        NoDeviceError
            If there is no OpenCL device.
        VDIFileError
            If the file cannot be written.
        """
        background = _rgb(self.background)
        pixels = picture(self._now(), self.camera, window_size, background, self.clipping_planes)
        if filename is not None:
            write_png(pixels, filename)
        return pixels

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.vdi!r})"

    def _accept(self, vdi: Any) -> Any:
        """Return what can be shown, or raise InvalidVDIError."""
        if isinstance(vdi, DeferredVDI):
            self._begun = vdi.classified(**self._first_look)
            return vdi
        if isinstance(vdi, VDISeries | VDISet):
            if vdi.value_range is not None:
                of = "series" if isinstance(vdi, VDISeries) else "set"
                raise InvalidVDIError(
                    f"this {of} keeps values, which have no colours yet, and a widget edits those "
                    f"of one VDI alone: pass {of}.classified(cmap=..., opacity=...)"
                )
            as_vdi(vdi[0])
            return vdi
        return as_vdi(vdi)

    def _now(self) -> VDI:
        """Return the VDI that is seen: of a series the present step, of a set the nearest one."""
        shown = self._vdi
        if shown is None:
            raise InvalidVDIError("there is no VDI here: plotter.screenshot() is the picture")
        if isinstance(shown, DeferredVDI):
            return self._begun
        if isinstance(shown, VDISeries):
            return shown[shown.nearest(shown.times[0] if self.time is None else self.time)]
        return shown[shown.nearest(camera_of(self.camera))] if isinstance(shown, VDISet) else shown

    def _script(self, shown: Any) -> str:
        """Return what runs in the page: what plays series, chooses of a set, or edits values."""
        series, values = isinstance(shown, VDISeries | VDISet), isinstance(shown, DeferredVDI)
        script = viewer_script(scene=self._has_scene, series=series, values=values, module=True)
        name = _NAMED % "series" if series else _NAMED % "values" if values else _PLAIN
        return script + name + _RENDER

    def _encoded(self, vdi: Any, *, coarse: bool = True) -> bytes:
        if vdi is None:
            return b""
        if not isinstance(vdi, VDI | DeferredVDI):
            return several(vdi._mapped(bare), compression="deflate", level=EFFORT)[0]
        fits = self._precision is not None or vdi.counts.max() <= DEPTH_CODES
        sent: Any = vdi.with_precision(self._precision or "8-byte") if fits else vdi
        about = None
        if isinstance(sent, DeferredVDI):
            sent, about = edited(sent, self._begun)
        stream = io.BytesIO()
        # A cell waits for it: a twentieth more bytes than by level 6, in half the time
        write_to(stream, sent, DEFLATE, 1, coarse=coarse, deferred=about)
        return stream.getvalue()

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return the view, and a picture for where there can be no view."""
        data, metadata = super()._repr_mimebundle_(**kwargs)
        shown = self._still()
        if shown is None:
            return data, metadata
        stand_in(shown, self._key, self.model_id)
        return {**data, "image/png": shown}, metadata

    def _still(self) -> str | None:
        """Return that picture as base64 PNG, if it can be had."""
        return still(self._now(), self.camera, _rgb(self.background), self.clipping_planes)


def _size_of(shown: Any) -> list[int]:
    """Return width and height of what the viewer is made for."""
    first = shown[0] if isinstance(shown, VDISeries) else shown
    return [1, 1] if first is None else list(first.picture_size)


def _hex(color: Any) -> str:
    """Return a colour as ``#rrggbb``: of CSS, RGB from 0 to 1, or of PyVista."""
    from PIL import ImageColor

    try:
        if isinstance(color, str):
            values: tuple[int, ...] = ImageColor.getrgb(color)[:3]
        else:
            rgb = [float(value) for value in getattr(color, "float_rgb", color)]
            if len(rgb) != 3 or not all(0 <= value <= 1 for value in rgb):
                raise ValueError
            values = tuple(round(255 * value) for value in rgb)
    except (TypeError, ValueError):
        raise InvalidArgumentError(
            "a background is a name of CSS, '#rrggbb', or red, green and blue from 0 to 1; "
            f"got {color!r}"
        ) from None
    return "#" + "".join(f"{value:02x}" for value in values)


def _rgb(color: str | None) -> tuple[float, ...] | None:
    """Return the colour of ``#rrggbb`` as RGB from 0 to 1."""
    return None if color is None else tuple(value / 255 for value in bytes.fromhex(color[1:]))
