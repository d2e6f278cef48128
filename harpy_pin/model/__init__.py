"""The robot: its states, kinematics, dynamics and contact forces as maps of what it is commanded.

Conventions (frames, units, order, signs) of the whole library:
:class:`harpy_pin.model.state.State`. The names that ``__init__.pyi`` lists are imported when they
are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
