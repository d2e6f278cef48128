"""Rotors with a fixed axis, and robots without feet that fly on them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import generalised_force, places
from needs import needs_robots
from pages import content_of
from same_optimum import same_optimum
from walks import walked

import harpy_pin as hp
from harpy_pin.controllers.tasks import MAX_LEAN, lean, limit_push
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.view import figures_of, replay_html
from harpy_pin.wbc import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus

ROTORS, ARM, DRAG, LIMIT = 6, 0.25, 0.016, (0.1, 8.0)
MASS, GRAVITY = 1.5, 9.81
FLYERS = [name for name, entry in CATALOGUE.items() if entry.rotors and not entry.feet]


def hexarotor(folder, tilt):
    """A rigid body with six rotors around it; each is tilted about its arm, to either side in turn,
    by ``tilt`` rad.
    """
    angles = 2.0 * np.pi * np.arange(ROTORS) / ROTORS
    links, rotors = "", []
    for k, angle in enumerate(angles):
        place = f"{ARM * np.cos(angle)} {ARM * np.sin(angle)} 0"
        links += f"""<link name="rotor_{k}"/>
            <joint name="mount_{k}" type="fixed"><parent link="base"/>
            <child link="rotor_{k}"/><origin xyz="{place}" rpy="0 0 {angle}"/></joint>"""
        side = (-1.0) ** k
        axis = (0.0, -side * np.sin(tilt), np.cos(tilt))  # y goes around, in the mount's own frame
        rotors.append(hp.Rotor(f"rotor_{k}", axis=axis, limit=LIMIT, drag=side * DRAG))
    path = folder / f"hexarotor_{tilt}.urdf"
    path.write_text(f"""<robot name="hexarotor"><link name="base"><inertial><mass value="{MASS}"/>
        <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.035"/></inertial></link>
        {links}</robot>""")
    return hp.load_robot(path, feet=(), rotors=rotors)


@pytest.fixture(scope="module", params=[0.0, 0.5], ids=["flat", "tilted"])
def flyer(request, tmp_path_factory):
    return hexarotor(tmp_path_factory.mktemp("hexarotor"), request.param)


@pytest.fixture(scope="module")
def mixed(robot):
    """Harpy with one free thruster and two rotors, one of them on a foot."""
    rotors = (
        hp.Rotor("right_thruster", axis=(0.4, 0.0, 2.0), limit=(-5.0, 30.0), drag=0.05),
        hp.Rotor("left_foot", axis=(1.0, 0.3, 0.5), limit=(1.0, 12.0), drag=-0.03),
    )
    model = robot.model.copy()
    model.damping = np.zeros(model.nv)
    load = hp.load_robot(
        robot.urdf, feet=robot.feet, thrusters=("left_thruster",), thrust_limit=53.0, rotors=rotors
    )
    return replace(load, model=model)


def wrenches(robot, q, forces):
    """Pinocchio's external forces of given thrusts along the axes (rotors) or in the world (free
    thrusters).
    """
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    external = [pin.Force.Zero() for _ in range(model.njoints)]
    free = len(robot.thrusters) - len(robot.rotors)
    for k, (name, force) in enumerate(zip(robot.thrusters, forces, strict=True)):
        frame = model.frames[robot.frame_id(name)]
        turn = data.oMf[robot.frame_id(name)].rotation
        if k < free:
            local = pin.Force(turn.T @ force, np.zeros(3))
        else:
            rotor = robot.rotors[k - free]
            axis = np.array(rotor.axis)
            local = pin.Force(force * axis, rotor.drag * force * axis)
        external[frame.parentJoint] += frame.placement.act(local)
    return external


def axes(robot, q):
    """World axes of the rotors."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return np.array(
        [data.oMf[robot.frame_id(rotor.frame)].rotation @ rotor.axis for rotor in robot.rotors]
    )


