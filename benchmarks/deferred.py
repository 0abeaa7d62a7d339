"""What deferred VDIs' pictures lose under transfer functions that generation never saw.

Sixteen volumes that are handed and four that are made; everything in their range is kept, air too.
Beside each deferred VDI stands the one made for the very transfer function, with the same N_S and
the same 8 bytes a supersegment, and beside volume rendering the same with steps an eighth as long:
nearer than that no list comes but by chance. Nothing is timed.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shared import Case, Latest, Results, execute, load, marked, parser_of, table

import pyvista_vdi as pvdi
from pyvista_vdi import examples
from pyvista_vdi.measure.bench import Bench, accuracy

#: Volumes that are not handed: made from seeds, and by formulas below.
MADE = ("kingsnake_like@8", "richtmyer_meshkov_like@8", "phantom", "marschner_lobb")

ANGLES = (0.0, 5.0, 30.0)
#: Of both kinds of VDI.
LISTS = {"max_supersegments": 20, "precision": "8-byte"}

WIDE = ("ramp", "window", "peak .2", "peak .05", "low peak .05", "peak .05 between")
SHARP = ("peak .016", "step", "opaque step")

#: Reached by groups of looks: SSIM at V_O, mean and worst; less the baked one's, mean and worst.
REACHES = {"wide": (0.996, 0.985, -0.003, -0.015), "sharp": (0.985, 0.96, -np.inf, -0.03)}
#: Brightness, |ratio - 1| in the mean and at worst, of pictures above 2/255; pixels; bytes.
MOST_MEAN, MOST_WORST, DARK, MOST_MOVED, MOST_BYTES = 0.03, 0.05, 2 / 255, 0.5, 0.75

KINDS = ("deferred", "baked")

Image = NDArray[np.float32]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    options = parser_of(__doc__, volumes=(*examples.WHOLE, *MADE)).parse_args(arguments)
    size = tuple(options.size)
    every = [Case(name, look, size) for name in options.volumes for look in WIDE + SHARP]
    volumes = Latest(
        lambda name: made(name) if name in ("phantom", "marschner_lobb") else load(name)
    )

    def kept(name: str) -> tuple[pvdi.DeferredVDI, dict[str, pvdi.TransferFunction]]:
        volume = volumes(name)
        bench = Bench(volume, looks(volume)["ramp"], size, device=options.device, vtk=False)
        asked = {"interpolation": "linear", "device": bench.runtime, **LISTS}
        vdi = pvdi.generate(volume, bench.view, size, classification="deferred", **asked)
        return vdi, looks(volume)

    deferred = Latest(kept)

    def measure(case: Case) -> dict[str, Any]:
        vdi, found = deferred(case.volume)
        own = found[str(case.look)]
        bench = Bench(volumes(case.volume), own, size, device=options.device, vtk=False)
        return measured(bench, vdi, with_bytes=case.look == "ramp")

    rooms = ("generation", "raycasting", "volume")
    execute("deferred", options, every, measure, report, count=20, rooms=rooms)
    return 0


def made(name: str) -> pvdi.Volume:
    """Return a volume that is a formula: a phantom of two materials in air, or Marschner-Lobb's."""
    n = 96
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, n, dtype=np.float32)] * 3, indexing="ij")
    if name == "marschner_lobb":
        rings = np.cos(12 * np.pi * np.cos(np.pi * np.hypot(x, y) / 2))
        values = (1 - np.sin(np.pi * z / 2) + 0.25 * (1 + rings)) / 2.5
        return pvdi.Volume(values.astype(np.float32), name=name)
    noise = np.random.default_rng(47).normal(0, 0.01, x.shape)

    def inside(radius: NDArray[Any], edge: float) -> NDArray[Any]:
        return 1 / (1 + np.exp(np.clip((radius - edge) * 1.2 * n, -80, 80)))

    body = inside(np.sqrt(x**2 + (y / 0.8) ** 2 + (z / 0.9) ** 2), 0.9)
    shell = inside(np.sqrt(x**2 + y**2 + z**2), 0.6) - inside(np.sqrt(x**2 + y**2 + z**2), 0.52)
    core = inside(np.sqrt((x - 0.2) ** 2 + y**2 + z**2), 0.2)
    values = body * (0.3 + 0.55 * shell + 0.25 * core + noise)
    return pvdi.Volume(np.clip(1000 * values, 0, 1000).astype(np.uint16), name=name)


