"""What ``harpy_pin.ground`` offers; :mod:`lazy_loader` reads this file."""

from .ground import Ground
from .terrain import HeightField, Plane, Ramp, Rough, Stairs, Terrain

__all__ = ["Ground", "HeightField", "Plane", "Ramp", "Rough", "Stairs", "Terrain"]
