// The walk of a work-item's rays, one or a block of 4 x 4 (lib/lanes.cl), through the lists of a
// VDI (paper, sections 3 and 4), of which programs make a picture, segments or first hits:
// `follow`.
//
// Each turn makes a guess, meets a supersegment or leaves a list, or the last two: rays side by
// side need not wait for the one that searches longest or meets most (docs/decisions/rays.md,
// blocks.md).
//
// Who includes this says before what is Made of what rays cross; take_medium, which adds it; and
// are_done, which rays no light is left of.
//
// What the occupancy grid says is empty is passed by where there are masks; the picture is the
// same. At V_O, and where LANES is 1, a ray stays in a list, whose supersegments a loop of its own
// meets.
#include "lib/lanes.cl"
typedef Int Steps;
typedef Real Border;
#include "raycasting/first_supersegment.cl"
#include "raycasting/ray.cl"
#include "raycasting/stepping.cl"
#pragma OPENCL FP_CONTRACT OFF

// Rays, and what stepping along them takes.
typedef struct {
    ListRay ray;
    Axis u, v;
} Path;

inline void begin_path(Path *path, __global const float *forms, const Frame *frame, Real a, Real b,
                       Real t_end, Int wanted)
{
    begin_ray(&path->ray, forms, frame, a, b, t_end, wanted);
    path->u = axis_of(path->ray.along.x, path->ray.deep.x, frame->lists_wide, 1);
    path->v = axis_of(path->ray.along.y, path->ray.deep.y, frame->lists_high,
                      STACKS_ALONG(frame->lists_wide));
    take_step(&path->u, path->u.along > 0.0f);
    take_step(&path->v, path->v.along > 0.0f);
}

inline Real lists_crossed(const Path *path) { return fabs(path->u.along) + fabs(path->v.along); }

// Bring the lists close that rays begin and end in, if they cross few: those in between are others'
// ends. Of blocks, and of rays in one list, those of the next column of blocks, which come while
// this one's are walked through.
inline void prefetch_ends(const Path *path, const Lists *lists)
{
    const Int few = path->ray.present && lists_crossed(path) < LISTS_TO_PREFETCH;
    if (!ANY(few))
        return;
    const Axis *u = &path->u, *v = &path->v;
    const int shift = LANES > 1 || lists->frame.one_list
                          ? BLOCK * lists->frame.lists_high / lists->frame.height
                          : 0;
    const Real r_end = path->ray.r_begin + 1.0f;
    const Places first_i = {list_index(u, path->ray.start.x, shift)};
    const Places first_j = {list_index(v, path->ray.start.y, 0)};
    const Places last_i = {list_index(u, fma(r_end, u->along, u->deep), shift)};
    const Places last_j = {list_index(v, fma(r_end, v->along, v->deep), 0)};
    const Places wanted = {few};
    for (int k = 0; k < LANES; ++k)
        if (wanted.each[k])
            prefetch_list(lists, first_i.each[k], first_j.each[k]);
    for (int k = 0; k < LANES; ++k)
        if (wanted.each[k] &&
            (first_i.each[k] != last_i.each[k] || first_j.each[k] != last_j.each[k]))
            prefetch_list(lists, last_i.each[k], last_j.each[k]);
}

// How far rays have come.
typedef struct {
    Int i, j;      // the lists
    Real r, depth; // depth in their sense
    Search search;
    Int active;    // rays that have not ended
    Int new_stack; // rays in a stack of cells that they have not looked at
} Cursor;

inline Cursor begin_walk(const Path *path, const Sense *sense, Int active)
{
    Cursor at;
    at.i = list_index(&path->u, path->ray.start.x, 0);
    at.j = list_index(&path->v, path->ray.start.y, 0);
    at.r = path->ray.r_begin;
    at.depth = sense->sign * path->ray.start.z;
    at.search = begin_search(0);
    at.active = active;
    at.new_stack = lists_crossed(path) > FEW_LISTS;
    return at;
}

// What a turn has found out.
typedef struct {
    ListMet list;
    Int found; // the first supersegment of the list behind the ray's depth, or none
    Faces face;
    Int meets;               // rays that cross it in the list,
    Int stays;               // and are still in the list behind it
    Real r_u, r_v;           // where they leave the list by u and by v
    Real r_next, next_depth; // and where they do
} Crossing;

// Search on for the first supersegments behind the rays' depths (Algorithm 1), and see where the
// rays leave the lists.
inline Crossing next_crossing(Cursor *at, const Path *path, const Sense *sense, const Lists *lists)
{
    Crossing crossing;
    crossing.list = list_met(lists, at->i, at->j, at->active);
    crossing.found = first_supersegment(&at->search, lists, crossing.list, at->depth, at->active,
                                        sense->away, path->ray.depths, &crossing.face);
    crossing.r_u = crossings(&path->u, at->i);
    crossing.r_v = crossings(&path->v, at->j);
    crossing.r_next =
        HIGHER_OF(at->r, LOWER_OF(path->ray.r_begin + 1.0f, LOWER_OF(crossing.r_u, crossing.r_v)));
    crossing.next_depth = depth_at(sense, crossing.r_next);
    crossing.meets = crossing.found && crosses(crossing.face, crossing.next_depth);
    crossing.stays = crossing.meets && crossing.face.far <= crossing.next_depth;
    return crossing;
}