@cache
def looks(volume: pvdi.Volume) -> dict[str, pvdi.TransferFunction]:
    """Return the transfer functions of a volume, by what its values are above its air."""
    least, largest = volume.finite_range()
    x = np.linspace(0, 1, 1025)
    values = (volume.array.ravel()[::97].astype(float) - least) / (largest - least)
    values = values[values > 0.02]
    low, high = np.quantile(values, [0.3, 0.8])
    edge = float(np.median(values))
    for _ in range(20):  # two materials: between their means
        below, above = values[values <= edge], values[values > edge]
        if not (len(below) and len(above)):
            break
        edge = (below.mean() + above.mean()) / 2

    def peak(middle: float, width: float, height: float = 0.6) -> NDArray[Any]:
        middle = min(max(middle, width / 2 + 0.02), 1 - width / 2)
        return height * np.clip(1 - np.abs(x - middle) / (width / 2), 0, 1)

    opacities = {
        "ramp": 0.5 * x,
        "window": 0.7 * np.clip((x - max(edge - 0.1, 0.02)) / 0.2, 0, 1),
        "peak .2": peak(high, 0.2),
        "peak .05": peak(high, 0.05),
        "low peak .05": peak(0.0, 0.05),
        "peak .05 between": peak(edge, 0.05),
        "peak .016": peak(high, 0.016, 0.9),
        "step": 0.9 * (x > max(edge, 0.05)),
        "opaque step": 1.0 * (x > max(low, 0.05)),
    }
    colors = 0.2 + 0.8 * np.stack([x, 1 - np.abs(2 * x - 1), 1 - x], axis=1)
    return {
        name: pvdi.TransferFunction(colors, opacity, (least, largest), interpolation="linear")
        for name, opacity in opacities.items()
    }


def measured(bench: Bench, deferred: pvdi.DeferredVDI, *, with_bytes: bool) -> dict[str, Any]:
    """Return how near the pictures of both kinds are by angle, and the bytes of their files."""
    baked = bench.generate(**LISTS)
    kinds = {
        "deferred": deferred.classified(transfer_function=bench.table, device=bench.runtime),
        "baked": baked,
    }
    figures: dict[str, Any] = {
        "supersegments": {"deferred": deferred.n_supersegments, "baked": baked.n_supersegments}
    }
    if with_bytes:
        with tempfile.TemporaryDirectory() as folder:
            figures["bytes"] = {
                name: vdi.save(Path(folder) / "a.vdi", compression="zstd").stat().st_size
                for name, vdi in (("deferred", deferred), ("baked", baked))
            }
    for angle in ANGLES:
        view = bench.view.azimuth(angle)
        truth = bench.reference(view)
        pictures = {name: bench.draw(vdi, view) for name, vdi in kinds.items()}
        if angle == 0:
            pictures["finer steps"] = bench.raycast(view, bench.step / 8)
        figures[f"{angle:g}"] = {
            "light": float(truth[..., :3].mean()),
            **{name: compared(picture, truth) for name, picture in pictures.items()},
        }
    return figures


