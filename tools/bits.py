"""Hashes of VDIs, frames and files by case: two versions that agree in them draw the same bits.

``python tools/bits.py --device 0 --out old.json`` hashes all that the cases make on one OpenCL
implementation; the same with the new code, then ``python tools/bits.py --compare old.json
new.json``. Hashes of two implementations differ: OpenCL C leaves them the last bits of elementary
functions. Only public names are used, so that one file runs on both versions; scenes are fixed,
from seeds and from the volumes in the folder that ``PYVISTA_VDI_DATA`` names. Both versions run the
same file, which takes nothing from ``tests/support``.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import functools
import hashlib
import json
import math
import os
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import pyvista_vdi as pvdi

#: What a case makes; its hash is what is kept.
Case = Callable[[], Any]

#: Names that a comparison prints of each kind.
MOST_NAMES = 40

#: The arrays of a VDI.
ARRAYS = ("offsets", "front", "back", "color", "optical_depth")
PRECISIONS = ("exact", "16-byte", "8-byte")


# -- hashing ---------------------------------------------------------------------------------------


def digest(thing: Any) -> str:
    """Return the SHA-256 of a VDI, an array, a pick, a text, bytes, or a sequence of them."""
    state = hashlib.sha256()
    _add(state, thing)
    return state.hexdigest()


def _add(state: Any, thing: Any) -> None:
    if isinstance(thing, pvdi.VDI):
        for name in ARRAYS:
            _add(state, getattr(thing, name))
        state.update(f"{thing.window_size} {thing.depth_origin!r} {thing.precision}".encode())
        _add(state, np.asarray(thing.bounds))
        state.update(json.dumps(thing.camera.to_dict(), sort_keys=True).encode())
    elif isinstance(thing, np.ndarray):
        state.update(f"{thing.dtype.str} {thing.shape}".encode())
        state.update(np.ascontiguousarray(thing).data)
    elif isinstance(thing, bytes):
        state.update(thing)
    elif isinstance(thing, list | tuple):
        for part in thing:
            _add(state, part)
    else:  # a number, a text, None, or a dataclass of them: floats are written exactly
        state.update(repr(thing).encode())


# -- 16 volumes, 3 transfer functions, 6 angles ----------------------------------------------------

#: Where the volumes lie, by the name of a case; shipped ones are taken from the package.
VOLUMES = {
    "mouse": "allen_mouse_brain_20um_660x400x570_u8.nrrd",
    "aneurism": "aneurism_256_u8.nrrd",
    "sandstone": "berea_sandstone_400_u8_binary.nrrd",
    "bonsai": "bonsai_256_u8.nrrd",
    "brain": "brain_colin27_181x217x181_u8.nrrd",
    "brain-fine": "brain_colin27_301x370x316_u8.nrrd",
    "catphan": "catphan_cbct_512x512x64_i16.nrrd",
    "embryo": "embryo_256_u8.nrrd",
    "heptane": "heptane_302_u8.nrrd",
    "hydrogen": "hydrogen_atom_128_u8.nrrd",
    "iguana": "iguana_head_210x256x179_u8.nrrd",
    "isabel": "isabel_wind_125x125x25_f64.nrrd",
    "mixing": "rayleigh_taylor_dns_192x192x192_u8.nrrd",
    "head": "t1w_head_274x384x384_i16.nrrd",
    "tooth": "tooth_103x94x161_u16.nrrd",
    "visible": "visible_female_head_512x512x234_u8.nrrd",
}

#: Those of ``standard_cases``.
TRANSFER_FUNCTIONS: dict[str, dict[str, Any]] = {
    "soft": {"cmap": "bone", "opacity": "linear"},
    "steep": {"cmap": "viridis", "opacity": "sigmoid_10"},
    "opaque": {"cmap": "inferno", "opacity": (0.0, 0.0, 0.02, 0.9, 1.0)},
}

#: Every n-th point is taken along an axis that has more than these.
MOST_POINTS = 128

#: Lists along each edge of V_O's window.
LISTS = (200, 150)

#: Degrees from V_O, and the window there: at 0 its own, so that pixels are drawn from lists of
#: their own; small and near, so that rays are followed in blocks; at least 200 pixels high and
#: across many lists, so that they are followed in packets.
VIEWS = {
    0: LISTS,
    5: (240, 160),
    30: (320, 220),
    60: (280, 240),
    90: (240, 256),
    180: (256, 208),
}


@functools.lru_cache(maxsize=2)
def real_volume(name: str) -> pvdi.Volume:
    """Return a volume with every n-th of its points, at most :data:`MOST_POINTS` per axis."""
    import nrrd

    folders = (os.environ.get("PYVISTA_VDI_DATA"), Path(pvdi.__file__).parent / "data")
    places = [Path(folder) / VOLUMES[name] for folder in folders if folder]
    file = next((place for place in places if place.is_file()), None)
    if file is None:
        raise FileNotFoundError(f"{VOLUMES[name]}: set PYVISTA_VDI_DATA to the folder that has it")
    array, header = nrrd.read(str(file), index_order="C")
    spacing = header.get("spacings")
    if spacing is None:
        spacing = np.linalg.norm(header["space directions"], axis=1)
    steps = [-(-points // MOST_POINTS) for points in array.shape]
    array = array[tuple(slice(None, None, step) for step in steps)]
    return pvdi.Volume(array, np.asarray(spacing) * steps[::-1], name=name)


def outside(
    bounds: Any, azimuth: float = 0.0, elevation: float = 20.0, *, distance: float = 2.0, **options
) -> pvdi.Camera:
    """Return a view of bounds from ``distance`` diagonals away, z upwards."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, diagonal = box.mean(axis=1), float(np.linalg.norm(box[:, 1] - box[:, 0]))
    turn, lift = math.radians(azimuth), math.radians(elevation)
    to_eye = np.array(
        [math.sin(turn) * math.cos(lift), -math.cos(turn) * math.cos(lift), math.sin(lift)]
    )
    angle = options.pop("view_angle", math.degrees(2 * math.atan(0.42 / distance)))
    return pvdi.Camera(
        centre + distance * diagonal * to_eye,
        centre,
        (0, 0, 1),
        view_angle=angle,
        parallel_scale=0.42 * diagonal,
        **options,
    )


