"""One walk in a world: what a controller knows and commands at every step of MuJoCo, and what is
measured of it.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np

from comparison.joint_pd.controller import JointPD, JointPDGains, found_gains
from comparison.peers.environment import default_folder
from comparison.worlds.hung import identified
from comparison.worlds.models import JOINTS, knowing, strip, world
from comparison.worlds.policy import PERIOD, Policy
from harpy_pin import (
    Command,
    MujocoBridge,
    Noise,
    Robot,
    Standing,
    State,
    WalkingGait,
    make_controller,
)
from harpy_pin.contrib.drift import off
from harpy_pin.errors import ControlError
from harpy_pin.estimation import Estimator, Imu
from harpy_pin.model import GRAVITY
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import import_mujoco
from harpy_pin.simulation.sensing import Sensing
from harpy_pin.simulation.sensors import Sensors

PD_GAINS = "go1"
"""Whose gains joint PD has: of the default ones, Go1's and Go2's those that slip least on seeds 0
to 3.
"""
SOLE_GAINS = JointPDGains(swing_p=4.0)
"""And on soles: of ten sets those that fell in none of three walks of Unitree's G1, of seed 2000,
and slipped least.
"""
PUSH = 0.1
"""Duration, s."""
DELAY = 3e-3
"""Of the sensors, with noise, rounded up to whole steps, s."""
LAW = (1.0, 0.3)
"""Stiffness and damping of the motors, in the units of
:class:`harpy_pin.controllers.WholeBodyParameters`.
"""
LAW_CONTACT_DAMPING = 20.0
"""Of a stance foot's velocity where motors hold the legs, too, 1/s."""
LOWEST, UPRIGHT = 0.55, 0.5
"""Share of the first height, and cosine of the tilt, below which the robot fell."""
EDGE = 0.02
"""Time after its touchdown and before it leaves the ground in which a foot lands and lifts, s; a
shorter break of a contact is a bounce.
"""
SHIFT, SHIFT_PERIOD = 0.5, 2.0
"""A robot that stands shifts its weight so far of the way above two of its feet, and back in so
many seconds.
"""


@dataclass(frozen=True, kw_only=True)
class Contender:
    """What walks.

    Attributes:
        controller: condensed, wbc, joint_pd, policy; or stand, the condensed WBC that stands.
        known: what it knows of the joints.
        law: stiffness and damping of the motors about the WBCs' joint targets.
        learning: rate at which the WBCs learn what joints lack whose targets motors hold, 1/s.
        contact_damping: of the WBCs, 1/s; None for the gait's.
        round: whether it is told that feet are spheres: the ground is one radius lower.
        estimate: whether it estimates the friction in the joints.
        identified: whether it knows of the joints what a log of the hung-up robot says.
        sensed: whether it knows only what an inertial unit, encoders and motor torques say.
    """

    controller: str = "condensed"
    known: tuple[str, ...] = ()
    law: tuple[float, float] = (0.0, 0.0)
    learning: float = 1.0
    contact_damping: float | None = None
    round: bool = True
    estimate: bool = False
    identified: bool = False
    sensed: bool = False


MOTOR_LAW: dict[str, Any] = {"law": LAW, "contact_damping": LAW_CONTACT_DAMPING}
POLICY, STANDS = "policy", "stands"
WALKERS = {
    "joint PD": Contender(controller="joint_pd"),
    "joint PD, joints known": Contender(controller="joint_pd", known=JOINTS),
    "torque alone": Contender(),
    "joints known": Contender(known=JOINTS),
    "joints identified": Contender(known=JOINTS, identified=True),
    "motor law": Contender(**MOTOR_LAW),
    "motor law, joints known": Contender(known=JOINTS, **MOTOR_LAW),
    "QP, torque alone": Contender(controller="wbc"),
    "QP, motor law": Contender(controller="wbc", **MOTOR_LAW),
    POLICY: Contender(controller="policy"),
    STANDS: Contender(controller="stand", known=JOINTS, **MOTOR_LAW),
}
"""By name; those without another one are the condensed WBC, and ``QP`` is the whole-body QP by own
search.
"""


