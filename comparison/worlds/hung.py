"""Other people's robots hung up by the base, with joints that the identification has to find."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from comparison.worlds.models import FEET, knowing, world_spec
from harpy_pin import Robot
from harpy_pin.contrib.identify import Excitation, excitation, identify
from harpy_pin.model.state import Vector
from harpy_pin.simulation.mujoco.conventions import import_mujoco

FACTOR = (0.3, 3.0)
"""Armature, damping and dry friction of each joint are the file's times a factor of this range."""
SCALE = 0.1
"""Largest error of a joint's torques, as a share."""
BIAS = 0.02
"""Their largest offset, as a share of the joint's largest torque."""
LATEST = 6e-3
"""Largest delay, s."""
STEP = 5e-4
"""Of MuJoCo, s."""
PERIOD = 2e-3
"""Of the log, s."""
ENCODER = 5e-4
"""Standard deviation of encoders, rad."""
TORQUE = 0.03
"""That of torques, as a share of the joint's rms torque."""
LEAST = {"armature": 0.01, "damping": 0.1, "friction": 0.1}
"""What stands for a number that is zero in the file: kg·m², N·m·s/rad, N·m."""


@dataclass(frozen=True)
class Hidden:
    """What the joints really are: (joints,) arrays by the names of
    :class:`harpy_pin.contrib.identify.Joints`.
    """

    armature: Vector
    damping: Vector
    friction: Vector
    bias: Vector
    torque_scale: Vector
    delay: Vector


def typical(robot: Robot) -> dict[str, Vector]:
    """(joints,) armature, damping and dry friction of the file, about which the true ones are."""
    model = robot.model
    known = {
        "armature": model.armature[6:],
        "damping": model.damping[6:],
        "friction": robot.dry_friction,
    }
    return {name: np.where(value > 0.0, value, LEAST[name]) for name, value in known.items()}


def hidden(robot: Robot, rng: np.random.Generator, largest: Vector) -> Hidden:
    """Drawn joints.

    Args:
        robot: as its file has it.
        rng: that draws.
        largest: (joints,) torque in the log, N·m.
    """
    n = len(robot.joints)
    return Hidden(
        **{
            name: value * np.exp(rng.uniform(np.log(FACTOR[0]), np.log(FACTOR[1]), n))
            for name, value in typical(robot).items()
        },
        bias=BIAS * largest * rng.uniform(-1.0, 1.0, n),
        torque_scale=rng.uniform(1.0 - SCALE, 1.0 + SCALE, n),
        delay=STEP * np.round(rng.uniform(0.0, LATEST, n) / STEP),
    )


def hung(name: str, feet: Sequence[str] = FEET) -> tuple[Any, Robot]:
    """Model and robot of a world, whose base is fixed in the air; see :func:`hang`."""
    spec, robot = world_spec(name, feet)
    return hang(spec, robot), robot


def hang(spec: Any, robot: Robot) -> Any:
    """A ``mujoco.MjModel`` whose base is fixed, that nothing touches, and whose only actuators are
    motors at the robot's joints, in their order.

    Args:
        spec: ``mujoco.MjSpec`` of the robot.
        robot: whose joints these are.
    """
    mujoco, spec = import_mujoco(), spec.copy()
    free = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    for part in [*free, *spec.keys, *spec.actuators, *spec.sensors]:
        spec.delete(part)
    for joint in robot.joints:
        motor = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.opt.timestep, model.opt.integrator = STEP, int(mujoco.mjtIntegrator.mjINT_RK4)
    model.jnt_actfrclimited[:] = 0
    return model


def with_hidden(
    model: Any, truth: Hidden, k_p: float | Vector = 0.0, k_d: float | Vector = 0.0
) -> Any:
    """A copy of the model with these joints, whose motors have these gains in their own law."""
    column, model = model.jnt_dofadr[model.actuator_trnid[:, 0]], copy.copy(model)
    model.dof_armature[column] = truth.armature
    model.dof_damping[column] = truth.damping
    model.dof_frictionloss[column] = truth.friction
    model.actuator_gainprm[:, 0] = truth.torque_scale
    model.actuator_biasprm[:, 0] = truth.bias
    model.actuator_biasprm[:, 1] = -truth.torque_scale * k_p
    model.actuator_biasprm[:, 2] = -truth.torque_scale * k_d
    mujoco = import_mujoco()
    mujoco.mj_setConst(model, mujoco.MjData(model))  # how stiff dry friction is: by the inertias
    return model


