"""What ``harpy_pin.estimation`` offers; :mod:`lazy_loader` reads this file."""

from .estimator import Estimator, EstimatorSettings
from .imu import Imu
from .readings import Readings

__all__ = ["Estimator", "EstimatorSettings", "Imu", "Readings"]
