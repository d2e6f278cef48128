"""Names that C has already."""

from __future__ import annotations

__all__ = ["ELSEWHERE", "RESERVED"]

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true
false integer real inside within slot isfinite isnan"""
MATHEMATICS = "sqrt sin cos tanh exp atan2 acos hypot copysign floor ceil fabs pow fmod rint"
RESERVED = frozenset([*KEYWORDS.split(), *MATHEMATICS.split(), *(f"{name}f" for name in MATHEMATICS.split())])
"""Words of C, and what generated code calls: no variable and no function may have such a name."""
FUNCTIONS = """acosh asin asinh atan atanh cbrt cosh erf erfc exp2 expm1 fdim fma fmax fmin fpclassify frexp gamma ilogb
isgreater isinf isless isnormal isunordered j0 j1 jn ldexp lgamma llrint llround log log10 log1p log2 logb lrint lround
modf nan nearbyint nextafter nexttoward remainder remquo round scalb scalbln scalbn signbit significand sinh tan tgamma
trunc y0 y1 yn abort abs atexit atof bsearch calloc div exit free getenv index labs ldiv llabs malloc memcpy memmove
memset mktemp printf puts qsort rand random read realloc remove rename rindex signal srand strtod system time write
entry main signature"""
ELSEWHERE = frozenset(FUNCTIONS.split())
"""Functions of C's library: no function may have such a name."""
