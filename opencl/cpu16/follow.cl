// The rays of a block, followed through the lists (cpu16/walk.cl), of which programs make a picture
// or segments.
//
// Who includes this says before what is Made of them; take_medium, which adds what rays cross of a
// medium; and are_done, which of them no light is left of.
#include "cpu16/walk.cl"
#pragma OPENCL FP_CONTRACT OFF

// Follow the rays that are `active`, of which all go away or come back.
__attribute__((always_inline)) inline void follow(Made *made, const Paths *paths, Int active,
                                                  bool away, const Lists *lists, const Grid *grid,
                                                  const Frame *frame)
{
    const Sense sense = sense_of(paths->rays.along.z, paths->rays.deep.z, away);
    Cursors at = begin_walk(paths, &sense, active);
    for (int turn = 0; ANY(at.active); ++turn) {
        if (SKIP_EMPTY && turn % TURNS_PER_LOOK == 0 && ANY(at.new_stack && at.active)) {
            skip_empty_cells(&at, at.new_stack && at.active, paths, &sense, grid,
                             frame->depth_origin);
            at.new_stack = 0;
            if (!ANY(at.active))
                break;
        }
        Crossings crossing = next_crossings(&at, paths, &sense, lists, frame->depth_origin);
        if (ANY(crossing.meets)) {
            Real from, to;
            const Real4 medium = media_crossed(&at, &crossing, &sense, lists, &from, &to);
            take_medium(made, &paths->rays, from, to, medium, crossing.meets);
        }
        step_on(&at, &crossing, paths, are_done(made, frame));
    }
}

// Follow those that go away, and those that come back.
inline void follow_all(Made *made, const Paths *paths, const Lists *lists, const Grid *grid,
                       const Frame *frame)
{
    if (!ANY(paths->rays.present))
        return;
    prefetch_ends(paths, lists, frame->height);
    const Int away = paths->rays.present && paths->rays.away;
    const Int back = paths->rays.present && !paths->rays.away;
    if (ANY(away))
        follow(made, paths, away, true, lists, grid, frame);
    if (ANY(back))
        follow(made, paths, back, false, lists, grid, frame);
}