def replayed(model: Any, trials: Sequence[Hidden], plan: Excitation, rows: int) -> Vector:
    """(trials, rows, joints) angles of motors that evaluate their own law on a plan's targets,
    which come late by the delays, rad.

    Args:
        model: of :func:`hang`, with any step of which the period of the plan is a multiple.
        trials: joints, each of a robot of its own.
        plan: that is followed from its begin.
        rows: how many of its rows.
    """
    mujoco = import_mujoco()
    from mujoco import rollout

    place, step = model.jnt_qposadr[model.actuator_trnid[:, 0]], model.opt.timestep
    every = round(PERIOD / step)
    data = mujoco.MjData(model)
    data.qpos[place] = plan.q[0]
    start = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    sent = (plan.torque + plan.k_p * plan.q + plan.k_d * plan.v)[:rows].repeat(every, axis=0)
    sent = np.vstack((0.0 * sent[:1], sent))
    ticks = np.arange(every * rows)[:, None]
    controls = []
    for trial in trials:
        late = ticks + 1 - np.clip(trial.delay, 0.0, None) / step  # between two steps: both
        before = np.maximum(np.floor(late).astype(int), 0)
        share, joint = np.clip(late - before, 0.0, 1.0), np.arange(sent.shape[1])
        after = np.minimum(before + 1, len(sent) - 1)
        controls.append((1.0 - share) * sent[before, joint] + share * sent[after, joint])
    models = [with_hidden(model, trial, plan.k_p, plan.k_d) for trial in trials]
    state, _ = rollout.rollout(models, data, start[None], np.array(controls))
    states = np.concatenate(
        (np.tile(start, (len(trials), 1, 1)), state[:, every - 1 : -1 : every]), 1
    )
    return np.asarray(states[:, :, 1 + place])


def logged(
    model: Any, truth: Hidden, plan: Excitation, rng: np.random.Generator, *, law: bool = False
) -> dict[str, Vector]:
    """The log of a hung-up robot that follows a plan.

    Args:
        model: of :func:`hang`.
        truth: its joints. A command, or with ``law`` its feedforward and targets, comes late by the
            delay.
        plan: what is followed.
        rng: of the noise.
        law: the motors evaluate their law themselves, and torques are not logged.
    """
    if law:
        q = replayed(model, [truth], plan, len(plan.t))[0]
        return {**plan.signals(), "q": q + ENCODER * rng.standard_normal(q.shape)}
    mujoco = import_mujoco()
    joints = model.actuator_trnid[:, 0]
    place, column = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    model = with_hidden(model, truth)
    data, every = mujoco.MjData(model), round(PERIOD / STEP)
    data.qpos[place] = plan.q[0]
    late = np.round(truth.delay / STEP).astype(int)
    sent, joint = np.zeros((every * len(plan.t), model.nu)), np.arange(model.nu)
    seen, commands = [], []
    for row in range(len(plan.t)):
        q = data.qpos[place] + ENCODER * rng.standard_normal(model.nu)
        error = plan.q[row] - q, plan.v[row] - data.qvel[column]
        command = plan.torque[row] + plan.k_p * error[0] + plan.k_d * error[1]
        seen.append(q)
        commands.append(command)
        for k in range(every * row, every * (row + 1)):
            sent[k] = command
            data.ctrl = np.where(k < late, 0.0, sent[np.maximum(k - late, 0), joint])
            mujoco.mj_step(model, data)
    torque = np.array(commands)
    noise = TORQUE * np.sqrt(np.mean(torque**2, axis=0)) * rng.standard_normal(torque.shape)
    return {"t": plan.t, "q": np.array(seen), "torque": torque + noise}


@cache
def identified(name: str, feet: tuple[str, ...], duration: float = 30.0) -> Robot:
    """A world's robot with the joints that a log of it says, hung up for so many seconds."""
    model, robot = hung(name, feet)
    zero = np.zeros(len(robot.joints))
    arrays = robot.model.armature[6:], robot.model.damping[6:], robot.dry_friction
    truth = Hidden(*arrays, bias=zero, torque_scale=zero + 1.0, delay=zero)
    robot = knowing(robot, ())
    plan = excitation(robot, duration=duration)
    return robot.with_joints(identify(robot, logged(model, truth, plan, np.random.default_rng(0))))
