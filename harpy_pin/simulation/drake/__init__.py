"""Drake as a third plant: the same robot, scenarios, controllers and logs in another engine.

``pip install 'harpy-pin[drake]'``, then ``walk(Scenario(plant="drake"))`` or ``harpy walk --plant drake``. Drake itself
is imported when the first model is made.
"""

from harpy_pin.simulation.drake.drake_model import DrakeModel
from harpy_pin.simulation.drake.drake_plant import APPROXIMATIONS, DrakePlant

__all__ = ["APPROXIMATIONS", "DrakeModel", "DrakePlant"]
