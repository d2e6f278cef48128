"""Jumps and flights in the plants, against momentum, ballistics and friction cones; and what is
refused.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from walks import walked

import harpy_pin as hp
from comparison.studies.built import built_harpy
from harpy_pin.contrib.flight import Fly, Flying, FlyingGait, Jump
from harpy_pin.contrib.flight.flying_gait import PHASES

FRICTION = 0.6
WEIGHT = 4.02 * 9.81


def flown(flights, *, duration=2.8, noise=False, velocity=None, **how):
    gait = Flying(
        flights=flights, start=0.1, **({} if velocity is None else {"velocity": velocity})
    )
    return walked(
        gait=gait, mu_s=FRICTION, noise=hp.Noise.typical(float(noise)), duration=duration, **how
    )


def assert_lands(run, place, within=0.03):
    """Where it should, and softly."""
    air, land = ticks(run, "air"), ticks(run, "land")
    assert run.ending == "completed"
    assert (middle(run, land[-1]) - middle(run, air[0]))[:2] == pytest.approx(place, abs=within)
    assert np.linalg.norm(run["foot_force"][land], axis=2).sum(axis=1).max() <= 2.0 * WEIGHT


def ticks(run, phase):
    return np.flatnonzero(run["flight_phase"].ravel() == PHASES.index(phase))


def middle(run, tick):
    return run["foot_position"][tick].mean(axis=0)


@pytest.fixture(scope="module")
def jumped():
    return flown(Jump(height=0.31, forward=0.4))


def test_a_jump_is_as_high_and_as_far_as_asked_for_and_stands(jumped):
    air, land = ticks(jumped, "air"), ticks(jumped, "land")
    assert jumped.ending == "completed"
    assert jumped["q"][air, 2].max() - jumped["q"][air[0], 2] == pytest.approx(0.31, abs=0.015)
    assert (middle(jumped, land[-1]) - middle(jumped, air[0]))[:2] == pytest.approx(
        (0.4, 0.0), abs=0.02
    )
    rise = jumped["q"][air, 2].max() - jumped["q"][air[0], 2]
    assert rise == pytest.approx(
        jumped["v"][air[0], 2] ** 2 / (2.0 * 0.5 * 9.81), rel=0.04
    )  # v² / 2 g (1 − carried)
    assert jumped["foot_position"][air, :, 2].min(axis=1).max() > 0.2
    end = jumped["q"][-1]
    assert 2.0 * np.hypot(end[3], end[4]) < 0.02
    assert end[2] == pytest.approx(jumped["q"][0, 2], abs=0.02)


def test_momentum_in_the_air_changes_by_thrust_and_gravity_alone(robot, jumped):
    """Linear and angular momentum about the centre of mass, by Pinocchio, against the thrusts
    logged.
    """
    model, data = robot.model, robot.model.createData()
    air = ticks(jumped, "air")[20:-5]
    frames = [robot.frame_id(name) for name in robot.thrusters]
    impulse, begin = np.zeros(6), None
    for k in air:
        q, v = jumped["q"][k], jumped["v"][k]
        pin.computeCentroidalMomentum(model, data, q, v)
        now = np.concatenate((data.hg.linear, data.hg.angular))
        if begin is None:
            begin = now
        pin.updateFramePlacements(model, data)
        last = now
        for frame, force in zip(frames, jumped["thrust"][k], strict=True):
            impulse[:3] += 1e-3 * force
            impulse[3:] += 1e-3 * np.cross(data.oMf[frame].translation - data.com[0], force)
        impulse[2] -= 1e-3 * WEIGHT
        assert np.abs(jumped["foot_force"][k]).max() == 0.0
    assert last[:3] - begin[:3] == pytest.approx(impulse[:3], abs=0.05)
    assert last[3:] - begin[3:] == pytest.approx(impulse[3:], abs=0.02)


@pytest.mark.parametrize(("controller", "plant"), [("condensed", "compliant"), ("wbc", "mujoco")])
def test_forces_stay_in_their_cones_at_take_off_and_landing(controller, plant):
    """Those asked for at every tick, those of the plant within Coulomb's; and no more than twice
    the weight.
    """
    run = flown(Jump(height=0.31, forward=0.42), controller=controller, plant=plant, noise=True)
    assert run.ending == "completed"
    on_ground = np.concatenate([ticks(run, phase) for phase in ("bend", "push", "land")])
    desired = run["desired_force"].reshape(len(run), -1, 3)[on_ground]
    tangent, normal = np.linalg.norm(desired[..., :2], axis=2), desired[..., 2]
    assert (normal > -1e-6).all()
    assert (tangent <= 0.75 * FRICTION * normal + 1e-5).all()
    force = run["foot_force"]
    assert (
        np.linalg.norm(force[..., :2], axis=2) <= FRICTION * np.maximum(force[..., 2], 0.0) + 0.1
    ).all()
    land = ticks(run, "land")
    assert np.linalg.norm(force[land], axis=2).sum(axis=1).max() <= 2.0 * WEIGHT
    assert (run["slip_path"][land[-1]] - run["slip_path"][land[0]]).sum() < 1e-3


@settings(max_examples=2, deadline=None)
@given(height=st.floats(0.12, 0.42), forward=st.floats(-0.3, 0.4), left=st.floats(-0.1, 0.1))
def test_jumps_land_where_they_should(height, forward, left):
    """Higher ones miss by up to 4 cm, see docs/flight.md."""
    assert_lands(
        flown(Jump(height=height, forward=forward, left=left), duration=3.4), (forward, left)
    )


def test_a_jump_whose_lag_is_known_lands_softly_where_it_should():
    part, fans = (
        hp.Condensed(parameters={"thrust_lag": 0.1}),
        hp.Actuators(thrusters=hp.Thrusters(lag=0.1)),
    )
    jump = Jump(height=0.31, forward=0.42)
    assert_lands(
        flown(jump, controller=part, duration=3.2, noise=True, actuators=fans), (0.42, 0.0)
    )


def test_the_plan_is_that_of_the_controllers_lag():
    gait = FlyingGait(hp.make_commanded_gait(hp.load_harpy()), Jump(forward=0.2))
    before = gait._plans
    hp.make_controller("condensed", gait, mu=FRICTION)
    assert gait._plans is before
    hp.make_controller("condensed", gait, mu=FRICTION, thrust_lag=0.05)
    assert gait._plans is not before
    with pytest.raises(hp.InputError, match="lag"):
        gait.expect_lag(-1.0)


def test_hovering_with_noise_stays_within_two_centimetres():
    run = flown(Fly(hover=1.5), duration=5.1, noise=True)
    air = ticks(run, "air")
    still = air[
        np.ptp(np.stack([run["body_plan"][air - 1], run["body_plan"][air]]), axis=0).max(axis=1)
        == 0.0
    ][500:]
    assert len(still) > 500
    assert np.linalg.norm(run["q"][still, :3] - run["body_plan"][still], axis=1).max() < 0.02
    thrust = run["thrust"][still].sum(axis=1).mean(axis=0)
    assert thrust == pytest.approx((0.0, 0.0, WEIGHT), abs=0.5)


def test_it_flies_to_a_slope_and_walks_on():
    slope = np.radians(15.0)
    ramp, ahead = hp.ground.Ramp(slope=slope, start=0.6, length=3.0), ((0.0, 0.3, 0.0, 0.0),)
    run = flown(
        Fly(forward=1.2, acceleration=2.0), terrain=ramp, velocity=ahead, duration=8.6, noise=True
    )
    assert run.ending == "completed"
    land = ticks(run, "land")
    feet = middle(run, land[-1])
    assert feet[0] == pytest.approx(1.2, abs=0.03)
    assert feet[2] == pytest.approx(0.6 * np.tan(slope), abs=0.02)
    assert np.linalg.norm(run["foot_force"][land], axis=2).sum(axis=1).max() <= 2.0 * WEIGHT
    assert run["q"][-1, 0] - feet[0] > 0.2


@pytest.mark.parametrize("rise", [-0.03, 0.03])
def test_touchdown_is_felt_where_the_ground_is_not_as_expected(robot, rise):
    """The gait knows flat ground; where it lands there is a platform, or a pit."""
    terrain = hp.ground.Ramp(slope=float(np.arctan(rise / 0.1)), start=0.4, length=0.1)
    gait = FlyingGait(hp.make_commanded_gait(robot), Fly(forward=0.8, acceleration=2.0), start=0.1)
    run = walked(gait, mu_s=FRICTION, terrain=terrain, duration=6.2)
    assert run.ending == "completed"
    assert middle(run, -1)[2] == pytest.approx(rise, abs=0.005)
    assert run["q"][-1, 2] == pytest.approx(run["q"][0, 2] + rise, abs=0.02)


def test_several_flights_one_after_the_other_and_time_begins_anew(robot):
    gait = FlyingGait(
        hp.make_commanded_gait(robot), [Jump(height=0.15), Jump(height=0.2)], start=0.1
    )
    scenario = hp.Scenario(ground=hp.Ground(mu_s=FRICTION), duration=6.0)
    first = hp.walk(scenario, gait=gait)
    phases = first["flight_phase"].ravel()
    changes = [PHASES[int(k)] for k in phases[np.flatnonzero(np.diff(phases, prepend=-1))]]
    one = ["stand", "bend", "push", "air", "land"]
    assert changes == [*one, *one, "stand", "gait"]
    assert gait.phase == "gait"
    again = hp.walk(replace(scenario, duration=1.5), gait=gait)
    assert np.array_equal(first["q"][: len(again)], again["q"])


def test_a_scenario_keeps_its_flights(tmp_path):
    part = Flying(flights=(Jump(forward=0.2), Fly(left=0.5, hover=1.0)), velocity=(0.2, 0.0, 0.0))
    scenario = hp.Scenario(gait=part, duration=0.02)
    assert hp.Scenario.from_dict(scenario.to_dict()) == scenario
    hp.walk(scenario, save=tmp_path / "run.npz")
    assert hp.Scenario.of(hp.Run.load(tmp_path / "run.npz")) == scenario


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Jump(height=-1.0), "height"),
        (lambda: Jump(forward=float("nan")), "forward"),
        (lambda: Jump(carried=1.0), "carried"),
        (lambda: Fly(hover=-1.0), "hover"),
        (lambda: Flying(flights=()), "at least one"),
        (lambda: Flying(flights="hop"), "fly, jump"),
        (lambda: Flying(flights={"name": "jump", "tall": 1.0}), "tall"),
        (lambda: hp.Scenario(gait="flying", controller="governed"), "neither jumps nor flies"),
        (lambda: hp.build(hp.Scenario(gait=Flying(flights=Jump(forward=3.0)))), "too far"),
        (lambda: hp.build(hp.Scenario(gait=Flying(flights=Jump(height=0.05)))), "at least"),
        (lambda: FlyingGait(hp.make_gait(hp.load_harpy()), Jump()), "at rest"),
        (lambda: FlyingGait(hp.Standing(hp.load_robot("solo12")), Jump()), "thrusters or rotors"),
    ],
)
def test_what_cannot_fly_is_refused(make, says):
    with pytest.raises(hp.InputError, match=says):
        make()


def test_bad_samples_are_ignored_and_times_refused():
    gait = FlyingGait(hp.make_commanded_gait(hp.load_harpy()), Jump())
    before = gait.update(0.1).body.copy()
    state = hp.build(hp.Scenario(duration=0.1)).simulator.state.copy()
    state.q[0] = np.nan
    gait.observe(state)
    assert np.array_equal(gait.update(0.1).body, before)
    with pytest.raises(hp.InputError, match="finite"):
        gait.update(float("inf"))


def rotorcraft(limit: float) -> FlyingGait:
    """Solo12 with a rotor at each shoulder, which flies half a metre ahead."""
    turns = {"FL": 1, "FR": -1, "HL": -1, "HR": 1}
    rotors = [
        hp.Rotor(f"{leg}_SHOULDER", limit=(0.0, limit), drag=0.02 * turn)
        for leg, turn in turns.items()
    ]
    flight = Fly(height=0.3, forward=0.5, hover=0.5)
    return FlyingGait(hp.Standing(hp.load_robot("solo12", rotors=rotors)), flight, start=0.1)


@needs_robots
def test_a_rotorcraft_with_legs_flies_to_a_place_and_stands():
    how = {"mu_s": FRICTION, "stiffness": 8000.0, "noise": hp.Noise.typical(), "duration": 6.0}
    run = walked(
        rotorcraft(15.0),
        make=lambda gait: hp.make_controller("condensed", gait, mu=FRICTION),
        **how,
    )
    air, land = (ticks(run, name) for name in ("air", "land"))
    assert run.ending == "completed"
    assert run["foot_position"][-1].mean(axis=0)[:2] == pytest.approx((0.5, 0.0), abs=0.02)
    assert run["foot_position"][air, :, 2].min(axis=1).max() == pytest.approx(0.3, abs=0.03)
    assert 0.05 < 2.0 * np.abs(run["q"][air, 4]).max() < 0.3
    assert (
        np.linalg.norm(run["foot_force"][land], axis=2).sum(axis=1).max()
        <= 2.0 * run.metadata["mass"] * 9.81
    )
    assert 2.0 * np.hypot(run["q"][-1, 3], run["q"][-1, 4]) < 0.02


@needs_robots
def test_a_robot_with_closed_loops_jumps():
    """Harpy as it is built, with thrusters that push in any direction, from bent knees."""
    posture = np.array((0.0, -0.4, 0.8) * 2)
    gait = FlyingGait(hp.Standing(built_harpy(), posture=posture), Jump(forward=0.2), start=0.1)
    scenario = hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.6), duration=2.5)
    run = hp.walk(scenario, gait=gait)
    air, land = ticks(run, "air"), ticks(run, "land")
    assert run.ending == "completed"
    assert run["q"][air, 2].max() - run["q"][air[0], 2] == pytest.approx(0.3, abs=0.015)
    way = middle(run, land[-1]) - middle(run, air[0])
    assert way[:2] == pytest.approx((0.2, 0.0), abs=0.04)


def test_rotors_that_do_not_carry_the_robot_are_refused():
    with pytest.raises(hp.InputError, match="to spare"):
        rotorcraft(5.0)
