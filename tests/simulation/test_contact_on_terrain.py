"""Contact about the normal, against closed forms and against flat ground under tilted gravity."""

import numpy as np
import pinocchio as pin
import pytest
from walks import put

import harpy_pin as hp
from harpy_pin.ground.terrain import HeightField, Plane, Ramp, Stairs
from harpy_pin.model.state import Command
from harpy_pin.simulation import PinocchioPlant
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.simulation.simulator import Simulator

NOTHING = Command(np.zeros(0), np.zeros((0, 3)))
MASS, G, MU = 2.0, 9.81, 0.25
HEADINGS = (0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi)


def rotation(slope: float, heading: float) -> np.ndarray:
    """The smallest rotation from the vertical to the normal of a plane that rises along the
    heading.
    """
    axis = np.array([np.sin(heading), -np.cos(heading), 0.0])
    return pin.exp3(slope * axis)


def place(simulator: Simulator, x: float = 0.0, y: float = 0.0) -> None:
    """Put the sled on the ground, at rest, as deep as its load presses it."""
    terrain = simulator.ground.surface
    q = pin.neutral(simulator.robot.model)
    normal = terrain.normal(x, y)
    q[:3] = (
        np.array([x, y, float(terrain.height(x, y))])
        - MASS * G * normal[2] / simulator.ground.stiffness * normal
    )
    simulator.reset(q, np.zeros(6))


@pytest.mark.parametrize("cone", ["circular", "per_axis"])
@pytest.mark.parametrize(("slope", "heading"), [(0.2, 0.0), (-0.5, 0.7), (1.0, 2.5)])
def test_a_robot_moves_as_on_flat_ground_under_tilted_gravity(robot, cone, slope, heading):
    """The world turned as a whole is the same world: state by state, force by force."""
    rng = np.random.default_rng(3)
    r = rotation(slope, heading)
    settings = {"mu_s": 0.4, "cone": cone}
    tilted = Simulator(robot, hp.Ground(terrain=Plane(slope=slope, heading=heading), **settings))
    flat = Simulator(robot, hp.Ground(**settings), gravity=r.T @ (0.0, 0.0, -G))
    q, v = hp.make_gait(robot).initial_state()
    q[2] -= 0.01
    v = rng.normal(0.0, 0.3, len(v))
    turned = q.copy()
    turned[:3] = r @ q[:3]
    turned[3:7] = pin.Quaternion(r @ pin.Quaternion(q[3:7]).matrix()).coeffs()
    flat.reset(q, v)
    tilted.reset(turned, v)
    for _ in range(100):
        torque, thrust = rng.normal(0.0, 3.0, 6), rng.normal(0.0, 5.0, (2, 3)) - 20.0 * np.eye(3)[2]
        flat.advance(Command(torque, thrust))
        tilted.advance(Command(torque, thrust @ r.T))
        np.testing.assert_allclose(tilted.v, flat.v, atol=1e-7)
        np.testing.assert_allclose(tilted.state.foot_force, flat.state.foot_force @ r.T, atol=1e-5)
    np.testing.assert_allclose(
        tilted.state.foot_position, flat.state.foot_position @ r.T, atol=1e-9
    )
    np.testing.assert_allclose(tilted.slip_path, flat.slip_path, atol=1e-9)
    np.testing.assert_allclose(tilted.slip_net, flat.slip_net, atol=1e-9)
    assert flat.slip_path.max() > 1e-3


def test_a_tread_is_flat_ground_that_is_higher(sled):
    """On the tread of a stair the block moves as on flat ground, digit for digit but for the
    height.
    """
    stairs = Stairs(rise=0.125, depth=0.5, start=-0.25)
    on = Simulator(sled, hp.Ground(terrain=stairs))
    flat = Simulator(sled, hp.Ground())
    for simulator, height in ((flat, 0.0), (on, 0.125)):
        put(simulator, z=height + 0.01, v=(0.2, 0.1, 0.0, 0.0, 0.0, 0.0)).advance(
            NOTHING, steps=1000
        )
    np.testing.assert_allclose(on.v, flat.v, atol=1e-12)
    np.testing.assert_allclose(on.q[:2], flat.q[:2], atol=1e-12)
    assert on.q[2] - flat.q[2] == pytest.approx(0.125, abs=1e-12)
    assert on.slip_path[0] == pytest.approx(flat.slip_path[0], rel=1e-12)


