// Entry point to opencl/raycasting/stacks.cl and to list_space.cl's depth coordinate, one work-item per query.
#include "lib/list_space.cl"
#include "raycasting/stacks.cl"
#pragma OPENCL FP_CONTRACT OFF

// What the raycaster compares at the near face of slab slabs[i]. A ray reaches over the offsets rays[i], from V_O's side to
// the deep one. It has skipped up to that face, away from V_O or back towards it, when it is at the depth coordinate until[i].
// A supersegment has one face, its front or its back, at the offset faces[i], and counts in the slabs that begin or end
// there with slabs_counted[i]; face_coordinates[i] is what the raycaster holds of that face.
__kernel void skipped_to_faces(int count, __global const float2 *rays, __global const int *slabs,
                               __global const float *faces, int away, float depth_origin, float first_depth,
                               float slabs_per_depth, float margin, __global float *until,
                               __global float *face_coordinates, __global int *slabs_counted)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float deep = depth_coordinate(rays[i].y, depth_origin);
    const float other = depth_coordinate(rays[i].x, depth_origin);
    const float along = away ? deep - other : other - deep;
    const float inverse = 1.0f / along;
    const float slab_face = first_depth + (float)slabs[i] / slabs_per_depth;
    const float r_until = (depth_coordinate(slab_face, depth_origin) - deep) * inverse;
    until[i] = fma(r_until, along, deep);
    face_coordinates[i] = depth_coordinate(faces[i], depth_origin);
    slabs_counted[i] = slab_of(away ? faces[i] - margin : faces[i] + margin, first_depth, slabs_per_depth);
}
