"""Many robots at once: each row is what a controller of its own gives, and no row disturbs
another.
"""

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin import InputError
from harpy_pin.contrib.batch import BAD_STATE, CondensedBatch
from harpy_pin.controllers import CondensedController, WholeBodyParameters
from harpy_pin.gaits import GaitParameters, StraightGait
from harpy_pin.model.robot import heavier
from harpy_pin.model.state import State
from harpy_pin.wbc.condensed import CondensedStatus
from harpy_pin.wbc.weights import WholeBodyLimits

ROBOT = hp.load_harpy()
N = 150


def samples(gait, rng, n, *, scale=0.03):
    """States near a gait's start, and forces of feet that touch or do not."""
    robot, (q0, _) = gait.robot, gait.initial_state()
    nv, feet = robot.model.nv, len(robot.feet)
    q = np.array(
        [pin.integrate(robot.model, q0, scale * rng.standard_normal(nv)) for _ in range(n)]
    )
    force = np.zeros((n, feet, 3))
    force[:, :, 2] = rng.uniform(-1.0, 1.0, (n, feet)) * robot.mass * 9.81
    return q, 10.0 * scale * rng.standard_normal((n, nv)), force.clip(min=0.0)


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_are_what_single_controllers_give(threads):
    """Over several ticks, so that active sets are remembered, with friction and mass of each
    robot's own.
    """
    rng, gait = np.random.default_rng(0), StraightGait(ROBOT, GaitParameters(double_support=0.25))
    batch = CondensedBatch(ROBOT, N, threads=threads, double_support=0.25)
    batch.mu[:], batch.mass_error[:] = rng.uniform(0.1, 0.8, N), rng.uniform(-0.2, 0.3, N)
    checked = rng.choice(N, 12, replace=False)
    singles = {}
    for i in checked:
        parameters = WholeBodyParameters.for_gait(gait, limits={"mu": batch.mu[i]}, hold_ticks=0)
        # Inertia of a heavier body, as the batch computes it.
        same_walk = StraightGait(heavier(ROBOT, batch.mass_error[i]), gait.parameters)
        singles[i] = CondensedController(same_walk, parameters)
    seen = set()
    for tick in range(4):
        q, v, force = samples(gait, rng, N)
        for i in range(N):
            batch.targets.fill(gait.update(0.01 * tick + 1.5 * i / N), i)
        torque, thrust = batch.step(q, v, force)
        for i, single in singles.items():
            t, feet = 0.01 * tick + 1.5 * i / N, np.zeros((2, 3))
            command = single.step(State(t, q[i], v[i], feet, feet, force[i]))
            np.testing.assert_allclose(torque[i], command.torque, rtol=0, atol=1e-12)
            np.testing.assert_allclose(thrust[i], command.thrust, rtol=0, atol=1e-12)
            np.testing.assert_allclose(batch.force[i], single.solver.force, rtol=0, atol=1e-11)
            assert batch.status[i] == single.solver.status
            seen.add(int(batch.status[i]))
    assert len(seen) > 1  # limits were met


MOTORS = {"joint_stiffness": 1.0, "joint_damping": 0.3}


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    "gains", [MOTORS, {"joint_damping": 0.5}, {}], ids=["both", "damping", "none"]
)
def test_joint_targets_are_those_of_single_controllers(gains, threads):
    """To the last bit, also after a reset and where torques are clipped or the state is bad;
    without gains all zero.
    """
    rng, gait = np.random.default_rng(3), StraightGait(ROBOT, GaitParameters(double_support=0.25))
    limits = WholeBodyLimits(mu=0.3, torque_scale=0.1)
    more = {"hold_ticks": 0, "estimate_friction": False, "joint_learning": 0.0}
    parameters = WholeBodyParameters.for_gait(gait, limits=limits, **more, **gains)
    batch = CondensedBatch(ROBOT, N, parameters, double_support=0.25, threads=threads)
    singles = [CondensedController(gait, parameters) for _ in range(0, N, 15)]
    status = []
    for tick in range(6):
        q, v, force = samples(gait, rng, N, scale=0.01)
        batch.targets.fill(gait.update(0.01 * tick))
        if tick == 4:
            v[15] = np.nan
        if tick == 5:
            batch.reset([30])
            singles[2].reset()
        torque, _ = batch.step(q, v, force)
        for i, single in zip(range(0, N, 15), singles, strict=True):
            command = single.step(State(0.01 * tick, q[i], v[i], *np.zeros((2, 2, 3)), force[i]))
            law = np.zeros((4, 6)) if command.law is None or np.isnan(v[i, 0]) else command.law
            np.testing.assert_array_equal(batch.law[i], law)
            if not np.isnan(v[i, 0]):
                np.testing.assert_array_equal(torque[i], command.torque)
        status.extend(batch.status)
    assert batch.law.any() == bool(gains)
    clipped = np.array(status) & CondensedStatus.TORQUE_CLIPPED != 0
    assert clipped.any()
    assert not clipped.all()


