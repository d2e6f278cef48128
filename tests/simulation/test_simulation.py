"""The simulator against reference integrations, its convergence, and how runs end."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import harpy_pin as hp
from harpy_pin import Command, ControlError, Ground, InputError, Interrupted, Simulator
from harpy_pin.simulation.ground import normal_force

NO_COMMAND = Command(np.zeros(0), np.zeros((0, 3)))
MASS = 2.0


def idle():
    return Command(np.zeros(6), np.zeros((2, 3)))


class Script:
    """A controller that does what a function of (tick, state) says."""

    def __init__(self, function, period=1e-3):
        self.function, self.period, self.tick = function, period, -1

    def step(self, state):
        self.tick += 1
        return self.function(self.tick, state)


def from_tick(first, function):
    """Idle before a tick, the function from then on."""
    return Script(lambda tick, state: function() if tick >= first else idle())


def throw(error):
    raise error


def standing(robot, dt=5e-4, mu=0.8):
    gait = hp.make_gait(robot, speed=0.0)
    simulator = Simulator(robot, Ground(mu_s=mu), dt=dt)
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    return simulator, gait


def walk(controller="governed", governor="none", dt=5e-4, duration=1.5, speed=0.3):
    part = hp.Governed(governor=governor) if controller == "governed" else controller
    gait, ground = hp.Straight(speed=speed), Ground(mu_s=0.8)
    return hp.walk(hp.Scenario(controller=part, gait=gait, ground=ground, dt=dt, duration=duration))


# --- Vertical motion of the sled ------------------------------------------------------------------------------------


def drop_exactly(ground, height, times):
    """The condensed controller, integrated phase by phase: in the air, going down in the ground, coming up in it."""
    packed = ground.record[0]

    def slope(_, y):
        return [y[1], -9.81 + normal_force(y[0], y[1], packed) / MASS]

    found = solve_ivp(slope, (0, times[-1]), [height, 0.0], rtol=1e-9, atol=1e-12, max_step=2e-4, t_eval=times)
    return found.y.T


def drop(sled, ground, height, dt, times):
    simulator = Simulator(sled, ground, dt=dt)
    q = pin.neutral(sled.model)
    q[2] = height
    simulator.reset(q, np.zeros(6))
    rows, every = [], round((times[1] - times[0]) / dt)
    for i in range(round(times[-1] / dt) + 1):
        if i % every == 0:
            rows.append([simulator.q[2], simulator.v[2]])
        simulator.advance(NO_COMMAND)
    return np.array(rows)


GROUNDS = {k: Ground(stiffness=1e3 * k, mu_s=0.8) for k in (4, 8, 16, 40, 80)}
"""By stiffness in kN/m, from grass to concrete under a rubber foot; the damping ratio is that of the paper's ground."""


@pytest.mark.parametrize("ground", [*(Ground(damping=d) for d in (0.0, 40.0, 268.3)), GROUNDS[4], GROUNDS[80]])
def test_drop_converges_to_the_explicit_law_with_order_one(sled, ground):
    """Height and velocity through touchdown, compression and rebound; mean over drop heights, as each touchdown
    falls somewhere in a step."""
    times = np.linspace(0.0, 0.16, 81)
    errors = np.zeros((4, 2))
    for height in np.linspace(0.01, 0.03, 7):
        exact = drop_exactly(ground, height, times)
        assert exact[:, 0].min() < -MASS * 9.81 / ground.stiffness  # it did land
        for k, dt in enumerate((2e-4, 1e-4, 5e-5, 2.5e-5)):
            errors[k] += np.abs(drop(sled, ground, height, dt, times) - exact).mean(axis=0)
    ratios = errors[:-1] / errors[1:]
    np.testing.assert_allclose(ratios, 2.0, atol=0.3)
    assert errors[-1, 0] / 7 < 2e-5


