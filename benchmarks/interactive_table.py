"""VDI frames, generation and render_volume against the faster of VTK's mappers, and the reaches.

Reads ``machine_cpu.json`` or ``machine_gpu.json`` (run ``machine.py`` first), for the reason why a
reach is missed, and ``scaling.json`` for what a second core brings. Writes ``interactive_WxH.json``
(all figures) and ``.md`` (the tables). See README.md in this folder.

It measures, compares with what is to be reached and writes, one table from top to bottom.

Every cell needs its measurement, its aim and its reason: hence more than 500 lines.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from common import (  # beside this file
    add_clock,
    add_looks,
    add_redo,
    add_size,
    begun,
    clock_of,
    new_parser,
    results_file,
    save,
)
from machine import Rates
from model import Model, around_work, hosted_work
from scaling import QUANTITIES, core_rows
from tqdm import tqdm

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.paper import find_dataset
from pyvista_vdi.measure.paper.datasets import label_of, require_allocation
from pyvista_vdi.measure.report import describe_system, system_line, table, write_text
from pyvista_vdi.measure.session import CANDIDATES, WARM_UP_SIZE, Bench, VDIRenderer
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.standard_cases import ANGLES
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

#: What volumes stand for, and which they are.
GROUPS: dict[str, tuple[str, ...]] = {
    "large": ("visible_female_head", "allen_mouse_brain", "kingsnake_like"),
    "medium": ("aneurism", "bonsai", "embryo", "heptane"),
    "solid": ("berea",),
}
#: The same with ``--quick``.
QUICK_GROUPS: dict[str, tuple[str, ...]] = {
    "large": ("kingsnake_like@4",),
    "medium": ("heptane",),
    "solid": ("berea",),
}

#: Most of a VDI frame's time over that of the faster of VTK's mappers, by group and degrees from
#: V_O; None: reported only.
REACHES: dict[str, dict[float, float | None]] = {
    "large": {0.0: 1 / 30, 5.0: 1 / 10, 30.0: 1 / 4},
    "medium": {0.0: 1 / 20, 5.0: 1 / 6, 30.0: 1 / 2.5},
    "solid": {0.0: 1 / 2, 5.0: 1.0, 30.0: None},
}

#: Most of generation's time over render_volume's at the same step, both without stopping at opaque.
GENERATION_REACH = 1.2
#: Most of render_volume's time over that of the faster of VTK's mappers, steps of a voxel.
VOLUME_REACH = 1.0

#: Who takes part: ours as users have them by default, and VTK's.
_OURS, _OUR_VOLUME = "vdi_skipping", "volume_skipping"
_PEERS = ("vtk_gpu", "vtk_fixed_point")

#: One block of rays is counted in so many pixels both ways.
_EVERY = 64

LEGEND = (
    "VDI frame over the faster of VTK's mappers, medians of turns in one run, the picture on the "
    "host; steps of one voxel for VTK and render_volume, half a voxel for generation; in brackets "
    "the reach."
)


@dataclass(frozen=True)
class Cell:
    """A ratio beside its reach.

    Parameters
    ----------
    ratio : float or None
        Measured; None where something is missing.
    reach : float or None
        The most that it may be; None where it is reported only.
    reason : str
        Why it is missed, by the model.
    """

    ratio: float | None
    reach: float | None
    reason: str = ""

    @property
    def verdict(self) -> str:
        """Whether it is met."""
        if self.ratio is None:
            return "not measured"
        if self.reach is None:
            return "reported"
        return "met" if self.ratio <= self.reach else "missed"

    def __str__(self) -> str:
        if self.ratio is None:
            return "-"
        reach = "" if self.reach is None else f" (≤ {as_share(self.reach)})"
        verdict = {"met": ", met", "missed": ", **missed**"}.get(self.verdict, "")
        return f"{as_share(self.ratio)}{reach}{verdict}"


def as_share(ratio: float) -> str:
    """Return a ratio as ``1/12.3`` below a half, as a number otherwise."""
    return f"1/{1 / ratio:.3g}" if 0 < ratio <= 0.5 else f"{ratio:.2f}"


# -- measuring -------------------------------------------------------------------------------------


def measured(
    name: str, options: argparse.Namespace, rates: Rates, done: Callable[[str], object]
) -> dict[str, Any]:
    """Measure one volume, and model its floors; a volume that does not fit gives the reason."""
    runtime = get_runtime(options.device)
    try:
        dataset = find_dataset(name)
        require_allocation(runtime, dataset)
        volume = dataset.load(None)
        done(f"{name}: generation")
        function = dataset.transfer_function(volume, options.interpolation)
        renderers = Bench(runtime, volume, function, tuple(options.size), options.vtk)
    except (VDIError, MemoryError) as error:
        return {"refused": f"{type(error).__name__}: {error}"}
    model = Model(runtime, rates, volume, function, tuple(options.size), _EVERY)
    try:
        clock = clock_of(options, runtime)
        medium = DeviceVolume(runtime, volume, function, sample_distance=renderers.step)
        vdi, seconds = _generation(renderers, medium, options, clock)
        found: dict[str, Any] = {
            "dimensions": list(volume.dimensions),
            "supersegments": vdi.n_supersegments,
            "generation": seconds,
            "angles": [],
        }
        prepared = prepared_vdi(runtime, vdi)
        draw = VDIRenderer(runtime, vdi, tuple(options.size))
        for angle in ANGLES:
            done(f"{name}: {angle:g} degrees")
            camera = vdi.camera.azimuth(angle)
            frames = {**draw.frames(camera), **renderers.frames(camera)}
            steps = {n: frames[n] for n in (_OURS, _OUR_VOLUME, *_PEERS) if n in frames}
            clocks = {"clock": clock}
            taken = take_turns(steps, options.repeats, runtime=runtime, clocks=clocks)
            found["angles"].append(
                {
                    "angle": angle,
                    "seconds": {n: median(t) for n, t in taken.items()},
                    "device_seconds": {n: median(t, "device") for n, t in taken.items()},
                    "model": {
                        _OURS: model.frame(
                            vdi,
                            camera,
                            n_bytes=prepared.list_bytes,
                            skips=prepared.occupancy.worthwhile,
                        ),
                        _OUR_VOLUME: model.volume_frame(camera, renderers.voxel),
                        "around": model.floor(around_work(tuple(options.size), runtime)),
                    },
                }
            )
        found["model"] = _generation_model(model, runtime, vdi, renderers.step)
        found["left_out"] = dict(renderers.left_out)
        return found
    finally:
        renderers.close()


def _generation(
    bench: Bench, medium: DeviceVolume, options: argparse.Namespace, clock: Callable[[], float]
) -> tuple[VDI, dict[str, float | None]]:
    """Time generation and a volume raycast at the same step, neither stopping at opaque."""
    looks = RenderOptions(transmittance_cutoff=0)
    raycast_medium(medium, FrameRequest(bench.view, WARM_UP_SIZE, looks))
    frame = FrameRequest(bench.view, bench.size, looks)
    made, taken = bench.generate(
        bench.view,
        bench.size,
        options.generations,
        before={"render_volume": partial(raycast_medium, medium, frame)},
        clocks={"clock": clock},
        max_supersegments=options.max_supersegments,
        sample_distance=bench.step,
    )
    names = {"generation": "generate", "render_volume": "render_volume"}
    return made["exact"], {name: median(taken[one]) for name, one in names.items()}


def _generation_model(model: Model, runtime: Runtime, vdi: VDI, step: float) -> dict[str, Any]:
    """Return floors of generation and of a volume raycast at the same step."""
    stages = model.generation(vdi, vdi.camera, step)
    on_host = model.floor(hosted_work(vdi, runtime))
    return {
        "generation": {**stages, "on the host": on_host},
        "render_volume": model.volume_frame(vdi.camera, step, stops=False),
    }


# -- judging ---------------------------------------------------------------------------------------


def faster_peer(seconds: Mapping[str, float | None]) -> tuple[str, float] | None:
    """Return the faster of VTK's mappers, and its time; None without any."""
    peers = [(taken, name) for name in _PEERS if (taken := seconds.get(name))]
    if not peers:
        return None
    taken, name = min(peers)
    return name, taken


