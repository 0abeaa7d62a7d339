"""Hashes of VDIs, frames and files by case: two versions that agree in them draw the same bits.

``PYVISTA_VDI_DEVICE=NAME python tools/bits.py old.json`` hashes what the cases make on one OpenCL
implementation; the same with the new code, then ``python tools/bits.py old.json new.json``.
Hashes of two implementations differ: OpenCL C leaves them the last bits of elementary functions.
Only public names are used, and nothing from ``tests``, so that one file runs on both versions.
"""

# ruff: noqa: T201
from __future__ import annotations

import hashlib
import json
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import pyvista_vdi as pvdi

#: A case makes something; its hash is what is kept.
Case = Callable[[], Any]
Cases = Iterator[tuple[str, Case]]

ARRAYS = ("offsets", "front", "back", "color", "optical_depth", "bounds")
PRECISIONS = ("exact", "8-byte")

SMALL = (64, 48)

#: Volumes of ``examples``, of several types and spacings; the shipped two come first.
REAL = ("brain", "rayleigh_taylor", "t1w_head", "heptane", "isabel_wind", "tooth")
LOOKS: dict[str, dict[str, Any]] = {
    "soft": {"cmap": "bone", "opacity": "linear"},
    "steep": {"cmap": "viridis", "opacity": "sigmoid_10"},
    "opaque": {"cmap": "inferno", "opacity": (0.0, 0.0, 0.02, 0.9, 1.0)},
}

#: Degrees from V_O, and the window there: at 0 its own, small and near, and such that rays are
#: followed in blocks, one by one, and in packets.
VIEWS = {0: (200, 150), 5: (240, 160), 30: (320, 220), 90: (240, 256), 180: (256, 208)}


def content(thing: Any) -> bytes:
    """Return the bytes of a VDI, an array, a text, a number, or a sequence of them."""
    if isinstance(thing, pvdi.VDI):
        camera = json.dumps(thing.camera.to_dict(), sort_keys=True)
        told = [camera, thing.window_size, thing.depth_origin, thing.precision]
        return content([*told, *(getattr(thing, name) for name in ARRAYS)])
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype.str} {thing.shape}".encode() + thing.tobytes()
    if isinstance(thing, list | tuple):
        return b"".join(map(content, thing))
    return thing if isinstance(thing, bytes) else repr(thing).encode()


@cache
def real(name: str) -> pvdi.Volume:
    """Return an example with every n-th of its points, at most 128 along an axis."""
    whole = pvdi.examples.load_data(name, as_volume=True)
    steps = [-(-points // 128) for points in whole.array.shape]
    array = whole.array[tuple(slice(None, None, step) for step in steps)]
    return pvdi.Volume(array, np.asarray(whole.spacing) * steps[::-1])


@cache
def noise(kind: str = "float32", shape: tuple[int, int, int] = (26, 30, 34)) -> pvdi.Volume:
    """Return waves and noise in a voxel type, or out of the ordinary."""
    rng, places = np.random.default_rng(5), np.indices(shape).reshape(3, -1)
    waves = np.sin(rng.normal(0, 0.3, (9, 3)) @ places + rng.uniform(0, 6, (9, 1))).sum(axis=0)
    field = (waves + rng.random(waves.shape)).reshape(shape)
    field = (field - field.min()) / (field.max() - field.min())
    options: dict[str, Any] = {"spacing": (1.0, 0.8, 1.25), "origin": (3.0, -2.0, 1.0)}
    array = (50 * (field - 0.3)).astype(np.float32)
    if kind == "rgba":
        parts = [np.roll(field, 5 * n, axis=n % 3) for n in range(4)]
        array = np.round(255 * np.stack(parts, axis=-1)).astype(np.uint8)
    elif kind == "holes":
        array[4:7, 5:9, 6:12], array[10, 10, 10:12] = np.nan, (np.inf, -np.inf)
    elif kind == "turned":
        options["direction"] = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.1, 0.0, 1.0]])
    elif kind in ("huge", "far"):
        array = array * np.float32(1e36) if kind == "huge" else array + np.float32(3e4)
    elif np.dtype(kind).kind in "iu":
        low, high = max(np.iinfo(kind).min, -(2**40)), min(np.iinfo(kind).max, 2**40)
        array = np.round(low + field * (float(high) - low)).astype(kind)
    else:
        array = field > 0.5 if kind == "bool" else array.astype(kind)
    return pvdi.Volume(array, **options)