class MotorPD:
    """Joint PD whose stiffness and damping are in the motors, which evaluate them at every step
    without a delay.
    """

    def __init__(self, gait: WalkingGait, *, mu: float, period: float) -> None:
        self._gait, of_points = gait, found_gains()[PD_GAINS]["gains"]
        gains = SOLE_GAINS if gait.robot.flat_feet else JointPDGains(**of_points)
        self._inner = JointPD(gait, gains, mu=mu, period=period)
        record = self._inner._record
        pairs = ("swing_p", "stance_p"), ("swing_d", "stance_d")
        values = np.array([[float(record[name][0]) for name in pair] for pair in pairs])
        self._gains = values[:, :, None] * record["share"][0]
        for name in (*pairs[0], *pairs[1]):
            record[name] = 0.0

    def step(self, state: State) -> Command:
        """Torques that are fed forward, and the motors' targets."""
        torque, inner = self._inner.step(state).torque, self._inner._record
        stance = np.append(self._gait.target.stance[:: int(inner["corners"][0])], 1.0)[
            inner["leg"][0]
        ]
        k_p, k_d = np.where(stance > 0.0, self._gains[:, 1], self._gains[:, 0])
        return Command(torque, q=inner["planned"][0][7:], v=inner["speed"][0][6:], k_p=k_p, k_d=k_d)


