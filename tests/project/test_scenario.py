"""Scenarios: written down, read back, walked again."""

import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import needs_robots
from walks import assert_same, scenario, started

import harpy_pin as hp
from harpy_pin.controllers import CONTROLLERS, GOVERNORS, GovernedParameters, WholeBodyParameters
from harpy_pin.ground import HeightField, Plane, Ramp, Rough, Stairs
from harpy_pin.model.robot import heavier

EVERYTHING = hp.Scenario(
    controller=hp.Governed(
        governor="filter",
        limits=True,
        parameters={
            "estimate_friction": True,
            "joints": {"k_p": [900.0, 900.0, 900.0]},
            "attitude": {"k_d": 25.0},
        },
        mu=0.5,
    ),
    gait=hp.Straight(speed=0.25),
    disturbances=hp.Disturbances(
        mass_error=0.1,
        start_velocity=(0.02, -0.03, 0.0, 0.0, 0.1, 0.0),
        pushes=(hp.Push(0.1, (0.0, 1.0, 0.0)), hp.Push(0.2, (0.5, 0.0, 0.0), 0.05)),
        noise=hp.Noise.typical(0.2),
        delay=1e-3,
        actuators=hp.Actuators(bandwidth=100.0, coulomb_friction=0.1, thrusters={"lag": 0.05}),
        seed=7,
    ),
    ground=hp.Ground(
        mu_s=0.7, stiffness=9000.0, cone="per_axis", friction_strips=((0.05, 0.4, 0.1),)
    ),
    duration=0.4,
)
"""A walk with something of everything."""
WAVES = HeightField(
    heights=((0.0, 0.1), (0.0, -0.1), (0.2, 0.0)), resolution=0.2, corner=(-0.3, 0.4)
)
PLANTS = (
    hp.Pinocchio(stiction_tolerance=2e-3),
    hp.Mujoco("default"),
    hp.Mujoco("menagerie", foot_radius=0.02),
)

positive = st.floats(1e-3, 1e3)
small = st.floats(0.0, 2.0)
terrains = st.sampled_from(
    (None, Plane(slope=0.1, heading=0.7), Ramp(), Stairs(), Rough(seed=3), WAVES)
)


def noises():
    return st.builds(hp.Noise, position=small, foot_force=small)


def gaits(*, turning):
    """Gaits of Harpy; those that turn are not for the paper's controller."""
    rows = st.lists(
        st.tuples(st.floats(0.0, 90.0), *[small] * 3),
        min_size=1,
        max_size=3,
        unique_by=lambda row: row[0],
    )
    speed, stiffness = st.floats(-1.0, 1.0), st.none() | positive
    straight = st.builds(hp.Straight, speed=speed, stiffness=stiffness)
    velocity = rows.map(sorted) | st.tuples(*[small] * 3)
    return straight | st.builds(hp.Commanded, velocity=velocity) if turning else straight


def controllers():
    settings = st.builds(
        lambda swing: {"weights": {"swing": swing}, "solver": "daqp"}, small
    ) | st.just({})
    gains = st.builds(
        lambda k_d: {"attitude": {"k_p": 1.0}, "joints": {"k_d": [k_d] * 3}}, small
    ) | st.just({})
    mu, switch = st.none() | small, st.booleans()
    governed = st.builds(
        hp.Governed,
        mu=mu,
        parameters=gains,
        governor=st.sampled_from(GOVERNORS),
        evaluate_at=st.sampled_from(("measured", "tracked")),
        limits=switch,
        thrust=switch,
    )
    return governed | st.sampled_from((hp.Condensed, hp.WholeBody)).flatmap(
        lambda kind: st.builds(kind, mu=mu, parameters=settings)
    )


