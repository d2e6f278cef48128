"""Contact-force governors and whole-body controllers for legged robots with thrusters, such as
Harpy, on Pinocchio.

The names that ``__init__.pyi`` lists are imported when they are first used, so that ``import
harpy_pin`` costs next to nothing.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
