"""Ground that is not flat: planes, ramps, stairs, stepping stones, rough ground and height fields."""

from harpy_pin.simulation.terrain.grid import HeightField, Rough
from harpy_pin.simulation.terrain.named_terrains import TERRAINS, read_terrain
from harpy_pin.simulation.terrain.plane import Plane
from harpy_pin.simulation.terrain.profile import Ramp, Stairs
from harpy_pin.simulation.terrain.stones import SteppingStones
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["TERRAINS", "HeightField", "Plane", "Ramp", "Rough", "Stairs", "SteppingStones", "Terrain", "read_terrain"]
