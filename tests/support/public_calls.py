"""Every public callable, found by its name, with honest values of its arguments.

Names come from the packages' ``__all__`` and from the pages of docs/reference, so a new public name
is here the day it is added. An argument without a default needs an honest value: one in
:data:`VALUES`, by its name, or in :data:`OWN`, by the name of its callable where others mean
something else by it.
"""

import copy
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, get_origin

import numpy as np

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.flight import Fly, FlyingGait
from harpy_pin.contrib.identify import excitation, identify
from harpy_pin.contrib.power import Motors
from harpy_pin.controllers import WholeBodyParameters
from harpy_pin.estimation import EstimatorSettings

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    *(
        "",
        ".controllers",
        ".export",
        ".gaits",
        ".governors",
        ".log",
        ".model",
        ".scenario",
        ".simulation",
    ),
    *(".simulation.mujoco", ".view", ".wbc", ".wbc.condensed"),
    *(
        f".contrib.{name}"
        for name in ("batch", "flight", "gym", "identify", "preview", "shield_batch")
    ),
)
OPERATORS = ("__call__", "__getitem__")
"""Methods with a name of Python's that users call."""


@cache
def public_names() -> dict[str, Any]:
    """Public objects that can be called, by one name each."""
    found: dict[str, Any] = {}
    for package in PACKAGES:
        module = importlib.import_module(f"harpy_pin{package}")
        found |= {f"{package}.{name}"[1:]: getattr(module, name) for name in module.__all__}
    for page in sorted((ROOT / "docs" / "reference").glob("*.md")):
        for path in re.findall(r"^::: harpy_pin\.([\w.]+)", page.read_text(), re.MULTILINE):
            parent, _, name = path.rpartition(".")
            found[path] = getattr(importlib.import_module(f"harpy_pin.{parent}".rstrip(".")), name)
    once = {id(value): (name, value) for name, value in reversed(found.items())}
    found = {
        name: value
        for name, value in sorted(once.values(), key=lambda pair: pair[0])
        if _attacked(value)
    }
    return {name: value for name, value in found.items() if name not in NOT_CALLED}


def _attacked(value: Any) -> bool:
    """Functions, kernels, and classes of which users make objects: no protocols, enumerations or
    exceptions.
    """
    if inspect.isclass(value):
        return not (issubclass(value, Exception | Enum) or getattr(value, "_is_protocol", False))
    return callable(value) and get_origin(value) is None


class Yaw:
    """A task of one's own."""

    def rows(self, dynamics: hp.Dynamics, state: hp.State) -> tuple[np.ndarray, np.ndarray]:
        """Damps the body's yaw."""
        return np.eye(6, len(state.v))[5:], -5.0 * state.v[5:6]


class Attached:
    """What a plant takes and what does nothing."""

    def __init__(self):
        self.signals = {}

    def reset(self, plant):
        pass

    def after_step(self, plant):
        pass


class Silent:
    """A planner without a plan."""

    def plan(self, state: hp.State) -> hp.Plan | None:
        """None."""
        return None


