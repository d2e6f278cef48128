"""Any robot that walks as a Gymnasium environment.

**Action**, each entry within ±1, held for a step of 20 control ticks (20 ms):

- ``action="velocity"``, (3,): velocity command of the robot's walking gait under the scenario's
  controller: forward and to the left in units of the gait's largest velocity, turning in units of 1
  rad/s.
- ``action="joints"``, (joints,): offsets of the joints from the standing posture, in units of 0.5
  rad, in the order of ``robot.joints``. Springs and dampers at the joints follow them at every
  tick, within the motors' torques: at 0.5 rad a spring gives the torque limit, or weight times
  standing height where that is less; a damper has 0.03 s of its spring.

**Observation**, each entry clipped to ±10, of the measured state (with the scenario's noise and
delay, or estimated):

| entries | what | unit |
|---|---|---|
| 1 | height of the body above the ground, less that of standing | 0.1 m |
| 3 | the vertical in the body's axes | |
| 3 | velocity of the body, body axes | m/s |
| 3 | angular velocity, body axes | 3 rad/s |
| joints | joint angles, less those of standing | 0.5 rad |
| joints | joint velocities | 10 rad/s |
| contact points | normal forces; a flat foot has four points | weight |
| 3 or joints | the last action | |
| 3 | velocity that is asked for: forward, to the left, turning | m/s, m/s, rad/s |

**Reward**: :mod:`harpy_pin.contrib.gym.rewards`.

**End**: *terminated* where the robot falls as it does in a run; *truncated* at the scenario's
duration.
"""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.contrib.gym.rewards import Reward, Step, make_reward
from harpy_pin.errors import ControlError, InputError, reason
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.ground.ground import Ground
from harpy_pin.model.robot import Robot, heavier
from harpy_pin.model.source import loaded_robot
from harpy_pin.model.state import GRAVITY, Command, State, Vector
from harpy_pin.scenario import Governed, Scenario
from harpy_pin.scenario import Walking as WalkingPart
from harpy_pin.simulation.sensing import EstimatedState, estimated_state
from harpy_pin.simulation.sensors import ESTIMATED, Sensors

Numbers = NDArray[np.float32]
ACTION_KINDS = ("velocity", "joints")  # what an action is
TICKS = 20  # control ticks of a step
MOST = 10.0  # largest entry of an observation
ANGLE, SPREAD, DAMPING = 0.5, 0.05, 0.03
"""What an action of one does to a joint, rad; how far joints start from the posture at most, rad;
and the dampers in their springs, s.
"""
TURN = 1.0  # what an action of one asks for, rad/s
ASKED = 0.5  # share of the gait's largest velocity, and of 1 rad/s, that is asked for at most


