"""Which wrong kernels the tests of a tier notice: each mutant is one changed line of one kernel.

    python tools/mutants.py                          # -m fast
    python tools/mutants.py --tier default --only march --only merge
    python tools/mutants.py --tier device --device portable

Each mutant is made in a copy of the checkout, which the tests of the rooms concerned import in
place of the installed package. It counts as killed if they fail, and only where they pass on the
unchanged copy. Needs an environment in which the tests run; the status is 0 whatever survives.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]

#: How pytest is asked for the tests of each tier.
TIERS = {"fast": "fast", "default": "not slow and not paraview", "device": "device"}

#: Rooms whose tests are run for kernels of a folder.
ROOMS = {
    "lib": ("raycasting", "generation"),
    "generation": ("generation",),
    "volume": ("volume", "generation"),
    "raycasting": ("raycasting", "model"),
    "multi_vdi": ("raycasting",),
    "series": ("series",),
    "large": ("large",),
}


@dataclass(frozen=True)
class Mutant:
    """A piece of a kernel that occurs once in its file, and what stands there instead."""

    name: str
    file: str  # below opencl/
    old: str
    new: str
    rooms: tuple[str, ...] | None = None  # if not those of the kernel's folder

    def changed(self, text: str) -> str:
        """Return the kernel's text with the mutation; ValueError if it does not occur once."""
        if text.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.file} has {text.count(self.old)} of {self.old!r}")
        return text.replace(self.old, self.new)


def _m(name: str, file: str, old: str, new: str, rooms: tuple[str, ...] | None = None) -> Mutant:
    return Mutant(name, file, old, new, rooms)


MARCH, MARCH_LISTS = "volume/march.cl", "generation/march_lists.cl"
RUNS, SHORTEN = "generation/runs.cl", "generation/shorten_lists.cl"
CRITERIA = "generation/criteria.cl"
LISTS, RAYS = "raycasting/lists.cl", "raycasting/list_rays.cl"
DECODE = "series/decode.cl"
LARGE, OPTICAL_DEPTHS, LARGE_RUNS = ("large",), "large/optical_depths.cl", "large/runs.cl"

