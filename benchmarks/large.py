"""Volumes in blocks: against one piece, and a large one on a cluster of two small workers.

Writes ``large.json`` (all figures) and ``large.md`` (the tables). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_size,
    add_volumes,
    at_hand,
    begun,
    marked,
    new_parser,
    save,
)
from tqdm import tqdm

import pyvista_vdi as pvdi
from pyvista_vdi import examples
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.large.blocks import Blocks
from pyvista_vdi.large.generate import generate_chunked
from pyvista_vdi.measure.report import describe_system, system_line, table, write_text
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera
from pyvista_vdi.quality.probe import turned

VOLUMES = (
    "brain",
    "rayleigh_taylor",
    "bonsai",
    "aneurism",
    "embryo",
    "tooth",
    "iguana_head",
    "heptane",
)
PARTS = ("accuracy", "large", "speed")
ANGLES = (0, 5, 30)
#: Least SSIM of the picture of blocks against that of one piece, by angle; the worst pixel at V_O.
LEAST_SSIM = {0: 0.9999, 5: 0.999, 30: 0.999}
#: Blocks along z, y and x.
CUTS = {2: (2, 1, 1), 4: (2, 2, 1), 8: (2, 2, 2)}
#: Pixels from the projection of an edge between blocks within which a seam would lie.
NEAR = 2.0
#: Points along the edges of the large volume and of its chunks; bytes that a worker may have.
EDGE, CHUNK, WORKER_BYTES = 2048, 128, 800_000_000
#: Points along the edges of the volume that is timed.
FAST_EDGE = 1024


LEGEND = (
    "SSIM of the picture of a VDI made in blocks against that of one made in one piece; the worst "
    "pixel in 255ths; the mean difference near blocks' edges over that elsewhere. Linear. Bold: "
    "what must be reached is not."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser, (640, 360))
    add_volumes(parser, VOLUMES)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--edge", type=int, default=EDGE, help="points of the large volume")
    parser.add_argument("--known", action="store_true", help="find the ranges of chunks before")
    parser.add_argument("--fast-store", type=Path, help="the same of the one that is timed")
    parser.add_argument("--store", type=Path, help="where the large volume is, or is written to")
    options = parser.parse_args()
    target = options.out / "large.json"
    results = begun(target, {"system": describe_system(options.device)}, "parts")
    for part in options.parts:
        results["parts"][part] = globals()[f"{part}_part"](options)
        save(results, target)
    write_text(target.with_suffix(".md"), report(results))
    print(f"Written: {target}, and .md beside it")
    return 0


# -- against one piece ---------------------------------------------------------------------------


def accuracy_part(options: argparse.Namespace) -> dict[str, Any]:
    """Return SSIM, the worst pixel and seams by volume and number of blocks."""
    found: dict[str, Any] = {}
    cases = [(name, look) for name in at_hand(options.volumes) for look in ("soft", "steep")]
    for name, look in tqdm(cases, desc="accuracy", leave=False):
        volume = examples.load_data(name, as_volume=True)
        camera = filling_camera(volume.bounds, options.size)
        looks = {**TRANSFER_FUNCTIONS[look], "interpolation": "linear"}
        function = Classification(looks, "a benchmark").transfer_function(volume)
        arguments = (volume, camera, options.size, function)
        whole = generate_vdi(*arguments, device=options.device)
        views = {angle: turned(camera, volume.bounds, angle) for angle in ANGLES}
        expected = {a: pvdi.render(whole, view, device=options.device) for a, view in views.items()}
        of_case = found[f"{name}, {look}"] = {}
        for n, cuts in CUTS.items():
            chunks = [-(-p // k) for p, k in zip(volume.array.shape, cuts, strict=True)]
            vdi = generate_chunked(*arguments, chunks=chunks, block_bytes=1, device=options.device)
            blocks = Blocks.of(volume, chunks, 1, 1)
            cell: dict[str, Any] = {
                "supersegments": vdi.n_supersegments / whole.n_supersegments,
                "longest": int(np.diff(vdi.offsets.astype(np.int64)).max()),
            }
            for angle, view in views.items():
                drawn = pvdi.render(vdi, view, device=options.device)
                cell[str(angle)] = {
                    "ssim": compare_images(expected[angle], drawn).ssim,
                    "worst": float(np.abs(expected[angle] - drawn).max() * 255),
                    "seam": seam(expected[angle], drawn, edges(blocks, view, options.size)),
                }
            of_case[str(n)] = cell
    return found


def edges(blocks: Blocks, view: pvdi.Camera, size: tuple[int, int]) -> np.ndarray:
    """Return which pixels are near the projection of an edge of a block, (height, width)."""
    t = np.linspace(0, 1, 2000)[:, None]
    points = []
    cuts = [np.array([*c[:-1], c[-1] - 1], float) for c in blocks.cuts]
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for a in cuts[others[0]]:
            for b in cuts[others[1]]:
                ends = [cuts[others[0]][[0, -1]], cuts[others[1]][[0, -1]]]
                if a in ends[0] and b in ends[1]:
                    continue  # an edge of the volume
                line = np.zeros((len(t), 3))
                line[:, axis] = (t * cuts[axis][-1])[:, 0]
                line[:, others[0]], line[:, others[1]] = a, b
                points.append(line)
    index = np.concatenate(points)[:, ::-1]
    homogeneous = np.column_stack([index, np.ones(len(index))])
    to_view = view.model_to_view @ blocks.grid.index_to_model
    viewport = homogeneous @ (view.viewport_matrix(size) @ to_view).T
    place = (viewport[:, :2] / viewport[:, 3:] + 1) / 2 * size
    width, height = size
    near = np.zeros((height, width), bool)
    for dx in np.arange(-NEAR, NEAR + 1):
        for dy in np.arange(-NEAR, NEAR + 1):
            x, y = np.floor(place[:, 0] + dx).astype(int), np.floor(place[:, 1] + dy).astype(int)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            near[height - 1 - y[inside], x[inside]] = True
    return near


def seam(expected: np.ndarray, drawn: np.ndarray, near: np.ndarray) -> float:
    """Return the mean difference near blocks' edges over that elsewhere."""
    difference = np.abs(expected - drawn).max(axis=2)
    seen = expected[..., 3] > 0
    elsewhere = difference[seen & ~near].mean()
    return float(difference[seen & near].mean() / elsewhere) if elsewhere > 0 else 0.0


