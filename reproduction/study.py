"""Compare the governors and the whole-body QP on the same walks: slip, forces, tracking, chattering, falls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from time import perf_counter_ns
from typing import Any, Literal

import numpy as np

from harpy_pin import checks
from harpy_pin.controllers.named_controllers import GOVERNORS
from harpy_pin.ground.ground import Ground
from harpy_pin.log.measures import LATE, chattering, contact_age, measure
from harpy_pin.log.run import Run
from harpy_pin.model.contact_map import ContactForceMap
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.robot import Robot, load_harpy
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Disturbances, Governed, Scenario, walk
from harpy_pin.simulation.push import Push
from reproduction.gait.spatial import make_named_gait
from reproduction.reduced_order import model_rows
from reproduction.vlip_simulation import VLIP_GOVERNORS, VlipParameters, simulate_vlip, vlip_governor, vlip_setting

__all__ = [
    "METHODS",
    "ModelResult",
    "PredictionError",
    "WalkResult",
    "demanded_force",
    "evaluate",
    "prediction_error",
    "vlip_study",
    "walk_method",
]

TRACKED = "paper, tracked"
WBC = "whole-body QP"
METHODS = {
    "none": Scenario(controller=Governed(governor="none")),
    "paper": Scenario(controller=Governed()),
    TRACKED: Scenario(controller=Governed(evaluate_at="tracked")),
    **{name: Scenario(controller=Governed(governor=name)) for name in GOVERNORS[2:]},
    WBC: Scenario(controller="wbc"),
}
"""What is compared: no governor; the paper's with both readings; those beyond it; the whole-body QP."""
PUSH_TIME = 3.45
"""Middle of the single support of the fifth step of the paper's rhythm, s."""
CHANGE_OVER = 0.02
"""Time after a touchdown and before a lift-off, s."""


