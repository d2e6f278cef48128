/* What C's library lacks, as Python has it; $fmod and $copysign are those of the precision. */

static inline integer floor_div(integer a, integer b)
{
    if (b == 0) return 0;
    const integer q = a / b;
    return q * b != a && (a < 0) != (b < 0) ? q - 1 : q;
}

static inline integer floor_mod(integer a, integer b)
{
    if (b == 0) return 0;
    const integer r = a % b;
    return r != 0 && (r < 0) != (b < 0) ? r + b : r;
}

static inline real real_mod(real a, real b)
{
    const real r = $fmod(a, b);
    return r == 0 ? $copysign(0, b) : (r < 0) != (b < 0) ? r + b : r;
}

static inline real real_min(real a, real b)
{
    return b < a ? b : a;
}

static inline real real_max(real a, real b)
{
    return b > a ? b : a;
}

static inline real maximum(real a, real b)
{
    return a >= b || a != a ? a : b;
}

static inline real minimum(real a, real b)
{
    return a <= b || a != a ? a : b;
}

static inline integer integer_min(integer a, integer b)
{
    return b < a ? b : a;
}

static inline integer integer_max(integer a, integer b)
{
    return b > a ? b : a;
}

static inline integer integer_abs(integer a)
{
    return a < 0 ? -a : a;
}

static inline real power_2(real x)
{
    return x * x;
}

static inline real power_3(real x)
{
    return x * (x * x);
}

static inline real power_4(real x)
{
    const real square = x * x;
    return square * square;
}

/* Checks of indices and slices, in C that is made to be debugged. */

static inline integer inside(integer i, integer size, int line)
{
    if (i < 0 || i >= size) { fprintf(stderr, "line %d: index %ld of %ld\n", line, (long)i, (long)size); abort(); }
    return i;
}

static inline integer within(integer begin, integer end, integer size, int line)
{
    if (begin < 0 || end > size) {
        fprintf(stderr, "line %d: slice to %ld of %ld\n", line, (long)end, (long)size);
        abort();
    }
    return begin;
}