def test_rest_is_the_static_sink(sled):
    simulator = Simulator(sled, dt=1e-3)
    q = pin.neutral(sled.model)
    q[2] = 0.01
    simulator.reset(q, np.zeros(6))
    for _ in range(3000):
        simulator.advance(NO_COMMAND)
    assert simulator.static_penetration == pytest.approx(MASS * 9.81 / 8000.0)
    assert simulator.q[2] == pytest.approx(-simulator.static_penetration, abs=1e-9)
    np.testing.assert_allclose(simulator.state.foot_force, [[0, 0, MASS * 9.81]], atol=1e-6)


def test_static_sink_on_a_slope_is_that_of_the_normal_load(sled):
    slope = np.radians(30)
    gravity = 9.81 * np.array([np.sin(slope), 0, -np.cos(slope)])
    simulator = Simulator(sled, Ground(mu_s=1.0), gravity=gravity)
    q = pin.neutral(sled.model)
    simulator.reset(q, np.zeros(6))
    for _ in range(4000):
        simulator.advance(NO_COMMAND)
    assert simulator.static_penetration == pytest.approx(-simulator.q[2], rel=1e-6)


def test_bouncing_never_gains_height(sled):
    ground = Ground(damping=0.0)  # elastic: the worst case
    simulator = Simulator(sled, ground, dt=5e-4)
    q = pin.neutral(sled.model)
    q[2] = 0.05
    simulator.reset(q, np.zeros(6))
    energies = []
    for _ in range(4000):
        simulator.advance(NO_COMMAND)
        z, w = simulator.q[2], simulator.v[2]
        energies.append(0.5 * MASS * w**2 + MASS * 9.81 * z + 0.5 * ground.stiffness * min(z, 0.0) ** 2)
    # Semi-implicit flight exchanges m g · g dt² / 2 per step at most, contact gives nothing.
    assert np.max(np.diff(energies)) <= 0.5 * MASS * 9.81**2 * 5e-4**2 + 1e-12
    assert np.max(energies) <= energies[0] + 1e-9


# --- Harpy ----------------------------------------------------------------------------------------------------------


def test_contact_forces_of_a_walk_converge():
    runs = [walk("wbc", dt=dt) for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4)]
    assert [run.ending for run in runs] == ["completed"] * 4
    assert all(run.metadata["contact_unconverged"] == 0 for run in runs)
    # Whether a foot is held is decided once a tick: a touchdown at the end of a tick is seen by one run and not by
    # another, which is a jump and no error of a step. The 30 ms after such a tick are left out.
    agree = np.ones(len(runs[0]), dtype=bool)
    for tick in np.flatnonzero(np.ptp([run["held"] for run in runs], axis=0).any(axis=1)):
        agree[tick : tick + 30] = False
    assert agree.mean() > 0.9
    forces = [run["foot_force"][agree, :, 2] for run in runs]
    gaps = [np.abs(fine - coarse).mean() for coarse, fine in pairwise(forces)]
    assert gaps[1] < gaps[0]
    assert gaps[2] < 0.75 * gaps[1]
    assert gaps[2] < 0.01 * forces[-1].mean()


@pytest.mark.parametrize("ground", GROUNDS.values(), ids=[f"{k} kN" for k in GROUNDS])
def test_walks_on_every_ground_converge_with_order_one(ground):
    runs = [
        hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), ground=ground, dt=dt, duration=1.5))
        for dt in (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    ]
    assert [run.ending for run in runs] == ["completed"] * 4
    assert all(run.metadata["contact_unconverged"] == 0 for run in runs)
    for gaps in (
        [np.abs(fine["foot_force"][:, :, 2] - coarse["foot_force"][:, :, 2]).mean() for coarse, fine in pairwise(runs)],
        [np.abs(fine["q"][:, :3] - coarse["q"][:, :3]).max() for coarse, fine in pairwise(runs)],
    ):
        assert gaps[1] < 0.65 * gaps[0]
        assert gaps[2] < 0.8 * gaps[1]
    forces = [run["foot_force"][:, :, 2].mean() for run in runs]
    assert abs(forces[1] - forces[3]) < 1e-3 * forces[3]


