"""Settings of the controllers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.fitting import fitting_parameters
from harpy_pin.gaits.gait import Gait
from harpy_pin.governors.thrust import AttitudeGains, CentreGains
from harpy_pin.wbc import FORMULATIONS, SOLVERS, WholeBodyLimits, WholeBodyWeights

Parameters = TypeVar("Parameters")

LEGS: Mapping[str, str] = {"pid": "", "feedforward": "harpy_pin.contrib.feedforward"}
"""Control laws of the governed controller's legs: the paper's joint PID, or softer joints with
feedforward torques. Another one than the PID is in a module that is imported where it is asked for.
"""

MAX_GAIN = 1e6
"""Largest gain, 1/s² and 1/s."""
PAIR: dict[str, Any] = {"check": checks.fixed_gains, "size": 2, "high": MAX_GAIN}
"""What (k_p, k_d) may be."""
MAX_FORCE = 1e6
"""Largest limit of a normal force, N."""
MAX_RATIO = 1e3
"""Largest stiffness and damping of joints in their units."""
JOINT_TARGETS: Mapping[str, float] = {
    "joint_stiffness": 1.0,
    "joint_damping": 0.3,
    "contact_damping": 20.0,
}
"""Settings with which motors hold joint targets, for models of others: torques alone fall in many
of them (docs/worlds.md).
"""
MAX_HELD = 1000
"""Largest number of ticks for which the last good command is held."""


@dataclass(frozen=True, kw_only=True)
class JointGains(checks.Checked):
    """PID of the joints, one value for (hip frontal, hip sagittal, knee).

    equations.md gives the hips 1000/20/40 in continuous time. Held over a control period of 1 ms, a
    derivative gain of 40 is unstable: the apparent inertia of a hip motor in swing is 0.017 kg·m²,
    and 40 · 1 ms / 0.017 > 2. The hips therefore have 10, and the light knee 3.

    Attributes:
        k_p: N·m/rad.
        k_i: N·m/(rad·s).
        k_d: N·m·s/rad.
        integral_limit: largest torque of the integral part, N·m.
    """

    whose = "joint "
    k_p: tuple[float, float, float] = checks.setting((1000.0, 1000.0, 1000.0), checks.fixed_gains)
    k_i: tuple[float, float, float] = checks.setting((20.0, 20.0, 20.0), checks.fixed_gains)
    k_d: tuple[float, float, float] = checks.setting((10.0, 10.0, 3.0), checks.fixed_gains)
    integral_limit: float = checks.setting(4.0, low=0.0)


@dataclass(frozen=True, kw_only=True)
class FeedforwardGains(checks.Checked):
    """Gains of :mod:`harpy_pin.contrib.feedforward`, for (hip frontal, hip sagittal, knee).

    In swing a gain acts on the inertia of a leg, in stance on a part of the body's, so each phase
    has its own. They were chosen among 48 sets on walks at friction 0.5 and 0.3 with 2 and 3 ms of
    delay.

    Attributes:
        stance_p: stiffness in stance, N·m/rad.
        stance_d: damping in stance, N·m·s/rad.
        swing_p: stiffness in swing, N·m/rad.
        swing_d: damping in swing, N·m·s/rad.
        contact_threshold: measured normal force from which on a foot counts as in stance, N.
    """

    stance_p: tuple[float, float, float] = checks.setting((600.0, 600.0, 300.0), checks.fixed_gains)
    stance_d: tuple[float, float, float] = checks.setting((6.5, 6.5, 3.0), checks.fixed_gains)
    swing_p: tuple[float, float, float] = checks.setting((200.0, 200.0, 60.0), checks.fixed_gains)
    swing_d: tuple[float, float, float] = checks.setting((4.0, 4.0, 1.1), checks.fixed_gains)
    contact_threshold: float = checks.setting(1.0, low=0.0, high=MAX_FORCE)


@dataclass(frozen=True, kw_only=True)
class GovernedParameters(checks.Checked):
    """Settings of :class:`~harpy_pin.controllers.governed.GovernedController`; by default the
    paper's 3D run.

    The defaults are those of equations.md §3.

    Attributes:
        period: time between ticks, s.
        centre: gains of the thruster feedback.
        attitude: gains of the roll and yaw feedback.
        joints: gains of the joint PID.
        legs: one of :data:`LEGS`. The paper's ``pid`` falls with 2 ms of delay; ``feedforward``
            does not.
        feedforward: gains of that control law; its integral part is that of ``joints``.
        reference_velocity: whether x_r has ċ_t (as printed) or zero velocity (equations.md §3, "c
            in the 3D run").
        limits: clip torques and thrusts to the motors' peak torque and the thrusters' limit (off in
            the paper).
        thrust: whether there are thrusters; without them only the legs act.
        estimate_friction: whether the governors take a friction coefficient that is estimated while
            walking (:mod:`harpy_pin.controllers.friction`) where it is below the one they were
            given.
    """

    period: float = checks.setting(1e-3, low=0.0, strict=True)
    centre: CentreGains = field(default_factory=CentreGains)
    attitude: AttitudeGains = field(default_factory=AttitudeGains)
    joints: JointGains = field(default_factory=JointGains)
    legs: str = checks.setting("pid", checks.one_of, valid=LEGS, called="leg control law")
    feedforward: FeedforwardGains = field(default_factory=FeedforwardGains)
    reference_velocity: bool = True
    limits: bool = False
    thrust: bool = True
    estimate_friction: bool = False


@dataclass(frozen=True, kw_only=True)
class WholeBodyParameters(checks.Checked):
    """Settings of the whole-body controllers; gains and forces are at most 1e6.

    Gains, forces and weights depend on the robot and have no defaults here: :meth:`for_gait` finds
    them.

    Attributes:
        period: time between ticks, s.
        body: (k_p, k_d) of the body's position, 1/s² and 1/s.
        orientation: (k_p, k_d) of its orientation, 1/s² and 1/s.
        swing: (k_p, k_d) of a swing foot, 1/s² and 1/s.
        posture: (k_p, k_d) of the joints, 1/s² and 1/s.
        contact_damping: of the velocity of a stance foot, 1/s. At most 1 / period counts: with more
            a command that is held would turn the velocity round.
        min_normal_force: f_min of a stance foot, N.
        max_normal_force: f_max, N.
        contact_threshold: measured normal force that counts as contact, N.
        hold_ticks: ticks in a row for which the last good command is held after failed solves, at
            most 1000.
        formulation: one of :data:`harpy_pin.wbc.FORMULATIONS`. ``full`` and ``input_space`` have
            the same solutions.
        solver: one of :data:`harpy_pin.wbc.SOLVERS`, which solves every tick. ``active_set`` is
            this library's own search, with which a tick is one bounded compiled call.
        estimate_friction: take a friction coefficient that is estimated while walking
            (:mod:`harpy_pin.controllers.friction`) where it is below that of the limits.
        estimate_joint_friction: take into account friction in the joints that the model lacks,
            estimated while walking (:mod:`harpy_pin.contrib.joint_friction`).
        thrust_lag: time constant with which thrusts follow their commands, s: the program has them
            as they are in each tick, and legs make up for the rest
            (:mod:`harpy_pin.contrib.thrust_lag`).
        thrust_turning_lag: time constant with which their directions follow, s.
        joint_stiffness: of the motors about joint targets, k_p in units of m g l / 4, with m the
            robot's mass and l the length of its leg (:mod:`harpy_pin.controllers.joint_targets`).
            0: motors get torques alone; 1 suits robots whose joints the model does not know well.
        joint_damping: of the motors, k_d in units of m g l / 4 √(l/g); with a stiffness of 1, 0.3
            suits.
        joint_leak: rate at which the targets are drawn to the measured motion, 1/s.
        joint_learning: rate at which inertia and damping of the joints are learned that the model
            lacks, where motors hold targets, 1/s (:mod:`harpy_pin.controllers.joint_targets`). 0:
            none.
        weights: of the tasks.
        limits: of the constraints.
    """

    period: float = checks.setting(1e-3, low=0.0, strict=True)
    body: tuple[float, float] = field(metadata=checks.rule(called="gains of body", **PAIR))
    orientation: tuple[float, float] = field(
        metadata=checks.rule(called="gains of orientation", **PAIR)
    )
    swing: tuple[float, float] = field(metadata=checks.rule(called="gains of swing", **PAIR))
    posture: tuple[float, float] = checks.setting((100.0, 20.0), called="gains of posture", **PAIR)
    contact_damping: float = field(metadata=checks.rule(low=0.0, high=MAX_GAIN))
    min_normal_force: float = field(metadata=checks.rule(low=0.0, high=MAX_FORCE))
    max_normal_force: float = field(metadata=checks.rule())
    contact_threshold: float = checks.setting(1.0, low=0.0, high=MAX_FORCE)
    hold_ticks: int = checks.setting(20, checks.whole, high=MAX_HELD)
    formulation: str = checks.setting("input_space", checks.one_of, valid=FORMULATIONS)
    solver: str = checks.setting("proxqp", checks.one_of, valid=SOLVERS)
    estimate_friction: bool = True
    estimate_joint_friction: bool = False
    thrust_lag: float = checks.setting(0.0, low=0.0, high=checks.MAX_LAG)
    thrust_turning_lag: float = checks.setting(0.0, low=0.0, high=checks.MAX_LAG)
    joint_stiffness: float = checks.setting(0.0, low=0.0, high=MAX_RATIO)
    joint_damping: float = checks.setting(0.0, low=0.0, high=MAX_RATIO)
    joint_leak: float = checks.setting(40.0, low=0.0, high=MAX_GAIN)
    joint_learning: float = checks.setting(1.0, low=0.0, high=MAX_GAIN)
    weights: WholeBodyWeights
    limits: WholeBodyLimits = field(default_factory=WholeBodyLimits)

    @classmethod
    def for_gait(cls, gait: Gait, **changes: Any) -> WholeBodyParameters:
        """Settings that fit a gait and its robot.

        What is not among the changes is the gait's own by its ``controller_parameters``
        (:class:`~harpy_pin.gaits.gait.Gait`), and where it brings none, the robot's by its mass and
        legs (:func:`~harpy_pin.gaits.fitting.fitting_parameters`).

        Args:
            gait: any.
            changes: settings that differ, by name; those of a record inside as a mapping or whole,
                such as ``weights={"swing": 0.5}``.

        Raises:
            InputError: it is no gait, or a setting is unknown or out of its domain.
        """
        rule = fitting_parameters(checks.instance("gait", gait, Gait).robot)
        records = {
            "weights": WholeBodyWeights(**rule["weights"]),
            "limits": WholeBodyLimits(**rule["limits"]),
        }
        fitting = cls(**{**rule, **records})
        return changed(changed(fitting, gait.controller_parameters), changes)

    def __post_init__(self) -> None:
        super().__post_init__()
        least = self.min_normal_force
        checks.number(
            "max_normal_force", self.max_normal_force, low=least, high=MAX_FORCE, strict=True
        )


def changed(
    parameters: Parameters,
    changes: Mapping[str, Any] | None,
    *,
    fixed: Collection[str] = (),
    inside: str = "",
) -> Parameters:
    """A copy of a frozen dataclass with other values, checked as when it is made.

    Args:
        parameters: may hold further dataclasses.
        changes: values by name, those of a dataclass inside as a mapping or whole. Lists become
            tuples; None changes nothing.
        fixed: names that may not change; those of a dataclass inside after its name and a dot.
        inside: name of the dataclass and a dot, for messages; empty at the top.
    """
    changes = {} if changes is None else changes
    if not isinstance(changes, Mapping):
        raise InputError(
            f"parameters {inside[:-1] or 'of the controller'} must be a mapping, got "
            f"{shown(changes)}"
        )
    valid = [entry.name for entry in fields(parameters)]  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for name, value in changes.items():
        checks.one_of("parameter", name, valid)
        if inside + name in fixed:
            raise InputError(
                f"parameter '{inside}{name}' has an argument of its own", name=name, value=value
            )
        default = getattr(parameters, name)
        if value is None:
            continue
        fixed_inside = any(entry.startswith(f"{inside}{name}.") for entry in fixed)
        if is_dataclass(default) and (fixed_inside or type(value) is not type(default)):
            value = changed(default, value, fixed=fixed, inside=f"{inside}{name}.")
        elif isinstance(default, bool) and not isinstance(value, bool):
            raise InputError(
                f"{inside}{name} must be true or false, got {shown(value)}", name=name, value=value
            )
        values[name] = tuple(value) if isinstance(value, list) else value
    return replace(parameters, **values)  # type: ignore[type-var]
