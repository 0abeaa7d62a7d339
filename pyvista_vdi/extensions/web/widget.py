"""``VDIWidget``: the viewer in a notebook's output, which shares its camera with the kernel."""

from __future__ import annotations

import secrets
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, needing
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.web import shown as of_viewers
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.shown import MOST_PLANES, camera_of, viewer_camera
from pyvista_vdi.model.metrics import check_background
from pyvista_vdi.model.options import checked_planes
from pyvista_vdi.model.packing import DEPTH_CODES
from pyvista_vdi.model.vdi import picture_view

with needing('a VDI in a notebook is turned by anywidget: pip install "pyvista-vdi[notebook]"'):
    import anywidget
    import traitlets

#: What anywidget calls in the page: a view of the model that the kernel's widget is.
_RENDER = """
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

function render({ model, el }) {
  const viewer = document.createElement("vdi-viewer"), [width, height] = model.get("_picture_size");
  viewer.style.cssText =
    `display: block; width: 100%; max-width: ${width}px; aspect-ratio: ${width} / ${height}`;
  const bytesOf = (name) => {
    const { buffer, byteOffset, byteLength } = model.get(name) ?? new Uint8Array();
    return new Uint8Array(buffer, byteOffset, byteLength);
  };
  const tell = (name) => {
    if (same(viewer[name], model.get(name))) return;
    model.set(name, viewer[name]);
    model.save_changes();
  };
  let timed = false; // whether there is a series, which begins at the kernel's time
  let told = 0; // the frame before which the kernel will be told the camera
  const takeBackground = () => {
    viewer.background = model.get("_gradient") || (model.get("background") ?? "transparent");
  };
  const take = {
    background: takeBackground,
    _gradient: takeBackground,
    clipping_planes() { // a scene has its own
      const planes = bytesOf("_scene").length ? [] : model.get("clipping_planes");
      viewer.clippingPlanes = planes.map((p) => ({ origin: p.slice(0, 3), normal: p.slice(3) }));
    },
    _scene() { // of a plotter
      const packed = bytesOf("_scene");
      if (packed.length) viewer.scene = new Scene(packed);
    },
    _file() {
      timed = false;
      viewer.load(bytesOf("_file")).catch(() => {}); // the viewer says what is wrong
    },
    camera() {
      if (!same(viewer.camera, model.get("camera"))) viewer.camera = model.get("camera");
    },
    time() {
      const time = model.get("time");
      if (timed && time !== null && viewer.time !== time) viewer.time = time;
    },
  };
  el.replaceChildren(viewer);
  const stills = `img[data-vdi="${model.get("_key")}"]`; // of shown.py, where there is no view
  document.querySelectorAll(stills).forEach((picture) => picture.remove());
  for (const [name, taken] of Object.entries(take)) {
    taken();
    model.on(`change:${name}`, taken);
  }
  viewer.addEventListener("camerachange", () => {
    told ||= requestAnimationFrame(() => { told = 0; tell("camera"); });
  });
  viewer.addEventListener("vditime", () => {
    if (timed) return;
    timed = true;
    take.time();
  });
  viewer.addEventListener("framedrawn", ({ detail }) => { // of a step that stays
    if (timed && detail.full && !viewer.playing) tell("time");
  });
  return () => {
    cancelAnimationFrame(told);
    for (const [name, taken] of Object.entries(take)) model.off(`change:${name}`, taken);
    viewer.remove();
  };
}
export default { render };
"""


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
        sent to the browser. The transfer function of a DeferredVDI is edited there.
    camera : Camera or pyvista.Camera or vtkCamera or dict, optional
        The first view; by default the VDI's own.
    background : str or (float, float, float), optional
        ``"white"``, ``"#204060"`` or RGB from 0 to 1; by default the page shows through.
    **look
        What the transfer function of a DeferredVDI begins with, as for
        :meth:`pyvista_vdi.DeferredVDI.classified`: ``cmap``, ``opacity``, ``clim`` and others.

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

    _esm = viewer_script("scene.js", module=True) + _RENDER
    _file = traitlets.Bytes().tag(sync=True)
    _scene = traitlets.Bytes().tag(sync=True)  # what else a plotter shows
    _gradient = traitlets.Unicode("").tag(sync=True)  # CSS of a plotter's background
    _picture_size = traitlets.List(traitlets.Int(), [1, 1]).tag(sync=True)
    _key = traitlets.Unicode("").tag(sync=True)
    time = traitlets.Float(None, allow_none=True).tag(sync=True)
    camera = traitlets.Any().tag(sync=True)
    background = traitlets.Any(None).tag(sync=True)
    clipping_planes = traitlets.Any([]).tag(sync=True)

    def __init__(
        self,
        vdi: Any,
        *,
        camera: Any = None,
        background: Any = None,
        **look: Any,
    ) -> None:
        self._first_look = look
        self._vdi = shown = of_viewers.as_shown(vdi)
        super().__init__(
            _file=self._sent(shown),
            _picture_size=list(picture_view(shown)[1]),
            _key=secrets.token_hex(8),
            camera=picture_view(shown)[0] if camera is None else camera,
            time=shown.times[0] if isinstance(shown, VDISeries) else None,
            background=background,
        )

    @traitlets.validate("camera")
    def _check_camera(self, proposal: Any) -> dict[str, Any]:
        return viewer_camera(proposal.value, self._picture_size)

    @traitlets.validate("background")
    def _check_background(self, proposal: Any) -> str | None:
        return None if proposal.value is None else _hex(proposal.value)

    @traitlets.validate("clipping_planes")
    def _check_planes(self, proposal: Any) -> list[list[float]]:
        planes = [list(plane) for plane in checked_planes(proposal.value)]
        if len(planes) > MOST_PLANES:
            raise InvalidArgumentError(
                f"clipping_planes: the viewer clips a VDI to {MOST_PLANES} planes at most; "
                f"got {len(planes)}"
            )
        return planes

    @property
    def vdi(self) -> Any:
        """The VDI, series or set that is shown; another takes its place whole, the camera stays."""
        return self._vdi

    @vdi.setter
    def vdi(self, vdi: Any) -> None:
        shown = of_viewers.as_shown(vdi)
        self._file = self._sent(shown)
        self._vdi = shown
        steps = shown if isinstance(shown, VDISeries) else None
        self.time = None if steps is None else steps.times[steps.nearest(self.time or 0.0)]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.vdi!r})"

    def _sent(self, shown: Any) -> bytes:
        """Return the file that the browser is sent."""
        seen = of_viewers.seen_of(shown, **self._first_look)
        precision = "exact" if seen.counts.max() > DEPTH_CODES else None
        # A cell waits for it: a twentieth more bytes than by level 6, in half the time
        return of_viewers.file_of(shown, precision, 1, seen=seen)[0]

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        """Return the view, and a picture for where there can be no view."""
        data, metadata = super()._repr_mimebundle_(**kwargs)
        return of_viewers.with_still(data, self._still(), self._key), metadata

    def _still(self) -> str | None:
        """Return that picture as base64 PNG, if it can be had."""
        seen_by = {"camera": camera_of(self.camera), "time": self.time}
        seen = of_viewers.seen_of(self._vdi, **seen_by, **self._first_look)
        color, planes = self.background, self.clipping_planes
        rgb = None if color is None else [value / 255 for value in bytes.fromhex(color[1:])]
        return of_viewers.still(seen, self.camera, background=rgb, clipping_planes=planes)


def _hex(color: Any) -> str:
    """Return a colour as ``#rrggbb``: of CSS, RGB from 0 to 1, or of PyVista."""
    from PIL import ImageColor

    if not isinstance(color, str):
        rgb = check_background(getattr(color, "float_rgb", color))
        return "#" + bytes(round(255 * value) for value in rgb).hex()
    try:
        return "#" + bytes(ImageColor.getrgb(color)[:3]).hex()
    except ValueError:
        raise InvalidArgumentError(
            f"background must be a name of CSS, '#rrggbb', or three numbers from 0 to 1; "
            f"got {color!r}"
        ) from None
