"""Wrong lines of kernels, of Python and of the viewer's JavaScript, for `tools/mutants.py`."""

from __future__ import annotations

from dataclasses import dataclass

#: Rooms whose tests are run for kernels of a folder.
ROOMS = {
    "lib": ("raycasting", "generation"),
    "generation": ("generation",),
    "volume": ("volume", "generation"),
    "raycasting": ("raycasting", "model"),
    "multi_vdi": ("raycasting",),
    "large": ("extensions/large",),
    "cpu16": ("generation", "volume", "raycasting"),
}


@dataclass(frozen=True)
class Mutant:
    """A piece of a file that occurs once in it, and what stands there instead."""

    name: str
    file: str  # in the checkout
    old: str
    new: str
    rooms: tuple[str, ...]  # of tests/, that must notice

    def changed(self, text: str) -> str:
        """Return the file's text with the mutation; ValueError if it does not occur once."""
        if text.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.file} has {text.count(self.old)} of {self.old!r}")
        return text.replace(self.old, self.new)


def _m(name: str, file: str, old: str, new: str, rooms: tuple[str, ...] = ()) -> Mutant:
    return Mutant(name, file, old, new, rooms or ROOMS[file.split("/")[1]])


MARCH, MARCH_LISTS = "opencl/volume/march.cl", "opencl/cpu16/generation_march.cl"
RUNS, SHORTEN = "opencl/generation/runs.cl", "opencl/cpu16/generation_shorten.cl"
HOMOGENEITY = "opencl/generation/homogeneity.cl"
LISTS = "opencl/raycasting/first_supersegment.cl"
LARGE, OPTICAL_DEPTHS, LARGE_RUNS = (
    ("extensions/large",),
    "opencl/cpu16/generation_optical_depths.cl",
    "opencl/large/runs.cl",
)

