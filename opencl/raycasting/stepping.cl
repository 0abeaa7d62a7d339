// Steps from list to list (Amanatides and Woo), and past what the occupancy grid says is empty
// (paper, section 4): formulas of one ray, or of several side by side (lib/lanes.cl).
//
// Who includes this says before of which types the ways of rays along an axis are: Steps, Int or,
// if all rays of a work-item step the same way, int; Border, Real or float.
#include "lib/list_space.cl"
#include "raycasting/lists.cl"
#include "raycasting/stacks.cl"
#pragma OPENCL FP_CONTRACT OFF

// Depth in the sense of rays that all go away, or all come back: it does not decrease along them.
typedef struct {
    bool away;
    float sign;       // of the depth coordinate
    Real along, deep; // at r it is fma(r, along, deep)
    Real inverse;     // of `along`, or 0
} Sense;

// Of rays whose depth coordinate is deep + r along.
inline Sense sense_of(Real along, Real deep, bool away)
{
    Sense sense;
    sense.away = away;
    sense.sign = away ? 1.0f : -1.0f;
    sense.along = sense.sign * along;
    sense.deep = sense.sign * deep;
    sense.inverse = SELECT((Real)(0.0f), 1.0f / sense.along, along != 0.0f);
    return sense;
}

inline Real depth_at(const Sense *sense, Real r) { return fma(r, sense->along, sense->deep); }

// What lies between depths `near` and `far` of the rays from r to r_next, where depths are `depth`
// and `next_depth`: clipped to the supersegment by interval; between two faces it never leaves
// [r, r_next].
inline void clip_to_faces(Real *from, Real *to, const Sense *sense, Real near, Real far, Real r,
                          Real r_next, Real depth, Real next_depth)
{
    const Real r_enters = (near - sense->deep) * sense->inverse;
    const Real r_leaves = (far - sense->deep) * sense->inverse;
    *from = SELECT(r, LOWER_OF(HIGHER_OF(r_enters, r), r_next), near > depth);
    *to = SELECT(r_next, LOWER_OF(HIGHER_OF(r_leaves, *from), r_next), far < next_depth);
}

// One axis of V_O's window.
typedef struct {
    Real along, deep;
    Real zero, inverse; // of crossings, see there
    Steps step;         // 1 or -1
    Border border;      // from a list's index to its border ahead
    float middle;       // half of the lists
    int lists;
    int by_stack; // from a stack to the next one in the occupancy grid
} Axis;

// An axis along which rays have a coordinate deep + r along; take_step says which way they step.
inline Axis axis_of(Real along, Real deep, int lists, int by_stack)
{
    Axis axis;
    axis.along = along;
    axis.deep = deep;
    // By a component that does not change, borders are crossed at infinity
    axis.zero = SELECT((Real)(-INFINITY), deep, along != 0.0f);
    axis.inverse = SELECT((Real)(1.0f), 1.0f / along, along != 0.0f);
    axis.middle = 0.5f * (float)lists;
    axis.lists = lists;
    axis.by_stack = by_stack;
    return axis;
}

// Set which way the rays step.
inline void take_step(Axis *axis, Steps upwards)
{
    axis->step = SELECT((Steps)(-1), (Steps)(1), upwards);
    axis->border = SELECT((Border)(0.0f), (Border)(1.0f), upwards) - axis->middle;
}

// Where the rays leave the lists of an index: from the border's number, never accumulated.
#define CROSSINGS(axis, index) (((index) + (axis)->border - (axis)->zero) * (axis)->inverse)

inline Real crossings(const Axis *axis, Int index) { return CROSSINGS(axis, TO_REAL(index)); }

// The indices of the lists at a coordinate u or v, or the nearest ones; a shift away from it.
inline Int list_index(const Axis *axis, Real coordinate, int shift)
{
    return clamp(TO_INT(floor(coordinate + axis->middle)) + shift, 0, axis->lists - 1);
}

inline Int are_outside(const Axis *u, const Axis *v, Int i, Int j)
{
    return i < 0 || i >= u->lists || j < 0 || j >= v->lists;
}