class Walker:
    """A controller in a world.

    Args:
        who: what it is.
        model: ``mujoco.MjModel``.
        robot: of it, with all of its joints known.
        friction: of the ground.
        seed: of the sensors' noise; None for true states.

    Attributes:
        bridge: between controller and MuJoCo.
    """

    def __init__(
        self, who: Contender, model: Any, robot: Robot, friction: float, seed: int | None = None
    ) -> None:
        robot, period = knowing(robot, who.known), float(model.opt.timestep)
        self.bridge = MujocoBridge(model, robot)
        self._radius = float(self.bridge.foot_radius.mean())
        # by how much the world is lower than the controller's
        self._lower = self._radius if who.round else 0.0
        self.gait: Any = WalkingGait(robot)
        if who.controller == "stand":
            left = range(0, len(robot.corners), 2)
            self.gait = Standing(
                robot, shift=SHIFT * Standing(robot).over(*left), shift_period=SHIFT_PERIOD
            )
        if who.controller == "joint_pd":
            self.controller: Any = MotorPD(self.gait, mu=friction, period=period)
        else:
            how: dict[str, Any] = dict(
                zip(("joint_stiffness", "joint_damping"), who.law, strict=True)
            )
            how |= {} if who.contact_damping is None else {"contact_damping": who.contact_damping}
            how |= {
                "joint_learning": who.learning,
                "estimate_joint_friction": who.estimate,
                "mu": friction,
                "period": period,
            }
            kind = "wbc" if who.controller == "wbc" else "condensed"
            how |= {"solver": "active_set"} if kind == "wbc" else {}
            self.controller = make_controller(kind, self.gait, **how)
        late = -int(-DELAY // period)
        self._sensors = (
            None
            if seed is None or who.sensed
            else Sensors(robot, Noise.typical(), delay=late, seed=seed)
        )
        self.estimator: Estimator | None = None
        self.trace: list[
            tuple[Vector, ...]
        ] = []  # true and estimated configurations and velocities, and the torques that are felt
        if who.sensed:
            self._sensing = Sensing(robot, Imu(), period=period, seed=0 if seed is None else seed)
            self.estimator = Estimator(
                robot, Imu(), period=period, foot_radius=self.bridge.foot_radius
            )

    def place(self, data: Any) -> None:
        """Put the robot on the ground, at rest."""
        q, v = self.gait.initial_state()
        q[2] += self._radius
        feet = np.zeros((len(self.bridge.foot_radius), 3))
        self.bridge.place(State(0.0, q, v, feet, feet, feet), data)
        import_mujoco().mj_forward(self.bridge.model, data)
        if self.estimator is not None:
            q[2] -= self._lower
            self.estimator.reset(q, v)

    def act(self, data: Any, command: Vector) -> None:
        """Write the commands of a tick into MuJoCo's data."""
        state = self.bridge.read(data)
        state.q[2] -= self._lower
        state.foot_position[:, 2] -= self._lower
        if self.estimator is not None:
            readings = self._sensing.read(state, data.qfrc_actuator[self.bridge.velocity])
            true, state = (
                state,
                self.estimator.step(
                    readings, self.controller.target, getattr(self.controller, "acceleration", None)
                ),
            )
            path = true.q, true.v, state.q.copy(), state.v.copy()
            self.trace.append((*path, readings.joint_torque))
        if self._sensors is not None:
            state = self._sensors.measure(state)
        if isinstance(self.gait, WalkingGait):
            self.gait.command[:3] = command
        self.bridge.write(self.controller.step(state), data)


class Watch:
    """Sums over a walk; :meth:`look` after every step of MuJoCo."""

    def __init__(self, bridge: MujocoBridge, data: Any) -> None:
        model = bridge.model
        link = bridge._record["link"][0]
        self._model, self._data, self._joints = model, data, bridge.velocity
        self._foot = np.where(link.any(axis=1), link.argmax(axis=1), -1).tolist()
        self.body = int(model.jnt_bodyid[bridge.free])
        self._height = float(data.xpos[self.body, 2])
        self._velocity = np.zeros(6)  # of the body, rotation first, axes of the body
        self.slip = self.landing = self.lifting = self.energy = self.path = self.time = (
            self.error
        ) = 0.0
        self._slips: dict[
            int, list[float]
        ] = {}  # of each foot's present contact, step by step, m/s
        self._away = dict[int, int]()  # steps since its last touch
        self.fell = False

    def look(self, command: Vector) -> None:
        """Take up the state at which the last step began, its forces, and what is commanded."""
        mujoco, data, dt = import_mujoco(), self._data, float(self._model.opt.timestep)
        speed = sliding(self._model, data, self._foot)
        self.slip += dt * sum(speed.values())
        self._note_contacts(speed, dt)
        torque = data.qfrc_actuator[self._joints] + data.qfrc_applied[self._joints]
        self.energy += dt * sum(
            power for power in (torque * data.qvel[self._joints]).tolist() if power > 0.0
        )
        turned, (forward, leftward) = data.xmat[self.body].tolist(), command[:2].tolist()
        mujoco.mj_objectVelocity(
            self._model, data, mujoco.mjtObj.mjOBJ_XBODY, self.body, self._velocity, 0
        )
        length, (x, y) = hypot(turned[0], turned[3]), self._velocity[3:5].tolist()
        ahead, aside = (
            (x * turned[0] + y * turned[3]) / length,
            (y * turned[0] - x * turned[3]) / length,
        )
        self.path += dt * hypot(x, y)
        self.error += dt * ((ahead - forward) ** 2 + (aside - leftward) ** 2)
        self.time += dt
        # MuJoCo does so where numbers are no longer finite
        began_anew = data.time < self.time - 0.5 * dt
        self.fell = bool(
            began_anew or data.xpos[self.body, 2] < LOWEST * self._height or turned[8] < UPRIGHT
        )

    def _note_contacts(self, speed: dict[int, float], dt: float) -> None:
        """Of each contact that has ended, the slip at its beginning and at its end."""
        for foot, here in speed.items():
            slips = self._slips.setdefault(foot, [])
            slips += [0.0] * self._away.get(foot, 0)
            slips.append(here)
            self._away[foot] = 0
        edge = round(EDGE / dt)
        for foot in [foot for foot in self._slips if foot not in speed]:
            self._away[foot] += 1
            if self._away[foot] > edge:
                slips = self._slips.pop(foot)
                steps = min(edge, len(slips) // 2)
                self.landing += dt * sum(slips[:steps])
                self.lifting += dt * sum(slips[len(slips) - steps :])
                self._away[foot] = 0

    def measures(self) -> dict[str, Any]:
        """Of the walk so far."""
        weight = GRAVITY * float(self._model.body_subtreemass[self.body])
        return {
            "fell": self.fell,
            "stood_s": self.time,
            "slip_mm_s": 1e3 * self.slip / self.time,
            "landing_mm_s": 1e3 * self.landing / self.time,
            "lifting_mm_s": 1e3 * self.lifting / self.time,
            "error_m_s": float(np.sqrt(self.error / self.time)),
            "cost_of_transport": self.energy / (weight * self.path),
        }


def sliding(model: Any, data: Any, foot: Sequence[int]) -> dict[int, float]:
    """Speed along the level ground of what touches it, m/s, of every foot in contact. A foot that
    rolls does not slide.

    Args:
        model: ``mujoco.MjModel``.
        data: ``mujoco.MjData``.
        foot: (geoms,) number of each geom's foot; −1 for none.
    """
    mujoco, speed = import_mujoco(), dict[int, float]()
    force, velocity = np.zeros(6), np.zeros(6)
    if data.ncon == 0:
        return speed
    for k, (pair, point) in enumerate(
        zip(data.contact.geom.tolist(), data.contact.pos.tolist(), strict=True)
    ):
        geom = pair[0] if foot[pair[0]] >= 0 else pair[1]
        if foot[geom] < 0:
            continue
        mujoco.mj_contactForce(model, data, k, force)
        if force.item(0) <= 0.0:
            continue
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocity, 0)
        p, q, r, vx, vy, _ = velocity.tolist()
        x, y, z = (
            at - middle for at, middle in zip(point, data.geom_xpos[geom].tolist(), strict=True)
        )
        here = hypot(vx + q * z - r * y, vy + r * x - p * z)
        speed[foot[geom]] = max(here, speed.get(foot[geom], 0.0))
    return speed


def followed(
    job: dict[str, Any],
    bridge: MujocoBridge,
    data: Any,
    act: Callable[[Any, Vector], None],
    every: int = 1,
) -> dict[str, Any]:
    """Measures of a walk to its end, or to the fall; ``act`` sets the actuators from data and
    command.
    """
    mujoco, model, watch = import_mujoco(), bridge.model, Watch(bridge, data)
    dt, rows, command = (
        float(model.opt.timestep),
        [np.array(row) for row in job["commands"]],
        np.zeros(3),
    )
    try:
        for k in range(round(job["duration"] / dt)):
            while rows and rows[0][0] <= k * dt:
                command = rows.pop(0)[1:]
            if job["push"] is not None:
                on = job["push"][0] <= k * dt < job["push"][0] + PUSH
                mass = float(model.body_subtreemass[watch.body])
                data.xfrc_applied[watch.body, :2] = (
                    mass / PUSH * np.array(job["push"][1:]) if on else 0.0
                )
            if k % every == 0:
                act(data, command)
            mujoco.mj_step(model, data)
            watch.look(command)
            if watch.fell:
                break
    except ControlError:
        watch.fell = True
    return watch.measures()


def walked(job: dict[str, Any]) -> dict[str, Any]:
    """Measures of a walk.

    Args:
        job: ``world``, ``feet`` and ``friction``; ``who``, a name of :data:`WALKERS`, or the
            settings of one; ``duration``, s; ``commands``, each with the time from which on it
            holds, s, forward, to the left and turning; ``push``, its time, s, and impulse over
            mass, m/s, or None; ``noise``, its seed, or None; and ``kept``, what alone is kept of
            the world (:func:`~comparison.worlds.models.strip`), or None.
    """
    who = WALKERS[job["who"]] if isinstance(job["who"], str) else Contender(**job["who"])
    mujoco = import_mujoco()
    model, robot = world(job["world"], job["feet"])
    robot = identified(job["world"], tuple(job["feet"])) if who.identified else robot
    model.geom_friction[:, 0] = job["friction"]
    model.pair_friction[:, :2] = job["friction"]
    if job.get("kept") is not None:
        strip(model, robot, job["kept"])
    walker = Walker(who, model, robot, job["friction"], seed=job["noise"])
    data = mujoco.MjData(model)
    if who.controller != "policy":
        model.actuator_ctrllimited[model.actuator_biastype != 0] = (
            0  # servos take any torque through any target
        )
    with Policy(default_folder()) if who.controller == "policy" else nullcontext() as network:
        if network is None:
            walker.place(data)
            found = followed(job, walker.bridge, data, walker.act)
            paths = [np.array(column) for column in zip(*walker.trace, strict=True)][:4]
            return found | (off(*paths, period=float(model.opt.timestep)) if paths else {})
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        return followed(
            job, walker.bridge, data, network.acting(model), round(PERIOD / model.opt.timestep)
        )
