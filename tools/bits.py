"""Hashes of VDIs, frames and files by case: two versions that agree in them draw the same bits.

``python tools/bits.py --device 0 --out old.json`` hashes all that the cases make on one OpenCL
implementation; the same with the new code, then ``python tools/bits.py --compare old.json
new.json``. Hashes of two implementations differ: OpenCL C leaves them the last bits of elementary
functions. Only public names are used, so that one file runs on both versions; scenes are fixed,
from seeds and from the volumes in the folder that ``PYVISTA_VDI_DATA`` names.
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
import time
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


# -- running ---------------------------------------------------------------------------------------


def all_cases() -> dict[str, Case]:
    """Return every case by name, in the order in which they share what is cached."""
    cases: dict[str, Case] = {}
    for group in (standard_cases,):
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
