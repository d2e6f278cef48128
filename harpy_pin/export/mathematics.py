"""Functions of mathematics in single precision that every processor rounds alike, see
``files/mathematics.c``.
"""

import re
from importlib.resources import files

_TEXT = (files("harpy_pin.export") / "files" / "mathematics.c").read_text(encoding="utf-8")
_PARTS = {
    name: text
    for text, name in re.findall(r"^(static real (\w+)\(.*?^\})$", _TEXT, re.DOTALL | re.MULTILINE)
}
_NEEDED = {
    "sin": ("reduce_angle", "sine_part", "cosine_part"),
    "cos": ("reduce_angle", "sine_part", "cosine_part"),
    "acos": ("real_atan2",),
    "tanh": ("real_exp",),
}
"""Functions that one calls."""
PORTABLE = {
    name: tuple(_PARTS[part] for part in (*_NEEDED.get(name, ()), f"real_{name}"))
    for name in ("sin", "cos", "atan2", "acos", "hypot", "exp", "tanh")
}
"""By the names of C's functions in double precision: what makes ``real_<name>``, in order."""
