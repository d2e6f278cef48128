/* Functions of mathematics in single precision, made of operations that every processor rounds alike.

   C's libraries differ in the last digit of sinf and its like, and a last digit may decide about an active constraint.
   With these, the exported C gives the same digits on all processors. Polynomials and reductions are those of Cephes
   (S. L. Moshier). An angle of 8192 rad or more is first reduced with the 2 pi of single precision. */

static real reduce_angle(real x, integer *octant)
{
    real angle = fabsf(x);
    if (!(angle < (real)INFINITY)) {
        *octant = 0;
        return x - x;
    }
    if (angle >= 8192.0f) {
        angle = fmodf(angle, 6.28318531f);
    }
    integer j = (integer)(angle * 1.27323954f);
    j += j & 1;
    const real y = (real)j;
    *octant = j & 7;
    return ((angle - y * 0.78515625f) - y * 2.4187564849853515625e-4f) - y * 3.77489497744594108e-8f;
}

static real sine_part(real x)
{
    const real z = x * x;
    return ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * x + x;
}

static real cosine_part(real x)
{
    const real z = x * x;
    return ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z - 0.5f * z + 1.0f;
}

static real real_sin(real x)
{
    integer octant;
    const real r = reduce_angle(x, &octant);
    const real size = (octant & 3) == 2 ? cosine_part(r) : sine_part(r);
    return (octant > 3) != (x < 0.0f) ? -size : size;
}

static real real_cos(real x)
{
    integer octant;
    const real r = reduce_angle(x, &octant);
    const real size = (octant & 3) == 2 ? sine_part(r) : cosine_part(r);
    return octant == 2 || octant == 4 ? -size : size;
}

static real real_atan2(real y, real x)
{
    const real along = fabsf(x), across = fabsf(y);
    if (along == 0.0f && across == 0.0f) {
        return copysignf(copysignf(1.0f, x) < 0.0f ? 3.14159265f : 0.0f, y);
    }
    real begin = 0.0f, t;
    if (across > 2.41421356f * along) {
        begin = 1.57079633f;
        t = -along / across;
    } else if (across > 0.414213562f * along) {
        begin = 0.785398163f;
        t = (across - along) / (across + along);
    } else {
        t = across / along;
    }
    const real z = t * t;
    const real s = ((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f;
    const real angle = s * z * t + t + begin;
    return copysignf(copysignf(1.0f, x) < 0.0f ? 3.14159265f - angle : angle, y);
}

static real real_acos(real x)
{
    return real_atan2(sqrtf((1.0f - x) * (1.0f + x)), x);
}

static real real_hypot(real x, real y)
{
    return sqrtf(x * x + y * y);
}

static real real_exp(real x)
{
    if (!(x < 88.7f)) {
        return x != x ? x : (real)INFINITY;
    }
    if (x < -87.0f) {
        return 0.0f;
    }
    const real n = floorf(1.44269504f * x + 0.5f);
    const real r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    const real s = ((1.9875691500e-4f * r + 1.3981999507e-3f) * r + 8.3334519073e-3f) * r + 4.1665795894e-2f;
    return ldexpf(((s * r + 1.6666665459e-1f) * r + 5.0000001201e-1f) * r * r + r + 1.0f, (int)n);
}

static real real_tanh(real x)
{
    const real z = x * x, size = fabsf(x);
    if (size < 0.625f) {
        const real s = ((-5.70498872745e-3f * z + 2.06390887954e-2f) * z - 5.37397155531e-2f) * z + 1.33314422036e-1f;
        return (s * z - 3.33332819422e-1f) * z * x + x;
    }
    return copysignf(1.0f - 2.0f / (real_exp(2.0f * size) + 1.0f), x);
}
