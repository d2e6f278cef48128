"""The planar walk, the search for it, its periodicity, and the same gait in space."""

from __future__ import annotations

import dataclasses
import json
import sys

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_plane import PinocchioPlane
from planar_controller import PlanarWalkController
from scipy.interpolate import BPoly

import harpy_pin as hp
from harpy_pin.errors import HarpyError, InputError, RobotError, RunFileError
from harpy_pin.gaits.planar.gait_file import PACKAGED_GAIT, PAPER_CURVES_GAIT, SPACE_GAIT, OptimisedGait, load_gait
from harpy_pin.gaits.planar.joints import PlanarJoints, joint_targets, walk_record
from harpy_pin.gaits.planar.planar_gait import PlanarGait, planar_targets
from harpy_pin.gaits.planar.planar_model import PlanarModel
from harpy_pin.gaits.planar.planar_step import planar_step
from harpy_pin.gaits.planar.planar_walk import PlanarWalk
from harpy_pin.gaits.spatial import SpatialGait
from harpy_pin.gaits.straight import GaitParameters
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.kinematics import LegGeometry, leg_forward
from harpy_pin.model.record import field
from harpy_pin.simulation.step import step_record
from reproduction.gait.optimise import optimise_gait
from reproduction.gait.periodicity import SCALE, StepMap, analyse_periodicity, poincare_map
from reproduction.gait.search import SEARCHES, PlanarTask


@pytest.fixture(scope="module")
def model(robot):
    return PlanarModel.from_robot(robot)


@pytest.fixture(scope="module")
def packaged():
    return load_gait()


@pytest.fixture(scope="module")
def ground(packaged):
    """The ground that the packaged gait was found on."""
    return hp.Ground(mu_s=packaged.record["friction"][0])


def random_state(rng):
    return np.concatenate((rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 4))), rng.uniform(-3, 3, 7)


def in_space(q, v):
    """Configuration and velocity of the free-flying robot for a planar state, and the map S with v3 = S v, Ṡ v."""
    c, s = np.cos(q[2]), np.sin(q[2])
    q3 = np.zeros(13)
    q3[0], q3[2] = q[0], q[1]
    q3[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0, q[2], 0)).coeffs()
    q3[[8, 9, 11, 12]] = q[3:]
    rows = np.zeros((12, 7))
    rows[0, :2], rows[2, :2], rows[4, 2] = (c, -s), (s, c), 1.0  # body axes: Rᵀ of the world's velocity
    rows[[7, 8, 10, 11], [3, 4, 5, 6]] = 1.0
    drift = np.zeros(12)
    drift[:3] = -np.cross([0, v[2], 0], (rows @ v)[:3])
    return q3, rows @ v, rows, drift


# --- Planar model ---