def test_plant_is_pinocchios_with_the_wrench(mixed, draw_state):
    """Force and drag moment of rotors on base and foot, beside a free thruster: one step far above
    the ground.
    """
    rng, dt = np.random.default_rng(3), 1e-4
    simulator = hp.Simulator(mixed, dt=dt)
    for _ in range(5):
        q, v = draw_state(rng)
        q[2] += 10.0
        torque, free = rng.standard_normal(6), rng.normal(scale=20.0, size=3)
        thrusts = np.array([rng.uniform(*rotor.limit) for rotor in mixed.rotors])
        simulator.reset(q, v)
        simulator.advance(hp.Command(torque, np.vstack((free, thrusts[:, None] * axes(mixed, q)))))
        external = wrenches(mixed, q, [free, *thrusts])
        data = mixed.model.createData()
        expected = pin.aba(mixed.model, data, q, v, np.concatenate((np.zeros(6), torque)), external)
        np.testing.assert_allclose(
            (simulator.v - v) / dt, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max()
        )
    assert simulator.counts[2] == 0


def test_what_a_rotor_cannot_do_is_projected_and_counted(mixed, draw_state):
    q, v = draw_state(np.random.default_rng(1))
    dynamics = hp.Dynamics(mixed)
    dynamics.update(q, v)
    axis, torque, feet = axes(mixed, q), np.zeros(6), np.zeros((2, 3))
    aside = np.cross(axis[0], (1.0, 2.0, 3.0))
    given = generalised_force(
        dynamics, torque, feet, np.array([np.zeros(3), 7.0 * axis[0] + aside, 20.0 * axis[1]])
    )
    done = generalised_force(
        dynamics, torque, feet, np.array([np.zeros(3), 7.0 * axis[0], 12.0 * axis[1]])
    )
    np.testing.assert_allclose(given, done, atol=1e-12)
    simulator = hp.Simulator(mixed)
    simulator.reset(q, v)
    for thrust, counted in (((7.0, 3.0), 0), ((31.0, 3.0), 1), ((31.0, 0.0), 3)):
        simulator.reset(q, v)
        simulator.advance(
            hp.Command(torque, np.vstack((np.zeros(3), np.array(thrust)[:, None] * axis))), steps=2
        )
        assert simulator.counts[2] == counted


@pytest.mark.long
def test_law_is_the_program_with_rotors_feet_and_limits(mixed, robot):
    rng = np.random.default_rng(5)
    standing = hp.make_gait(robot).initial_state()[0]
    states = [
        (
            pin.integrate(mixed.model, standing, 0.1 * rng.standard_normal(12)),
            0.3 * rng.standard_normal(12),
        )
        for _ in range(80)
    ]
    limits = WholeBodyLimits(
        mu=0.5, give_way=1.0
    )  # a program built once does not let tasks give way
    weights = WholeBodyWeights.for_robot(flyer, posture=1e-10)
    saturated, _ = same_optimum(
        mixed, states, weights, limits, ("input_space",), spread=4.0, most=300.0
    )
    assert 20 <= saturated < 80


def test_law_is_the_program_in_the_air(flyer):
    rng = np.random.default_rng(6)
    neutral = pin.neutral(flyer.model)
    states = [
        (pin.integrate(flyer.model, neutral, rng.standard_normal(6)), rng.standard_normal(6))
        for _ in range(60)
    ]
    how = {"spread": 8.0, "most": 300.0}
    saturated, _ = same_optimum(
        flyer,
        states,
        WholeBodyWeights.for_robot(flyer),
        WholeBodyLimits(),
        ("input_space", "full"),
        **how,
    )
    assert 10 <= saturated <= 60


def test_thrusts_are_the_analytic_allocation(flyer):
    """Away from limits, with next to no weight on thrusts: the least thrusts that give force and
    moment.
    """
    angles = 2.0 * np.pi * np.arange(ROTORS) / ROTORS
    side = (-1.0) ** np.arange(ROTORS)
    around = np.stack((-np.sin(angles), np.cos(angles), np.zeros(ROTORS)))
    slope = np.arcsin(-flyer.rotors[0].axis[1])  # the tilt
    force = np.cos(slope) * np.array([[0.0], [0.0], [1.0]]) - np.sin(slope) * side * around
    outward = np.stack((np.cos(angles), np.sin(angles), np.zeros(ROTORS)))
    moment = np.cross(ARM * outward.T, force.T).T + side * DRAG * force
    allocation = np.vstack((force, moment))
    law = CondensedSolver(flyer, WholeBodyWeights.for_robot(flyer, thrust=1e-9))
    dynamics, targets = hp.Dynamics(flyer), WholeBodyTargets(flyer)
    q, v = pin.neutral(flyer.model), np.zeros(6)
    dynamics.update(q, v)
    desired = np.array([0.4, -0.3, 0.5]) if slope > 0.1 else np.array([0.0, 0.0, 0.5])
    targets.body[:], targets.orientation[:] = desired, (2.0, -3.0, 0.4)
    found = law.solve(dynamics, v, targets)
    push = MASS * (desired - flyer.model.gravity.linear)
    wrench = np.concatenate((push, (0.02 * 2.0, -0.02 * 3.0, 0.035 * 0.4)))
    np.testing.assert_allclose(found, np.linalg.pinv(allocation) @ wrench, rtol=1e-4)
    assert np.linalg.matrix_rank(allocation) == (6 if slope > 0.1 else 4)
    assert law.status == CondensedStatus.OPTIMAL


