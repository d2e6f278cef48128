"""Many robots, each in a world of its own: actions, physics, observations and rewards in one
compiled loop.

**Action** (12,), each entry within ±1:

- 6 offsets of the joints from the standing posture, in units of 0.5 rad, in the order of
  ``robot.joints``: joint targets, at rest, of the motors' own law
  (:class:`~harpy_pin.model.state.Command`; 400 N·m/rad, 3 N·m·s/rad).
- 6 thrusts (two thrusters, each x, y, z in the body's axes), in units of half the robot's weight,
  within the thrusters' limit.

With a shield, torques and thrusts pass :class:`harpy_pin.contrib.shield.Shield` at every physics
step.

**Observation** (39,), each entry clipped to ±10:

| entries | what | unit |
|---|---|---|
| 0 | height of the body, less that of standing | 0.1 m |
| 1–3 | the vertical in the body's axes | |
| 4, 5 | direction of the body's x axis in the world, along x and y | |
| 6–8 | velocity of the body, body axes | m/s |
| 9–11 | angular velocity, body axes | 3 rad/s |
| 12–17 | joint angles, less those of standing | 0.5 rad |
| 18–23 | joint velocities | 10 rad/s |
| 24, 25 | normal forces of the feet | weight |
| 26–37 | the last action | |
| 38 | speed that is asked for | m/s |

**Reward** of a step: exp(−((ẋ − v)² + ẏ²) / (0.25 m/s)²) − 0.1 \\|thrusts\\|² / weight², with v the
speed that is asked for, ẋ and ẏ the body's velocity at the end of the step in the world, and the
thrusts those of the action.

**End**: *terminated* where the robot falls as it does in a run (body below 60 % of its height at
the start, or tilted by more than 60°, or speeds beyond reason); *truncated* at the scenario's
duration.
"""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.shield import LimitsRecord, within_limits
from harpy_pin.contrib.threads import Threads
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.straight import make_gait
from harpy_pin.governors.contact_force_filter import ContactForceFilter
from harpy_pin.governors.contact_force_kernels import ContactForceFilterRecord, hold_forces
from harpy_pin.governors.contact_force_parameters import ContactForceFilterParameters
from harpy_pin.ground.ground import Ground, GroundRecord
from harpy_pin.kernels import kernel
from harpy_pin.log.slip import forget_slip
from harpy_pin.model.contact_map import ContactMapRecord
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.loading import load_harpy
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, make_record
from harpy_pin.model.robot import heavier
from harpy_pin.model.state import GRAVITY, State, Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.scenario import Compliant, Scenario, Straight
from harpy_pin.simulation.push import push_forces
from harpy_pin.simulation.simulator import Simulator
from harpy_pin.simulation.step import StepRecord, physics_steps, upright

ACTIONS, OBSERVATIONS = 12, 39
MOST = 10.0  # largest entry of an observation
SPRING, DAMPER = 400.0, 3.0  # stiffness and damping of the joints, N·m/rad and N·m·s/rad
ANGLE, SPREAD = 0.5, 0.05
"""What an action of one does to a joint, and how far joints start from the posture at most, rad."""
THRUST = 0.5  # what an action of one is, in weights of the robot
TOLERANCE, EFFORT = 0.25, 0.1  # width of the reward of velocity, m/s, and the price of thrust


def default_scenario() -> Scenario:
    """Ten seconds at 0.3 m/s on friction 0.6, an action every 5 ms, physics at 1 ms."""
    return Scenario(duration=10.0, period=5e-3, dt=1e-3, ground=Ground(mu_s=0.6))


class SettingsRecord(LimitsRecord):
    """What the kernels know of the robot and the task."""

    posture: Vector  # (joints,) rad
    height: float  # of the base at the start, m
    weight: float  # of the robot, N
    speed: float  # desired along x, m/s
    shield: int  # 1 where commands pass a shield


