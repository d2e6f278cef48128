"""Walks that train and walks that judge: the wide campaign's distribution, from seeds of their own."""

from __future__ import annotations

from dataclasses import replace

from comparison.campaign.plan import Task, plan
from comparison.campaign.settings import JOINT_DAMPING, CampaignSettings
from comparison.campaign.walks import scenario
from harpy_pin.scenario import Compliant, ControllerPart, Scenario

__all__ = ["JUDGING_SEED", "TRAINING_SEED", "judging_tasks", "scenario_with", "training_tasks"]

TRAINING_SEED, JUDGING_SEED = 61211, 86028
"""Seeds of the walks; the wide campaign has another one, 40427."""


def training_tasks(count: int, duration: float, joint_damping: float = JOINT_DAMPING) -> list[Task]:
    """Walks to search on, all in the library's own engine; MuJoCo is kept for judging.

    Args:
        count: of walks.
        duration: of each, s.
        joint_damping: of every joint, N·m·s/rad, known to the controllers.
    """
    return [replace(task, plant=Compliant.name) for task in _tasks(count, duration, joint_damping, TRAINING_SEED)]


def judging_tasks(count: int, duration: float, joint_damping: float = JOINT_DAMPING) -> list[Task]:
    """Walks that judge what the search found, in both engines.

    Args:
        count: of walks.
        duration: of each, s.
        joint_damping: of every joint, N·m·s/rad, known to the controllers.
    """
    return _tasks(count, duration, joint_damping, JUDGING_SEED)


def _tasks(count: int, duration: float, joint_damping: float, seed: int) -> list[Task]:
    alone = {"contenders": ("governed/none",), "joint_dampings": (joint_damping,)}
    return plan(CampaignSettings.wide(walks=count, duration=duration, seed=seed, **alone))


def scenario_with(task: Task, controller: ControllerPart) -> Scenario:
    """The scenario of a task, walked by another controller with the task's error of friction."""
    drawn = scenario(task)
    return Scenario(
        ground=drawn.ground,
        plant=drawn.plant,
        gait=drawn.gait,
        controller=replace(controller, mu=drawn.mu),
        disturbances=drawn.disturbances,
        duration=drawn.duration,
        urdf=drawn.urdf,
    )
