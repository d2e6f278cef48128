"""Gaits laid over ground that is not flat: where feet and body are, how they begin, and the walks
that they make.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import places
from hypothesis import given, settings
from hypothesis import strategies as st
from long import long_but
from needs import PLANTS, needs_mujoco, needs_robots
from walks import slip_per_step, walked

import harpy_pin as hp
from harpy_pin.contrib.felt_ground import OnFeltGround
from harpy_pin.gaits.on_terrain import FRICTION_SHARE, OnTerrain
from harpy_pin.gaits.terrain_targets import MARGIN, RADIUS, STEEPEST, fit_plane, way_over
from harpy_pin.ground.surface import greatest_rise
from harpy_pin.ground.terrain import Plane, Ramp, Rough, Stairs
from harpy_pin.log.measures import measure
from harpy_pin.scenario import build

ROBOT = hp.load_harpy()
TERRAINS = (
    Plane(slope=0.3, heading=0.4),
    Rough(amplitude=0.03, resolution=0.2),
    Stairs(rise=0.05, start=0.3),
)


@pytest.mark.parametrize("terrain", TERRAINS, ids=lambda terrain: terrain.name)
def test_feet_are_as_high_above_the_ground_as_on_flat_ground(terrain):
    """Or higher, in the air. Stance feet are where they are on flat ground, except on stairs those
    beside a riser.
    """
    flat, over, rows = hp.make_gait(ROBOT), OnTerrain(hp.make_gait(ROBOT), terrain), []
    for t in np.arange(0.003, 6.0, 0.007):
        a, b = flat.update(float(t)), over.update(float(t))
        both = (one.body[:3] + one.foot_position for one in (a, b))
        rows.append(
            (*both, a.stance == 0.0, b.stance > 0.0, b.normal.copy(), b.ground_height.copy())
        )
    on_flat, on_terrain, lifted, down, normal, ground = map(np.array, zip(*rows, strict=True))
    assert (
        np.abs(on_terrain - on_flat)[..., :2] <= (0.0625 if isinstance(terrain, Stairs) else 1e-12)
    ).all()
    x, y, z = on_terrain[down].T
    np.testing.assert_allclose(z, on_flat[down, 2] + terrain.height(x, y), atol=1e-12)
    np.testing.assert_allclose(normal[down], terrain.normal(x, y), atol=1e-12)
    np.testing.assert_allclose(ground[down], terrain.height(x, y), atol=1e-12)
    x, y, z = on_terrain[lifted].T
    assert (z >= terrain.height(x, y) + on_flat[lifted, 2] - 1e-9).all()
    assert lifted.any(axis=0).all()
    assert down.any(axis=0).all()


@pytest.mark.parametrize(
    "name",
    ["harpy", pytest.param("go2", marks=needs_robots), pytest.param("g1", marks=needs_robots)],
)
def test_it_begins_with_its_feet_on_the_ground(name):
    terrain = Plane(slope=0.1, heading=0.6)
    robot = ROBOT if name == "harpy" else hp.load_robot(name)
    flat = hp.make_commanded_gait(robot) if name == "harpy" else hp.WalkingGait(robot)
    q, v = OnTerrain(flat, terrain).initial_state(penetration=0.003)
    below = places(robot, flat.initial_state(penetration=0.003)[0])
    feet = places(robot, q)
    height = terrain.height(feet[:, 0], feet[:, 1])
    # soles turn about two axes, their corners cannot all be there
    within = 1e-9 if not robot.flat_feet else 2e-3
    np.testing.assert_allclose(feet[:, 2] - height, below[:, 2], atol=within)
    np.testing.assert_allclose(feet[:, :2], below[:, :2], atol=within)
    np.testing.assert_array_equal(v, 0.0)
    up = pin.Quaternion(*q[[6, 3, 4, 5]]).matrix()[:, 2]
    np.testing.assert_allclose(
        up, terrain.normal(0.0, 0.0) if name == "go2" else (0.0, 0.0, 1.0), atol=1e-12
    )


@needs_robots
@pytest.mark.parametrize("degrees", long_but((0, 90, 180), (90,)))
def test_g1_walks_up_across_and_down_15_degrees(degrees):
    """Across, one of its legs, which are nearly straight, has to be shorter: its body begins lower.

    Upwards, its ankles come to their ends, and the feet slip more.
    """
    pytest.importorskip("mujoco")
    ground = hp.Ground(
        terrain=Plane(slope=np.deg2rad(15.0), heading=np.deg2rad(degrees)),
        mu_s=0.6,
        stiffness=1.6e5,
    )
    gait = hp.Walking(velocity=(0.15, 0, 0))
    run = walked(robot="g1", gait=gait, ground=ground, plant="mujoco", duration=4.0)
    assert run.ending == "completed"
    assert run["centre"][-1, 0] > 0.4
    assert slip_per_step(run) < (1.5 if degrees == 0 else 1.0)
    assert run["q"][:, [10, 16]].min() > 0.0  # knees stay bent the right way


@pytest.mark.parametrize(
    ("most", "settings"),
    [
        *((0.2, {"slope": slope}) for slope in (0.2, 0.3)),
        (1.0, {"slope": -0.3, "mu_s": 0.6}),
        (1.0, {"terrain": Plane(slope=0.2, heading=1.2), "mu_s": 0.6}),
        (1.0, {"terrain": Rough(amplitude=0.02, resolution=0.2), "mu_s": 0.6}),
        (1.0, {"slope": 0.2, "controller": hp.WholeBody(parameters={"solver": "active_set"})}),
        (1.0, {"slope": 0.2, "controller": hp.Governed(governor="filter")}),
        (1.0, {"slope": 0.2, "gait": hp.Commanded(velocity=(0.3, 0.0, 0.2))}),
        (1.0, {"slope": 0.2, "normal_error": 0.087}),
        pytest.param(1.0, {"slope": 0.2, "plant": "mujoco"}, marks=needs_mujoco),
    ],
    ids=str,
)
def test_harpy_walks(most, settings):
    run = walked(**{"mu_s": 0.8, "duration": 2.0, **settings})
    assert run.ending == "completed"
    seen = measure(run)
    assert (seen.slip_mm_per_step if most < 1.0 else seen.net_slip_mm_per_step) < most
    assert run["q"][-1, 0] > 0.4


def test_harpy_climbs_stairs():
    """Ten steps of 5 cm; it is up where its body is as high above the last tread as it was above
    the ground.
    """
    stairs = Stairs(rise=0.05, depth=0.3, start=0.3, steps=10)
    run = walked(ground=hp.Ground(terrain=stairs, mu_s=0.6), duration=12.0)
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 3.4
    assert run["q"][-1, 2] - run["q"][0, 2] == pytest.approx(0.5, abs=0.01)


@needs_robots
@pytest.mark.parametrize("degrees", [10.0, 20.0, -20.0])
def test_go2_trots_on_a_ramp(degrees):
    ground = hp.Ground(slope=np.radians(degrees), mu_s=0.6, stiffness=75e3)
    run = walked(
        robot="go2", ground=ground, gait=hp.Walking(velocity=(0.4, 0.0, 0.0)), duration=3.0
    )
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.7
    assert measure(run).slip_mm_per_step < 1.0


@needs_robots
def test_four_headings_give_equal_walks():
    """The slope, the robot and its walk turned about the vertical: the same walk."""
    paths, slips = [], []
    for heading in (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi):
        ground = hp.Ground(terrain=Plane(slope=0.2, heading=heading), mu_s=0.6, stiffness=75e3)
        made = build(hp.Scenario(robot="go2", ground=ground, duration=1.0))
        q, v = made.simulator.q.copy(), made.simulator.v.copy()
        if heading:
            upright = build(
                hp.Scenario(robot="go2", ground=hp.Ground(slope=0.2, mu_s=0.6, stiffness=75e3))
            )
            q = upright.simulator.q.copy()
            turn = pin.Quaternion(pin.exp3(np.array((0.0, 0.0, heading))))
            q[:3] = turn.matrix() @ q[:3]
            q[3:7] = (turn * pin.Quaternion(*q[[6, 3, 4, 5]])).coeffs()
        made.simulator.reset(q, v)
        run = made.run()
        c, s = np.cos(heading), np.sin(heading)
        x, y = run["q"][:, 0], run["q"][:, 1]
        paths.append(np.stack((c * x + s * y, c * y - s * x, run["q"][:, 2]), axis=1))
        slips.append(run["slip_path"][-1])
    for path, slip in zip(paths[1:], slips[1:], strict=True):
        np.testing.assert_allclose(path, paths[0], atol=1e-6)
        np.testing.assert_allclose(slip, slips[0], atol=1e-6)


@needs_robots
def test_a_gait_of_ones_own_is_laid_over_the_ground():
    """It walks as that of the scenario does, on stairs where it falls blind."""
    ground, trot = (
        hp.Ground(mu_s=0.6, terrain=Stairs(rise=0.06)),
        hp.WalkingGait(hp.load_robot("go2")),
    )
    trot.command[0] = 0.4
    scenario = hp.Scenario(
        robot="go2", ground=ground, duration=5.0, gait=hp.Walking(velocity=(0.4, 0.0, 0.0))
    )
    expected, run = hp.walk(scenario), hp.walk(scenario, gait=trot)
    assert run.ending == "completed"
    assert run["q"][-1, 2] > run["q"][0, 2] + 0.1
    np.testing.assert_array_equal(run["q"], expected["q"])
    assert hp.walk(scenario, gait=OnTerrain(trot, Plane(slope=0.0))).fell


def test_a_gait_over_flat_ground_of_its_own_walks_blind():
    """Harpy crosses rough ground of 2 cm by touch."""
    rough, blind = (
        Rough(amplitude=0.02, resolution=0.2, seed=1),
        OnTerrain(hp.make_gait(ROBOT), Plane(slope=0.0)),
    )
    run = walked(blind, terrain=rough, mu_s=0.6, duration=3.0)
    assert run.ending == "completed"
    flat = hp.make_gait(ROBOT)
    np.testing.assert_allclose(run["x_r"][-1], flat.update(float(run["t"][-1])).body[:6], atol=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 10.0, -10.0])
def test_harpy_feels_an_unknown_slope(degrees):
    slope = np.radians(degrees)
    gait = OnFeltGround(hp.make_gait(ROBOT))
    run = walked(gait, slope=slope, mu_s=0.6, duration=3.0)
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.75
    np.testing.assert_allclose(np.arctan(gait.slope), (slope, 0.0), atol=0.02)


@needs_robots
def test_go2_feels_an_unknown_ramp():
    gait = hp.WalkingGait(hp.load_robot("go2"), velocity=(0.4, 0.0, 0.0))
    felt = OnFeltGround(gait)
    run = walked(
        felt,
        robot="go2",
        terrain=Ramp(slope=np.radians(10.0)),
        mu_s=0.6,
        stiffness=75e3,
        duration=3.0,
    )
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.75
    np.testing.assert_allclose(np.arctan(felt.slope), (np.radians(10.0), 0.0), atol=0.03)


def test_what_was_felt_is_forgotten_when_the_clock_goes_back():
    gait = OnFeltGround(hp.make_gait(ROBOT))
    walked(gait, slope=0.2, mu_s=0.6, duration=1.5)
    assert gait.slope[0] > 0.1
    q, v = gait.initial_state()
    gait.observe(hp.State(0.0, q, v, places(ROBOT, q), np.zeros((2, 3)), np.zeros((2, 3))))
    np.testing.assert_array_equal(gait.slope, 0.0)


STEEP = Plane(slope=np.radians(25.0), heading=0.7)
FRICTION = 0.2


@pytest.mark.parametrize("heading", [0.0, 0.7, np.pi])
def test_weight_and_thrust_along_the_slope_leave_no_moment_about_the_feet(heading):
    """With as much of the weight on friction as its share."""
    angle = np.radians(25.0)
    gait = OnTerrain(
        hp.make_gait(ROBOT, speed=0.0), Plane(slope=angle, heading=heading), friction=FRICTION
    )
    q = gait.initial_state()[0]
    middle = places(ROBOT, q).mean(axis=0)
    mass = pin.centerOfMass(ROBOT.model, ROBOT.model.createData(), q) - middle
    arm = places(ROBOT, q, ROBOT.thrusters).mean(axis=0) - middle
    uphill = np.array(
        (np.cos(heading) * np.cos(angle), np.sin(heading) * np.cos(angle), np.sin(angle))
    )
    thrust = (np.sin(angle) - FRICTION_SHARE * FRICTION * np.cos(angle)) * uphill
    moment = np.cross(mass, (0.0, 0.0, -1.0)) + np.cross(arm, thrust)  # per newton of weight
    across = np.array((-np.sin(heading), np.cos(heading), 0.0))
    assert abs(moment @ across) < 1e-3
    assert abs(np.cross(arm, thrust) @ across) > 0.1


def test_targets_are_where_body_and_feet_begin():
    flat = OnTerrain(hp.make_gait(ROBOT), STEEP)
    gait = OnTerrain(hp.make_gait(ROBOT), STEEP, friction=FRICTION)
    away = gait.describe()["on_terrain"]["offset"]
    assert float(STEEP.height(*away[:2])) == pytest.approx(away[2])
    np.testing.assert_allclose(
        gait.initial_state()[0][:3], flat.initial_state()[0][:3] + away, atol=1e-12
    )
    for t in (0.0, 0.4, 1.1):
        a, b = flat.update(t), gait.update(t)
        np.testing.assert_allclose(b.body[:3], a.body[:3] + away, atol=1e-12)
        np.testing.assert_allclose(
            b.body[:3] + b.foot_position, a.body[:3] + a.foot_position, atol=1e-12
        )
        np.testing.assert_array_equal(b.foot_velocity, a.foot_velocity)


@pytest.mark.parametrize(
    ("terrain", "friction"),
    [
        (STEEP, None),
        (STEEP, 1.01 * np.tan(np.radians(25.0)) / FRICTION_SHARE),
        (Ramp(slope=0.4), FRICTION),
    ],
    ids=["friction not given", "enough friction", "no plane"],
)
def test_it_stays_above_its_feet_otherwise(terrain, friction):
    gait = OnTerrain(hp.make_gait(ROBOT), terrain, friction=friction)
    assert gait.describe()["on_terrain"]["offset"] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("plant", PLANTS)
def test_harpy_walks_where_friction_holds_a_sixth_of_what_it_must(plant):
    """Up a slope of 30 degrees at friction 0.1, whose angle is 5.7 degrees."""
    run = walked(mu_s=0.1, slope=np.radians(30.0), plant=plant, duration=2.0)
    assert run.ending == "completed"
    assert run["q"][-1, 0] - run["q"][0, 0] > 0.5
    assert measure(run).slip_mm_per_step < 3.0


AWAY = 0.02
"""Distance of a foothold from a riser, m: the margin, less the way on which a riser rises by as
much.
"""
starts = st.floats(0.3, 0.6)
rises = st.sampled_from((0.05, -0.05))


def to_risers(stairs: Stairs, x: float) -> float:
    """Distance of a place from the nearest riser, m; negative on one."""
    begin = stairs.start + stairs.depth * np.arange(stairs.steps)
    return float(np.maximum(begin - x, x - begin - stairs.edge).min())


@given(start=starts, rise=rises)
@settings(max_examples=10, deadline=None)
def test_footholds_keep_their_distance_from_risers(start, rise):
    """That of a stance foot, after its first swing; it stays in the world, and its walk is that of
    flat ground where no riser is near.
    """
    stairs = Stairs(rise=rise, depth=0.3, start=start)
    flat, gait = hp.make_gait(ROBOT), OnTerrain(hp.make_gait(ROBOT), stairs)
    at = np.full(2, np.nan)
    for t in np.arange(0.0, 9.0, 0.02):
        plain, target = flat.update(float(t)), gait.update(float(t))
        for k in range(2):
            x = target.body[0] + target.foot_position[k, 0]
            own = plain.body[0] + plain.foot_position[k, 0]
            if not target.stance[k] or t < 1.5:
                at[k] = np.nan
                continue
            assert to_risers(stairs, x) > AWAY - 1e-9
            assert abs(x - own) <= (0.035 if to_risers(stairs, own) < 0.025 else 1e-9)
            assert np.isnan(at[k]) or x == pytest.approx(at[k], abs=1e-9)
            at[k] = x


@pytest.mark.parametrize(
    "terrain", [TERRAINS[0], Stairs(rise=0.05, depth=0.3, start=0.47)], ids=("plane", "riser")
)
def test_targets_move_as_their_velocities_say(terrain):
    """Places are the integral of velocities, these of accelerations; beside a riser along the
    ground, without jumps.
    """
    gait, step, rows = OnTerrain(hp.make_gait(ROBOT), terrain), 1e-4, []
    for t in np.arange(0.5, 4.0, step):
        target = gait.update(float(t))
        body = target.body.reshape(3, 1, 3)
        feet = (
            np.stack((target.foot_position, target.foot_velocity, target.foot_acceleration)) + body
        )
        rows.append(np.concatenate((body, feet), axis=1))
    place, velocity, acceleration = np.moveaxis(rows, 1, 0)
    for value, rate, axes in (
        (place, velocity, 3 if terrain.name == "plane" else 2),
        (velocity, acceleration, 2),
    ):
        sums = step * np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0)
        np.testing.assert_allclose((value[1:] - value[0])[..., :axes], sums[..., :axes], atol=5e-3)
    assert np.abs(np.diff(place[..., 2], axis=0)).max() < 2.5 * step  # 2.5 m/s


@given(x=st.floats(0.2, 1.4), start=starts, rise=rises)
@settings(max_examples=60, deadline=None)
def test_the_way_over_steps_is_the_lowest_that_is_not_too_steep(x, start, rise):
    """Against the definition, looked up at many places."""
    stairs = Stairs(rise=rise, depth=0.3, start=start)
    dx = np.linspace(-RADIUS, RADIUS, 24001)
    around = stairs.height(x + dx, 0.0 * dx)
    assert way_over(stairs.record, x, 0.0)[0] == pytest.approx(
        (around - STEEPEST * np.abs(dx)).max(), abs=2e-4
    )


BETWEEN = [(rise, start) for rise in (0.05, -0.05) for start in (0.5, 0.56)]


@pytest.mark.parametrize(
    ("plant", "rise", "start"),
    [
        *(("compliant", rise, start) for rise in (0.05, -0.05) for start in (0.52, 0.58)),
        *(
            pytest.param("mujoco", *where, marks=needs_mujoco)
            for where in ((0.05, 0.52), (-0.05, 0.58))
        ),
        *(
            pytest.param("mujoco", *where, marks=[needs_mujoco, pytest.mark.long])
            for where in BETWEEN
        ),
        *(pytest.param("compliant", *where, marks=pytest.mark.long) for where in BETWEEN),
    ],
)
def test_harpy_slips_little_on_stairs_wherever_they_begin(plant, rise, start):
    run = walked(
        terrain=Stairs(rise=rise, depth=0.3, start=start, steps=4),
        mu_s=0.6,
        duration=7.0,
        plant=plant,
    )
    assert run.ending == "completed"
    assert measure(run).slip_mm_per_step < 1.0


@pytest.mark.parametrize(("rise", "start"), [(0.05, 0.59), (-0.05, 0.59), (-0.05, 0.74)])
def test_a_commanded_walk_keeps_off_risers_and_stops_on_stairs(rise, start):
    stairs = Stairs(rise=rise, depth=0.3, start=start, steps=10)
    gait = OnTerrain(
        hp.make_commanded_gait(ROBOT, [(0.0, 0.3, 0.0, 0.05), (7.0, 0.0, 0.0, 0.0)]), stairs
    )
    run = walked(gait, terrain=stairs, mu_s=0.6, duration=11.0)
    assert run.ending == "completed"
    assert measure(run).slip_mm_per_step < 1.0
    assert not gait.gait.walking
    assert 1.5 < run["q"][-1, 0] < 3.0
    place, loaded = run["foot_position"][::20], np.abs(run["foot_force"][::20]).max(axis=2) > 1.0
    assert min(to_risers(stairs, x) for x in place[..., 0][loaded]) > AWAY - 0.01


def test_a_clock_that_goes_back_begins_anew():
    stairs = Stairs(rise=0.05, depth=0.3, start=0.47)
    gait, new = OnTerrain(hp.make_gait(ROBOT), stairs), OnTerrain(hp.make_gait(ROBOT), stairs)
    for t in np.arange(0.0, 5.0, 0.05):
        gait.update(float(t))
    for t in np.arange(0.0, 2.0, 0.05):
        a, b = gait.update(float(t)), new.update(float(t))
        np.testing.assert_array_equal(a.foot_position, b.foot_position)


UPSTAIRS = Stairs(rise=0.08, depth=0.3, steps=4, start=0.5)


def climbed(terrain: Stairs, **part) -> hp.Run:
    ground = hp.Ground(terrain=terrain, mu_s=0.6, stiffness=75e3)
    gait = hp.Walking(velocity=(0.4, 0.0, 0.0))
    how = {"robot": "go2", "ground": ground, "gait": gait, "duration": 6.5, **part}
    run = hp.walk(hp.Scenario(**how))
    assert run.ending == "completed"
    return run


@needs_robots
@pytest.mark.parametrize(
    ("rise", "part"),
    [(0.08, {}), (-0.08, {}), (0.08, {"plant": "mujoco"}), (0.08, {"controller": "wbc"})],
    ids=["up", "down", "mujoco", "wbc"],
)
def test_go2_walks_stairs(rise, part):
    """Four steps of 8 cm; behind them its body is as high above the last tread as it was above the
    ground.
    """
    if part.get("plant") == "mujoco":
        pytest.importorskip("mujoco")
    stairs = Stairs(rise=rise, depth=0.3, steps=4, start=0.5)
    run = climbed(stairs, **part)
    assert run["q"][-1, 0] > 0.5 + 4 * 0.3 + 0.25  # its hind feet are up, too
    assert run["q"][-1, 2] - run["q"][0, 2] == pytest.approx(4 * rise, abs=0.02)
    assert measure(run).slip_mm_per_step < 3.0


@needs_robots
def test_feet_stand_on_treads_and_clear_the_steps():
    """A loaded foot is away from every riser; a swing foot is nowhere below the ground."""
    run = climbed(UPSTAIRS)
    x, y, z = np.moveaxis(run["foot_position"][::5], 2, 0)
    assert (z > UPSTAIRS.height(x, y) - 0.01).all()
    loaded = np.abs(run["foot_force"][::5]).max(axis=2) > 10.0
    risers = UPSTAIRS.start + UPSTAIRS.depth * np.arange(UPSTAIRS.steps)
    away = np.maximum(risers - x[loaded, None], x[loaded, None] - risers - UPSTAIRS.edge)
    assert away.min() > 0.4 * MARGIN  # knees reach their ends as they are pulled up


@needs_robots
@pytest.mark.parametrize("start", [0.52, 0.56, 0.6])
def test_go2_goes_down_wherever_stairs_begin(start):
    run = climbed(Stairs(rise=-0.08, depth=0.3, steps=3, start=start), duration=5.5)
    assert measure(run).slip_mm_per_step < 0.1


@needs_robots
def test_steps_last_as_long_as_lifting_a_foot_takes():
    """From rest to rest over h in a time t the least peak of a quintic's acceleration is 10 h / (√3
    t²).
    """
    gait = hp.WalkingGait(hp.load_robot("go2"))
    flat = gait.step_duration
    over = OnTerrain(gait, UPSTAIRS)
    assert over.step_duration == gait.step_duration > flat
    way = 0.08 + float(gait.record["pace"]["clearance"][0])
    time = gait.parameters.apex * (1.0 - gait.double_support) * over.step_duration
    assert 10.0 * way / (np.sqrt(3.0) * time**2) == pytest.approx(
        gait.parameters.lift_acceleration, rel=1e-4
    )
    assert OnTerrain(hp.WalkingGait(hp.load_robot("go2")), Plane(slope=0.3)).step_duration == flat


def test_the_greatest_rise_is_that_of_the_steps_in_reach():
    assert greatest_rise(Stairs(rise=0.08, depth=0.3, steps=3).record, 0.2) == pytest.approx(0.08)
    assert greatest_rise(Stairs(rise=-0.08, depth=0.3, steps=3).record, 0.4) == pytest.approx(0.16)
    assert greatest_rise(Plane(slope=0.4).record, 0.2) == 0.0
    rough = Rough(amplitude=0.03, seed=2)
    assert greatest_rise(rough.record, 0.2) == pytest.approx(np.ptp(rough.record["grid"]))


@given(x=st.floats(-0.5, 4.0), slope=st.floats(-0.3, 0.3))
@settings(max_examples=50, deadline=None)
def test_the_body_follows_the_line_nearest_to_the_steps(x, slope):
    """Against a fit to many samples."""
    gait = OnTerrain(hp.make_gait(hp.load_harpy()), UPSTAIRS)
    record = gait._record
    record["terrain"]["slope"][0] = (slope, 0.1)
    reach = float(record["reach"][0])
    height, along, across = fit_plane(record["terrain"], x, 0.2, reach)
    samples = x + reach * (np.arange(-5000, 5000) + 0.5) / 5000
    heights = UPSTAIRS.height(samples, 0.0 * samples) + slope * samples + 0.1 * 0.2
    line = np.polynomial.polynomial.polyfit(samples - x, heights, 1)
    np.testing.assert_allclose((height, along), line, atol=1e-4)
    assert across == pytest.approx(0.1)