# -- large, on a cluster --------------------------------------------------------------------------


def stored(options: argparse.Namespace, folder: str) -> pvdi.Volume:
    """Return the large volume, written chunk by chunk where it is not there yet.

    A ball of waves, of which an eighth is nothing, with noise: about half of the chunks are
    visible.
    """
    import zarr

    path = options.store or Path(folder) / "large.zarr"
    n = options.edge
    if not path.exists():
        array = zarr.create_array(
            store=str(path), shape=(n,) * 3, chunks=(CHUNK,) * 3, dtype="u1", overwrite=True
        )
        noise = np.random.default_rng(1).integers(0, 4, (CHUNK,) * 3, np.uint8)
        for z in tqdm(range(0, n, CHUNK), desc="writing", leave=False):
            for y in range(0, n, CHUNK):
                for x in range(0, n, CHUNK):
                    corner = np.array([z, y, x])
                    array[z : z + CHUNK, y : y + CHUNK, x : x + CHUNK] = chunk(corner, n, noise)
    return pvdi.Volume(zarr.open_array(str(path), mode="r"), name="waves")


def chunk(corner: np.ndarray, n: int, noise: np.ndarray) -> np.ndarray:
    """Return a chunk of the large volume: smooth every eighth point, and noise at each."""
    step = 8
    at = [(c + np.arange(0, CHUNK, step)) / n - 0.5 for c in corner]
    z, y, x = np.meshgrid(*at, indexing="ij", sparse=True)
    r = np.sqrt(x * x + y * y + z * z)
    field = 100 + 100 * np.sin(40 * x) * np.sin(35 * y + 3 * z) * np.cos(30 * z)
    coarse = np.where(r < 0.42, np.clip(field, 8, 240), 0).astype(np.uint8)
    fine = np.repeat(np.repeat(np.repeat(coarse, step, 0), step, 1), step, 2)
    return np.where(fine > 0, fine + noise, 0).astype(np.uint8)