@pytest.mark.parametrize("controller", ["governed", "wbc"])
def test_stance_feet_of_a_standing_robot_do_not_drift(robot, controller):
    run = walk(controller, duration=2.0, speed=0.0)
    assert run.ending == "completed"
    feet = run["foot_position"][100:, :, :2]
    assert np.abs(feet - feet[0]).max() < 1e-9
    total = run["foot_force"][-1].sum(axis=0) + run["thrust"][-1].sum(axis=0)
    np.testing.assert_allclose(total, [0, 0, robot.mass * 9.81], atol=0.05)


def test_momentum_balance_of_a_walk(robot):
    """Newton for the whole: change of momentum = gravity + contact + thrust, step by step, to order one."""
    defects = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        gait = hp.make_gait(robot)
        simulator = Simulator(robot, Ground(mu_s=0.8), dt=dt)
        simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
        controller = hp.make_controller("governed", gait, mu=0.8, governor="none")
        data, impulse = robot.model.createData(), np.zeros(3)
        first = pin.computeCentroidalMomentum(robot.model, data, simulator.q, simulator.v).linear.copy()
        for i in range(round(0.3 / dt)):
            if i % round(1e-3 / dt) == 0:
                command = controller.step(simulator.state)
            simulator.advance(command)
            force = simulator.state.foot_force.sum(axis=0) + command.thrust.sum(axis=0)
            impulse += dt * (force + robot.mass * np.array([0, 0, -9.81]))
        last = pin.computeCentroidalMomentum(robot.model, data, simulator.q, simulator.v).linear
        defects.append(np.linalg.norm(last - first - impulse))
    assert defects[2] < 0.6 * defects[1] < 0.36 * defects[0]


def test_forces_of_a_walk_are_lawful(robot):
    for cone in ("circular", "per_axis"):
        ground = Ground(mu_s=0.25, cone=cone)
        run = hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), ground=ground, duration=1.5))
        force, velocity = run["foot_force"], run["foot_velocity"]
        assert np.all(force[:, :, 2] >= 0.0)
        tangent, slip = force[:, :, :2], velocity[:, :, :2]
        reach = ground.mu_s * force[:, :, 2] + 1e-6
        if cone == "circular":
            size, speed = np.linalg.norm(tangent, axis=2), np.linalg.norm(slip, axis=2)
            assert np.all(size <= reach + 1.01 * ground.mu_v * speed + 1e-3)
        else:
            assert np.all(np.abs(tangent) <= reach[:, :, None] + 1.01 * ground.mu_v * np.abs(slip) + 1e-3)
        assert np.all(force[run["foot_position"][:, :, 2] > 1e-4] == 0.0)


def test_reset_forgets(robot):
    """The same simulator and controller, after another run and a reset, repeat themselves."""
    simulator, gait = standing(robot)
    controller = hp.make_controller("governed", gait, mu=0.8)
    start = gait.initial_state(penetration=simulator.static_penetration)
    runs = []
    for _ in range(2):
        simulator.reset(*start)
        controller.reset()
        runs.append(simulator.run(controller, 0.2))
    for name in runs[0].signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(runs[0][name], runs[1][name], err_msg=name)


def test_run_in_two_parts_is_the_run(robot):
    """Stopping at a tick and going on changes nothing."""

    def command(tick, state):
        return Command(200.0 * (start[0][7:] - state.q[7:]) - 2.0 * state.v[6:], np.zeros((2, 3)))

    simulator, gait = standing(robot)
    start = gait.initial_state(penetration=simulator.static_penetration)
    whole = simulator.run(Script(command), 0.1)
    simulator.reset(*start)
    parts = [simulator.run(Script(command), 0.06), simulator.run(Script(command), 0.04)]
    np.testing.assert_allclose(np.concatenate([p["t"] for p in parts]), whole["t"], atol=1e-12)
    for name in ("q", "v", "foot_force"):
        joined = np.concatenate([p[name] for p in parts])
        np.testing.assert_allclose(joined, whole[name], atol=1e-9, err_msg=name)


