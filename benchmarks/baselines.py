"""The paper's rivals: rays in the world, and cuts at equal shares: time by N_S and angle, SSIM.

Rays of Lochmann et al. 2016 (``world_rays.cl``) draw the same VDI as ours, or one cut by their own
criterion; frames end on the host, raycast alone. Cuts after Brady et al. 1997 (lengths), Lochmann
(transmittance) and by optical depths are also taken by ``accuracy.py``. Tests hold the pictures to
the oracle; docs/decisions/baselines.md has what was found.
"""

from __future__ import annotations

import itertools
import math
import statistics
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the reference is

from reference.compositing import Segment, merge, opacity, split
from reference.generate import vdi_of_lists
from reference.raycast import Lists, near_limit
from shared import Case, Latest, Results, benches, execute, milliseconds, parser_of, table

from pyvista_vdi.device import DeviceBuffer, Runtime
from pyvista_vdi.device.constants import GROUP, block_items
from pyvista_vdi.measure.bench import accuracy, take_turns
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import RenderOptions
from pyvista_vdi.model.vdi import VDI

Runs = Sequence[Segment]

KERNEL = Path(__file__).with_name("world_rays.cl"), "world_rays"

#: Supersegments of a list from which cuts are made: more than a ray through most data has.
RECORDED = 512

ANGLES, LIMITS = (0.0, 5.0, 15.0, 30.0, 90.0), (4, 8, 15, 30, 60)


def equal_lengths(runs: Runs, limit: int) -> NDArray[np.float64]:
    """Return depths of cuts at equal depths from the first face to the last."""
    return np.linspace(runs[0].front, runs[-1].back, limit + 1)[1:-1]


def equal_transmittance(runs: Runs, limit: int) -> NDArray[np.float64]:
    """Return where the light that reaches the eye has fallen by equal steps."""
    lost = opacity(sum(run.optical_depth for run in runs)) * np.arange(1, limit) / limit
    return _depths_of(runs, -np.log1p(-lost))


def equal_optical_depths(runs: Runs, limit: int) -> NDArray[np.float64]:
    """Return where equal steps of optical depth are passed."""
    whole = sum(run.optical_depth for run in runs)
    return _depths_of(runs, whole * np.arange(1, limit) / limit)


#: What returns the depths at which runs are cut, which ascend, by the criterion's name.
CRITERIA: Mapping[str, Callable[[Runs, int], NDArray[np.float64]]] = {
    "length": equal_lengths,
    "transmittance": equal_transmittance,
    "optical-depth": equal_optical_depths,
}


