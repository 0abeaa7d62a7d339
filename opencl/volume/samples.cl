// Steps that are sampled before they are composited (volume/bricks.cl): of a volume that is on the
// device brick by brick.
//
// Rays are stored in blocks of 16, step by step, so that neighbouring work-items touch neighbouring
// words.
#define SAMPLE_LANES 16

// Where the samples of a work-item begin, of which there is room for `held`.
inline size_t samples_start(uint item, int held)
{
    return (size_t)(item / SAMPLE_LANES) * (size_t)held * SAMPLE_LANES + item % SAMPLE_LANES;
}