@st.composite
def scenarios(draw):
    controller = draw(controllers())
    period = draw(st.sampled_from((1e-3, 2e-3, 5e-4)))
    mu = draw(small)
    strips = draw(
        st.sampled_from(
            ({}, {"stiffness_strips": ((0.5, 1.0, 2e3),), "friction_strips": ((0.5, 1.0, 0.2),)})
        )
    )
    disturbances = hp.Disturbances(
        actuators=draw(st.sampled_from((hp.Actuators(), EVERYTHING.disturbances.actuators))),
        pushes=draw(
            st.lists(
                st.builds(hp.Push, small, st.tuples(small, small, small), positive), max_size=3
            )
        ),
        noise=draw(noises()),
        delay=period * draw(st.integers(0, 9)),
        mass_error=draw(st.floats(-0.9, 2.0)),
        start_velocity=draw(st.tuples(*[st.floats(-1.0, 1.0)] * 6)),
        seed=draw(st.integers(0, 2**64)),
    )
    return hp.Scenario(
        gait=draw(gaits(turning=controller.name != "governed")),
        controller=controller,
        plant=draw(st.sampled_from(("compliant", "pinocchio", "mujoco", hp.Mujoco("stiff")))),
        ground=hp.Ground(
            mu_s=mu,
            mu_c=draw(st.floats(0.0, mu)),
            stiffness=draw(positive),
            terrain=draw(terrains),
            **strips,
        ),
        disturbances=disturbances,
        duration=draw(st.floats(2.5, 100.0)),
        period=period,
        urdf=draw(
            st.none() | st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1)
        ),
    )


@given(scenarios())
@settings(max_examples=60)
def test_what_is_written_down_is_what_is_read(scenario):
    data = scenario.to_dict()
    read = hp.Scenario.from_dict(json.loads(json.dumps(data)))
    assert read == scenario
    assert hash(read) == hash(scenario)
    assert read.to_dict() == data
    assert list(data) == list(hp.Scenario.__dataclass_fields__)


@given(st.data())
@settings(max_examples=20)
def test_every_part_is_written_down(data):
    """Two scenarios that differ in one attribute have different dictionaries."""
    a, b = data.draw(scenarios()), data.draw(scenarios())
    for name in ("gait", "controller", "plant", "ground", "disturbances", "urdf"):
        one, other = (
            hp.Scenario(duration=100.0, period=5e-4, **{name: getattr(s, name)}) for s in (a, b)
        )
        assert (one.to_dict() == other.to_dict()) == (one == other)


@pytest.mark.parametrize(
    "given",
    [
        EVERYTHING,
        hp.Scenario(duration=0.3),
        hp.Scenario(controller=hp.Governed(governor="none"), duration=0.3),
        scenario(
            controller=hp.WholeBody(parameters={"solver": "active_set"}),
            duration=0.3,
            noise=hp.Noise.typical(0.5),
        ),
        *(hp.Scenario(plant=plant, duration=0.05) for plant in PLANTS),
        replace(EVERYTHING, plant=hp.Mujoco("stiff"), ground=hp.Ground(mu_s=0.6)),
    ],
    ids=lambda given: f"{given.controller.name} {given.plant.name}",
)
def test_a_run_is_walked_again_from_its_file(given, tmp_path):
    run = hp.walk(given)
    run.save(tmp_path / "run.npz")
    loaded = hp.Run.load(tmp_path / "run.npz")
    assert hp.Scenario.of(loaded) == given
    again = hp.walk(hp.Scenario.of(loaded))
    assert_same(again, run)
    assert again.metadata == run.metadata


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_walk_is_what_its_parts_make_by_hand(robot, name):
    gait = hp.make_gait(robot, speed=0.2)
    # ProxQP's last digits depend on where its memory lies.
    parameters = {"governed": {"limits": True}, "wbc": {"solver": "active_set"}}.get(name, {})
    governor = "paper" if name == "governed" else "none"
    controller = hp.make_controller(name, gait, mu=0.3, governor=governor, **parameters)
    part = {"name": name, "mu": 0.3}
    part |= (
        {"governor": governor, "limits": True} if name == "governed" else {"parameters": parameters}
    )
    pushes = [hp.Push(0.05, (0.0, 1.0, 0.0))]
    by_hand = started(hp.Simulator(robot, hp.Ground(mu_s=0.4)), gait).run(
        controller, 0.2, pushes=pushes
    )
    asked = scenario(
        controller=part, gait=hp.Straight(speed=0.2), mu_s=0.4, pushes=pushes, duration=0.2
    )
    run = hp.walk(asked, metadata={"note": "mine"})
    assert_same(run, by_hand)
    expected = {**by_hand.metadata, "note": "mine", "scenario": asked.to_dict()}
    assert json.dumps(run.metadata, sort_keys=True) == json.dumps(expected, sort_keys=True)


