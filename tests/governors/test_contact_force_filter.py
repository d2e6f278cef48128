"""The true contact force: its affine map, and the governor that holds it."""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import ContactForceMap, constrained_dynamics
from walks import scenario

import harpy_pin as hp
from harpy_pin.gaits import make_gait
from harpy_pin.governors import ContactForceFilter, ContactForceFilterParameters
from harpy_pin.governors.contact_force_kernels import into_cone
from harpy_pin.log.measures import contact_age
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.loading import load_harpy
from harpy_pin.model.state import Command, State
from harpy_pin.simulation.push import Push
from reproduction.chattering import chattering

ROBOT = load_harpy()
GAIT = make_gait(ROBOT)
STANDING = GAIT.initial_state()[0]
SUPPORTS = ([True, True], [True, False], [False, True])


def random_state(rng, *, load=20.0):
    """A robot near its stand, in any attitude and motion, both feet measured as carrying."""
    model = ROBOT.model
    q = pin.integrate(model, STANDING, 0.15 * rng.normal(size=model.nv))
    v = 0.5 * rng.normal(size=model.nv)
    dynamics = Dynamics(ROBOT)
    dynamics.update(q, v)
    force = np.zeros((2, 3))
    force[:, 2] = load
    return State(0.0, q, v, dynamics.foot_position.copy(), dynamics.foot_velocity.copy(), force)


def random_command(rng):
    return Command(
        3.0 * rng.normal(size=6), np.array([0.0, 0.0, 5.0]) + 5.0 * rng.normal(size=(2, 3))
    )


def constrained(state, command, touching, damping=0.0):
    return constrained_dynamics(ROBOT, state.q, state.v, command, touching, damping=damping)


@pytest.mark.parametrize("touching", SUPPORTS)
def test_force_is_that_of_constrained_dynamics(touching):
    rng = np.random.default_rng(0)
    dynamics, contact = Dynamics(ROBOT), ContactForceMap(ROBOT, damping=30.0)
    for _ in range(100):
        state, command = random_state(rng), random_command(rng)
        dynamics.update(state.q, state.v)
        force = contact.update(dynamics, state.v, command, touching)
        expected, _ = constrained(state, command, touching, 30.0)
        np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("touching", SUPPORTS)
def test_force_is_affine_in_the_command(touching):
    """G, H and the response of the acceleration, against whole changes of the command."""
    rng = np.random.default_rng(1)
    dynamics, contact = Dynamics(ROBOT), ContactForceMap(ROBOT)
    for _ in range(50):
        state, command, other = random_state(rng), random_command(rng), random_command(rng)
        dynamics.update(state.q, state.v)
        before = contact.update(dynamics, state.v, command, touching)
        u, tau = (other.thrust - command.thrust).ravel(), other.torque - command.torque
        predicted = before.ravel() + contact.thrust_gain @ u + contact.torque_gain @ tau
        moved = contact.response @ np.concatenate((u, tau))
        after, acceleration = constrained(state, other, touching)
        _, first = constrained(state, command, touching)
        scale = np.abs(after).max() + np.abs(before).max()
        np.testing.assert_allclose(predicted, after.ravel(), atol=1e-8 * scale)
        np.testing.assert_allclose(
            moved, acceleration - first, atol=1e-7 * (1.0 + np.abs(acceleration).max())
        )


def test_no_foot_no_force():
    rng = np.random.default_rng(2)
    state, command = random_state(rng), random_command(rng)
    dynamics, contact = Dynamics(ROBOT), ContactForceMap(ROBOT)
    dynamics.update(state.q, state.v)
    assert not contact.update(dynamics, state.v, command, [False, False]).any()


def test_into_cone():
    rng = np.random.default_rng(3)
    out = np.empty(3)
    for _ in range(1000):
        force = 30.0 * rng.normal(size=3)
        into_cone(force, 0.3, 0.9, 0.5, 1.0, out)
        assert out[2] == max(force[2], 1.0)
        assert np.hypot(out[0], out[1]) <= max(0.27 * out[2] - 0.5, 0.06 * out[2]) + 1e-12
        assert abs(out[0] * force[1] - out[1] * force[0]) < 1e-9  # its direction stays
        again = np.empty(3)
        into_cone(out.copy(), 0.3, 0.9, 0.5, 1.0, again)
        np.testing.assert_allclose(again, out, atol=1e-12)


def free(**changes):
    """Settings without lag and without limits."""
    return ContactForceFilterParameters(
        **{
            "lag": 0.0,
            "thrust_authority": 1e9,
            "torque_authority": 1e9,
            "sliding_speed": 1e9,
            **changes,
        }
    )


