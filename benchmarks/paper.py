"""The paper's tables measured again, beside its figures: VDIs over volume rendering, previews.

Table 1 on volumes like the paper's (``shared/volumes.py``) at its windows, N_S and angles: frames
without and with skipping, of ``render_volume`` and of VTK's mappers, which end with the picture on
the host (VTK's in its framebuffer), in turns; pictures against ``render_volume`` at half a voxel.
Table 2: previews at its rates, by fewer pixels, as plotters do, and by samples along rays.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from shared import Case, Latest, Results, execute, load, milliseconds, parser_of, table
from shared.volumes import KINDS
from skimage.transform import resize

from pyvista_vdi import TransferFunction, read_volume
from pyvista_vdi.cli.declare import size as parse_size
from pyvista_vdi.measure.bench import Bench, accuracy, take_turns
from pyvista_vdi.quality.rate import FrameRate

PAPER = json.loads(Path(__file__).with_name("paper_tables.json").read_text(encoding="utf-8"))

#: The paper's windows, N_S and angles; those of a sample come first.
SIZES, LIMITS, ANGLES = ((1280, 720), (1920, 1080)), (15, 30), (0.0, 5.0, 30.0)
SAMPLED = ("brain", "kingsnake_like@4", "beechnut_like@4", "richtmyer_meshkov_like@8")

#: Opacity at equidistant scalars: air and its noise are transparent, tissue is translucent, bone is
#: not; of two fluids one is transparent; a ramp elsewhere. Colours are black, blue-grey, white.
OPACITIES = {
    "kingsnake": (0.0, 0.0, 0.02, 0.05, 0.3, 0.8),
    "beechnut": (0.0, 0.0, 0.02, 0.05, 0.3, 0.8),
    "richtmyer_meshkov": (0.0, 0.0, 0.0, 0.01, 0.05, 0.15, 0.05, 0.01, 0.005),
}
COLORS = ((0.0, 0.0, 0.0), (0.25, 0.3, 0.45), (0.7, 0.7, 0.6), (1.0, 1.0, 1.0))

#: Frames in which the controller may find its choice, and those that are measured afterwards;
#: samples of a ray that count as full quality.
SETTLING, MEASURED, MOST_SAMPLES = 12, 5, 64

#: Who draws, by the keys of the results.
WAYS = ("f", "f_e", "volume", "volume skipping", "gpu", "fixed_point")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, volumes=(), repeats=5)
    parser.add_argument("--sizes", nargs="+", type=parse_size, metavar="WxH")
    parser.add_argument("--no-vtk", action="store_true", help="leave out VTK's mappers")
    options = parser.parse_args(arguments)
    # The paper's own volumes are files: kingsnake=FILE
    files = dict(each.split("=", 1) for each in options.volumes if "=" in each)
    options.volumes = [each.partition("=")[0] for each in options.volumes]
    options.volumes = options.volumes or list(KINDS if options.whole else SAMPLED)
    options.sizes = options.sizes or (SIZES if options.whole else SIZES[:1])

    def bench_of(name: str, size: tuple[int, int]) -> Bench:
        volume = read_volume(files[name]) if name in files else load(name)
        function = look(name, volume)
        return Bench(volume, function, size, device=options.device, vtk=not options.no_vtk)

    with Latest(bench_of) as kept:

        def measure(case: Case) -> dict[str, Any]:
            bench, limit = kept(case.volume, case.window_size), dict(case.options)["N_S"]
            vdi = bench.generate(max_supersegments=limit)
            if case.what == "previews":
                return previews(bench, vdi, case.angle or 0.0)
            found = frames(bench, vdi, case.angle or 0.0, options.repeats)
            bytes_of = {"mean_length": vdi.n_supersegments / max(1, np.count_nonzero(vdi.counts))}
            return {**found, **bytes_of, "bytes": vdi.nbytes}

        cases = [
            Case(name, None, tuple(size), angle, (("N_S", limit),), "frames")
            for name, size, limit, angle in product(options.volumes, options.sizes, LIMITS, ANGLES)
        ]
        of_previews = next((v for v in options.volumes if "beechnut" in v), options.volumes[0])
        size = tuple(options.sizes[-1])
        cases.append(Case(of_previews, None, size, 30.0, (("N_S", 15),), "previews"))
        rooms = ("generation", "raycasting", "volume", "quality")
        execute("paper", options, cases, measure, report, count=len(cases), rooms=rooms)
    return 0


def look(name: str, volume: Any) -> TransferFunction:
    """Return how a volume looks; it needs no PyVista, so that every run has the same."""

    def resampled(nodes: Sequence[float]) -> Any:
        return np.interp(np.linspace(0, len(nodes) - 1, 256), np.arange(len(nodes)), nodes)

    colors = np.stack([resampled(channel) for channel in zip(*COLORS, strict=True)], axis=1)
    values = volume.finite_range()
    if name.partition("@")[0] in KINDS:  # its type's whole range, whatever the seed made of it
        values = (0.0, float(np.iinfo(volume.array.dtype).max))
    nodes = OPACITIES.get(name.partition("_like")[0], (0.0, 1.0))
    return TransferFunction(colors, resampled(nodes), values)


def frames(bench: Bench, vdi: Any, angle: float, repeats: int) -> dict[str, Any]:
    """Return medians of frame times by who draws, and how near the pictures are."""
    camera = bench.view.azimuth(angle)
    own = bench.frames(camera, vdi)
    work = {
        "f": partial(bench.draw, vdi, camera, skip_empty=False),
        "f_e": own.pop("vdi"),
        "volume": partial(bench.raycast, camera, bench.voxel, skip_empty=False),
        "volume skipping": own.pop("volume"),
        **own,
    }
    taken = take_turns(work, repeats)
    return {
        "seconds": {name: statistics.median(times) for name, times in taken.items()},
        "near": accuracy(bench.draw(vdi, camera), bench.reference(camera)),
    }


def previews(bench: Bench, vdi: Any, angle: float) -> dict[str, Any]:
    """Keep each target rate of the paper's Table 2 in both ways, and look at the pictures."""
    camera, (width, height) = bench.view.azimuth(angle), bench.size
    whole = bench.draw(vdi, camera)
    full = take_turns({"full": partial(bench.draw, vdi, camera)}, MEASURED)["full"]

    def fewer_pixels(pixels: int) -> Any:
        edge = math.sqrt(pixels / (width * height))
        size = max(1, round(width * edge)), max(1, round(height * edge))
        return bench.draw(vdi, camera, size)

    def fewer_samples(samples: int) -> Any:
        return bench.draw(vdi, camera, preview_samples=samples)

    rows = []
    for target in PAPER["table2"]["targets"]:
        # Multiples of the full frame's rate ask the same of every device
        speed_up = target["fps"] / PAPER["table2"]["full_fps"]
        for name, way, most in (
            ("fewer pixels", fewer_pixels, width * height),
            ("samples per ray", fewer_samples, MOST_SAMPLES),
        ):
            samples, seconds = settled(way, most, speed_up / statistics.median(full))
            image = way(samples)
            if image.shape != whole.shape:
                image = resize(image, whole.shape, order=1, mode="edge", anti_aliasing=False)
            found = {"way": name, "target": speed_up, "share": samples / most}
            reached = statistics.median(full) / seconds
            ssim = accuracy(image, whole)["ssim"]
            rows.append({**found, "reached": reached, "ssim": ssim, "paper": target["ssim"]})
    return {"ways": rows, "seconds": statistics.median(full)}


