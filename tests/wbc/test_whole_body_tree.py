"""The whole-body optimum in six unknowns: beside dense programs, at the edges of what robots can do, and bounded."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from tree_cases import CASES, LIMITS, Case, humanoid, legged, random_tree, solve_proxqp, solve_quadprog, two_joints

import harpy_pin as hp
from harpy_pin.errors import InputError
from harpy_pin.wbc import MomentumTask
from harpy_pin.wbc.tree import WholeBodySolver, WholeBodyStatus
from harpy_pin.wbc.tree.cones import project
from harpy_pin.wbc.tree.newton import multiplier_of_forces

ANGLES = 2.0 * np.pi * np.arange(8) / 8
FACES = np.column_stack((np.cos(ANGLES), np.sin(ANGLES), np.full(8, np.tan(np.pi / 8))))


def error(found, true):
    """Largest difference, relative to the largest entry."""
    return np.abs(found - true).max() / np.abs(true).max()


def compare(case, state, solvers):
    """The solver's answer has accelerations, forces and torques of the dense program."""
    solution = case.solver.solve(state)
    assert solution.status == WholeBodyStatus.OPTIMAL
    program, torques = case.dense(state)
    nv, found = len(state.v), case.answer(solution)
    for solve in solvers:
        best = solve(program)
        assert error(found[:nv], best[:nv]) < 1e-6
        assert error(found[nv:], best[nv:]) < 1e-6 or np.abs(found[nv:] - best[nv:]).max() < 1e-6
        assert error(solution.torque, torques(best)) < 1e-6


@needs_robots
@pytest.mark.parametrize("name", CASES)
def test_the_optimum_is_that_of_the_dense_program(name, fuzz):
    """At random states and targets, many of which press forces against their cones."""
    case, rng = CASES[name](), np.random.default_rng(1)
    for _ in range(8 * fuzz):
        compare(case, case.draw(rng), (solve_proxqp, solve_quadprog))


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_any_tree_with_any_contacts(seed):
    """Feet anywhere, several on a limb, points and soles, most of them contradictory: soft, so that all are possible."""
    case, rng = random_tree(seed)
    state = case.draw(rng, spread=1.0)
    compare(case, state, (solve_quadprog,))
