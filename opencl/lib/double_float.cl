// Numbers of 48 bits: an unevaluated sum of two floats, (.x, .y) with |.y| at most half a unit in
// the last place of .x.
//
// The sum and the product of two floats, and what they round off, are exact (Knuth 1969, 4.2.2;
// Dekker 1971, "A floating-point technique for extending the available precision"). That of pairs
// is right to some 2^-46 of the larger operand.
#pragma OPENCL FP_CONTRACT OFF

// |a| >= |b|, or a is 0
inline float2 double_float_of_ordered(float a, float b)
{
    const float sum = a + b;
    return (float2)(sum, b - (sum - a));
}

inline float2 double_float_sum(float2 a, float2 b)
{
    const float sum = a.x + b.x;
    const float of_b = sum - a.x;
    const float rest = (a.x - (sum - of_b)) + (b.x - of_b);
    return double_float_of_ordered(sum, rest + (a.y + b.y));
}

inline float2 double_float_product(float2 a, float2 b)
{
    const float product = a.x * b.x;
    return double_float_of_ordered(product, fma(a.x, b.x, -product) + fma(a.x, b.y, a.y * b.x));
}

// As far away as float goes where b is too small.
inline float2 double_float_quotient(float2 a, float2 b)
{
    const float quotient = a.x / b.x;
    if (isinf(quotient))
        return (float2)(quotient, 0.0f);
    const float2 rest = double_float_sum(a, -double_float_product((float2)(quotient, 0.0f), b));
    return double_float_of_ordered(quotient, rest.x / b.x);
}

inline bool double_float_less(float2 a, float2 b) { return a.x < b.x || (a.x == b.x && a.y < b.y); }
