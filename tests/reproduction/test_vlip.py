import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harpy_pin.errors import InputError
from harpy_pin.governors import ExplicitReferenceGovernor, ForceRows
from harpy_pin.governors.erg import explicit_update
from harpy_pin.governors.point_mass import Law, axial_force, model_record
from harpy_pin.governors.rows import force_rows_measured
from harpy_pin.governors.thrust import CentreGains, centre_feedback
from reproduction.vlip_model import PolarRows, leg_force, multiplier, polar_to_cartesian
from reproduction.vlip_simulation import (
    PAPER_GAINS,
    VlipParameters,
    cartesian,
    paper_reference,
    simulate_vlip,
    vlip_governor,
)

GRAVITY = np.array([0.0, 0.0, -9.81])
vectors = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0))
legs = st.builds(
    cartesian, st.floats(0.0, 1.2), st.floats(-np.pi, np.pi), st.floats(0.2, 1.0)
)  # θ, φ, l: never of zero length
masses = st.floats(0.5, 20.0)
gains = st.builds(
    CentreGains,
    k_pt=st.tuples(*[st.floats(0.0, 800.0)] * 3),
    k_dt=st.tuples(*[st.floats(0.0, 80.0)] * 3),
    k_pr=st.floats(0.0, 800.0),
    k_dr=st.floats(0.0, 80.0),
)


@given(legs, masses, vectors, st.floats(-5.0, 5.0), vectors)
def test_multiplier_solves_the_constrained_dynamics(r, mass, thrust, u_r, cop_acceleration):
    """Against the saddle-point system of the paper, solved whole."""
    system = np.zeros((4, 4))
    system[:3, :3] = mass * np.eye(3)
    system[:3, 3] = -r
    system[3, :3] = r
    right = np.concatenate((mass * GRAVITY + thrust, [u_r + r @ cop_acceleration]))
    *acceleration, lam = np.linalg.solve(system, right)
    assert multiplier(r, mass, GRAVITY, thrust, u_r, cop_acceleration) == pytest.approx(
        lam, rel=1e-9, abs=1e-9
    )
    force = np.empty(3)
    leg_force(r, mass, GRAVITY, thrust, u_r, cop_acceleration, force)
    np.testing.assert_allclose(
        mass * np.array(acceleration), mass * GRAVITY + thrust + force, atol=1e-8
    )


@given(
    legs,
    vectors,
    vectors,
    masses,
    gains,
    arrays(np.float64, 6, elements=st.floats(-2.0, 2.0)),
    st.sampled_from(Law),
)
def test_axial_force_is_the_affine_form_of_the_leg_force(r, c, c_dot, mass, gain, w, law):
    """N(w) = J w + d gives the force that law and multiplier give (equations.md §2)."""
    jacobian = np.empty(6)
    d = axial_force(r, c, c_dot, model_record(mass=mass, g=9.81, gains=gain, law=law)[0], jacobian)
    thrust, force = np.empty(3), np.empty(3)
    u_r = centre_feedback(r, c, c_dot, w, int(law), gain.record[0], thrust)
    if law is Law.FULL:
        u_r = 0.0  # unused in the 3D run
    leg_force(r, mass, GRAVITY, thrust, u_r, np.zeros(3), force)
    direction = r / np.linalg.norm(r)
    np.testing.assert_allclose((jacobian @ w + d) * direction, force, rtol=1e-9, atol=1e-7)


def test_reference_of_the_paper():
    """(θ, φ, l) at the times where its sines and cosines are known."""
    np.testing.assert_allclose(
        paper_reference(0.5)[:3], [0.0, 1.5, 0.4], atol=1e-15
    )  # θ = 0: straight up (W8)
    np.testing.assert_allclose(paper_reference(1.5)[:3], [0.9, -1.5, 0.4], atol=1e-15)
    np.testing.assert_allclose(paper_reference(0.0)[:3], [0.45, 0.0, 0.3], atol=1e-15)
    assert np.all(paper_reference(0.3)[3:] == 0.0)


@given(arrays(np.float64, 6, elements=st.floats(-1.5, 1.5)), vectors)
def test_polar_reference_by_complex_step(w, foot):
    """c = u + l (sinθ cosφ, sinθ sinφ, cosθ): velocity along the rates, and the derivative of
    both.
    """

    def position(angles):
        theta, phi, length = angles
        return length * np.array(
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
        )

    def both(x):
        gradient = np.stack(
            [np.imag(position(x[:3] + 1e-30j * e)) / 1e-30 for e in np.eye(3)], axis=1
        )
        return np.concatenate((foot + position(x[:3]), gradient @ x[3:]))

    out, derivative = np.empty(6), np.empty((6, 6))
    polar_to_cartesian(w, foot, out, derivative)
    np.testing.assert_allclose(out, both(w), atol=1e-12)
    for i, e in enumerate(np.eye(6)):
        difference = (both(w + 1e-6 * e) - both(w - 1e-6 * e)) / 2e-6
        np.testing.assert_allclose(derivative[:, i], difference, atol=1e-7)