@dataclass(frozen=True)
class WalkResult:
    """One walk under one method.

    Attributes:
        method: one of :data:`METHODS`.
        friction: μ_s of the ground.
        push_ns: lateral impulse, N·s.
        fell_at_s: time of the fall, s; NaN without one.
        speed: mean speed along x, m/s.
        slip_mm: per step.
        late_slip_mm: per step, later than 50 ms after touchdown.
        sliding: share of contact time faster than 10 mm/s.
        low_force: share of time with less than 20 N on the ground, after the first 50 ms.
        demanded_violation: share of ticks at which sticking demands a force outside Coulomb's cone.
        demanded_worst_n: largest excess of the demanded tangential force over μ f_z later than 50 ms after touchdown,
            N.
        model_violation: share of ticks with a violated row of the reduced-order model at x_w (NaN without x_w).
        model_worst_n: largest violation of one, N.
        deviation_rms_mm: distance of x_w from x_r (NaN without x_w).
        reversals_per_s: changes of direction of x_w's position.
        variation_per_s: its total variation, m/s.
        rate_max: largest speed of x_w's position, m/s.
        thrust_rms_n: of the sum of both thrusts' magnitudes.
        thrust_max_n: largest of one side.
    """

    method: str
    friction: float
    push_ns: float
    fell_at_s: float
    speed: float
    slip_mm: float
    late_slip_mm: float
    sliding: float
    low_force: float
    demanded_violation: float
    demanded_worst_n: float
    model_violation: float
    model_worst_n: float
    deviation_rms_mm: float
    reversals_per_s: float
    variation_per_s: float
    rate_max: float
    thrust_rms_n: float
    thrust_max_n: float

    def as_dict(self) -> dict[str, float | str]:
        """Names and values, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class PredictionError:
    """Error of the force that :class:`harpy_pin.model.contact_map.ContactForceMap` predicts for the next tick, N.

    Attributes:
        phase: of contact.
        samples: feet and ticks counted.
        median: of the length of the error.
        p90: its 90th percentile.
        p99: its 99th percentile.
    """

    phase: str
    samples: int
    median: float
    p90: float
    p99: float


@dataclass(frozen=True)
class ModelResult:
    """One governor on the reduced-order model.

    Attributes:
        governor: see :data:`reproduction.vlip_simulation.VLIP_GOVERNORS`, with both readings of the paper's.
        violation_share: share of ticks with a violated force constraint.
        worst_violation_n: largest violation of one, N.
        reversals_per_s: of the normal force, at Δt, Δt/2 and Δt/4.
        deviation_rms_mm: of x_w from x_r.
        thrust_rms_n: root mean square of the thrust.
        update_us: median time of an update called from Python, µs (NaN without a governor).
    """

    governor: str
    violation_share: float
    worst_violation_n: float
    reversals_per_s: tuple[float, ...]
    deviation_rms_mm: float
    thrust_rms_n: float
    update_us: float

    def as_dict(self) -> dict[str, Any]:
        """Names and values, ready for JSON."""
        return asdict(self)


def vlip_study() -> list[ModelResult]:
    """Every governor on the paper's target, from a start inside the cone, in Cartesian references."""
    cases: list[tuple[str, str, Literal["measured", "tracked"]]] = [(name, name, "measured") for name in VLIP_GOVERNORS]
    cases.insert(2, (TRACKED, "paper", "tracked"))
    results = []
    for label, name, evaluate_at in cases:
        runs = []
        for divide in (1, 2, 4):
            p = vlip_setting(name, VlipParameters(start="inside", coordinates="cartesian", dt=1e-3 / divide))
            governor = vlip_governor(p, name=name, evaluate_at=evaluate_at)
            runs.append(simulate_vlip(governor, p))
        first = runs[0].summary()
        times = []
        if governor is not None:
            state = np.zeros(9)
            for k in range(len(runs[0].t)):
                state[:3], state[3:6] = runs[0].position[k], runs[0].velocity[k]
                begin = perf_counter_ns()
                governor.update(state, runs[0].x_r[k], 1e-3)
                times.append(perf_counter_ns() - begin)
        results.append(
            ModelResult(
                label,
                first.violation_share,
                first.worst_violation_n,
                tuple(run.summary().reversals_per_s for run in runs),
                1e3 * first.deviation_rms_m,
                first.thrust_rms_n,
                1e-3 * float(np.median(times)) if times else float("nan"),
            )
        )
    return results


def walk_method(
    method: str,
    *,
    friction: float,
    duration: float = 20.0,
    push: float = 0.0,
    gait: str = "hand",
    period: float = 1e-3,
    dt: float = 5e-4,
) -> Run:
    """One walk.

    Args:
        method: one of :data:`METHODS`.
        friction: μ_s of the ground, known to the controller; μ_c is nine tenths of it.
        duration: s.
        push: lateral impulse on the body in the middle of a single support, N·s, over 0.1 s.
        gait: see :data:`reproduction.gait.spatial.GAITS`.
        period: control period, s.
        dt: physics step, s.

    Raises:
        InputError: an unknown method, or a number out of its domain.
    """
    checks.one_of("method", method, METHODS)
    scenario = replace(
        METHODS[method],
        ground=Ground(mu_s=friction),
        duration=duration,
        disturbances=Disturbances(pushes=(Push(PUSH_TIME, (0.0, push, 0.0)),) if push != 0.0 else ()),
        period=period,
        dt=dt,
    )
    return walk(scenario, gait=make_named_gait(load_harpy(), gait), metadata={"method": method})


def demanded_force(robot: Robot, run: Run) -> Vector:
    """(n, feet, 3) force that sticking demands of each foot that touches, world axes, N; NaN in the air."""
    dynamics, contact = Dynamics(robot), ContactForceMap(robot)
    out = np.full(run["foot_force"].shape, np.nan)
    for k in range(len(run)):
        touching = run["foot_force"][k, :, 2] > 0.0
        if touching.any():
            dynamics.update(run["q"][k], run["v"][k])
            force = contact.update(
                dynamics, run["v"][k], torque=run["torque"][k], thrust=run["thrust"][k], touching=touching
            )
            out[k, touching] = force[touching]
    return out