@pytest.mark.parametrize("support", [[20.0, 20.0], [20.0, 0.0]])
def test_bent_command_demands_a_force_in_the_cone(support):
    """By Pinocchio's constrained dynamics, not by the governor's word."""
    rng = np.random.default_rng(4)
    p = free(mu=0.2, contact_damping=0.0)
    governor = ContactForceFilter(ROBOT, p)
    acted = 0
    for _ in range(200):
        state, command = random_state(rng), random_command(rng)
        state.foot_force[:, 2] = support
        touching = state.foot_force[:, 2] > 1.0
        given = Command(command.torque.copy(), command.thrust.copy())
        governor.update(state, command)
        force, _ = constrained(state, command, touching)
        scale = 1.0 + np.abs(force).max() + np.abs(constrained(state, given, touching)[0]).max()
        np.testing.assert_allclose(governor.force, force, atol=1e-7 * scale)
        for k in np.flatnonzero(touching):
            limit = max(p.friction_share * p.mu * force[k, 2] - p.margin, 0.2 * p.mu * force[k, 2])
            assert np.hypot(*force[k, :2]) <= limit + 1e-7 * scale
            assert force[k, 2] >= p.min_normal_force - 1e-7 * scale
        acted += bool(governor.bend.any())
    assert acted > 100


def test_bend_is_the_least_change():
    """The weighted least-squares problem of the module's docstring, solved by its KKT system."""
    rng = np.random.default_rng(5)
    p = free(mu=0.2)
    governor, contact = (
        ContactForceFilter(ROBOT, p),
        ContactForceMap(ROBOT, damping=p.contact_damping),
    )
    d = Dynamics(ROBOT)
    for support in ([20.0, 20.0], [0.0, 20.0]):
        for _ in range(50):
            state, command = random_state(rng), random_command(rng)
            state.foot_force[:, 2] = support
            touching = state.foot_force[:, 2] > 1.0
            d.update(state.q, state.v)
            before = contact.update(d, state.v, command, touching)
            governor.update(state, command)
            rows = np.repeat(touching, 3)
            change = (governor.force - before).ravel()[rows]
            gain = np.hstack((contact.thrust_gain, contact.torque_gain))[rows]
            response = contact.response
            weights = np.array([*p.linear, *p.angular])
            hessian = response[:6].T @ (weights[:, None] * response[:6])
            swing = d.foot_jacobian[~rows] @ response
            hessian += p.swing * swing.T @ swing + np.diag([p.thrust] * 6 + [p.torque] * 6)
            n, m = len(hessian), len(gain)
            kkt = np.block([[hessian, gain.T], [gain, np.zeros((m, m))]])
            expected = np.linalg.solve(kkt, np.concatenate((np.zeros(n), change)))[:n]
            np.testing.assert_allclose(
                governor.bend, expected, atol=1e-6 * (1.0 + np.abs(expected).max())
            )


def test_inside_the_cone_nothing_changes():
    rng = np.random.default_rng(6)
    governor = ContactForceFilter(ROBOT, free(mu=1e6, min_normal_force=0.0))
    unchanged = 0
    for _ in range(50):
        state, command = random_state(rng), random_command(rng)
        given = Command(command.torque.copy(), command.thrust.copy())
        governor.update(state, command)
        if governor.status.h_r.min() > 0.0:
            unchanged += 1
            np.testing.assert_array_equal(command.torque, given.torque)
            np.testing.assert_array_equal(command.thrust, given.thrust)
    assert unchanged > 5


def test_authority_lag_and_rate():
    """No component beyond the authority, none faster than twice the authority over the lag, never
    NaN.
    """
    rng = np.random.default_rng(7)
    p = ContactForceFilterParameters(mu=0.05, thrust_authority=3.0, torque_authority=0.5, lag=0.004)
    governor = ContactForceFilter(ROBOT, p, period=1e-3)
    authority = np.array([3.0] * 6 + [0.5] * 6)
    last = np.zeros(12)
    flagged = 0
    for _ in range(300):
        state, command = random_state(rng), random_command(rng)
        state.foot_force[:, 2] = rng.choice([0.0, 20.0], 2)
        governor.update(state, command)
        status = governor.status
        assert np.isfinite(governor.bend).all()
        assert np.isfinite(status.least_violation)
        assert (np.abs(governor.bend) <= authority + 1e-9).all()
        assert (np.abs(governor.bend - last) <= 2.0 * authority * 1e-3 / 0.004 + 1e-9).all()
        assert status.infeasible == (status.least_violation > 0.0)
        assert status.least_violation == max(-status.h_w.min(), 0.0)
        flagged += status.infeasible
        last = governor.bend.copy()
    assert flagged > 50
    governor.reset()
    assert not governor.bend.any()


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_degenerate_states(mu):
    """A straight knee, both feet in one place, huge forces, nothing touching: finite commands."""
    governor = ContactForceFilter(ROBOT, ContactForceFilterParameters(mu=mu))
    rng = np.random.default_rng(8)
    for angles in (np.zeros(6), np.array([-0.3, 0.2, 0.5, 0.3, 0.2, 0.5])):
        for torque in (0.0, 1e6):
            state = random_state(rng)
            state.q[7:] = angles
            governor.reset()
            command = Command(np.full(6, torque), np.zeros((2, 3)))
            governor.update(state, command)
            assert np.isfinite(command.torque).all()
            assert np.isfinite(command.thrust).all()
    state.foot_force[:] = 0.0
    governor.reset()
    governor.update(state, command)
    assert not governor.bend.any()