LOOKS: dict[str, Any] = {
    "cmap": "viridis",
    "opacity": [0.0, 0.0, 0.05, 0.2, 0.5, 0.6],
    "clim": (0, 255),
    "opacity_unit_distance": 16.0,
    "sample_distance": 1.0,
    "interpolation": "linear",
}


class Cluster:
    """Two workers of one thread, each confined to a core of its own."""

    def __init__(self, memory: int) -> None:
        from distributed import Client, LocalCluster

        self.cluster = LocalCluster(
            n_workers=2, threads_per_worker=1, memory_limit=memory, dashboard_address=":0"
        )
        self.client = Client(self.cluster)
        cores = sorted(os.sched_getaffinity(0))
        self.workers = list(self.client.scheduler_info()["workers"])
        for k, at in enumerate(self.workers):
            core = {cores[k % len(cores)]}
            self.client.run(lambda core=core: os.sched_setaffinity(0, core), workers=[at])

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.client.close()
        self.cluster.close()

    def peaks(self) -> dict[int, int]:
        """Return the largest resident memory of each worker's process so far, bytes."""
        return self.client.run(
            lambda: (os.getpid(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
        )


def shares(stream: list[dict[str, Any]]) -> dict[str, float]:
    """Return seconds by kind of task, and of transfers between workers."""
    seconds: dict[str, float] = {}
    for task in stream:
        name = str(task["key"]).strip("('").split("-")[0]
        for part in task["startstops"]:
            kind = name if part["action"] == "compute" else part["action"]
            seconds[kind] = seconds.get(kind, 0.0) + part["stop"] - part["start"]
    return seconds


def large_part(options: argparse.Namespace) -> dict[str, Any]:
    """Return memory and bytes of a VDI of the large volume on two small workers."""
    from distributed import get_task_stream

    with tempfile.TemporaryDirectory() as folder:
        volume = stored(options, folder)
        camera = filling_camera(volume.bounds, options.size)
        with Cluster(WORKER_BYTES) as cluster:
            before = cluster.peaks()
            if options.known:
                volume.chunks.found_ranges()
            bar = tqdm(total=1.0, desc="large", leave=False)
            with get_task_stream(client=cluster.client) as stream:
                start = time.perf_counter()
                vdi = pvdi.generate(
                    volume,
                    camera,
                    options.size,
                    client=cluster.client,
                    memory_limit=300_000_000,
                    progress=lambda done: bar.update(done - bar.n),
                    **LOOKS,
                )
                seconds = time.perf_counter() - start
            after = cluster.peaks()
            high = volume.chunks.ranges()[1]
            opacities = pvdi.TransferFunction.from_dict(vdi.metadata["transfer_function"]).opacities
            least = np.argmax(opacities > 0) / (len(opacities) - 1) * 255
            visible = int((high > least).sum()) * CHUNK**3
            return {
                "edge": options.edge,
                "bytes": volume.array.nbytes,
                "supersegments": vdi.n_supersegments,
                "blocks": vdi.metadata["blocks"],
                "points_read": vdi.metadata["points_read"],
                "runs_merged": vdi.metadata["runs_merged"],
                "rays": int((np.diff(vdi.offsets.astype(np.int64)) > 0).sum()),
                "read_over_visible": vdi.metadata["points_read"] / visible,
                "visible": visible / volume.array.size,
                "restarts": len({p for p, _ in before.values()} ^ {p for p, _ in after.values()}),
                "worker_peaks": sorted(peak for _, peak in after.values()),
                "worker_limit": WORKER_BYTES,
                "client_peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
                "seconds": seconds,
                "shares": shares(stream.data),
            }


def speed_part(options: argparse.Namespace) -> dict[str, Any]:
    """Return the time of one worker over that of two, and the share of exchange and merging."""
    from distributed import get_task_stream

    from pyvista_vdi.large.on_dask import generate_on_dask

    ratios: list[float] = []
    parts: dict[str, float] = {}
    small = argparse.Namespace(**{**vars(options), "edge": FAST_EDGE, "store": options.fast_store})
    with tempfile.TemporaryDirectory() as folder, Cluster(10**10) as cluster:
        volume = stored(small, folder)
        volume.chunks.found_ranges()
        camera = filling_camera(volume.bounds, options.size)
        looks = {k: v for k, v in LOOKS.items() if k != "sample_distance"}
        function = Classification(looks, "a benchmark").transfer_function(volume)
        for turn in range(6):
            seconds = {}
            for workers in (cluster.workers[:1], cluster.workers):
                with get_task_stream(client=cluster.client) as stream:
                    start = time.perf_counter()
                    generate_on_dask(
                        volume,
                        camera,
                        options.size,
                        function,
                        client=cluster.client,
                        workers=workers,
                        block_bytes=2**24,
                    )
                    seconds[len(workers)] = time.perf_counter() - start
                parts = shares(stream.data)
            if turn:  # the first one compiles
                ratios.append(seconds[1] / seconds[2])
    merging = sum(parts.get(kind, 0) for kind in ("rows", "merge", "lengths", "transfer"))
    return {
        "ratio": statistics.median(ratios),
        "ratios": ratios,
        "shares": parts,
        "exchange_and_merge": merging / sum(parts.values()),
    }


# -- what is written ------------------------------------------------------------------------------


def report(results: dict[str, Any]) -> str:
    """Return the tables."""
    parts = results["parts"]
    lines = ["# Volumes in blocks", ""]
    if "accuracy" in parts:
        heads, rows = ["volume, look", "blocks", "supersegments", "V_O: SSIM", "worst"], []
        for angle in ANGLES[1:]:
            heads += [f"{angle} degrees: SSIM", "seam"]
        for name, cells in parts["accuracy"].items():
            for n, cell in cells.items():
                at = {angle: cell[str(angle)] for angle in ANGLES}
                row = [name, n, f"{cell['supersegments']:.4f}"]
                row += [marked(f"{at[0]['ssim']:.6f}", at[0]["ssim"] >= LEAST_SSIM[0])]
                row += [marked(f"{at[0]['worst']:.3f}", at[0]["worst"] <= 1)]
                for angle in ANGLES[1:]:
                    ssim = at[angle]["ssim"]
                    row += [marked(f"{ssim:.5f}", ssim >= LEAST_SSIM[angle])]
                    row += [f"{at[angle]['seam']:.2f}"]
                rows.append(row)
        lines += [LEGEND, "", *table(heads, rows)]
    if "large" in parts:
        found = parts["large"]
        peaks = ", ".join(f"{peak / 1e6:.0f}" for peak in found["worker_peaks"])
        text = (
            f"{found['edge']}^3 points in chunks of {CHUNK}^3, two workers of "
            f"{found['worker_limit'] / 1e6:.0f} MB: peaks of {peaks} MB, restarts "
            f"{found['restarts']}; the client's peak {found['client_peak'] / 1e9:.2f} GB; points "
            f"read over those of visible chunks ({found['visible']:.0%} of all): "
            f"{found['read_over_visible']:.2f}."
        )
        lines += ["", text]
    if "speed" in parts:
        found = parts["speed"]
        text = (
            f"Two workers against one, a core each: {found['ratio']:.2f}; exchange and merging "
            f"take {found['exchange_and_merge']:.0%} of all."
        )
        lines += ["", text]
    return "\n".join([*lines, "", system_line(results["system"]), ""])


if __name__ == "__main__":
    sys.exit(main())
