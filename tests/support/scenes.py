"""Short runs that use all of the library's kernels."""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pinocchio as pin
from looped_robots import ROBOTS
from walks import started, walked

import harpy_pin as hp
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.battery import Battery
from harpy_pin.contrib.shield_batch import ShieldBatch
from harpy_pin.controllers import GOVERNORS
from harpy_pin.controllers.governed import FrictionEstimator
from harpy_pin.export.exported_controllers import Exportable, exportable, exportable_walk
from harpy_pin.export.recording import CONTROLLERS, ESTIMATOR, _from_kernels, ready, record
from harpy_pin.governors import ForceRows
from harpy_pin.governors.point_mass import Law, axial_force, model_record
from harpy_pin.governors.rows import StackedRows
from harpy_pin.governors.thrust import CentreGains
from harpy_pin.kernels import Kernel
from harpy_pin.kernels.kernels import _KERNELS
from harpy_pin.model.catalogue import installed_data
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.scenario import Walk
from harpy_pin.wbc import FORMULATIONS, WholeBodyTargets, make_problem
from harpy_pin.wbc.condensed import CondensedSolver
from reproduction.gait.planar_gait import load_gait
from reproduction.gait.planar_walk import PlanarWalk
from reproduction.gait.spatial import make_named_gait
from reproduction.margin import MarginGovernor
from reproduction.vlip_model import AngleRow, leg_force, multiplier
from reproduction.vlip_simulation import (
    VLIP_GOVERNORS,
    cartesian,
    simulate_vlip,
    vlip_governor,
    vlip_setting,
)

GAINS = CentreGains(k_pt=660.0, k_dt=60.0, k_pr=300.0, k_dr=30.0)
SCENES: dict[str, Callable[[], object]] = {}
"""By name."""


def scene(function: Callable[[], object]) -> Callable[[], object]:
    """Make a function a scene."""
    SCENES[function.__name__] = function
    return function


def library_kernels() -> dict[str, Kernel]:
    """Every kernel of the library, private ones and those that were made so far, too."""
    import harpy_pin

    made = [kernel for kernel in _KERNELS if "<locals>" in kernel.__qualname__]
    found = {
        f"{kernel.__module__}.{kernel.__qualname__}[{n}]": kernel
        for n, kernel in enumerate(made)
        if kernel.__module__.startswith("harpy_pin.")
    }
    for module in pkgutil.walk_packages(harpy_pin.__path__, "harpy_pin."):
        if module.name.endswith("__main__"):
            continue
        loaded = importlib.import_module(module.name)
        named = dict(vars(loaded))
        tables = {name: value for name, value in named.items() if isinstance(value, dict)}
        entries = {
            f"{name}[{key}]": value
            for name, table in tables.items()
            for key, value in table.items()
        }
        named |= entries
        for name, entry in entries.items():  # or several kernels of one entry
            if is_dataclass(entry) and not isinstance(entry, type):
                named |= {
                    f"{name}.{part.name}": getattr(entry, part.name) for part in fields(entry)
                }
        for name, value in named.items():
            # Kernels in tables may be made by a function of another module.
            if isinstance(value, Kernel) and ("[" in name or value.__module__ == module.name):
                found[f"{module.name}.{name}"] = value
    return found


