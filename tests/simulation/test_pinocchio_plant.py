"""The plant by Pinocchio's ABA: its force law as printed, its steps, and the same walks as in the
other plants.
"""

from math import exp, hypot

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_robots
from numpy.polynomial.legendre import Legendre
from scipy.integrate import solve_ivp
from walks import assert_same, put, scenario, started, walked

import harpy_pin as hp
from harpy_pin import Command, Ground, Simulator
from harpy_pin.ground.terrain import Plane
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.simulation import PinocchioPlant
from harpy_pin.simulation.pinocchio_plant import JOINT_TOLERANCE, contact_force, legendre_step

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
G = 9.81
MASS = 2.0
"""Of the sled."""
COULOMB = {"mu_s": 0.25, "mu_c": 0.25, "mu_v": 0.0}
"""Friction with closed forms."""

heights = st.floats(-0.05, 0.02)
speeds = st.floats(-2.0, 2.0)
coefficients = st.floats(0.05, 1.5)


def force(height, velocity, ground, tolerance):
    """Of the ground on one point."""
    contact = ground.stiffness, ground.damping, ground.mu_s, ground.mu_c
    return np.array(contact_force(height, velocity, contact, ground, tolerance))


def normal_as_printed(height, speed, ground):
    """E1."""
    damping = 0.0 if speed > 0.0 else ground.damping
    return -ground.stiffness * height - damping * speed if height <= 0.0 else 0.0


def friction_as_printed(speed, normal, ground):
    """E2, its magnitude."""
    bell = exp(-((speed / ground.stribeck_velocity) ** 2))
    return (ground.mu_c + (ground.mu_s - ground.mu_c) * bell) * normal + ground.mu_v * speed


@given(heights, speeds, speeds, speeds, coefficients)
def test_force_is_e1_and_e2(height, along, across, up, mu):
    """But for its factor s / √(s² + ε²) at the sliding speed s."""
    ground, tolerance = Ground(mu_s=mu), 1e-3
    found = force(height, (along, across, up), ground, tolerance)
    normal = normal_as_printed(height, up, ground)
    assert found[2] == pytest.approx(normal, rel=1e-12, abs=1e-12)
    speed = hypot(along, across)
    most = friction_as_printed(speed, normal, ground) if normal > 0.0 else 0.0
    assert hypot(*found[:2]) == pytest.approx(
        most * speed / hypot(speed, tolerance), rel=1e-9, abs=1e-12
    )
    assert found[:2] @ (along, across) <= 0.0
    assert abs(found[0] * across - found[1] * along) <= 1e-9 * (
        1.0 + most
    )  # straight against the motion
    assert hypot(*found[:2]) <= mu * normal + ground.mu_v * speed + 1e-12
    if height > 0.0:
        np.testing.assert_array_equal(found, 0.0)


@given(heights, speeds, speeds, speeds)
def test_each_axis_apart_is_a_box(height, along, across, up):
    ground, tolerance = Ground(mu_s=0.6, cone="per_axis"), 1e-3
    found = force(height, (along, across, up), ground, tolerance)
    normal = normal_as_printed(height, up, ground)
    for part, speed in zip(found[:2], (along, across), strict=True):
        most = friction_as_printed(abs(speed), normal, ground) if normal > 0.0 else 0.0
        assert part == pytest.approx(-most * speed / hypot(speed, tolerance), rel=1e-9, abs=1e-12)


def test_a_foot_holds_nearly_all_of_the_static_friction():
    """The figure of the page: 0.96 of μ_s, where the smooth friction is largest, at the default
    tolerance.
    """
    ground = Ground(mu_v=0.0)
    held = max(
        abs(force(-1e-3, (s, 0.0, 0.0), ground, 1e-3)[0]) for s in np.linspace(1e-4, 0.02, 400)
    )
    assert held / (ground.mu_s * ground.stiffness * 1e-3) == pytest.approx(0.96, abs=0.003)


@pytest.mark.parametrize("stages", [1, 2, 3, 8, 21])
def test_a_step_is_the_polynomial_of_legendre(stages):
    """On ẏ = −λ y a step multiplies by P_s(1 − 2 λ h / (s (s + 1))), which is within 1 up to λ h =
    s (s + 1).
    """
    most, polynomial = stages * (stages + 1), Legendre.basis(stages)
    for x in np.linspace(0.0, most, 50):
        (found,) = legendre_step(lambda y, x=x: -x * y, np.ones(1), 1.0, stages)
        assert found == pytest.approx(polynomial(1.0 - 2.0 * x / most), abs=1e-9)
        assert abs(found) < 1.0 + 1e-9


