"""View: a loop of one's own in Meshcat, runs replayed in the browser or as a file, and figures of
their signals.

The names that ``__init__.pyi`` lists are imported when they are first used; all but ``robot_of``
need the extra view.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