// Of rays in one list: come to the next supersegment of the list, if the ray meets it there.
inline Int next_in_list(Cursor *at, Crossing *crossing, const Path *path, const Sense *sense,
                        const Lists *lists)
{
    const Int more = crossing->stays && at->search.p + 1 < crossing->list.count;
    crossing->meets = crossing->stays = 0;
    if (!ANY(more))
        return 0;
    at->search.p += 1;
    crossing->face =
        faces_met(lists, crossing->list, at->search.p, more, sense->away, path->ray.depths);
    crossing->meets = crosses(crossing->face, crossing->next_depth);
    crossing->stays = crossing->meets && crossing->face.far <= crossing->next_depth;
    return crossing->meets;
}

// Go on to the next supersegments of the lists, or step to the next lists (Amanatides and Woo);
// rays whose light is `done` end with their lists.
inline void step_on(Cursor *at, const Crossing *crossing, const Path *path, Int done)
{
    const Int leaves = crossing->found && !crossing->stays;
    guess_again(&at->search, crossing->list, crossing->stays);
    search_again(&at->search, leaves);
    at->r = SELECT(at->r, crossing->r_next, leaves);
    at->depth = SELECT(at->depth, crossing->next_depth, leaves);
    const Int in_u = crossing->r_u <= crossing->r_v;
    const Int i = at->i + SELECT((Int)(0), path->u.step, leaves && in_u);
    const Int j = at->j + SELECT((Int)(0), path->v.step, leaves && !in_u);
    const Int ends = crossing->r_next >= path->ray.r_begin + 1.0f || done ||
                     are_outside(&path->u, &path->v, i, j);
    at->active = at->active && !(leaves && ends);
    at->new_stack = at->new_stack || ((i ^ at->i) | (j ^ at->j)) >> STACK_SHIFT != 0;
    at->i = i;
    at->j = j;
}

// Follow the rays that are `active`, of which all go away or come back.
__attribute__((always_inline)) inline void follow_in_sense(Made *made, const Path *path, Int active,
                                                           bool away, const Lists *lists)
{
    const Sense sense = sense_of(path->ray.along.z, path->ray.deep.z, away);
    Cursor at = begin_walk(path, &sense, active);
    for (int turn = 0; ANY(at.active); ++turn) {
        // Skip cells of the occupancy grid that no supersegment reaches (section 4)
        if (lists->masks && turn % TURNS_PER_LOOK == 0 && ANY(at.new_stack && at.active)) {
            const Int moved = skip_empty_cells(
                &at.i, &at.j, &at.r, &at.depth, &at.active, at.new_stack && at.active, &path->u,
                &path->v, &sense, lists, path->ray.r_begin + 1.0f, path->ray.depths);
            search_again(&at.search, moved);
            at.new_stack = 0;
            if (!ANY(at.active))
                break;
        }
        // Find the first supersegment that ends behind the point of entry (Algorithm 1)
        Crossing crossing = next_crossing(&at, path, &sense, lists);
        // Take what the ray crosses of it, also of rays that meet theirs in another turn: it is
        // close then
        for (Int meets = crossing.meets; ANY(meets);) {
            const Int there = at.active && at.search.p < crossing.list.count;
            const Real4 medium = medium_met(lists, crossing.list, at.search.p, there, away);
            Real from, to;
            clip_to_faces(&from, &to, &sense, crossing.face.near, crossing.face.far, at.r,
                          crossing.r_next, at.depth, crossing.next_depth);
            take_medium(made, &path->ray, from, to, medium, meets);
            if (LANES > 1 || !lists->frame.one_list)
                break;
            crossing.stays = crossing.stays && !are_done(made, lists);
            meets = next_in_list(&at, &crossing, path, &sense, lists);
        }
        // Step on (Amanatides and Woo)
        step_on(&at, &crossing, path, are_done(made, lists));
    }
}

// Follow rays: of several, first those that go away, and then those that come back.
inline void follow(Made *made, const Path *path, const Lists *lists)
{
    if (!ANY(path->ray.present))
        return;
    prefetch_ends(path, lists);
#if LANES == 1
    follow_in_sense(made, path, path->ray.present, path->ray.away, lists);
#else
    const Int away = path->ray.present && path->ray.away;
    const Int back = path->ray.present && !path->ray.away;
    if (ANY(away))
        follow_in_sense(made, path, away, true, lists);
    if (ANY(back))
        follow_in_sense(made, path, back, false, lists);
#endif
}
