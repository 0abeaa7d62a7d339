"""``VDIActor``: a real ``vtkVolume`` whose shader looks up the image of its VDI."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.raycasting.picking import FirstHit, Pick
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods
from pyvista_vdi.vtk_pipeline.drawing.screen import LOOKUP, place_image
from pyvista_vdi.vtk_pipeline.drawing.settings import OF_ACTORS, OF_SHADERS, refuse
from pyvista_vdi.vtk_pipeline.drawing.window import VDIStatus
from pyvista_vdi.vtk_pipeline.filters.source import input_of
from pyvista_vdi.vtk_pipeline.filters.view import as_array, framed, size_of
from pyvista_vdi.vtk_pipeline.vtk import vtkCamera, vtkOpenGLShaderProperty, vtkVolume, weakly


class VDIShaderProperty(vtkOpenGLShaderProperty):  # type: ignore[misc]
    """The property with the shader that looks the image up; it takes no other."""


refuse(VDIShaderProperty, OF_SHADERS)


class VDIActorMethods:
    """What makes a volume show a VDI; mixed into VTK's and into PyVista's."""

    def __init__(self: Any) -> None:
        super().__init__()
        super().SetShaderProperty(shader := VDIShaderProperty())  # type: ignore[misc]
        vtkOpenGLShaderProperty.SetFragmentShaderCode(shader, LOOKUP)
        place_image(self, 0, (0, 0), (1, 1))

    def SetMapper(self: Any, mapper: Any) -> None:
        """Set the mapper, which must be a :class:`VDIMapper` of its own.

        Raises
        ------
        InvalidArgumentError
            If it is another mapper, or already behind another actor.
        """
        if mapper is not None and not isinstance(mapper, VDIMapperMethods):
            raise InvalidArgumentError(
                f"a VDIActor needs a VDIMapper; got {type(mapper).__name__}: an ordinary volume "
                "mapper goes behind a vtkVolume"
            )
        if mapper is not None and mapper.driver.actor() not in (None, self):
            raise InvalidArgumentError(
                "this VDIMapper is already behind another VDIActor: give each actor its own "
                "(the VDI itself can be shared)"
            )
        old = self.GetMapper()
        if isinstance(old, VDIMapperMethods) and old.driver.actor() is self:
            old.driver.actor = lambda: None
        if mapper is not None:
            mapper.driver.actor = weakly(self)
        super().SetMapper(mapper)  # type: ignore[misc]
        # VTK keeps no more than its own part of a mapper, so this observer, which is never called,
        # keeps the rest. The shader property is what VTK frees last of an actor: so the mapper goes
        # after its actor, by Python, and not within VTK's collection, whose lock threads wait for.
        shader = self.GetShaderProperty()
        shader.RemoveObservers("UserEvent")
        if mapper is not None:
            shader.AddObserver("UserEvent", lambda *_: mapper)

    def SetProperty(self: Any, prop: Any) -> None:
        """Set the volume property, from which the VDI is regenerated.

        Parameters
        ----------
        prop : vtkVolumeProperty
            Changes to it are followed.

        Raises
        ------
        UnsupportedError, InvalidArgumentError
            If a VDI cannot honour it; the property before stays.
        """
        mapper = self.GetMapper()
        source = None if mapper is None else mapper.GetSource()
        if source is not None:
            source.SetVolumeProperty(prop)
        elif mapper is not None and mapper.driver.input is not None:
            mapper.driver.input.prop = prop
        super().SetProperty(prop)  # type: ignore[misc]

    @property
    def vdi(self: Any) -> VDI | None:
        """The VDI, made now where there is none or its data, look or light have changed.

        It is of the view that the first picture had; before that, of the view that it would have
        now; where a camera was given, of that. Making it is waited for. ``None`` where the mapper
        has no input, or where nothing shows the actor and nobody has said a view. Another one that
        is set, a series or a set is shown from the next frame on, and takes the place of what made
        the one before: a volume, which is let go of.

        Raises
        ------
        VDIError
            What generating raises.
        """
        return self._driver.vdi_asked_for()  # type: ignore[no-any-return]

    @vdi.setter
    def vdi(self: Any, vdi: VDI | VDICollection) -> None:
        self._driver.set_input(input_of(vdi))
        self.GetMapper().Modified()

    @property
    def deferred(self: Any) -> DeferredVDI | None:
        """The values that the property classifies, to be saved as such; ``None`` where it has none.

        Of a series they are those of the step that is shown.
        """
        return self._driver.values_asked_for()  # type: ignore[no-any-return]

    @property
    def collection(self: Any) -> VDICollection | None:
        """The series or set that is shown; ``None`` where a single VDI or a volume is."""
        shown = self._driver.input
        return None if shown is None else shown.collection

    @property
    def player(self: Any) -> Any:
        """What shows the steps of a series: ``time`` and ``step``, which may be set, ``play()``.

        ``None`` where no series is shown. See
        :class:`pyvista_vdi.extensions.series.shown.SeriesInput`.
        """
        shown = self._driver.input
        return None if shown is None else shown.player

    @property
    def _driver(self: Any) -> Any:
        """What draws; InvalidArgumentError without a mapper."""
        mapper = self.GetMapper()
        if mapper is None:
            raise InvalidArgumentError("this actor has no mapper: set a VDIMapper (SetMapper)")
        return mapper.driver

    @property
    def status(self: Any) -> VDIStatus:
        """How the VDI was drawn in the last frame, and what goes on behind it."""
        return self._driver.status()  # type: ignore[no-any-return]

    @property
    def opacity_multiplier(self: Any) -> float:
        """Factor of the extinction, 1 by default: see :meth:`VDIMapper.SetOpacityMultiplier`."""
        return self._driver.settings.opacity_multiplier  # type: ignore[no-any-return]

    @opacity_multiplier.setter
    def opacity_multiplier(self: Any, multiplier: float) -> None:
        mapper, _ = self.GetMapper(), self._driver  # which raises without a mapper
        mapper.SetOpacityMultiplier(multiplier)

    def pick(
        self: Any, x: float, y: float, opacity_threshold: float = FirstHit.opacity_threshold
    ) -> Pick | None:
        """Return the supersegment that is seen at a place of the window.

        Parameters
        ----------
        x, y : float
            Display coordinates: pixels of the window from its lower left corner, as in VTK's
            events and pickers.
        opacity_threshold : float
            Opacity that the ray must reach in the VDI, from its beginning on.

        Returns
        -------
        Pick or None
            The first supersegment that reaches it, and where the ray enters it, in world
            coordinates. ``None`` where nothing of the VDI is hit, where something opaque hid the
            hit in the last frame, and where the actor is invisible or not pickable.

        Raises
        ------
        InvalidArgumentError
            If no renderer of a window shows the actor.
        """
        shown = [r for r in self._driver.renderers if r.GetRenderWindow() is not None]
        if not shown:
            raise InvalidArgumentError(
                "nothing shows this actor yet: add it to a renderer of a window first"
            )
        there = [r for r in shown if r.IsInViewport(int(x), int(y))]
        hit = FirstHit(opacity_threshold)
        return self._driver.pick(there[0], x, y, hit) if there else None  # type: ignore[no-any-return]

    def regenerate(self: Any, camera: Any = None, window_size: Any = None) -> VDI:
        """Generate the VDI anew, now.

        Parameters
        ----------
        camera : vtkCamera or pyvista.Camera or Camera, optional
            The new generating view; by default the view of the renderer that shows the actor, or
            the view before if none does.
        window_size : (int, int), optional
            Width and height of that view in pixels; by default the renderer's.

        Returns
        -------
        VDI
            What is shown from now on.

        Raises
        ------
        InvalidArgumentError
            If there is no volume to make it from, or no view.
        VDIError, KeyboardInterrupt
            Whatever stops the generation; the VDI before stays.
        """
        mapper = self.GetMapper()
        source = None if mapper is None else mapper.GetSource()
        if source is None:
            raise InvalidArgumentError(
                "this actor shows VDIs without a volume, which cannot be generated anew: add "
                "the volume, or set another VDI (actor.vdi = another)"
            )
        driver = mapper.driver
        driver.drop()
        driver.failed = ()
        driver.said.clear()
        matrix, renderers = as_array(self.GetMatrix()), driver.renderers
        renderer = renderers[0] if renderers else None
        source.note_scene(renderers, matrix)
        if camera is not None:
            source.SetCamera(camera, matrix)
        elif renderer is not None:
            source.take_camera(self.camera_to_come(renderer), matrix)
        if window_size is not None:
            source.SetWindowSize(window_size)
        elif renderer is not None and min(renderer.GetSize()) > 0:
            source.take_size(size_of(renderer))
        return source.GetVDI()  # type: ignore[no-any-return]

    def camera_to_come(self, renderer: Any) -> Any:
        """Return the camera of a renderer's next picture: its own, or what VTK will make."""
        if renderer.IsActiveCameraCreated():
            return renderer.GetActiveCamera()
        return framed(vtkCamera(), renderer, renderer.ComputeVisiblePropBounds())


refuse(VDIActorMethods, OF_ACTORS)


class VDIActor(VDIActorMethods, vtkVolume):
    """Shows a VDI in a VTK scene: ``renderer.AddVolume(actor)``.

    Position, scale, user matrix, visibility and picking are those of a ``vtkVolume``, and its
    volume property is that of the source. Other coordinate systems than the world, and another
    shader, are refused by name.
    """
