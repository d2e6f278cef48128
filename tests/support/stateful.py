"""Every public object that keeps arrays between calls, with something that it answers when it is
used.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from walks import own_search

import harpy_pin as hp
from harpy_pin import controllers
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.gym.batched_env import BatchedEnv
from harpy_pin.contrib.shield import Shield
from harpy_pin.contrib.shield_batch import ShieldBatch
from harpy_pin.controllers.governed import FrictionEstimator
from harpy_pin.governors import ForceRows

ROBOT = hp.load_harpy()
Q, V = hp.make_gait(ROBOT).initial_state(penetration=0.003)
LEVEL = hp.make_gait(ROBOT, speed=0.0).initial_state()[0][7:]
STATE = hp.Simulator(ROBOT)
STATE.reset(Q, V)
SAMPLE = STATE.state
FORCE = SAMPLE.foot_force
REFERENCE = np.array([0.02, 0.01, 0.6, 0.3, 0.0, 0.0])


def _follow(gait: Any, ticks: int = 5) -> list[np.ndarray]:
    """Targets of some ticks."""
    answers = []
    for k in range(ticks):
        if hasattr(gait, "observe"):
            gait.observe(SAMPLE)
        target = gait.update(0.3 + 0.01 * k)
        answers += [target.body.copy(), target.foot_position.copy(), np.array(target.stance)]
    return answers


def _control(controller: Any, ticks: int = 5) -> list[np.ndarray]:
    """Commands of some ticks."""
    answers = []
    for k in range(ticks):
        t = SAMPLE.t + 1e-3 * k
        state = hp.State(
            t, SAMPLE.q, SAMPLE.v + 0.01 * k, SAMPLE.foot_position, SAMPLE.foot_velocity, FORCE
        )
        command = controller.step(state)
        answers += [command.torque.copy(), command.thrust.copy()]
    return answers


def _filter(made: Any, ticks: int = 5) -> list[np.ndarray]:
    answers = []
    for k in range(ticks):
        command = made.update(SAMPLE, hp.Command(np.full(6, 2.0 * k), np.full((2, 3), 5.0)))
        answers += [command.torque.copy(), command.thrust.copy()]
    return answers


def _simulate(plant: Any, steps: int = 5) -> list[np.ndarray]:
    for _ in range(steps):
        plant.advance(hp.Command(np.full(6, 1.0), np.zeros((2, 3))))
    return [plant.q.copy(), plant.v.copy(), plant.state.foot_force.copy(), plant.slip_path.copy()]


def _started(plant: Any) -> Any:
    plant.reset(Q, V)
    return plant


def _bend(governor: Any) -> list[np.ndarray]:
    x = np.concatenate([Q[:3], V[:3], np.zeros(3)])
    return [governor.update(x, REFERENCE + 0.01 * k, 1e-3).copy() for k in range(5)]


def _shield(shield: Any) -> list[np.ndarray]:
    answers = []
    for k in range(5):
        command, report = shield(SAMPLE, hp.Command(np.full(6, 3.0 * k), np.full((2, 3), 4.0)))
        answers += [command.torque.copy(), command.thrust.copy(), np.array(report.safe)]
    return answers


def _batch(batch: Any) -> list[np.ndarray]:
    n = batch.n
    force = np.tile(np.array([0.0, 0.0, 30.0]), (n, 2, 1))
    for k in range(3):
        batch.step(np.tile(Q, (n, 1)), np.tile(V + 0.01 * k, (n, 1)), force)
    return [batch.torque.copy(), batch.thrust.copy(), batch.status.copy()]


def _shield_batch(batch: Any) -> list[np.ndarray]:
    n = batch.n
    force = np.tile(np.array([0.0, 0.0, 30.0]), (n, 2, 1))
    states = (np.tile(Q, (n, 1)), np.tile(V, (n, 1)), force)
    torque, thrust, report = batch(*states, np.full((n, 6), 3.0), np.full((n, 2, 3), 4.0))
    return [torque, thrust, report.after]


def _estimate(made: Any) -> list[np.ndarray]:
    force, held = np.array([[5.0, 0.0, 50.0]] * 2), np.ones(2)
    for k in range(20):
        made.update(force, np.array([[0.01 * k, 0.0, 0.0], [0.0, 0.0, 0.0]]), held)
    return [made.estimate.copy()]


def _dynamics(made: Any) -> list[np.ndarray]:
    made.update(Q, V)
    return [made.mass_matrix.copy(), made.bias.copy(), made.foot_jacobian.copy()]


def _act(worlds: Any) -> list[np.ndarray]:
    for _ in range(3):
        worlds.step(np.full((worlds.n, 12), 0.2), np.zeros(worlds.n, dtype=np.bool_))
    return [worlds.observation.copy(), worlds.reward.copy(), worlds.q.copy()]


def _measure(sensors: Any) -> list[np.ndarray]:
    return [
        array
        for _ in range(4)
        for array in (lambda s: (s.q, s.v, s.foot_force))(sensors.measure(SAMPLE))
    ]


def assert_equal(name: str, answer: Any, wanted: Any) -> None:
    """Two answers of a case have the same digits; but for those of ProxQP, which depend on where
    its memory lies.
    """
    if "ProxQP" in name:
        np.testing.assert_allclose(answer, wanted, rtol=0, atol=1e-6)
    else:
        np.testing.assert_array_equal(answer, wanted)


Case = tuple[Callable[[], Any], Callable[[Any], list[np.ndarray]]]


def _walker(name: str, **more: Any) -> Case:
    return lambda: hp.make_controller(name, hp.make_gait(ROBOT), mu=0.4, **more), _control


CASES: dict[str, Case] = {
    "Simulator": (lambda: _started(hp.Simulator(ROBOT)), _simulate),
    "CondensedController": _walker("condensed"),
    "WholeBodyController": _walker("wbc", solver="active_set"),
    "WholeBodyController, ProxQP": _walker("wbc"),
    "estimating": _walker("condensed", estimate_friction=True, estimate_joint_friction=True),
    **{
        f"{name}, lag": _walker(name, thrust_lag=0.1, **own_search(name))
        for name in ("condensed", "wbc")
    },
    **{f"governed, {name}": _walker("governed", governor=name) for name in controllers.GOVERNORS},
    "StraightGait": (lambda: hp.make_gait(ROBOT), _follow),
    "CommandedGait": (lambda: hp.make_commanded_gait(ROBOT, [(0.0, 0.2, 0.1, 0.3)]), _follow),
    "WalkingGait": (
        lambda: hp.WalkingGait(ROBOT, velocity=(0.2, 0.1, 0.3), posture=LEVEL),
        _follow,
    ),
    "ContactForceFilter": (lambda: hp.ContactForceFilter(ROBOT), _filter),
    "ExplicitReferenceGovernor": (
        lambda: hp.ExplicitReferenceGovernor(ForceRows(mass=ROBOT.mass, mu=0.2)),
        _bend,
    ),
}


def _with_task() -> Any:
    made = hp.make_controller("wbc", hp.make_gait(ROBOT), mu=0.4, solver="daqp")
    made.add(hp.wbc.MomentumTask(part="angular", momentum=np.zeros(3), gain=5.0), weight=0.1)
    return made


CASES |= {
    "wbc, own task": (_with_task, _control),
    "Shield": (lambda: Shield(ROBOT, mu=0.3), _shield),
    "ShieldBatch": (lambda: ShieldBatch(ROBOT, 3, mu=[0.2, 0.3, 0.4]), _shield_batch),
    "CondensedBatch": (lambda: CondensedBatch(ROBOT, 300, threads=2), _batch),
    "FrictionEstimator": (lambda: FrictionEstimator(assumed=0.6), _estimate),
    "Dynamics": (lambda: hp.Dynamics(ROBOT), _dynamics),
    "Sensors": (lambda: hp.simulation.Sensors(ROBOT, hp.Noise.typical(), delay=2), _measure),
    "BatchedEnv": (lambda: BatchedEnv(150, threads=2), _act),
}


def holders(made: Any, seen: set[int]) -> Iterator[Any]:
    """An object and all objects of the library that it leads to."""
    if id(made) in seen:
        return
    seen.add(id(made))
    if isinstance(made, list | tuple):
        parts = list(made)
    elif isinstance(made, dict):
        parts = list(made.values())
    elif type(made).__module__.startswith("harpy_pin") and not isinstance(made, np.ndarray):
        yield made
        parts = [
            getattr(made, name, None)
            for kind in type(made).__mro__
            for name in getattr(kind, "__slots__", ())
        ]
        parts += list(getattr(made, "__dict__", {}).values())
    else:
        return
    for part in parts:
        yield from holders(part, seen)