def test_a_step_is_of_first_order():
    errors = []
    for n in (20, 40, 80):
        y = np.array([1.0, 0.0])
        for _ in range(n):
            y = legendre_step(lambda y: np.array([y[1], -y[0]]), y, 1.0 / n, 4)
        errors.append(np.abs(y - (np.cos(1.0), -np.sin(1.0))).max())
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.1)
    assert errors[2] == pytest.approx(0.5 * errors[1], rel=0.1)


def test_flight_converges_to_pinocchio(robot):
    """Under torques and thrusts, to pin.aba integrated by the midpoint rule in short steps."""
    model, data = robot.model, robot.model.createData()
    command = Command(np.linspace(-1.0, 1.0, 6), np.array([[1.0, -2.0, 12.0], [-3.0, 1.0, 18.0]]))
    q = np.array([0, 0, 2.0, 0.1, -0.2, 0.3, 0.9, 0.1, -0.2, 0.5, 0.0, -0.3, 0.6])
    q, v = pin.normalize(model, q), np.linspace(-0.3, 0.3, 12)

    def acceleration(q, v):
        tau = np.concatenate((np.zeros(6), command.torque)) - model.damping * v
        for name, thrust in zip(robot.thrusters, command.thrust, strict=True):
            frame = robot.frame_id(name)
            tau += (
                pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3].T
                @ thrust
            )
        return pin.aba(model, data, q, v, tau)

    exact, exact_v, h = q, v, 2e-5
    for _ in range(2000):
        middle = exact_v + 0.5 * h * acceleration(exact, exact_v)
        change = h * acceleration(pin.integrate(model, exact, 0.5 * h * exact_v), middle)
        exact, exact_v = pin.integrate(model, exact, h * middle), exact_v + change
    errors = []
    for dt in (4e-4, 2e-4, 1e-4):
        plant = PinocchioPlant(robot, dt=dt)
        plant.reset(q, v)
        plant.advance(command, steps=round(0.04 / dt))
        gap = np.concatenate((pin.difference(model, exact, plant.q), plant.v - exact_v))
        errors.append(np.abs(gap).max())
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1] < 3e-3


@needs_robots
def test_rotors_lift_and_turn_as_in_the_other_plant():
    """Thrust along tilted axes, with drag: the gap of two integrators of first order halves with
    the step.
    """
    robot = hp.load_robot("hextilt")
    rng, gaps = np.random.default_rng(2), []
    q, v = hp.Hovering(robot).initial_state()
    v += 0.3 * rng.standard_normal(len(v))
    torque = 0.05 * rng.standard_normal(len(robot.joints))
    terms = hp.Dynamics(robot)
    terms.update(q, v)
    command = Command(torque, 5.0 * terms.rotor_axis)
    push = hp.Push(0.0, (0.4, -0.3, 0.2), 0.02)
    for dt in (5e-4, 2.5e-4):
        plants = [kind(robot, dt=dt) for kind in (Simulator, PinocchioPlant)]
        for plant in plants:
            plant.reset(q, v)
            plant.advance(command, (push,), steps=round(0.03 / dt))
        gaps.append(np.abs(plants[0].v - plants[1].v).max())
    assert np.abs(plants[0].v - v).max() > 0.1
    assert gaps[1] < 0.6 * gaps[0] < 0.01


def test_energy_of_flight_stays(robot):
    """Kinetic and potential energy of a robot that tumbles with swinging legs; what is gained
    halves with the step.
    """
    free = robot.with_joints(damping=np.zeros(6))
    model, data = free.model, free.model.createData()
    q, v = hp.make_gait(robot).initial_state()
    q[2], v = 2.0, np.array([0.5, 0.0, 1.0, 1.0, -2.0, 0.5, 1.0, -1.0, 2.0, -1.0, 1.0, -2.0])
    gained = []
    for dt in (5e-4, 2.5e-4):
        plant = PinocchioPlant(free, dt=dt)
        plant.reset(q, v)
        begin = pin.computeMechanicalEnergy(model, data, plant.q, plant.v)
        plant.advance(Command(np.zeros(6), np.zeros((2, 3))), steps=round(0.1 / dt))
        gained.append(pin.computeMechanicalEnergy(model, data, plant.q, plant.v) - begin)
    kinetic = pin.computeKineticEnergy(model, data, q, v)
    assert abs(gained[0]) < 2e-3 * kinetic
    assert gained[1] == pytest.approx(0.5 * gained[0], rel=0.2)