@cache
def values() -> dict[str, Any]:
    """Honest values by the name of the argument; with that of the callable in front, where it means
    something else.
    """
    robot = hp.load_harpy()
    gait = hp.make_gait(robot)
    simulator, dynamics = hp.Simulator(robot), hp.Dynamics(robot)
    q, v = gait.initial_state(penetration=simulator.static_penetration)
    simulator.reset(q, v)
    dynamics.update(q, v)
    controller = hp.make_controller("wbc", gait, mu=0.25)
    command = controller.step(simulator.state)
    run, problem = hp.walk(hp.Scenario(duration=0.01)), hp.wbc.make_problem("input_space", robot)
    program, feet = problem.program, np.zeros((2, 3))
    rows = hp.governors.ForceRows(mass=robot.mass, mu=0.25)
    iris, solo = (hp.load_robot(name) for name in ("iris", "solo12"))
    fitting = vars(WholeBodyParameters.for_gait(gait))
    return {
        **{f"controllers.WholeBodyParameters.{name}": value for name, value in fitting.items()},
        **{
            f"wbc.WholeBodyWeights.{name}": value
            for name, value in vars(fitting["weights"]).items()
        },
        **{
            "robot": robot,
            "gait": gait,
            "state": simulator.state,
            "command": command,
            "run": run,
            "q": q,
            "v": v,
        },
        **{
            "simulator": simulator,
            "dynamics": dynamics,
            "ground": hp.Ground(),
            "mu": 0.25,
            "t": 0.0,
            "dt": 1e-3,
        },
        **{
            "task": Yaw(),
            "scenario": hp.Scenario(duration=0.01),
            "problem": problem,
            "program": program,
        },
        **{
            "torque": np.zeros(6),
            "thrust": feet,
            "n": 2,
            "mass": robot.mass,
            "period": 1e-3,
            "duration": 0.002,
        },
        **{
            "foot_position": feet,
            "foot_velocity": feet,
            "foot_force": feet,
            "signals": run.signals,
        },
        **{"x": np.array([*q[:3], *v[:3], *np.zeros(3)]), "x_r": np.zeros(6), "w": np.zeros(6)},
        **{
            "path": "/nowhere/run.npz",
            "folder": "/nowhere",
            "urdf": robot.urdf,
            "metadata": run.metadata,
        },
        **{
            "targets": controller.targets,
            "rotation": np.eye(3),
            "z": np.zeros(program.shape[0]),
            "held": np.ones(2),
        },
        **{
            "foot": "left_foot",
            "joints": ("left_knee",),
            "frame": "left_foot",
            "name": "wbc",
            "stiffness": 8000.0,
        },
        **{
            "rows": rows,
            "runs": [(run, robot)],
            "target": controller.target,
            "velocity": np.zeros(3),
        },
        **{
            "action": np.zeros(12),
            "actions": np.zeros((1, 12)),
            "begin": 0.0,
            "end": 1.0,
            "error": np.zeros(3),
        },
        **{"size": 4, "equalities": 1, "inequalities": 3, "bounded": 2, "offset": (0.0, 0.0, 0.01)},
        **{
            "geometry": hp.model.LegGeometry.from_robot(robot, "left_foot"),
            "length": 0.1,
            "width": 0.05,
        },
        **{
            "h": np.zeros(7),
            "jacobian": np.zeros((7, 6)),
            "time": 0.0,
            "data": hp.Scenario().to_dict(),
        },
        **{"hip": (0.0, 0.1, 0.0), "upper": 0.3, "lower": 0.3, "impulse": (0.0, 1.0, 0.0)},
        **{
            "matrix": np.zeros((1, 18)),
            "out": np.zeros(12),
            "parts": (rows,),
            "gravity": (0.0, 0.0, -9.81),
        },
        **{"friction": 0.5, "foot_radius": 0.02, "load": 10.0, "fall_height": 0.3, "settings": {}},
        **{"controller": controller, "force": np.ones((2, 3)), "depth": 0.01, "inverse_mass": 0.5},
        **{"imu": hp.Imu(), "gyroscope": np.zeros(3), "accelerometer": np.array([0.0, 0.0, 9.81])},
        **{"joint_position": q[7:], "joint_velocity": np.zeros(6), "joint_torque": np.zeros(6)},
        "WholeBodySolver.tasks": {hp.JointTask(robot.joints): 1.0},
        "readings": hp.Readings(
            0.0, np.zeros(3), np.array([0.0, 0.0, 9.81]), q[7:], np.zeros(6), np.zeros(6)
        ),
        "Readings.foot_force": np.zeros(2),
        "Estimator.settings": EstimatorSettings(),
        "simulation.sensing.EstimatedState.plant": simulator,
        "simulation.sensing.EstimatedState.estimator": hp.Estimator(robot),
        **{
            "terrain": hp.ground.Plane(slope=0.1),
            "heights": ((0.0, 0.1), (0.2, 0.3)),
            "y": np.zeros(9),
        },
        **{"normal_error": 0.01, "lag": 0.1, "walks": True, "reach": 0.2},
        "contrib.flight.FlyingGait.gait": hp.make_commanded_gait(robot),
        "contrib.flight.FlyingGait.flights": Fly(),
        "contrib.flight.Flying.gait": FlyingGait(hp.make_commanded_gait(robot), Fly()),
        "simulation.contact_step.mobility": np.eye(6),
        "simulation.contact_step.free_velocity": np.zeros(6),
        "simulation.contact_step.height": np.zeros(2),
        "simulation.contact_step.friction": np.ones((2, 3)),
        "simulation.contact_step.ground": hp.Ground().record,
        "simulation.contact_step.force": np.zeros(6),
        "contrib.battery.Battery.plant": hp.Simulator(
            robot, actuators=hp.Actuators(thrusters={"largest": 40.0})
        ),
        **{
            f"{name}.part": Attached()
            for name in ("Simulator", "simulation.PinocchioPlant", "simulation.mujoco.MujocoPlant")
        },
        "contrib.shield_batch.ShieldBatch.q": np.tile(q, (2, 1)),
        "contrib.shield_batch.ShieldBatch.v": np.tile(v, (2, 1)),
        **{
            f"contrib.shield_batch.ShieldBatch.{name}": np.zeros((2, 2, 3))
            for name in ("foot_force", "thrust")
        },
        "contrib.shield_batch.ShieldBatch.torque": np.zeros((2, 6)),
        "contrib.batch.CondensedBatch.q": np.tile(q, (2, 1)),
        "contrib.batch.CondensedBatch.v": np.tile(v, (2, 1)),
        "contrib.batch.CondensedBatch.foot_force": np.zeros((2, 2, 3)),
        **{"Hovering.robot": iris, "scenario.Hover.robot": iris},
        "Run.name": "q",
        "model.LegGeometry.offset": 0.05,
        "controllers.make_governor.name": "paper",
        "wbc.make_problem.name": "full",
        "wbc.make_solver.name": "daqp",
        "export.export.robot": "harpy",
        "scenario.gaits_of.robot": "harpy",
        "model.leg_inverse_kinematics.foot": np.array([0.0, 0.1, -0.5]),
        "model.solve_ik.targets": {"left_foot": np.array([0.0, 0.1, 0.0])},
        **dict.fromkeys(
            (
                "Standing.robot",
                "WalkingGait.robot",
                "PlannedGait.robot",
                "contrib.preview.Preview.robot",
                "scenario.Stand.robot",
                "Walking.robot",
            ),
            solo,
        ),
        "PlannedGait.planner": Silent(),
        **dict.fromkeys(
            ("PlannedGait.state", "contrib.preview.Preview.state"),
            hp.State(0.0, *hp.Standing(solo).initial_state(), *np.zeros((3, 4, 3))),
        ),
        **{"Plan.times": (0.0, 1.0), "Plan.position": np.zeros(3), "Plan.contact": (1, 1)},
        **{"Plan.foothold": feet, "Plan.velocity": np.zeros(3), "Plan.force": feet},
        **{"gaits.swing.foot": np.zeros(3), "gaits.swing.goal": np.ones(3)},
        **{"gaits.swing.left": 1.0, "gaits.swing.apex": 1.0},
        "load_robot.feet": robot.feet,
        "load_robot.loops": (),
        "WholeBodyController.weight": 0.1,
        "CondensedController.weight": 0.1,
        "wbc.AddedTasks.weight": 0.1,
        "walk.controller": None,
        "build.controller": None,
        **{"log.Propulsion.power": 1000.0, "log.Propulsion.thrust": 18.0},
        "log.Propulsion.thrusts": np.array([18.0, 2.0]),
        "contrib.power.Motors.constant": 0.6,
        "contrib.identify.identify.log": excitation(robot, duration=4.0).signals()
        | {"q": excitation(robot, duration=4.0).q},
        "contrib.identify.Excitation.tick": 0,
        "contrib.power.power.motors": Motors(constant=0.6),
        "contrib.power.power.propulsion": hp.log.Propulsion(thrust=18.0, power=1000.0),
    }


