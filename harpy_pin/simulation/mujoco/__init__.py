"""MuJoCo as a plant: the same robot, scenarios, controllers and logs in another engine.

With the extra ``mujoco``: ``walk(Scenario(plant="mujoco"))`` or ``harpy walk --set plant=mujoco``.
The names that ``__init__.pyi`` lists are imported when they are first used, MuJoCo itself when the
first model is made.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