def test_state_is_a_copy(robot):
    simulator, _ = standing(robot)
    state = simulator.state
    q = state.q.copy()
    simulator.advance(idle())
    np.testing.assert_array_equal(state.q, q)
    state.v[:] = 99.0
    assert np.all(simulator.v != 99.0)


def test_controller_sees_what_is_logged_and_command_is_held(robot):
    """Ticks come at multiples of the period, whatever dt, and the state handed over is the row of the log."""
    simulator, _ = standing(robot, dt=2.5e-4)
    seen = []
    script = Script(lambda tick, state: (seen.append(state.copy()), idle())[1], period=2e-3)
    run = simulator.run(script, 0.05)
    assert len(run) == len(seen) == 25
    np.testing.assert_allclose(run["t"], 2e-3 * np.arange(25), atol=1e-15)
    for i, state in enumerate(seen):
        assert state.t == run["t"][i]
        np.testing.assert_array_equal(state.q, run["q"][i])
        np.testing.assert_array_equal(state.foot_force, run["foot_force"][i])


# --- How runs end ---------------------------------------------------------------------------------------------------


def test_completed(robot):
    simulator, _ = standing(robot)
    run = simulator.run(from_tick(0, idle), 0.02, metadata={"note": "mine"})
    assert run.ending == "completed"
    assert not run.fell
    assert len(run) == 20
    assert run.metadata["note"] == "mine"
    assert run.metadata["robot"] == "harpy"
    assert run.metadata["dt"] == 5e-4
    assert run.metadata["control_period"] == 1e-3
    assert run["torque"].shape == (20, 6)
    assert run["thrust"].shape == (20, 2, 3)


def test_fall_keeps_the_log(robot):
    simulator, _ = standing(robot)
    run = simulator.run(from_tick(0, idle), 5.0)
    assert run.ending == "fell"
    assert run.fell
    assert 100 < len(run) < 2000
    assert run.metadata["end_time"] == pytest.approx(len(run) * 1e-3, abs=1e-9)
    start = run["q"][0, 2]

    def down(q):
        """Below 60 % of the height at the start, or tilted by more than 60°."""
        return q[2] < 0.6 * start or pin.Quaternion(q[3:7]).matrix()[2, 2] < 0.5

    assert not any(down(q) for q in run["q"])  # it ended with the first tick that was
    assert down(simulator.q)


def test_divergence_keeps_the_log(robot):
    simulator, _ = standing(robot)
    run = simulator.run(from_tick(5, lambda: Command(np.full(6, 1e9), np.zeros((2, 3)))), 1.0)
    assert run.ending == "diverged"
    assert run.fell
    assert len(run) == 6
    assert np.all(np.isfinite(run["q"]))


@pytest.mark.parametrize("tick", [0, 5])
def test_interrupt_in_the_controller_keeps_the_log(robot, tick):
    simulator, _ = standing(robot)
    with pytest.raises(Interrupted, match="interrupted at t =") as caught:
        simulator.run(from_tick(tick, lambda: throw(KeyboardInterrupt())), 1.0)
    run = caught.value.run
    assert run.ending == "interrupted"
    assert not run.fell
    assert len(run) == tick


def test_interrupt_in_the_physics_keeps_the_log(robot, monkeypatch):
    simulator, _ = standing(robot)
    advance, calls = simulator.advance, []

    def interrupted(command, pushes=(), *, steps=1):
        calls.append(steps)
        if len(calls) == 5:
            raise KeyboardInterrupt
        advance(command, steps=steps)

    monkeypatch.setattr(simulator, "advance", interrupted)
    with pytest.raises(Interrupted) as caught:
        simulator.run(from_tick(0, idle), 1.0)
    run = caught.value.run
    assert run.ending == "interrupted"
    assert len(run) == 5