def test_the_walk_is_made_for_the_ground_or_for_the_one_that_is_assumed():
    def offset(**more):
        return hp.build(hp.Scenario(**more)).gait.parameters.penetration_offset

    assert offset() == 0.005
    assert offset(ground=hp.Ground(stiffness=40e3)) == pytest.approx(0.001)
    assert offset(ground=hp.Ground(stiffness=40e3), gait=hp.Straight(stiffness=8e3)) == 0.005
    assert offset(plant=hp.Mujoco("stiff")) == pytest.approx(0.0005)


def test_damping_ratio_of_the_ground_stays():
    assert hp.Ground().damping == 268.3
    for stiffness in (4e3, 80e3):
        assert hp.Ground(stiffness=stiffness).damping / np.sqrt(stiffness) == pytest.approx(
            268.3 / np.sqrt(8e3)
        )
    assert hp.Ground(stiffness=4e3, damping=0.0).damping == 0.0


def test_a_heavier_body(robot):
    """The mass matrix grows by the body's spatial inertia, times the error, and nowhere else."""
    q, data = (
        pin.randomConfiguration(robot.model, -np.ones(13), np.ones(13)),
        robot.model.createData(),
    )
    changed = heavier(robot, 0.3)
    before = pin.crba(robot.model, data, q).copy()
    after = pin.crba(changed.model, changed.model.createData(), q)
    expected = np.zeros_like(before)
    expected[:6, :6] = 0.3 * robot.model.inertias[1].matrix()
    np.testing.assert_allclose(np.triu(after - before), np.triu(expected), atol=1e-12)
    built = hp.build(scenario(mass_error=0.3))
    body = robot.model.inertias[1].mass
    assert built.gait.robot.mass == built.controller.robot.mass == robot.mass
    assert built.simulator.robot.mass == pytest.approx(robot.mass + 0.3 * body)
    assert built.simulator.q[2] < hp.build(hp.Scenario()).simulator.q[2]  # it sinks in deeper


def test_the_start_is_moved_by_what_was_asked_for():
    moves = ((0,) * 6, (0.1, -0.2, 0, 0, 0.3, 0))
    plain, moved = (hp.build(scenario(start_velocity=v)).simulator for v in moves)
    np.testing.assert_array_equal(moved.q, plain.q)
    np.testing.assert_allclose(moved.v - plain.v, [0.1, -0.2, 0, 0, 0.3, 0, *[0] * 6], atol=1e-15)


def test_the_controller_believes_in_its_own_friction():
    for assumed, believed in ((None, 0.4), (0.9, 0.9)):
        built = hp.build(
            hp.Scenario(controller=hp.WholeBody(mu=assumed), ground=hp.Ground(mu_s=0.4))
        )
        assert built.controller.parameters.limits.mu == believed
        assert built.simulator.ground.mu_s == 0.4


def test_parameters_reach_the_controller():
    changes = {
        "solver": "daqp",
        "weights": {"swing": 0.5},
        "limits": {"faces": 4},
        "body": [30.0, 12.0],
    }
    wbc = hp.build(
        scenario(controller=hp.WholeBody(parameters=changes), mu_s=0.6)
    ).controller.parameters
    default = WholeBodyParameters.for_gait(hp.make_gait(hp.load_harpy()))
    weights, limits = replace(default.weights, swing=0.5), replace(default.limits, faces=4, mu=0.6)
    assert wbc == replace(default, solver="daqp", body=(30.0, 12.0), weights=weights, limits=limits)
    part = hp.Governed(parameters={"centre": {"k_pt": 300.0}}, limits=True)
    governed = hp.build(hp.Scenario(controller=part)).controller
    default = GovernedParameters(limits=True)
    assert governed.parameters == replace(default, centre=replace(default.centre, k_pt=300.0))
    # The governor stands in front of the law with the changed gains, as its rows know.
    assert list(governed.governor.rows.record["k_pt"][0]) == [300.0] * 3


