"""What VDIs take: bytes and seconds of files, what packing loses, and the peak of memory.

Files beside NumPy's own of the same arrays, in turns. Packed VDIs' pictures beside the exact one's.
Memory in a process of its own for each volume, which draws a small VDI first: the peak of what the
process has in memory, above what was there before, over volume and VDI (Linux with glibc only).
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from shared import (  # beside this file
    Case,
    Results,
    benches,
    execute,
    load,
    mean_of,
    parser_of,
    table,
    table_of,
)

from pyvista_vdi import Volume, compare_images, generate, render
from pyvista_vdi.device import get_runtime
from pyvista_vdi.io import read
from pyvista_vdi.measure.bench import Bench, take_turns
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: Bytes of a supersegment in the dense form: two depths, four colour components, float32.
DENSE_BYTES = 24

#: Ways to compress, the default first; a VDI's arrays.
COMPRESSIONS = ("lz4", "zstd", "none")
ARRAYS = ("offsets", "front", "back", "color", "optical_depth")

PRECISIONS = ("exact", "8-byte")

MIB = 2**20

#: Degrees from V_O of pictures of packed VDIs, and the largest loss of SSIM that is allowed.
ANGLES, MOST_LOSS = (0.0, 5.0, 30.0), 0.001

KINDS = ("files", "packed", "memory")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, size=(1280, 720), repeats=5)
    parser.add_argument("--max-supersegments", type=int, default=20, metavar="N")
    parser.add_argument("--disk", type=Path, metavar="FOLDER", help="where the files are written")
    parser.add_argument("--child", metavar="PRECISION", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        print(json.dumps(memory(options)))
        return 0
    with benches(options) as bench_of:

        def measure(case: Case) -> dict[str, Any]:
            if case.what == "memory":
                return {form: peaks_of(case.volume, form, options) for form in ("exact", "8-byte")}
            bench = bench_of(case.volume, case.look)
            vdi = bench.generate(max_supersegments=options.max_supersegments)
            return (files if case.what == "files" else packed)(bench, vdi, options)

        size = tuple(options.size)
        cases = [Case(name, "soft", size, what=kind) for name in options.volumes for kind in KINDS]
        rooms = ("generation", "raycasting", "volume", "io")
        execute("files", options, cases, measure, report, count=3, key=None, rooms=rooms)
    return 0


def files(_: Bench, vdi: VDI, options: argparse.Namespace) -> dict[str, Any]:
    """Return sizes and times of a VDI's files, and whether each gives back every bit."""
    with tempfile.TemporaryDirectory(dir=options.disk) as name:
        folder = Path(name)
        paths = {kind: folder / f"{kind}.vdi" for kind in COMPRESSIONS}
        ways: dict[str, Callable[[], object]] = {
            "numpy save": partial(save_arrays, vdi, folder),
            "numpy load": lambda: [np.load(folder / f"{name}.npy") for name in ARRAYS],
        }
        for kind, file in paths.items():
            ways[f"{kind} save"] = partial(vdi.save, file, compression=kind)
            ways[f"{kind} load"] = partial(read, file)
        taken = take_turns(ways, options.repeats)
        width, height = vdi.window_size
        return {
            "empty_lists": float((vdi.counts == 0).mean()),
            "array_bytes": vdi.nbytes,
            "dense_bytes": width * height * options.max_supersegments * DENSE_BYTES,
            "file_bytes": {kind: file.stat().st_size for kind, file in paths.items()},
            "identical": all(read(file).equals(vdi) for file in paths.values()),
            "seconds": {way: statistics.median(times) for way, times in taken.items()},
        }


def save_arrays(vdi: VDI, folder: Path) -> None:
    """Write a VDI's arrays by ``numpy.save``, to the disk, as a VDI's file is."""
    for name in ARRAYS:
        with (folder / f"{name}.npy").open("wb") as stream:
            np.save(stream, getattr(vdi, name))
            stream.flush()
            os.fsync(stream.fileno())


def packed(bench: Bench, vdi: VDI, options: argparse.Namespace) -> dict[str, Any]:
    """Return losses, bytes and times of a VDI in every form."""
    forms = {precision: vdi.with_precision(precision) for precision in PRECISIONS}
    found: dict[str, Any] = {"losses": {}, "seconds": {}, "bytes": {}}
    with tempfile.TemporaryDirectory() as folder:
        for name, form in forms.items():
            on_device = prepared_vdi(bench.runtime, form).list_bytes
            found["bytes"][name] = [on_device, form.save(Path(folder) / "a.vdi").stat().st_size]
    for angle in ANGLES:
        camera = bench.view.azimuth(angle)
        pictures = {name: bench.draw(form, camera) for name, form in forms.items()}
        losses = {}
        for name in PRECISIONS[1:]:
            compared = compare_images(pictures[name], pictures["exact"])
            losses[name] = {"ssim": 1 - compared.ssim, "worst_pixel": compared.worst_pixel}
        found["losses"][f"{angle:g}"] = losses
        ways = {name: partial(bench.draw, form, camera) for name, form in forms.items()}
        taken = take_turns(ways, options.repeats)
        found["seconds"][f"{angle:g}"] = {n: statistics.median(t) for n, t in taken.items()}
    return found


