// The walk of raycasting/walk.cl of a block of 4 x 4 rays (docs/decisions/blocks.md), of which all
// go away from V_O or come back: each turn, each ray makes a guess, meets a supersegment or leaves
// a list, or the last two.
//
// Offsets are OFFSET_T int. What one ray has, and sixteen:
//
//   raycasting/walk.cl         here
//   Path, begin_path           Paths, begin_paths; a Sense beside them, as all share `away`
//   Cursor                     Cursors
//   Crossing, next_crossing    Crossings, next_crossings
//   note_face                  `meets` of next_crossings, `stays` of media_crossed
//   medium_met, ends_inside    media_crossed
//   begin_search               search_again (cpu16/lists.cl, which has a table of its own)
//
// -D SKIP_EMPTY=0, 1   pass by what the occupancy grid says is empty; the picture is the same
#include "lib/lanes.cl"
typedef Int Steps;
typedef Real Border;
#include "cpu16/lists.cl"
#include "cpu16/pixels.cl"
#include "cpu16/rays.cl"
#include "raycasting/stepping.cl"
#pragma OPENCL FP_CONTRACT OFF

// The rays, and what stepping along them takes.
typedef struct {
    ListRay rays;
    Axis u, v;
} Paths;

inline Paths begin_paths(__global const float *forms, const Frame *frame, Real a, Real b,
                         Real t_end, Int wanted)
{
    Paths paths;
    paths.rays = begin_rays(forms, frame, a, b, t_end, wanted);
    paths.u = axis_of(paths.rays.along.x, paths.rays.deep.x, frame->lists_wide);
    paths.v = axis_of(paths.rays.along.y, paths.rays.deep.y, frame->lists_high);
    take_step(&paths.u, paths.u.along > 0.0f);
    take_step(&paths.v, paths.v.along > 0.0f);
    return paths;
}

// Bring the lists close that the rays of the next column of blocks begin and end in, if they cross
// few: they come while this one's are walked through.
inline void prefetch_ends(const Paths *paths, const Lists *lists, int height)
{
    const Axis *u = &paths->u, *v = &paths->v;
    const Int crosses_few =
        paths->rays.present && fabs(u->along) + fabs(v->along) < LISTS_TO_PREFETCH;
    if (!ANY(crosses_few))
        return;
    const int shift = BLOCK * lists->high / height;
    const Real r_end = paths->rays.r_begin + 1.0f;
    const Int first_i = list_index(u, paths->rays.start.x, shift),
              first_j = list_index(v, paths->rays.start.y, 0);
    const Int last_i = list_index(u, fma(r_end, u->along, u->deep), shift);
    const Int last_j = list_index(v, fma(r_end, v->along, v->deep), 0);
    int columns[2][LANES], rows[2][LANES], wanted[2][LANES];
    vstore16(first_i, 0, columns[0]);
    vstore16(first_j, 0, rows[0]);
    vstore16(crosses_few, 0, wanted[0]);
    vstore16(last_i, 0, columns[1]);
    vstore16(last_j, 0, rows[1]);
    vstore16(crosses_few && (first_i != last_i || first_j != last_j), 0, wanted[1]);
    for (int end = 0; end < 2; ++end) {
        for (int k = 0; k < LANES; ++k) {
            if (wanted[end][k])
                prefetch_list(lists, columns[end][k], rows[end][k]);
        }
    }
}

// How far the rays have come.
typedef struct {
    Int i, j; // lists
    Real r;
    Real depth; // in their sense
    Searches search;
    Int active;    // rays that have not ended
    Int new_stack; // rays in a stack that they have not looked at
} Cursors;

inline Cursors begin_walk(const Paths *paths, const Sense *sense, Int active)
{
    Cursors at;
    at.i = list_index(&paths->u, paths->rays.start.x, 0);
    at.j = list_index(&paths->v, paths->rays.start.y, 0);
    at.r = paths->rays.r_begin;
    at.depth = sense->sign * paths->rays.start.z;
    at.search.n = at.search.low = at.search.missed = at.search.passed = at.search.beyond = 0;
    at.search.high = INT_MAX;
    at.active = active;
    at.new_stack = fabs(paths->u.along) + fabs(paths->v.along) > FEW_LISTS;
    return at;
}

inline Int are_outside(const Paths *paths, Int i, Int j)
{
    return i < 0 || i >= paths->u.lists || j < 0 || j >= paths->v.lists;
}

