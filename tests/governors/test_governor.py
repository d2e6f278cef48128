import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import null_space

import harpy_pin as hp
from harpy_pin.governors import ExplicitReferenceGovernor, ForceRows, StackedRows
from harpy_pin.governors.erg import ErgRecord, explicit_update
from harpy_pin.governors.point_mass import Law
from harpy_pin.governors.thrust import CentreGains
from harpy_pin.model.record import field, make_record
from reproduction.vlip_model import AngleRow
from reproduction.vlip_simulation import cartesian

ALPHA = (10.0, 15.0, 20.0)
GAINS = CentreGains(k_pt=400.0, k_dt=40.0, k_pr=300.0, k_dr=30.0)
small = st.floats(-1.0, 1.0).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


def states():
    """(9,) [c; ċ; u] with a leg of ordinary length and lean."""
    return st.builds(
        lambda theta, phi, length, foot, rate: np.concatenate(
            (foot + cartesian(theta, phi, length), rate, foot)
        ),
        st.floats(0.01, 1.2),
        st.floats(-np.pi, np.pi),
        st.floats(0.2, 0.9),
        arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
        arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
    )


def references():
    """(6,) [c; ċ]."""
    return arrays(np.float64, 6, elements=st.floats(-1.0, 1.0))


def algorithm_1(h_r, h_w, jacobian, x_r, x_w, dt, literal=False):
    """The paper's listing, line by line, in plain NumPy and SciPy."""
    a_r, a_t, a_n = ALPHA
    v_r = v_t = v_n = np.zeros_like(x_r)
    if h_w.min() >= 0 or h_r.min() >= 0:
        v_r = a_r * (x_r - x_w)
    if (h_w.min() >= 0 or h_r.min() < 0) if literal else (h_w.min() >= 0 and h_r.min() < 0):
        rows = jacobian[h_r < 0]
        rows = rows[np.linalg.norm(rows, axis=1) > 0]
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        basis = null_space(rows, rcond=1e-9) if len(rows) else np.eye(len(x_r))
        for n_k in basis.T:
            v_t = v_t + a_t * n_k * (n_k @ (x_r - x_w))
    if h_w.min() < 0 and h_r.min() < 0:
        k = int(np.argmin(h_w))
        norm = np.linalg.norm(jacobian[k])
        r_k = jacobian[k] if literal else (jacobian[k] / norm if norm > 0 else jacobian[k])
        towards = h_w.min() <= h_r.min() if literal else h_r[k] >= h_w[k]
        v_n = (1 if towards else -1) * a_n * r_k * (r_k @ (x_r - x_w))
    return x_w + dt * (v_r + v_t + v_n)


def made(rows, literal, h_r, h_w, jacobian_r):
    """A governor's record with the paper's rates and rows of the paper, their values and slopes
    filled in.
    """
    rates = dict(zip(("alpha_r", "alpha_t", "alpha_n"), ALPHA, strict=True))
    own = np.zeros(rows, dtype=bool)
    erg = make_record(ErgRecord, {"rows": rows, "size": 6}, **rates, literal=literal, own=own)
    erg["h_r"], erg["h_w"], erg["jacobian_r"] = h_r, h_w, jacobian_r
    return erg