@pytest.mark.parametrize("controller", ["condensed", "wbc"])
def test_a_push_is_answered(flyer, controller, tmp_path):
    """An impulse that gives 1 m/s sideways: back within 5 cm, thrusts within limits, balanced at
    the end.
    """
    gait = hp.Hovering(flyer, height=1.2)
    push = hp.Push(0.5, (0.6 * MASS, -0.8 * MASS, 0.0))
    run = walked(gait, controller=controller, duration=5.0, pushes=(push,))
    assert run.ending == "completed"
    assert run.metadata["thrusts_projected"] == 0
    away = np.linalg.norm(run["q"][:, :3] - (0.0, 0.0, 1.2), axis=1)
    assert 0.1 < away.max() < 0.5
    assert away[2500:].max() < 0.05
    tilt = np.arccos(np.array([pin.Quaternion(q[3:7]).matrix()[2, 2] for q in run["q"][::10]]))
    leans = flyer.lift_axis is not None
    assert tilt.max() < MAX_LEAN + 0.05
    assert leans == (tilt.max() > 0.3)
    for q, thrust in zip(run["q"][::50], run["thrust"][::50], strict=True):
        along = np.sum(axes(flyer, q) * thrust, axis=1)
        np.testing.assert_allclose(thrust, along[:, None] * axes(flyer, q), atol=1e-9)
        assert ((along >= LIMIT[0] - 1e-9) & (along <= LIMIT[1] + 1e-9)).all()
    # Momentum in hover: the thrusts hold the weight, and neither they nor the drag turn the robot.
    q, thrust = run["q"][-1], run["thrust"][-1]
    np.testing.assert_allclose(
        thrust.sum(axis=0), (0.0, 0.0, MASS * GRAVITY), atol=0.02 * MASS * GRAVITY
    )
    along = np.sum(axes(flyer, q) * thrust, axis=1)
    total = sum(wrenches(flyer, q, along), pin.Force.Zero())
    np.testing.assert_allclose(total.angular, 0.0, atol=1e-3)
    measures = hp.measure(run)
    assert measures.solver_failures == 0
    slips = (
        measures.slip_mm_per_step,
        measures.net_slip_mm_per_step,
        measures.sliding,
        measures.no_contact,
    )
    assert np.isnan(slips).all()
    path = tmp_path / "flight.npz"
    run.save(path)
    loaded = hp.Run.load(path)
    assert loaded["foot_force"].shape == (5000, 0, 3)
    if controller == "condensed":
        assert "thrust" in [
            entry["label"] for entry in content_of(replay_html([(loaded, flyer)]))["key"]
        ]
        assert "feet" not in figures_of(loaded, flyer)


def test_mujoco_flies_alike(flyer):
    pytest.importorskip("mujoco")
    gait = hp.Hovering(flyer, shift=(0.1, 0.05, 0.1))
    how = {"controller": "condensed", "duration": 0.5}
    runs = [
        hp.walk(hp.Scenario(plant=plant, **how), gait=gait) for plant in ("compliant", "mujoco")
    ]
    np.testing.assert_allclose(runs[0]["q"][-1], runs[1]["q"][-1], atol=2e-4)
    assert np.abs(runs[0]["q"][-1, :3] - (0.0, 0.0, 1.0)).max() > 0.01