def over(volume: pvdi.Volume, **options: Any) -> pvdi.TransferFunction:
    """Return random colours whose lower third is transparent, and then ever less so."""
    shares = np.arange(24) / 23
    opacities = options.pop("most", 0.6) * np.clip(1.5 * shares - 0.5, 0, 1)
    colors = np.random.default_rng(7).random((24, 3))
    low, high = options.pop("range", None) or volume.finite_range()
    return pvdi.TransferFunction(colors, opacities, (low, high), **options)


def outside(
    bounds: Any, azimuth: float = 0.0, elevation: float = 20.0, distance: float = 2.0, **more: Any
) -> pvdi.Camera:
    """Return a view of bounds from ``distance`` diagonals away, z upwards."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, diagonal = box.mean(axis=1), float(np.linalg.norm(box[:, 1] - box[:, 0]))
    eye = centre - (0, distance * diagonal, 0)
    more |= {"view_angle": 48 / distance, "parallel_scale": 0.42 * diagonal}
    return pvdi.Camera(eye, centre, (0, 0, 1), **more).azimuth(azimuth).elevation(elevation)


def cameras(bounds: Any) -> dict[str, pvdi.Camera]:
    """Return views of bounds by name: generating ones, and new ones."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, edges = box.mean(axis=1), box[:, 1] - box[:, 0]
    near = outside(bounds, 25.0, distance=0.8)
    shear = np.array([[1, 0.4, 0, 5], [0, -1.5, 0.2, -3], [0.1, 0, 0.7, 2], [0, 0, 0, 1]])
    # The eye goes along, so that the view still shows it
    eye, focus = np.array([near.position, near.focal_point]) @ shear[:3, :3].T + shear[:3, 3]
    return {
        "near": near,
        "telescope": outside(bounds, 25.0, distance=300.0),
        "parallel": outside(bounds, 25.0, parallel_projection=True),
        "inside": pvdi.Camera(centre + 0.1 * edges, centre + edges, (0, 0, 1), view_angle=80),
        "behind": outside(bounds, 205.0, -30.0, distance=0.9),
        "above": outside(bounds, 10.0, 85.0, distance=0.9),
        "tile": near.tile((100, 80), (30, 20), (40, 30)),
        "shear": near.replace(position=eye, focal_point=focus, model_transform=shear),
    }


def small(make: Any, volume: pvdi.Volume, function: Any = None, **options: Any) -> Any:
    """Return what ``generate`` or ``render_volume`` makes of a small scene."""
    camera = options.pop("camera", None) or outside(volume.bounds, 25.0)
    function = function or over(volume, interpolation="linear")
    size = options.pop("size", SMALL)
    seldom = pvdi.Settings(**{n: options.pop(n) for n in pvdi.Settings.declared.keys() & options})
    return make(volume, camera, size, transfer_function=function, settings=seldom, **options)


made, pictured = partial(small, pvdi.generate), partial(small, pvdi.render_volume)


def both(name: str, volume: Case, look: dict[str, Any] | None = None, **options: Any) -> Cases:
    """Yield a VDI of a volume, and its picture; ``look`` goes to :func:`over`."""

    def case(make: Any, interpolation: str) -> Any:
        given = volume()
        return make(given, over(given, interpolation=interpolation, **(look or {})), **options)

    for interpolation in ("nearest", "linear"):
        yield f"generate/{name}/{interpolation}", partial(case, made, interpolation)
        yield f"volume/{name}/{interpolation}", partial(case, pictured, interpolation)