def test_a_fall_follows_spring_and_damper_and_rests_as_deep_as_they_say(sled):
    ground = Ground(mu_s=0.5)
    k, d = ground.stiffness, ground.damping

    def slope(_, y):
        return [y[1], -G + normal_as_printed(y[0], y[1], ground) / MASS]

    times = np.linspace(0.0, 0.1, 26)
    exact = solve_ivp(
        slope, (0, 0.1), [0.005, 0.0], rtol=1e-9, atol=1e-12, max_step=1e-4, t_eval=times
    ).y.T
    assert exact[:, 0].min() < -0.5 * MASS * G / k  # it went in
    errors = []
    for dt in (4e-4, 2e-4, 1e-4):
        plant, rows = put(PinocchioPlant(sled, ground, dt=dt), z=0.005), []
        for _ in times:
            rows.append([plant.q[2], plant.v[2]])
            plant.advance(NOTHING, steps=round(0.004 / dt))
        errors.append(np.abs(np.array(rows) - exact).mean(axis=0))
    errors = np.array(errors)
    assert np.all(errors[2] < 0.4 * errors[0])
    assert errors[2, 0] < 2e-5
    assert d > 0.0
    plant = put(PinocchioPlant(sled, ground), z=0.001)
    plant.advance(NOTHING, steps=2000)
    assert plant.q[2] == pytest.approx(-MASS * G / k, rel=1e-6)
    np.testing.assert_allclose(plant.state.foot_force, [[0, 0, MASS * G]], atol=1e-6)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9])
@pytest.mark.parametrize("tolerance", [1e-3, 4e-3])
def test_a_foot_that_holds_creeps_as_the_page_says(sled, share, tolerance):
    """At ε r / √(1 − r²) under the share r of its largest friction."""
    angle = np.arctan(share * 0.25)
    gravity = G * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    plant = PinocchioPlant(sled, Ground(**COULOMB), gravity=gravity, stiction_tolerance=tolerance)
    put(plant).advance(NOTHING, steps=600)
    assert plant.v[0] == pytest.approx(tolerance * share / np.sqrt(1.0 - share**2), rel=1e-3)


def test_a_foot_that_slides_does_so_as_coulomb_says(sled):
    angle = np.arctan(0.5)
    gravity = G * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    plant = put(PinocchioPlant(sled, Ground(**COULOMB), gravity=gravity), v=(0.3, 0, 0, 0, 0, 0))
    plant.advance(NOTHING, steps=400)
    assert plant.v[0] == pytest.approx(
        0.3 + G * (np.sin(angle) - 0.25 * np.cos(angle)) * 0.2, rel=1e-4
    )


def test_a_slope_is_tilted_gravity(sled):
    slope, heading = 0.3, 0.7
    turn = pin.exp3(slope * np.array([np.sin(heading), -np.cos(heading), 0.0]))
    on = PinocchioPlant(sled, Ground(terrain=Plane(slope=slope, heading=heading)))
    flat = PinocchioPlant(sled, Ground(), gravity=turn.T @ (0.0, 0.0, -G))
    for plant in (on, flat):
        put(plant, z=0.0).advance(NOTHING, steps=200)
    np.testing.assert_allclose(on.state.foot_position, flat.state.foot_position @ turn.T, atol=1e-9)
    np.testing.assert_allclose(on.state.foot_force, flat.state.foot_force @ turn.T, atol=1e-6)
    assert on.slip_path[0] == pytest.approx(flat.slip_path[0], rel=1e-6)
    assert on.slip_path[0] > 1e-3


def test_strips_are_felt(sled):
    """A sled that glides from a strip of ice onto soft ground: forces as the strips say."""
    ground = Ground(
        mu_s=0.5, friction_strips=((0.0, 0.1, 0.0),), stiffness_strips=((0.1, 9.0, 2000.0),)
    )
    plant = put(PinocchioPlant(sled, ground), x=0.02, v=(0.5, 0, 0, 0, 0, 0))
    plant.advance(NOTHING, steps=100)
    assert plant.state.foot_force[0, 0] == pytest.approx(
        -0.85 * plant.v[0], rel=1e-3
    )  # viscous alone
    plant.advance(NOTHING, steps=3000)
    assert plant.q[0] > 0.1
    assert plant.q[2] == pytest.approx(-MASS * G / 2000.0, rel=1e-3)
    assert abs(plant.v[0]) < 1e-3


def test_a_joint_that_dry_friction_holds_creeps(robot):
    """In the air, where all joints have the same friction and one has a torque."""
    share, plant = 0.5, PinocchioPlant(robot, actuators=hp.Actuators(coulomb_friction=0.4))
    q, v = hp.make_gait(robot).initial_state()
    q[2] = 3.0
    plant.reset(q, v)
    torque = np.zeros(6)
    torque[2] = share * 0.4
    plant.advance(Command(torque, np.zeros((2, 3))), steps=300)
    friction = torque[2] - robot.model.damping[8] * plant.v[8]
    assert friction == pytest.approx(
        0.4 * plant.v[8] / np.hypot(plant.v[8], JOINT_TOLERANCE), rel=0.02
    )
    assert 0.0 < plant.v[8] < JOINT_TOLERANCE