def test_single_precision_is_near():
    rng, gait = np.random.default_rng(1), hp.make_gait(ROBOT, speed=0.3)
    parameters = WholeBodyParameters.for_gait(
        hp.make_gait(ROBOT), estimate_friction=False, **MOTORS
    )
    double, single = (
        CondensedBatch(ROBOT, N, parameters, dtype=dtype) for dtype in (np.float64, np.float32)
    )
    given = [array.astype(np.float32) for array in samples(gait, rng, N)]
    for batch in (double, single):
        batch.targets.fill(gait.update(0.3))
    exact, _ = double.step(*given)
    rounded, _ = single.step(*given)
    assert rounded.dtype == np.float32
    # Targets and results are rounded to float32; what lies between is not.
    assert np.median(np.abs(exact - rounded)) < 1e-4
    np.testing.assert_allclose(single.law, double.law, rtol=1e-3, atol=1e-3)


def test_a_bad_row_spoils_no_other():
    rng, gait = np.random.default_rng(2), hp.make_gait(ROBOT, speed=0.3)
    q, v, force = samples(gait, rng, N)
    clean, spoiled = CondensedBatch(ROBOT, N), CondensedBatch(ROBOT, N)
    bad = np.arange(0, N, 7)
    for _ in range(2):
        expected = clean.step(q, v, force)[0].copy()
        broken = v.copy()
        broken[bad[0::3], 0], broken[bad[1::3], 7], broken[bad[2::3], 3] = np.nan, np.inf, 1e300
        torque, thrust = spoiled.step(q, broken, force)
        good = np.setdiff1d(np.arange(N), bad)
        np.testing.assert_array_equal(torque[good], expected[good])
        assert np.isfinite(torque).all()
        assert np.isfinite(thrust).all()
    nan = bad[0::3]
    assert (spoiled.status[nan] == BAD_STATE).all()
    assert (torque[nan] == 0.0).all()
    # A row that was bad is answered as any other once it is good again.
    spoiled.reset(bad)
    clean.reset(bad)
    np.testing.assert_array_equal(spoiled.step(q, v, force)[0], clean.step(q, v, force)[0])


def test_arrays_are_read_where_they_are():
    class Foreign:
        """An array of another library, which NumPy reads through DLPack alone."""

        def __init__(self, array):
            self._array = array

        def __dlpack__(self, **how):
            return self._array.__dlpack__(**how)

        def __dlpack_device__(self):
            return self._array.__dlpack_device__()

    rng, gait = np.random.default_rng(4), hp.make_gait(ROBOT, speed=0.3)
    given = samples(gait, rng, N)
    batch = CondensedBatch(ROBOT, N)
    assert batch._array("q", given[0]) is given[0]
    assert np.shares_memory(batch._array("q", Foreign(given[0])), given[0])
    expected = batch.step(*given)[0].copy()
    batch.reset()
    np.testing.assert_array_equal(batch.step(*map(Foreign, given))[0], expected)
    assert np.from_dlpack(batch.torque) is not None


def test_what_does_not_fit_is_refused():
    batch = CondensedBatch(ROBOT, 3)
    q, v, force = np.zeros((3, 13)), np.zeros((3, 12)), np.zeros((3, 2, 3))
    with pytest.raises(InputError, match="q must have shape"):
        batch.step(q[:2], v, force)
    with pytest.raises(InputError, match="foot_force"):
        batch.step(q, v, force[:, :1])
    with pytest.raises(InputError, match="float32, float64"):
        CondensedBatch(ROBOT, 3, dtype=np.int32)
    with pytest.raises(InputError):
        CondensedBatch(ROBOT, 0)
    with pytest.raises(InputError, match="estimates no friction"):
        CondensedBatch(
            ROBOT, 3, WholeBodyParameters.for_gait(hp.make_gait(ROBOT), estimate_friction=True)
        )
    iris = hp.load_robot("iris")
    motors = WholeBodyParameters.for_gait(hp.Hovering(iris), estimate_friction=False, **MOTORS)
    with pytest.raises(InputError, match="'iris' has no legs"):
        CondensedBatch(iris, 2, motors)
    for array in (np.full((3, 4, 6), np.nan), np.zeros((3, 4, 5))):
        with pytest.raises(InputError, match="law"):
            batch.law = array
    with pytest.raises(InputError, match="mu"):
        batch.mu = np.ones(1)
    batch.mu[1] = np.nan
    with pytest.raises(InputError, match="mu"):
        batch.step(q, v, force)
