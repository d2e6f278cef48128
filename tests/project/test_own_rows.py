"""Rows of one's own that a governor cannot hold, and other use that only looks right."""

import itertools

import numpy as np
import pytest
from guarded_walks import X_R, Row, X, controller_of, equal, governor_of

import harpy_pin as hp
from harpy_pin.controllers.named_controllers import make_controller, make_governor
from harpy_pin.governors import ForceRows, StackedRows

OWN = {
    "speed": lambda x, w: (0.2 - w[3], (0, 0, 0, -1, 0, 0)),
    "speed and a little lag": lambda x, w: (
        0.2 - w[3] - 0.1 * (w[0] - x[0]),
        (-0.1, 0, 0, -1, 0, 0),
    ),
    "height": lambda x, w: (w[2] - 0.65, (0, 0, 1, 0, 0, 0)),
    "height and a little lag": lambda x, w: (
        w[2] - 0.65 + 0.02 * (w[0] - x[0]),
        (0.02, 0, 1, 0, 0, 0),
    ),
    "height that falls with the way": lambda x, w: (
        0.55 - w[2] - 0.02 * w[0],
        (-0.02, 0, -1, 0, 0, 0),
    ),
    "no gradient": lambda x, w: (-1.0, (0, 0, 0, 0, 0, 0)),
    "gradient that vanishes": lambda x, w: (-0.01 - w[1] ** 2, (0, -2 * w[1], 0, 0, 0, 0)),
    "out of reach behind": lambda x, w: (-1.0 - 1e-3 * w[0], (-1e-3, 0, 0, 0, 0, 0)),
    "out of reach ahead": lambda x, w: (-1.0 + 1e-3 * w[0], (1e-3, 0, 0, 0, 0, 0)),
}
"""Rows that are violated from the start, and stay so at the target."""


@pytest.mark.parametrize("name", OWN)
def test_own_row_violated_from_the_start_does_not_freeze_the_walk(name, robot, gait, simulator):
    """It is repaired where a small change does it; in all other directions x_w goes on with the
    target.
    """
    row = Row(OWN[name])
    governor = hp.ExplicitReferenceGovernor(StackedRows([ForceRows(mass=robot.mass, mu=0.8), row]))
    run = simulator.run(hp.controllers.GovernedController(gait, governor), 2.0)
    assert run.ending == "completed"
    assert not hp.measure(run).stumbled
    assert run["q"][-1, 0] > 0.5
    assert np.abs(run["x_r"] - run["x_w"])[:, :3].max() < 0.07
    assert run["infeasible"][1:30].all()
    h, jacobian = np.zeros(1), np.zeros((1, 6))
    row.evaluate(np.zeros(9), run["x_w"][-1], h, jacobian)
    if "out of reach" in name or "gradient" in name:
        assert governor.status.stuck
        assert run["infeasible"][1:].all()
    else:
        assert not governor.status.stuck
        assert h[0] > (-5e-3 if "lag" not in name else -0.06)


@pytest.mark.parametrize("conditions", ["algorithm", "equation"])
def test_own_row_is_repaired_by_the_shortest_way(robot, conditions):
    """To just inside, along its gradient; without rates of the rest, nothing else moves."""
    a = np.array([0.0, 3.0, 0.0, -1.0, 0.0, 2.0])
    governor = hp.ExplicitReferenceGovernor(
        StackedRows(
            [ForceRows(mass=robot.mass, mu=0.8), Row(lambda x, w: (a @ (w - X_R) - 0.2, a))]
        ),
        alpha_r=0.0,
        alpha_t=0.0,
        conditions=conditions,
    )
    governor.reset(X_R)
    for _ in range(300):
        governor.update(X, X_R, 1e-3)
    np.testing.assert_allclose(governor.applied - X_R, 0.2 * a / (a @ a), atol=2e-4)
    governor.update(X, X_R, 1e-3)
    assert not governor.status.infeasible


def test_stuck_is_a_matter_of_time(robot):
    governor = hp.ExplicitReferenceGovernor(
        StackedRows([ForceRows(mass=robot.mass, mu=0.8), Row(OWN["no gradient"])])
    )
    governor.reset(X_R)
    seen = []
    for _ in range(200):
        governor.update(X, X_R, 1e-3)
        seen.append(governor.status.stuck)
    assert 95 <= seen.index(True) <= 105
    assert all(seen[105:])
    fine = governor_of("paper", robot)
    fine.reset(X_R)
    for _ in range(200):
        fine.update(X, X_R, 1e-3)
    assert not fine.status.stuck


@pytest.mark.parametrize(
    "values", [(np.nan, 0.0), (1.0, (np.nan, 0, 0, 0, 0, 0))], ids=["h", "jacobian"]
)
def test_rows_that_are_no_numbers_are_refused(values, robot):
    governor = hp.ExplicitReferenceGovernor(
        StackedRows([ForceRows(mass=robot.mass, mu=0.8), Row(lambda x, w: values)])
    )
    governor.reset(X_R)
    with pytest.raises(hp.InputError, match="forward speed"):
        governor.update(X, X_R, 1e-3)
    np.testing.assert_array_equal(governor.applied, X_R)


def test_whole_body_controller_takes_no_governor(gait, robot):
    for settings in (
        {"governor": "paper"},
        {"governor": "filter"},
        {"governor_parameters": {"alpha_n": 1.0}},
    ):
        with pytest.raises(hp.InputError, match="no governor"):
            make_controller("wbc", gait, mu=0.3, **settings)
    make_controller("wbc", gait, mu=0.3, governor="none")
    with pytest.raises(hp.InputError, match="ContactForceFilter"):
        make_governor("filter", robot, mu=0.3)


@pytest.mark.parametrize("formulation", ["full", "input_space"])
def test_changes_of_the_objective_do_not_pile_up(formulation, gait, states):
    controller = make_controller("wbc", gait, mu=0.3, formulation=formulation)
    for state in states[:3]:
        controller.prepare(state)
        program = controller.build(state).program
        expected = program.hessian.copy(), program.gradient.copy()
        program.hessian += np.eye(len(program.gradient)) + 1.0
        program.gradient += 1.0
        controller.build(state)
        np.testing.assert_array_equal(program.hessian, expected[0])
        np.testing.assert_array_equal(program.gradient, expected[1])


@pytest.mark.parametrize("names", [("none", "wbc"), ("filter", "none")])
def test_one_gait_serves_two_controllers(names, gait, states):
    """Tick by tick in turns: commands as with a gait each."""
    first, second = (controller_of(name, gait) for name in names)
    alone = controller_of(names[0], hp.make_gait(gait.robot))
    assert first.target is not second.target
    for now, later in itertools.pairwise(states[:20]):
        second.step(later)
        gait.update(later.t + 0.1)
        assert equal(first.step(now), alone.step(now))


def test_a_gait_of_ones_own_is_used_as_it_is(robot):
    class Steered(hp.gaits.StraightGait):
        """Its speed may change during the walk."""

    own = Steered(robot)
    assert controller_of("none", own).gait is own