def test_a_walk_comes_to_that_of_the_compliant_plant():
    """The same place to a millimetre; the creep, which is what differs, goes with the tolerance."""
    how = {"mu_s": 0.25, "controller": hp.Governed(governor="none"), "duration": 0.5}
    ours = walked(plant="compliant", **how)
    gaps, slips = [], []
    for tolerance in (8e-3, 1e-3):
        theirs = walked(plant=hp.Pinocchio(stiction_tolerance=tolerance), **how)
        gaps.append(np.abs(theirs["q"] - ours["q"])[:, :3].max())
        slips.append(theirs["slip_path"][-1].sum() - ours["slip_path"][-1].sum())
        friction = np.linalg.norm(theirs["foot_force"][..., :2], axis=-1)
        assert np.all(friction <= 0.25 * theirs["foot_force"][..., 2] * (1.0 + 1e-9) + 0.85 * 0.5)
    assert gaps[1] < gaps[0] < 5e-3
    assert gaps[1] < 1e-3
    assert 0.0 < slips[1] < 0.3 * slips[0]
    normals = [run["foot_force"][50:, :, 2].sum(axis=1).mean() for run in (ours, theirs)]
    assert normals[1] == pytest.approx(normals[0], rel=5e-3)


@needs_robots
@pytest.mark.parametrize("name", ["solo12", "bolt", "go2", "hyq", "g1"])
def test_robots_drop_as_in_the_compliant_plant(name):
    """A millimetre deep, with motors that hold the posture; G1 on the corners of its soles.

    Both plants come to the same motion as steps and tolerance get smaller.
    """
    robot = hp.load_robot(name)
    ground = Ground(mu_s=0.8, stiffness=robot.mass * G / 4e-3)
    q, v = hp.Standing(robot).initial_state(penetration=1e-3)
    terms = hp.Dynamics(robot)
    terms.update(q, v)
    inertia = np.diag(terms.mass_matrix)[6:]
    command = Command(
        np.zeros(len(robot.joints)), q=q[7:], v=v[6:], k_p=3600.0 * inertia, k_d=60.0 * inertia
    )
    exact, gaps = Simulator(robot, ground, dt=2e-5), []
    exact.reset(q, v)
    exact.advance(command, steps=2000)
    weight = exact.state.foot_force[:, 2].sum()
    assert weight > 0.3 * robot.mass * G
    assert np.abs(exact.q - q).max() > 3e-3
    for dt, tolerance in ((5e-4, 1e-3), (1e-4, 1e-4)):
        plant = PinocchioPlant(robot, ground, dt=dt, stiction_tolerance=tolerance)
        plant.reset(q, v)
        plant.advance(command, steps=round(0.04 / dt))
        gaps.append(np.abs(plant.q - exact.q).max())
    assert gaps[1] < gaps[0]
    assert gaps[1] < 5e-4
    assert plant.state.foot_force[:, 2].sum() == pytest.approx(weight, rel=0.01)


@pytest.mark.long
@needs_robots
def test_undamped_rebound_fells_go2_where_implicit_steps_damp_it():
    """On stiff ground at 2 m/s. What decides is the damping of the compliant plant's steps, not the
    plant.
    """
    gait = hp.WalkingGait(hp.load_robot("go2"), velocity=(2.0, 0.0, 0.0), max_speed=2.0)
    ends = []
    for plant, dt in (("compliant", 5e-4), ("compliant", 2e-5), ("pinocchio", 5e-4)):
        stiffness = gait.robot.mass * G / 2e-3
        run = walked(gait, mu_s=0.8, stiffness=stiffness, duration=4.0, plant=plant, dt=dt)
        ends.append((run.ending, run.metadata["end_time"]))
    assert ends[0][0] == "completed"
    for ending, time in ends[1:]:
        assert ending == "fell"
        assert time == pytest.approx(3.1, abs=0.3)


@needs_robots
def test_a_foot_without_mass_is_refused():
    """A link of iCub has no inertia of its own: no explicit step is short enough."""
    robot = hp.load_robot("icub")
    assert "icub" in CATALOGUE
    with pytest.raises(hp.InputError, match="too light"):
        started(PinocchioPlant(robot, Ground()), hp.Standing(robot))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan, "small"])