def frame_cell(row: Mapping[str, Any], reach: float | None) -> Cell:
    """Return a VDI frame over the faster of VTK's mappers, and why it misses the reach."""
    seconds, model = row["seconds"], row["model"]
    floor = [model[_OURS]["floor"], model["around"]["floor"]]
    counts = model[_OURS]["per ray"]
    visits = counts["occupied" if counts["skips"] else "lists"]
    detail = (
        f"{visits:.1f} lists and {counts['met']:.1f} supersegments a ray, "
        f"{counts['lanes in step']:.0%} of the lanes at work where blocks go list by list"
    )
    return _cell(seconds[_OURS], faster_peer(seconds), reach, floor, detail)


def volume_cell(row: Mapping[str, Any]) -> Cell:
    """Return render_volume over the faster of VTK's mappers."""
    seconds, model = row["seconds"], row["model"]
    floor = [model[_OUR_VOLUME]["floor"], model["around"]["floor"]]
    counts = model[_OUR_VOLUME]["per ray"]
    detail = (
        f"{counts['looked']:.0f} samples a ray, {counts['lanes busy']:.0%} of the lanes at work"
    )
    return _cell(seconds[_OUR_VOLUME], faster_peer(seconds), VOLUME_REACH, floor, detail)


def generation_cell(found: Mapping[str, Any]) -> Cell:
    """Return generation over render_volume at the same step."""
    seconds, model = found["generation"], found["model"]
    floor = [stage["floor"] for stage in model["generation"].values()]
    runs = model["generation"]["shorten"]["per ray"]
    detail = f"{runs['runs']:.0f} runs a ray become {runs['supersegments']:.1f} supersegments"
    base = ("render_volume", float(seconds["render_volume"]))
    return _cell(seconds["generation"], base, GENERATION_REACH, floor, detail)