class RobotEnv(gymnasium.Env[Numbers, Numbers]):
    """A robot on two, four or six feet that is to move as it is asked; see
    :mod:`harpy_pin.contrib.gym.robot_env`.

    Args:
        robot: name in the catalogue; or a :class:`~harpy_pin.model.robot.Robot` with two, four or
            six feet. By default the scenario's, or go2 where that is Harpy.
        action: ``velocity`` or ``joints``.
        reward: scales by name, see :mod:`harpy_pin.contrib.gym.rewards`; or a function of the
            :class:`~harpy_pin.contrib.gym.rewards.Step` that returns the reward.
        velocity: (3,) that is asked for in every episode, forward, to the left (m/s), turning
            (rad/s); or (2, 3) ends between which it is drawn. By default it is drawn within half of
            what the gait can do.
        scenario: ground, controller, plant, disturbances, duration, period of the control ticks and
            physics step; ten seconds at friction 0.6 by default. The gait counts for its
            schedule.
        render_mode: none; :attr:`state` goes into the library's own viewers.

    Attributes:
        robot: that walks.
        gait: of the actions ``velocity``.
        desired: (3,) velocity that is asked for in this episode.
        simulator: the plant.

    Raises:
        InputError: a robot that does not walk, an unknown kind of action or term of the reward, or
            a scenario of another robot or with the governed controller.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - as Gymnasium declares it

    def __init__(
        self,
        robot: str | Robot | None = None,
        *,
        action: str = "velocity",
        reward: Reward | None = None,
        velocity: ArrayLike | None = None,
        scenario: Scenario | None = None,
        render_mode: None = None,
    ) -> None:
        checks.one_of("action", action, ACTION_KINDS)
        if scenario is None:
            scenario = Scenario(duration=10.0, ground=Ground(mu_s=0.6))
        self.robot, self.scenario = _checked(scenario, robot)
        s = self.scenario
        schedule = s.gait.schedule if isinstance(s.gait, WalkingPart) else None
        self.gait = WalkingGait(self.robot, schedule)
        self._top = np.array([self.gait.max_speed, self.gait.max_aside, TURN])
        self._ends = _velocity_ends(velocity, ASKED * self._top)
        self._reward = make_reward(reward)
        self._drives = action == "velocity"
        mass_error, actuators = s.disturbances.mass_error, s.disturbances.actuators
        heavy = heavier(self.robot, mass_error) if mass_error else self.robot
        self.simulator = s.plant.make(heavy, s.ground, dt=s.dt, actuators=actuators)
        self._motors = self.simulator._record_["motors"]
        self._substeps = checks.multiple("period", s.period, "physics step", s.dt)
        self._delay = checks.multiple("delay", s.disturbances.delay, "period", s.period, low=0)
        self._surface = s.ground.surface
        self._laid = self.gait if self._surface is None else OnTerrain(self.gait, self._surface)
        self._q, self._v = self._laid.initial_state(penetration=self.simulator.static_penetration)
        self._height = float(self._q[2]) - self._below(self._q)
        self._spring = (
            np.minimum(self.robot.torque_limit, self.robot.mass * GRAVITY * self._height) / ANGLE
        )
        joints = len(self.robot.joints)
        size = 3 if self._drives else joints
        observations = 13 + 2 * joints + len(self.robot.feet) + size
        self.observation_space: gymnasium.Space[Any] = gymnasium.spaces.Box(
            -MOST, MOST, (observations,), np.float32
        )
        self.action_space: gymnasium.Space[Any] = gymnasium.spaces.Box(
            -1.0, 1.0, (size,), np.float32
        )
        self.render_mode = render_mode
        self.desired = np.zeros(3)
        self._last_action = np.zeros(size)
        self._command = Command(np.zeros(joints), np.zeros((len(self.robot.thrusters), 3)))
        self._tick = 0

    @property
    def state(self) -> State:
        """The true state (a copy)."""
        return self.simulator.state

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Stand; with actions of joints, these are drawn within ±0.05 rad of the posture.

        Args:
            seed: of the draws; those of the last seed go on without one.
            options: ``velocity``, (3,), is asked for in this episode.

        Raises:
            InputError: the seed is no whole number, an unknown option, or a velocity that is not
                three finite numbers.
        """
        seed = None if seed is None else checks.whole("seed", seed)
        wishes = {} if options is None else checks.mapping("options", options)
        for name in wishes:
            checks.one_of("option", name, ("velocity",))
        super().reset(seed=seed, options=options)
        self.desired = self.np_random.uniform(*self._ends)
        if "velocity" in wishes:
            self.desired = checks.vector("velocity", wishes["velocity"], 3)
        self.simulator.reset(*self._start())
        self._tick = 0
        self._last_action[:] = 0.0
        if self._drives:
            s = self.scenario
            self.gait.command[:] = 0.0
            self._laid.observe(self.state)
            self._laid.update(0.0)  # its targets are those of the last episode else
            self._controller = s.controller.make(self._laid, mu=s.mu, period=s.period)
        self._sensors = self._make_sensors()
        self._seen = self._measured()
        return self._observe(self._seen), {}

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Twenty control ticks; the episode is over where it terminates or is truncated.

        Returns:
            Observation, reward, terminated, truncated; and ``reward``, what each of its terms adds.

        Raises:
            InputError: the action has the wrong shape, or is not finite.
            ControlError: the controller failed.
        """
        size = len(self._last_action)
        clipped = np.clip(checks.vector("action", action, size), -1.0, 1.0)
        slip = float(self.simulator.slip_path.sum())
        if self._drives:
            self.gait.command[:3] = clipped * self._top
        ending = self._walk(clipped)
        fell, over = (
            ending != "completed",
            self._time >= self.scenario.duration - 0.5 * self.scenario.dt,
        )
        slip = float(self.simulator.slip_path.sum()) - slip
        state = self.state
        done = Step(
            robot=self.robot,
            state=state,
            command=self._command,
            torque=self._command.torque
            if self._command.law is None
            else self._motors["mean_torque"][0].copy(),
            action=clipped,
            last_action=self._last_action.copy(),
            velocity=_heading_velocity(state),
            desired=self.desired,
            standing_height=self._height + self._below(state.q),
            slip=slip,
            fell=fell,
        )
        reward, parts = self._reward(done)
        self._last_action[:] = clipped
        return self._observe(self._seen), reward, fell, over and not fell, {"reward": parts}

    @property
    def _time(self) -> float:
        return self._tick * self.scenario.period

    def _walk(self, action: Vector) -> str:
        """The ticks of a step, until the robot falls: how it ended. The state is measured once at
        each tick.
        """
        s, ending = self.simulator, "completed"
        for _ in range(TICKS):
            if self._drives:
                try:
                    self._command = self._controller.step(self._seen)
                except Exception as error:
                    raise ControlError(
                        f"at t = {s.t:.3f} s the controller failed: {reason(error)}", time=s.t
                    ) from error
            else:
                self._follow_joints(self._seen, action)
            s.advance(self._command, self.scenario.disturbances.pushes, steps=self._substeps)
            self._tick += 1
            s.t = self._time
            self._seen = self._measured()
            ending = s.verdict(0.6 * self._height)
            if ending != "completed":
                break
        return ending

    def _follow_joints(self, measured: State, action: Vector) -> None:
        """Torques of springs and dampers."""
        target = self._q[7:] + ANGLE * action
        torque = self._spring * (target - measured.q[7:] - DAMPING * measured.v[6:])
        limit = self.robot.torque_limit
        self._command.torque[:] = np.clip(torque, -limit, limit)

    def _start(self) -> tuple[Vector, Vector]:
        """A state at rest, the lowest foot as deep in the ground as when standing."""
        q, v = self._q.copy(), self._v.copy()
        v[:6] += np.array(self.scenario.disturbances.start_velocity)
        if not self._drives:
            q[7:] += self.np_random.uniform(-SPREAD, SPREAD, len(q) - 7)
            data = self.robot.model.createData()
            pin.framesForwardKinematics(self.robot.model, data, self.robot.closed(q))
            feet = [data.oMf[self.robot.frame_id(foot)].translation for foot in self.robot.feet]
            q[2] -= (
                min(foot[2] - self._below(foot) for foot in feet)
                + self.simulator.static_penetration
            )
        return q, v

    def _make_sensors(self) -> Sensors | EstimatedState | None:
        """Sensors with a new seed; None where the true state is measured."""
        s, noise = self.scenario, self.scenario.disturbances.noise
        if s.sensors is None and not (noise or self._delay):
            return None
        seed = int(self.np_random.integers(2**31))
        if s.sensors is None:
            return Sensors(self.robot, noise, delay=self._delay, seed=seed)
        how: dict[str, Any] = {
            "controller": self._controller if self._drives else None,
            "seed": seed,
        }
        how |= {"feedback": s.state == ESTIMATED, "period": s.period}
        return estimated_state(self.simulator, self.robot, s.sensors, **how)

    def _below(self, place: Vector) -> float:
        """Height of the ground below a place, m."""
        return 0.0 if self._surface is None else float(self._surface.height(place[0], place[1]))

    def _measured(self) -> State:
        state = self.simulator.state
        return state if self._sensors is None else self._sensors.measure(state)

    def _observe(self, state: State) -> Numbers:
        """The observation; see the top of this module."""
        vertical = _rotation(state)[2]
        weight = self.robot.mass * GRAVITY
        entries = (
            [(state.q[2] - self._below(state.q) - self._height) / 0.1],
            vertical,
            state.v[:3],
            state.v[3:6] / 3.0,
            (state.q[7:] - self._q[7:]) / ANGLE,
            state.v[6:] / 10.0,
            state.foot_force[:, 2] / weight,
            self._last_action,
            self.desired,
        )
        seen = np.nan_to_num(np.concatenate(entries), nan=0.0, posinf=MOST, neginf=-MOST)
        observation: Numbers = np.clip(seen, -MOST, MOST).astype(np.float32)
        return observation


def _rotation(state: State) -> Vector:
    """(3, 3) from the body's axes to the world's."""
    x, y, z, w = state.q[3:7].tolist()
    return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())


def _heading_velocity(state: State) -> Vector:
    """(3,) velocity forward and to the left of the heading, m/s, and about the vertical, rad/s."""
    r = _rotation(state)
    linear, angular = r @ state.v[:3], r @ state.v[3:6]
    heading = np.arctan2(r[1, 0], r[0, 0])
    c, s = np.cos(heading), np.sin(heading)
    return np.array([c * linear[0] + s * linear[1], c * linear[1] - s * linear[0], angular[2]])


def _checked(scenario: Scenario, robot: str | Robot | None) -> tuple[Robot, Scenario]:
    """The robot, and a scenario that it may walk, whose ground fits it."""
    checks.instance("scenario", scenario, Scenario)
    robot = loaded_robot(
        ("go2" if scenario.robot == "harpy" else scenario.robot) if robot is None else robot
    )
    if scenario.robot_name not in ("harpy", robot.name):
        raise InputError(
            f"the scenario is of '{scenario.robot_name}', and the environment of '{robot.name}'",
            name="scenario",
            value=scenario,
        )
    if isinstance(scenario.controller, Governed):
        raise InputError(
            "the governed controller is for Harpy: take 'condensed' or 'wbc'", name="scenario"
        )
    return robot, replace(scenario, ground=scenario.ground.fitted(robot, walks=True))


def _velocity_ends(velocity: ArrayLike | None, usual: Vector) -> tuple[Vector, Vector]:
    """Ends between which the velocity that is asked for is drawn."""
    if velocity is None:
        return -usual, usual
    given = checks.array("velocity", velocity, None)
    ends = checks.vector(
        "velocity", np.stack((given, given)) if given.shape == (3,) else given, (2, 3)
    )
    if np.any(ends[0] > ends[1]):
        raise InputError(
            "the lower end of the velocity is above the upper one", name="velocity", value=velocity
        )
    return ends[0], ends[1]
