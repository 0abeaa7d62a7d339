"""Volumes in blocks: pictures against one piece; a large one on two small workers, over one.

Each worker of the cluster has a core of its own and a limit of memory, beyond which Dask would
start it anew.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import dask.array as da
import zarr
from distributed import Client, LocalCluster
from shared import Case, Results, benches, execute, load, marked, parser_of, table

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.large.generate import generate_in_blocks
from pyvista_vdi.measure.bench import accuracy, ratio
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.quality.targets import turned

VOLUMES = (
    *("brain", "rayleigh_taylor", "bonsai", "aneurism"),
    *("embryo", "tooth", "iguana_head", "heptane"),
)

#: Least SSIM of the picture of blocks against that of one piece, by degrees from V_O.
LEAST_SSIM = {"0": 0.9999, "5": 0.999, "30": 0.999}

#: Blocks along z, y and x.
CUTS = {2: (2, 1, 1), 4: (2, 2, 1), 8: (2, 2, 2)}

#: The large volume of a sample and of the whole; points of a chunk's edge; limit of a worker.
LARGE, CHUNK, WORKER_BYTES = ("kingsnake_like@2", "kingsnake_like"), 128, 800_000_000

LOOKS = {"cmap": "viridis", "opacity": [0.0, 0.0, 0.05, 0.2, 0.5, 0.6], "clim": (0, 255)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, volumes=VOLUMES, repeats=3)
    parser.add_argument("--large", metavar="NAME", help="on the cluster: one that is made")
    parser.add_argument("--store", type=Path, help="where it is, or is written to")
    parser.add_argument("--no-cluster", dest="cluster", action="store_false")
    options = parser.parse_args(arguments)
    size = tuple(options.size)
    cases = [
        Case(name, look, size, options=(("blocks", n),), what="blocks")
        for name in options.volumes
        for look in ("soft", "steep")
        for n in CUTS
    ]
    if options.cluster:
        cases.append(Case("large", None, size, what="cluster"))
    with benches(options) as bench_of:

        def measure(case: Case) -> dict[str, Any]:
            if case.what == "cluster":
                return on_cluster(options)
            return in_blocks(
                bench_of(case.volume, case.look, "linear"), dict(case.options)["blocks"]
            )

        rooms = ("generation", "raycasting", "volume", "extensions/large")
        key = lambda case: case.what  # noqa: E731
        execute("large", options, cases, measure, report, count=10, key=key, rooms=rooms)
    return 0


def in_blocks(bench: Any, n: int) -> dict[str, Any]:
    """Return how near the picture of blocks is to that of one piece, by angle."""
    whole, of = bench.generate(), bench.volume
    chunks = tuple(-(-p // k) for p, k in zip(of.array.shape, CUTS[n], strict=True))
    volume = pvdi.Volume(da.from_array(of.array, chunks), of.spacing, of.origin, of.direction)
    request = GenerationRequest(volume, bench.table, bench.view, bench.size, device=bench.runtime)
    vdi = generate_in_blocks(request, block_bytes=1)
    near = {}
    for angle in LEAST_SSIM:
        view = turned(bench.view, bench.volume.bounds, float(angle))
        near[angle] = accuracy(bench.draw(vdi, view), bench.draw(whole, view))
    return {"supersegments": vdi.n_supersegments / whole.n_supersegments, "near": near}


def stored(path: Path, name: str) -> pvdi.Volume:
    """Return a volume that is made, in a store of chunks, written where it is not there yet."""
    if not path.exists():
        made = load(name).array
        zarr.create_array(store=str(path), data=made, chunks=(CHUNK,) * 3)
    return pvdi.Volume(zarr.open_array(str(path), mode="r"), name=name)


def on_cluster(options: Any) -> dict[str, Any]:
    """Return seconds on one worker and on two, in turns, and the peaks of their memory."""

    def peak() -> tuple[int, int]:
        return os.getpid(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

    with tempfile.TemporaryDirectory() as folder:
        name = options.large or LARGE[options.whole]
        volume = stored(options.store or Path(folder) / "large.zarr", name)
        camera = filling_camera(volume.bounds, options.size)
        function = Classification.composited(LOOKS, "a benchmark").transfer_function_of(volume)
        given = {"threads_per_worker": 1, "memory_limit": WORKER_BYTES, "dashboard_address": ":0"}
        request = GenerationRequest(volume, function, camera, options.size)
        clients: dict[str, Client] = {}
        with ExitStack() as stack:
            cores = sorted(os.sched_getaffinity(0))
            for n in (1, 2):
                cluster = stack.enter_context(LocalCluster(n_workers=n, **given))
                clients[str(n)] = client = stack.enter_context(Client(cluster))
                for k, at in enumerate(client.nthreads()):
                    client.run(os.sched_setaffinity, 0, {cores[k % len(cores)]}, workers=[at])
            before, seconds = client.run(peak), {n: [] for n in clients}
            for turn in range(options.repeats + 1):
                for n, client in clients.items():
                    start = time.perf_counter()
                    vdi = generate_in_blocks(request, client)
                    if turn:  # the first one compiles
                        seconds[n].append(time.perf_counter() - start)
            after = client.run(peak)
        return {
            "points": volume.array.size,
            "supersegments": vdi.n_supersegments,
            "seconds": seconds,
            "restarts": len(
                {pid for pid, _ in before.values()} ^ {pid for pid, _ in after.values()}
            ),
            "worker_peaks": sorted(found for _, found in after.values()),
        }


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the tables."""
    rows = []
    for row in results.rows(what="blocks"):
        near = row["near"]
        cells = [row["case"][key] for key in ("volume", "look", "blocks")]
        cells += [f"{row['supersegments']:.4f}", f"{near['0']['worst_pixel']:.3f}"]
        for angle, least in LEAST_SSIM.items():
            ssim = near[angle]["ssim"]
            cells.append(marked(f"{ssim:.5f}", ssim >= least))
        rows.append(cells)
    heads = [f"SSIM, {angle} degrees" for angle in LEAST_SSIM]
    first = ["volume", "look", "blocks", "supersegments", "worst pixel at V_O, /255"]
    yield "Of blocks over one piece, linear sampling."
    yield ""
    yield from table([*first, *heads], rows)
    for row in results.rows(what="cluster"):
        peaks = ", ".join(f"{found / 1e6:.0f}" for found in row["worker_peaks"])
        yield ""
        yield f"{row['points']:.2g} points in chunks of {CHUNK}³, two workers of"
        yield f"{WORKER_BYTES / 1e6:.0f} MB: peaks of {peaks} MB, restarts {row['restarts']};"
        yield f"time of one worker over that of two {ratio(*row['seconds'].values()):.2f}."


if __name__ == "__main__":
    sys.exit(main())
