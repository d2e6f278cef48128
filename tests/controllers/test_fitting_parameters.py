"""Settings where a gait brings none: they fit the robot by its mass and legs, and none of them is
Harpy's.
"""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long import long_but
from needs import needs_robots
from own_gaits import OwnGait, Wrapped, scaled
from walks import walked

import harpy_pin as hp
from harpy_pin import InputError
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.contrib.shield import Shield
from harpy_pin.controllers import CondensedController, WholeBodyController, WholeBodyParameters
from harpy_pin.gaits.fitting import fitting_parameters, leg_length
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.wbc import WholeBodyWeights, make_problem
from harpy_pin.wbc.condensed import CondensedSolver

ROBOT = hp.load_harpy()
LEGGED = [name for name, robot in CATALOGUE.items() if robot.feet]
QUICK = ("solo12", "go2", "hyq", "g1", "talos")
"""From 2.5 to 90 kg, on points and on soles."""
NAN = float("nan")


def stood(run: hp.Run) -> bool:
    """Whether it has neither fallen nor sunk by a tenth, and is upright."""
    q = run["q"]
    upright = pin.Quaternion(*q[-1, [6, 3, 4, 5]]).matrix()[2, 2]
    return run.ending == "completed" and bool(q[:, 2].min() > 0.9 * q[0, 2]) and upright > 0.99


def walk(gait: Any, controller: str, *, duration: float = 0.8) -> hp.Run:
    return walked(gait, controller=controller, mu_s=0.8, duration=duration)


@needs_robots
@pytest.mark.parametrize("name", long_but((name for name in LEGGED if name != "bolt"), QUICK))
@pytest.mark.parametrize("controller", ["condensed", "wbc"])
def test_a_gait_of_three_members_stands_and_sways(name: str, controller: str) -> None:
    robot = hp.load_robot(name)
    for kind in (
        ("stand", "sway") if robot.flat_feet or name == "solo8" else ("stand", "sway", "trot")
    ):
        run = walk(OwnGait(robot, kind), controller)
        assert stood(run), kind
        assert (run["foot_position"][..., 2].max() > 0.04 * run["q"][0, 2]) == (kind == "trot")


@needs_robots
@pytest.mark.parametrize(
    "name", long_but((name for name in LEGGED if name != "solo8"), ("bolt", *QUICK))
)
@pytest.mark.parametrize("controller", ["condensed", "wbc"])
def test_a_walk_of_ones_own_walks(name: str, controller: str) -> None:
    """Steps that balance, as those of this library, but without what it says of settings."""
    robot = hp.load_robot(name)
    inner = hp.WalkingGait(robot, "step" if len(robot.corners) == 2 else "trot", (0.1, 0.0, 0.0))
    run = walk(Wrapped(inner), controller, duration=1.0)
    assert stood(run)
    assert run["foot_position"][..., 2].max() > 0.04 * run["q"][0, 2]


@needs_robots
@pytest.mark.parametrize("mass", [0.3, 10.0])
@pytest.mark.parametrize("length", [0.4, 1.0, 2.5])
def test_a_robot_of_another_size_stands_and_trots(mass: float, length: float) -> None:
    robot = scaled(hp.load_robot("go2"), mass=mass, length=length)
    for kind in ("stand", "sway", "trot"):
        assert stood(walk(OwnGait(robot, kind), "condensed")), kind


@needs_robots
@given(
    mass=st.floats(0.05, 50.0),
    length=st.floats(0.1, 5.0),
    name=st.sampled_from(("go2", "bolt", "g1")),
)
@settings(max_examples=20)
def test_settings_scale_with_mass_and_legs(mass: float, length: float, name: str) -> None:
    """Forces in weights, weights on squared forces in one over the squared weight, on squared
    turning in length².
    """
    robot = hp.load_robot(name)
    large = scaled(robot, mass=mass, length=length)
    assert leg_length(large) == pytest.approx(length * leg_length(robot))
    own, other = (WholeBodyParameters.for_gait(OwnGait(one, "stand")) for one in (robot, large))
    for force in ("min_normal_force", "max_normal_force"):
        assert getattr(other, force) == pytest.approx(mass * getattr(own, force))
    assert other.min_normal_force * len(robot.feet) < 0.11 * 9.81 * large.mass
    assert other.max_normal_force * robot.corners[0] > 1.9 * 9.81 * large.mass
    assert other.contact_threshold <= min(
        1.0, 0.2 * 9.81 * large.mass / len(robot.feet) * (1.0 + 1e-9)
    )
    assert other.weights.force == pytest.approx(own.weights.force / mass**2)
    for weight in ("orientation", "arms", "posture"):
        assert getattr(other.weights, weight) == pytest.approx(
            length**2 * getattr(own.weights, weight)
        )
    for k_p, k_d in (other.body, other.orientation, other.swing):
        assert k_d == pytest.approx(2.0 * np.sqrt(k_p))  # critically damped
        assert k_d < 1000.0  # and stable over a tick of 1 ms
    if name == "bolt":
        assert other.orientation[0] == pytest.approx(own.orientation[0] / length)


@pytest.mark.parametrize("controller", ["condensed", "wbc"])
def test_harpy_walks_by_the_rule_too(controller: str) -> None:
    """A gait around its own that passes nothing on."""
    run = walk(Wrapped(hp.make_gait(ROBOT)), controller, duration=3.0)
    assert stood(run)
    assert run["q"][-1, 0] > 0.8


