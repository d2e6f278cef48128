"""Where the body is on slopes that are too steep for friction: in balance, and the walks there."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin.gaits.downhill import SHARE
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.log.measures import measure
from harpy_pin.simulation.terrain import Plane, Ramp

ROBOT = hp.load_harpy()
STEEP = Plane(slope=np.radians(25.0), heading=0.7)
FRICTION = 0.2


def frames(q: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    data = ROBOT.model.createData()
    pin.framesForwardKinematics(ROBOT.model, data, q)
    return np.array([data.oMf[ROBOT.frame_id(name)].translation for name in names])


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi])
def test_weight_and_thrust_along_the_slope_leave_no_moment_about_the_feet(heading):
    """With as much of the weight on friction as its share."""
    angle = np.radians(25.0)
    gait = OnTerrain(hp.make_gait(ROBOT, speed=0.0), Plane(slope=angle, heading=heading), friction=FRICTION)
    q = gait.initial_state()[0]
    middle = frames(q, ROBOT.feet).mean(axis=0)
    mass = pin.centerOfMass(ROBOT.model, ROBOT.model.createData(), q) - middle
    arm = frames(q, ROBOT.thrusters).mean(axis=0) - middle
    uphill = np.array((np.cos(heading) * np.cos(angle), np.sin(heading) * np.cos(angle), np.sin(angle)))
    thrust = (np.sin(angle) - SHARE * FRICTION * np.cos(angle)) * uphill
    moment = np.cross(mass, (0.0, 0.0, -1.0)) + np.cross(arm, thrust)  # per newton of weight
    across = np.array((-np.sin(heading), np.cos(heading), 0.0))
    assert abs(moment @ across) < 1e-3
    assert abs(np.cross(arm, thrust) @ across) > 0.1


def test_body_and_feet_are_told_where_they_begin():
    flat = OnTerrain(hp.make_gait(ROBOT), STEEP)
    gait = OnTerrain(hp.make_gait(ROBOT), STEEP, friction=FRICTION)
    away = gait.describe()["on_terrain"]["offset"]
    assert float(STEEP.height(*away[:2])) == pytest.approx(away[2])
    np.testing.assert_allclose(gait.initial_state()[0][:3], flat.initial_state()[0][:3] + away, atol=1e-12)
    for t in (0.0, 0.4, 1.1):
        a, b = flat.update(t), gait.update(t)
        np.testing.assert_allclose(b.body[:3], a.body[:3] + away, atol=1e-12)
        np.testing.assert_allclose(b.body[:3] + b.foot_position, a.body[:3] + a.foot_position, atol=1e-12)
        np.testing.assert_array_equal(b.foot_velocity, a.foot_velocity)


@pytest.mark.parametrize(
    ("terrain", "friction"),
    [(STEEP, None), (STEEP, 1.01 * np.tan(np.radians(25.0)) / SHARE), (Ramp(slope=0.4), FRICTION)],
    ids=["friction not given", "enough friction", "no plane"],
)
def test_it_stays_above_its_feet_otherwise(terrain, friction):
    gait = OnTerrain(hp.make_gait(ROBOT), terrain, friction=friction)
    assert gait.describe()["on_terrain"]["offset"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_harpy_walks_where_friction_holds_a_sixth_of_what_it_must(plant):
    """Up a slope of 30 degrees at friction 0.1, whose angle is 5.7 degrees."""
    scenario = hp.Scenario(ground=hp.Ground(mu_s=0.1, slope=np.radians(30.0)), plant=plant, duration=2.0)
    run = hp.walk(scenario)
    assert run.ending == "completed"
    assert run["q"][-1, 0] - run["q"][0, 0] > 0.5
    assert measure(run).slip_mm_per_step < 3.0