@pytest.mark.parametrize("seed", range(10))
def test_planar_model_is_the_robot_held_in_the_plane(robot, model, seed):
    """Mass matrix, bias, feet and accelerations of the 3D model projected onto the plane."""
    rng = np.random.default_rng(seed)
    q, v = random_state(rng)
    q3, v3, rows, drift = in_space(q, v)
    space = Dynamics(robot)
    space.update(q3, v3)
    terms = model.terms(q, v)
    mass = rows.T @ space.mass_matrix @ rows
    bias = rows.T @ (space.mass_matrix @ drift + space.bias)
    np.testing.assert_allclose(terms["mass_matrix"], mass, atol=1e-12)
    np.testing.assert_allclose(terms["bias"], bias, atol=1e-10)
    np.testing.assert_allclose(terms["foot_position"], space.foot_position * [1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(terms["foot_jacobian"], space.foot_jacobian @ rows, atol=1e-12)
    torque, force, thrust = rng.uniform(-9, 9, 4), rng.uniform(-40, 40, 4), rng.uniform(-20, 20, 2)
    feet, mounts = np.zeros((2, 3)), np.zeros((2, 3))
    feet[:, [0, 2]] = force.reshape(2, 2)
    mounts[:, [0, 2]] = 0.5 * thrust
    planar = np.concatenate((np.zeros(3), torque)) - terms["bias"]
    planar += terms["foot_jacobian"].T @ feet.ravel() + terms["thruster_jacobian"].T @ mounts.sum(axis=0)
    joints = np.zeros(6)
    joints[[1, 2, 4, 5]] = torque
    full = rows.T @ (space.generalised_force(joints, feet, mounts) - space.bias - space.mass_matrix @ drift)
    np.testing.assert_allclose(
        np.linalg.solve(terms["mass_matrix"], planar), np.linalg.solve(mass, full), rtol=1e-9, atol=1e-9
    )


def test_planar_step_is_the_simulators_step(model):
    rng = np.random.default_rng(5)
    ground = hp.Ground(mu_s=0.4)
    simulator = PinocchioPlane(model, ground)
    q, v = np.array([0, 0.65, 0.1, -0.5, 0.9, -0.3, 0.6]), rng.uniform(-1, 1, 7)
    simulator.reset(q, v)
    terms, step = model.record.copy(), step_record(nv=7, feet=2, dt=5e-4)
    force = field(step, "force")
    touched = 0
    for _ in range(600):
        torque, thrust = rng.uniform(-1, 1, 4) - 5 * v[3:], rng.uniform(-5, 5, (2, 3)) * [1, 0, 1]
        simulator.advance(hp.Command(torque, thrust))
        planar_step(q, v, torque, thrust.sum(axis=0), terms, ground.record, step)
        touched += force[2] + force[5] > 0
        np.testing.assert_allclose(q, simulator.q, atol=1e-11)
        np.testing.assert_allclose(v, simulator.v, atol=1e-9)
        np.testing.assert_allclose(force, simulator.foot_force, atol=1e-6)
    assert touched > 40


def test_walk_is_the_controller_in_the_simulator(model, packaged, ground):
    """The compiled loop and a simulator with Pinocchio's terms log the same motion."""
    walk = PlanarWalk(model, packaged.gait, ground=ground)
    simulator = PinocchioPlane(model, walk.ground)
    simulator.reset(*walk.initial_state())
    q, torque = simulator.run(PlanarWalkController(model, packaged.gait), 1.2)
    walk.run(1.2, log=True)
    assert len(q) == len(walk.log) == 1200
    np.testing.assert_allclose(walk.log[:, 1:8], q, atol=1e-8)
    np.testing.assert_allclose(walk.log[:, 21:25], torque, atol=1e-4)


def test_a_robot_that_is_no_planar_biped(robot):
    with pytest.raises(RobotError, match="biped"):
        PlanarModel.from_robot(dataclasses.replace(robot, feet=("left_foot",)))


# --- Curves ---


def targets(gait, t):
    position, velocity, stance = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))
    planar_targets(t, gait.record[0], position, velocity, stance)
    return position, velocity, stance


def joints_at(t, q, v, gait, model):
    """Targets and rates of the joints."""
    walk = walk_record(gait, PlanarJoints(), period=1e-3)
    joint_targets(t, q, v, walk[0], model.record[0])
    return field(walk, "target"), field(walk, "rate")


ENDS = PlanarGait(
    lift_x=0.02,
    lift_z=0.01,
    land_x=-0.03,
    land_z=0.02,
    load_x=-0.05,
    load_z=0.01,
    push_x=0.04,
    push_z=-0.01,
    offset=0.02,
)