@pytest.mark.parametrize("tick", [0, 5])
def test_failing_controller_hands_over_the_log(robot, tick):
    simulator, _ = standing(robot)
    with pytest.raises(ControlError, match="out of ideas") as caught:
        simulator.run(from_tick(tick, lambda: throw(ZeroDivisionError("out of ideas"))), 1.0)
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert caught.value.time == pytest.approx(tick * 1e-3)
    assert len(caught.value.run) == tick
    assert "out of ideas" in caught.value.run.ending


GARBAGE = {
    "nothing": lambda: None,
    "a number": lambda: 3.0,
    "an array": lambda: np.zeros(6),
    "short torque": lambda: Command(np.zeros(5), np.zeros((2, 3))),
    "scalar torque": lambda: Command(np.zeros(()), np.zeros((2, 3))),
    "flat thrust": lambda: Command(np.zeros(6), np.zeros(6)),
    "one thrust": lambda: Command(np.zeros(6), np.zeros((1, 3))),
    "NaN torque": lambda: Command(np.array([0, 0, 0, np.nan, 0, 0]), np.zeros((2, 3))),
    "infinite thrust": lambda: Command(np.zeros(6), np.array([[0, 0, np.inf], [0, 0, -np.inf]])),
    "words": lambda: Command("left", "right"),
    "None inside": lambda: Command(None, np.zeros((2, 3))),
    "objects": lambda: Command(np.array([None] * 6), np.zeros((2, 3))),
    "ragged list": lambda: Command([0.0] * 6, [[0.0] * 3, [0.0] * 2]),
}


@pytest.mark.parametrize("tick", [0, 5])
@pytest.mark.parametrize("kind", GARBAGE)
def test_garbage_is_a_control_error(robot, kind, tick):
    simulator, _ = standing(robot)
    with pytest.raises(ControlError) as caught:
        simulator.run(from_tick(tick, GARBAGE[kind]), 0.02)
    assert len(caught.value.run) == tick
    assert caught.value.time == pytest.approx(tick * 1e-3)


def test_object_without_step(robot):
    simulator, _ = standing(robot)
    with pytest.raises((ControlError, InputError)):
        simulator.run(SimpleNamespace(), 0.02)


def telemetry(values):
    script = from_tick(0, idle)
    script.telemetry = lambda: values[min(script.tick, len(values) - 1)]
    return script


@pytest.mark.parametrize(
    "values",
    [
        [{"a": 1.0}, {"a": 1.0}, {"b": 1.0}],
        [{"a": 1.0}, {"a": 1.0}, {}],
        [{"a": np.zeros(3)}, {"a": np.zeros(3)}, {"a": np.zeros(4)}],
        [{"a": 1.0}, {"a": 1.0}, {"a": "text"}],
        [{"a": 1.0}, {"a": 1.0}, None],
    ],
    ids=["new name", "missing", "shape", "text", "none"],
)
def test_telemetry_that_changes_is_a_control_error_with_the_log(robot, values):
    """A fault of the controller like any other: the log up to then must survive it."""
    simulator, _ = standing(robot)
    with pytest.raises(ControlError) as caught:
        simulator.run(telemetry(values), 0.02)
    assert len(caught.value.run) == 2


def test_telemetry_is_logged(robot):
    simulator, _ = standing(robot)
    script = telemetry([{"gain": 0.5, "row": [1.0, 2.0], "flag": True}])
    script.describe = lambda: {"tuned": "by hand"}
    run = simulator.run(script, 0.01)
    np.testing.assert_array_equal(run["row"], [[1.0, 2.0]] * 10)
    assert run["flag"].dtype == bool
    assert run.metadata["parameters"] == {"tuned": "by hand"}


