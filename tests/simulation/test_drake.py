"""Drake as a third plant: the same robot, the same ground, the same walks."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_drake
from random_trees import BODIES, random_model, random_state
from scipy.integrate import solve_ivp

import harpy_pin as hp
from harpy_pin import Actuators, Command, Drake, Ground, InputError, Push, Robot, Scenario, Simulator
from harpy_pin.simulation.drake import APPROXIMATIONS, DrakePlant, drake_model
from harpy_pin.simulation.drake.drake_model import DrakeModel

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))


def inside(robot):
    settings = {"approximation": "sap", "dissipation": 1.0, "dt": 1e-6, "foot_radius": 1e-4}
    return DrakeModel(robot, ground=Ground(), gravity=robot.model.gravity.linear, **settings)


def on_slope(sled, share, *, mu=0.25, approximation="lagged"):
    """The sled at rest on a slope that needs this share of its friction."""
    angle = np.arctan(share * mu)
    gravity = 9.81 * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    plant = DrakePlant(sled, Ground(mu_s=mu), gravity=gravity, approximation=approximation)
    q = pin.neutral(sled.model)
    q[2] = -plant.static_penetration
    plant.reset(q, np.zeros(6))
    return plant, angle


@needs_drake
@pytest.mark.parametrize("seed", range(3))
def test_any_tree_accelerates_as_pinocchio_says(seed):
    """Every kind of joint, in any order, free of the ground: one tiny step has Pinocchio's acceleration."""
    model, rng = random_model(seed)
    for i in range(1, BODIES + 1):
        body = model.inertias[i]
        box = pin.Inertia.FromBox(body.mass, *rng.uniform(0.1, 1.0, 3)).inertia
        model.inertias[i] = pin.Inertia(body.mass, body.lever, box)
    robot = Robot(model, hp.load_harpy().urdf, (), (), np.inf)
    plant, force = inside(robot), rng.standard_normal(model.nv)
    q, v = random_state(model, rng)
    plant.reset(q, v)
    again_q, again_v = pin.neutral(model), np.zeros(model.nv)
    plant._read(again_q, again_v)
    np.testing.assert_allclose(again_q, q, rtol=0, atol=1e-14)
    np.testing.assert_allclose(again_v, v, rtol=0, atol=1e-14)
    data = model.createData()
    wanted = pin.aba(model, data, q, v, force - model.damping * v)
    plant.step(force, again_q, again_v)
    # Ours is the rate of v in axes that turn with the body; both differ from it by the length of the step.
    found = (again_v - v) / 1e-6
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-3 * np.abs(wanted).max())


@needs_drake
def test_flight_under_torques_thrusts_and_a_push_converges_to_ours(robot):
    """Two integrators of order one for the same equations: their gap halves with the step."""
    command = Command(np.linspace(-1.0, 1.0, 6), np.array([[1.0, -2.0, 12.0], [-3.0, 1.0, 18.0]]))
    push, gaps = Push(0.0, (0.4, -0.3, 0.2), 0.02), []
    for dt in (1e-3, 5e-4, 2.5e-4):
        plants = [kind(robot, dt=dt) for kind in (Simulator, DrakePlant)]
        q = np.array([0, 0, 2.0, 0.1, -0.2, 0.3, 0.9, 0.1, -0.2, 0.5, 0.0, -0.3, 0.6])
        for plant in plants:
            plant.reset(q, np.linspace(-0.3, 0.3, 12))
            plant.advance(command, (push,), steps=round(0.04 / dt))
        gaps.append(np.abs(plants[0].q - plants[1].q).max())
    assert gaps[1] < 0.6 * gaps[0]
    assert gaps[2] < 0.6 * gaps[1] < 1e-3


@needs_drake
@pytest.mark.parametrize("approximation", APPROXIMATIONS)
def test_a_body_falls_on_the_ground_as_its_law_says(sled, approximation):
    """Hunt and Crossley's law, or a spring and a damper, integrated by a solver of high order."""
    ground = Ground(mu_s=0.5)
    k, d, mass = ground.stiffness, ground.damping, 2.0
    depth = mass * 9.81 / k

    def slope(_, y):
        force = 0.0
        if y[0] < 0.0:
            damped = -d * y[1] if approximation == "sap" else y[0] * y[1] * d / depth
            force = max(-k * y[0] + damped, 0.0)
        return [y[1], -9.81 + force / mass]

    times = np.linspace(0.0, 0.1, 26)
    exact = solve_ivp(slope, (0, 0.1), [0.005, 0.0], rtol=1e-9, atol=1e-12, max_step=1e-4, t_eval=times).y.T
    assert exact[:, 0].min() < -0.5 * depth
    errors = []
    for dt in (4e-4, 1e-4):
        plant = DrakePlant(sled, ground, dt=dt, approximation=approximation)
        q = pin.neutral(sled.model)
        q[2] = 0.005
        plant.reset(q, np.zeros(6))
        rows = []
        for _ in times:
            rows.append(plant.q[2])
            plant.advance(NOTHING, steps=round(0.004 / dt))
        errors.append(np.abs(np.array(rows) - exact[:, 0]).mean())
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 4e-5
    plant.advance(NOTHING, steps=8000)
    assert plant.q[2] == pytest.approx(-plant.static_penetration, rel=1e-4)
    np.testing.assert_allclose(plant.state.foot_force, [[0, 0, mass * 9.81]], atol=1e-3)


