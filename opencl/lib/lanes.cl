// Vectors that are written out: the lanes of each are LANES rays, which a work-item follows together.
#pragma OPENCL FP_CONTRACT OFF

#define LANES 16 // those of pyvista_vdi/packets.py, and BLOCK_RAYS of pyvista_vdi/blocks.py
typedef float16 Reals;
typedef int16 Ints; // also truth values: all bits or none
#define NUMBERS (Ints)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
// Whether a truth value is true in any lane. By the sign, which compilers know how to ask a mask for.
#define ANY(chosen) any((chosen) < 0)

// Sixteen places that are read one by one, as volatile: from memory, as to take each out of a register costs two operations
// more.
typedef union {
    Ints all;
    int each[LANES];
} Places;