def test_margins_of_known_errors():
    p = ContactForceFilterParameters.robust(
        mu=0.25,
        friction_error=0.1,
        force_error=0.2,
        mass_error=0.05,
        delay=0.002,
        load=40.0,
        force_rate=100.0,
    )
    assert p.friction_share == pytest.approx(0.9)
    assert p.margin == pytest.approx((1.0 + 0.9 * 0.25) * (0.2 + 2.0 + 0.2))
    # The worst case within the bounds is inside the real cone.
    error, normal = 2.4, 30.0
    limit = p.friction_share * p.mu * normal - p.margin
    assert limit + error <= 0.9 * 0.25 * (normal - error) + 1e-12


def walked(governor, *, friction, duration, push=0.0, period=1e-3, dt=5e-4):
    """A walk; a push is to the left, N·s, in the single support of the fifth step."""
    how = {"pushes": (Push(3.45, (0.0, push, 0.0)),) if push else (), "period": period, "dt": dt}
    return hp.walk(
        scenario(controller=hp.Governed(governor=governor), mu_s=friction, duration=duration, **how)
    )


def test_applied_reference_gives_the_thrust():
    """x_w after the bend is the reference to which the thruster law would give the total thrust."""
    run = walked("filter", friction=0.2, duration=1.0)
    turned = [pin.Quaternion(q).matrix() for q in run["q"][:, 3:7]]
    velocity = np.einsum("nij,nj->ni", turned, run["v"][:, :3])
    desired = 400.0 * (run["x_w"][:, :3] - run["q"][:, :3]) + 40.0 * (run["x_w"][:, 3:] - velocity)
    np.testing.assert_allclose(run["thrust"].sum(axis=1), desired, atol=1e-8)
    assert run["bend"].any()


def test_sticking_force_predicts_the_compliant_ground():
    """Away from touchdown and lift-off to half a newton a tick ahead; within 20 ms of them to
    ten.
    """
    run = walked("none", friction=0.8, duration=5.0)
    dynamics, contact = Dynamics(ROBOT), ContactForceMap(ROBOT)
    touching = run["foot_force"][..., 2] > 0.0
    predicted = np.zeros_like(run["foot_force"])
    for k in np.flatnonzero(touching.any(axis=1)):
        dynamics.update(run["q"][k], run["v"][k])
        command = Command(run["torque"][k], run["thrust"][k])
        predicted[k] = contact.update(dynamics, run["v"][k], command, touching[k])
    error = np.linalg.norm(predicted[:-1] - run["foot_force"][1:], axis=2)
    both, double = touching[:-1] & touching[1:], touching[:-1].all(axis=1, keepdims=True)
    changing = contact_age(touching, 1e-3)[:-1] < 0.02
    changing |= contact_age(touching[::-1], 1e-3)[::-1][:-1] < 0.02
    for support in (double, ~double):
        assert np.count_nonzero(both & support & ~changing) > 1000
        assert np.percentile(error[both & support & ~changing], 99.0) < 0.5
    assert np.percentile(error[both & changing], 99.0) < 10.0


def test_walk_on_the_papers_ground():
    """Friction 0.25, 20 s: what the best governor has to hold."""
    m = hp.measure(walked("filter", friction=0.25, duration=20.0))
    assert not m.fell
    assert m.slip_mm_per_step <= 2.0
    assert m.late_slip_mm_per_step <= 0.3
    assert m.sliding <= 0.01
    assert m.low_force <= 0.01
    assert abs(m.distance_m / m.duration_s - 0.3) <= 0.009
    assert m.thrust_max_n <= 53.0


@pytest.mark.parametrize(
    ("friction", "push", "share"), [(0.2, 0.0, 0.02), (0.15, 5.0, 0.1), (0.1, 0.0, 0.5)]
)
def test_slippery_ground_and_pushes(friction, push, share):
    """Never a fall, and a small share of the slip without governor."""
    held, none = (
        hp.measure(walked(name, friction=friction, push=push, duration=5.0))
        for name in ("filter", "none")
    )
    assert not held.fell
    assert held.slip_mm_per_step <= share * none.slip_mm_per_step


def test_applied_reference_does_not_chatter():
    """As many reversals at half the control period, and the same total variation; chattering would
    double them.
    """
    runs = {
        period: walked("filter", friction=0.25, duration=8.0, period=period, dt=2.5e-4)
        for period in (1e-3, 5e-4)
    }
    coarse, fine = (chattering(run["x_w"][:, :3], period=period) for period, run in runs.items())
    assert fine.variation_per_s == pytest.approx(coarse.variation_per_s, rel=0.1)
    assert fine.reversals_per_s == pytest.approx(coarse.reversals_per_s, rel=0.1)
    fastest = [
        np.linalg.norm(np.diff(run["x_w"][:, :3], axis=0), axis=1).max() / at
        for at, run in runs.items()
    ]
    assert fastest[1] < 1.5 * fastest[0]