KERNEL_MUTANTS = (
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
        "speed / view->unit_distance",
        "speed * view->unit_distance",
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
        "seen_weight(run, recording.hidden_weight);",
        "1.0f;",
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
        "errors) <= thresholds;",
        "errors) < thresholds;",
    ),
    _m(
        "shortening: of equal errors the last",
        SHORTEN,
        "const Int less = error < least;",
        "const Int less = error <= least;",
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
        "homogeneity: the threshold is not squared",
        HOMOGENEITY,
        "const float most = threshold * threshold;",
        "const float most = threshold;",
    ),
    _m(
        "packing: colours stay premultiplied",
        "opencl/generation/pack_lists.cl",
        "run.COLOR / run.OPACITY",
        "run.COLOR",
    ),
    _m(
        "packing: opacity for optical depth",
        "opencl/generation/pack_lists.cl",
        "optical_depths[begin + k] = run.TAU;",
        "optical_depths[begin + k] = run.OPACITY;",
    ),
    _m(
        "offsets: a list's own length counts before it",
        "opencl/generation/offsets.cl",
        "return sums[item] - value;",
        "return sums[item];",
    ),
    _m(
        "offsets: the block's own sum counts before it",
        "opencl/generation/offsets.cl",
        "block < item / items",
        "block <= item / items",
    ),
    _m(
        "ambient occlusion: wrong weight along z",
        "opencl/volume/ambient_occlusion.cl",
        "shares[3 * k + 2]",
        "shares[3 * k + 1]",
    ),
    _m(
        "bricks: no margin",
        "opencl/volume/bricks.cl",
        "<< bricks.shift) - bricks.margin;",
        "<< bricks.shift);",
    ),
    _m(
        "render_volume: opacity multiplier is added",
        "opencl/cpu16/volume_render.cl",
        "step.w *= opacity_multiplier;",
        "step.w += opacity_multiplier;",
    ),
    _m(
        "cropping: a wrong region",
        "opencl/lib/cropping.cl",
        "region = 3 * region +",
        "region = 2 * region +",
    ),
    _m(
        "compositing: what is in front does not hide",
        "opencl/lib/compositing.cl",
        "const Real weight = seen->sums.w * opacity_of(",
        "const Real weight = opacity_of(",
    ),
    _m(
        "compositing: green by red",
        "opencl/lib/compositing.cl",
        "seen->compensation.y, weight * color.y);",
        "seen->compensation.y, weight * color.x);",
    ),
    _m(
        "list search: the guess before is one too far",
        LISTS,
        "search->low = passed ? p + 1 :",
        "search->low = passed ? p + 2 :",
    ),
    _m(
        "list search: halves forget what lies behind",
        LISTS,
        "search->high = beyond ? p - 1 :",
        "search->high = beyond ? p - 2 :",
    ),
    _m(
        "list ray: enters at the far face",
        "opencl/raycasting/stepping.cl",
        "(near - sense->deep) * sense->inverse",
        "(far - sense->deep) * sense->inverse",
    ),
    _m(
        "list ray: not clipped where it leaves the list",
        "opencl/raycasting/stepping.cl",
        "LOWER_OF(HIGHER_OF(r_leaves, *from), r_next)",
        "HIGHER_OF(r_leaves, *from)",
    ),
    _m(
        "list ray: length by one end's depth",
        "opencl/raycasting/lengths.cl",
        " * reciprocal_depth_at(ray, to));",
        " * reciprocal_depth_at(ray, from));",
    ),
    _m(
        "stepping: v before u",
        "opencl/raycasting/walk.cl",
        "const bool in_u = crossing->r_u <= crossing->r_v;",
        "const bool in_u = crossing->r_u >= crossing->r_v;",
    ),
    _m(
        "blocks: a supersegment is left too early",
        "opencl/cpu16/walk.cl",
        "crossing->meets && crossing->face.far <= crossing->next_depth;",
        "crossing->meets && crossing->face.far > crossing->next_depth;",
    ),
    _m(
        "occupancy: less than the faces",
        "opencl/raycasting/occupancy.cl",
        "slab_of(front - grid->margin,",
        "slab_of(front + 64 * grid->margin,",
    ),
    _m(
        "occupancy: supersegments end a slab too early",
        "opencl/raycasting/occupancy.cl",
        "atomic_dec(cells + last + 1);",
        "atomic_dec(cells + last);",
    ),
    _m(
        "skipping: a face too far",
        "opencl/raycasting/stepping.cl",
        "TO_REAL(sense->away ? nearest : nearest + 1)",
        "TO_REAL(sense->away ? nearest + 1 : nearest)",
    ),
    _m(
        "preview: samples at the ends of their parts",
        "opencl/raycasting/preview.cl",
        "if (halves & 1) {",
        "if (!(halves & 1)) {",
    ),
    _m(
        "preview: weights without counts",
        "opencl/raycasting/preview.cl",
        "const float half_part = weight / (2.0f * (float)samples);",
        "const float half_part = weight / (float)samples;",
    ),
    _m(
        "packets: a ray's list is left by the other axis",
        "opencl/cpu16/packets.cl",
        "const Int steps_p = here && r_p <= r_q;",
        "const Int steps_p = here && r_p >= r_q;",
    ),
    _m(
        "packets: what waits is forgotten at the end",
        "opencl/cpu16/packets.cl",
        "met.waits = met.waits || meet;",
        "met.waits = meet;",
    ),
    _m(
        "aligned view: not clipped where the ray begins",
        "opencl/cpu16/aligned_view.cl",
        "HIGHER_OF(at.front, begin)",
        "at.front",
    ),
    _m(
        "aligned view: a supersegment less",
        "opencl/cpu16/aligned_view.cl",
        "going && k < lists.count &&",
        "going && k + 1 < lists.count &&",
    ),
    _m(
        "packed supersegments: red for blue",
        "opencl/raycasting/supersegments.cl",
        "(float)(high >> 16 & 255)",
        "(float)(high >> 8 & 255)",
    ),
    _m(
        "prepare: thickness in view depth, not along the ray",
        "opencl/raycasting/prepare.cl",
        "(back - front) * per_depth",
        "(back - front)",
    ),
    _m(
        "multi_vdi: the last medium's optical depth only",
        "opencl/multi_vdi/merge.cl",
        "optical_depth += part;",
        "optical_depth = part;",
    ),
    _m(
        "multi_vdi: owned by the last that covers",
        "opencl/cpu16/merge.cl",
        "meets > grades",
        "meets >= grades",
    ),
    _m(
        "packed lists: the scale lacks the stride",
        "opencl/raycasting/prepare_packed.cl",
        "length(direction) * (float)stride * step",
        "length(direction) * step",
    ),
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
        "hidden_weight) <= recording.finest)",
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
        "WHILE((end > begin) & behind_part(march, of, end - 1), end -= COUNT(moves))",
        "",
        LARGE,
    ),
    _m(
        "large: macrocells are the whole grid's",
        MARCH,
        "TO_REAL(((n) << MACROCELL_SHIFT) + (GRID_PART ? of->part_first.axis : 0))",
        "TO_REAL((n) << MACROCELL_SHIFT)",
        LARGE,
    ),
    _m(
        "large: occlusion by samples in a neighbour's cells",
        "opencl/volume/ambient_occlusion.cl",
        "(position) < classified.part_upper.axis))",
        "true))",
        LARGE,
    ),
    _m(
        "large: occlusion by the part's first nodes",
        "opencl/volume/ambient_occlusion.cl",
        "(node + first_node.xyz) * cell.xyz",
        "node * cell.xyz",
        LARGE,
    ),
)