def test_what_is_given_comes_before_the_gaits_and_the_gaits_before_the_robots() -> None:
    gait = Wrapped(hp.gaits.make_commanded_gait(ROBOT))
    gait.controller_parameters = {"body": [36.0, 12.0], "weights": {"swing": 3.0, "thrust": 1e-3}}
    rule = fitting_parameters(ROBOT)
    p = WholeBodyParameters.for_gait(
        gait, hold_ticks=3, weights={"swing": 2.0}, limits={"mu": 0.7}, solver=None
    )
    assert (p.body, p.hold_ticks, p.limits.mu, p.solver) == ((36.0, 12.0), 3, 0.7, "proxqp")
    assert (p.weights.swing, p.weights.thrust, p.weights.force) == (
        2.0,
        1e-3,
        rule["weights"]["force"],
    )
    assert (p.orientation, p.limits.friction_share) == (rule["orientation"], 0.75)
    made = hp.make_controller("wbc", gait, mu=0.7, hold_ticks=3, weights={"swing": 2.0})
    assert made.parameters == p
    for bad, message in (
        ({"gain": 1.0}, "gain"),
        ({"body": (NAN, 1.0)}, "body"),
        ({"weights": 3.0}, "mapping"),
    ):
        with pytest.raises(InputError, match=message):
            WholeBodyParameters.for_gait(gait, **bad)
    with pytest.raises(InputError, match="must be a Gait"):
        WholeBodyParameters.for_gait(ROBOT)  # type: ignore[arg-type]


@needs_robots
@pytest.mark.parametrize("kind", [CondensedController, WholeBodyController])
def test_controllers_that_are_given_nothing_fit(go2: hp.Robot, kind: type) -> None:
    """Whoever makes them, and also what they are made of."""
    for gait in (OwnGait(go2, "stand"), hp.Standing(go2), hp.WalkingGait(go2), hp.make_gait(ROBOT)):
        assert kind(gait).parameters == WholeBodyParameters.for_gait(gait)
    weights = WholeBodyWeights(**fitting_parameters(go2)["weights"])
    assert CondensedSolver(go2).weights == make_problem("full", go2).weights == weights
    standing = WholeBodyParameters.for_gait(hp.Standing(go2))
    assert CondensedBatch(go2, 2).parameters == standing


def test_harpys_settings_are_its_gaits() -> None:
    """The numbers of the published walks, and by weight those of another robot of its kind."""
    p = WholeBodyParameters.for_gait(hp.make_gait(ROBOT))
    assert (p.body, p.orientation, p.swing) == ((100.0, 40.0), (210.0, 21.0), (850.0, 85.0))
    assert (p.contact_damping, p.min_normal_force, p.max_normal_force) == (100.0, 11.0, 200.0)
    assert (p.limits.friction_share, p.estimate_friction, p.formulation) == (
        0.4,
        True,
        "input_space",
    )
    published = {
        "orientation": 0.25,
        "swing": 12.0,
        "posture": 1e-6,
        "arms": 1.0,
        "thrust": 3.5e-4,
        "force": 1.9e-5,
    }
    assert p.weights == WholeBodyWeights(**published)
    assert WholeBodyParameters.for_gait(hp.gaits.make_commanded_gait(ROBOT)) == p
    large = WholeBodyParameters.for_gait(
        hp.make_gait(scaled(ROBOT, mass=10.0, length=1.0), stiffness=80_000.0)
    )
    assert (large.min_normal_force, large.max_normal_force) == (
        pytest.approx(110.0),
        pytest.approx(2000.0),
    )
    assert large.weights.force == pytest.approx(1.9e-7)


def test_parameters_without_a_robot_are_not_made() -> None:
    """There are no numbers that fit every robot."""
    for kind in (WholeBodyParameters, WholeBodyWeights):
        with pytest.raises(TypeError, match="missing"):
            kind()


def test_a_filter_knows_forces_in_weights_and_torques_by_the_legs() -> None:
    own = hp.governors.ContactForceFilter(ROBOT).parameters
    assert own == hp.ContactForceFilterParameters()
    large = Shield(scaled(ROBOT, mass=10.0, length=2.0), mu=0.4).governor.parameters
    assert large.mu == 0.4
    for force in ("margin", "min_normal_force", "contact_threshold", "thrust_authority"):
        assert getattr(large, force) == pytest.approx(10.0 * getattr(own, force))
    assert large.torque_authority == pytest.approx(20.0 * own.torque_authority)
    assert (large.thrust, large.torque) == (
        pytest.approx(1e-2 * own.thrust),
        pytest.approx(own.torque / 400.0),
    )
    np.testing.assert_allclose(large.angular, 4.0 * np.array(own.angular))


@needs_robots
def test_the_papers_controller_refuses_other_robots() -> None:
    for name in ("go2", "bolt", "g1"):
        with pytest.raises(hp.HarpyError, match=name if name != "bolt" else "FL_FOOT"):
            hp.make_controller(
                "governed", hp.WalkingGait(hp.load_robot(name)), mu=0.5, governor="none"
            )


@needs_robots
def test_the_papers_governor_refuses_robots_lighter_than_its_force() -> None:
    bolt = hp.load_robot("bolt")
    with pytest.raises(InputError, match="20 N, is more than 'bolt' weighs"):
        hp.controllers.make_governor("paper", bolt, mu=0.5)
    assert (
        hp.controllers.make_governor("paper", bolt, mu=0.5, parameters={"min_normal_force": 6.0})
        is not None
    )