PUSH = (hp.Push(0.002, (0.0, 2.0, 0.0)),)
NOISE = hp.Noise.typical(0.5)
MOTORS = hp.Actuators(bandwidth=50.0, torque_share=0.8, viscous_friction=1.0, coulomb_friction=0.3)
LATE = hp.Actuators(
    thrusters=hp.Thrusters(lag=0.02, rate=500.0, least=0.5, largest=40.0, turning_lag=0.03)
)
WORN = hp.Actuators(thrusters=hp.Thrusters(largest=40.0, failing=(0, 0.1, 0.5)), no_load_speed=20.0)
KNOWN_LAG = {"parameters": {"thrust_lag": 0.02, "thrust_turning_lag": 0.03}}
FRICTION = {"parameters": {"estimate_friction": True}}
SLANTED = hp.ground.HeightField(heights=((0.0, 0.1), (0.0, 0.1)))
TERRAINS = (
    hp.ground.Plane(slope=0.2, heading=0.4),
    hp.ground.Stairs(start=-0.1),
    hp.ground.Rough(),
    SLANTED,
)
BRIEF = {"duration": 0.01}
WALKS: dict[str, list[dict[str, Any]]] = {
    **{f"governor {name}": [{"controller": hp.Governed(governor=name)}] for name in GOVERNORS},
    **{
        f"formulation {name}": [
            {"controller": hp.WholeBody(parameters={"formulation": name, "solver": solver})}
            for solver in ("active_set", "proxqp")
        ]
        for name in FORMULATIONS
    },
    "condensed": [{}],
    "commanded": [
        *(
            {
                "controller": name,
                "gait": hp.Commanded(velocity=(0.3, 0.1, 0.5)),
                "noise": NOISE,
                "delay": 1e-3,
            }
            for name in ("condensed", "wbc")
        ),
        {"controller": hp.Governed(limits=True, evaluate_at="tracked"), "plant": "mujoco"},
    ],
    "actuators": [
        {
            "controller": hp.Condensed(parameters={"estimate_joint_friction": True}),
            "actuators": MOTORS,
        }
    ],
    "thrusters": [
        *(
            {"controller": kind(**KNOWN_LAG), "actuators": LATE}
            for kind in (hp.Condensed, hp.WholeBody)
        ),
        {"actuators": LATE, "plant": "mujoco"},
        *({"actuators": WORN, "plant": plant} for plant in ("compliant", "mujoco")),
    ],
    "terrain": [
        *({"terrain": terrain, **BRIEF} for terrain in TERRAINS),
        *(
            {"controller": part, "slope": 0.2, **BRIEF}
            for part in (hp.WholeBody(), hp.WholeBody(**FRICTION))
        ),
        *(
            {"controller": hp.Governed(governor="filter", **more), "slope": 0.2, **BRIEF}
            for more in ({}, FRICTION)
        ),
        *({"plant": plant, "slope": 0.2, **BRIEF} for plant in ("compliant", "mujoco")),
    ],
    "loops": [
        *(
            {"controller": hp.Condensed(**more), "gait": gait, **BRIEF}
            for more in ({}, FRICTION)
            for gait in ("hand", "commanded")
        ),
        {"gait": hp.Straight(speed=0.0)},
    ],
    "governed": [
        *(
            {"controller": controller, "gait": gait, "noise": hp.Noise.typical(0.1)}
            for controller in ("condensed", "wbc")
            for gait in ("hand", "commanded")
        ),
        *(
            {"controller": hp.Governed(governor=governor, parameters={"legs": legs})}
            for governor in GOVERNORS
            for legs in ("pid", "feedforward")
        ),
    ],
}
"""Walks of scenes: pushed, on a ground that is slippery enough for limits to be active."""
if installed_data() is not None:  # point feet step over what is higher, and soles stand on it
    WALKS["terrain"] += [
        {
            "robot": "go2",
            "terrain": hp.ground.Stairs(start=0.2),
            "mu_s": 0.6,
            "stiffness": 75e3,
            **BRIEF,
        },
        {"robot": "go2", "slope": 0.2, "stiffness": 75e3, **BRIEF},
        *(
            {"robot": name, "slope": 0.1, "stiffness": 1e5, "duration": 0.005}
            for name in ("go2", "g1")
        ),
    ]


def walk(**settings: Any) -> hp.Run:
    """A walk of a scene."""
    return walked(**{"duration": 0.05, "pushes": () if "robot" in settings else PUSH, **settings})


def all_of(walks: list[dict[str, Any]]) -> None:
    """Walk them one after the other."""
    for settings in walks:
        walk(**settings)


SCENES |= {name: partial(all_of, walks) for name, walks in WALKS.items()}


@scene
def joint_targets() -> None:
    """Motors' laws of all whole-body controllers, where a sample is bad, and where thrusts lag."""
    motors = {"joint_stiffness": 1.0, "joint_damping": 0.3}
    own = motors | {"solver": "active_set"}
    parts = [hp.WholeBody(parameters=own | {"formulation": name}) for name in FORMULATIONS]
    for part in (
        *parts,
        hp.Condensed(parameters=motors),
        hp.Condensed(parameters=motors | {"thrust_lag": 0.02}),
    ):
        motion = hp.build(hp.Scenario(controller=part, duration=0.01))
        motion.run()
        motion.controller.step(hp.State(np.nan, *motion.controller._sample))
    for part in parts:
        _tick_alone(hp.build(hp.Scenario(controller=part, duration=0.01)))


@scene
def estimated() -> None:
    """Walks on the estimate, on points and on round feet, and readings that are none."""
    walk(state="estimated")
    estimator = hp.Estimator(hp.load_harpy(), foot_radius=0.02)
    for n in range(60):
        unit = np.full(3, np.nan if n > 50 else 1e-3 * n), np.array([0.1, 0.0, 9.81])
        force = np.full(2, 20.0 if n > 9 else 0.0)
        estimator.step(hp.Readings(1e-3 * n, *unit, *np.full((3, 6), 0.1), foot_force=force))