def _depths_of(runs: Runs, optical_depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where on the ray so much optical depth has been passed."""
    passed = np.concatenate([[0.0], np.cumsum([run.optical_depth for run in runs])])
    k = np.searchsorted(passed[:-1], optical_depths, side="right") - 1
    front, back, tau = np.array([(r.front, r.back, r.optical_depth) for r in runs]).T
    return np.asarray(front[k] + (optical_depths - passed[k]) / tau[k] * (back[k] - front[k]))


def cut_runs(runs: Runs, criterion: str, limit: int) -> list[Segment]:
    """Merge what lies between the same two cuts; split what spans them. Nothing is dropped."""
    ends = [*CRITERIA[criterion](runs, limit), math.inf] if runs else []
    cuts: list[Segment] = []
    cut, begun = 0, False
    for run in runs:
        rest: Segment | None = run
        while rest is not None:
            while ends[cut] <= rest.front:
                cut, begun = cut + 1, False
            spans = rest.front < ends[cut] < rest.back
            part, rest = split(rest, ends[cut]) if spans else (rest, None)
            if begun:
                cuts[-1] = merge(cuts[-1], part)
            else:
                cuts.append(part)
            begun = True
    return cuts


def cut(vdi: VDI, criterion: str, limit: int) -> VDI:
    """Return a VDI whose lists, of up to ``RECORDED`` supersegments, are cut by a criterion."""
    origin = vdi.depth_origin
    columns = (vdi.front, vdi.back, vdi.color, vdi.optical_depth)
    rows = zip(*(column.astype(np.float64) for column in columns), strict=True)
    runs = [Segment(front + origin, back + origin, color, tau) for front, back, color, tau in rows]
    ends = itertools.pairwise(vdi.offsets.tolist())
    lists = [cut_runs(runs[begin:end], criterion, limit) for begin, end in ends]
    return vdi_of_lists(lists, vdi.camera, vdi.window_size, vdi.bounds, origin, criterion)


class WorldRays:
    """A VDI drawn by rays of the new view, every supersegment intersected as a pyramid's part.

    ``binary``: whether a list's first supersegment is found by halving, not by looking from its
    beginning. The lists lie on the device one after the other, as view depths of faces less the
    depth origin, nothing behind V_O's eye, and as straight RGB and extinction per model length.
    """

    def __init__(self, runtime: Runtime, vdi: VDI, *, binary: bool = True) -> None:
        self._runtime, self._vdi = runtime, vdi
        self._wide, self._high = vdi.window_size
        self._parallel = vdi.camera.parallel_projection
        self._nearest = -np.inf if self._parallel else near_limit(vdi) - vdi.depth_origin
        in_float64 = Lists(vdi)
        faces = np.maximum(np.stack([vdi.front, vdi.back], axis=1), np.float32(self._nearest))
        with np.errstate(divide="ignore", over="ignore"):
            extinction = (in_float64.optical_depth / in_float64.length).astype(np.float32)
        extinction = np.minimum(extinction, np.finfo(np.float32).max)
        media = np.concatenate([vdi.color, extinction[:, None]], axis=1)
        # Model frame to (U d, V d, Z less the depth origin, d), where list (i, j) is
        # i <= U < i + 1, j <= V < j + 1, and d is Z, or 1 in parallel projection
        half = np.array([[self._wide / 2], [self._high / 2]])
        matrix = vdi.camera.viewport_matrix(vdi.window_size) @ vdi.camera.model_to_view
        self._to_lists = np.concatenate([half * (matrix[:2] + matrix[3]), matrix[2:]])
        self._to_lists[2, 3] -= vdi.depth_origin
        offsets = vdi.offsets.astype(np.int32)
        offsets, faces, media = map(self._upload, (offsets, faces, media))
        defines = {"BINARY_SEARCH": 1} if binary else {}
        self._draw = runtime.bind(*KERNEL, defines, offsets=offsets, faces=faces, media=media)
        cutoff = RenderOptions.transmittance_cutoff
        self._draw.set(lists_wide=self._wide, lists_high=self._high, cutoff=cutoff)

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.float32]:
        """Draw a frame; premultiplied RGBA (H, W, 4)."""
        runtime, (forms, planes) = self._runtime, self._rays(camera, size)
        with (
            runtime.upload(forms, "rays") as on_device,
            runtime.result((*size[::-1], 4), name="image") as image,
        ):
            of_frame = {"forms": on_device, "planes": planes, "image": image}
            self._draw(block_items(*size), GROUP, width=size[0], height=size[1], **of_frame)
            return runtime.download(image)

    def _rays(self, camera: Camera, size: tuple[int, int]) -> tuple[NDArray[np.float32], int]:
        """Return a window's rays: coordinates, model direction, planes to clip to; and how many."""
        vdi = self._vdi
        pixel_rays = rays.pixel_rays(camera, size, vdi.bounds)
        u, v, depth, d = pixel_rays.forms(self._to_lists)
        planes = [
            *rays.box_planes(pixel_rays, vdi.bounds),
            *(u, v, self._wide * d - u, self._high * d - v),
            *rays.view_planes(camera, pixel_rays, ()),
        ]
        if not self._parallel:
            planes.append(depth - self._nearest * np.eye(6)[0])
        direction = rays.direction_forms(pixel_rays, size)
        return rays.packed([u, v, depth, d, *direction, *planes]), len(planes)

    def _upload(self, array: NDArray[Any]) -> DeviceBuffer:
        """Bring an array to the device; one without elements as one that has some."""
        values = np.ascontiguousarray(array)
        return self._runtime.upload(values if values.size else np.zeros(4, values.dtype), "a list")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    options = parser_of(__doc__, volumes=("brain",), repeats=3).parse_args(arguments)
    with benches(options) as bench_of:

        def vdi_of(volume: str, limit: int) -> tuple[VDI, VDI]:
            bench = bench_of(volume, "soft")
            recorded = bench.generate(max_supersegments=RECORDED)
            return bench.generate(max_supersegments=limit), cut(recorded, "transmittance", limit)

        vdis = Latest(vdi_of)

        def measure(case: Case) -> dict[str, Any]:
            bench = bench_of(case.volume, "soft")
            camera, size = bench.view.azimuth(case.angle), bench.size
            vdi, by_theirs = vdis(case.volume, dict(case.options)["N_S"])
            work = {
                "ours, f": partial(bench.draw, vdi, camera, skip_empty=False),
                "ours, f_e": partial(bench.draw, vdi, camera),
                "halving": partial(WorldRays(bench.runtime, vdi).image, camera, size),
                "linear": partial(WorldRays(bench.runtime, vdi, binary=False).image, camera, size),
            }
            taken = take_turns(work, options.repeats)
            theirs = WorldRays(bench.runtime, by_theirs).image(camera, size)
            near = {"ours": bench.draw(vdi, camera), "by their own criterion": theirs}
            truth = bench.reference(camera)
            return {
                "seconds": {name: statistics.median(times) for name, times in taken.items()},
                "ssim": {name: accuracy(image, truth)["ssim"] for name, image in near.items()},
            }

        at = [(limit, 30.0) for limit in LIMITS] + [(15, a) for a in ANGLES if a != 30.0]
        cases = [
            Case(name, "soft", tuple(options.size), angle, (("N_S", limit),))
            for name in options.volumes
            for limit, angle in at
        ]
        execute("baselines", options, cases, measure, report, count=4)
    return 0


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield milliseconds and SSIM by N_S and angle."""
    rows, heads = [], []
    for row in results.rows():
        case = row["case"]
        heads = [*(f"{name}, ms" for name in row["seconds"]), *(f"SSIM {n}" for n in row["ssim"])]
        cells = [case["volume"], case["N_S"], f"{case['angle']:g}"]
        cells += [milliseconds(seconds) for seconds in row["seconds"].values()]
        rows.append([*cells, *(f"{ssim:.4f}" for ssim in row["ssim"].values())])
    yield from table(["volume", "N_S", "degrees", *heads], rows)


if __name__ == "__main__":
    sys.exit(main())
