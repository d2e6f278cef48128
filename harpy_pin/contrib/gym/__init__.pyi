"""What ``harpy_pin.contrib.gym`` offers; :mod:`lazy_loader` reads this file."""

from .env import HarpyEnv, HarpyVectorEnv
from .robot_env import RobotEnv

__all__ = ["HarpyEnv", "HarpyVectorEnv", "RobotEnv", "register_envs"]

def register_envs() -> None: ...
