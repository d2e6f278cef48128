"""libdwbc's recorded states and its models of 18 to 45 joints of the humanoid TOCABI.

The inertias of motors are part of the links there, so that many of them are those of no body. Our loader refuses such a
file; Pinocchio reads it, and the terms of the equations of motion are defined all the same.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.walking import Progress, Rows, tracked
from comparison.public.sources import reading
from comparison.sections.growth import Case, exponent_of, time_case
from harpy_pin import Dynamics, Robot
from harpy_pin.model.flat_foot import FlatFoot, add_flat_feet
from harpy_pin.model.state import Vector

__all__ = ["compare_states", "growth_exponents", "time_models"]

FEET = ("L_AnkleRoll_Link", "R_AnkleRoll_Link")
SOLE = FlatFoot(length=0.26, width=0.12, centre=(0.03, 0.0, -0.1585))
"""The contact of libdwbc's tests: the point at which its Jacobians are taken, and the sole about it."""
PARTS = ("terms", "full", "input_space", "condensed")


def _load(path: Path) -> Robot:
    with reading(path, "model of libdwbc"):
        model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
        points, corners = add_flat_feet(model, FEET, dict.fromkeys(FEET, SOLE))
    return Robot(model, path, points, (), np.inf, flat_feet=corners)


def _matrix(path: Path) -> Vector:
    """A recorded matrix: rows and columns as integers, then the numbers by columns."""
    with reading(path, "recorded matrix"):
        data = path.read_bytes()
        rows, columns = np.frombuffer(data[:16], np.int64)
        matrix: Vector = np.frombuffer(data[16:]).reshape(columns, rows).T
    return matrix


def compare_states(tests: Path) -> Rows:
    """Our terms at the two recorded states, and what was recorded there by libdwbc, which has them from RBDL.

    Returns:
        For each state the largest entry of M A⁻¹ − 1 (their inverse of the mass matrix), of the difference of the
        Jacobians of both soles, and of the difference in the torques that hold the robot against gravity, N·m: the
        least ones whose accelerations within the contacts are zero.
    """
    robot, found = _load(tests / "dyros_tocabi.urdf"), []
    dynamics, nv = Dynamics(robot), robot.model.nv
    source = tests / "dwbc_test.cpp"
    with reading(source, "test of libdwbc"):
        text = source.read_text(encoding="utf-8", errors="replace")
    for case in (1, 2):
        inverse, jacobian, gravity = (
            _matrix(tests / "cases" / str(case) / k) for k in ("A_inv_", "J_C", "torque_grav_")
        )
        with reading(source, f"test of libdwbc with the state of case {case}"):
            given = re.findall(r"\bq\s*<<([\d\s.,-]*);", text.split(f'case_set = "/{case}"')[0])[-1].split(",")
            q = np.array([float(x) for x in given])
        dynamics.update(np.concatenate((q[:6], q[-1:], q[6:-1])), np.zeros(nv))
        ours = dynamics.foot_jacobian.reshape(2, 4, 3, nv).mean(axis=1)
        # Ours: mass matrix and bias; the wrench on each sole acts by the recorded rows, translation and rotation.
        response = np.linalg.solve(dynamics.mass_matrix, np.column_stack((jacobian.T, dynamics.bias)))
        weight = np.linalg.inv(jacobian @ response[:, :-1])
        held = np.linalg.inv(dynamics.mass_matrix) - response[:, :-1] @ weight @ response[:, :-1].T
        torque = np.linalg.pinv(held[6:, 6:], rcond=1e-9) @ (held @ dynamics.bias)[6:]
        found.append(
            {
                "state": f"recorded state {case}",
                "mass": float(np.abs(dynamics.mass_matrix @ inverse - np.eye(nv)).max()),
                "jacobian": float(np.abs(jacobian.reshape(2, 2, 3, nv)[:, 0] - ours).max()),
                "gravity": float(np.abs(torque - gravity[:, 0]).max()),
            }
        )
    return found


def time_models(tests: Path, joints: Sequence[int], repetitions: int, progress: Progress | None = None) -> Rows:
    """Medians of our terms and controllers on models of so many joints, both soles on the ground, µs."""
    rows = []
    for count in tracked(joints, progress):
        robot = _load(tests / "dof_test" / f"dyros_tocabi_dof{count}.urdf")
        times = time_case(Case(robot, held=len(robot.feet)), repetitions, np.random.default_rng(0))
        rows.append({"joints": count, "dof": robot.model.nv, **{part: times[part] for part in (*PARTS, "unsolved")}})
    return rows


def growth_exponents(rows: Rows) -> dict[str, Any]:
    """Exponent by which each time grows with the degrees of freedom."""
    return {part: exponent_of([(row["dof"], row[part]) for row in rows]) for part in PARTS}