class Still:
    """A controller of one's own that does nothing."""

    def __init__(self, gait):
        self.gait = gait

    def step(self, state):
        return hp.Command(np.zeros(6), np.zeros((2, 3)))


class Slow(Still):
    period = 2e-3


def test_parts_of_ones_own(robot, tmp_path):
    gait = hp.make_gait(robot, speed=0.1)
    short = hp.Scenario(duration=0.02)
    run = hp.walk(short, gait=gait, controller=Still)
    assert run.metadata["controller"] == "Still"
    assert np.all(run["torque"] == 0.0)
    run.save(tmp_path / "own.npz")
    with pytest.raises(hp.InputError, match="its own gait and controller"):
        hp.Scenario.of(hp.Run.load(tmp_path / "own.npz"))
    assert (
        hp.build(short, controller=lambda gait: Still(gait)).controller.gait.parameters.speed == 0.3
    )
    with pytest.raises(hp.InputError, match=r"0\.002 s is not the scenario's 0\.001"):
        hp.walk(short, controller=Slow)
    assert len(hp.walk(replace(short, period=2e-3), controller=Slow)) == 10


def test_a_run_without_a_scenario(robot):
    with pytest.raises(hp.InputError, match="holds no scenario"):
        hp.Scenario.of(started(hp.Simulator(robot), hp.make_gait(robot)).run(Still(None), 0.002))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"controller": "lqr"}, "valid names: condensed, governed, wbc"),
        ({"gait": "trot"}, "valid names: commanded, (flying, )?hand, hovering, standing"),
        (
            {"gait": {"name": "soar", "import": "a.b"}},
            "gait 'soar' is known after 'import a.b', which is missing",
        ),
        ({"gait": 3}, "gait must be a part .*Straight.* or a name, got 3"),
        (
            {"gait": {"name": "hand", "colour": 1}},
            "unknown setting of the gait 'hand' 'colour'; valid names: speed",
        ),
        ({"gait": "trot", "robot": "go2"}, r"Walking\(schedule='trot'\)"),
        ({"controller": "paper"}, r"it is Governed\(governor='paper'\)"),
        ({"robot": "./x.urdf"}, r"hp\.load_robot\(path, feet=\.\.\.\)"),
        ({"gait": {"speed": 0.3, "velocity": (0, 0, 0)}}, "'velocity'.* of the gait 'commanded'"),
        ({"gait": "commanded", "controller": "governed"}, "cannot turn"),
        ({"gait": {"name": "hand", "speed": "fast"}}, "speed must be a number"),
        ({"plant": "bullet"}, "valid names: compliant, mujoco, pinocchio"),
        (
            {"plant": "mujoco", "ground": hp.Ground(cone="per_axis")},
            "MuJoCo's friction cone is circular",
        ),
        ({"ground": 0.8}, "ground must be a Ground"),
        ({"ground": {"mu": 0.3}}, "unknown entry of the ground 'mu'; valid names: cone"),
        ({"disturbances": 3}, "disturbances must be a Disturbances"),
        (
            {"disturbances": {"wind": 3}},
            "unknown entry of the disturbances 'wind'; valid names: actuators, delay",
        ),
        (
            {"disturbances": hp.Disturbances(pushes=[hp.Push(6.0, (0, 1, 0))])},
            "outside the run from 0 to 6 s",
        ),
        (
            {"disturbances": hp.Disturbances(delay=1.5e-3)},
            "delay 0.0015 s must be a multiple of the period",
        ),
        ({"disturbances": hp.Disturbances(delay=1e300)}, "multiple of the period"),
        ({"dt": 1e-300}, "dt must be finite and ≥ 1e-06"),
        ({"period": 1e-300}, "more than 10000000 periods"),
        ({"period": 1e300}, "multiple of the physics step"),
        ({"duration": 1e308}, "duration 1e[+]308 s is more than 10000000 periods"),
        ({"period": 7e-4}, "period 0.0007 s must be a multiple of the physics step"),
        ({"robot": "r2d2"}, "valid names: .*harpy"),
        ({"robot": "go2", "controller": "governed"}, "takes 'condensed' or 'wbc'"),
        ({"robot": "go2", "gait": "hand"}, "standing, walking"),
        (
            {"robot": "go2", "gait": {"name": "walking", "schedule": "amble"}},
            "valid names: bound, crawl",
        ),
        (
            {"robot": "go2", "gait": {"name": "walking", "velocity": "fast"}},
            "velocity must look like",
        ),
        (
            {"robot": "go2", "gait": {"name": "walking", "velocity": (0.1,)}},
            "velocity must have shape",
        ),
        ({"robot": "go2", "urdf": "a.urdf"}, "variant of Harpy"),
    ],
)
def test_parts_that_do_not_fit_are_refused(values, says):
    with pytest.raises(hp.InputError, match=says):
        hp.Scenario(**values)
    with pytest.raises(hp.InputError, match="scenario must be a mapping"):
        hp.Scenario.from_dict("scenario")
    with pytest.raises(
        hp.InputError, match="unknown entry of the scenario 'colour'; valid names: controller"
    ):
        hp.Scenario.from_dict({**EVERYTHING.to_dict(), "colour": "red"})