@functools.lru_cache(maxsize=2)
def standard_vdi(name: str, transfer: str) -> pvdi.VDI:
    """Return the VDI of a real volume: every other pair of them by a long lens."""
    volume = real_volume(name)
    distance = (0.9, 2.0)[list(VOLUMES).index(name) // 2 % 2]
    camera = outside(volume.bounds, distance=distance)
    return pvdi.generate(volume, camera, LISTS, **TRANSFER_FUNCTIONS[transfer])


@functools.lru_cache(maxsize=2)
def standard_vdi_drawn(name: str, transfer: str) -> pvdi.VDI:
    """Return the VDI with the precision that frames are drawn with: each third has the next."""
    place = list(VOLUMES).index(name) + list(TRANSFER_FUNCTIONS).index(transfer)
    return standard_vdi(name, transfer).with_precision(PRECISIONS[place % 3])


def standard_frame(name: str, transfer: str, angle: float) -> Any:
    """Return a frame; of every second volume from above, so that packets lie along columns."""
    vdi = standard_vdi_drawn(name, transfer)
    upright = list(VOLUMES).index(name) % 2
    turn = vdi.camera.elevation if upright else vdi.camera.azimuth
    return pvdi.render(vdi, turn(angle), VIEWS[int(angle)])


def standard_cases() -> Iterator[tuple[str, Case]]:
    """Yield the 48 VDIs, and the six frames of each."""
    for name in VOLUMES:
        for transfer in TRANSFER_FUNCTIONS:
            yield f"vdi/{name}/{transfer}", functools.partial(standard_vdi, name, transfer)
            for angle in VIEWS:
                frame = functools.partial(standard_frame, name, transfer, angle)
                yield f"frame/{name}/{transfer}/{angle}", frame


# -- small scenes ----------------------------------------------------------------------------------

#: Lists of the VDIs of small scenes.
SMALL = (64, 48)
CRITERIA = ("least-error", "homogeneity")
VOXELS = (
    "uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64",
    "bool", "float16", "int64", "uint64",
)  # fmt: skip
INTERPOLATIONS = ("nearest", "linear")


def smooth(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    """Return smooth noise with a little detail, 0 to 1, float64: sums and products only."""
    rng = np.random.default_rng(seed)
    field = rng.random(tuple(max(3, edge // 5) for edge in shape))
    for axis, edge in enumerate(shape):
        at = np.arange(edge) * ((field.shape[axis] - 1) / (edge - 1))
        low = np.minimum(at.astype(int), field.shape[axis] - 2)
        share = (at - low).reshape([-1 if a == axis else 1 for a in range(len(shape))])
        field = field.take(low, axis) * (1 - share) + field.take(low + 1, axis) * share
    field = 0.9 * field + 0.1 * rng.random(shape)
    return (field - field.min()) / (field.max() - field.min())


def cast(field: np.ndarray, dtype: str) -> np.ndarray:
    """Return noise in a voxel type: over all that an integer holds, -15 to 35 as float."""
    kind = np.dtype(dtype)
    if kind.kind == "b":
        return field > 0.5
    if kind.kind == "f":
        return (50 * (field - 0.3)).astype(kind)
    most = min(np.iinfo(kind).max, 2**40)
    least = max(np.iinfo(kind).min, -(2**40))
    return np.round(least + field * (float(most) - least)).astype(kind)


@functools.cache
def noise(dtype: str = "float32", shape: tuple[int, int, int] = (26, 30, 34)) -> pvdi.Volume:
    """Return a volume of smooth noise whose spacings differ."""
    return pvdi.Volume(cast(smooth(5, shape), dtype), (1.0, 0.8, 1.25), (3.0, -2.0, 1.0))


@functools.cache
def rgba() -> pvdi.Volume:
    """Return a volume of colours with opacity."""
    parts = [smooth(seed, (22, 26, 24)) for seed in range(4)]
    return pvdi.Volume(np.round(255 * np.stack(parts, axis=-1)).astype(np.uint8))


def ramp(
    low: float, high: float, opacity: float = 0.6, *, seed: int = 7, n: int = 24, **options: Any
) -> pvdi.TransferFunction:
    """Return random colours whose lower third is transparent, and then ever less so."""
    shares = np.arange(n) / max(n - 1, 1)
    opacities = opacity * np.clip(1.5 * shares - 0.5, 0, 1)
    colors = np.random.default_rng(seed).random((n, 3))
    return pvdi.TransferFunction(colors, opacities, (low, high), **options)


def over(volume: pvdi.Volume, **options: Any) -> pvdi.TransferFunction:
    """Return :func:`ramp` over a volume's scalars."""
    return ramp(*volume.finite_range(), **options)


def made(
    volume: pvdi.Volume, transfer_function: pvdi.TransferFunction | None = None, **options: Any
) -> pvdi.VDI:
    """Return a VDI of a small scene."""
    camera = options.pop("camera", None) or outside(volume.bounds, 25.0)
    size = options.pop("size", SMALL)
    function = transfer_function or over(volume, interpolation="linear")
    return pvdi.generate(volume, camera, size, transfer_function=function, **options)


def pictured(
    volume: pvdi.Volume, transfer_function: pvdi.TransferFunction | None = None, **options: Any
) -> Any:
    """Return the volume itself, drawn from another place than :func:`made` has."""
    camera = options.pop("camera", None) or outside(volume.bounds, -40.0, 35.0)
    size = options.pop("size", SMALL)
    function = transfer_function or over(volume, interpolation="linear")
    return pvdi.render_volume(volume, camera, size, transfer_function=function, **options)


def both(
    name: str, volume: Callable[[], pvdi.Volume], function: Any = None, **options: Any
) -> Iterator[tuple[str, Case]]:
    """Yield a VDI of a volume, and its picture; ``function`` makes of it a transfer function."""

    def case(make: Any) -> Any:
        given = volume()
        return make(given, None if function is None else function(given), **options)

    yield f"generate/{name}", functools.partial(case, made)
    yield f"volume/{name}", functools.partial(case, pictured)


def criterion_cases() -> Iterator[tuple[str, Case]]:
    """Yield what decides where lists are cut: criteria, lengths, tolerances, cones, steps."""
    for criterion in CRITERIA:
        for limit in (1, 4, 20, 300):
            for tolerance in (0.0, 0.02):
                options = {"criterion": criterion, "max_supersegments": limit}
                yield (
                    f"generate/{criterion}/{limit}/{tolerance}",
                    lambda o=options, t=tolerance: made(noise(), tolerance=t, **o),
                )
    for limit in (2, 3, 8, 60, 4096):
        size = (12, 9) if limit > 1000 else SMALL
        yield (
            f"generate/limit/{limit}",
            lambda n=limit, s=size: made(noise("uint8"), max_supersegments=n, size=s),
        )
    for cone in (0, 30, 90):
        yield (
            f"generate/cone/{cone}",
            lambda c=cone: made(noise(), view_cone=c, tolerance=0.01, max_supersegments=6),
        )
    for interpolation in INTERPOLATIONS:
        function = functools.partial(over, interpolation=interpolation)
        for step in (0.1, 0.37, 1.0, 4.0):
            yield from both(f"step/{step}/{interpolation}", noise, function, sample_distance=step)
        # Above 1024 and 8192 steps sums carry what they round off
        for step in (0.004, 0.0007):
            small = functools.partial(noise, "uint8", (4, 5, 6))
            options = {"sample_distance": step, "size": (12, 9)}
            yield from both(f"steps/{step}/{interpolation}", small, function, **options)
    for size in ((1, 1), (1, 40), (40, 1), (37, 23), (130, 5)):
        yield f"generate/window/{size[0]}x{size[1]}", lambda s=size: made(noise("uint8"), size=s)
    for precision in PRECISIONS:
        yield f"generate/precision/{precision}", lambda p=precision: made(noise(), precision=p)
    yield "generate/dial/fast", lambda: made(noise(), quality="fast", size=(240, 160))
    yield "generate/dial/bytes", lambda: made(noise(), max_bytes=400_000, size=(240, 160))


def special_volumes() -> dict[str, tuple[Callable[[], pvdi.Volume], Any]]:
    """Return volumes out of the ordinary by name, and what makes transfer functions of them."""
    field = smooth(11, (18, 20, 22))
    holes = field.astype(np.float32)
    holes[4:7, 5:9, 6:12] = np.nan
    holes[10, 10, 10:14] = (np.inf, -np.inf, 1e30, -1e30)
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.1, 0.0, 1.0]])
    clamped = functools.partial(ramp, 0.3, 0.6)
    one_entry = functools.partial(pvdi.TransferFunction, [(0.2, 0.5, 0.9)], [0.3], (0.0, 1.0))
    values: dict[str, tuple[np.ndarray, dict[str, Any], Any]] = {
        "far-range": (field + 3e4, {}, None),
        "far-range-f32": ((field + 3e4).astype(np.float32), {}, None),
        "far-range-i32": (np.round(100 * field).astype(np.int32) + 2**30, {}, None),
        "huge": ((field * 1e38).astype(np.float32), {}, None),
        "tiny": ((field * 1e-36).astype(np.float32), {}, None),
        "holes": (holes, {}, lambda **o: ramp(0.0, 1.0, **o)),
        "step": (field.astype(np.float32), {}, lambda **o: ramp(0.5, 0.5, **o)),
        "step-u8": (np.round(255 * field).astype(np.uint8), {}, lambda **o: ramp(120, 120, **o)),
        "clamped": (field.astype(np.float32), {}, clamped),
        "clamped-u16": (
            np.round(1000 * field).astype(np.uint16),
            {},
            lambda **o: ramp(-3, 400, **o),
        ),
        "one-entry": (field.astype(np.float32), {}, one_entry),
        "flat": (np.full((5, 6, 7), 3.0), {}, lambda **o: ramp(0.0, 4.0, **o)),
        "two-points": (field[:2, :2, :2].astype(np.float32), {}, None),
        "thin": (np.round(255 * field[:2]).astype(np.uint8), {}, None),
        "anisotropic": (field.astype(np.float32), {"spacing": (0.2, 1.0, 5.0)}, None),
        "direction": (field.astype(np.float32), {"direction": turn}, None),
        "origin": (np.round(255 * field).astype(np.uint8), {"origin": (1e6, -7e5, 3e5)}, None),
        "nanometres": (field.astype(np.float32), {"spacing": (1e-9, 2e-9, 1e-9)}, None),
        "opaque": (field.astype(np.float32), {}, lambda **o: ramp(0.0, 1.0, 1.0, **o)),
        "dense": (field.astype(np.float32), {}, lambda **o: ramp(0, 1, unit_distance=1e-3, **o)),
        "transparent": (field.astype(np.float32), {}, lambda **o: ramp(2.0, 3.0, **o)),
    }

    def volume(array: np.ndarray, options: dict[str, Any]) -> pvdi.Volume:
        return pvdi.Volume(array, **options)

    def function(given: pvdi.Volume, own: Any = None, **options: Any) -> pvdi.TransferFunction:
        return over(given, **options) if own is None else own(**options)

    return {
        name: (
            functools.cache(functools.partial(volume, array, options)),
            functools.partial(function, own=own),
        )
        for name, (array, options, own) in values.items()
    }


def volume_cases() -> Iterator[tuple[str, Case]]:
    """Yield what volumes and transfer functions may be, nearest and linear."""
    for interpolation in INTERPOLATIONS:
        function = functools.partial(over, interpolation=interpolation)
        for dtype in VOXELS:
            name = f"dtype/{dtype}/{interpolation}"
            yield from both(name, functools.partial(noise, dtype), function)
        for special, (volume, own) in special_volumes().items():
            own = functools.partial(own, interpolation=interpolation)
            yield from both(f"{special}/{interpolation}", volume, own)
        yield from both(f"rgba/{interpolation}", rgba, function)
        for dtype in ("uint8", "int16", "float32"):
            options = {"gradient_opacities": (0.0, 0.2, 1.0, 0.7), "gradient_range": (0.0, 9.0)}
            graded = functools.partial(over, interpolation=interpolation, **options)
            name = f"gradient/{dtype}/{interpolation}"
            yield from both(name, functools.partial(noise, dtype), graded)
    for options in ({"early_termination": False}, {"skip_empty": False}, {"opacity_multiplier": 3}):
        (name,) = options
        yield f"volume/{name}", lambda o=options: pictured(noise("uint8"), **o)
    for name, ends in view_options(noise().bounds, outside(noise().bounds), SMALL).items():
        if not {"preview_samples", "transmittance_cutoff"} & ends.keys():
            yield (
                f"volume/view/{name}",
                lambda o=ends: pictured(noise("uint8"), camera=outside(noise().bounds), **o),
            )


def lighting_cases() -> Iterator[tuple[str, Case]]:
    """Yield lights, materials and ambient occlusion."""
    spot = pvdi.Light(
        "scene", (30, -20, 40), (16, 10, 17), diffuse=(1, 0.8, 0.5), positional=True,
        attenuation=(0.5, 0.01, 0.001), cone_angle=25, exponent=3,
    )  # fmt: skip
    bulb = pvdi.Light("scene", (16, 10, 60), positional=True, cone_angle=180)
    lamp = pvdi.Light("camera", (0.5, 0.7, 1.0), ambient=(0.2, 0.1, 0.3), intensity=0.7)
    sun = pvdi.Light("scene", (100, 20, 300), specular=(0.3, 0.9, 0.4))
    matt = pvdi.Shading()
    shiny = pvdi.Shading(0.2, 0.5, 0.9, 40)
    sharp = pvdi.Shading(0.0, 0.3, 1.0, 400)
    scenes: dict[str, tuple[pvdi.Shading, Any]] = {
        "headlight": (matt, None),
        "shiny": (shiny, None),
        "sharp": (sharp, None),
        "sun": (shiny, [sun]),
        "camera": (shiny, [lamp]),
        "spot": (shiny, [spot]),
        "many": (sharp, [spot, bulb, lamp, sun, pvdi.Light(intensity=0.3)]),
        "one-sided": (shiny, pvdi.Lights((sun, bulb), two_sided=False)),
        "dark": (shiny, []),
    }
    for interpolation in INTERPOLATIONS:
        for name, (shading, lights) in scenes.items():
            lit = functools.partial(over, interpolation=interpolation, shading=shading)
            yield from both(f"lit/{name}/{interpolation}", noise, lit, lights=lights)
        for dtype in ("uint8", "float64"):
            lit = functools.partial(over, interpolation=interpolation, shading=shiny)
            volume = functools.partial(noise, dtype)
            yield from both(f"lit/{dtype}/{interpolation}", volume, lit, lights=[lamp])
        lit = functools.partial(over, interpolation=interpolation, shading=matt)
        yield from both(f"lit/rgba/{interpolation}", rgba, lit)
        # Rays so far from the volume's points that positions on them are sums of two numbers
        far = {"camera": cameras(noise().bounds)["inside-wide"], "lights": [lamp]}
        far_lit = functools.partial(over, interpolation=interpolation, shading=shiny)
        yield from both(f"lit/far/{interpolation}", noise, far_lit, **far)
        far_plain = functools.partial(over, interpolation=interpolation)
        volume = functools.partial(noise, "uint8")
        yield from both(f"far/{interpolation}", volume, far_plain, camera=far["camera"])
        occluded = functools.partial(over, interpolation=interpolation)
        for name, given in {
            "default": True,
            "radius": 6.0,
            "strong": pvdi.AmbientOcclusion(4.0, 1.0, 64),
            "coarse": pvdi.AmbientOcclusion(30.0, 0.5, 12),
        }.items():
            name = f"occlusion/{name}/{interpolation}"
            yield from both(name, noise, occluded, ambient_occlusion=given)
        yield from both(f"occlusion/rgba/{interpolation}", rgba, occluded, ambient_occlusion=True)
        options = {"gradient_opacities": (0.1, 1.0), "gradient_range": (0.0, 5.0)}
        lit = functools.partial(over, interpolation=interpolation, shading=shiny, **options)
        name = f"occlusion/lit/{interpolation}"
        yield from both(name, noise, lit, lights=[sun, spot], ambient_occlusion=5.0)


def brick_cases() -> Iterator[tuple[str, Case]]:
    """Yield volumes that a memory limit has brought to the device brick by brick."""

    @functools.cache
    def large(dtype: str) -> pvdi.Volume:
        return pvdi.Volume(cast(smooth(2, (60, 90, 80)), dtype))

    @functools.cache
    def larger() -> pvdi.Volume:
        array = np.round(255 * smooth(6, (80, 100, 90))).astype(np.uint8)
        return pvdi.Volume(array.repeat(2, 0).repeat(2, 1).repeat(2, 2))

    @functools.cache
    def colours() -> pvdi.Volume:
        parts = [smooth(seed, (60, 90, 80)) for seed in range(4)]
        return pvdi.Volume(np.round(255 * np.stack(parts, axis=-1)).astype(np.uint8))

    shape = {"memory_limit": "2600 kB", "size": (24, 20)}
    graded = {"gradient_opacities": (0.1, 1.0), "gradient_range": (0.0, 5.0)}
    for dtype in ("float32", "float64"):
        for interpolation in INTERPOLATIONS:
            function = functools.partial(over, interpolation=interpolation)
            volume = functools.partial(large, dtype)
            yield from both(f"bricks/{dtype}/{interpolation}", volume, function, **shape)
    for name, options in {
        "shaded": {"shading": pvdi.Shading()},
        "graded": graded,
        "both": {"shading": pvdi.Shading(0.1, 0.5, 0.5, 300), **graded},
    }.items():
        function = functools.partial(over, interpolation="linear", **options)
        yield from both(f"bricks/{name}", functools.partial(large, "float32"), function, **shape)
    function = functools.partial(over, interpolation="linear")
    yield from both("bricks/rgba", colours, function, **shape)
    for interpolation in INTERPOLATIONS:
        function = functools.partial(over, interpolation=interpolation)
        options = {"memory_limit": "5 MB", "size": (24, 20)}
        yield from both(f"bricks/uint8/{interpolation}", larger, function, **options)
    tight = {**shape, "memory_limit": "2200 kB"}
    yield from both("bricks/int32", functools.partial(large, "int32"), None, **tight)
    tight = {"size": (12, 10), "memory_limit": "3 MB"}
    yield (
        "generate/bricks/homogeneity",
        lambda: made(large("float32"), criterion="homogeneity", **tight),
    )


# -- views -----------------------------------------------------------------------------------------


def transform(kind: str) -> np.ndarray:
    """Return a model transform, float64 (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = {
        "rigid": [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]],
        "mirror": [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "shear": [[1.0, 0.4, 0.0], [0.0, 1.5, 0.2], [0.1, 0.0, 0.7]],
    }[kind]
    matrix[:3, 3] = (5.0, -3.0, 2.0)
    return matrix


def cameras(bounds: Any) -> dict[str, pvdi.Camera]:
    """Return views of bounds by name: generating ones, and new ones."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, edges = box.mean(axis=1), box[:, 1] - box[:, 0]
    near = outside(bounds, 25.0, distance=0.8)
    inside = pvdi.Camera(centre + 0.1 * edges, centre + edges, (0, 0, 1), view_angle=80)
    side = pvdi.Camera(centre, centre + np.eye(3)[0], (0, 0, 1), parallel_projection=True)
    views = {
        "near": near,
        "long-lens": outside(bounds, 25.0, distance=6.0),
        "telescope": outside(bounds, 25.0, distance=300.0),
        "parallel": outside(bounds, 25.0, parallel_projection=True),
        "axis": side.replace(parallel_scale=0.7 * float(edges.max())),
        "inside": inside,
        "inside-wide": inside.replace(view_angle=165),
        "at-face": pvdi.Camera(centre * (1, 0, 1) + (0, box[1, 0], 0), centre, (0, 0, 1)),
        "away": near.replace(focal_point=2 * np.array(near.position) - centre),
        "behind": outside(bounds, 205.0, -30.0, distance=0.9),
        "above": outside(bounds, 10.0, 85.0, distance=0.9),
        "off-centre": near.replace(window_center=(0.4, -0.7)),
        "tile": near.tile((100, 80), (30, 20), (40, 30)),
        "horizontal": near.replace(use_horizontal_view_angle=True),
        "rolled": near.replace(view_up=(1, 0.5, 0.3)),
    }
    for kind in ("rigid", "mirror", "shear"):
        matrix = transform(kind)
        # The eye goes along, so that the view still shows it
        points = np.array([near.position, near.focal_point]) @ matrix[:3, :3].T + matrix[:3, 3]
        views[kind] = near.replace(
            position=points[0], focal_point=points[1], model_transform=matrix
        )
    return views


@functools.cache
def seen_from(name: str) -> pvdi.VDI:
    """Return the VDI of a small volume from one of :func:`cameras`."""
    volume = noise("uint8")
    return made(volume, camera=cameras(volume.bounds)[name], max_supersegments=12)


def camera_cases() -> Iterator[tuple[str, Case]]:
    """Yield every generating view, and its VDI from others; the volume itself from each."""
    bounds = noise("uint8").bounds
    for number, name in enumerate(cameras(bounds)):
        yield f"generate/view/{name}", functools.partial(seen_from, name)
        yield (
            f"volume/from/{name}",
            lambda n=name: pictured(noise("uint8"), camera=cameras(bounds)[n]),
        )

        def frame(own: str, other: str, precision: str) -> Any:
            vdi = seen_from(own).with_precision(precision)
            size = (220, 204) if other in ("behind", "above") else (70, 50)
            return pvdi.render(vdi, cameras(bounds)[other], size)

        others = ("near", "parallel", "inside", "behind", "above", "shear", name)
        for place, other in enumerate(dict.fromkeys(others)):
            precision = PRECISIONS[(number + place) % 3]
            yield f"render/from/{name}/{other}", functools.partial(frame, name, other, precision)


@functools.cache
def sheet(at: int, parallel: bool) -> pvdi.VDI:
    """Return a VDI of a thin sheet far behind, or near in, a deep volume: depths are relative."""
    array = np.zeros((20, 320, 24), np.float32)
    array[:, at] = smooth(3, (20, 24))
    volume = pvdi.Volume(array, (1, 1, 1))
    camera = pvdi.Camera(
        (11.5, -250, 9.5), (11.5, 0, 9.5), (0, 0, 1),
        view_angle=5 if at < 100 else 2.5, parallel_projection=parallel, parallel_scale=11,
    )  # fmt: skip
    return made(volume, camera=camera, size=(80, 60))


@functools.cache
def empty() -> pvdi.VDI:
    """Return a VDI in which nothing is."""
    return made(noise("uint8"), ramp(300, 400), size=(20, 15))


@functools.cache
def drawn(name: str, precision: str = "exact") -> pvdi.VDI:
    """Return a VDI to draw: 240 x 210 lists, so that all ways of following rays are taken."""
    if name.startswith("sheet"):
        vdi = sheet(315 if "far" in name else 2, "parallel" in name)
    elif name == "empty":
        vdi = empty()
    else:
        volume = pvdi.Volume(np.round(255 * smooth(4, (40, 48, 44))).astype(np.uint8))
        vdi = made(volume, camera=cameras(volume.bounds)[name], size=(240, 210))
    return vdi.with_precision(precision)


@functools.cache
def wide_vdi(size: tuple[int, int]) -> pvdi.VDI:
    """Return a VDI of so many lists along an edge that sums over them carry what they round off."""
    volume = noise("uint8")
    return made(volume, size=size, camera=outside(volume.bounds, view_angle=20))


def shown(name: str, vdi: pvdi.VDI) -> Any:
    """Return the bounds of what there is to see, to cut it with planes."""
    at = 315 if "far" in name else 2
    x0, x1, y0, y1, z0, z1 = vdi.bounds
    return (
        (x0, x1, at - 3, at + 3, z0, z1) if name.startswith("sheet") else (x0, x1, y0, y1, z0, z1)
    )


def view_options(bounds: Any, camera: pvdi.Camera, size: tuple[int, int]) -> dict[str, Any]:
    """Return keyword arguments of ``render`` by name."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, edges = box.mean(axis=1), box[:, 1] - box[:, 0]
    third = np.stack([box[:, 0] + edges / 3, box[:, 0] + 2 * edges / 3], axis=1).ravel()
    width, height = size
    depth = float(np.dot(centre - camera.position, camera.axes[2]))
    ends = depth + 0.4 * float(edges.max()) * (smooth(8, (height, width)) - 0.5)
    ends = ends.astype(np.float32)
    ends[: height // 3, : width // 3] = np.inf
    plane = [*centre, 0.3, 0.8, -0.2]
    planes = [plane, [*(centre + 0.2 * edges), -1, 0, 0], [*centre, 0, 0.2, 1]]
    return {
        "plain": {},
        "depth": {"opaque_depth": ends},
        "plane": {"clipping_planes": [plane]},
        "planes": {"clipping_planes": planes},
        "box": {"cropping": third},
        "open-box": {"cropping": [third[0], np.inf, -np.inf, third[3], *third[4:]]},
        "fence": {"cropping": (third, "fence")},
        "inverted-fence": {"cropping": (third, "inverted_fence")},
        "cross": {"cropping": pvdi.Cropping(tuple(third), "cross")},
        "inverted-cross": {"cropping": (third, "inverted_cross")},
        "regions": {"cropping": (third, 0x2A5F0C3)},
        "nothing": {"cropping": (third, 0)},
        "thin": {"opacity_multiplier": 0.2},
        "thick": {"opacity_multiplier": 6.0},
        "clear": {"opacity_multiplier": 0.0},
        "no-skip": {"skip_empty": False},
        "all": {
            "opaque_depth": ends, "clipping_planes": [plane], "cropping": (third, "cross"),
            "opacity_multiplier": 2.0,
        },
        "cutoff-0": {"transmittance_cutoff": 0.0},
        "cutoff-0.004": {"transmittance_cutoff": 0.004},
        "cutoff-0.5": {"transmittance_cutoff": 0.5, "clipping_planes": [plane]},
        "preview-1": {"preview_samples": 1},
        "preview-30": {"preview_samples": 30},
        "preview-cropped": {"preview_samples": 40, "cropping": (third, "fence")},
        "preview-clipped": {"preview_samples": 25, "opaque_depth": ends, "clipping_planes": planes},
    }  # fmt: skip


def new_views(vdi: pvdi.VDI) -> list[tuple[pvdi.Camera, tuple[int, int]]]:
    """Return V_O, a near view in a small window, and two in which packets may pay."""
    own = vdi.camera
    return [
        (own, vdi.window_size),
        (own.azimuth(12), (90, 70)),
        (own.azimuth(85), (230, 210)),
        (own.elevation(75), (208, 220)),
    ]


def option_cases() -> Iterator[tuple[str, Case]]:
    """Yield frames by every option, of VDIs that take different ways, in a precision each."""

    def frames(name: str, precision: str, option: str) -> Any:
        vdi = drawn(name, precision)
        return [
            pvdi.render(vdi, view, size, **view_options(shown(name, vdi), view, size)[option])
            for view, size in new_views(vdi)
        ]

    names = tuple(view_options((0, 1, 0, 1, 0, 1), outside((0, 1, 0, 1, 0, 1)), (4, 3)))
    vdis = ("near", "long-lens", "parallel", "sheet-near", "sheet-far", "sheet-far-parallel")
    few = ("plain", "depth", "plane", "regions", "all", "preview-30")
    for number, name in enumerate(vdis):
        for place, option in enumerate(names):
            if name.startswith("sheet-far") and option not in few:
                continue
            precision = PRECISIONS[(number + place) % 3]
            case = functools.partial(frames, name, precision, option)
            yield f"render/{name}/{option}/{precision}", case
            if option in ("plain", "regions", "preview-30") and number < 4:
                for other in (p for p in PRECISIONS if p != precision):
                    case = functools.partial(frames, name, other, option)
                    yield f"render/{name}/{option}/{other}", case
    for option in ("plain", "box", "preview-30"):
        yield f"render/empty/{option}", functools.partial(frames, "empty", "exact", option)
    for samples in (2000, 9000):  # sums carry what they round off
        yield (
            f"render/near/preview-{samples}",
            lambda n=samples: pvdi.render(
                drawn("near"), drawn("near").camera.azimuth(20), (30, 20), preview_samples=n
            ),
        )

    def wide(size: tuple[int, int], precision: str) -> Any:
        vdi = wide_vdi(size).with_precision(precision)
        return [pvdi.render(vdi, vdi.camera.azimuth(turn), (40, 30)) for turn in (0, 10, 85)]

    for size in ((1100, 6), (6, 1100), (8400, 2)):  # as do those over so many lists
        for precision in PRECISIONS:
            name = f"render/wide/{size[0]}x{size[1]}/{precision}"
            yield name, functools.partial(wide, size, precision)


def hit_cases() -> Iterator[tuple[str, Case]]:
    """Yield depths of first hits, and picks."""
    wants = {
        "default": {},
        "any": {"opacity_threshold": 0.0},
        "opaque": {"opacity_threshold": 0.9},
        "each": {"opacity_threshold": 0.2, "accumulated": False},
    }
    ways = ("plain", "depth", "planes", "box", "regions", "thick", "clear", "no-skip", "all")

    def depths(name: str, precision: str, want: str, option: str) -> Any:
        vdi = drawn(name, precision)
        return [
            pvdi.render_depth(
                vdi, view, size, **wants[one], **view_options(shown(name, vdi), view, size)[option]
            )
            for view, size in new_views(vdi)[:3]
            for one in dict.fromkeys(("any", want))
        ]

    def picks(name: str, precision: str, want: str, option: str) -> Any:
        vdi = drawn(name, precision)
        found = []
        for view, (width, height) in new_views(vdi)[1:3]:
            wanted = wants[want] if height < 100 else wants["any"]
            options = dict(view_options(shown(name, vdi), view, (width, height))[option])
            options.pop("skip_empty", None)
            ends = options.pop("opaque_depth", None)
            for y in range(height // 8, height, height // 4):
                for x in range(width // 8, width, width // 4):
                    end = {} if ends is None else {"opaque_depth": float(ends[height - 1 - y, x])}
                    hit = pvdi.pick(
                        vdi, view, (x + 0.25, y), (width, height), **wanted, **end, **options
                    )
                    found.append(hit and [hit.position, hit.depth, hit.list, hit.index])
                    found.append(hit and [hit.supersegment, hit.color, hit.optical_depth])
                    found.append(hit and hit.accumulated_optical_depth)
        return found

    vdis = ("near", "long-lens", "parallel", "sheet-near")
    for number, name in enumerate(vdis):
        for place, option in enumerate(ways):
            want, precision = tuple(wants)[(number + place) % 4], PRECISIONS[(number + place) % 3]
            given = (name, precision, want, option)
            yield f"depth/{'/'.join((name, option, want))}", functools.partial(depths, *given)
            yield f"pick/{'/'.join((name, option, want))}", functools.partial(picks, *given)


# -- VDIs of random media --------------------------------------------------------------------------


@functools.cache
def random_vdi(seed: int) -> pvdi.VDI:
    """Return a VDI of random lists, short and long, touching and apart, some beyond the bounds."""
    rng = np.random.default_rng([seed, 77])
    edges = rng.uniform(1, 4, size=3)
    centre = rng.normal(size=3) * (0.0, 2.0, 20.0)[seed % 3]
    bounds = np.stack([centre - edges / 2, centre + edges / 2], axis=1).ravel()
    distance = (0.7, 1.2, 3.0, 40.0)[seed % 4]
    camera = outside(bounds, rng.uniform(0, 360), rng.uniform(-60, 60), distance=distance)
    camera = camera.replace(parallel_projection=seed % 5 == 4)
    width, height = (int(n) for n in rng.integers(2, 40, size=2))
    corners = np.array([bounds[[i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2 & 1)]] for i in range(8)])
    depth = (corners - camera.position) @ camera.axes[2]
    near, far = float(depth.min()), float(depth.max())
    first = near - 0.1 * (far - near)
    first = first if camera.parallel_projection else max(first, 0.0)
    origin = near if seed % 2 and near > 0 else 0.0
    lists = []
    for count in rng.integers(0, (3, 12, 60)[seed % 3], size=width * height):
        gaps = rng.exponential(size=count) * (rng.random(count) < 0.5)
        media = rng.exponential(size=count) + 0.01 * count
        ends = np.cumsum(np.column_stack([gaps, media]).ravel())
        ends = first + (far - first) * rng.uniform(0.5, 1) * ends / max(ends[-1:].sum(), 1e-9)
        lists.append((ends - origin).reshape(count, 2))
    front, back = np.concatenate(lists).astype(np.float32).T
    n = len(front)
    offsets = np.concatenate([[0], np.cumsum([len(one) for one in lists])]).astype(np.uint64)
    tau = rng.choice([1e-4, 0.03, 0.5, 4.0, 90.0, 0.0], size=n) * rng.random(n)
    return pvdi.VDI(
        camera, (width, height), offsets, front, back, rng.random((n, 3)), tau, bounds,
        depth_origin=origin, metadata={"made_by": "bits"},
    )  # fmt: skip


def random_cases() -> Iterator[tuple[str, Case]]:
    """Yield frames of random VDIs from everywhere."""

    def frame(seed: int, view: str, precision: str) -> Any:
        vdi = random_vdi(seed).with_precision(precision)
        options = {"preview_samples": 17} if view == "near" and seed % 3 == 0 else {}
        size = (210, 200) if view in ("above", "rigid") else (61, 47)
        camera = vdi.camera if view == "own" else cameras(vdi.bounds)[view]
        return pvdi.render(vdi, camera, vdi.window_size if view == "own" else size, **options)

    views = ("own", "near", "parallel", "axis", "inside", "behind", "above", "rigid", "telescope")
    for seed in range(8):
        yield f"random/{seed}", functools.partial(random_vdi, seed)
        for precision in PRECISIONS[1:]:
            yield (
                f"random/{seed}/{precision}",
                lambda s=seed, p=precision: random_vdi(s).with_precision(p),
            )
        for place, view in enumerate(views):
            precision = PRECISIONS[(seed + place) % 3]
            yield f"random/{seed}/{view}", functools.partial(frame, seed, view, precision)


# -- several VDIs ----------------------------------------------------------------------------------


def joint_cases() -> Iterator[tuple[str, Case]]:
    """Yield frames of several VDIs."""
    shift = np.eye(4)
    shift[:3, 3] = (9.0, 2.0, 4.0)
    apart = np.eye(4)
    apart[:3, 3] = (60.0, 0.0, 0.0)
    there = (np.eye(4), shift, transform("rigid"))
    bounds = noise("uint8").bounds
    scenes: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
        "two": (("near", "behind"), {}),
        "three": (("near", "long-lens", "parallel"), {"model_transforms": there}),
        "apart": (("near", "behind"), {"model_transforms": (np.eye(4), apart)}),
        "partly": (("near", "behind", "near"), {"model_transforms": (np.eye(4), shift, apart)}),
        "multiplied": (("near", "behind"), {"opacity_multiplier": [0.3, 4.0]}),
        "no-skip": (("near", "parallel"), {"skip_empty": False}),
        "cropped": (
            ("near", "parallel"),
            {"cropping": [(noise().bounds, "cross"), None], "model_transforms": there[:2]},
        ),
        "boxed": (("near", "above"), {"cropping": [None, (5, 25, 0, 14, 6, 20)]}),
        "fenced": (("inside", "above"), {"cropping": [((9, 24, 3, 13, 9, 21), "fence"), None]}),
        "sheets": (("sheet-near", "sheet-far", "sheet-far-parallel"), {}),
        "with-empty": (("near", "empty"), {}),
        "clipped": (("near", "behind"), {"clipping_planes": [[16, 8, 15, 1, 0.2, 0]]}),
        "clipped-each": (
            ("near", "behind"),
            {"clipping_planes": [[[16, 8, 15, 1, 0.2, 0]], None], "model_transforms": there[1:]},
        ),
        "one": (("near",), {"model_transforms": (shift,)}),
        "wide": (("1100x6", "near"), {}),
        "very-wide": (("8400x2", "near", "behind"), {}),
    }

    def vdi(name: str, precision: str) -> pvdi.VDI:
        if "x" in name:
            width, height = map(int, name.split("x"))
            return wide_vdi((width, height)).with_precision(precision)
        if name.startswith(("empty", "sheet")):
            return drawn(name, precision)
        return seen_from(name).with_precision(precision)

    def frames(scene: str, precisions: tuple[str, ...], opaque: bool) -> Any:
        names, options = scenes[scene]
        vdis = [vdi(name, p) for name, p in zip(names, precisions * 3, strict=False)]
        view = outside(vdis[0].bounds, 60.0, distance=1.6)
        views = [(view, (120, 90)), (vdis[0].camera.azimuth(20), (64, 48))]
        if opaque:
            ends = view_options(bounds, view, (120, 90))["depth"]
            return pvdi.render(vdis, *views[0], **ends, **options)
        return [pvdi.render(vdis, camera, size, **options) for camera, size in views]

    for number, scene in enumerate(scenes):
        given = (PRECISIONS[number % 3 :] + PRECISIONS)[:3]
        yield f"joint/{scene}", functools.partial(frames, scene, given, False)
        yield f"joint/{scene}/opaque", functools.partial(frames, scene, ("exact",), True)


# -- files, and other forms ------------------------------------------------------------------------


def saved(vdi: pvdi.VDI, suffix: str, **options: Any) -> Any:
    """Return a file's content, without the version that wrote it, and the VDI read from it."""
    with tempfile.TemporaryDirectory() as folder:
        path = vdi.save(Path(folder) / f"vdi{suffix}", **options)
        version = f"pyvista-vdi {pvdi.__version__}".encode()
        if suffix == ".vdi":  # a ZIP file: its sums depend on the version
            with zipfile.ZipFile(path) as archive:
                parts = [
                    n.encode() + archive.read(n).replace(version, b"") for n in archive.namelist()
                ]
        else:  # VTK's, with its version in it
            parts = []
        return [*parts, pvdi.read(path)]


def file_cases() -> Iterator[tuple[str, Case]]:
    """Yield files of each kind, and the VDIs that are read from them."""
    of = {
        "small": lambda: seen_from("near"),
        "parallel": lambda: seen_from("parallel"),
        "random": lambda: random_vdi(2),
        "empty": empty,
    }
    plain = functools.cache(
        lambda name: pvdi.VDI(
            *(getattr(of[name](), n) for n in ("camera", "window_size", *ARRAYS, "bounds")),
            depth_origin=of[name]().depth_origin,
            metadata={"made_by": "bits"},
        )
    )
    for name in of:
        for precision in PRECISIONS:
            for compression in ("lz4", "zstd", "none"):
                options = {"precision": precision, "compression": compression}
                yield (
                    f"file/vdi/{name}/{precision}/{compression}",
                    lambda n=name, o=options: saved(plain(n), ".vdi", **o),
                )
        yield f"file/vti/{name}", lambda n=name: saved(plain(n), ".vti")
    for level in (1, 5, 9):
        options = {"compression": "zstd", "level": level}
        yield f"file/vdi/level/{level}", lambda o=options: saved(plain("small"), ".vdi", **o)
    yield "file/vti/zlib", lambda: saved(plain("small"), ".vti", compression="zlib", level=3)


def form_cases() -> Iterator[tuple[str, Case]]:
    """Yield what comes by PyVista's and VTK's objects, and what is said of VDIs and pictures."""

    @functools.cache
    def image() -> Any:
        import pyvista as pv

        grid = pv.ImageData(dimensions=(24, 22, 20), spacing=(1, 1.2, 0.9), origin=(4, 5, 6))
        grid["values"] = smooth(9, (20, 22, 24)).ravel() * 40 + 2
        grid.cell_data["cells"] = smooth(10, (19, 21, 23)).ravel()
        return grid

    def by(make: Any, **options: Any) -> Any:
        import pyvista as pv

        camera = pv.Camera()
        camera.position, camera.focal_point, camera.up = (60, -40, 50), (15, 18, 14), (0, 0, 1)
        return make(image(), camera, SMALL, **options)

    ways: dict[str, dict[str, Any]] = {
        "default": {},
        "cells": {"scalars": "cells", "preference": "cell", "cmap": "coolwarm"},
        "values": {"scalars": "values", "cmap": "gist_ncar", "opacity": "geom"},
        "log": {"scalars": "values", "log_scale": True, "opacity": "linear_r"},
        "colours": {"scalars": "values", "n_colors": 7, "flip_scalars": True, "opacity": 0.3},
        "clim": {"scalars": "values", "clim": (10, 30), "opacity_unit_distance": 2.5},
        "shade": {"scalars": "values", "shade": True, "specular": 0.7, "specular_power": 30},
        "linear": {"scalars": "values", "interpolation": "linear", "opacity": "sigmoid_5"},
    }
    for name, options in ways.items():
        yield f"generate/pyvista/{name}", lambda o=options: by(pvdi.generate, **o)
        yield f"volume/pyvista/{name}", lambda o=options: by(pvdi.render_volume, **o)

    def said(name: str) -> Any:
        vdi = drawn(name)
        told = {k: v for k, v in vdi.metadata.items() if k != "generator"}
        told = json.dumps(told, sort_keys=True)
        return [told, vdi.counts, vdi.nbytes, repr(vdi), repr(vdi.list_at(31, 22))]

    for name in ("near", "parallel", "sheet-near"):
        yield f"said/{name}", functools.partial(said, name)
    yield (
        "said/comparison",
        lambda: pvdi.compare_images(
            pvdi.render(seen_from("near"), seen_from("near").camera.azimuth(9)),
            pictured(noise("uint8"), camera=seen_from("near").camera.azimuth(9)),
        ),
    )
    for criterion in CRITERIA[:2]:
        yield (
            f"said/estimate/{criterion}",
            lambda c=criterion: pvdi.estimate(
                noise(), (640, 360), criterion=c, ambient_occlusion=True, memory_limit="1 GiB"
            ),
        )


# -- running ---------------------------------------------------------------------------------------


def all_cases() -> dict[str, Case]:
    """Return every case by name, in the order in which they share what is cached."""
    cases: dict[str, Case] = {}
    groups = (
        standard_cases,
        criterion_cases,
        volume_cases,
        lighting_cases,
        brick_cases,
        camera_cases,
        option_cases,
        hit_cases,
        random_cases,
        joint_cases,
        file_cases,
        form_cases,
    )
    for group in groups:
        for name, case in group():
            if name in cases:
                raise ValueError(f"two cases are called {name}")
            cases[name] = case
    return cases


def chosen_device(text: str | None) -> Any:
    """Return the device: its place in ``list_devices()``, or what ``device=`` takes."""
    devices = pvdi.list_devices()
    if text is not None and text.isdigit() and int(text) < len(devices):
        text = devices[int(text)].selector
    if text is not None:
        os.environ["PYVISTA_VDI_DEVICE"] = text  # for every call below
    text = os.environ.get("PYVISTA_VDI_DEVICE")
    if text is None:
        raise SystemExit("name a device by --device, such as 0 or 1: " + pvdi.describe_devices())
    named = [device for device in devices if device.selector == text]
    return named[0] if named else None


def run(cases: Mapping[str, Case], *, verbose: bool) -> dict[str, str]:
    """Return the hash of each case; of one that fails, the error."""
    hashes = {}
    for name, case in cases.items():
        began = time.perf_counter()
        try:
            hashes[name] = digest(case())
        except Exception as error:
            hashes[name] = f"failed: {type(error).__name__}: {error}"
            print(f"{name}: {hashes[name]}", file=sys.stderr)
        if verbose:
            print(f"{time.perf_counter() - began:7.3f} s  {name}", file=sys.stderr)
    return hashes


def compare(old: Path, new: Path, wanted: Callable[[str], bool]) -> int:
    """Print what differs and what one of the files lacks; return 1 if anything does."""
    files = [json.loads(path.read_text()) for path in (old, new)]
    for entry in ("platform", "device", "driver"):
        values = [file.get(entry) for file in files]
        if values[0] != values[1]:
            print(f"note: {entry} differs, {values[0]!r} and {values[1]!r}")
    before, after = ({n: h for n, h in file["cases"].items() if wanted(n)} for file in files)
    both = before.keys() & after.keys()
    differing = [name for name in before if name in both and before[name] != after[name]]
    failed = [name for name in after if after[name].startswith("failed")]
    for words, names in (
        ("differs", differing),
        (f"missing in {new}", [name for name in before if name not in both]),
        (f"missing in {old}", [name for name in after if name not in both]),
        (f"failed in {new}", failed),
    ):
        for name in names[:MOST_NAMES]:
            print(f"{words}: {name}")
        if len(names) > MOST_NAMES:
            print(f"{words}: {len(names) - MOST_NAMES} more")
    print(
        f"{len(both)} cases in both files, {len(differing)} differ, "
        f"{len(before) - len(both)} missing, {len(after) - len(both)} new, {len(failed)} failed"
    )
    return int(bool(differing or failed or len(before) > len(both)))


def main() -> int:
    """Run the tool; return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--device", metavar="D", help="0, 1 ... or what device= takes")
    parser.add_argument("--out", type=Path, metavar="F", help="JSON file for the hashes")
    parser.add_argument(
        "--compare", type=Path, nargs=2, metavar=("A", "B"), help="two such files; runs nothing"
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        metavar="TEXT",
        help="cases with this in their name (may be repeated: any of them)",
    )
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--verbose", action="store_true", help="print the seconds of each case")
    arguments = parser.parse_args()

    def wanted(name: str) -> bool:
        return not arguments.only or any(text in name for text in arguments.only)

    if arguments.compare:
        return compare(*arguments.compare, wanted)
    cases = {name: case for name, case in all_cases().items() if wanted(name)}
    if arguments.list:
        print("\n".join(cases))
        return 0
    device = chosen_device(arguments.device)
    began = time.perf_counter()
    hashes = run(cases, verbose=arguments.verbose)
    seconds = time.perf_counter() - began
    failed = sum(value.startswith("failed") for value in hashes.values())
    print(
        f"{len(hashes)} cases, {failed} failed, {seconds:.0f} s, {Path(pvdi.__file__).parent}",
        file=sys.stderr,
    )
    result = {
        "version": pvdi.__version__,
        "platform": getattr(device, "platform", None),
        "device": getattr(device, "name", os.environ["PYVISTA_VDI_DEVICE"]),
        "driver": getattr(device, "driver", None),
        "seconds": round(seconds),
        "cases": hashes,
    }
    if arguments.out:
        arguments.out.write_text(json.dumps(result, indent=1) + "\n")
    else:
        print(json.dumps(hashes, indent=1))
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
