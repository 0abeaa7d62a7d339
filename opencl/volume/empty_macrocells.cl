// The size of the macrocells by which marches skip what is transparent.
//
// -D MACROCELL_SHIFT  its logarithm to base 2
#define MACROCELL (1 << MACROCELL_SHIFT) // points along each axis