@pytest.mark.parametrize(
    ("part", "values", "says"),
    [
        (hp.Governed, {"governor": "best"}, "valid names: filter, none, paper"),
        (hp.Governed, {"evaluate_at": "guessed"}, "valid names: measured, tracked"),
        (hp.Governed, {"limits": "no"}, "limits must be true or false"),
        (hp.Governed, {"thrust": 1}, "thrust must be true or false"),
        (hp.Governed, {"parameters": {"weights": {}}}, "valid names: attitude, centre"),
        (hp.Governed, {"parameters": {"joints": 3}}, "parameters joints must be a mapping"),
        (hp.Governed, {"parameters": 3}, "must be a mapping"),
        (hp.Governed, {"parameters": {"joints": {"k_q": 3}}}, "valid names: integral_limit, k_d"),
        (hp.Governed, {"parameters": {"joints": {"k_p": np.nan}}}, "parameters must be numbers"),
        (hp.Governed, {"parameters": {"attitude": {"k_p": -1}}}, "attitude k_p"),
        (hp.Governed, {"parameters": {"period": 1e-3}}, "'period' has an argument of its own"),
        (
            hp.Governed,
            {"parameters": {"reference_velocity": "no"}},
            "reference_velocity must be true or false",
        ),
        (hp.Governed, {"governor_parameters": {"alpha": 1.0}}, "parameter 'alpha'"),
        (hp.Governed, {"governor_parameters": {"alpha_n": -1.0}}, "alpha_n"),
        (hp.Governed, {"governor_parameters": {"friction_share": 1.1}}, "friction_share"),
        (hp.Governed, {"governor_parameters": {"conditions": "both"}}, "conditions"),
        (hp.Governed, {"governor_parameters": [1]}, "mapping"),
        (
            hp.Governed,
            {"governor_parameters": {"alpha_n": object()}},
            "governor_parameters must be",
        ),
        (
            hp.Governed,
            {"governor": "none", "governor_parameters": {"alpha_n": 1.0}},
            "'none' has no parameters",
        ),
        (
            hp.Governed,
            {"governor": "filter", "governor_parameters": {"mu": 1.0}},
            "'mu' has an argument of its own",
        ),
        (
            hp.WholeBody,
            {"parameters": {"limits": {"mu": 1}}},
            "'limits.mu' has an argument of its own",
        ),
        (hp.WholeBody, {"parameters": {"solver": "best"}}, "unknown solver"),
        (hp.Commanded, {"velocity": (0.1, 0.2)}, "velocity must have shape"),
        (hp.Commanded, {"velocity": ()}, "velocity must be"),
        (hp.Commanded, {"velocity": "fast"}, "velocity must look like"),
        (
            hp.Mujoco,
            {"preset": "hard"},
            "valid names: default, elliptic, menagerie, overdamped, soft, stiff",
        ),
        (hp.Disturbances, {"noise": "loud"}, "noise must be a Noise"),
        (hp.Disturbances, {"noise": {"foot": 1}}, "unknown entry of the noise 'foot'"),
        (hp.Disturbances, {"start_velocity": (0.1, 0.2)}, "start_velocity must have shape"),
        (hp.Disturbances, {"start_velocity": (np.nan,) * 6}, "start_velocity must be finite"),
        (hp.Disturbances, {"pushes": [(1.0, (0, 1, 0))]}, "push must be a Push"),
        (
            hp.Disturbances,
            {"pushes": [{"time": 1.0, "force": 3}]},
            "unknown entry of the push 'force'",
        ),
        (hp.Disturbances, {"pushes": [{"time": 1.0}]}, "push: .*impulse"),
        (hp.Disturbances, {"pushes": 3}, "pushes must be a list"),
    ],
)
def test_a_part_checks_itself(part, values, says):
    with pytest.raises(hp.InputError, match=says):
        part(**values)