@cache
def objects() -> dict[str, Any]:
    """Objects that are not made by their class alone, by its name."""
    robot = values()["robot"]
    simulator = copy.deepcopy(values()["simulator"])
    return {
        "contrib.batch.BatchTargets": CondensedBatch(robot, 2).targets,
        "contrib.batch.CondensedBatch": CondensedBatch(robot, 2),
        "contrib.identify.Excitation": excitation(robot, duration=4.0),
        "contrib.identify.Joints": identify(robot, values()["contrib.identify.identify.log"]),
        "Simulator": simulator,
        "wbc.QPSolver": hp.wbc.make_solver("daqp", values()["program"]),
        "wbc.WholeBodyProblem": values()["problem"],
        "wbc.AddedTask": values()["controller"].add(Yaw(), weight=0.1),
        "wbc.QuadraticProgram": values()["program"],
    }


MADE_BY_THE_LIBRARY = (
    *(
        "log.Measures",
        "contrib.shield.ShieldReport",
        "scenario.Setting",
        "contrib.batch.BatchTargets",
    ),
    *("contrib.identify.Excitation", "contrib.identify.Joints"),
    *("export.Exportable", "export.Exported", "contrib.power.Power"),
    *("governors.GovernorStatus", "contrib.shield.ShieldAnswer", "model.IKResult", "Robot"),
    *("wbc.QPSolution", "scenario.Walk", "Interrupted"),
    *("model.CatalogueRobot", "model.KnownRobot", "wbc.AddedTask", "simulation.mujoco.Conventions"),
    "MujocoBridge",
    "gaits.PlannedMoment",
    "contrib.preview.Pace",
)
"""Classes whose objects users get and do not make."""
BASES = (
    *(
        "scenario.ControllerPart",
        "scenario.GaitPart",
        "scenario.Part",
        "scenario.PlantPart",
        "simulation.Plant",
    ),
    *("Gait", "wbc.WholeBodyProblem", "wbc.QPSolver"),
)
"""Classes that others are derived from; those are attacked."""
NOT_CALLED = {
    "export.write_folder": "takes a recording that export() makes",
    "scenario.read_part": "takes a table of classes",
    "ground.Terrain": "is the base of the kinds of terrain",
    "view.show": "serves until it is closed",
    "view.ReplayServer": "serves until it is closed",
    "view.Viewer": "serves until it is closed",
    "wbc.WholeBodySolution": "is made by a solver",
}
"""Functions left out, and why."""
METHODS_NOT_CALLED = (*("wait", "calls", "compile_loop", "log", "close", "close_extras"),)
"""Methods that the library's own loops call, or that end an object."""