def settled(way: Callable[[int], Any], most: int, target_fps: float) -> tuple[int, float]:
    """Return the controller's choice once it has settled, and the median time of its frames."""
    way(most)  # not counted: its kernel may have to be compiled
    rate = FrameRate(target_fps, floor=1 / most)
    for _ in range(SETTLING):
        samples = rate.chosen(most)
        (seconds,) = take_turns({"way": partial(way, samples)}, 1, warm_up=False)["way"]
        rate = rate.record(samples, seconds, seconds).choose(most)
    samples = rate.chosen(most)
    taken = take_turns({"way": partial(way, samples)}, MEASURED, warm_up=False)["way"]
    return samples, statistics.median(taken)


def of_paper(case: dict[str, Any]) -> dict[str, Any] | None:
    """Return the paper's cell of Table 1: speed-ups over its volume rendering, and SSIM."""
    name = case["volume"].partition("_like")[0]
    for row in PAPER["table1"]:
        if (row["dataset"], row["window_size"]) == (name, list(case["window_size"])):
            for cell in row["vdi"]:
                if (cell["max_supersegments"], cell["angle"]) == (case["N_S"], case["angle"]):
                    volume = row["volume_fps"][str(cell["angle"])]
                    ratios = {"f": cell["fps"] / volume, "f_e": cell["fps_skipping"] / volume}
                    return {**ratios, "ssim": cell["ssim"]}
    return None


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield Table 1 and Table 2, beside the paper's figures."""
    yield "Medians, milliseconds; speed-ups over `render_volume` without skipping, in brackets the"
    yield f"paper's over its own volume rendering ({PAPER['device']})."
    yield ""
    rows = []
    for row in results.rows(what="frames"):
        case, seconds, paper = row["case"], row["seconds"], of_paper(row["case"])
        cells = [case["volume"], "x".join(map(str, case["window_size"])), case["N_S"]]
        cells += [f"{case['angle']:g}", *(milliseconds(seconds.get(way)) for way in WAYS)]
        for way in ("f", "f_e"):
            of_theirs = f" ({paper[way]:.1f})" if paper else ""
            cells.append(f"{seconds['volume'] / seconds[way]:.1f}{of_theirs}")
        of_theirs = f" ({paper['ssim']:.3f})" if paper else ""
        cells.append(f"{row['near']['ssim']:.4f}{of_theirs}")
        rows.append([*cells, f"{row['mean_length']:.1f}", f"{row['bytes'] / 2**20:.1f}"])
    heads = ["volume", "window", "N_S", "angle", *WAYS, "speed-up f", "speed-up f_e", "SSIM"]
    yield from table([*heads, "per list", "MiB"], rows)
    for row in results.rows(what="previews"):
        yield from ("", f"Previews of {row['case']['volume']}, SSIM to the full frame:", "")
        heads = ["way", "target", "reached", "share", "SSIM", "paper"]
        shown = [
            [
                way["way"],
                *(f"{way[n]:.3g}" for n in ("target", "reached", "share", "ssim", "paper")),
            ]
            for way in row["ways"]
        ]
        yield from table(heads, shown)


if __name__ == "__main__":
    sys.exit(main())