def test_telemetry_cannot_overwrite_the_state(robot):
    """A signal of the controller named like one of the simulator's is refused, not silently swapped in."""
    simulator, _ = standing(robot)
    with pytest.raises((ControlError, InputError)):
        simulator.run(telemetry([{"q": np.zeros(13)}]), 0.02)


def test_telemetry_keeps_fractions_after_a_whole_first_value(robot):
    simulator, _ = standing(robot)
    run = simulator.run(telemetry([{"gain": 1}, {"gain": 2.5}]), 0.003)
    np.testing.assert_array_equal(run["gain"], [1.0, 2.5, 2.5])


def test_low_start_is_not_a_fall(sled):
    """A robot whose origin rests in the ground (height ≤ 0) has not fallen by standing still."""
    simulator = Simulator(sled)
    q = pin.neutral(sled.model)
    q[2] = -simulator.static_penetration
    simulator.reset(q, np.zeros(6))
    run = simulator.run(Script(lambda tick, state: NO_COMMAND), 0.05)
    assert run.ending == "completed"


# --- Refusing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("duration", [float("nan"), float("inf"), 0.0, -1.0, "long", None])
def test_bad_duration(robot, duration):
    simulator, _ = standing(robot)
    with pytest.raises(InputError, match="duration"):
        simulator.run(from_tick(0, idle), duration)


@pytest.mark.parametrize("period", [float("nan"), 0.0, -1e-3, 1e-4, 7e-4, 1.3e-3, "often"])
def test_bad_control_period(robot, period):
    simulator, _ = standing(robot)
    with pytest.raises(InputError, match="control_period"):
        simulator.run(from_tick(0, idle), 0.1, control_period=period)
    with pytest.raises(InputError, match="control_period"):
        simulator.run(Script(lambda tick, state: idle(), period=period), 0.1)


@pytest.mark.parametrize("dt", [0.0, -1e-3, float("nan"), float("inf"), "small"])
def test_bad_step(robot, dt):
    with pytest.raises(InputError, match="dt"):
        Simulator(robot, dt=dt)


@pytest.mark.parametrize("gravity", [9.81, [0, 0], [0, 0, float("nan")], "down"])
def test_bad_gravity(robot, gravity):
    with pytest.raises(InputError, match="gravity"):
        Simulator(robot, gravity=gravity)


def test_robot_without_feet_falls_through_the_ground(robot):
    simulator = Simulator(hp.load_robot(robot.urdf, feet=()), dt=1e-3)
    q = pin.neutral(robot.model)
    simulator.reset(q, np.zeros(12))
    simulator.advance(Command(np.zeros(6), np.zeros((0, 3))), steps=100)
    centre = pin.centerOfMass(robot.model, robot.model.createData(), simulator.q)
    start = pin.centerOfMass(robot.model, robot.model.createData(), q)
    np.testing.assert_allclose(centre - start, (0.0, 0.0, -0.5 * 9.81 * 0.1 * 0.101), atol=1e-6)
    assert simulator.state.foot_force.shape == (0, 3)
    assert simulator.static_penetration == 0.0


def test_bad_reset(robot):
    simulator = Simulator(robot)
    good_q, good_v = pin.neutral(robot.model), np.zeros(12)
    for q, v, t in (
        (good_q[:-1], good_v, 0.0),
        (good_q, good_v[:-1], 0.0),
        (good_q * np.nan, good_v, 0.0),
        (good_q, good_v + np.inf, 0.0),
        (good_q, good_v, float("nan")),
        (np.zeros(13), good_v, 0.0),  # a quaternion of zeros cannot be normalised
    ):
        with pytest.raises(InputError):
            simulator.reset(q, v, t=t)


def test_reset_normalises_the_quaternion(robot):
    simulator = Simulator(robot)
    q = pin.neutral(robot.model)
    q[3:7] = [0.0, 0.0, 3.0, 4.0]
    simulator.reset(q, np.zeros(12))
    np.testing.assert_allclose(simulator.q[3:7], [0, 0, 0.6, 0.8], atol=1e-15)