def evaluate(robot: Robot, run: Run) -> WalkResult:
    """Measures of a run made by :func:`walk_method`."""
    scenario = Scenario.from_dict(run.metadata["scenario"])
    mu, period = scenario.mu, scenario.period
    m = measure(run)
    demanded = demanded_force(robot, run)
    touching = run["foot_force"][..., 2] > 0.0
    excess = np.hypot(demanded[..., 0], demanded[..., 1]) - mu * np.maximum(demanded[..., 2], 0.0)
    late = touching & (contact_age(touching, period) > LATE)
    settled = run["foot_force"][run["t"] > LATE, :, 2].sum(axis=1)
    governed = "x_w" in run
    rows = model_rows(run, mu=mu) if governed else np.full((len(run), 1), np.nan)
    nan = float("nan")
    if governed:
        x_w = run["x_w"][:, :3]
        chatter = chattering(x_w, period=period)
        reversals, variation = chatter.reversals_per_s, chatter.variation_per_s
        deviation = 1e3 * float(np.sqrt(np.mean(np.sum((x_w - run["x_r"][:, :3]) ** 2, axis=1))))
        rate = float(np.linalg.norm(np.diff(x_w, axis=0), axis=1).max() / period)
    else:
        reversals = variation = deviation = rate = nan
    return WalkResult(
        method=str(run.metadata["method"]),
        friction=mu,
        push_ns=sum(push.impulse[1] for push in scenario.disturbances.pushes),
        fell_at_s=m.duration_s if m.fell else nan,
        speed=m.distance_m / m.duration_s,
        slip_mm=m.slip_mm_per_step,
        late_slip_mm=m.late_slip_mm_per_step,
        sliding=m.sliding,
        low_force=float(np.mean(settled < 20.0)) if len(settled) else nan,
        demanded_violation=float(np.mean((excess > 0.0).any(axis=1))),
        demanded_worst_n=float(np.max(excess[late], initial=0.0)),
        model_violation=float(np.mean((rows < 0.0).any(axis=1))) if governed else nan,
        model_worst_n=float(max(-rows.min(), 0.0)) if governed else nan,
        deviation_rms_mm=deviation,
        reversals_per_s=reversals,
        variation_per_s=variation,
        rate_max=rate,
        thrust_rms_n=m.thrust_rms_n,
        thrust_max_n=m.thrust_max_n,
    )


def prediction_error(robot: Robot, run: Run) -> Sequence[PredictionError]:
    """How well the sticking force at a tick predicts the simulated force one tick later, by phase of contact.

    Args:
        robot: Harpy.
        run: with feet that stick: of a walk at high friction.
    """
    period = float(run.metadata["control_period"])
    predicted, actual = demanded_force(robot, run)[:-1], run["foot_force"][1:]
    touching = run["foot_force"][..., 2] > 0.0
    both = touching[:-1] & touching[1:]
    age = contact_age(touching, period)[:-1]
    remaining = contact_age(touching[::-1], period)[::-1][:-1]
    error = np.linalg.norm(predicted - actual, axis=2)
    double = np.asarray(touching[:-1].all(axis=1))[:, None]
    fresh, leaving = age < CHANGE_OVER, remaining < CHANGE_OVER
    phases = {
        "single support": both & ~double & ~fresh & ~leaving,
        "double support": both & double & ~fresh & ~leaving,
        f"first {1e3 * CHANGE_OVER:.0f} ms after touchdown": both & fresh,
        f"last {1e3 * CHANGE_OVER:.0f} ms before lift-off": both & leaving & ~fresh,
    }
    return [
        PredictionError(name, int(mask.sum()), *(float(np.percentile(error[mask], p)) for p in (50, 90, 99)))
        for name, mask in phases.items()
        if mask.any()
    ]
