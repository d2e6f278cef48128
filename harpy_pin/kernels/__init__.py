"""Kernels: functions in a small language that become portable C (docs/kernels.md).

What becomes of a kernel, each file by what it translates:

- ``numbers``: constants, operators and functions of numbers;
- ``arrays``: elements, what is done element by element, and how it is written to memory;
- ``numpy_functions``: products, sums, and other functions of arrays;
- ``expressions``: names and operators in Python's order; ``parts``: fields, elements, slices;
- ``assignments``, ``statements``: what gives values; branches, loops, returns;
- ``functions``: a kernel's parameters and result, and calls of it.

Each is a class that builds on the one before. They write C with ``code`` (an expression), ``body``
(lines, blocks, variables) and ``unit`` (a file). ``values`` and ``types`` say what an expression
stands for. ``kernels`` is the decorator, ``entry_points`` and ``bridge`` are what Python calls,
``compiler`` and ``library_files`` make and keep it.

The names that ``__init__.pyi`` lists are imported when they are first used, and the files that
translate when something is translated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
