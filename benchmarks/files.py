"""How large .vdi files are, and how long saving and loading take beside NumPy's own files.

Writes ``files_WxH.json`` (all figures) and ``.md`` (the tables). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_vdi_options,
    at_hand,
    marked,
    measure_missing,
    new_parser,
    timed,
    vdi_of,
)

from pyvista_vdi.io import FORMAT_VERSION, read, read_info
from pyvista_vdi.measure.report import describe_system, system_line, table
from pyvista_vdi.model.vdi import VDI

#: Bytes of a supersegment in the dense form: two depths, four colour components, float32.
DENSE_BYTES = 24

#: Ways to compress, the default first.
COMPRESSIONS = ("lz4", "zstd", "none")

#: A VDI's arrays; NumPy's functions write and read each as one file.
ARRAYS = ("offsets", "front", "back", "color", "optical_depth")

#: Least ratio of dense form and file, and most of our times and NumPy's.
LEAST_SHRINKING, MOST_SAVING, MOST_LOADING = 6.0, 10.0, 3.0

LEGEND = (
    "`dense / size`: bytes of width x height x longest list x 24 over the file's. `save` and "
    "`load`: our time over `numpy.save`'s and `numpy.load`'s for the same five arrays, by wall "
    "clock (in brackets by the process's CPU time). Ours brings the file to the disk (fsync) and "
    "NumPy's does not; `synced` is over NumPy's with fsync. Loading takes from the page "
    "cache, and ours compares checksums and checks every supersegment. Medians of turns."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    case = {
        "transfer_function": options.tf,
        "max_supersegments": options.max_supersegments,
        "format_version": FORMAT_VERSION,
        "system": {**describe_system(options.device), "numcodecs": version("numcodecs")},
    }

    def measured_of(volume: str) -> dict[str, Any]:
        with tempfile.TemporaryDirectory(dir=options.disk) as folder:
            return measured(vdi_of(volume, options), Path(folder), options)

    volumes = at_hand(options.volumes)
    results = measure_missing("files", options, case, volumes, measured_of, report)
    return 0 if all(v["identical"] for v in results["volumes"].values()) else 1


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=9, repeated="timed turns")
    add_vdi_options(parser)
    parser.add_argument("--disk", type=Path, metavar="FOLDER", help="where the files are written")
    return parser.parse_args()


def measured(vdi: VDI, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return sizes and times of one VDI's files."""
    files = {kind: folder / f"{kind}.vdi" for kind in COMPRESSIONS}
    ways: dict[str, Callable[[], object]] = {
        "numpy save": partial(save_arrays, vdi, folder),
        "numpy save, synced": partial(save_arrays, vdi, folder, synced=True),
        "numpy load": partial(load_arrays, folder),
        "info": partial(read_info, files["lz4"]),
    }
    for kind, file in files.items():
        ways[f"{kind} save"] = partial(vdi.save, file, compression=kind)
        ways[f"{kind} load"] = partial(read, file)
    packed = folder / "compressed.npz"
    arrays = {name: getattr(vdi, name) for name in ARRAYS}
    for way in (*(w for n, w in ways.items() if "save" in n), *ways.values()):
        way()  # files are there, modules imported, memory warm
    width, height = vdi.window_size
    return {
        "supersegments": vdi.n_supersegments,
        "empty_lists": float((vdi.counts == 0).mean()),
        "array_bytes": vdi.nbytes,
        "dense_bytes": width * height * options.max_supersegments * DENSE_BYTES,
        "file_bytes": {kind: file.stat().st_size for kind, file in files.items()},
        "identical": all(read(file).equals(vdi) for file in files.values()),
        "seconds": timed(ways, options.repeats),
        "savez_compressed": {
            **timed({"save": partial(np.savez_compressed, packed, **arrays)}, 1),
            **timed({"load": partial(load_packed, packed)}, 3),
            "file_bytes": packed.stat().st_size,
        },
    }


def save_arrays(vdi: VDI, folder: Path, *, synced: bool = False) -> None:
    """Write a VDI's arrays by ``numpy.save``."""
    for name in ARRAYS:
        with (folder / f"{name}.npy").open("wb") as stream:
            np.save(stream, getattr(vdi, name))
            if synced:
                stream.flush()
                os.fsync(stream.fileno())


