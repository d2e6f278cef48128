"""Robots for reinforcement learning: Gymnasium environments around a
:class:`~harpy_pin.scenario.Scenario`.

With the extra ``gym``: ``gymnasium.make("harpy_pin.contrib.gym:Harpy-v0")`` or ``:Robot-v0``.
Actions, observations and rewards of Harpy: :mod:`harpy_pin.contrib.gym.batched_env`; of other
robots: :mod:`harpy_pin.contrib.gym.robot_env`.
"""

import lazy_loader

from harpy_pin.errors import InputError, install_line

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def register_envs() -> None:
    """Tell Gymnasium the names ``Harpy-v0`` and ``Robot-v0``; the environments are not imported
    yet.

    Raises:
        InputError: Gymnasium is not installed.
    """
    try:
        from gymnasium import register, registry
    except ImportError as error:
        raise InputError(
            f"no Gymnasium ({error}): {install_line('gym')}", name="gymnasium"
        ) from error
    where = "harpy_pin.contrib.gym.env"
    if "Harpy-v0" not in registry:
        register("Harpy-v0", f"{where}:HarpyEnv", vector_entry_point=f"{where}:HarpyVectorEnv")
    if "Robot-v0" not in registry:
        register("Robot-v0", "harpy_pin.contrib.gym.robot_env:RobotEnv")


register_envs()
