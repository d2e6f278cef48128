"""Flat feet: corners and their cones against the closed form, and the law of a humanoid against
dense algebra.
"""

import json

import numpy as np
import pinocchio as pin
import pytest
from biped_urdf import biped_urdf
from needs import PLANTS, needs_robots
from scipy.optimize import linprog

import harpy_pin as hp
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.flat_foot import MIN_SPREAD
from harpy_pin.model.source import plain_source, read_robot
from harpy_pin.model.terms import flat_foot_rows
from harpy_pin.wbc import (
    WholeBodyLimits,
    WholeBodyTargets,
    WholeBodyWeights,
    make_problem,
    make_solver,
)
from harpy_pin.wbc.condensed import CondensedSolver, CondensedStatus

SOLE = hp.FlatFoot(length=0.2, width=0.12)
X, Y = 0.1, 0.06
"""Half of its sides, m."""


def wrench(corner_forces):
    """Force and moment about the middle of corner forces (4, 3)."""
    return np.concatenate(
        (corner_forces.sum(axis=0), np.cross(SOLE.corners, corner_forces).sum(axis=0))
    )


def margins(w, mu):
    """Rows of the wrench cone of a rectangle in closed form (Caron, Pham and Nakamura 2015, eq. 6
    to 10): all ≥ 0.
    """
    fx, fy, fz, tx, ty, tz = w
    least = -mu * (X + Y) * fz + abs(Y * fx - mu * tx) + abs(X * fy - mu * ty)
    most = mu * (X + Y) * fz - abs(Y * fx + mu * tx) - abs(X * fy + mu * ty)
    return np.array(
        [
            mu * fz - abs(fx),
            mu * fz - abs(fy),
            fz,
            Y * fz - abs(tx),
            X * fz - abs(ty),
            tz - least,
            most - tz,
        ]
    )


def corner_forces_of(w, pyramid):
    """Corner forces in their pyramids that make the wrench, by a linear program; None if there are
    none.
    """
    matrix = np.hstack(
        [np.vstack((np.eye(3), pin.skew(np.array(corner)))) for corner in SOLE.corners]
    )
    found = linprog(
        np.zeros(12),
        A_ub=-np.kron(np.eye(4), pyramid),
        b_ub=np.zeros(4 * len(pyramid)),
        A_eq=matrix,
        b_eq=w,
        bounds=(None, None),
    )
    return found.x.reshape(4, 3) if found.status == 0 else None


LIMITS = WholeBodyLimits(mu=0.5, friction_share=1.0, faces=4)
"""Four faces, as in the closed form: |f_x| and |f_y| at most μ f_z."""
MU = LIMITS.mu * LIMITS.inscribed


def test_wrenches_in_the_closed_form_are_made_by_corner_forces_and_others_are_not():
    rng = np.random.default_rng(1)
    inside = outside = 0
    for _ in range(200):
        w = np.array([MU, MU, 1.0, Y, X, MU * (X + Y)]) * rng.uniform(-1.2, 1.2, 6)
        w[2] = 1.0
        margin = margins(w, MU).min()
        if abs(margin) < 1e-6:
            continue
        forces = corner_forces_of(w, LIMITS.pyramid)
        assert (forces is not None) == (margin > 0.0)
        if forces is not None:
            np.testing.assert_allclose(wrench(forces), w, atol=1e-9)
        inside += margin > 0.0
        outside += margin < 0.0
    assert min(inside, outside) > 15


@pytest.mark.parametrize("corners", [3, 4, 6])
def test_rows_of_a_flat_foot_are_its_rigid_motion(corners):
    """Held corners on one body: the rows vanish on every motion that keeps the body, and on no
    other.
    """
    rng = np.random.default_rng(corners)
    places, turn = 0.1 * rng.standard_normal((corners, 3)), rng.standard_normal((6, 20))
    jacobian = np.vstack([np.hstack((np.eye(3), -pin.skew(place))) @ turn for place in places])
    drift, desired = rng.standard_normal(3 * corners), rng.standard_normal((corners, 3))
    rows, value = np.full((6, 20), np.nan), np.full(6, np.nan)
    flat_foot_rows(jacobian, drift, desired, places + rng.standard_normal(3), rows, value)
    assert np.linalg.matrix_rank(rows) == 6
    assert np.linalg.matrix_rank(np.vstack((rows, turn)), tol=1e-9) == 6
    # What they ask for is the rigid acceleration nearest to what the corners ask for.
    acceleration = np.linalg.lstsq(rows, value, rcond=None)[0]
    nearest = np.linalg.lstsq(jacobian, desired.ravel() - drift, rcond=None)[0]
    np.testing.assert_allclose(turn @ acceleration, turn @ nearest, atol=1e-9)


