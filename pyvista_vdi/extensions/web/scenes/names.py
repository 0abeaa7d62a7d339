"""What a user knows the parts of a scene by: the names of PyVista's methods that put them there.

Nothing keeps which method was called. It is told by what it leaves behind: the class of a prop,
and what a plotter's component for widgets lists.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pyvista_vdi.extensions.web.placing import planes_of
from pyvista_vdi.extensions.web.scenes.meshes import offset_of
from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods
from pyvista_vdi.vtk_pipeline.vtk import BACKEND

#: By the first class of VTK's that a prop is of.
_METHODS = {
    "vtkLegendBoxActor": "add_legend",
    "vtkLegendScaleActor": "add_legend_scale",
    "vtkAxisActor2D": "add_ruler",
    "vtkContextActor": "add_chart",
    "vtkCubeAxesActor": "show_bounds",
    "vtkScalarBarActor": "add_scalar_bar",
    "vtkCamera3DRepresentation": "add_camera3d_widget",
    "vtkDistanceRepresentation": "add_measurement_widget",
    "vtkTexturedButtonRepresentation2D": "add_checkbox_button_widget",
    "vtkLightActor": "add_light(Light(show_actor=True))",
    "vtkAxesActor": "add_axes_at_origin",
    "vtkCornerAnnotation": "add_text",
    "vtkTextActor": "add_text",
    "vtkVolume": "add_volume",
}

_PASSES = {
    "vtkGaussianBlurPass": "add_blurring",
    "vtkEDLShading": "enable_eye_dome_lighting",
    "vtkShadowMapPass": "enable_shadows",
    "vtkDepthOfFieldPass": "enable_depth_of_field",
    "vtkSSAOPass": "enable_ssao",
    "vtkSSAAPass": 'enable_anti_aliasing("ssaa")',
}

#: What PyVista begins the names of props with that the user gave none.
_OF_PYVISTA = ("_", "BoundingBox(", "Floor(")


class Names:
    """Names of a renderer's props."""

    def __init__(self, given: dict[str, Any], renderer: Any) -> None:
        self._given = {
            prop: name
            for name, prop in given.items()
            if "(Addr" not in name and not name.startswith(_OF_PYVISTA)
        }
        widgets = _widgets(renderer)
        groups = getattr(widgets, "radio_button_widget_dict", None) or {}
        self._radio = {w.GetRepresentation() for group in groups.values() for w in group}
        charts: list[Any] = getattr(renderer, "get_charts", list)()
        self._editors = bool(charts) and all(map(_is_editor, charts))
        planes = getattr(widgets, "plane_widgets", None) or []
        self._clips = len(planes) > len(set(planes))  # see widgets_of

    def of(self, prop: Any) -> str:
        """Return the user's name, or else the method."""
        return self._given.get(prop) or method_of(prop) or "add_mesh"

    def of_missing(self, prop: Any) -> str:
        """Return the method, with the user's name for what it has made."""
        kind = type(prop).__name__
        method = method_of(prop) or ("add_mesh" if kind == "Actor" else f"add_actor({kind})")
        if prop in self._radio:
            method = "add_radio_button_widget"
        if method == "add_chart" and self._editors:
            method = "add_transfer_function_editor"
        if method == "add_volume" and self._clips and planes_of(prop):
            method = "add_volume_clip_plane"
        return " ".join([method, *(f"({name})" for name in [self._given.get(prop)] if name)])


def method_of(prop: Any) -> str | None:
    """Return the method by which a prop like this is added to a plotter; ``None`` if it is none."""
    if isinstance(prop, VDIActorMethods):
        return "add_vdi"
    if is_silhouette(prop):
        return "add_silhouette"
    method = next((name for kind, name in _METHODS.items() if prop.IsA(kind)), None)
    # show_grid is show_bounds with these
    if method == "show_bounds" and prop.GetDrawXGridlines():
        return "show_grid"
    return method


def _is_editor(chart: Any) -> bool:
    """Whether a chart has points that can be dragged: a transfer function's editor."""
    plots = [chart.GetPlot(k) for k in range(chart.GetNumberOfPlots())]
    return any(plot.IsA("vtkCompositeControlPointsItem") for plot in plots)


def is_silhouette(prop: Any) -> bool:
    """Whether what a prop draws is made for one view."""
    # Of PyVista's actors alone: a source of VTK's own that is asked for before its module is
    # imported is of a base class for Python, and so are then all others of its class, for good
    if not prop.IsA("vtkActor") or type(prop).__module__.startswith(BACKEND):
        return False
    source = None if prop.GetMapper() is None else prop.GetMapper().GetInputAlgorithm()
    return source is not None and bool(source.IsA("vtkPolyDataSilhouette"))