def honest(name: str, function: Callable[..., Any]) -> dict[str, Any]:
    """Honest values of the arguments of a function or method."""
    found = {}
    for argument, parameter in inspect.signature(function).parameters.items():
        if argument == "self" or parameter.kind in (
            parameter.VAR_KEYWORD,
            parameter.VAR_POSITIONAL,
        ):
            continue
        named = f"{name}.{argument}"
        if named in values():
            found[argument] = values()[named]
        elif parameter.default is not parameter.empty:
            found[argument] = parameter.default
        else:
            assert argument in values(), f"public_calls.values() needs an honest value for {named}"
            found[argument] = values()[argument]
    return found


def calls(name: str, public: Any) -> Iterator[tuple[str, Callable[..., Any], dict[str, Any]]]:
    """The callables of a public name: itself and the public methods of one object, with honest
    arguments.
    """
    made = objects().get(name)
    if name not in (*MADE_BY_THE_LIBRARY, *BASES):
        given = honest(name, public)
        yield name, public, given
        if inspect.isclass(public) and made is None:
            made = public(**given)
    if not inspect.isclass(public) or made is None:
        return
    for method, function in inspect.getmembers(public):
        own = (
            inspect.isfunction(function) or inspect.ismethod(function)
        ) and "harpy_pin" in function.__module__
        called = method in OPERATORS or not method.startswith(("_", *METHODS_NOT_CALLED))
        if own and called:
            yield f"{name}.{method}", getattr(made, method), honest(name, function)