MUTANTS = (
    _m(
        "march: the last step is as long as the others",
        MARCH,
        "fmin(fma(TO_REAL(k), march->step, march->t0), march->t1)",
        "fma(TO_REAL(k), march->step, march->t0)",
    ),
    _m("march: one step less", MARCH, "TO_INT(ceil(", "TO_INT(floor("),
    _m(
        "march: opacity unit distance multiplies",
        MARCH,
        "speed / unit_distance",
        "speed * unit_distance",
    ),
    _m("skipping: two steps too far", MARCH, "march->per_step - 0.51f", "march->per_step + 1.49f"),
    _m(
        "march: a gap does not end a run",
        MARCH_LISTS,
        "visible & (run_back == group_front) & (error",
        "visible & (error",
    ),
    _m(
        "march: errors are not weighted by what is seen",
        MARCH_LISTS,
        "square_of(difference) * seen_weight(run, hidden_weight)",
        "square_of(difference)",
    ),
    _m(
        "march: steps at a chunk's end stay ungrouped",
        MARCH_LISTS,
        "(left == 0) | (empty > 0) | (k >= end)",
        "(left == 0) | (empty > 0)",
    ),
    _m(
        "merge: optical depth of the second run only",
        RUNS,
        "run.TAU = a.TAU + b.TAU;",
        "run.TAU = b.TAU;",
    ),
    _m(
        "merge: green is added, not composited",
        RUNS,
        "a.GREEN + through * b.GREEN",
        "a.GREEN + b.GREEN",
    ),
    _m(
        "merge error: density does not saturate",
        RUNS,
        "run.TAU / (run.TAU + length)",
        "run.TAU / length",
    ),
    _m("merge error: opacity is no feature", RUNS, "(v.z * v.z + v.w * v.w)", "(v.z * v.z)"),
    _m(
        "merge error: gap's term divided by less",
        RUNS,
        "square_of(mean) / (both + gap)",
        "square_of(mean) / both",
    ),
    _m(
        "shortening: < for <= of a threshold",
        SHORTEN,
        "<= (Row)(thresholds)",
        "< (Row)(thresholds)",
    ),
    _m(
        "shortening: of equal errors the last",
        SHORTEN,
        "const RowPlaces less = error < least;",
        "const RowPlaces less = error <= least;",
    ),
    _m(
        "shortening: one run more than the limit",
        SHORTEN,
        "const Int chosen = alive > limit;",
        "const Int chosen = alive > limit + 1;",
    ),
    _m(
        "shortening: the error before is not renewed",
        SHORTEN,
        "if (earlier.each[lane] >= 0)",
        "if (earlier.each[lane] > 0)",
    ),
    _m(
        "criteria: shares for one more supersegment",
        CRITERIA,
        "at.y / (float)limit;",
        "at.y / (float)(limit + 1);",
    ),
    _m(
        "criteria: homogeneity's threshold is not squared",
        CRITERIA,
        "const float most = threshold * threshold;",
        "const float most = threshold;",
    ),
    _m(
        "packing: colours stay premultiplied",
        "generation/pack_lists.cl",
        "run.COLOR / run.OPACITY",
        "run.COLOR",
    ),
    _m(
        "packing: opacity for optical depth",
        "generation/pack_lists.cl",
        "optical_depths[begin + k] = run.TAU;",
        "optical_depths[begin + k] = run.OPACITY;",
    ),
    _m(
        "offsets: a list's own length counts before it",
        "generation/offsets.cl",
        "return sums[item] - value;",
        "return sums[item];",
    ),
    _m(
        "offsets: the block's own sum counts before it",
        "generation/offsets.cl",
        "block < item / items",
        "block <= item / items",
    ),
    _m(
        "ambient occlusion: wrong weight along z",
        "volume/ambient_occlusion.cl",
        "shares[3 * k + 2]",
        "shares[3 * k + 1]",
    ),
    _m(
        "bricks: no margin",
        "volume/bricks.cl",
        "<< BRICK_SHIFT) - BRICK_MARGIN;",
        "<< BRICK_SHIFT);",
    ),
    _m(
        "render_volume: opacity multiplier is added",
        "volume/render_volume.cl",
        "step.w *= opacity_multiplier;",
        "step.w += opacity_multiplier;",
    ),
    _m(
        "cropping: a wrong region",
        "lib/cropping.cl",
        "region = 3 * region +",
        "region = 2 * region +",
    ),
    _m(
        "compositing: what is in front does not hide",
        "lib/compositing.cl",
        "SELECT((Real)(0.0f), seen->sums.w * ",
        "SELECT((Real)(0.0f), 1.0f * ",
    ),
    _m(
        "compositing: green by red",
        "lib/compositing.cl",
        "ADD_TO_SUM(y, weight * color.y)",
        "ADD_TO_SUM(y, weight * color.x)",
    ),
    _m(
        "list search: the guess before is one too far",
        LISTS,
        "search->beyond), search->n + 1, onwards)",
        "search->beyond), search->n + 2, onwards)",
    ),
    _m(
        "list search: halves forget what lies behind",
        LISTS,
        "SELECT(search->high, search->n - 1,",
        "SELECT(search->high, search->n - 2,",
    ),
    _m(
        "list ray: enters at the far face",
        RAYS,
        "(near - sense->deep) * sense->inverse",
        "(far - sense->deep) * sense->inverse",
    ),
    _m(
        "list ray: not clipped where it leaves the list",
        RAYS,
        "LOWER_OF(HIGHER_OF(r_leaves, *from), r_next)",
        "HIGHER_OF(r_leaves, *from)",
    ),
    _m(
        "list ray: length by one end's depth",
        RAYS,
        " * reciprocal_depth_at(rays, to, depths));",
        " * reciprocal_depth_at(rays, from, depths));",
    ),
    _m(
        "stepping: v before u",
        "raycasting/raycast.cl",
        "const Int in_u = r_u <= r_v;",
        "const Int in_u = r_u >= r_v;",
    ),
    _m(
        "blocks: a supersegment is left too early",
        "raycasting/raycast.cl",
        "stays = meets && face.far <= next_depth;",
        "stays = meets && face.far > next_depth;",
    ),
    _m(
        "occupancy: less than the faces",
        "raycasting/occupancy.cl",
        "slab_of(front - margin,",
        "slab_of(front + 64 * margin,",
    ),
    _m(
        "occupancy: supersegments end a slab too early",
        "raycasting/occupancy.cl",
        "atomic_dec(cells + last + 1);",
        "atomic_dec(cells + last);",
    ),
    _m(
        "skipping: a face too far",
        "raycasting/stepping.cl",
        "TO_REAL(sense->away ? nearest : nearest + 1)",
        "TO_REAL(sense->away ? nearest + 1 : nearest)",
    ),
    _m(
        "preview: samples at the ends of their parts",
        "raycasting/preview.cl",
        "if (halves & 1) {",
        "if (!(halves & 1)) {",
    ),
    _m(
        "preview: weights without counts",
        "raycasting/preview.cl",
        "const float half_part = weight / (2.0f * (float)samples);",
        "const float half_part = weight / (float)samples;",
    ),
    _m(
        "packets: a ray's list is left by the other axis",
        "raycasting/packets.cl",
        "const Int steps_p = here && r_p <= r_q;",
        "const Int steps_p = here && r_p >= r_q;",
    ),
    _m(
        "packets: what waits is forgotten at the end",
        "raycasting/packets.cl",
        "met.waits = met.waits || meet;",
        "met.waits = meet;",
    ),
    _m(
        "aligned view: not clipped where the ray begins",
        "raycasting/aligned_view.cl",
        "HIGHER_OF(at.front, begin)",
        "at.front",
    ),
    _m(
        "aligned view: a supersegment less",
        "raycasting/aligned_view.cl",
        "going && k < lists.list.count &&",
        "going && k + 1 < lists.list.count &&",
    ),
    _m(
        "packed supersegments: red for blue",
        "raycasting/supersegments.cl",
        "LIST_TO_REAL(second >> 16 & 255)",
        "LIST_TO_REAL(second >> 8 & 255)",
    ),
    _m(
        "prepare: thickness in view depth, not along the ray",
        "raycasting/prepare.cl",
        "(back - front) * per_depth",
        "(back - front)",
    ),
    _m(
        "multi_vdi: the last medium's optical depth only",
        "multi_vdi/merge.cl",
        "optical_depth += part;",
        "optical_depth = part;",
    ),
    _m(
        "multi_vdi: owned by the last that covers",
        "multi_vdi/merge.cl",
        "meets > grades",
        "meets >= grades",
    ),
    _m(
        "packed lists: the scale lacks the stride",
        "raycasting/prepare_packed.cl",
        "length(direction) * (float)stride * step",
        "length(direction) * step",
    ),
    _m("series: lists have not moved", DECODE, "rounded(shift * moved_by, 1.0, &tame)", "0"),
    _m(
        "series: kept ones that are left over do not matter",
        DECODE,
        "tame = tame && !bit_at(kept_there, place[THERE_BIT] + old);",
        ";",
    ),
    _m("series: last faces are as the others", DECODE, "if (k == count - 1) {", "if (false) {"),
    _m("series: numbers are rounded down", DECODE, "rint(value / unit)", "floor(value / unit)"),
    _m("series: colours are the table's", DECODE, "if (same >= 0 && left == 0) {", "if (false) {"),
    _m(
        "large: a step that is sampled stands for itself alone",
        OPTICAL_DEPTHS,
        "of_step * (float)stride",
        "of_step",
    ),
    _m(
        "large: which steps are sampled depends on the block",
        OPTICAL_DEPTHS,
        "(march.begin + (stride - 1)) / stride * stride",
        "march.begin",
    ),
    _m("large: runs that touch are not joined", LARGE_RUNS, "run.FRONT == last.BACK", "false"),
    _m(
        "large: runs are joined whatever they look like",
        LARGE_RUNS,
        "hidden_weight) <= finest)",
        "hidden_weight) <= INFINITY)",
    ),
    _m(
        "large: each block begins with all the light",
        LARGE_RUNS,
        "transmittance = last.TRANSMITTANCE - last.TRANSMITTANCE * last.OPACITY;",
        "",
    ),
    _m("large: rows of a block are not its window's", LARGE_RUNS, "* window.z + x", "* window.z"),
    _m(
        "large: a step at a face belongs to two blocks",
        MARCH,
        "WHILE((end > begin) & behind_part(march, medium, end - 1), end -= COUNT(moves))",
        "",
        LARGE,
    ),
    _m(
        "large: macrocells are the whole grid's",
        MARCH,
        "TO_REAL(((n) << MACROCELL_SHIFT) + FIRST_OF_PART(axis))",
        "TO_REAL((n) << MACROCELL_SHIFT)",
        LARGE,
    ),
    _m(
        "large: occlusion by samples in a neighbour's cells",
        "volume/ambient_occlusion.cl",
        "(position) < part_upper.axis)",
        "true)",
        LARGE,
    ),
    _m(
        "large: occlusion by the part's first nodes",
        "volume/ambient_occlusion.cl",
        "(node + first_node.xyz) * cell.xyz",
        "node * cell.xyz",
        LARGE,
    ),
)