def load_arrays(folder: Path) -> list[Any]:
    """Read a VDI's arrays by ``numpy.load``."""
    return [np.load(folder / f"{name}.npy") for name in ARRAYS]


def load_packed(file: Path) -> list[Any]:
    """Read a VDI's arrays from a compressed archive of NumPy."""
    with np.load(file) as archive:
        return [archive[name] for name in ARRAYS]


def report(results: dict[str, Any]) -> str:
    """Return the tables: a line per volume, the emptiest first."""
    width, height = results["window_size"]
    case = f"{results['transfer_function']}, {results['max_supersegments']} supersegments"
    volumes = sorted(results["volumes"].items(), key=lambda item: -item[1]["empty_lists"])
    lines = [f"# Files, {width}x{height}, {case}", "", LEGEND]
    rows = []
    for name, found in volumes:
        shrinking = found["dense_bytes"] / found["file_bytes"]["lz4"]
        cells = [
            name,
            f"{found['empty_lists']:.0%}",
            mebibytes(found["array_bytes"]),
            mebibytes(found["file_bytes"]["lz4"]),
            marked(f"{shrinking:.1f}", shrinking >= LEAST_SHRINKING),
            ratio(found, "lz4 save", "numpy save", MOST_SAVING),
            ratio(found, "lz4 save", "numpy save, synced", MOST_SAVING),
            ratio(found, "lz4 load", "numpy load", MOST_LOADING),
        ]
        rows.append(cells)
    heads = ["volume", "empty lists", "arrays, MiB", ".vdi, MiB", "dense / size"]
    lines += [
        "",
        *table((*heads, "save", "synced", "load"), rows),
        "",
        "## Other compressions",
        "",
        "Dense form over file, then save and load as above. `npz`: `numpy.savez_compressed`.",
        "",
    ]
    rows = []
    for name, found in volumes:
        cells = [name]
        for kind in COMPRESSIONS[1:]:
            cells.append(f"{found['dense_bytes'] / found['file_bytes'][kind]:.1f}")
            cells += [ratio(found, f"{kind} {a}", f"numpy {a}") for a in ("save", "load")]
        npz = found["savez_compressed"]
        cells.append(f"{found['dense_bytes'] / npz['file_bytes']:.1f}")
        cells += [
            f"{npz[a]['wall']['median'] / found['seconds'][f'numpy {a}']['wall']['median']:.0f}"
            for a in ("save", "load")
        ]
        rows.append(cells)
    heads = [head for kind in (*COMPRESSIONS[1:], "npz") for head in (kind, "save", "load")]
    lines += table(("volume", *heads), rows)
    infos = [1e3 * found["seconds"]["info"]["wall"]["median"] for _, found in volumes]
    spreads = [
        (wall["most"] - wall["least"]) / wall["median"]
        for _, found in volumes
        for wall in (found["seconds"]["lz4 load"]["wall"], found["seconds"]["numpy load"]["wall"])
    ]
    if volumes:
        spread = statistics.median(spreads)
        lines += [
            "",
            f"`read_info`: {min(infos):.1f} to {max(infos):.1f} ms.",
            f"Spread of the repeated loads, (most - least) / median: {spread:.0%}.",
        ]
    return "\n".join([*lines, "", system_line(results["system"]), ""])


def ratio(found: dict[str, Any], ours: str, theirs: str, most: float = np.inf) -> str:
    """Return our time over theirs, by wall clock and by CPU; bold where it is above ``most``."""
    seconds = found["seconds"]
    wall, cpu = (
        seconds[ours][clock]["median"] / seconds[theirs][clock]["median"]
        for clock in ("wall", "cpu")
    )
    return f"{marked(f'{wall:.1f}', wall <= most)} ({cpu:.1f})"


def mebibytes(n: int) -> str:
    """Return bytes in MiB."""
    return f"{n / 2**20:.1f}"


if __name__ == "__main__":
    sys.exit(main())