def test_it_slides_down_a_ramp_and_stops_behind_it(sled):
    """The energy of the height is what friction takes on the ramp and behind it, where nothing else
    takes any.

    The edge at the foot of the ramp takes the velocity's part across the level ground besides.
    """
    slope, length = 0.5, 1.0
    ground = hp.Ground(
        mu_s=0.3,
        mu_c=0.3,
        mu_v=0.0,
        stiffness=1e5,
        terrain=Ramp(slope=-slope, start=0.0, length=length),
    )
    simulator = Simulator(sled, ground, dt=1e-4)
    place(simulator, x=0.01)
    simulator.advance(NOTHING, steps=40000)
    assert np.linalg.norm(simulator.v) < 1e-9
    drop = np.tan(slope) * (length - 0.01)
    squared = 2 * G * (drop - 0.3 * (length - 0.01))  # of the speed at the foot of the ramp
    # the impulse of the edge has friction, too
    landed = squared * (np.cos(slope) - 0.3 * np.sin(slope)) ** 2
    assert simulator.q[0] - length == pytest.approx(landed / (2 * 0.3 * G), rel=0.05)


def test_a_height_field_of_a_plane_is_the_plane(sled):
    x = 0.5 * np.arange(9) - 2.0
    field = HeightField(
        heights=tuple(map(tuple, (np.tan(0.3) * x[:, None] + 0.0 * x).tolist())), resolution=0.5
    )
    ends = []
    for terrain in (Plane(slope=0.3), field):
        simulator = Simulator(sled, hp.Ground(mu_s=MU, terrain=terrain))
        place(simulator)
        simulator.advance(NOTHING, steps=1000)
        ends.append(np.concatenate((simulator.q, simulator.v)))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("degrees", [10.0, 20.0])
def test_mujoco_holds_and_slides_as_coulomb_says(sled, heading, degrees):
    """On a slope as on flat ground under tilted gravity, and as the closed forms say."""
    pytest.importorskip("mujoco")
    slope = np.radians(degrees)
    r = rotation(slope, heading)
    plant = MujocoPlant(sled, hp.Ground(mu_s=MU, terrain=Plane(slope=slope, heading=heading)))
    flat = MujocoPlant(sled, hp.Ground(mu_s=MU), gravity=r.T @ (0.0, 0.0, -G))
    place(plant)
    for one in (plant, put(flat)):
        one.advance(NOTHING, steps=1000)
    np.testing.assert_allclose(plant.state.foot_position, flat.state.foot_position @ r.T, atol=1e-9)
    np.testing.assert_allclose(plant.state.foot_force, flat.state.foot_force @ r.T, atol=1e-6)
    assert plant.slip_path[0] == pytest.approx(flat.slip_path[0], rel=1e-6)
    force = flat.state.foot_force[0]
    assert np.hypot(*force[:2]) <= MU * force[2] * (1.0 + 1e-6)
    if degrees == 10.0:
        assert plant.slip_path[0] < 2e-5  # what impratio leaves of creep
    else:
        way = 0.5 * G * (np.sin(slope) - MU * np.cos(slope)) * 0.25
        assert np.linalg.norm(plant.q[:3]) == pytest.approx(way, rel=1e-2)