@given(
    arrays(np.float64, 5, elements=small),
    arrays(np.float64, 5, elements=small),
    arrays(np.float64, (5, 6), elements=small),
    references(),
    references(),
    st.booleans(),
)
def test_update_is_algorithm_1(h_r, h_w, jacobian, x_r, x_w, literal):
    spread = (
        np.linalg.svd(jacobian[h_r < 0], compute_uv=False) if (h_r < 0).any() else np.array([1.0])
    )
    if ((spread > 1e-12) & (spread < 1e-2)).any():
        return  # a rank that no two methods agree on
    worst = int(np.argmin(h_w))
    if h_r.min() < 0 and abs(jacobian[worst] @ (x_r - x_w)) <= -1e-6 * h_w[worst]:
        # no direction of repair: not the paper's, see ExplicitReferenceGovernor and the next test
        return
    expected = algorithm_1(h_r, h_w, jacobian, x_r, x_w, 1e-3, literal)
    applied, erg = x_w.copy(), made(5, literal, h_r, h_w, jacobian)
    infeasible = explicit_update(x_r, applied, 1e-3, erg[0])
    np.testing.assert_allclose(applied, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(erg["rate"][0], (applied - x_w) / 1e-3, rtol=1e-6, atol=1e-6)
    assert infeasible == (h_r.min() < 0 and h_w.min() < 0)


def test_repair_without_a_direction_follows_the_target():
    """Both references agree in the row that both violate: x_w moves along it, at the rate α_t."""
    x_r, x_w, row = (
        np.zeros(6),
        np.array([0.0, 1.0, -1.0, 0.5, 0.0, 0.0]),
        np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    )
    applied, erg = x_w.copy(), made(1, False, -1.0, -1.0, row)
    assert explicit_update(x_r, applied, 1e-3, erg[0])
    np.testing.assert_allclose(applied, (1.0 - 1e-3 * ALPHA[1]) * x_w, rtol=1e-12)


def test_ticks_of_a_walk_are_algorithm_1():
    """To rounding on all ticks of a walk that falls: on none of them does v_t act without a
    direction of repair.
    """
    walk = hp.build(hp.Scenario(controller="governed", ground=hp.Ground(mu_s=0.15), duration=3.0))
    record, ticks = walk.controller.governor._record, []
    names = ("h_r", "h_w", "jacobian_r", "rate", "applied")
    run = walk.run(
        on_tick=lambda _: ticks.append([np.array(field(record, name)) for name in names])
    )
    repaired = 0
    for x_r, (h_r, h_w, jacobian, rate, applied) in zip(run["x_r"][:-1], ticks[1:], strict=True):
        repaired += h_r.min() < 0 and h_w.min() < 0
        expected = algorithm_1(h_r, h_w, jacobian, x_r, applied - 1e-3 * rate, 1e-3)
        np.testing.assert_allclose(applied, expected, rtol=0, atol=1e-12)
    assert repaired > 1000


@given(states(), references(), st.sampled_from(Law))
def test_measured_rows_are_those_of_the_models_force(x, w, law):
    """μ u_gz ∓ u_gx, μ u_gz ∓ u_gy, u_gz − 20 with u_g of E4, written out in vectors."""
    c, c_dot, r = x[:3], x[3:6], x[:3] - x[6:]
    e, e_dot = w[:3] - c, w[3:] - c_dot
    thrust = 400.0 * e + 40.0 * e_dot
    u_r = 0.0
    if law is Law.PROJECTED:
        thrust = thrust - r * (r @ thrust) / (r @ r)
        u_r = r @ (300.0 * e + 30.0 * e_dot)
    force = 4.0 * r * (u_r - r @ (np.array([0, 0, -9.81]) + thrust / 4.0)) / (r @ r)
    h, jacobian = np.empty(5), np.empty((5, 6))
    ForceRows(mass=4.0, mu=0.4, gains=GAINS, law=law).evaluate(x, w, h, jacobian)
    f_x, f_y, f_z = force
    expected = [0.4 * f_z - f_x, 0.4 * f_z + f_x, 0.4 * f_z - f_y, 0.4 * f_z + f_y, f_z - 20.0]
    np.testing.assert_allclose(h, expected, rtol=1e-9, atol=1e-7)


@given(st.floats(0.01, 1.3), st.floats(-np.pi, np.pi), st.floats(0.2, 0.9))
def test_tracked_rows_in_angles(theta, phi, length):
    """u_gz = m g cos²θ and the friction m g cosθ sinθ cosφ, independent of l (equations.md R2)."""
    w = np.concatenate((cartesian(theta, phi, length), np.zeros(3)))
    h, jacobian = np.empty(5), np.empty((5, 6))
    ForceRows(mass=4.0, mu=0.4, evaluate_at="tracked").evaluate(np.zeros(9), w, h, jacobian)
    weight = 4.0 * 9.81
    normal = weight * np.cos(theta) ** 2
    along_x = weight * np.cos(theta) * np.sin(theta) * np.cos(phi)
    along_y = weight * np.cos(theta) * np.sin(theta) * np.sin(phi)
    expected = [
        0.4 * normal - along_x,
        0.4 * normal + along_x,
        0.4 * normal - along_y,
        0.4 * normal + along_y,
        normal - 20,
    ]
    np.testing.assert_allclose(h, expected, atol=1e-10)
    assert np.abs(jacobian[:, :3] @ w[:3]).max() < 1e-9  # no change along the leg


@pytest.mark.parametrize(
    "rows",
    [
        ForceRows(mass=4.0, mu=0.4, evaluate_at="tracked"),
        AngleRow(),
        StackedRows([AngleRow(), ForceRows(mass=4.0, mu=0.3)]),
    ],
)
@given(states())
def test_jacobians_by_central_differences(rows, x):
    n = len(rows.names)
    w = np.concatenate((x[:3], np.zeros(3)))
    h, jacobian = np.empty(n), np.empty((n, 6))
    rows.evaluate(x, w, h, jacobian)
    scratch = np.empty((n, 6))
    for i in range(6):
        ahead, behind = np.empty(n), np.empty(n)
        for out, sign in ((ahead, 1.0), (behind, -1.0)):
            moved = w.copy()
            moved[i] += sign * 1e-6
            rows.evaluate(x, moved, out, scratch)
        np.testing.assert_allclose(jacobian[:, i], (ahead - behind) / 2e-6, rtol=1e-4, atol=1e-3)


@given(states())
def test_friction_cannot_be_repaired_by_a_measured_reference(x):
    """The reference scales the force and never turns it: with the leg outside the cone no w
    satisfies friction and a positive normal force at once (equations.md §2).
    """
    r = x[:3] - x[6:]
    mu = 0.5 * np.abs(r[:2]).max() / r[2]
    rows = ForceRows(mass=4.0, mu=mu, min_normal_force=0.0)
    rng = np.random.default_rng(0)
    h, jacobian = np.empty(5), np.empty((5, 6))
    for _ in range(20):
        rows.evaluate(x, rng.uniform(-3.0, 3.0, 6), h, jacobian)
        assert h.min() < 0.0


def test_reaches_a_target_that_violates_nothing():
    rows = ForceRows(mass=4.0, mu=0.8, min_normal_force=1.0)
    governor = ExplicitReferenceGovernor(rows)
    x = np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    target = np.array([0.01, 0.0, 0.6, 0.0, 0.0, 0.0])
    governor.reset(np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0]))
    for _ in range(2000):
        applied = governor.update(x, target, 1e-3)
    np.testing.assert_allclose(applied, target, atol=1e-9)
    assert governor.status.active == ()
    assert np.shares_memory(applied, governor.applied)