OPTIONS, RENDER = "pyvista_vdi/model/options.py", "pyvista_vdi/model/render_options.py"
SCENE, CHOOSE = "pyvista_vdi/raycasting/scene.py", "pyvista_vdi/raycasting/choose.py"
PICTURES = "pyvista_vdi/quality/pictures.py"
PACKING = "pyvista_vdi/model/packing.py"
DECIDE = "pyvista_vdi/quality/decide.py"
WHEN, WAYS = "pyvista_vdi/quality/regeneration_policy.py", "pyvista_vdi/quality/render_mode.py"
SET, SHOWN = (
    "pyvista_vdi/extensions/sets/vdi_set.py",
    "pyvista_vdi/extensions/sets/shown.py",
)
VIEWER = "pyvista_vdi/extensions/web/viewer/"
PLAYER, SERIES = (
    "pyvista_vdi/extensions/series/player.py",
    "pyvista_vdi/extensions/series/series.py",
)

PYTHON_MUTANTS = (
    _m(
        "options: what V_O cannot see weighs the cosine of the view cone",
        OPTIONS,
        "float(1 - np.cos(np.radians(self.view_cone)))",
        "float(np.cos(np.radians(self.view_cone)))",
        ("model", "generation"),
    ),
    _m(
        "options: a view cone of 180 degrees is accepted",
        OPTIONS,
        "if not 0 <= angle <= 90:",
        "if not 0 <= angle <= 180:",
        ("model", "api", "generation"),
    ),
    _m(
        "options: the tolerance is dropped",
        OPTIONS,
        "return difference",
        "return 0.0",
        ("model", "generation"),
    ),
    _m(
        "options: changes of given options are lost",
        OPTIONS,
        "return replace(options, **changes) if changes else options",
        "return options",
        ("model", "api", "generation", "plotting"),
    ),
    _m(
        "options: a preview of no samples is accepted",
        RENDER,
        "if not 1 <= number <= MAX_PREVIEW_SAMPLES:",
        "if not 0 <= number <= MAX_PREVIEW_SAMPLES:",
        ("model", "api", "raycasting"),
    ),
    _m(
        "options: clipping planes may have no direction",
        RENDER,
        "if not table[:, 3:].any(axis=1).all():",
        "if False:",
        ("model", "api", "raycasting"),
    ),
    _m(
        "variant: the aligned view's kernel draws what is cropped",
        CHOOSE,
        "if uncropped and scene.aligned is not None:",
        "if in_vectors and scene.aligned is not None:",
        ("raycasting",),
    ),
    _m(
        "variant: vectors of 8 floats are taken for long",
        SCENE,
        "vector_floats >= 16",
        "vector_floats >= 8",
        ("raycasting",),
    ),
    _m(
        "lists in vectors: the scale of codes is read from the word before",
        "opencl/cpu16/lists.cl",
        "list->first - 1, asks",
        "list->first - 2, asks",
        ("model",),
    ),
    _m(
        "variant: every view is taken for V_O's",
        SCENE,
        "return same and not self.segments",
        "return not self.segments",
        ("raycasting",),
    ),
    _m(
        "variant: previews are drawn ray by ray in full",
        CHOOSE,
        "if options.preview_samples is not None:",
        "if False:",
        ("raycasting",),
    ),
    _m(
        "variant: segments end at a transmittance, not at its optical depth",
        SCENE,
        "cutoff=-math.log(cutoff) if self.segments else cutoff,",
        "cutoff=cutoff,",
        ("raycasting",),
    ),
    _m(
        "packing: optical depths are rounded down",
        PACKING,
        "upper = (bits + 0x7FFF + (bits >> 16 & 1)) >> 16",
        "upper = bits >> 16",
        ("model", "raycasting"),
    ),
    _m(
        "packing: faces that rounding made equal stay equal",
        PACKING,
        "codes = np.minimum(running, most[:, np.newaxis]) + needed",
        "codes = np.maximum(codes, 0)",
        ("model", "raycasting"),
    ),
    _m(
        "packing: green has as few steps as blue",
        PACKING,
        "_COLOR_16 = ((2047, 0), (2047, 11), (1023, 22))",
        "_COLOR_16 = ((2047, 0), (1023, 11), (1023, 22))",
        ("model", "raycasting"),
    ),
    _m(
        "packing: what is in front of the eye may end up behind it",
        PACKING,
        "np.maximum(faces, np.ceil(max(-vdi.depth_origin / step, -(2.0**30))), out=faces)",
        "pass",
        ("model", "raycasting"),
    ),
    _m(
        "packing: a code is too few steps long",
        PACKING,
        "stride = np.maximum(1, np.ceil(span / DEPTH_CODES))",
        "stride = np.maximum(1, np.floor(span / DEPTH_CODES))",
        ("model", "raycasting"),
    ),
    _m(
        "decision: what changes while a VDI is made is not noticed",
        DECIDE,
        "begun = making is not None and making.content == wanted.content",
        "begun = making is not None",
        ("quality",),
    ),
    _m(
        "decision: a VDI of a view that was left is kept in the making",
        DECIDE,
        "if away > OUT_OF_DATE or away > _apart(state, seen, seen.request.screen):",
        "if False:",
        ("quality",),
    ),
    _m(
        "decision: what has failed is tried again and again",
        DECIDE,
        "failed = state.failed is not None and state.failed == state.stamp",
        "failed = False",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: a VDI that comes after the window was closed is taken",
        DECIDE,
        "if state.making is None:  # nobody waits for it any more",
        "if False:",
        ("quality",),
    ),
    _m(
        "decision: a second estimate is begun before the first is there",
        DECIDE,
        "if state.making is not None or state.estimating or failed:",
        "if state.making is not None or failed:",
        ("quality",),
    ),
    _m(
        "decision: the VDI is drawn although it shows what is no longer so",
        DECIDE,
        "if making is not None and changed(state, seen) and _drawable(state, f, making):",
        "if False:",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: what the device cannot draw is asked for again and again",
        DECIDE,
        "return state.refused is None or bool(state.refused != of.content)",
        "return True",
        ("quality",),
    ),
    _m(
        "decision: a change that was taken back is made all the same",
        DECIDE,
        'return replace(state, making=None), (Do("drop vdi"),)  # it was changed back',
        "return state, ()",
        ("quality",),
    ),
    _m(
        "decision: a view is estimated before it rests",
        DECIDE,
        "return not state.moving and now - state.moved_at >= _SETTLED",
        "return not state.moving",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: both eyes of a frame are looked at",
        DECIDE,
        "f = replace(f, look=f.whole and f.number != state.number)",
        "f = replace(f, look=f.whole)",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: off-screen a film makes no VDI",
        DECIDE,
        "if deserves_vdi(state.pictures, f.view, wanted.volume.bounds):",
        "if False:",
        ("quality", "plotting"),
    ),
    _m(
        "decision: a volume beside another is drawn by itself",
        DECIDE,
        'if settings.draw == "volume" and not f.joint:',
        'if settings.draw == "volume":',
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: an estimate that nobody waits for any more is taken",
        DECIDE,
        "if not state.estimating:",
        "if False:",
        ("quality",),
    ),
    _m(
        "decision: views that move are estimated in every frame",
        DECIDE,
        "ESTIMATE_PERIOD_IN_MOTION = 0.5",
        "ESTIMATE_PERIOD_IN_MOTION = 0.0",
        ("quality",),
    ),
    _m(
        "decision: nobody looks whether a view has come to rest",
        DECIDE,
        "return state.making is not None or state.estimating or settles",
        "return state.making is not None or state.estimating",
        ("quality",),
    ),
    _m(
        "decision: a stored VDI that has failed is read in every frame",
        DECIDE,
        "failed = asked.stamp is not None and asked.stamp == state.failed_in_frame",
        "failed = False",
        ("quality",),
    ),
    _m(
        "decision: a pick of what the VDI has is answered by another",
        DECIDE,
        "return state, () if coverage == 1 else",
        "return state, () if coverage > 1 else",
        ("quality",),
    ),
    _m(
        "decision: a VDI that is there is made again when it is asked for",
        DECIDE,
        'if there and (state.settings.draw != "auto" or state.behind):',
        "if False:",
        ("quality",),
    ),
    _m(
        "decision: what was known of another input is kept",
        DECIDE,
        "        if another:\n",
        "        if False:\n",
        ("quality",),
    ),
    _m(
        "decision: a VDI without its volume is shown from anywhere without a word",
        DECIDE,
        "if seen.angle > of.cone:",
        "if False:",
        ("quality",),
    ),
    _m(
        "regeneration: patience is for views at rest",
        WHEN,
        "(_PATIENCE_IN_MOTION if moving else 1)",
        "(1 if moving else _PATIENCE_IN_MOTION)",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "regeneration: a view at rest is estimated as rarely as one that moves",
        WHEN,
        "(_ANOTHER_ESTIMATE_IN_MOTION if moving else _ANOTHER_ESTIMATE)",
        "_ANOTHER_ESTIMATE_IN_MOTION",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: a changed volume gets a VDI of the old view",
        DECIDE,
        'None if state.settings.regenerate == "never" else f.view',
        "None",
        ("quality", "vtk_pipeline"),
    ),
    _m(
        "decision: windows of one source are not told apart",
        "pyvista_vdi/vtk_pipeline/drawing/deciding.py",
        "one_view = len(self.renderers()) == 1 and source.alone",
        "one_view = source.alone",
        ("vtk_pipeline",),
    ),
    _m(
        "view selection: few lists stay as long as they came",
        "pyvista_vdi/quality/pace.py",
        '(_FEW_ABOVE if frame.cost == "few lists" else _FEW_BELOW)',
        "_FEW_BELOW",
        ("vtk_pipeline",),
    ),
    _m(
        "options: what a VDI refuses of add_volume's is dropped",
        "pyvista_vdi/plotting/adding.py",
        "changed = {*self.array.given, *given, *self.options.given, *target, *self.deferral.given}",
        "changed = set()",
        ("plotting",),
    ),
    _m(
        "options: a preset of quality is regenerated before it is missed",
        "pyvista_vdi/plotting/adding.py",
        "below = min(given, max(0.0, goal - _BELOW_GOAL))",
        "pass",
        ("plotting",),
    ),
    _m(
        "view selection: what the VDI loses counts nothing",
        WAYS,
        'losses["vdi"] += own',
        "pass",
        ("quality",),
    ),
    _m(
        "view selection: at rest the VDI is drawn however poor",
        WAYS,
        "if seconds is None and own > 1 - bound:",
        "if False:",
        ("quality",),
    ),
    _m(
        "view selection: a set's views come in abruptly",
        SET,
        "reach = min(self._blend, beyond[-1]) if len(order) > MOST_BLENDED else self._blend",
        "reach = self._blend",
        ("extensions/sets",),
    ),
    _m(
        "view selection: the view before stays the nearest",
        SHOWN,
        "self._weights = self.collection.weights(camera)",
        "pass",
        ("extensions/sets", "vtk_pipeline", "plotting"),
    ),
    _m(
        "series: steps that were left out are not counted",
        PLAYER,
        "self.dropped += max(0, place - self._place - 1)",
        "self.dropped += 0",
        ("extensions/series",),
    ),
    _m(
        "series: what was played to its end does not begin anew",
        PLAYER,
        "self._begin(0 if not loop and self.step == last else self.step)",
        "self._begin(self.step)",
        ("extensions/series",),
    ),
    _m(
        "series: a second writer is not refused",
        "pyvista_vdi/extensions/series/writer.py",
        "fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)",
        "pass",
        ("extensions/series",),
    ),
    _m(
        "series: the nearest time is the one after",
        SERIES,
        "return min(candidates, key=lambda i: abs(self.times[i] - time))",
        "return candidates[-1]",
        ("extensions/series",),
    ),
    _m(
        "pictures: a VDI of which the view shows more than it has",
        PICTURES,
        " or seen.coverage < 1:",
        ":",
        ("quality",),
    ),
    _m(
        "pictures: contrast does not count",
        PICTURES,
        "does = does and abs(error.contrast - 1) <= _SAME_CONTRAST",
        "pass",
        ("quality",),
    ),
    _m(
        "pictures: an estimate holds whatever else changed",
        PICTURES,
        "if each.options == seen.options",
        "if True",
        ("quality",),
    ),
    _m(
        "pictures: lists as coarse as one likes",
        PICTURES,
        "if bound is None and seen.magnification > FINE_ENOUGH:",
        "if False:",
        ("quality",),
    ),
    _m(
        "pictures: what failed is asked about again",
        PICTURES,
        "poor_from=seen.angle, in_vain=in_vain",
        "in_vain=in_vain",
        ("quality",),
    ),
    _m(
        "pictures: pictures from anywhere make a VDI worth while",
        PICTURES,
        "view.distance(other, bounds) <= _NEAR",
        "view.distance(other, bounds) >= 0",
        ("quality",),
    ),
    _m(
        "viewer: zooming in takes one away",
        VIEWER + "camera.js",
        "from, 1 / factor)",
        "from, factor)",
        ("extensions/web",),
    ),
    _m(
        "viewer: pinching apart takes one away",
        VIEWER + "interaction.js",
        "nearer(rolled(camera, turn), pinch)",
        "nearer(rolled(camera, turn), 1 / pinch)",
        ("extensions/web",),
    ),
    _m(
        "viewer: the step farthest in time is shown",
        VIEWER + "series.js",
        "far.indexOf(Math.min(...far))",
        "far.indexOf(Math.max(...far))",
        ("extensions/web",),
    ),
    _m(
        "viewer: what was played to its end does not begin anew",
        VIEWER + "player.js",
        "if (!loop && this.#place === n - 1) this.#moveTo(0);",
        "",
        ("extensions/web",),
    ),
    _m(
        "viewer: a served picture waits for its drawing for ever",
        VIEWER + "remote.js",
        "await Promise.race([this.viewer.showBytes(file), drawn])",
        "await this.viewer.showBytes(file)",
        ("extensions/web",),
    ),
    _m(
        "viewer: damaged bytes are shown",
        VIEWER + "decode.js",
        "if (crc32(bytes) !== crc) damaged",
        "if (false) damaged",
        ("extensions/web",),
    ),
)

MUTANTS = KERNEL_MUTANTS + PYTHON_MUTANTS
