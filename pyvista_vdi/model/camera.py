"""The camera: world, view and list coordinates (docs/dev/conventions.md#list-coordinates)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, InvalidCameraError, UnsupportedError
from pyvista_vdi.model.checks import as_flag, as_float, as_floats, as_vector

Matrix: TypeAlias = NDArray[np.float64]
#: What is given as a vector, and kept as a tuple.
Vector: TypeAlias = Sequence[float] | NDArray[Any]

#: Largest width or height of a window, in pixels: four times 16k, far beyond any display.
MAX_WINDOW_EDGE = 65536


def check_window_size(window_size: Sequence[int], *, name: str = "window_size") -> tuple[int, int]:
    """Return width and height in pixels as two Python ints; ``name`` is for errors."""
    try:
        width, height = window_size
        size = (int(width), int(height))
        if size == (width, height) and min(size) >= 1 and max(size) <= MAX_WINDOW_EDGE:
            return size
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidArgumentError(
        f"{name} must be (width, height), from 1 to {MAX_WINDOW_EDGE} whole pixels each; "
        f"got {window_size!r}"
    )


@dataclass(frozen=True)
class Camera:
    """A view, with VTK's names and meanings.

    Immutable and hashable. What the viewport's aspect decides is taken from the window size that
    it is used with; clipping ranges are not part of it, because nothing here needs them.

    Parameters
    ----------
    position, focal_point, view_up : array_like of float, shape (3,)
        Eye, the point looked at, and the up direction, in world coordinates. ``view_up`` need not
        be perpendicular to the direction of projection, only not parallel to it.
    view_angle : float
        Full opening angle in degrees, vertical unless ``use_horizontal_view_angle``; between 0
        and 180, both excluded. Ignored in parallel projection.
    parallel_projection : bool
        Parallel instead of perspective projection.
    parallel_scale : float
        Half the viewport's height in world units, for parallel projection.
    window_center : array_like of float, shape (2,)
        Centre of the viewport in units of its half width and half height (``c_x, c_y``), as
        ``vtkCamera::SetWindowCenter``.
    use_horizontal_view_angle : bool
        Read ``view_angle`` as the horizontal angle.
    model_transform : array_like of float, shape (4, 4), optional
        M, from the model frame (the data set's own coordinates) to world coordinates; affine and
        invertible. Identity by default.

    Raises
    ------
    InvalidCameraError
        If a value is not finite or out of range, the eye is the focal point, ``view_up`` is
        parallel to the direction of projection, or ``model_transform`` cannot be inverted.
    """

    position: Vector
    focal_point: Vector
    view_up: Vector
    _: KW_ONLY
    view_angle: float = 30.0
    parallel_projection: bool = False
    parallel_scale: float = 1.0
    window_center: Vector = (0.0, 0.0)
    use_horizontal_view_angle: bool = False
    model_transform: Any = field(default=None, compare=False, repr=False)
    _transform: bytes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        put = object.__setattr__
        lengths = {"position": 3, "focal_point": 3, "view_up": 3, "window_center": 2}
        for name, length in lengths.items():
            put(self, name, as_vector(getattr(self, name), name, length, InvalidCameraError))
        for name in ("parallel_projection", "use_horizontal_view_angle"):
            put(self, name, as_flag(getattr(self, name), name))
        put(self, "view_angle", as_float(self.view_angle))
        put(self, "parallel_scale", as_float(self.parallel_scale))
        given = self.model_transform
        matrix = np.eye(4) if given is None else as_floats(given)
        finite = matrix.shape == (4, 4) and np.isfinite(matrix).all()
        if not finite or not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise InvalidCameraError(
                "model_transform must be 4 x 4 finite numbers, affine: with a last row of 0 0 0 1; "
                f"got {given!r}"
            )
        # Scale-free: the determinant against the product of the column lengths (Hadamard's bound)
        if abs(np.linalg.det(unit(matrix[:3, :3].T))) < 1e-12:
            raise InvalidCameraError(
                f"model_transform cannot be inverted: it flattens space; got {given!r}"
            )
        matrix.setflags(write=False)
        put(self, "model_transform", matrix)
        put(self, "_transform", self.model_transform.tobytes())
        _ = self.axes  # which refuses what makes no view

    @classmethod
    def from_any(cls, camera: Any, *, model_transform: ArrayLike | None = None) -> Camera:
        """Return what a user calls a camera as a :class:`Camera`.

        It is a Camera, a ``vtkCamera`` or PyVista's, which are read through their ``Get…`` methods,
        or position, focal point and view up. ``model_transform`` replaces what it has.
        """
        if isinstance(camera, Camera):
            given = model_transform is not None
            return camera.replace(model_transform=model_transform) if given else camera
        if not hasattr(camera, "GetDirectionOfProjection"):
            try:
                vectors: Any = () if isinstance(camera, str) else camera
                position, focal_point, view_up = vectors
            except (TypeError, ValueError):
                raise InvalidCameraError(
                    "expected a pyvista_vdi.Camera, a vtkCamera, a pyvista.Camera or (position, "
                    f"focal_point, view_up); got {type(camera).__name__}"
                ) from None
            return cls(position, focal_point, view_up, model_transform=model_transform)
        lacking = {
            "a view shear": tuple(camera.GetViewShear()) != (0.0, 0.0, 1.0),
            "an explicit projection matrix": camera.GetUseExplicitProjectionTransformMatrix(),
            "an off-axis projection": camera.GetUseOffAxisProjection(),
            "a user transform": camera.GetUserTransform() or camera.GetUserViewTransform(),
        }
        if has := list(filter(lacking.get, lacking)):
            raise UnsupportedError(
                f"the camera has {' and '.join(has)}, which a VDI cannot honour: remove it"
            )
        if model_transform is None:
            matrix = camera.GetModelTransformMatrix()
            elements = [matrix.GetElement(k // 4, k % 4) for k in range(16)]
            model_transform = np.reshape(elements, (4, 4))
        names = [each.name for each in fields(cls) if each.init and each.name != "model_transform"]
        known = {name: getattr(camera, f"Get{name.title().replace('_', '')}")() for name in names}
        return cls(**known, model_transform=model_transform)

    @classmethod
    def from_dict(cls, state: Mapping[str, Any]) -> Camera:
        """Return the camera that :meth:`to_dict` described."""
        try:
            return cls(**state)
        except TypeError as error:  # an entry is missing, or unknown
            raise InvalidCameraError(f"this is no camera's description: {error}") from error

    def to_dict(self) -> dict[str, Any]:
        """Return all arguments of the constructor, as plain numbers and lists (for JSON)."""
        names = sorted(each.name for each in fields(self) if each.init)
        return {name: np.asarray(getattr(self, name)).tolist() for name in names}

    def to_pyvista(self) -> Any:
        """Return the view of the model frame as a PyVista camera: ``plotter.camera = ...``.

        An actor whose matrix is the identity is seen as the model transform placed it: where this
        is rigid by an eye that has moved instead, else by the camera's own model transform.
        """
        return registry.method("Camera.to_pyvista")(self)

    replace = replace

    def azimuth(self, degrees: float) -> Camera:
        """Return the view turned about ``view_up`` through the focal point (as VTK's Azimuth)."""
        return self._turned(np.asarray(self.view_up), degrees)

    def elevation(self, degrees: float) -> Camera:
        """Return the view turned about the horizontal axis through the focal point.

        As VTK's ``Elevation``: positive angles lift the eye; ``view_up`` stays.
        """
        return self._turned(-self.axes[0], degrees)

    def tile(
        self, window_size: Sequence[int], corner: Sequence[int], tile_size: Sequence[int]
    ) -> Camera:
        """Return the view that a rectangle of pixels of a window has.

        ``corner``: column and row of the tile's first pixel, from the top left; the tile may reach
        beyond the window. Its rays are the same to rounding.
        """
        window = np.array(check_window_size(window_size))
        tile = np.array(check_window_size(tile_size, name="tile_size"))
        centre = (2 * np.asarray(corner) + tile) / window - 1  # (u, v) in the window, v downwards
        around = np.asarray(self.window_center) + centre * (1, -1)
        width_share, height_share = tile / window
        # The angle is that of the edge it is measured along; the other follows from the aspect
        share = width_share if self.use_horizontal_view_angle else height_share
        tangent = math.tan(math.radians(self.view_angle) / 2)
        return self.replace(
            view_angle=2 * math.degrees(math.atan(tangent * share)),
            parallel_scale=self.parallel_scale * height_share,
            window_center=around * window / tile,
        )

    @cached_property
    def axes(self) -> Matrix:
        """Unit vectors right, up and forward in world coordinates, float64 (3, 3), as rows."""
        # In parallel projection the angle has no meaning, but it is a number
        any_angle = self.parallel_projection and math.isfinite(self.view_angle)
        if not (any_angle or 0 < self.view_angle < 180):
            raise InvalidCameraError(
                f"view_angle must lie between 0 and 180 degrees, both excluded; "
                f"got {self.view_angle!r}"
            )
        if not 0 < self.parallel_scale < math.inf:
            raise InvalidCameraError(
                f"parallel_scale must be a positive number of world units; "
                f"got {self.parallel_scale!r}"
            )
        with np.errstate(over="ignore"):
            forward = np.subtract(self.focal_point, self.position)
        if not (np.isfinite(forward).all() and forward.any()):
            wrong = "the same point" if np.isfinite(forward).all() else "too far apart for float64"
            raise InvalidCameraError(
                f"the camera's position and focal point are {wrong}, {self.position} and "
                f"{self.focal_point}: move one of them"
            )
        # By a power of two, which rounds nothing: squares may overflow
        forward = np.ldexp(forward, -np.frexp(np.abs(forward).max())[1])
        forward = forward / math.sqrt(forward @ forward)
        right = _cross(forward, unit(np.array(self.view_up)))
        # sin of the angle between them; below 1e-12 float64 cannot tell which way is right
        if math.sqrt(right @ right) < 1e-12:
            raise InvalidCameraError(
                f"view_up {self.view_up} is zero or parallel to the direction of projection "
                f"{tuple(forward.tolist())}: choose another up direction"
            )
        right /= math.sqrt(right @ right)
        axes = np.array([right, _cross(right, forward), forward])
        axes.setflags(write=False)
        return axes

    @property
    def view_matrix(self) -> Matrix:
        """World to view space (X right, Y up, Z forward, world units), float64 (4, 4)."""
        axes = self.axes
        shift = -axes @ np.asarray(self.position)
        return np.vstack([np.column_stack([axes, shift]), [0, 0, 0, 1]])

    @cached_property
    def model_to_view(self) -> Matrix:
        """Model frame to view space, float64 (4, 4), read-only.

        The eye is subtracted before the rotation, so that an origin far from zero costs no digits
        beyond those of the coordinates themselves.
        """
        axes, matrix = self.axes, np.eye(4)
        matrix[:3, :3] = axes @ self.model_transform[:3, :3]
        matrix[:3, 3] = axes @ (self.model_transform[:3, 3] - np.asarray(self.position))
        matrix.setflags(write=False)
        return matrix

    def half_extent(self, window_size: Sequence[int]) -> tuple[float, float]:
        """Return half the width and height of a viewport of so many pixels.

        ``(t_x, t_y)``, tangents of the half angles, in perspective; ``(s_x, s_y)``, world units, in
        parallel projection.
        """
        width, height = check_window_size(window_size)
        aspect = width / height
        if self.parallel_projection:
            return self.parallel_scale * aspect, self.parallel_scale
        tangent = math.tan(math.radians(self.view_angle) / 2)
        if self.use_horizontal_view_angle:
            return tangent, tangent / aspect
        return tangent * aspect, tangent

    def viewport_matrix(self, window_size: Sequence[int]) -> Matrix:
        """View space to homogeneous coordinates of a viewport of so many pixels, float64 (4, 4).

        K with ``K [X, Y, Z, 1] = [u d, v d, Z, d]``: ``(u, v)`` in [-1, 1]² is the viewport; ``d``
        is Z in perspective and 1 in parallel projection (docs/dev/conventions.md#list-coordinates).
        """
        half_width, half_height = self.half_extent(window_size)
        denominator = 3 if self.parallel_projection else 2
        matrix = np.diag([1 / half_width, 1 / half_height, 1.0, 0.0])
        matrix[:2, denominator] -= self.window_center
        matrix[3, denominator] = 1
        return matrix

    def ray_coefficients(self, window_size: Sequence[int]) -> tuple[Matrix, Matrix]:
        """Rays through a viewport of so many pixels, in view space: origins and directions.

        float64 (3, 3) each. The ray through ``(u, v)`` is ``P(t) = [1, u, v] @ origin +
        t [1, u, v] @ direction``; its direction has Z = 1, so t is view depth.
        """
        half = self.half_extent(window_size)
        slope, forward = np.zeros((3, 3)), np.zeros((3, 3))
        slope[:, :2] = np.vstack([np.multiply(half, self.window_center), np.diag(half)])
        forward[0, 2] = 1.0
        if self.parallel_projection:
            return slope, forward
        return np.zeros((3, 3)), slope + forward

    def _turned(self, axis: Matrix, degrees: float) -> Camera:
        """Rotate the eye about ``axis`` through the focal point (Rodrigues' formula)."""
        axis, angle = unit(axis), math.radians(as_float(degrees))
        if not math.isfinite(angle):
            raise InvalidCameraError(f"a view is turned by a finite angle; got {degrees!r}")
        arm = np.subtract(self.position, self.focal_point)
        turned = arm * math.cos(angle) + _cross(axis, arm) * math.sin(angle)
        turned = turned + axis * (axis @ arm) * (1 - math.cos(angle))
        return self.replace(position=np.asarray(self.focal_point) + turned)


def unit(vectors: Matrix) -> Matrix:
    """Return vectors, (..., n), at length one; zeros where they are zero."""
    # Scaled first: the square of a component may overflow or vanish though the vector does not
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    scaled = vectors / np.where(largest > 0, largest, 1.0)
    return np.asarray(scaled / np.maximum(np.linalg.norm(scaled, axis=-1, keepdims=True), 1.0))


def _cross(a: Matrix, b: Matrix) -> Matrix:
    # A frame has dozens of them: np.cross takes 50 times as long for three numbers
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
