"""What equations.md says of the printed equations, shown: affinity, deadlock, rank failure, the Lyapunov claim."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harpy_pin.governors import ExplicitReferenceGovernor, ForceRows
from harpy_pin.governors.reduced.erg import erg_record, explicit_update
from harpy_pin.governors.reduced.point_mass import Law
from harpy_pin.governors.reduced.rows import force_rows_measured
from harpy_pin.model.thrust import CentreGains
from reproduction.vlip_simulation import cartesian

GAINS = CentreGains(k_pt=660.0, k_dt=60.0, k_pr=660.0, k_dr=60.0)


def parameters(law):
    rows = ForceRows(mass=4.0, mu=0.45, min_normal_force=20.0, gains=GAINS, law=law)
    return rows.record[0]


vectors = arrays(np.float64, 6, elements=st.floats(-1.0, 1.0))


def measured(theta, phi, length, rate):
    return np.concatenate((cartesian(theta, phi, length), rate, np.zeros(3)))


states = st.builds(
    measured,
    st.floats(0.05, 1.2),
    st.floats(-3.0, 3.0),
    st.floats(0.2, 0.8),
    arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
)


@given(states, vectors)
def test_w2_deadlock(x, x_r):
    """v_n is proportional to x_r − x_w: where both coincide and violate, nothing moves, however long."""
    rows = ForceRows(mass=4.0, mu=0.0, gains=GAINS, law=Law.PROJECTED, min_normal_force=1e6)
    governor = ExplicitReferenceGovernor(rows, alpha_r=1.0, alpha_t=5.0, alpha_n=2.0)
    governor.reset(x_r)
    for _ in range(50):
        governor.update(x, x_r, 1e-3)
    assert governor.status.infeasible
    assert governor.status.h_w.min() < 0.0
    np.testing.assert_array_equal(governor.applied, x_r)


def test_w7_finite_differences_give_the_wrong_rank():
    """The five rows are parallel: rank one. Differences of a step of 1e-6 make it more, and with too small
    a null space the reference stands still where it need not; the analytic rows, normalised, have the right one."""
    rng = np.random.default_rng(0)
    wrong, p = 0, parameters(Law.PROJECTED)
    for _ in range(100):
        x = measured(rng.uniform(0.1, 1.0), rng.uniform(-3.0, 3.0), rng.uniform(0.2, 0.8), rng.uniform(-1.0, 1.0, 3))
        w = rng.uniform(-1.0, 1.0, 6)
        h, jacobian, scratch = np.empty(5), np.empty((5, 6)), np.empty((5, 6))
        force_rows_measured(x, w, p, h, jacobian)
        differences = np.empty((5, 6))
        for i in range(6):
            moved, ahead = w.copy(), np.empty(5)
            moved[i] += 1e-6
            force_rows_measured(x, moved, p, ahead, scratch)
            differences[:, i] = (ahead - h) / 1e-6
        wrong += np.linalg.matrix_rank(differences) > 1
        assert np.linalg.matrix_rank(jacobian) == 1
        erg = erg_record(rows=5, size=6, alpha_r=0.0, alpha_t=1.0, alpha_n=0.0)
        erg["h_r"], erg["h_w"], erg["jacobian_r"] = -1.0, 1.0, jacobian
        explicit_update(w, np.zeros(6), 0.0, erg[0])
        normal = jacobian[4] / np.linalg.norm(jacobian[4])
        np.testing.assert_allclose(erg["rate"][0], w - normal * (normal @ w), atol=1e-12)  # five dimensions are left
    assert wrong == 100
