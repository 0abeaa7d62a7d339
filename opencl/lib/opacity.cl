// Opacity of an optical depth of 0 or more: 1 - exp(-tau) without cancellation, within 1 ulp.
//
// With tau = k log(2) + r and |r| <= log(2) / 2 it is (1 - 2^-k) + 2^-k (1 - exp(-r)): the first term is exact, and nothing
// cancels. 1 - exp(-r) is r - r^2 Q(r); Q is the polynomial of degree 4 for which the largest relative error of the whole,
// 1.4e-8, is least. A call of expm1 would take longer, and a vector's registers are stored around it.
#pragma OPENCL FP_CONTRACT OFF

#define OPAQUE_FROM 32.0f    // 1 - exp(-32) is 1 in float32
#define PER_LOG_2 1.44269504f // 1 / log(2)
#define LOG_2 0.693147182f   // rounded: an error of 2e-9 k, which 2^-k makes less than .1 ulp
#define TO_WHOLE 12582912.0f // 1.5 * 2^23: added, it leaves a whole number in the last bits
#define BITS_OF_1 0x3f800000

// WIDTH: of the vectors, nothing for single numbers
#define DEFINE_OPACITY_OF(NAME, WIDTH)                                                            \
    inline float##WIDTH NAME(float##WIDTH tau)                                                    \
    {                                                                                             \
        const float##WIDTH x = tau > OPAQUE_FROM ? (float##WIDTH)(OPAQUE_FROM) : tau;             \
        const float##WIDTH shifted = fma(x, (float##WIDTH)(PER_LOG_2), (float##WIDTH)(TO_WHOLE)); \
        const float##WIDTH r = fma(shifted - TO_WHOLE, (float##WIDTH)(-LOG_2), x);                \
        const float##WIDTH left = as_float##WIDTH(BITS_OF_1 - (as_uint##WIDTH(shifted) << 23));   \
        float##WIDTH q = fma(r, (float##WIDTH)(0.0013946417f), (float##WIDTH)(-0.008366566f));    \
        q = fma(q, r, (float##WIDTH)(0.041666284f));                                              \
        q = fma(q, r, (float##WIDTH)(-0.16666543f));                                              \
        q = fma(q, r, (float##WIDTH)(0.5f));                                                      \
        return fma(left, fma(-(r * r), q, r), 1.0f - left);                                       \
    }

DEFINE_OPACITY_OF(opacity_of, )