def test_all_plants_have_the_same_stairs(sled):
    """A block that falls on each tread comes to rest on it."""
    pytest.importorskip("mujoco")
    stairs = Stairs(rise=0.1, depth=0.4, steps=3, start=0.0)
    for kind in (Simulator, PinocchioPlant, MujocoPlant):
        for step in range(3):
            plant = put(
                kind(sled, hp.Ground(terrain=stairs)),
                x=0.4 * step + 0.2,
                z=0.1 * (step + 1) + 0.005,
            )
            plant.advance(NOTHING, steps=4000)
            assert plant.q[2] == pytest.approx(
                0.1 * (step + 1) - plant.static_penetration, abs=1e-6
            )
            assert plant.q[0] == pytest.approx(0.4 * step + 0.2, abs=1e-6)


def test_contacts_that_are_not_ours_refuse_terrain(sled):
    pytest.importorskip("mujoco")
    with pytest.raises(hp.InputError, match="no foot_radius"):
        MujocoPlant(sled, hp.Ground(slope=0.1), foot_radius=0.02)


WEIGHT = 2.0 * 9.81
HALF, HEIGHT = 0.1, 0.05
"""Half the length of the sole, and height of the centre of mass above it, m."""


@pytest.fixture(scope="module")
def block(sled):
    sole = hp.FlatFoot(length=2.0 * HALF, width=0.1, centre=(0.0, 0.0, -HEIGHT))
    return hp.load_robot(sled.urdf, feet=("skid",), flat_feet={"skid": sole})


def on_slope(kind, block, slope, heading, *, steps, stiffness=2e5, friction=1.0, height=0.0):
    """The block after some time on a plane, its length along the slope."""
    terrain = Plane(slope=slope, heading=heading)
    plant = kind(block, hp.Ground(mu_s=friction, stiffness=stiffness, terrain=terrain))
    normal = terrain.normal(0.0, 0.0)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
    q = pin.neutral(block.model)
    q[:3] = (HEIGHT + height) * normal
    q[3:7] = pin.Quaternion(turn @ pin.exp3(np.array([0.0, 0.0, heading]))).coeffs()
    plant.reset(q, np.zeros(6))
    plant.advance(NOTHING, steps=steps)
    return plant, normal


@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi, 2.0])
@pytest.mark.parametrize("degrees", [6.0, 20.0])
@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_its_corners_carry_what_the_balance_of_moments_says(kind, degrees, heading, block):
    """The lower edge carries W cos θ / 2 (1 + h tan θ / a), and friction holds W sin θ."""
    if kind is MujocoPlant:
        pytest.importorskip("mujoco")
    slope = np.radians(degrees)
    plant, normal = on_slope(kind, block, slope, heading, steps=4000)
    force = plant.state.foot_force
    load = force @ normal
    share = HEIGHT / HALF * np.tan(slope)
    upper, lower = load[:2].sum(), load[2:].sum()
    within = 5e-3 if kind is Simulator else 3e-2  # MuJoCo's ground is softer
    assert lower == pytest.approx(0.5 * WEIGHT * np.cos(slope) * (1.0 + share), rel=within)
    assert upper == pytest.approx(0.5 * WEIGHT * np.cos(slope) * (1.0 - share), rel=within)
    np.testing.assert_allclose(force.sum(axis=0), (0.0, 0.0, WEIGHT), atol=1e-2 * WEIGHT)


@pytest.mark.parametrize("kind", [Simulator, MujocoPlant])
def test_it_tips_over_its_lower_edge_where_the_weight_is_beyond_it(kind, block):
    """That is from tan θ = a / h on; friction would hold it."""
    if kind is MujocoPlant:
        pytest.importorskip("mujoco")
    limit = np.arctan(HALF / HEIGHT)
    for slope, tips in ((limit - 0.06, False), (limit + 0.06, True)):
        plant, normal = on_slope(kind, block, slope, 0.0, steps=1000, friction=4.0)
        up = pin.Quaternion(plant.q[3:7]).matrix()[:, 2]
        tilt = np.arccos(np.clip(up @ normal, -1.0, 1.0))
        assert (tilt > 0.2) == tips