def test_a_lean_points_the_thrust_where_it_is_asked_for():
    rng, gravity = np.random.default_rng(0), np.array([0.0, 0.0, -GRAVITY])
    for _ in range(20):
        desired = rng.normal(scale=3.0, size=3)
        limited = desired.copy()
        limit_push(gravity, limited)
        push = limited - gravity
        assert push[2] >= 0.5 * GRAVITY - 1e-12
        slope = np.hypot(*push[:2]) / push[2]
        assert slope <= np.tan(MAX_LEAN) + 1e-12
        if (
            np.hypot(*desired[:2]) < np.tan(MAX_LEAN) * (desired[2] + GRAVITY)
            and desired[2] > -0.5 * GRAVITY
        ):
            np.testing.assert_allclose(limited, desired, atol=1e-12)
        lift = pin.exp3(rng.normal(scale=0.3, size=3))[:, 2]
        heading = rng.uniform(-3.0, 3.0)
        upright = pin.exp3(np.array([0.0, 0.0, heading]))
        turn = pin.Quaternion.FromTwoVectors(upright @ lift, push).matrix()
        target = turn @ upright
        body = limited.copy()
        left = np.array(pin.Quaternion(target).coeffs())
        lean(target, gravity, lift, heading, body, left)
        np.testing.assert_allclose(pin.Quaternion(left).matrix(), upright, atol=1e-12)
        np.testing.assert_allclose(body, limited, atol=1e-12)  # all of it can be had there
        body = limited.copy()
        lean(upright, gravity, lift, heading, body, left)
        now = upright @ lift
        np.testing.assert_allclose(body - gravity, (push @ now) * now, atol=1e-12)
    weightless = np.array([3.0, 4.0, 5.0])
    limit_push(np.zeros(3), weightless)
    np.testing.assert_array_equal(weightless, (3.0, 4.0, 5.0))


def test_refusals(flyer, robot):
    with pytest.raises(hp.RobotError, match=r"no thruster frame 'wing'; its links, .* base"):
        hp.load_robot(flyer.urdf, feet=(), rotors=[hp.Rotor("wing")])
    with pytest.raises(hp.InputError, match="a thruster is named twice"):
        hp.load_robot(flyer.urdf, feet=(), thrusters=("rotor_1",), rotors=[hp.Rotor("rotor_1")])
    with pytest.raises(hp.InputError, match=r"no foot to stand on: hp\.Hovering"):
        hp.Standing(flyer)
    with pytest.raises(hp.InputError, match=r"has feet: hp\.Standing"):
        hp.Hovering(robot)
    with pytest.raises(hp.InputError, match="not rotors"):
        hp.ContactForceFilter(flyer)
    assert robot.lift_axis is None


def test_thrust_variables(mixed, flyer):
    assert (mixed.n_thrust, flyer.n_thrust) == (5, 6)
    assert mixed.thrusters == ("left_thruster", "right_thruster", "left_foot")
    flat = np.isclose(flyer.rotors[0].axis[2], 1.0)
    assert (flyer.lift_axis is not None) == flat
    if flat:
        np.testing.assert_allclose(flyer.lift_axis, (0.0, 0.0, 1.0))


@needs_robots
@pytest.mark.parametrize("name", FLYERS)
def test_catalogue_can_fly(name):
    """The rotors hold the weight without turning the robot, within their limits; opposite drags
    cancel.
    """
    robot = hp.load_robot(name)
    assert robot.feet == ()
    q, _ = hp.Hovering(robot).initial_state()
    assert np.all((robot.joint_lower <= q[7:]) & (q[7:] <= robot.joint_upper))
    centre = pin.centerOfMass(robot.model, robot.model.createData(), q)
    force = axes(robot, q)
    drags = np.array([rotor.drag for rotor in robot.rotors])
    moment = np.cross(places(robot, q, robot.thrusters) - centre, force) + drags[:, None] * force
    weight = np.array([0.0, 0.0, robot.mass * GRAVITY, 0.0, 0.0, 0.0])
    thrust = np.linalg.lstsq(np.hstack((force, moment)).T, weight, rcond=None)[0]
    np.testing.assert_allclose(np.hstack((force, moment)).T @ thrust, weight, atol=1e-9)
    low, high = np.array([rotor.limit for rotor in robot.rotors]).T
    assert ((thrust > low) & (thrust < high)).all()
    assert drags.sum() == pytest.approx(0.0, abs=1e-12)
    assert (robot.lift_axis is None) == (name == "hextilt")