@pytest.mark.parametrize("double", [0.0, 0.4])
def test_bezier_end_conditions(double):
    """Feet start and end where told, with 4/duration of the given differences: zero as the paper prints it."""
    for gait in (PlanarGait(), ENDS):
        gait = dataclasses.replace(gait, double_support=double)
        g, T = gait, gait.step_duration
        stance_time, swing_time = T * (1 + double), T * (1 - double)
        front, back = (g.offset + g.half_step, -g.end_height), (g.offset - g.half_step, -g.end_height)
        begin, end = T * double, T
        # The left foot carries from t = 0; the right one swings from the end of the double support to the step's end.
        for t, k, place, rate, span in (
            (0.0, 0, front, (g.load_x, g.load_z), stance_time),
            (stance_time - 1e-8, 0, back, (g.push_x, g.push_z), stance_time),
            (begin + 1e-12, 1, back, (g.lift_x, g.lift_z), swing_time),
            (end - 1e-8, 1, front, (g.land_x, g.land_z), swing_time),
        ):
            position, velocity, _ = targets(gait, t)
            np.testing.assert_allclose(position[k], place, atol=1e-7)
            np.testing.assert_allclose(velocity[k], 4 * np.array(rate) / span, atol=1e-6)


def test_targets_are_bernstein_polynomials():
    gait = ENDS
    for k, row in ((0, 0), (1, 1)):
        polynomial = BPoly(gait.curves[row][:, None, :], [0.0, gait.step_duration])
        for t in np.linspace(0.01, 0.74, 7):
            position, velocity, stance = targets(gait, t)
            assert stance[k, 0] == 1 - row
            np.testing.assert_allclose(position[k], polynomial(t), atol=1e-14)
            np.testing.assert_allclose(velocity[k], polynomial.derivative()(t), atol=1e-12)


@pytest.mark.parametrize("double", [0.0, 0.3])
def test_hand_made_walk_in_the_plane(robot, double):
    parameters = GaitParameters(double_support=double)
    gait, planar = hp.StraightGait(robot, parameters), PlanarGait.from_walk(parameters)
    for t in np.linspace(0.0, 2.9, 40):
        target = gait.update(t)
        position, velocity, stance = targets(planar, t)
        np.testing.assert_allclose(position, target.foot_position[:, [0, 2]], atol=1e-12)
        np.testing.assert_allclose(velocity, target.foot_velocity[:, [0, 2]], atol=1e-11)
        np.testing.assert_array_equal(stance[:, 0], target.stance)


def test_joint_targets_put_the_feet_there(robot, model):
    geometry = LegGeometry.from_robot(robot, "left_foot")
    gait, q, v = ENDS, np.zeros(7), np.zeros(7)
    foot = np.zeros(3)
    for t in np.linspace(0.02, 1.45, 20):
        found, rate = joints_at(t, q, v, gait, model)
        ahead, _ = joints_at(t + 1e-6, q, v, gait, model)
        position = targets(gait, t)[0]
        for k in range(2):
            leg_forward(geometry.record[0], np.array([0.0, *found[2 * k : 2 * k + 2]]), foot)
            np.testing.assert_allclose(foot[[0, 2]], position[k], atol=1e-12)
        np.testing.assert_allclose(rate, (ahead - found) / 1e-6, atol=1e-4)


