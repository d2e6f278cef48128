"""Robots for reinforcement learning: Gymnasium environments around a :class:`~harpy_pin.scenario.Scenario`.

``pip install 'harpy-pin[gym]'``. Gymnasium knows the names ``Harpy-v0`` and ``Robot-v0`` once this package is
imported::

    env = gymnasium.make("harpy_pin.contrib.gym:Harpy-v0")  # imports the package itself
    dog = gymnasium.make("harpy_pin.contrib.gym:Robot-v0", robot="go2")
    many = gymnasium.make_vec("Harpy-v0", num_envs=1000, vectorization_mode="vector_entry_point")

The last one is many robots in one compiled loop. Actions, observations and rewards of Harpy:
:mod:`harpy_pin.contrib.gym.batched_env`; of other robots: :mod:`harpy_pin.contrib.gym.robot_env`.
"""

from typing import TYPE_CHECKING, Any

__all__ = ["HarpyEnv", "HarpyVectorEnv", "RobotEnv", "register_envs"]

if TYPE_CHECKING:
    from harpy_pin.contrib.gym.env import HarpyEnv, HarpyVectorEnv
    from harpy_pin.contrib.gym.robot_env import RobotEnv

_WHERE = {
    "HarpyEnv": "harpy_pin.contrib.gym.env",
    "HarpyVectorEnv": "harpy_pin.contrib.gym.env",
    "RobotEnv": "harpy_pin.contrib.gym.robot_env",
}


def register_envs() -> None:
    """Tell Gymnasium the names ``Harpy-v0`` and ``Robot-v0``; nothing of the library is imported yet.

    Raises:
        InputError: Gymnasium is not installed.
    """
    try:
        from gymnasium import register, registry
    except ImportError as error:
        from harpy_pin.errors import InputError

        message = f"Gymnasium cannot be imported ({error}): pip install 'harpy-pin[gym]'"
        raise InputError(message, name="gymnasium") from error
    if "Harpy-v0" not in registry:
        register(
            id="Harpy-v0",
            entry_point="harpy_pin.contrib.gym.env:HarpyEnv",
            vector_entry_point="harpy_pin.contrib.gym.env:HarpyVectorEnv",
        )
    if "Robot-v0" not in registry:
        register(id="Robot-v0", entry_point="harpy_pin.contrib.gym.robot_env:RobotEnv")


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    from importlib import import_module

    return getattr(import_module(_WHERE[name]), name)


register_envs()