def peaks_of(volume: str, precision: str, options: argparse.Namespace) -> dict[str, int]:
    """Return the peaks of memory that another process finds, bytes."""
    size = f"{options.size[0]}x{options.size[1]}"
    command = [sys.executable, __file__, "--child", precision, "--volumes", volume, "--size", size]
    command += ["--max-supersegments", str(options.max_supersegments)]
    command += ["--device", options.device] if options.device else []
    return dict(json.loads(subprocess.run(command, check=True, capture_output=True).stdout))


def memory(options: argparse.Namespace) -> dict[str, int]:
    """Return the bytes of a volume, its VDI, and the peaks above what was there before."""
    (name,) = options.volumes
    dtype = load(name).array.dtype
    drawn(Volume(np.indices((40, 40, 40)).sum(axis=0).astype(dtype)), (64, 48), options, 0)
    forget_peak()
    before = resident()
    volume = load(name)
    return {"volume": volume.array.nbytes, **drawn(volume, tuple(options.size), options, before)}


def drawn(
    volume: Volume, size: tuple[int, int], options: argparse.Namespace, before: int
) -> dict[str, int]:
    """Generate a VDI and draw it from another view; return its bytes and the peaks."""
    view = filling_camera(volume.bounds, size)
    forget_peak()
    vdi = generate(
        volume,
        view,
        size,
        transfer_function=table_of(volume, "soft"),
        max_supersegments=options.max_supersegments,
        precision=options.child,
        device=options.device,
    )
    generating = resident("VmHWM") - before
    forget_peak()
    render(vdi, view.azimuth(5), device=options.device)
    drawing = resident("VmHWM") - before
    device = get_runtime(options.device).peak_allocated
    return {"vdi": vdi.nbytes, "generate": generating, "render": drawing, "device": device}


def resident(which: str = "VmRSS") -> int:
    """Return what the process has in memory, or with ``"VmHWM"`` had at most; bytes."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith(f"{which}:"))
    return int(line.split()[1]) * 1024


def forget_peak() -> None:
    """Hand back what was freed, and let the peak begin anew."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the tables: a line per volume, and form."""
    yield "*Dense / size*: bytes of width x height x longest list x 24 over the file's. *Save* and"
    yield "*load*: our time over `numpy.save`'s (with fsync, as ours) and `numpy.load`'s."
    yield ""
    rows = []
    for row in results.rows(what="files"):
        seconds = row["seconds"]
        cells = [
            row["case"]["volume"],
            f"{row['empty_lists']:.0%}",
            f"{row['array_bytes'] / MIB:.2f}",
        ]
        for kind in COMPRESSIONS:
            cells.append(f"{row['dense_bytes'] / row['file_bytes'][kind]:.1f}")
            for way in ("save", "load"):
                cells.append(f"{seconds[f'{kind} {way}'] / seconds[f'numpy {way}']:.1f}")
        rows.append([*cells, "the same" if row["identical"] else "**the same**"])
    heads = [head for kind in COMPRESSIONS for head in (f"dense / size, {kind}", "save", "load")]
    yield from table(("volume", "empty lists", "arrays, MiB", *heads, "bits"), rows)
    of = lambda row: row["dense_bytes"] / row["file_bytes"]["lz4"]  # noqa: E731
    yield from ("", f"Dense / size, mean: {mean_of(results, every, of, what='files')}.", "")
    yield from ("", "Packed over exact; losses of SSIM in millionths, the worst of all angles:", "")
    rows = []
    for row in results.rows(what="packed"):
        for form in PRECISIONS[1:]:
            losses = [loss[form] for loss in row["losses"].values()]
            ssim = max(loss["ssim"] for loss in losses)
            mark = "" if ssim <= MOST_LOSS else "**"
            cells = [row["case"]["volume"], form, f"{mark}{1e6 * ssim:.0f}{mark}"]
            cells.append(f"{max(loss['worst_pixel'] for loss in losses):.2f}")
            cells += [f"{s[form] / s['exact']:.2f}" for s in row["seconds"].values()]
            sizes = zip(row["bytes"][form], row["bytes"]["exact"], strict=True)
            rows.append([*cells, *(f"{of / exact:.2f}" for of, exact in sizes)])
    times = [f"time {angle:g}°" for angle in ANGLES]
    heads = ["volume", "form", "loss", "worst pixel, /255", *times, "on the device", "file"]
    yield from table(heads, rows)
    yield from ("", "Peak of memory over volume and VDI:", "")
    rows = []
    for row in results.rows(what="memory"):
        for form in ("exact", "8-byte"):
            of = row[form]
            cells = [f"{of[what] / MIB:.2f}" for what in ("volume", "vdi", "device")]
            shares = [f"{of[k] / (of['volume'] + of['vdi']):.2f}" for k in ("generate", "render")]
            rows.append([row["case"]["volume"], form, *cells, *shares])
    heads = ["volume, MiB", "VDI, MiB", "device, MiB", "while generated", "while drawn"]
    yield from table(("volume", "form", *heads), rows)


if __name__ == "__main__":
    sys.exit(main())