def _cell(
    ours: float,
    base: tuple[str, float] | None,
    reach: float | None,
    floors: list[Mapping[str, Any]],
    detail: str,
) -> Cell:
    if base is None:
        return Cell(None, reach)
    ratio = ours / base[1]
    if reach is None or ratio <= reach:
        return Cell(ratio, reach)
    least = sum(floor["seconds"] for floor in floors)
    longest = max(floors, key=lambda floor: floor["seconds"])
    of_base = as_share(least / base[1])
    if least / base[1] > reach:
        reason = (
            f"out of reach: the floor alone is {of_base}, bound by {longest['bound']}; {detail}"
        )
    else:
        reason = (
            f"{ours / least:.1f} times its floor ({of_base}, bound by {longest['bound']}); {detail}"
        )
    return Cell(ratio, reach, reason)


def worst(cells: Mapping[str, Cell]) -> tuple[str, Cell]:
    """Return the volume of a group with the largest ratio; every volume has to reach it."""
    there = {name: cell for name, cell in cells.items() if cell.ratio is not None}
    if not there:
        return "", Cell(None, None)
    name = max(there, key=lambda n: there[n].ratio or 0.0)
    return name, there[name]


# -- the script ------------------------------------------------------------------------------------


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    runtime = get_runtime(options.device)
    rates = Rates.read_for(runtime, options.machine or options.out)
    target = results_file(f"interactive{'_quick' if options.quick else ''}", options)
    case = {
        "window_size": list(options.size),
        "max_supersegments": options.max_supersegments,
        "interpolation": options.interpolation,
        "repeats": options.repeats,
        "clock": options.clock,
        "system": describe_system(options.device),
    }
    results = begun(target, case)
    groups = chosen(options)
    results["groups"] = {group: [label_of(n) for n in names] for group, names in groups.items()}
    names = [name for members in groups.values() for name in members]
    missing = [n for n in names if options.redo or label_of(n) not in results["volumes"]]
    bar = tqdm(total=len(missing) * (1 + len(ANGLES)), disable=not sys.stderr.isatty())

    def done(doing: str) -> None:
        bar.set_description(doing)
        bar.update()

    for name in missing:
        bar.set_description(f"{name}: loading")
        results["volumes"][label_of(name)] = measured(name, options, rates, done)
        save(results, target)
    bar.close()
    save(results, target)
    scaling = options.out / "scaling.json"
    text = report(results, json.loads(scaling.read_text()) if scaling.exists() else None)
    write_text(target.with_suffix(".md"), text)
    print(text)
    print(f"Written: {target}, and .md beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="timed frames of each candidate and view")
    add_size(parser)
    parser.add_argument(
        "--volumes", nargs="+", metavar="NAME", help="only these of the groups' volumes"
    )
    add_looks(parser, tf=None)
    parser.add_argument("--generations", type=int, default=3, help="timed generations of each VDI")
    parser.add_argument("--quick", action="store_true", help="one volume a group, two repeats")
    parser.add_argument("--no-vtk", dest="vtk", action="store_false", help="leave VTK out")
    parser.add_argument("--machine", type=Path, metavar="FOLDER", help="of machine.py's results")
    add_clock(parser)
    add_redo(parser)
    options = parser.parse_args()
    if options.quick:
        options.repeats = options.generations = 2
    names = [n for members in _groups(options).values() for n in members]
    unknown = [name for name in options.volumes or () if name not in names]
    if unknown:
        parser.error(f"--volumes: {', '.join(unknown)} not among {', '.join(names)}")
    return options


def chosen(options: argparse.Namespace) -> dict[str, list[str]]:
    """Return the volumes to be measured, by group."""
    wanted = options.volumes
    return {
        group: [name for name in names if wanted is None or name in wanted]
        for group, names in _groups(options).items()
    }


def _groups(options: argparse.Namespace) -> dict[str, tuple[str, ...]]:
    return QUICK_GROUPS if options.quick else GROUPS


def report(results: Mapping[str, Any], scaling: Mapping[str, Any] | None) -> str:
    """Return the reaches' tables, the volumes', and why what is missed is missed."""
    width, height = results["window_size"]
    cells = frame_cells(results)
    case = f"N_S {results['max_supersegments']}, {results['interpolation']}"
    if results["clock"] == "cpu":
        case += ", by CPU time over cores"
    lines = [
        f"# Against VTK, {width}x{height}, {case}",
        "",
        f"{LEGEND} A group's cell is its worst volume's.",
        "",
        *table(("VDI frame / VTK", *results["groups"]), _group_rows(cells)),
        "",
        *table(("what", "worst", "volume"), _second_rows(results)),
        "",
    ]
    if scaling is not None:
        lines += [*table(("cores", *QUANTITIES), core_rows(scaling)), ""]
    lines += ["## By volume", "", *table(_HEADS, _volume_rows(results, cells)), ""]
    for title, found in (
        ("Missed, and why", _reasons(results, cells)),
        ("Left out", _left_out(results)),
    ):
        if reasons := list(found):
            lines += [f"## {title}", "", *reasons, ""]
    return "\n".join([*lines, system_line(results["system"]), ""])


_HEADS = (
    "volume",
    "faster mapper",
    "its ms",
    *(f"VDI at {angle:g}°" for angle in ANGLES),
    "generation / render_volume",
    "render_volume / VTK",
)


def frame_cells(results: Mapping[str, Any]) -> dict[str, dict[float, dict[str, Cell]]]:
    """Return the cells of VDI frames: by group, angle and volume."""
    return {
        group: {
            angle: {
                name: frame_cell(row, REACHES[group][angle])
                for name, found in _measured_of(results, names)
                for row in found["angles"]
                if row["angle"] == angle
            }
            for angle in ANGLES
        }
        for group, names in results["groups"].items()
    }


def _measured_of(
    results: Mapping[str, Any], names: list[str]
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name in names:
        found = results["volumes"].get(name)
        if found is not None and "refused" not in found:
            yield name, found


def _all_measured(results: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    return list(_measured_of(results, [n for names in results["groups"].values() for n in names]))


def _group_rows(cells: Mapping[str, Mapping[float, Mapping[str, Cell]]]) -> Iterator[list[str]]:
    for angle in ANGLES:
        row = [f"at {angle:g}°" if angle else "at V_O"]
        for group in cells:
            name, cell = worst(cells[group][angle])
            row.append(f"{cell}, {name}" if name else "-")
        yield row


def _second_rows(results: Mapping[str, Any]) -> Iterator[list[str]]:
    volumes = _all_measured(results)
    name, cell = worst({n: generation_cell(found) for n, found in volumes})
    yield ["generation / render_volume, same step, neither stops at opaque", str(cell), name]
    name, cell = worst({n: volume_cell(found["angles"][0]) for n, found in volumes})
    yield ["render_volume / VTK at V_O", str(cell), name]


def _volume_rows(
    results: Mapping[str, Any], cells: Mapping[str, Mapping[float, Mapping[str, Cell]]]
) -> Iterator[list[str]]:
    for group, names in results["groups"].items():
        for name in names:
            found = results["volumes"].get(name)
            if found is None:
                continue
            if "refused" in found:
                yield [name, found["refused"], *("-" for _ in _HEADS[2:])]
                continue
            peer = faster_peer(found["angles"][0]["seconds"])
            yield [
                name,
                "-" if peer is None else CANDIDATES[peer[0]],
                "-" if peer is None else f"{1e3 * peer[1]:.0f}",
                *(str(cells[group][angle][name]) for angle in ANGLES),
                str(generation_cell(found)),
                str(volume_cell(found["angles"][0])),
            ]


def _reasons(
    results: Mapping[str, Any], cells: Mapping[str, Mapping[float, Mapping[str, Cell]]]
) -> Iterator[str]:
    for by_angle in cells.values():
        for angle, by_name in by_angle.items():
            for name, cell in by_name.items():
                if cell.reason:
                    yield f"- {name}, VDI at {angle:g} degrees: {cell.reason}"
    for name, found in _all_measured(results):
        for what, cell in (
            ("generation", generation_cell(found)),
            ("render_volume", volume_cell(found["angles"][0])),
        ):
            if cell.reason:
                yield f"- {name}, {what}: {cell.reason}"


def _left_out(results: Mapping[str, Any]) -> Iterator[str]:
    """Yield which of VTK's mappers could not draw a volume: the other one was the faster."""
    for name, found in _all_measured(results):
        for peer, reason in found["left_out"].items():
            yield f"- {CANDIDATES[peer]} with {name}: {reason}"


if __name__ == "__main__":
    sys.exit(main())