def test_a_part_is_given_as_itself_its_name_or_its_mapping():
    for part, name in ((hp.Straight(), "hand"), (hp.Commanded(), "commanded")):
        assert hp.Scenario(gait=part) == hp.Scenario(gait=name) == hp.Scenario(gait=part.to_dict())
    assert hp.Scenario() == hp.Scenario(
        gait="hand", controller="condensed", plant="compliant", ground={}
    )
    rows = ((0.0, 0.1, 0.0, 0.2),)
    assert hp.Commanded(velocity=(0.1, 0.0, 0.2)) == hp.Commanded(velocity=rows)


@pytest.mark.parametrize(
    ("settings", "part"),
    [
        (
            {"gait": {"velocity": "0.3 0 0.2; 2s 0 0 0"}},
            hp.Commanded(velocity=((0, 0.3, 0, 0.2), (2, 0, 0, 0))),
        ),
        ({"controller": {"legs": "feedforward"}}, hp.Governed(parameters={"legs": "feedforward"})),
        (
            {"controller": {"weights": {"swing": 1.0}}},
            hp.Condensed(parameters={"weights": {"swing": 1.0}}),
        ),
        ({"plant": {"preset": "stiff"}}, hp.Mujoco("stiff")),
        ({"plant": {"stiction_tolerance": 0.002}}, hp.Pinocchio(stiction_tolerance=0.002)),
    ],
)
def test_a_part_without_a_name_is_the_first_that_has_the_settings(settings, part):
    (kind,) = settings
    assert getattr(hp.Scenario(**settings), kind) == part


def test_what_a_dictionary_leaves_out_has_its_default():
    assert hp.Scenario.from_dict({}) == hp.Scenario()
    assert hp.Scenario.from_dict({"ground": {"mu_s": 0.8}}).ground == hp.Ground(mu_s=0.8)


@needs_robots
@pytest.mark.parametrize(
    ("robot", "gait"), [("solo12", "walking"), ("bolt", "walking"), ("iris", "hovering")]
)
def test_other_robots_walk_again_from_their_log(robot, gait, tmp_path):
    made = scenario(robot=robot, duration=0.3, mu_s=0.5)
    assert (made.gait.name, made.controller.name) == (gait, "condensed")
    run = hp.walk(made, save=tmp_path / "a.npz")
    assert run.ending == "completed"
    again = hp.Scenario.of(hp.Run.load(tmp_path / "a.npz"))
    assert again == made
    assert_same(run, hp.walk(again))


@needs_robots
def test_a_gait_of_another_robot_is_refused() -> None:
    gait = hp.Standing(hp.load_robot("a1"))
    with pytest.raises(hp.InputError, match="the gait is of 'a1', the scenario of 'go2'"):
        hp.walk(hp.Scenario(robot="go2"), gait=gait)