// Pass by stacks, and parts of stacks, whose slabs ahead are empty, for the rays that look. Written
// with selects, and in a loop of its own, so that the rays meet again behind it.
inline void skip_empty_cells(Cursors *at, Int looks, const Paths *paths, const Sense *sense,
                             const Grid *grid, float depth_origin)
{
    const Axis *u = &paths->u, *v = &paths->v;
    while (ANY(looks)) {
        const Int stack = (at->j >> STACK_SHIFT) * grid->stacks_wide + (at->i >> STACK_SHIFT);
        const Words mask = words_at(grid->masks, select((Int)(0), stack, looks));
        Int nearest, nothing;
        const Int passes = look_ahead(&nearest, &nothing, mask.low, mask.high, sense, at->depth,
                                      looks, grid, depth_origin);
        if (!ANY(passes))
            break;
        const Int edge_i = stack_edge(u, at->i);
        const Int edge_j = stack_edge(v, at->j);
        const Real r_border = fmin(crossings(u, edge_i), crossings(v, edge_j));
        const Real r_until = empty_until(r_border, nearest, nothing, sense, grid, depth_origin);
        const Int i = index_reached(u, at->i, edge_i, r_until);
        const Int j = index_reached(v, at->j, edge_j, r_until);
        const Int moves = passes && (i != at->i || j != at->j);
        const Real r = r_entered(v, r_entered(u, at->r, at->i, i), at->j, j);
        at->r = select(at->r, r, moves);
        at->depth = select(at->depth, depth_at(sense, r), moves);
        search_again(&at->search, moves);
        const Int ends = r_until >= paths->rays.r_begin + 1.0f || are_outside(paths, i, j);
        looks = passes && !ends && ((i ^ at->i) | (j ^ at->j)) >> STACK_SHIFT != 0;
        at->i = select(at->i, i, passes);
        at->j = select(at->j, j, passes);
        at->active = at->active && !(passes && ends);
    }
}

// What a turn has found out.
typedef struct {
    ListOfEach list;
    Int found; // the first supersegment of the list behind the ray's depth, or none
    FacesOfEach face;
    Int meets;               // rays that cross it in the list,
    Int stays;               // and are still in the list behind it
    Real r_u, r_v;           // where they leave the list by u and by v
    Real r_next, next_depth; // and where they do
} Crossings;

inline Crossings next_crossings(Cursors *at, const Paths *paths, const Sense *sense,
                                const Lists *lists, float depth_origin)
{
    Crossings crossing;
    crossing.list = lists_at(lists, at->i, at->j, at->active);
    crossing.found = search_on(&at->search, lists, &crossing.list, at->depth, at->active,
                               sense->away, depth_origin, &crossing.face);
    crossing.r_u = crossings(&paths->u, at->i);
    crossing.r_v = crossings(&paths->v, at->j);
    crossing.r_next = HIGHER_OF(
        at->r, LOWER_OF(paths->rays.r_begin + 1.0f, LOWER_OF(crossing.r_u, crossing.r_v)));
    crossing.next_depth = depth_at(sense, crossing.r_next);
    crossing.meets = crossing.found && crossing.face.near <= crossing.next_depth;
    crossing.stays = 0;
    return crossing;
}

// The media that rays meet, and where they enter and leave them: also of those that meet theirs in
// another turn, as it is close then.
inline Real4 media_crossed(const Cursors *at, Crossings *crossing, const Sense *sense,
                           const Lists *lists, Real *from, Real *to)
{
    const Int there = at->active && at->search.n < crossing->list.count;
    const Real4 medium = medium_met(lists, &crossing->list, at->search.n, there, sense->away);
    clip_to_faces(from, to, sense, crossing->face.near, crossing->face.far, at->r, crossing->r_next,
                  at->depth, crossing->next_depth);
    crossing->stays = crossing->meets && crossing->face.far <= crossing->next_depth;
    return medium;
}

// Step on; rays whose light is `done` end with their lists.
inline void step_on(Cursors *at, const Crossings *crossing, const Paths *paths, Int done)
{
    const Int leaves = crossing->found && !crossing->stays;
    guess_again(&at->search, &crossing->list, crossing->stays);
    search_again(&at->search, leaves);
    at->r = select(at->r, crossing->r_next, leaves);
    at->depth = select(at->depth, crossing->next_depth, leaves);
    const Int in_u = crossing->r_u <= crossing->r_v;
    const Int i = at->i + select((Int)(0), paths->u.step, leaves && in_u);
    const Int j = at->j + select((Int)(0), paths->v.step, leaves && !in_u);
    const Int ends =
        crossing->r_next >= paths->rays.r_begin + 1.0f || done || are_outside(paths, i, j);
    at->active = at->active && !(leaves && ends);
    at->new_stack = at->new_stack || ((i ^ at->i) | (j ^ at->j)) >> STACK_SHIFT != 0;
    at->i = i;
    at->j = j;
}
