"""A VDI in a trame app: a component whose Python side gives it VDIs, and its camera both ways."""

from __future__ import annotations

import itertools
from base64 import b64encode
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from pyvista_vdi.errors import MissingDependencyError
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.camera import camera_of, viewer_camera
from pyvista_vdi.extensions.web.shown import bare_file
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.inputs import as_vdi

try:
    from trame_client.widgets.core import AbstractElement
except ImportError as error:
    raise MissingDependencyError(
        'this is a component for trame, which is not installed: pip install "pyvista-vdi[web]"'
    ) from error

#: The component: a viewer that follows two properties, and says where it is turned to.
_COMPONENT = """
window.pyvistaVDI = { install(app) { app.component("vdi-view", {
  props: ["file", "eye"],
  emits: ["turned"],
  render() { return Vue.h("vdi-viewer"); },
  mounted() {
    const viewer = this.$el;
    let timer, told = "";
    viewer.addEventListener("camerachange", () => {
      clearTimeout(timer);
      timer = setTimeout(() => {
        const { camera, clientWidth, clientHeight } = viewer, density = devicePixelRatio || 1;
        const size = [clientWidth, clientHeight].map((e) => Math.max(1, Math.round(e * density)));
        const text = JSON.stringify({ camera, size });
        if (text !== told) this.$emit("turned", { camera, size });
        told = text;
      }, 100);
    });
    this.$watch("eye", (eye) => { if (eye) viewer.camera = { ...eye }; }, { immediate: true });
    this.$watch("file", async (file) => {
      const bytes = new Uint8Array(await new Response(file).arrayBuffer());
      if (file && file === this.file) viewer.showBytes(bytes).catch(() => {});
    }, { immediate: true });
  },
}); } };
"""

_numbers = itertools.count(1)


@cache
def _module() -> dict[str, Any]:
    """Return what trame's pages load: the viewer and the component, one script in its own URL."""
    script = b64encode((viewer_script() + _COMPONENT).encode()).decode()
    return {"scripts": [f"data:text/javascript;base64,{script}"], "vue_use": ["pyvistaVDI"]}


class VDIView(AbstractElement):
    """A viewer of a VDI, in the layout of a trame app (Vue 3).

    Parameters
    ----------
    vdi : VDI, optional
        What it shows first.
    camera : Camera, optional
        Where it is seen from; by default from the VDI's own view.
    on_camera : callable, optional
        Called with this object when somebody has turned the view in a page.
    background : str, optional
        A CSS colour.
    **kwargs
        Of trame's elements: ``style``, ``classes`` and others.

    Attributes
    ----------
    size : (int, int) or None
        Width and height of the page's picture, pixels; ``None`` before that is known.

    Raises
    ------
    MissingDependencyError
        When this module is imported without trame.
    """

    def __init__(
        self,
        vdi: Any = None,
        *,
        camera: Camera | None = None,
        on_camera: Callable[[VDIView], object] | None = None,
        background: str | None = None,
        **kwargs: Any,
    ) -> None:
        key = f"pyvista_vdi_{next(_numbers)}"
        self._file_key, self._camera_key = f"{key}_file", f"{key}_camera"
        self._camera: Camera | None = None
        self._on_camera = on_camera
        super().__init__(
            "vdi-view",
            file=(self._file_key, None),
            eye=(self._camera_key, None),
            turned=(self._turned, "[$event]"),
            **({} if background is None else {"background": background}),
            **kwargs,
        )
        self.server.enable_module(_module())
        # Not "camera", which would be no attribute of this class any more
        self._attr_names += ["file", "eye", "background"]
        self._event_names += ["turned"]
        self.size: tuple[int, int] | None = None
        if vdi is not None:
            self.update(vdi)
        if camera is not None:
            self.camera = camera

    def update(self, vdi: Any) -> None:
        """Show another VDI, or its VTK form; pages draw the one before until it has come."""
        with self.server.state as state:
            state[self._file_key] = bare_file(as_vdi(vdi))

    @property
    def camera(self) -> Camera | None:
        """Where the page sees the VDI from; ``None`` before that is known. It can be set."""
        return self._camera

    @camera.setter
    def camera(self, camera: Any) -> None:
        self._camera = Camera.from_any(camera)
        with self.server.state as state:
            state[self._camera_key] = viewer_camera(self._camera, self.size or (1, 1))

    def _turned(self, event: Mapping[str, Any]) -> None:
        width, height = event["size"]
        self.size, self._camera = (int(width), int(height)), camera_of(event["camera"])
        if self._on_camera is not None:
            self._on_camera(self)