def passes_of(renderer: Any) -> Iterator[str]:
    """Yield the methods whose render passes a renderer has."""
    outer = renderer.GetPass()
    pending, names = [outer], []
    while pending:
        one = pending.pop()
        if one is None:
            continue
        names += [name for kind, name in _PASSES.items() if one.IsA(kind)]
        if hasattr(one, "GetDelegatePass"):
            pending.append(one.GetDelegatePass())
        if hasattr(one, "GetPasses") and one.GetPasses() is not None:
            passes = one.GetPasses()
            pending += [passes.GetItemAsObject(k) for k in range(passes.GetNumberOfItems())]
    if outer is not None and not names:
        names.append(f"its render pass ({outer.GetClassName()})")
    yield from names


def _widgets(renderer: Any) -> Any:
    """Return the component for widgets of a renderer's plotter; ``None`` if there is none."""
    return getattr(getattr(renderer, "parent", None), "widgets", None)


def widgets_of(renderer: Any) -> Iterator[str]:
    """Yield the methods whose widgets can be used in a renderer of PyVista's."""
    widgets = _widgets(renderer)

    def used(kind: str) -> list[Any]:
        found = getattr(widgets, kind, None) or []
        return [w for w in found if w.GetEnabled() and w.GetCurrentRenderer() is renderer]

    def made(kind: str) -> int:
        return len(getattr(widgets, kind, None) or [])

    planes, sliders = used("plane_widgets"), used("slider_widgets")
    texts = [w for w in sliders if not w.GetRepresentation().GetShowSliderLabel()]
    # One for each axis, all at once
    sliced, axes = made("plane_sliced_meshes"), ("X", "Y", "Z")
    alike = [sum(bool(getattr(w, f"GetNormalTo{a}Axis")()) for w in planes) for a in axes]
    across = 3 * min(*alike, sliced // 3)
    # PyVista lists these twice; add_vdi_clip_plane goes by way of add_volume_clip_plane
    volumes = len(planes) - len(set(planes))
    vdis = [prop for prop in renderer.GetViewProps() if isinstance(prop, VDIActorMethods)]
    of_vdis = min(volumes, sum(len(planes_of(vdi)) for vdi in vdis))
    yield from _split(
        len(used("box_widgets")), "add_box_widget", add_mesh_clip_box=made("box_clipped_meshes")
    )
    yield from _split(
        len(set(planes)),
        "add_plane_widget",
        add_mesh_clip_plane=made("plane_clipped_meshes"),
        add_mesh_slice=sliced - across,
        add_mesh_slice_orthogonal=across,
        add_vdi_clip_plane=of_vdis,
        add_volume_clip_plane=volumes - of_vdis,
    )
    yield from _split(
        len(sliders),
        "add_slider_widget",
        add_mesh_threshold=made("threshold_meshes"),
        add_mesh_isovalue=made("isovalue_meshes"),
        add_text_slider_widget=len(texts),
    )
    yield from _split(
        len(used("spline_widgets")),
        "add_spline_widget",
        add_mesh_slice_spline=made("spline_sliced_meshes"),
    )
    for kind, method in (
        ("line_widgets", "add_line_widget"),
        ("sphere_widgets", "add_sphere_widget"),
        ("distance_widgets", "add_measurement_widget"),
    ):
        if used(kind):
            yield method
    if any(_is_always_visible(prop) for prop in renderer.GetViewProps()):
        yield "add_affine_transform_widget"
    cameras = getattr(widgets, "camera_widgets", None) or []
    if any(w.GetEnabled() and w.GetParentRenderer() is renderer for w in cameras):
        yield "add_camera_orientation_widget"
    axes_widget = getattr(renderer, "axes_widget", None)
    if axes_widget is not None and axes_widget.GetEnabled() and axes_widget.GetInteractive():
        marker = axes_widget.GetOrientationMarker()
        kinds = {"vtkAxesActor": "add_axes", "vtkPropAssembly": "add_box_axes"}
        names = [name for kind, name in kinds.items() if marker.IsA(kind)]
        yield f"{(*names, 'add_orientation_widget')[0]}(interactive=True)"
    if any(prop.IsA("vtkScalarBarRepresentation") for prop in renderer.GetViewProps()):
        yield "add_scalar_bar(interactive=True)"


def _is_always_visible(prop: Any) -> bool:
    """Whether a prop is drawn before all else, as PyVista has the arrows by which actors move."""
    mapper = prop.GetMapper() if prop.IsA("vtkActor") else None
    return mapper is not None and offset_of(mapper) < -0.5


def _split(count: int, plain: str, **special: int) -> Iterator[str]:
    """Yield which methods have made ``count`` widgets, of which so many by each special one."""
    if count:
        yield from (name for name, made in special.items() if made)
        if count > sum(special.values()):
            yield plain