def test_pitch_feedback_turns_the_legs(model):
    """−1 holds a flying leg upright in the world; the carrying leg follows its own gain."""
    q, v = np.array([0, 0.6, 0.2, 0, 0, 0, 0.0]), np.zeros(7)
    plain, _ = joints_at(0.3, q, v, PlanarGait(), model)
    turned, _ = joints_at(0.3, q, v, PlanarGait(swing_pitch=-1.0, stance_pitch=0.5), model)
    np.testing.assert_allclose(turned - plain, [0.1, 0.0, -0.2, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    "bad",
    [
        {"half_step": 0.0},
        {"half_step": "far"},
        {"end_height": float("nan")},
        {"double_support": 0.95},
        {"thrust_k_p": -1},
    ],
    ids=str,
)
def test_bad_numbers(bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        PlanarGait(**bad)


# --- The packaged gait ---


@pytest.mark.parametrize("path", [PACKAGED_GAIT, SPACE_GAIT, PAPER_CURVES_GAIT], ids=lambda path: path.stem)
def test_packaged_gaits_walk_as_asked(model, path):
    """≥ 10 steps at 0.3 ± 0.03 m/s, height 0.6 ± 0.03 m, |pitch| ≤ 0.15 rad at any time, by the clock alone."""
    found = load_gait(path)
    gait = found.gait
    assert not gait.feedback
    assert not gait.thrust
    summary = PlanarWalk(model, gait, ground=hp.Ground(mu_s=found.record["friction"][0])).run(20 * gait.step_duration)
    assert not summary.fell
    assert summary.steps == pytest.approx(20)
    assert summary.speed == pytest.approx(0.3, abs=0.03)
    assert summary.height_min >= 0.57
    assert summary.height_max <= 0.63
    assert summary.pitch_max <= 0.15
    assert summary.thrust_rms == 0.0
    assert summary.slip < 2.0 or path == SPACE_GAIT  # that one is made for the ground forces of the walk in space


@pytest.mark.parametrize("mu", [0.25, 0.4, 0.8])
def test_packaged_gait_minds_no_friction(model, packaged, mu):
    summary = PlanarWalk(model, packaged.gait, ground=hp.Ground(mu_s=mu)).run(20.0)
    assert not summary.fell
    assert summary.speed == pytest.approx(0.3, abs=0.015)
    assert summary.pitch_max < 0.03
    assert summary.slip < 1.5


def test_the_papers_curves_have_the_papers_ends():
    points = load_gait(PAPER_CURVES_GAIT).gait.curves
    np.testing.assert_array_equal(points[:, 0], points[:, 1])
    np.testing.assert_array_equal(points[:, 3], points[:, 4])
    assert load_gait(PAPER_CURVES_GAIT).gait.double_support == 0.0


def test_packaged_gait_says_how_it_was_found(packaged):
    record = packaged.record
    assert record["command"].startswith("harpy gait ")
    assert record["search"] in SEARCHES
    assert record["evaluations"] > 0
    assert record["ending"] == "completed"
    assert record["cost"] < 30


def test_a_walk_that_falls_says_so(model):
    summary = PlanarWalk(model, PlanarGait()).run(5.0)
    assert summary.fell
    assert summary.duration < 5.0


# --- Search ---


def task(model, **changes):
    return PlanarTask(model=model, **{"search": "paper", "duration": 0.9, **changes})


def test_search_is_seeded(robot, model):
    np.random.seed(1)  # noqa: NPY002 - the search must not look at it
    first = optimise_gait(robot, task=task(model), seed=4, budget=90)
    before = np.random.random()  # noqa: NPY002
    second = optimise_gait(robot, task=task(model), seed=4, budget=90)
    other = optimise_gait(robot, task=task(model), seed=5, budget=90)
    assert first.gait == second.gait
    assert first.record == second.record
    assert other.gait != first.gait
    np.random.seed(1)  # noqa: NPY002
    assert np.random.random() == before  # noqa: NPY002 - nor move it


@pytest.mark.parametrize("start", [None, PlanarGait(half_step=0.05)], ids=["everywhere", "around a gait"])
def test_resumed_search_is_the_uninterrupted_one(robot, model, tmp_path, start):
    path = tmp_path / "search.json"
    whole = optimise_gait(robot, task=task(model), seed=2, budget=95, start=start)
    optimise_gait(robot, task=task(model), seed=2, budget=70, start=start, resume=path)
    seen = []
    resumed = optimise_gait(
        robot, task=task(model), seed=2, budget=95, start=start, resume=path, on_progress=seen.append
    )
    assert resumed == whole
    assert [p.evaluations for p in seen] == list(range(71, 96))
    assert seen[-1].cost == whole.record["cost"]


def test_search_improves_and_reports(robot, model):
    seen = []
    found = optimise_gait(robot, task=task(model), seed=0, budget=80, on_progress=seen.append)
    costs = [p.cost for p in seen]
    assert costs == sorted(costs, reverse=True)
    assert found.record["cost"] == costs[-1] < costs[0]
    assert task(model).evaluate(found.gait) == costs[-1]
    both = task(model, friction=(0.25, 0.8))
    each = [both.cost(summary, found.gait) for summary in both.walk(found.gait)]
    assert both.evaluate(found.gait) == max(each)
    assert each[0] == costs[-1]
    for name, (low, high) in SEARCHES["paper"].items():
        assert low <= getattr(found.gait, name) <= high


def test_interrupted_search_keeps_the_best(robot, model, tmp_path):
    path = tmp_path / "search.json"

    def stop(progress):
        if progress.evaluations == 5:
            raise KeyboardInterrupt

    found = optimise_gait(robot, task=task(model), budget=50, resume=path, on_progress=stop)
    assert found.record["ending"] == "interrupted"
    assert len(json.loads(path.read_text())["costs"]) == 5


def test_resume_refuses_other_searches_and_damage(robot, model, tmp_path):
    path = tmp_path / "search.json"
    optimise_gait(robot, task=task(model), seed=1, budget=3, resume=path)
    with pytest.raises(RunFileError, match="seed is 1, desired 2"):
        optimise_gait(robot, task=task(model), seed=2, budget=3, resume=path)
    for text in ("not json", "[]", '{"costs": ["x"]}', "{}"):
        path.write_text(text)
        with pytest.raises(RunFileError, match="damaged"):
            optimise_gait(robot, task=task(model), budget=3, resume=path)


@pytest.mark.parametrize(
    "bad", [{"budget": 0}, {"budget": 1.5}, {"budget": "many"}, {"seed": -1}, {"seed": 0.5}], ids=str
)
def test_bad_search(robot, model, bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        optimise_gait(robot, task=task(model), **bad)


@pytest.mark.parametrize(
    "bad",
    [{"search": "lucky"}, {"duration": 0.0}, {"friction": (0.0,)}, {"friction": ()}, {"fixed": {"leg": 1.0}}],
    ids=str,
)
def test_bad_task(model, bad):
    with pytest.raises(InputError):
        task(model, **bad)


def test_search_without_its_library(robot, model, monkeypatch):
    monkeypatch.setitem(sys.modules, "cma", None)
    with pytest.raises(HarpyError, match="pip install cma"):
        optimise_gait(robot, task=task(model), budget=3)


# --- Files ---


def test_file_round_trip(tmp_path):
    path = tmp_path / "gait.toml"
    gait = OptimisedGait(
        ENDS, {"command": 'harpy "gait"\n\\', "seed": 3, "cost": 1.25, "fell": False, "mu": [0.25, 0.8]}
    )
    gait.save(path)
    assert load_gait(path) == gait


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format = ", "not a TOML"),
        ("format = 1", "no gait of format"),
        ("format = 9\n[gait]", "no gait of format"),
        ("format = 1\n[gait]\nhalf_step = -1", "half_step"),
        ("format = 1\n[gait]\nhalf_step = 'x'", "half_step"),
        ("format = 1\n[gait]\nhalf_step = nan", "half_step"),
        ('format = 1\n[gait]\nspeed = "0.3"', "speed"),
        ("format = 1\n[gait]\nspeed = true", "speed"),
        ("format = 1\n[gait]\nspeed = [0.3]", "speed"),
        ("format = 1\n[gait]\nspeed = nan", "speed"),
        ("format = 1\n[gait]\nspeed = 2020-01-01", "speed"),
        (f"format = 1\n[gait]\nspeed = 1{'0' * 400}", "strange"),
        (f"format = 1\n[gait]\nspeed = 1{'0' * 5000}", "strange"),
        (f"format = 1\na = {'[' * 50_000}", "strange"),
        ("format = 1\ngait = 3", "strange"),
        ("format = []\n[gait]", "strange"),
    ],
    ids=lambda text: text[:40],
)
def test_bad_files_are_refused_by_name(tmp_path, text, message):
    path = tmp_path / "strange.toml"
    path.write_text(text)
    with pytest.raises(RunFileError, match=message) as caught:
        load_gait(path)
    assert "strange.toml" in str(caught.value)
    assert len(str(caught.value)) < 400


def test_an_unknown_number_in_a_file_is_told(tmp_path):
    path = tmp_path / "gait.toml"
    path.write_text("format = 1\n[gait]\nstride = 1")
    with pytest.raises(RunFileError, match=r"stride.*step_duration"):
        load_gait(path)


def test_missing_files(tmp_path):
    with pytest.raises(RunFileError, match="cannot read"):
        load_gait(tmp_path / "none.toml")
    with pytest.raises(RunFileError, match="cannot write"):
        OptimisedGait(PlanarGait()).save(tmp_path / "no" / "gait.toml")


# --- Periodicity ---


@pytest.fixture(scope="module")
def periodic(model, packaged, ground):
    return analyse_periodicity(model, packaged.gait, ground=ground, memory=False, settle=20)


@pytest.fixture
def step_map(model, packaged, ground):
    """A step of the packaged gait, with joints whose integrals are off."""
    return StepMap(model, packaged.gait, ground=ground, joints=PlanarJoints(k_i=(0.0, 0.0)))


def test_step_map_is_the_walk(step_map):
    """Two maps in a row are two steps of the walk, legs exchanged twice."""
    start, later = step_map.settle(4), step_map.settle(6)
    np.testing.assert_allclose(step_map(step_map(start)), later, atol=1e-6)


def test_fixed_point(step_map, periodic):
    assert periodic.residual < 1e-8
    np.testing.assert_allclose(step_map(periodic.section), periodic.section, atol=1e-6)
    assert not periodic.memory
    assert len(periodic.eigenvalues) == 13


def test_packaged_gait_is_stable(step_map, periodic):
    """Spectral radius below one, and a disturbed walk really comes back at that rate."""
    assert periodic.stable
    assert periodic.spread[0] <= periodic.spectral_radius <= periodic.spread[1] < 0.95
    rng = np.random.default_rng(0)
    section = periodic.section + 1e-5 * SCALE[:13] * rng.standard_normal(13)
    distance = [np.abs((section - periodic.section) / SCALE[:13]).max()]
    for _ in range(12):
        section = step_map(section)
        distance.append(np.abs((section - periodic.section) / SCALE[:13]).max())
    assert distance[-1] < 0.1 * distance[0]


def test_packaged_gait_is_stable_with_its_integrals(model, packaged, ground):
    """The integrals creep for hundreds of steps; once settled, their slow decay is the largest eigenvalue."""
    found = analyse_periodicity(model, packaged.gait, ground=ground, newton=0)
    assert found.memory
    assert found.residual < 1e-5
    assert 0.95 < found.spread[0] <= found.spread[1] < 1.0


def test_jacobian_predicts_a_disturbance(step_map, periodic):
    matrix = poincare_map(step_map, periodic.section)
    shift = 1e-5 * np.random.default_rng(1).standard_normal(13)
    found = (step_map(periodic.section + shift * SCALE[:13]) - step_map(periodic.section)) / SCALE[:13]
    np.testing.assert_allclose(found, matrix @ shift, atol=0.05 * np.abs(matrix @ shift).max())


def test_periodicity_refuses(model):
    with pytest.raises(InputError, match="falls after"):
        analyse_periodicity(model, PlanarGait(), settle=10)
    with pytest.raises(InputError, match="thrust"):
        StepMap(model, PlanarGait(thrust_k_p=400.0))
    with pytest.raises(InputError, match="whole number of ticks"):
        StepMap(model, PlanarGait(step_duration=0.7503))


# --- In space ---


class Thrustless:
    """A controller whose thrusters are off."""

    def __init__(self, inner):
        self.inner, self.period = inner, inner.period

    def step(self, state):
        command = self.inner.step(state)
        command.thrust[:] = 0.0
        return command


def test_spatial_gait_has_the_planar_feet(robot, packaged):
    gait = SpatialGait(robot, packaged.gait)
    planar = packaged.gait
    for t in np.linspace(0.0, 3.0, 31):
        target = gait.update(t)
        position, velocity, stance = targets(planar, t)
        np.testing.assert_allclose(target.foot_position[:, [0, 2]], position, atol=1e-12)
        np.testing.assert_allclose(target.foot_velocity[:, [0, 2]], velocity, atol=1e-11)
        np.testing.assert_allclose(target.foot_position[:, 1] + target.body[1], [0.1, -0.1], atol=1e-12)
        np.testing.assert_array_equal(target.stance, stance[:, 0])
        np.testing.assert_array_equal(target.world_frame_blend, 0.0)


def test_planar_reference_is_periodic_and_its_own_derivative(robot, packaged, ground):
    gait = SpatialGait(robot, packaged.gait, reference="planar", settle=6, friction=ground.mu_s)
    for t in np.linspace(0.05, 1.4, 9):
        here = gait.update(t).body.copy()
        later = gait.update(t + 1.5).body.copy()
        h = 5e-3
        ahead, behind = gait.update(t + h).body.copy(), gait.update(t - h).body.copy()
        np.testing.assert_allclose(later[2:6], here[2:6], atol=1e-9)
        assert later[0] - here[0] == pytest.approx(1.5 * 0.3, abs=0.05)
        np.testing.assert_allclose(here[[3, 5]], (ahead - behind)[[0, 2]] / (2 * h), atol=0.08)


def test_in_space_it_falls_without_thrusters_and_walks_with_them(robot, packaged, ground):
    """The paper's claim: the planar gait is not stable in space without thrusters (equations.md Q4)."""
    endings = []
    for wrap in (Thrustless, lambda controller: controller):
        gait = SpatialGait(robot, packaged.gait)
        controller = wrap(hp.make_controller("governed", gait, mu=ground.mu_s, governor="none"))
        scenario = hp.Scenario(ground=ground, duration=3.0)
        endings.append(hp.walk(scenario, gait=gait, controller=lambda _, chosen=controller: chosen).ending)
    assert endings == ["fell", "completed"]


@pytest.mark.parametrize("governor", ["none", "paper"])
def test_in_space_at_the_papers_friction(robot, packaged, ground, governor):
    """No fall, 0.3 m/s ± 5 %, upright within 0.15 rad, at most 8 mm of slip per step."""
    gait = SpatialGait(robot, packaged.gait, reference="planar")
    scenario = hp.Scenario(controller=hp.Governed(governor=governor, mu=0.25), ground=ground)
    measures = hp.measure(hp.walk(scenario, gait=gait))
    assert measures.ending == "completed"
    assert measures.distance_m / measures.duration_s == pytest.approx(0.3, rel=0.05)
    assert max(measures.roll_max_rad, measures.pitch_max_rad, measures.yaw_max_rad) <= 0.15
    assert measures.slip_mm_per_step <= 8.0


def test_spatial_gait_refuses(robot, packaged):
    with pytest.raises(InputError, match="reference of the body"):
        SpatialGait(robot, packaged.gait, reference="moon")
    with pytest.raises(InputError, match="feedback"):
        SpatialGait(robot, PlanarGait(stance_pitch=0.1))
    with pytest.raises(InputError, match="falls before"):
        SpatialGait(robot, PlanarGait(), reference="planar")
    with pytest.raises(InputError, match="reach"):
        SpatialGait(robot, PlanarGait(end_height=0.85))