def make_copy(folder: Path, mutant: Mutant | None) -> dict[str, str]:
    """Lay the package, as it is installed, and its tests into a folder; return the environment."""
    shutil.copytree(CHECKOUT / "pyvista_vdi", folder / "site" / "pyvista_vdi", symlinks=True)
    shutil.copytree(CHECKOUT / "opencl", folder / "site" / "pyvista_vdi" / "opencl")
    for name in ("tests", "docs", "examples"):
        shutil.copytree(CHECKOUT / name, folder / name)
    shutil.copy(CHECKOUT / "pyproject.toml", folder)
    if mutant is not None:
        path = folder / "site" / "pyvista_vdi" / "opencl" / mutant.file
        path.write_text(mutant.changed(path.read_text()))
    return {**os.environ, "PYTHONPATH": str(folder / "site"), "PYTHONDONTWRITEBYTECODE": "1"}


def tests_fail(mutant: Mutant | None, rooms: tuple[str, ...], options: argparse.Namespace) -> bool:
    """Whether the tests of rooms, in a tier, fail with a mutant."""
    with tempfile.TemporaryDirectory() as name:
        environment = make_copy(Path(name), mutant)
        if options.device:
            environment["PYVISTA_VDI_TEST_DEVICES"] = options.device
        command = [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider"]
        command += ["-x"] if mutant is not None else []
        try:
            done = subprocess.run(
                [*command, "-m", TIERS[options.tier], *(f"tests/{room}" for room in rooms)],
                cwd=name,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=None if mutant is None else options.patience,
            )
        except subprocess.TimeoutExpired:  # a kernel that never ends
            return True
    if done.returncode > 1:  # interrupted, or not a test was run
        raise SystemExit(f"pytest ends with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr}")
    if mutant is None and done.returncode:
        print(done.stdout[-3000:])
    return done.returncode != 0  # a kernel that reads beyond its memory may crash: below 0


def main() -> None:
    """Run the tests on every mutant that was asked for, and print which survive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tier", choices=TIERS, default="fast")
    parser.add_argument("--device", help="parts of devices' names, as PYVISTA_VDI_TEST_DEVICES")
    parser.add_argument("--only", action="append", help="mutants with this in their name or file")
    parser.add_argument(
        "--patience", type=float, default=1800, help="seconds after which a mutant hangs: killed"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time")
    options = parser.parse_args()
    chosen = [
        mutant
        for mutant in MUTANTS
        if any(text in f"{mutant.name} {mutant.file}" for text in options.only or [""])
    ]
    rooms = {each: each.rooms or ROOMS[each.file.partition("/")[0]] for each in chosen}
    for each in sorted({room for of_mutant in rooms.values() for room in of_mutant}):
        if tests_fail(None, (each,), options):
            raise SystemExit(f"tests/{each} fails without a mutant: nothing can be said")

    def try_out(mutant: Mutant) -> bool:
        began = time.monotonic()
        killed = tests_fail(mutant, rooms[mutant], options)
        word = "killed" if killed else "LIVES"
        print(f"{word:8}{time.monotonic() - began:5.0f} s  {mutant.name}", flush=True)
        return killed

    with ThreadPoolExecutor(options.jobs) as pool:
        killed = list(pool.map(try_out, chosen))
    print(f"tier {options.tier}: {sum(killed)} of {len(killed)} killed; alive:")
    print("\n".join(f"  {m.name}" for m, dead in zip(chosen, killed, strict=True) if not dead))


if __name__ == "__main__":
    main()