@fixed_arrays("fallen", "observation", "q", "reward", "t", "v")
class BatchedEnv(KeepsViews):
    """n copies of a scenario's robot on its ground.

    Of the scenario, robot, mass error, ground, start velocity, pushes, period, step, duration and
    the speed count; the rest of the gait, and the controller, are the learner's business. With a
    ``shield``, which knows the ground's friction, commands pass it. At most ``threads`` step at a
    time, by default one for each core.

    An :class:`InputError` refuses an n that is no positive integer, and a scenario with another
    engine, sensors, noise, delay or other actuators, which are not here.
    """

    n = property(attrgetter("_n"))

    @checked
    def __init__(
        self,
        n: int,
        scenario: Scenario | None = None,
        *,
        shield: bool = False,
        threads: int | None = None,
    ) -> None:
        self.scenario = s = scenario if scenario is not None else default_scenario()
        self._n = n = checks.whole("num_envs", n, low=1, high=checks.MAX_TICKS)
        disturbances = s.disturbances
        signals = disturbances.noise or disturbances.delay or disturbances.actuators or s.sensors
        if (
            not isinstance(s.plant, Compliant)
            or signals
            or s.robot != "harpy"
            or s.ground.surface is not None
        ):
            raise InputError(
                "an environment has Harpy in the library's own plant, without sensors, "
                "noise, delay or actuators, "
                "on flat ground: put a wrapper around it",
                name="scenario",
                value=s,
            )
        if not isinstance(s.gait, Straight):
            raise InputError(
                f"an environment rewards a speed along x, which the gait '{s.gait.name}' "
                f"lacks: give Straight",
                name="scenario",
                value=s,
            )
        mass_error = disturbances.mass_error
        self.robot = (
            heavier(load_harpy(s.urdf), mass_error) if mass_error != 0.0 else load_harpy(s.urdf)
        )
        simulator = Simulator(self.robot, s.ground, dt=s.dt)
        self._start = make_gait(self.robot, speed=0.0, stiffness=s.stiffness).initial_state(
            penetration=simulator.static_penetration
        )
        self._start[1][:6] += np.array(disturbances.start_velocity)
        self._settings = make_record(
            SettingsRecord,
            posture=self._start[0][7:],
            height=self._start[0][2],
            weight=self.robot.mass * GRAVITY,
            torque_limit=self.robot.torque_limit,
            thrust_limit=self.robot.thrust_limit,
            speed=s.gait.speed,
            shield=shield,
        )
        governor = ContactForceFilter(
            self.robot, ContactForceFilterParameters(mu=s.mu), period=s.dt
        )
        parts = (simulator.dynamics._record_, simulator._record_, governor.terms, governor._record_)
        self._ground = s.ground.record
        self._dynamics, self._step, self._terms, self._governor = (
            np.repeat(part, n) for part in parts
        )
        self._steps = checks.multiple("period", s.period, "physics step", s.dt)
        # (n, nq) and (n, nv)
        self.q, self.v = (np.tile(array, (n, 1)).copy() for array in self._start)
        self.t = np.zeros(n)
        self.observation, self.reward = np.zeros((n, OBSERVATIONS)), np.zeros(n)  # of the last step
        self.fallen = np.zeros(n, dtype=np.bool_)
        self._no_action, self._no_push = np.zeros(ACTIONS), np.zeros((n, self._steps, 3))
        self._threads = Threads(n, threads)
        _step_worlds.prepare(
            0, n, *self._arguments(np.zeros((n, ACTIONS)), self._no_push, self.fallen)
        )
        for i in range(n):
            self.reset(i, np.random.default_rng(i))

    def _arguments(
        self, action: Vector, push: Vector, idle: NDArray[np.bool_]
    ) -> tuple[Any, Any, Any]:
        """Records, arrays and results of a step, for the kernel."""
        records = (
            self._dynamics,
            self._ground,
            self._step,
            self._terms,
            self._governor,
            self._settings,
        )
        return (
            records,
            (self.q, self.v, action, push, idle),
            (self.observation, self.reward, self.fallen),
        )

    def reset(self, i: int, random: np.random.Generator) -> None:
        """Stand robot i at the start, its joints drawn within ±0.05 rad of the posture, by six
        numbers.
        """
        i, (q, v) = checks.whole("i", i, high=self.n - 1), self._start
        self.q[i], self.v[i], self.t[i] = q, v, 0.0
        self.q[i, 7:] += random.uniform(-SPREAD, SPREAD, len(q) - 7)
        self.fallen[i] = False
        worlds = (self._dynamics[i : i + 1], self._step[i : i + 1], self._governor[i : i + 1])
        _begin(*worlds, self._settings, self.q[i], self.v[i], self._no_action, self.observation[i])

    def step(self, action: ArrayLike, idle: NDArray[np.bool_]) -> None:
        """One period: apply the action, step the physics, observe and compute the reward.

        The action, (n, 12), is clipped to ±1; one of another shape, or not finite, is an
        :class:`InputError`. Worlds that are ``idle``, (n,), stay as they are.
        """
        clipped = np.clip(checks.vector("action", action, (self.n, ACTIONS)), -1.0, 1.0)
        if not (
            isinstance(idle, np.ndarray) and idle.dtype == np.bool_ and idle.shape == (self.n,)
        ):
            raise InputError(
                f"idle must be {self.n} truth values, got {shown(idle)}", name="idle", value=idle
            )
        push = self._push_forces() if self.scenario.disturbances.pushes else self._no_push
        arguments = self._arguments(clipped, push, idle)
        self._threads.run(lambda _, begin, end: _step_worlds(begin, end, *arguments))
        self.t[~idle] += self.scenario.period

    def truncated(self) -> NDArray[np.bool_]:
        """(n,) whether the scenario's duration is over."""
        over: NDArray[np.bool_] = self.t >= self.scenario.duration - 0.5 * self.scenario.dt
        return over

    def state(self, i: int) -> State:
        """The true state of world i (a copy)."""
        d, force = self._dynamics[i], self._step[i]["force"].reshape(-1, 3)
        feet = (d["foot_position"].copy(), d["foot_velocity"].copy(), force.copy())
        return State(float(self.t[i]), self.q[i].copy(), self.v[i].copy(), *feet)

    def close(self) -> None:
        """End the threads."""
        self._threads.close()

    def _push_forces(self) -> Vector:
        """(n, steps, 3) mean force of the pushes over each of the coming steps, world axes, N."""
        pushes, dt = self.scenario.disturbances.pushes, self.scenario.dt
        return np.array([push_forces(pushes, t, dt, self._steps) for t in self.t])


