// A ray's walk through the lists of a VDI (paper, sections 3 and 4), of which kernels make a
// picture, segments or first hits:
//
//     while (at.active) {
//         skip_empty_cells(&at, ...);        // section 4
//         crossing = next_crossing(&at, ..); // Algorithm 1
//         ... composite what it crosses ...
//         step_on(&at, ...);                    // Amanatides and Woo
//     }
//
// Each turn makes a guess, meets a supersegment or leaves a list, or the last two: rays side by
// side need not wait for the one that searches longest or meets most (docs/decisions/rays.md).
//
// -D SKIP_EMPTY=0, 1   pass by what the occupancy grid says is empty; the picture is the same
// -D ONE_LIST=0, 1     the view is V_O: a ray stays in a list, whose supersegments a loop of its
// own
//                      meets (next_in_list)
#include "lib/lanes.cl"
typedef int Steps;
typedef float Border;
#include "raycasting/first_supersegment.cl"
#include "raycasting/ray.cl"
#include "raycasting/stepping.cl"
#pragma OPENCL FP_CONTRACT OFF

// A ray, and what stepping along it takes.
typedef struct {
    ListRay ray;
    Axis u, v;
    Sense sense;
} Path;

inline void begin_path(Path *path, __global const float *forms, const Frame *frame, float a,
                       float b, float t_end)
{
    begin_ray(&path->ray, forms, frame, a, b, t_end);
    path->u = axis_of(path->ray.along.x, path->ray.deep.x, frame->lists_wide);
    path->v = axis_of(path->ray.along.y, path->ray.deep.y, frame->lists_high);
    take_step(&path->u, path->u.along > 0.0f);
    take_step(&path->v, path->v.along > 0.0f);
    path->sense = sense_of(path->ray.along.z, path->ray.deep.z, path->ray.away);
}

inline float lists_crossed(const Path *path) { return fabs(path->u.along) + fabs(path->v.along); }

// Bring the lists close that a ray begins and ends in, if it crosses few: those in between are
// others' ends. With ONE_LIST, those of the next column of blocks.
inline void prefetch_ends(const Path *path, const Lists *lists, int height)
{
    if (!(lists_crossed(path) < LISTS_TO_PREFETCH))
        return;
    const int shift = ONE_LIST ? BLOCK * lists->high / height : 0;
    const float r_end = path->ray.r_begin + 1.0f;
    const int first_i = list_index(&path->u, path->ray.start.x, shift);
    const int first_j = list_index(&path->v, path->ray.start.y, 0);
    const int last_i = list_index(&path->u, fma(r_end, path->u.along, path->u.deep), shift);
    const int last_j = list_index(&path->v, fma(r_end, path->v.along, path->v.deep), 0);
    prefetch_list(lists, first_i, first_j);
    if (first_i != last_i || first_j != last_j)
        prefetch_list(lists, last_i, last_j);
}

// How far a ray has come.
typedef struct {
    int i, j;       // the list
    float r, depth; // depth in its sense
    Search search;
    bool active;    // it has not ended
    bool new_stack; // it has come to a stack of cells that it has not looked at
} Cursor;

inline Cursor begin_walk(const Path *path)
{
    Cursor at;
    at.i = list_index(&path->u, path->ray.start.x, 0);
    at.j = list_index(&path->v, path->ray.start.y, 0);
    at.r = path->ray.r_begin;
    at.depth = path->sense.sign * path->ray.start.z;
    at.search = begin_search(0); // where Algorithm 1 has lines 1 and 2: there is no list before
    at.active = path->ray.present;
    at.new_stack = lists_crossed(path) > FEW_LISTS;
    return at;
}

inline bool is_outside(const Path *path, int i, int j)
{
    return i < 0 || i >= path->u.lists || j < 0 || j >= path->v.lists;
}

// Pass by stacks of cells, and parts of stacks, whose slabs ahead are empty (section 4).
inline void skip_empty_cells(Cursor *at, const Path *path, const Grid *grid)
{
    const Axis *u = &path->u, *v = &path->v;
    at->new_stack = false;
    for (bool looks = true; looks;) {
        // Is the cell empty? Which is the nearest that is not, in this stack?
        const ulong mask =
            grid->masks[(at->j >> STACK_SHIFT) * grid->stacks_wide + (at->i >> STACK_SHIFT)];
        int nearest, nothing;
        if (!look_ahead(&nearest, &nothing, (uint)mask, (uint)(mask >> HALF_SLABS), &path->sense,
                        at->depth, true, grid, path->ray.depths))
            break;
        // Jump to it, or to the stack's border
        const int edge_i = stack_edge(u, at->i), edge_j = stack_edge(v, at->j);
        const float r_border = fmin(crossings(u, edge_i), crossings(v, edge_j));
        const float r_until =
            empty_until(r_border, nearest, nothing, &path->sense, grid, path->ray.depths);
        const int i = index_reached(u, at->i, edge_i, r_until);
        const int j = index_reached(v, at->j, edge_j, r_until);
        if (i != at->i || j != at->j) {
            at->r = r_entered(v, r_entered(u, at->r, at->i, i), at->j, j);
            at->depth = depth_at(&path->sense, at->r);
            at->search = begin_search(at->search.p);
        }
        const bool ends = r_until >= path->ray.r_begin + 1.0f || is_outside(path, i, j);
        looks = !ends && ((i ^ at->i) | (j ^ at->j)) >> STACK_SHIFT != 0;
        at->i = i;
        at->j = j;
        at->active = !ends;
    }
}