@pytest.mark.parametrize("evaluate_at", ["measured", "tracked"])
@given(st.floats(0.1, 1.2), st.floats(-3.0, 3.0), st.floats(0.2, 0.6), st.integers(0, 1000))
def test_polar_rows_are_the_cartesian_rows(evaluate_at, theta, phi, length, seed):
    """The same constraints at the same reference, with the Jacobian by central differences."""
    rng = np.random.default_rng(seed)
    cart = ForceRows(
        mass=4.0, mu=0.45, law=Law.PROJECTED, gains=PAPER_GAINS, evaluate_at=evaluate_at
    )
    rows = PolarRows(cart)
    x = np.concatenate((cartesian(0.4, 0.2, 0.4), rng.normal(size=3), np.zeros(3)))
    w = np.concatenate(([theta, phi, length], 0.3 * rng.normal(size=3)))
    h, jacobian = np.empty(5), np.empty((5, 6))
    rows.evaluate(x, w, h, jacobian)
    point, scratch, expected = np.empty(6), np.empty((6, 6)), np.empty(5)
    polar_to_cartesian(w, np.zeros(3), point, scratch)
    cart.evaluate(x, point, expected, np.empty((5, 6)))
    np.testing.assert_allclose(h, expected, atol=1e-12)
    for i in range(6):
        values = []
        for sign in (1.0, -1.0):
            moved = w.copy()
            moved[i] += sign * 1e-6
            value = np.empty(5)
            rows.evaluate(x, moved, value, np.empty((5, 6)))
            values.append(value)
        np.testing.assert_allclose(
            jacobian[:, i], (values[0] - values[1]) / 2e-6, rtol=1e-4, atol=1e-2
        )


def test_free_leg_conserves_energy():
    """Without gains and with a leg of constant length the model is a spherical pendulum."""
    p = VlipParameters(duration=0.3, start="inside", gains=CentreGains(k_pt=0.0, k_dt=0.0))
    run = simulate_vlip(None, p)
    height, speed = run.position[:, 2], np.linalg.norm(run.velocity, axis=1)
    # u_r = r·c̈ = 0 keeps L L̈ = |ṙ⊥|²: the leg lengthens as it swings, and its force does work.
    power = np.einsum("ij,ij->i", run.force, run.velocity)
    energy = p.mass * (p.g * height + 0.5 * speed**2)
    work = np.concatenate(([0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * p.dt)))
    assert speed[-1] > 0.3
    np.testing.assert_allclose(energy - work, energy[0], rtol=1e-6)


def test_tracked_reading_violates_less_than_no_governor():
    p = VlipParameters(start="inside", coordinates="cartesian")
    without = simulate_vlip(None, p).summary()
    assert simulate_vlip(None, p).h_r.shape == (4000, 0)
    tracked = simulate_vlip(vlip_governor(p, evaluate_at="tracked"), p).summary()
    assert without.violation_share > 0.4
    assert tracked.violation_share < 0.5 * without.violation_share


def test_too_long_a_step_is_reported():
    with pytest.raises(InputError, match="diverged"):
        simulate_vlip(None, VlipParameters(dt=0.2, duration=100.0))


def measured(theta, phi, length, rate):
    return np.concatenate((cartesian(theta, phi, length), rate, np.zeros(3)))


states = st.builds(
    measured,
    st.floats(0.05, 1.2),
    st.floats(-3.0, 3.0),
    st.floats(0.2, 0.8),
    arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
)


@given(states, arrays(np.float64, 6, elements=st.floats(-1.0, 1.0)))
def test_w2_deadlock(x, x_r):
    """v_n is proportional to x_r − x_w: where both coincide and violate, nothing moves, however
    long.
    """
    rows = ForceRows(mass=4.0, mu=0.0, gains=PAPER_GAINS, law=Law.PROJECTED, min_normal_force=1e6)
    governor = ExplicitReferenceGovernor(rows, alpha_r=1.0, alpha_t=5.0, alpha_n=2.0)
    governor.reset(x_r)
    for _ in range(50):
        governor.update(x, x_r, 1e-3)
    assert governor.status.infeasible
    assert governor.status.h_w.min() < 0.0
    np.testing.assert_array_equal(governor.applied, x_r)


def test_w7_finite_differences_give_the_wrong_rank():
    """The five rows are parallel: rank one. Differences of a step of 1e-6 make it more, and with
    too small a null space the reference stands still where it need not; the analytic rows,
    normalised, have the right one.
    """
    rng = np.random.default_rng(0)
    wrong, rows = 0, ForceRows(mass=4.0, mu=0.45, gains=PAPER_GAINS, law=Law.PROJECTED)
    for _ in range(100):
        x = measured(
            rng.uniform(0.1, 1.0),
            rng.uniform(-3.0, 3.0),
            rng.uniform(0.2, 0.8),
            rng.uniform(-1.0, 1.0, 3),
        )
        w = rng.uniform(-1.0, 1.0, 6)
        h, jacobian, scratch = np.empty(5), np.empty((5, 6)), np.empty((5, 6))
        force_rows_measured(x, w, rows.record, h, jacobian)
        differences = np.empty((5, 6))
        for i in range(6):
            moved, ahead = w.copy(), np.empty(5)
            moved[i] += 1e-6
            force_rows_measured(x, moved, rows.record, ahead, scratch)
            differences[:, i] = (ahead - h) / 1e-6
        wrong += np.linalg.matrix_rank(differences) > 1
        assert np.linalg.matrix_rank(jacobian) == 1
        erg = ExplicitReferenceGovernor(
            ForceRows(mass=4.0, mu=0.3), alpha_r=0.0, alpha_t=1.0, alpha_n=0.0
        )._record
        erg["h_r"], erg["h_w"], erg["jacobian_r"] = -1.0, 1.0, jacobian
        explicit_update(w, np.zeros(6), 0.0, erg[0])
        normal = jacobian[4] / np.linalg.norm(jacobian[4])
        np.testing.assert_allclose(
            erg["rate"][0], w - normal * (normal @ w), atol=1e-12
        )  # five dimensions are left
    assert wrong == 100