@scene
def bridged() -> None:
    """A state from MuJoCo, and a command into it."""
    plant = hp.build(hp.Scenario(plant="mujoco")).simulator
    bridge = hp.MujocoBridge(plant.model, plant.robot)
    bridge.read(plant.data)
    bridge.write(hp.Command(np.zeros(6)), plant.data)


@scene
def battery() -> None:
    """A battery behind the thrusters."""
    plant = hp.Simulator(
        hp.load_harpy(), actuators=hp.Actuators(thrusters=hp.Thrusters(largest=40.0))
    )
    plant.attach(Battery())
    started(plant, hp.make_gait(plant.robot)).advance(hp.Command(np.zeros(6), np.ones((2, 3))))


@scene
def gaits() -> None:
    """Gaits that were found."""
    scenario = hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01)
    for gait in ("optimised", "paper-curves"):
        hp.walk(scenario, gait=make_named_gait(hp.load_harpy(), gait))
    PlanarWalk(hp.load_harpy(), load_gait().gait).run(0.01)


@scene
def others() -> None:
    """A humanoid on its soles, a rotorcraft, and a biped that steps in place."""
    if installed_data() is None:
        return
    g1, iris, bolt = (hp.load_robot(name) for name in ("g1", "iris", "bolt"))
    moved = hp.Standing(g1)
    moved.move((0.01, 0.0, 0.0), t=0.0)
    for gait in (moved, hp.Hovering(iris), hp.WalkingGait(bolt, "step", (0.0, 0.0, 0.0))):
        for controller in ("condensed", "wbc"):
            hp.walk(hp.Scenario(controller=controller, duration=0.005), gait=gait)


@scene
def whole_body() -> None:
    """The whole-body optimum of tasks of one's own, whose first search is long."""
    robot = hp.load_harpy()
    q, v = hp.make_gait(robot).initial_state()
    feet = np.zeros((2, 3))
    tasks = {
        hp.FrameTask(
            "base", part="both", position=q[:3], rotation=np.eye(3), gains=(100.0, 20.0)
        ): 1.0,
        hp.FrameTask("right_foot", acceleration=(30.0, -20.0, 90.0)): 10.0,
        hp.CentreOfMassTask(acceleration=(8.0, -6.0, 1.0)): 5.0,
        hp.JointTask(robot.joints, position=q[7:], gains=(100.0, 20.0)): 0.01,
    }
    solver = hp.WholeBodySolver(robot, tasks)
    for held in ((1, 1), (1, 0)):
        solver.held[:] = held
        solver.solve(hp.State(0.0, q, v + 0.3, feet, feet, feet))


@scene
def environments() -> None:
    """Environments for learning."""
    from harpy_pin.contrib.gym import HarpyVectorEnv

    for shield in (False, True):
        envs = HarpyVectorEnv(3, shield=shield, threads=2)
        envs.reset(seed=0)
        for _ in range(3):
            envs.step(envs.action_space.sample())


@scene
def in_place() -> None:
    """All changes of public arrays in place."""
    from in_place import CASES, change_all

    assert sum(map(change_all, CASES)) > 10_000


@scene
def parts() -> None:
    """Normals of terrains, a task on a force on a slope, and gaits that stand and walk on soles and
    on points.
    """
    for kind in TERRAINS:
        kind.normal([0.1], [0.2])

    def controller(gait: hp.Gait) -> hp.WholeBodyController:
        made = hp.WholeBodyController(gait)
        made.add(hp.FootForceTask("left_foot"), weight=1e-3)
        return made

    walked(make=controller, slope=0.2, duration=0.01)
    if installed_data() is not None:
        robot = hp.load_robot("g1")
        walking = hp.WalkingGait(hp.load_robot("bolt"), velocity=(0.1, 0.0, 0.0))
        for gait in (
            hp.Standing(robot, shift=(0.01, 0.0, 0.0), shift_period=1.0),
            walking,
            hp.WalkingGait(robot),
        ):
            walked(gait, duration=0.01)


@scene
def batches() -> None:
    """Many robots, shields and references at once."""
    robot, rng = hp.load_harpy(), np.random.default_rng(0)
    n, feet = 3, len(robot.feet)
    q0, _ = hp.make_gait(robot).initial_state()
    q = np.array([pin.integrate(robot.model, q0, 0.03 * rng.standard_normal(12)) for _ in range(n)])
    v, force = 0.1 * rng.standard_normal((n, 12)), np.zeros((n, feet, 3))
    force[:, :, 2] = 20.0
    batch = CondensedBatch(robot, n, threads=1)
    batch.step(q, v, force)
    shields = ShieldBatch(robot, n, mu=0.3)
    shields(q, v, force, np.zeros((n, 6)), np.zeros((n, 2, 3)))
    estimator = FrictionEstimator(assumed=0.8)
    for _ in range(20):
        estimator.update(rng.normal(size=(2, 3)) * 20.0, rng.normal(size=(2, 3)), np.ones(2))
    Dynamics(robot).update(q[0], v[0])