// The last index in a stack, in the rays' sense.
inline Int stack_edge(const Axis *axis, Int index)
{
    return SELECT(index & ~(STACK - 1), index | (STACK - 1), (Int)(axis->step) > 0);
}

// The index of the list that stepping from `index`, but not beyond the edge of a stack, would have
// reached at r_until, by the crossings of its borders: where r_until lies by its coordinates, one
// back or one on where rounding has it otherwise.
inline Int index_reached(const Axis *axis, Int index, Int edge, Real r_until)
{
    const Int behind = edge + axis->step;
    Int reached = TO_INT(floor(fma(r_until, axis->along, axis->deep) + axis->middle));
    reached = clamp(reached, min(index, behind), max(index, behind));
    const Int too_far = reached != index && crossings(axis, reached - axis->step) > r_until;
    const Int farther = !too_far && crossings(axis, reached) <= r_until;
    reached +=
        SELECT((Int)(0), (Int)(axis->step), farther) - SELECT((Int)(0), (Int)(axis->step), too_far);
    return SELECT(index, reached, axis->along != 0.0f);
}

// r where rays come to the list of an index from another one: they do not go back.
inline Real r_entered(const Axis *axis, Real r, Int from, Int to)
{
    return SELECT(r, fmax(r, crossings(axis, to - axis->step)), to != from);
}

// Pass by stacks of cells, and parts of stacks, whose slabs ahead are empty (section 4), for the
// rays that look, from lists (i, j) along axes u and v; those that come to an end are not `active`
// any more. In a loop of its own, so that rays meet again behind it. Returns which have moved.
inline Int skip_empty_cells(Int *i, Int *j, Real *r, Real *depth, Int *active, Int looks,
                            const Axis *u, const Axis *v, const Sense *sense, const Lists *lists,
                            Real r_end, Depths depths)
{
    const Frame *frame = &lists->frame;
    Int moved = 0;
    while (ANY(looks)) {
        // Is the cell empty? Which is the nearest that is not, in this stack?
        const Int stack = (*j >> STACK_SHIFT) * v->by_stack + (*i >> STACK_SHIFT) * u->by_stack;
        const Words mask = words_at(lists->masks, SELECT((Int)(0), stack, looks));
        const Int slab = slab_of(depth_offset(sense->sign * *depth, depths), frame->first_depth,
                                 frame->slabs_per_depth);
        Int nothing;
        const Int nearest = nearest_slab(mask.low, mask.high, slab, sense->away, &nothing);
        const Int passes = looks && (nothing || nearest != slab);
        if (!ANY(passes))
            break;
        // Up to its face, or the stack's border, nothing is met: jump there
        const Int edge_i = stack_edge(u, *i), edge_j = stack_edge(v, *j);
        const Real r_border = fmin(crossings(u, edge_i), crossings(v, edge_j));
        const Real face = frame->first_depth +
                          TO_REAL(sense->away ? nearest : nearest + 1) / frame->slabs_per_depth;
        const Real r_face =
            (sense->sign * depth_coordinate(face, depths) - sense->deep) * sense->inverse;
        const Real r_until =
            SELECT(r_border, fmin(r_border, r_face), !nothing && sense->along != 0.0f);
        const Int next_i = index_reached(u, *i, edge_i, r_until);
        const Int next_j = index_reached(v, *j, edge_j, r_until);
        const Int moves = passes && (next_i != *i || next_j != *j);
        const Real next_r = r_entered(v, r_entered(u, *r, *i, next_i), *j, next_j);
        *r = SELECT(*r, next_r, moves);
        *depth = SELECT(*depth, depth_at(sense, next_r), moves);
        moved = moved || moves;
        const Int ends = r_until >= r_end || are_outside(u, v, next_i, next_j);
        looks = passes && !ends && ((next_i ^ *i) | (next_j ^ *j)) >> STACK_SHIFT != 0;
        *i = SELECT(*i, next_i, passes);
        *j = SELECT(*j, next_j, passes);
        *active = *active && !(passes && ends);
    }
    return moved;
}