def test_status_names_the_violated_rows():
    rows = ForceRows(mass=4.0, mu=0.8)
    governor = ExplicitReferenceGovernor(rows)
    x = np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    governor.reset(x[:6])
    high = np.array(
        [0.0, 0.0, 0.7, 0.0, 0.0, 0.0]
    )  # asks the thrusters to take the weight off the ground
    governor.update(x, high, 1e-3)
    assert "normal force" in governor.status.active
    assert not governor.status.infeasible


@given(
    states(),
    references(),
    references(),
    st.sampled_from(Law),
    st.sampled_from(["measured", "tracked"]),
)
def test_one_call_equals_rows_then_update(x, x_r, start, law, evaluate_at):
    """The fused update of force rows gives what rows of any kind give, bit for bit."""
    rows = ForceRows(mass=4.0, mu=0.4, gains=GAINS, law=law, evaluate_at=evaluate_at)
    fused, general = ExplicitReferenceGovernor(rows), ExplicitReferenceGovernor(StackedRows([rows]))
    for governor in (fused, general):
        governor.reset(start)
        governor.update(x, x_r, 1e-3)
    np.testing.assert_array_equal(fused.applied, general.applied)
    np.testing.assert_array_equal(fused.status.h_r, general.status.h_r)
    np.testing.assert_array_equal(fused.status.h_w, general.status.h_w)
    assert fused.status.infeasible == general.status.infeasible