def real_cases() -> Cases:
    """Yield VDIs of real volumes, every other one by a long lens; frames from around or above."""

    @cache
    def vdi(name: str, look: str) -> pvdi.VDI:
        camera = outside(real(name).bounds, distance=(0.9, 2.0)[REAL.index(name) % 2])
        return pvdi.generate(real(name), camera, VIEWS[0], **LOOKS[look])

    def frame(name: str, look: str, angle: int, precision: str) -> Any:
        camera = vdi(name, look).camera
        view = (camera.azimuth, camera.elevation)[REAL.index(name) // 2 % 2](angle)
        return pvdi.render(vdi(name, look).with_precision(precision), view, VIEWS[angle])

    for number, (name, look) in enumerate(product(REAL, LOOKS)):
        yield f"vdi/{name}/{look}", partial(vdi, name, look)
        for place, angle in enumerate(VIEWS):
            precision = PRECISIONS[(number + place) % 2]
            yield f"frame/{name}/{look}/{angle}", partial(frame, name, look, angle, precision)


def generation_cases() -> Cases:
    """Yield what decides where lists are cut, voxel types and special volumes, light, bricks."""
    every = product(("least-error", "homogeneity"), (1, 4, 20, 300), (0.0, 0.02))
    for criterion, limit, tolerance in every:
        options = {"criterion": criterion, "max_supersegments": limit, "tolerance": tolerance}
        yield f"generate/{criterion}/{limit}/{tolerance}", partial(made, noise(), **options)
    for option, value, size in (
        *(("view_cone", cone, SMALL) for cone in (0, 30, 90)),
        *(("max_supersegments", 3, size) for size in ((1, 1), (1, 40), (37, 23), (130, 5))),
        *(("max_supersegments", 4096, (12, 9)), ("precision", "8-byte", SMALL)),
        *(("quality", "fast", (240, 160)), ("max_bytes", 400_000, (240, 160))),
    ):
        case = partial(made, noise("uint8"), size=size, **{option: value})
        yield f"generate/{option}/{value}/{size[0]}x{size[1]}", case
    for step in (0.1, 0.37, 4.0):
        yield from both(f"step/{step}", noise, sample_distance=step)
    # Above 8192 steps sums carry what they round off
    few = partial(noise, "uint8", (4, 5, 6))
    yield from both("step/0.0007", few, sample_distance=0.0007, size=(12, 9))
    kinds = ("uint8", "int16", "uint32", "float64", "bool", "float16", "int64")
    for kind in (*kinds, "rgba", "holes", "turned", "huge", "far"):
        yield from both(kind, partial(noise, kind), {"range": (0, 30)} if kind == "holes" else {})
    yield from both("step-function", noise, {"range": (5.0, 5.0)})
    yield from both("opaque", noise, {"most": 1.0})
    yield from both("dense", noise, {"unit_distance": 1e-3})
    graded = {"gradient_opacities": (0.0, 0.2, 1.0, 0.7), "gradient_range": (0.0, 9.0)}
    yield from both("gradient", noise, graded)
    yield "volume/whole", lambda: pictured(noise(), early_termination=False)
    # Lights, materials, ambient occlusion
    spot = pvdi.Light("scene", (30, -20, 40), (16, 10, 17), positional=True, cone_angle=25)
    lamp = pvdi.Light("camera", (0.5, 0.7, 1.0), ambient=(0.2, 0.1, 0.3), intensity=0.7)
    sun = pvdi.Light("scene", (100, 20, 300), specular=(0.3, 0.9, 0.4))
    matt, shiny = {"shading": pvdi.Shading()}, {"shading": pvdi.Shading(0.2, 0.5, 0.9, 40)}
    yield from both("lit/headlight", noise, matt)
    yield from both("lit/lights", noise, shiny, lights=[spot, lamp, sun])
    yield from both("lit/one-sided", noise, shiny, lights=pvdi.Lights((sun,), two_sided=False))
    yield from both("lit/rgba", partial(noise, "rgba"), matt)
    yield from both("occlusion/default", noise, ambient_occlusion=True)
    strong = pvdi.AmbientOcclusion(4.0, 1.0, 64)
    yield from both("occlusion/strong", noise, {**shiny, **graded}, ambient_occlusion=strong)
    yield from both("occlusion/rgba", partial(noise, "rgba"), ambient_occlusion=True)
    # What a memory limit has brought to the device brick by brick
    shape, tight = (60, 90, 80), {"memory_limit": 2_600_000, "size": (24, 20)}
    for dtype in ("float32", "float64"):
        yield from both(f"bricks/{dtype}", partial(noise, dtype, shape), **tight)
    yield from both("bricks/lit", partial(noise, "float32", shape), {**matt, **graded}, **tight)
    yield from both("bricks/rgba", partial(noise, "rgba", shape), **tight)


@cache
def seen_from(name: str) -> pvdi.VDI:
    """Return the VDI of a small volume from one of :func:`cameras`; "empty": nothing is in it."""
    volume = noise("uint8")
    if name == "empty":
        return made(volume, over(volume, range=(300, 400)), size=(20, 15))
    return made(volume, camera=cameras(volume.bounds)[name], max_supersegments=12)


@cache
def drawn(name: str, precision: str = "exact") -> pvdi.VDI:
    """Return a VDI of so many lists that all ways of following rays are taken."""
    if name == "wide":  # sums over so many lists carry what they round off
        return made(noise("uint8"), size=(8400, 2)).with_precision(precision)
    volume = noise("uint8", (40, 48, 44))
    vdi = made(volume, camera=cameras(volume.bounds)[name], size=(240, 210))
    return vdi.with_precision(precision)


def frame_options(bounds: Any, camera: pvdi.Camera, size: tuple[int, int]) -> dict[str, Any]:
    """Return keyword arguments of ``render`` by name."""
    box = np.reshape(np.asarray(bounds, dtype=np.float64), (3, 2))
    centre, edges = box.mean(axis=1), box[:, 1] - box[:, 0]
    third = np.stack([box[:, 0] + edges / 3, box[:, 0] + 2 * edges / 3], axis=1).ravel()
    depth = float(np.dot(centre - camera.position, camera.axes[2]))
    ends = depth + 0.4 * float(edges.max()) * (np.random.default_rng(8).random(size[::-1]) - 0.5)
    ends = ends.astype(np.float32)
    ends[: size[1] // 3, : size[0] // 3] = np.inf
    plane = [*centre, 0.3, 0.8, -0.2]
    return {
        "plain": {},
        "depth": {"opaque_depth": ends},
        "planes": {"clipping_planes": [plane, [*centre, 0, 0.2, 1]]},
        "box": {"cropping": third},
        "regions": {"cropping": (third, 0x2A5F0C3)},
        "thick": {"opacity_multiplier": 6.0},
        "no-skip": {},
        "all": {"opaque_depth": ends, "clipping_planes": [plane], "cropping": (third, "fence")},
        "cutoff": {"settings": pvdi.Settings(transmittance_cutoff=0.5)},
        "preview-30": {"preview_samples": 30, "opaque_depth": ends, "clipping_planes": [plane]},
        "preview-9000": {"preview_samples": 9000},
    }


def frame_cases() -> Cases:
    """Yield frames between all kinds of views and by every option, depths and picks of hits."""
    bounds = noise("uint8").bounds

    def between(own: str, other: str, precision: str) -> Any:
        size = (220, 204) if other in ("behind", "above") else (70, 50)
        return pvdi.render(seen_from(own).with_precision(precision), cameras(bounds)[other], size)

    for number, name in enumerate(cameras(bounds)):
        yield f"generate/view/{name}", partial(seen_from, name)
        yield f"volume/view/{name}", partial(pictured, noise("uint8"), camera=cameras(bounds)[name])
        others = ("near", "parallel", "inside", "behind", "above", "shear", name)
        for place, other in enumerate(dict.fromkeys(others)):
            case = partial(between, name, other, PRECISIONS[(number + place) % 2])
            yield f"render/{name}/{other}", case

    def frames(name: str, precision: str, option: str) -> Any:
        vdi = drawn(name, precision)
        own = vdi.camera  # in its own window, a small one, and one in which packets may pay
        views = ((own, vdi.window_size), (own.azimuth(12), (90, 70)), (own.azimuth(85), (230, 210)))
        if option == "preview-9000" or name == "wide":
            views = ((own, (40, 30)), (own.azimuth(20), (30, 20)))
        return [
            pvdi.render(vdi, view, size, **frame_options(vdi.bounds, view, size)[option])
            for view, size in views
        ]

    options = frame_options(bounds, outside(bounds), (9, 8))
    for name, (place, option) in product(("near", "telescope", "parallel"), enumerate(options)):
        precision = PRECISIONS[(len(name) + place) % 2]
        yield f"render/{name}/{option}/{precision}", partial(frames, name, precision, option)
    for precision in PRECISIONS:
        yield f"render/wide/{precision}", partial(frames, "wide", precision, "plain")
    yield "render/empty", lambda: pvdi.render(seen_from("empty"), seen_from("near").camera, SMALL)

    def hits(name: str, option: str, want: dict[str, Any]) -> Any:
        vdi, size = drawn(name, PRECISIONS[len(option) % 2]), (90, 70)
        view = vdi.camera.azimuth(12)
        given = frame_options(vdi.bounds, view, size)[option] | want
        found: list[Any] = [pvdi.render_depth(vdi, view, size, **given)]
        ends = given.pop("opaque_depth", None)
        for x, y in product(range(11, 90, 22), range(8, 70, 17)):
            end = {} if ends is None else {"opaque_depth": float(ends[size[1] - 1 - y, x])}
            hit = pvdi.pick(vdi, view, (x + 0.25, y), size, **given, **end)
            found.append(hit and [hit.position, hit.depth, hit.list, hit.index, hit.supersegment])
            found.append(hit and [hit.color, hit.optical_depth, hit.accumulated_optical_depth])
        return found

    wants = ({}, {"opacity_threshold": 0.0}, {"opacity_threshold": 0.2, "accumulated": False})
    for name in ("near", "telescope", "parallel"):
        for place, option in enumerate(("plain", "depth", "planes", "regions", "thick", "all")):
            yield f"hits/{name}/{option}", partial(hits, name, option, wants[place % 3])


def other_cases() -> Cases:
    """Yield frames of several VDIs, deferred VDIs, and files."""
    shift = np.eye(4) + np.pad([[9.0], [2.0], [4.0]], ((0, 1), (3, 0)))
    scenes: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
        "two": (("near", "behind"), {}),
        "moved": (("near", "shear"), {"model_transforms": (np.eye(4), shift)}),
        "cropped": (("near", "parallel"), {"cropping": [((5, 25, 0, 14, 6, 20), "cross"), None]}),
        "with-empty": (("near", "empty"), {}),
    }

    def joint(scene: str, precision: str) -> Any:
        names, options = scenes[scene]
        vdis = [seen_from(name).with_precision(precision) for name in names]
        view, size = outside(vdis[0].bounds, 60.0, distance=1.6), (120, 90)
        ends = frame_options(vdis[0].bounds, view, size)["depth"]
        return [pvdi.render(vdis, view, size, **options, **more) for more in ({}, ends)]

    for scene, precision in product(scenes, PRECISIONS):
        yield f"joint/{scene}/{precision}", partial(joint, scene, precision)

    def deferred(name: str) -> Any:
        view = outside(real(name).bounds, 15.0)
        kept = pvdi.generate(real(name), view, (96, 72), classification="deferred")
        looks = [kept.classified(**look) for look in LOOKS.values()]
        return [*looks, pvdi.render(kept, view.azimuth(20), (120, 90), **LOOKS["soft"])]

    for name in ("brain", "tooth", "isabel_wind"):
        yield f"deferred/{name}", partial(deferred, name)

    def saved(name: str, **options: Any) -> Any:
        """Return a file's content without the version that wrote it, and what is read from it."""
        vdi = seen_from(name)
        with tempfile.TemporaryDirectory() as folder:
            path = vdi.save(Path(folder) / "vdi.vdi", **options)
            version = f"pyvista-vdi {pvdi.__version__}".encode()
            with zipfile.ZipFile(path) as archive:
                parts = [(n, archive.read(n).replace(version, b"")) for n in archive.namelist()]
            return [*parts, pvdi.read(path)]

    for name, precision in product(("near", "parallel", "empty"), PRECISIONS):
        for compression in ("lz4", "zstd", "none"):
            options = {"precision": precision, "compression": compression}
            yield f"file/{name}/{precision}/{compression}", partial(saved, name, **options)


def measured(path: Path) -> int:
    """Write the hashes of all cases, and of those that fail the error; return 1 if one does."""
    began, hashes = time.perf_counter(), dict[str, str]()
    for cases in (real_cases, generation_cases, frame_cases, other_cases):
        for name, case in cases():
            try:
                hashes[name] = hashlib.sha256(content(case())).hexdigest()
            except Exception as error:
                hashes[name] = f"failed: {type(error).__name__}: {error}"
                print(f"{name} {hashes[name]}")
    path.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
    failed = sum(one.startswith("failed") for one in hashes.values())
    print(f"{len(hashes)} cases, {failed} failed, {time.perf_counter() - began:.0f} s")
    return int(failed > 0)


def compared(old: Path, new: Path) -> int:
    """Print what differs, or is in one of the files alone; return 1 if anything does."""
    before, after = (json.loads(path.read_text()) for path in (old, new))
    names = [name for name in {**before, **after} if before.get(name) != after.get(name)]
    for name in names:
        print(f"{name}: {before.get(name, 'missing')[:12]} and {after.get(name, 'missing')[:12]}")
    print(f"{len(before)} and {len(after)} cases, {len(names)} differ")
    return int(bool(names))


if __name__ == "__main__":
    sys.exit((measured, compared)[len(sys.argv) - 2](*map(Path, sys.argv[1:])))