def test_corners_of_a_flat_foot_and_their_names(sled):
    foot = hp.FlatFoot(length=0.2, width=0.1, centre=(0.03, 0.0, -0.02))
    robot = hp.load_robot(sled.urdf, feet=("skid",), flat_feet={"skid": foot})
    assert robot.feet == ("skid_0", "skid_1", "skid_2", "skid_3")
    assert robot.flat_feet == robot.corners == (4,)
    places = [robot.model.frames[robot.frame_id(name)].placement.translation for name in robot.feet]
    desired = [
        (0.13, 0.05, -0.02),
        (0.13, -0.05, -0.02),
        (-0.07, 0.05, -0.02),
        (-0.07, -0.05, -0.02),
    ]
    np.testing.assert_allclose(places, desired, atol=1e-15)
    assert sled.flat_feet == ()
    assert sled.corners == (1,)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_turned_sole_is_that_of_a_frame_that_is_not(tmp_path, plant):
    """The same biped, whose soles' frames have other axes: corners, posture, and a walk are the
    same.
    """
    turn = (0.4, -1.2, 2.5)
    back = pin.rpy.matrixToRpy(pin.rpy.rpyToMatrix(*turn).T)
    runs = []
    for frame, orientation in (((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), (turn, back)):
        (tmp_path / "biped.urdf").write_text(biped_urdf(sole="{} {} {}".format(*frame)))
        place = tuple(pin.rpy.rpyToMatrix(*frame).T @ (0.03, 0.0, -0.01))
        sole = hp.FlatFoot(length=0.2, width=0.1, centre=place, orientation=orientation)
        feet = ("L_sole", "R_sole")
        robot = hp.load_robot(
            tmp_path / "biped.urdf", feet=feet, flat_feet=dict.fromkeys(feet, sole)
        )
        read = read_robot(json.loads(json.dumps(plain_source(robot.source))))
        assert read.model == robot.model
        gait = hp.WalkingGait(read, velocity=(0.1, 0.0, 0.0))
        run = hp.walk(hp.Scenario(robot=read, plant=plant, duration=0.6), gait=gait)
        runs.append(
            [gait.initial_state()[0], *(run[name] for name in ("q", "foot_position", "foot_force"))]
        )
    assert np.ptp(runs[0][1][:, 1]) > 1e-3  # it sways
    for plain, turned in zip(*runs, strict=True):
        np.testing.assert_allclose(turned, plain, rtol=0, atol=1e-4 * max(1.0, np.abs(plain).max()))


def test_corners_have_names_of_their_own(tmp_path):
    more = (
        '<link name="L_sole_1"/><joint name="corner:L_sole_2" type="fixed"><parent link="L_sole"/>'
    )
    more += '<child link="L_sole_1"/><origin xyz="1 1 1"/></joint><link name="L_sole_2"/>'
    more += (
        '<joint name="mark" type="fixed"><parent link="L_sole"/><child link="L_sole_2"/></joint>'
    )
    (tmp_path / "biped.urdf").write_text(biped_urdf(more=more))
    feet = ("L_sole", "R_sole")
    robot = hp.load_robot(tmp_path / "biped.urdf", feet=feet, flat_feet=dict.fromkeys(feet, SOLE))
    assert robot.feet[:4] == ("L_sole_0", "corner:L_sole_1", "corner:corner:L_sole_2", "L_sole_3")
    assert len(set(robot.feet)) == 8
    frames = [robot.model.frames[robot.frame_id(name)] for name in robot.feet[:4]]
    sole = robot.model.frames[robot.frame_id("L_sole")].placement
    np.testing.assert_allclose(
        [sole.actInv(f.placement).translation for f in frames], SOLE.corners, atol=1e-15
    )


LINE = {"length": 0.2, "width": 1.9 * MIN_SPREAD}
"""A foot so narrow that it turns freely about the line of its corners."""


def test_what_is_no_flat_foot_is_refused(sled):
    with pytest.raises(hp.InputError, match="unknown flat foot 'base'; valid names: skid"):
        hp.load_robot(sled.urdf, feet=("skid",), flat_feet={"base": SOLE})
    with pytest.raises(hp.InputError, match="must be a FlatFoot"):
        hp.load_robot(sled.urdf, feet=("skid",), flat_feet={"skid": (0.2, 0.1)})
    nowhere = {"length": 0.2, "width": 0.1, "orientation": (0.0, np.nan, 0.0)}
    bare = (
        {"length": 0.0, "width": 0.1},
        {"length": 0.2, "width": np.nan},
        {"length": -0.2, "width": 0.1},
    )
    for bad in (*bare, LINE, nowhere):
        with pytest.raises(hp.InputError, match="of a flat foot"):
            hp.FlatFoot(**bad)


@needs_robots
def test_soles_of_humanoids_are_inside_their_geometry():
    """Talos' lowest vertices and G1's spheres lie around the corners; iCub's sole is as large as
    its mesh's bottom.
    """
    folder = CATALOGUE["talos"].path().parents[4]
    for name, link, box in (
        ("talos", "leg_left_6_link", None),
        ("g1", "left_ankle_roll_link", None),
        ("icub", "l_foot", (0.156, 0.061)),
    ):
        robot = hp.load_robot(name)
        kind = pin.GeometryType.COLLISION
        shapes = pin.buildGeomFromUrdf(
            robot.model, str(robot.urdf), kind, package_dirs=[str(folder)]
        )
        sole = robot.model.frames[robot.frame_id(CATALOGUE[name].feet[0])]
        points = []
        for shape in shapes.geometryObjects:
            if robot.model.frames[shape.parentFrame].name == link:
                place, geometry = sole.placement.inverse() * shape.placement, shape.geometry
                if hasattr(geometry, "radius"):
                    points.append(place.translation[None] - (0.0, 0.0, geometry.radius))
                else:
                    points.append(
                        np.array(geometry.vertices()) @ place.rotation.T + place.translation
                    )
        cloud = np.vstack(points)
        bottom = cloud[cloud[:, 2] < cloud[:, 2].min() + 3e-3, :2]
        foot = CATALOGUE[name].flat_feet[CATALOGUE[name].feet[0]]
        corners = np.array(foot.corners)[:, :2]
        if box is not None:
            np.testing.assert_allclose(np.sort(np.ptp(bottom, axis=0)), np.sort(box), atol=1e-3)
            assert foot.length <= box[0]
            assert foot.width <= box[1]
            continue
        assert (bottom.min(axis=0) <= corners.min(axis=0) + 1e-9).all()
        assert (bottom.max(axis=0) >= corners.max(axis=0) - 1e-9).all()
        assert cloud[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def dense_truth(robot, dynamics, v, torque, targets):
    """Accelerations of the robot and wrenches on its held soles, by Pinocchio's frame Jacobians:
    one dense system.
    """
    model, rows, desired, moments = robot.model, [], [], []
    starts = np.cumsum((0, *robot.corners))
    for n, first in enumerate(starts[:-1]):
        if not targets.held[first]:
            continue
        own = slice(3 * first, 3 * starts[n + 1])
        arms = dynamics.foot_position[first : starts[n + 1]] - dynamics.foot_position[
            first : starts[n + 1]
        ].mean(axis=0)
        rigid = np.vstack([np.hstack((np.eye(3), -pin.skew(arm))) for arm in arms])
        twist = np.linalg.lstsq(rigid, dynamics.foot_jacobian[own], rcond=None)[0]
        rows.append(twist)
        residual = targets.feet[first : starts[n + 1]].ravel() - dynamics.foot_drift[own]
        desired.append(np.linalg.lstsq(rigid, residual, rcond=None)[0])
        moments.append(rigid.T)
    jacobian = np.vstack(rows)
    size, nv = len(jacobian), model.nv
    system = np.zeros((nv + size, nv + size))
    system[:nv, :nv] = dynamics.mass_matrix
    system[:nv, nv:], system[nv:, :nv] = -jacobian.T, jacobian
    drive = -dynamics.bias - model.damping * v
    drive[6:] += torque
    solution = np.linalg.solve(system, np.concatenate((drive, *desired)))
    return solution[:nv], solution[nv:].reshape(-1, 6), moments


@needs_robots
@pytest.mark.parametrize(("arms", "torque_scale"), [(1.0, 1.0), (0.01, 1.0), (1.0, 0.25)])
def test_law_of_a_humanoid_is_true_and_optimal(g1, arms, torque_scale, fuzz):
    """With its torques the rigid robot has its accelerations and contact wrenches; and it is the
    QP's optimum.

    Arms, torso and head give way as in the QP, and more where their weight is small; with weak
    motors, too.
    """
    dynamics, rng, mass = hp.Dynamics(g1), np.random.default_rng(3), g1.mass
    weights = WholeBodyWeights(
        orientation=0.25, swing=12.0, posture=1e-9, arms=arms, thrust=3.5e-4, force=2e-4 / mass**2
    )
    limits = WholeBodyLimits(mu=0.5, torque_scale=torque_scale, give_way=1.0)
    law, problem = (CondensedSolver(g1, weights, limits), make_problem("full", g1, weights, limits))
    solver = make_solver("active_set", problem.program)
    standing, nv = hp.Standing(g1).initial_state()[0], g1.model.nv
    targets, inputs = WholeBodyTargets(g1), np.empty(nv - 6)
    free = law.record["system"]["order"][0]
    compared = binding = limited = 0
    deviation = 0.0
    for _ in range(60 * fuzz):
        q, v = (
            pin.integrate(g1.model, standing, 0.05 * rng.standard_normal(nv)),
            0.05 * rng.standard_normal(nv),
        )
        targets.body[:], targets.orientation[:] = rng.standard_normal(3), rng.standard_normal(3)
        targets.feet[:], targets.joints[:] = (
            rng.standard_normal((8, 3)),
            rng.standard_normal(nv - 6),
        )
        targets.joint_share[free - 6] = 10.0 ** rng.uniform(0.0, 2.0, len(free))
        targets.held[:] = np.repeat(
            [(True, True), (True, False), (False, True)][rng.integers(3)], 4
        )
        targets.force_range[:] = (0.0, 2.0 * mass * 9.81)
        dynamics.update(q, v)
        torque = law.solve(dynamics, v, targets).copy()
        held = targets.held > 0.0
        assert (limits.pyramid @ law.force[held].T >= -1e-9 * mass * 9.81).all()
        assert (law.force[held, 2] >= -1e-9).all()
        assert (law.force[~held] == 0.0).all()
        assert not law.status & CondensedStatus.TORQUE_CLIPPED
        deviation = max(
            deviation, float(np.abs(law.acceleration[free] - targets.joints[free - 6]).max())
        )
        acceleration, wrenches, moments = dense_truth(g1, dynamics, v, torque, targets)
        scale = 1.0 + np.abs(torque).max()
        np.testing.assert_allclose(
            law.acceleration, acceleration, rtol=0, atol=1e-8 * (1.0 + np.abs(acceleration).max())
        )
        intended = [m @ law.force[held][4 * i : 4 * i + 4].ravel() for i, m in enumerate(moments)]
        np.testing.assert_allclose(intended, wrenches, rtol=0, atol=1e-8 * mass * 9.81)
        problem.build(dynamics, v, dynamics.rotation, targets)
        solution = solver.solve(problem.program)
        if solution.usable:
            problem.inputs(solution.z, inputs)
            np.testing.assert_allclose(torque, inputs, rtol=0, atol=2e-4 * scale)
            given = problem.acceleration(solution.z)
            np.testing.assert_allclose(
                law.acceleration, given, rtol=0, atol=2e-4 * (1.0 + np.abs(given).max())
            )
            compared += 1
            limited += law.status & CondensedStatus.TORQUE_LIMITED != 0
            binding += bool((limits.pyramid @ law.force[held].T < 1e-6).any())
    assert compared > 50
    assert binding > 20
    assert deviation > 1e-3
    assert limited > 20 or torque_scale == 1.0
