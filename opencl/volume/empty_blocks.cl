// The size of the blocks by which marches skip what is transparent.
//
// -D BLOCK_SHIFT  its logarithm to base 2
#define BLOCK (1 << BLOCK_SHIFT) // points along each axis
