"""Ambient occlusion: how near the grid is to the definition, what it costs, and what a VDI loses.

Writes ``ambient_occlusion_WxH.json`` and ``.md``, for the two volumes that are shipped.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import numpy as np
from common import (  # beside this file
    add_size,
    new_parser,
    results_file,
    save,
    subject_of,
)
from tqdm import tqdm

from pyvista_vdi import AmbientOcclusion
from pyvista_vdi.api import render, render_volume
from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import table, write_text
from pyvista_vdi.model.ambient_occlusion import OcclusionGrid
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.reference import ambient_transmittance
from pyvista_vdi.reference.occlusion import _trilinear as trilinear
from pyvista_vdi.reference.rays import pixel_ray
from pyvista_vdi.volume.classified_volume import DeviceVolume

VOLUMES = ("brain", "rayleigh_taylor")
ANGLES = (0.0, 5.0, 30.0)
#: Points at which the grid is compared with the definition, and directions of the definition.
POINTS, DIRECTIONS = 400, 512

LEGEND = """\
A: at points that V_O sees, as likely as they count in its picture, what is open on average; rms and
mean: how far the grid is from the definition there (512 directions, steps of half a voxel, no
grid). Anew, kept: generation with the occlusion computed, and with one that was kept, over
generation without, by the process's CPU time, median of rounds in turns. SSIM: the VDI against our
raycaster with the same occlusion, and in brackets both without."""


def main() -> int:
    """Measure, and write what was found."""
    parser = new_parser(__doc__, repeats=5, repeated="timed rounds")
    add_size(parser, (640, 360))
    parser.set_defaults(interpolation="linear")
    options = parser.parse_args()
    cases = [(name, look) for name in VOLUMES for look in TRANSFER_FUNCTIONS]
    results = {
        "window_size": list(options.size),
        "device": get_runtime().info.name,
        "rows": [measured(*case, options) for case in tqdm(cases, unit="case")],
    }
    target = results_file("ambient_occlusion", options)
    save(results, target)
    write_text(target.with_suffix(".md"), "\n".join([*described(results), ""]))
    return 0


def measured(name: str, look: str, options: argparse.Namespace) -> dict[str, Any]:
    """Return a row of the table."""
    volume, classified, view = subject_of(name, options, look)
    occlusion = AmbientOcclusion()
    plain = generate_vdi(volume, view, options.size, classified)
    occluded = generate_vdi(volume, view, options.size, classified, ambient_occlusion=occlusion)
    return {
        "volume": name,
        "transfer_function": look,
        **error(volume, classified, plain, occlusion),
        **cost(volume, classified, view, options),
        "ssim": ssim(volume, classified, occluded, occlusion),
        "plain_ssim": ssim(volume, classified, plain, None),
    }


def error(
    volume: Volume, classified: TransferFunction, vdi: VDI, occlusion: AmbientOcclusion
) -> dict[str, float]:
    """Compare the grid with the definition where V_O sees something."""
    medium = DeviceVolume(get_runtime(), volume, classified, ambient_occlusion=occlusion)
    nodes = get_runtime().download(medium._occlusion[0]).astype(np.float64)
    cell = OcclusionGrid.of(volume, occlusion).cell
    position = seen_points(volume, vdi)
    radius = occlusion.radius_in(volume)
    exact = ambient_transmittance(volume, classified, position, radius, DIRECTIONS)
    difference = trilinear(nodes, position / cell) - exact
    return {
        "open": float(exact.mean()),
        "rms": float(np.sqrt(np.mean(difference**2))),
        "mean": float(difference.mean()),
    }


def seen_points(volume: Volume, vdi: VDI) -> np.ndarray:
    """Return index positions in the medium, as likely as they count in V_O's picture."""
    rng = np.random.default_rng(1)
    list_of = np.repeat(np.arange(len(vdi.counts.ravel())), vdi.counts.ravel())
    tau = vdi.optical_depth.astype(np.float64)
    before = np.cumsum(tau) - tau
    before -= before[vdi.offsets[list_of].astype(np.int64)]  # of the own list only
    weight = np.exp(-before) * -np.expm1(-tau)
    chosen = rng.choice(len(tau), POINTS, p=weight / weight.sum())
    # Within a supersegment as an exponential medium hides it
    share = -np.log1p(rng.random(POINTS) * np.expm1(-tau[chosen])) / tau[chosen]
    depth = vdi.depth_origin + vdi.front[chosen] + share * (vdi.back - vdi.front)[chosen]
    to_index = np.linalg.inv(volume.index_to_model)
    width = vdi.window_size[0]
    points = []
    for one, z in zip(list_of[chosen], depth, strict=True):
        ray = pixel_ray(vdi.camera, vdi.window_size, int(one % width), int(one // width))
        points.append(to_index[:3, :3] @ (ray.origin + z * ray.direction) + to_index[:3, 3])
    return np.array(points)


def cost(
    volume: Volume, classified: TransferFunction, view: Camera, options: argparse.Namespace
) -> dict[str, float]:
    """Return the ratios of generation with occlusion to without, in turns."""
    radius = AmbientOcclusion().radius_in(volume)
    kept = radius

    def generate(occlusion: float | None) -> None:
        generate_vdi(volume, view, options.size, classified, ambient_occlusion=occlusion)

    def anew() -> None:
        nonlocal kept
        kept += 1e-6 * radius  # nothing is kept of another radius
        generate(kept)

    work = {"plain": lambda: generate(None), "anew": anew, "kept": lambda: generate(kept)}
    clocks = {"clock": time.process_time}
    taken = take_turns(work, options.repeats, warm_up=False, clocks=clocks)
    seconds = {name: median(times) for name, times in taken.items()}
    return {f"{name}_ratio": seconds[name] / seconds["plain"] for name in ("anew", "kept")}


def ssim(
    volume: Volume, classified: TransferFunction, vdi: VDI, occlusion: AmbientOcclusion | None
) -> list[float]:
    """Compare with the volume's own pictures."""
    found = []
    for angle in ANGLES:
        view = vdi.camera.azimuth(angle)
        picture = render_volume(
            volume,
            view,
            vdi.window_size,
            transfer_function=classified,
            ambient_occlusion=occlusion,
        )
        found.append(compare_images(render(vdi, view), picture).ssim)
    return found


def described(results: dict[str, Any]) -> list[str]:
    """Return the rows as Markdown."""
    width, height = results["window_size"]
    head = f"{width} x {height}, linear, N_S 20, the default occlusion, {results['device']}."
    heads = ["volume", "look", "A", "rms", "mean", "anew", "kept", "SSIM 0°", "5°", "30°"]
    rows = []
    for row in results["rows"]:
        cells = [row["volume"], row["transfer_function"]]
        cells += [f"{row['open']:.3f}", f"{row['rms']:.3f}", f"{row['mean']:+.3f}"]
        cells += [f"{row['anew_ratio']:.2f}", f"{row['kept_ratio']:.2f}"]
        pairs = zip(row["ssim"], row["plain_ssim"], strict=True)
        cells += [f"{with_it:.4f} ({without:.4f})" for with_it, without in pairs]
        rows.append(cells)
    return [head, LEGEND, "", *table(heads, rows)]


if __name__ == "__main__":
    sys.exit(main())
