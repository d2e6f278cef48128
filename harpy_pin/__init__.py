"""Contact-force governors and whole-body controllers for legged robots with thrusters, such as Harpy, on Pinocchio.

The names that ``__init__.pyi`` lists are imported when they are first used, so that ``import harpy_pin`` costs next to
nothing.
"""

from typing import Any

import lazy_loader

from harpy_pin.deprecated import new_name

__version__ = "0.1.0"

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


def __getattr__(name: str) -> Any:
    return _load(name) if name in __all__ or name.startswith("__") else new_name(name)