@scene
def reduced() -> None:
    """Governors of the reduced-order model, and its simulation."""
    x = np.concatenate((cartesian(0.1, 0.3, 0.5), (0.1, 0.0, 0.05), np.zeros(3)))
    for name in VLIP_GOVERNORS:
        setting = replace(vlip_setting(name), duration=0.02)
        simulate_vlip(vlip_governor(setting, name=name), setting)
    rows = ForceRows(mass=4.0, mu=0.45, min_normal_force=20.0, gains=GAINS)
    erg = hp.ExplicitReferenceGovernor(
        StackedRows([rows, AngleRow()]), alpha_r=1.0, alpha_t=5.0, alpha_n=2.0
    )
    for governor in (
        hp.ExplicitReferenceGovernor(rows, alpha_r=1.0, alpha_t=5.0, alpha_n=2.0),
        MarginGovernor(mass=4.0, mu=0.45, k_p=300.0, k_d=30.0),
    ):
        governor.reset(x[:6])
        for _ in range(3):
            governor.update(x, x[:6] + 0.1, 1e-3)
    erg.reset(x[:6])
    erg.update(x, x[:6] + 0.1, 1e-3)


@scene
def exported() -> None:
    """Ticks as they are exported."""
    for name in (*CONTROLLERS, ESTIMATOR):
        motion = ready(hp.load_harpy(), name, duration=0.01)
        _tick_alone(motion)
    full = hp.WholeBody(parameters={"formulation": "full", "solver": "active_set"})
    _tick_alone(hp.build(hp.Scenario(controller=full, duration=0.01)))
    if installed_data() is not None:
        for law in ({}, {"joint_stiffness": 20.0, "joint_damping": 0.5}):
            robot, part = hp.load_robot("go2"), {"name": "condensed", **law}
            motion = hp.build(
                hp.Scenario(controller=part, duration=0.01), gait=hp.WalkingGait(robot)
            )
            _tick_alone(motion, exportable_walk(motion.controller))


def _tick_alone(motion: Walk, what: Exportable | None = None) -> None:
    what = what or exportable(motion.sensors.estimator if motion.sensors else motion.controller)
    _from_kernels(what, record(motion, what))


@scene
def linkages() -> None:
    """Robots with closed loops of each kind, with the estimator and a task of a frame."""
    folder = Path(mkdtemp())
    made = [
        hp.load_robot("harpy_built"),
        *(ROBOTS[name](folder) for name in ("four_bar", "coupled")),
    ]
    for robot in made:
        gait = hp.WalkingGait(robot)
        scenario = hp.Scenario(controller="condensed", state="estimated", duration=0.002)
        hp.walk(scenario, gait=gait)
        task = hp.wbc.FrameTask(robot.feet[0], part="position")
        controller = hp.make_controller("condensed", hp.WalkingGait(robot), mu=0.5)
        controller.add(task, weight=0.1)
        controller.step(hp.State(0.0, *gait.initial_state(), *np.zeros((3, 2, 3))))


@scene
def pieces() -> None:
    """Kernels that users call by themselves."""
    robot, model = hp.load_harpy(), model_record(mass=4.0, g=9.81, gains=None, law=Law.FULL)
    r, c, zero, out = cartesian(0.1, 0.3, 0.5), cartesian(0.1, 0.3, 0.5), np.zeros(3), np.empty(3)
    g = np.array([0.0, 0.0, -9.81])
    multiplier(r, 4.0, g, zero, 0.0, zero)
    leg_force(r, 4.0, g, zero, 0.0, zero, out)
    axial_force(r, c, zero, model[0], np.empty(6))
    x, w, h, jacobian = np.concatenate((c, zero, zero)), np.zeros(6), np.empty(5), np.empty((5, 6))
    ForceRows(mass=4.0, mu=0.45, gains=GAINS).evaluate(x, w, h, jacobian)
    AngleRow().evaluate(x, w, h[:1], jacobian[:1])
    at = (Dynamics(robot), np.zeros(12), np.eye(3), WholeBodyTargets(robot))
    at[0].update(*hp.make_gait(robot).initial_state())
    CondensedSolver(robot).solve(at[0], at[1], at[3])
    problem = make_problem("input_space", robot)
    problem.build(*at)
    z = np.zeros(len(problem.program.gradient))
    problem.inputs(z, np.empty(robot.n_thrust + 6))
    problem.acceleration(z)