def compared(picture: Image, truth: Image) -> dict[str, float | None]:
    """Return SSIM, brightness, how far silhouettes move, and pixels seen where there are none."""
    opaque, there = picture[..., 3] > 0.5, truth[..., 3] > 0.5
    outline = int((there[1:] != there[:-1]).sum() + (there[:, 1:] != there[:, :-1]).sum())
    none = picture[..., 3][truth[..., 3] == 0]
    return {
        "ssim": accuracy(picture, truth)["ssim"],
        "brightness": float(picture[..., :3].mean() / truth[..., :3].mean()),
        "moved": float((opaque != there).sum() / outline) if outline > 20 else None,
        "alpha_seen": float((none > DARK).sum() / truth[..., 3].size),
    }


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the tables: by group, look and volume, and bytes."""
    rows = list(results.rows())
    yield f"{LISTS['max_supersegments']} supersegments of 8 bytes, everything in the range kept,"
    yield "between points. SSIM to volume rendering at V_O, in brackets that of volume rendering"
    yield "with steps an eighth as long; turned, less the baked VDI's. Brightness: |ratio - 1| of"
    yield "pictures over 2/255. Silhouettes: pixels that change sides of an alpha of 1/2, per pixel"
    yield "of outline. In brackets those of the baked VDI. Bold: what misses its reach."
    yield ""
    groups = {
        "**wide**": [row for row in rows if row["case"]["look"] in WIDE],
        **{look: [row for row in rows if row["case"]["look"] == look] for look in WIDE},
        "**sharp**": [row for row in rows if row["case"]["look"] in SHARP],
        **{look: [row for row in rows if row["case"]["look"] == look] for look in SHARP},
    }
    heads = ("V_O", "worst", "5°", "worst", "30°", "worst", "brightness", "worst", "silhouettes")
    yield from table(
        ("look", *heads),
        [
            [name, *line(group, REACHES["wide" if name in ("**wide**", *WIDE) else "sharp"])]
            for name, group in groups.items()
            if group
        ],
    )
    yield ""
    names = list(dict.fromkeys(row["case"]["volume"] for row in rows))
    lines = []
    for name in names:
        of_name = [row for row in rows if row["case"]["volume"] == name]
        ratios = [
            row["bytes"]["deferred"] / row["bytes"]["baked"] for row in of_name if "bytes" in row
        ]
        ratio = marked(f"{ratios[0]:.2f}", ratios[0] <= MOST_BYTES) if ratios else ""
        lines.append([name, *line(of_name, None), ratio])
    yield from table(("volume", *heads, "bytes"), lines)
    yield ""
    yield "Pixels of over 2/255 alpha where volume rendering has none, in the mean and at worst:"
    for angle in ANGLES:
        shown = [row[f"{angle:g}"] for row in rows]
        for kind in (*KINDS, "finer steps"):
            seen = [one[kind]["alpha_seen"] for one in shown if kind in one]
            if seen:
                yield f"{angle:g}°, {kind}: {np.mean(seen):.3%}, {max(seen):.2%}."


def line(rows: Sequence[Any], reach: tuple[float, ...] | None) -> Iterator[str]:
    """Yield the cells of a line; bold is what misses its reach."""
    none = (-np.inf,) * 4
    mean, worst, less_mean, less_worst = reach or none
    found = [row["0"]["deferred"]["ssim"] for row in rows]
    finer = [row["0"]["finer steps"]["ssim"] for row in rows]
    yield f"{marked(f'{np.mean(found):.3f}', np.mean(found) >= mean)} ({np.mean(finer):.3f})"
    yield f"{marked(f'{min(found):.3f}', min(found) >= worst)} ({min(finer):.3f})"
    for angle in ("5", "30"):
        less = [row[angle]["deferred"]["ssim"] - row[angle]["baked"]["ssim"] for row in rows]
        yield marked(f"{np.mean(less):+.4f}", np.mean(less) >= less_mean)
        yield marked(f"{min(less):+.4f}", min(less) >= less_worst)
    of_all = [row[f"{angle:g}"] for row in rows for angle in ANGLES]
    ratios = [abs(one["deferred"]["brightness"] - 1) for one in of_all if one["light"] > DARK]
    of_baked = [abs(one["baked"]["brightness"] - 1) for one in of_all if one["light"] > DARK]
    if ratios:
        text = marked(f"{np.mean(ratios):.3f}", np.mean(ratios) <= MOST_MEAN)
        yield f"{text} ({np.mean(of_baked):.3f})"
        text = marked(f"{max(ratios):.3f}", max(ratios) <= MOST_WORST)
        yield f"{text} ({max(of_baked):.3f})"
    else:
        yield from ("", "")
    moved = [
        [one[kind]["moved"] for one in of_all if one["deferred"]["moved"] is not None]
        for kind in KINDS
    ]
    if moved[0]:
        yield f"{np.mean(moved[0]):.2f} ({np.mean(moved[1]):.2f})"
    else:
        yield ""


if __name__ == "__main__":
    sys.exit(main())