@kernel
def _begin(
    d: DynamicsRecord,
    s: StepRecord,
    governor: ContactForceFilterRecord,
    p: SettingsRecord,
    q: Vector,
    v: Vector,
    action: Vector,
    observation: Vector,
) -> None:
    """Forget contact, slip and shield, and observe."""
    update_terms(d, q, v)
    s.force[:] = 0.0
    s.counts[:] = 0
    forget_slip(s.slip, d.foot_position)
    governor.bend[:] = 0.0
    _observe(d, s, p, q, v, action, observation)


@kernel(release=True)
def _step_worlds(
    begin: int,
    end: int,
    records: tuple[
        Records[DynamicsRecord],
        Records[GroundRecord],
        Records[StepRecord],
        Records[ContactMapRecord],
        Records[ContactForceFilterRecord],
        Records[SettingsRecord],
    ],
    given: tuple[Vector, Vector, Vector, Vector, NDArray[np.bool_]],
    results: tuple[Vector, Vector, NDArray[np.bool_]],
) -> None:
    """One period of the worlds from ``begin`` to ``end``."""
    dynamics, ground, step, terms, governor, settings = records
    q, v, action, push, idle = given
    observation, reward, fallen = results
    p = settings[0]
    torque, thrust = np.empty(p.posture.shape[0]), np.empty((2, 3))
    for i in range(begin, end):
        if idle[i]:
            continue
        a = action[i]
        for n in range(push.shape[1]):
            _command(dynamics[i], p, q[i], v[i], a, torque, thrust)
            within_limits(p, torque, thrust)
            if p.shield:
                force = step[i].force.reshape((2, 3))
                hold_forces(dynamics[i], terms[i], governor[i], v[i], force, torque, thrust)
                within_limits(p, torque, thrust)
            one = push[i, n : n + 1]
            physics_steps(dynamics[i], ground[0], step[i], q[i], v[i], torque, thrust, one)
        fallen[i] = upright(q[i], v[i], 0.6 * p.height) != 0
        reward[i] = _reward(dynamics[i], p, v[i], a)
        _observe(dynamics[i], step[i], p, q[i], v[i], a, observation[i])


@kernel
def _command(
    d: DynamicsRecord,
    p: SettingsRecord,
    q: Vector,
    v: Vector,
    a: Vector,
    torque: Vector,
    thrust: Vector,
) -> None:
    """Torques of springs that follow the action, and its thrusts in world axes."""
    joints = torque.shape[0]
    torque[:] = SPRING * (p.posture + ANGLE * a[:joints] - q[7:]) - DAMPER * v[6:]
    share = a[joints : joints + 6].reshape((2, 3))
    thrust[:] = (THRUST * p.weight * share) @ d.tree.rotation.T


@kernel
def _reward(d: DynamicsRecord, p: SettingsRecord, v: Vector, a: Vector) -> float:
    """The reward; zero where the velocity is not finite."""
    error, thrusts = d.tree.rotation[:2] @ v[:3], a[p.posture.shape[0] :]
    error[0] -= p.speed
    cost = EFFORT * THRUST * THRUST * (thrusts @ thrusts)
    reward = float(np.exp(-(error @ error) / (TOLERANCE * TOLERANCE)) - cost)
    return reward if np.isfinite(reward) else 0.0


@kernel
def _observe(
    d: DynamicsRecord,
    s: StepRecord,
    p: SettingsRecord,
    q: Vector,
    v: Vector,
    a: Vector,
    out: Vector,
) -> None:
    """The observation; see the top of this module."""
    r, joints = d.tree.rotation, p.posture.shape[0]
    of_feet = 12 + 2 * joints
    out[0] = (q[2] - p.height) / 0.1
    out[1:4] = r[2]
    out[4:6] = r[:2, 0]
    out[6:9] = v[:3]
    out[9:12] = v[3:6] / 3.0
    out[12 : 12 + joints] = (q[7:] - p.posture) / ANGLE
    out[12 + joints : of_feet] = v[6:] / 10.0
    out[of_feet : of_feet + 2] = s.force.reshape((2, 3))[:, 2] / p.weight
    out[of_feet + 2 : of_feet + 2 + a.shape[0]] = a
    out[of_feet + 2 + a.shape[0]] = p.speed
    out[:] = np.where(np.isfinite(out), np.clip(out, -MOST, MOST), 0.0)
