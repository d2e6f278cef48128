"""How runs end, what they log, and what a simulator refuses."""

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from scripted import NO_COMMAND, Script, idle, standing

import harpy_pin as hp
from harpy_pin import Command, ControlError, InputError, Interrupted, Simulator


def from_tick(first, function):
    """Idle before a tick, the function from then on."""
    return Script(lambda tick, state: function() if tick >= first else idle())


def throw(error):
    raise error


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
        [{}, {}, {"q": np.zeros(13)}],
    ],
    ids=["new name", "missing", "shape", "text", "none", "a name of the log"],
)
def test_telemetry_that_changes_is_a_control_error_with_the_log(robot, values):
    """A fault of the controller like any other: the log up to then must survive it."""
    simulator, _ = standing(robot)
    with pytest.raises(ControlError) as caught:
        simulator.run(telemetry(values), 0.02)
    assert len(caught.value.run) == 2


def test_telemetry_is_logged(robot):
    simulator, _ = standing(robot)
    script = telemetry(
        [
            {"gain": 1, "row": [1.0, 2.0], "flag": True},
            {"gain": 2.5, "row": [1.0, 2.0], "flag": False},
        ]
    )
    script.describe = lambda: {"tuned": "by hand"}
    run = simulator.run(script, 0.01)
    np.testing.assert_array_equal(run["row"], [[1.0, 2.0]] * 10)
    assert run["flag"].dtype == bool
    assert run["gain"].tolist() == [1.0, *9 * [2.5]]
    assert run.metadata["parameters"] == {"tuned": "by hand"}


def test_low_start_is_not_a_fall(sled):
    """A robot whose origin rests in the ground (height ≤ 0) has not fallen by standing still."""
    simulator = Simulator(sled)
    q = pin.neutral(sled.model)
    q[2] = -simulator.static_penetration
    simulator.reset(q, np.zeros(6))
    run = simulator.run(Script(lambda tick, state: NO_COMMAND), 0.05)
    assert run.ending == "completed"


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("duration", [float("nan"), float("inf"), 0.0, -1.0, "long", None]),
        ("control_period", [float("nan"), 0.0, -1e-3, 1e-4, 7e-4, 1.3e-3, "often"]),
        ("dt", [0.0, -1e-3, float("nan"), float("inf"), "small"]),
        ("gravity", [9.81, [0, 0], [0, 0, float("nan")], "down"]),
    ],
)
def test_bad_settings_are_named(robot, name, values):
    simulator, _ = standing(robot)

    def use(duration=0.1, control_period=None, **plant):
        Simulator(robot, **plant)
        simulator.run(from_tick(0, idle), duration, control_period=control_period)

    for value in values:
        with pytest.raises(InputError, match=name):
            use(**{name: value})
    with pytest.raises(InputError, match="control_period"):
        simulator.run(Script(lambda tick, state: idle(), period=7e-4), 0.1)
    with pytest.raises((ControlError, InputError)):
        simulator.run(SimpleNamespace(), 0.02)


def test_robot_without_feet_falls_through_the_ground(robot):
    simulator = Simulator(hp.load_robot(robot.urdf, feet=()), dt=1e-3)
    q = pin.neutral(robot.model)
    # no joint is at its end
    q[7:] = 0.5 * (robot.model.lowerPositionLimit + robot.model.upperPositionLimit)[7:]
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
    simulator.reset([*good_q[:3], 0.0, 0.0, 3.0, 4.0, *good_q[7:]], good_v)
    np.testing.assert_allclose(simulator.q[3:7], [0, 0, 0.6, 0.8], atol=1e-15)  # normalised
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