// What a turn has found out.
typedef struct {
    List list;
    bool found; // the first supersegment of the list behind the ray's depth, or none
    Faces face;
    bool meets;               // the ray crosses it in the list,
    bool stays;               // and is still in the list behind it
    float r_u, r_v;           // where it leaves the list by u and by v
    float r_next, next_depth; // and where it does
} Crossing;

// Whether the ray crosses the supersegment of a face before it leaves the list: lines 16 to 20 of
// Algorithm 1, whose f > i_exit is the wrong way round (docs/conventions.md, "The paper's
// pseudocode, and its replacement").
inline void note_face(Crossing *crossing, Faces face)
{
    crossing->face = face;
    crossing->meets = face.near <= crossing->next_depth;
    crossing->stays = crossing->meets && face.far <= crossing->next_depth;
}

// Search on for the first supersegment behind the ray's depth, and see where the ray leaves the
// list.
inline Crossing next_crossing(Cursor *at, const Path *path, const Lists *lists)
{
    Crossing crossing;
    Faces face;
    crossing.list = list_at(lists, at->i, at->j);
    crossing.found = first_supersegment(&at->search, lists, crossing.list, at->depth,
                                        path->sense.away, path->ray.depths, &face);
    crossing.r_u = crossings(&path->u, at->i);
    crossing.r_v = crossings(&path->v, at->j);
    crossing.r_next =
        HIGHER_OF(at->r, LOWER_OF(path->ray.r_begin + 1.0f, LOWER_OF(crossing.r_u, crossing.r_v)));
    crossing.next_depth = depth_at(&path->sense, crossing.r_next);
    note_face(&crossing, face);
    crossing.meets = crossing.meets && crossing.found;
    crossing.stays = crossing.stays && crossing.found;
    return crossing;
}

// With ONE_LIST: come to the next supersegment of the list, if the ray meets it there.
inline bool next_in_list(Cursor *at, Crossing *crossing, const Path *path, const Lists *lists)
{
    const bool more = crossing->stays && at->search.p + 1 < crossing->list.count;
    crossing->stays = false;
    if (!more)
        return false;
    ++at->search.p;
    note_face(crossing,
              faces_met(lists, crossing->list, at->search.p, path->sense.away, path->ray.depths));
    return crossing->meets;
}

// Where the ray enters and leaves the supersegment that it meets, r.
inline float2 ends_inside(const Cursor *at, const Crossing *crossing, const Path *path)
{
    float from, to;
    clip_to_faces(&from, &to, &path->sense, crossing->face.near, crossing->face.far, at->r,
                  crossing->r_next, at->depth, crossing->next_depth);
    return (float2)(from, to);
}

inline float4 medium_met(const Cursor *at, const Crossing *crossing, const Path *path,
                         const Lists *lists)
{
    return medium_of(lists, crossing->list,
                     index_met(crossing->list, at->search.p, path->sense.away));
}

// Go on to the next supersegment of the list, or step to the next list (Amanatides and Woo); a ray
// whose light is `done` ends with its list.
inline void step_on(Cursor *at, const Crossing *crossing, const Path *path, bool done)
{
    if (!crossing->found)
        return;
    if (crossing->stays) {
        at->search.low = ++at->search.p;
        return;
    }
    at->r = crossing->r_next;
    at->depth = crossing->next_depth;
    at->search = begin_search(at->search.p);
    const bool in_u = crossing->r_u <= crossing->r_v;
    const int i = at->i + (in_u ? path->u.step : 0);
    const int j = at->j + (in_u ? 0 : path->v.step);
    at->active = !(crossing->r_next >= path->ray.r_begin + 1.0f || done || is_outside(path, i, j));
    at->new_stack = at->new_stack || ((i ^ at->i) | (j ^ at->j)) >> STACK_SHIFT != 0;
    at->i = i;
    at->j = j;
}