@needs_drake
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_block_inside_the_cone_creeps_as_the_closed_form_says(sled, share):
    plant, _ = on_slope(sled, share)
    plant.advance(NOTHING, steps=40)  # later the sled turns: its contact is 0.1 mm below its centre
    before = plant.q[0]
    plant.advance(NOTHING, steps=40)
    creep = plant.creep(plant.state.foot_force)[0]
    assert creep[0] == pytest.approx(1e-4 * share / np.sqrt(1.0 - share**2), rel=1e-3)
    assert (plant.q[0] - before) / 0.02 == pytest.approx(creep[0], rel=3e-3)


@needs_drake
@pytest.mark.parametrize("approximation", APPROXIMATIONS)
def test_slopes_hold_and_slide_as_coulomb_says(sled, approximation):
    plant, _ = on_slope(sled, 0.6, approximation=approximation)
    plant.advance(NOTHING, steps=2000)
    assert 0.0 <= plant.q[0] < 1e-4
    assert plant.slip_path[0] == pytest.approx(plant.q[0], rel=1e-3)
    plant, angle = on_slope(sled, 1.2, approximation=approximation)
    plant.advance(NOTHING, steps=2000)
    assert plant.q[0] == pytest.approx(0.5 * 9.81 * (np.sin(angle) - 0.25 * np.cos(angle)), rel=5e-3)
    force = plant.state.foot_force[0]
    assert np.hypot(*force[:2]) == pytest.approx(0.25 * force[2], rel=1e-4)


@needs_drake
def test_walks_agree_with_ours():
    """Distance within 2 %, mean normal force within 2 %, of our plant on the same ground."""
    for controller in (hp.Governed(governor="filter"), hp.Condensed()):
        runs = [
            hp.walk(Scenario(plant=plant, controller=controller, ground=Ground(mu_s=0.25), duration=1.5))
            for plant in ("compliant", "drake")
        ]
        assert all(run.ending == "completed" for run in runs)
        ways = [run["q"][-1, 0] - run["q"][0, 0] for run in runs]
        assert ways[1] == pytest.approx(ways[0], rel=0.02)
        normals = [run["foot_force"][:, :, 2].sum(axis=1).mean() for run in runs]
        assert normals[1] == pytest.approx(normals[0], rel=0.02)


@needs_drake
def test_forces_lie_in_the_cone_by_sap_and_a_step_late_by_lagged():
    """The friction of ``lagged`` is that of the last step's normal force."""
    for plant, beyond in ((Drake("sap"), 1e-5), (Drake(), 1.0)):
        force = hp.walk(Scenario(plant=plant, ground=Ground(mu_s=0.15), duration=0.4))["foot_force"]
        along, most = np.hypot(force[..., 0], force[..., 1]), 0.15 * force[..., 2]
        assert along.max() > 1.0
        assert np.all(along <= most * (1.0 + 1e-5) + beyond)


@needs_drake
def test_a_scenario_is_saved_and_walks_again(tmp_path):
    scenario = Scenario(
        plant=Drake("sap"),
        ground=Ground(mu_s=0.6),
        disturbances=hp.Disturbances(mass_error=0.1, actuators=Actuators(bandwidth=100.0, viscous_friction=0.1)),
        duration=0.1,
    )
    run = hp.walk(scenario, save=tmp_path / "run.npz")
    again = hp.walk(Scenario.of(hp.Run.load(tmp_path / "run.npz")))
    np.testing.assert_array_equal(run["q"], again["q"])
    assert run.metadata["plant"]["name"] == "drake"
    assert run.metadata["plant"]["approximation"] == "sap"


def test_what_drake_does_not_have_is_refused():
    with pytest.raises(InputError, match="approximation"):
        Drake("tamsi")
    for ground in (Ground(cone="per_axis"), Ground(friction_strips=((0.1, 0.2, 0.1),))):
        with pytest.raises(InputError, match="Drake's"):
            Scenario(plant=Drake(), ground=ground)
    with pytest.raises(InputError, match="Coulomb"):
        DrakePlant(hp.load_harpy(), actuators=Actuators(coulomb_friction=0.1))


def test_without_drake_the_message_says_how_to_get_it(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(drake_model, "import_module", missing)
    with pytest.raises(InputError, match=r"harpy-pin\[drake\]"):
        hp.build(Scenario(plant="drake"))