def test_a_tolerance_that_is_none_is_refused(robot, tolerance):
    for make in (
        lambda: PinocchioPlant(robot, stiction_tolerance=tolerance),
        lambda: hp.Pinocchio(stiction_tolerance=tolerance),
    ):
        with pytest.raises(hp.InputError, match="stiction_tolerance"):
            make()


def test_stages_grow_with_what_is_stiff(gait, robot):

    def evaluations(mu=0.25, tolerance=1e-3, dt=5e-4, **ground):
        plant = PinocchioPlant(
            robot, Ground(mu_s=mu, **ground), dt=dt, stiction_tolerance=tolerance
        )
        return started(plant, gait).substeps * plant.stages

    usual = evaluations()
    assert evaluations(tolerance=2.5e-4) == pytest.approx(2.0 * usual, rel=0.15)
    assert evaluations(mu=1.0) > 1.5 * usual
    assert evaluations(stiffness=8e5) > 3 * usual
    assert evaluations(dt=1.25e-4) == pytest.approx(0.5 * usual, rel=0.15)
    with pytest.raises(hp.InputError, match="too stiff"):
        evaluations(stiffness=1e9, dt=5e-3)


def test_logged_forces_are_those_that_move_the_robot(robot):
    """Newton for the whole: the momentum changes by what is logged, step by step."""
    dt = 5e-4
    push = hp.Push(0.1, (0.0, 0.5, 0.0))
    run = walked(plant="pinocchio", duration=0.25, dt=dt, period=dt, pushes=(push,))
    model, data = robot.model, robot.model.createData()
    momentum = []
    for q, v in zip(run["q"], run["v"], strict=True):
        pin.centerOfMass(model, data, q, v)
        momentum.append(robot.mass * data.vcom[0])
    force = run["foot_force"][1:].sum(axis=1) + run["thrust"][:-1].sum(axis=1)
    impulse = dt * (force + robot.mass * np.array([0.0, 0.0, -G]))
    impulse += np.outer([push.share(t, t + dt) for t in run["t"][:-1]], push.impulse)
    defect = np.diff(momentum, axis=0) - impulse
    assert np.abs(defect.sum(axis=0)).max() < 2e-3
    assert np.abs(impulse).sum(axis=0).min() > 0.05


def test_everything_of_a_scenario_works_and_walks_again(tmp_path):
    given = scenario(
        plant=hp.Pinocchio(stiction_tolerance=2e-3),
        controller=hp.Governed(governor="filter"),
        mu_s=0.6,
        cone="per_axis",
        friction_strips=((0.02, 0.04, 0.3),),
        mass_error=0.1,
        start_velocity=(0.02, -0.03, 0.0, 0.0, 0.1, 0.0),
        pushes=(hp.Push(0.05, (0.0, 1.0, 0.0)),),
        noise=hp.Noise.typical(0.2),
        delay=1e-3,
        actuators=hp.Actuators(bandwidth=100.0, coulomb_friction=0.1, thrusters={"lag": 0.05}),
        seed=7,
        duration=0.15,
    )
    run = hp.walk(given, save=tmp_path / "run.npz")
    loaded = hp.Run.load(tmp_path / "run.npz")
    assert_same(hp.walk(hp.Scenario.of(loaded)), run)
    assert run.ending == "completed"
    about = loaded.metadata["plant"]
    assert (about["name"], about["version"], about["stiction_tolerance"]) == (
        "pinocchio",
        pin.__version__,
        2e-3,
    )
    assert about["stages"] > 1


def test_motors_hold_their_targets(robot):
    """A command with the motors' law: its torque is that of the log, and the robot stands on it."""
    run = walked(
        plant="pinocchio",
        controller=hp.Condensed(parameters={"joint_stiffness": 1.0}),
        duration=0.1,
        mu_s=0.8,
    )
    assert run.ending == "completed"
    assert run["motor_torque"].shape == (len(run), 6)
    assert np.abs(run["motor_torque"][1:]).max() > 1.0


def test_a_run_that_goes_nowhere_ends(sled):
    plant = put(PinocchioPlant(sled, Ground()), z=1.0, v=(2e4, 0, 0, 0, 0, 0))
    assert plant.verdict(0.0) == "diverged"
    plant.advance(NOTHING, (hp.Push(0.0, (1e6, 0.0, 0.0), 1e-3),), steps=10)
    assert plant.t == pytest.approx(5e-3)


@given(*[st.floats(-1e300, 1e300)] * 4)
def test_no_number_is_too_large_for_the_force(height, along, across, up):
    """So that a run that diverges ends as one that did."""
    force(height, (along, across, up), Ground(), 1e-3)
