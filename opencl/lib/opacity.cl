// Opacity of an optical depth of 0 or more: 1 - exp(-tau) without cancellation, within 1 ulp.
//
// With tau = k log(2) + r and |r| <= log(2) / 2 it is (1 - 2^-k) + 2^-k (1 - exp(-r)): the first
// term is exact, and nothing cancels. 1 - exp(-r) is r - r^2 Q(r); Q is the polynomial of degree 4
// for which the largest relative error of the whole, 1.4e-8, is least. A call of expm1 would take
// longer, and a vector's registers are stored around it.
#include "lib/lanes.cl"
#pragma OPENCL FP_CONTRACT OFF

#define OPAQUE_FROM 32.0f     // 1 - exp(-32) is 1 in float32
#define PER_LOG_2 1.44269504f // 1 / log(2)
#define LOG_2 0.693147182f    // rounded: an error of 2e-9 k, which 2^-k makes less than .1 ulp
#define TO_WHOLE 12582912.0f  // 1.5 * 2^23: added, it leaves a whole number in the last bits
#define BITS_OF_1 0x3f800000

inline Real opacity_of(Real tau)
{
    const Real x = SELECT(tau, (Real)(OPAQUE_FROM), tau > OPAQUE_FROM);
    const Real shifted = fma(x, (Real)(PER_LOG_2), (Real)(TO_WHOLE));
    const Real r = fma(shifted - TO_WHOLE, (Real)(-LOG_2), x);
    const Real left = AS_REAL(BITS_OF_1 - (AS_UINT(shifted) << 23));
    Real q = fma(r, (Real)(0.0013946417f), (Real)(-0.008366566f));
    q = fma(q, r, (Real)(0.041666284f));
    q = fma(q, r, (Real)(-0.16666543f));
    q = fma(q, r, (Real)(0.5f));
    return fma(left, fma(-(r * r), q, r), 1.0f - left);
}
