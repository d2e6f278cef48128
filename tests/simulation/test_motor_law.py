"""Motors with a law of their own: joint targets, stiffness and damping in a command."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_robots
from walks import started

import harpy_pin as hp
from harpy_pin.contrib.shield import Shield
from harpy_pin.governors import ContactForceFilter
from harpy_pin.simulation.actuators import Actuators, drive_motors, motors_record
from harpy_pin.simulation.mujoco import MujocoPlant

STEP = 5e-4
STIFFNESS, DAMPING = 60.0, 1.5


class Springs:
    """Springs about the standing posture, by the motors' law or by torques that are made anew at
    each tick.
    """

    def __init__(
        self, robot: hp.Robot, *, law: bool, period: float, damping: float = DAMPING
    ) -> None:
        self.limit, self.law, self.period, self.damping = robot.torque_limit, law, period, damping
        self.posture = hp.Standing(robot).initial_state()[0][7:]

    def step(self, state: hp.State) -> hp.Command:
        if self.law:
            return hp.Command(
                np.zeros(len(self.posture)), q=self.posture, k_p=STIFFNESS, k_d=self.damping
            )
        torque = STIFFNESS * (self.posture - state.q[7:]) + self.damping * (0.0 - state.v[6:])
        return hp.Command(np.clip(torque, -self.limit, self.limit))


def stand(plant: type, **springs: object) -> hp.Run:
    robot = hp.load_robot("go2")
    world = started(plant(robot, hp.Ground(mu_s=0.6), dt=STEP), hp.Standing(robot))
    return world.run(Springs(robot, **springs), 0.5, pushes=[hp.Push(0.2, (0.0, 3.0, 0.0))])


@needs_robots
@pytest.mark.parametrize("plant", [hp.Simulator, MujocoPlant])
def test_plants_evaluate_the_law_in_every_step(plant):
    """It is what a controller gives that ticks as often as the plant steps, bit for bit."""
    law, torques = stand(plant, law=True, period=STEP), stand(plant, law=False, period=STEP)
    assert law.ending == torques.ending == "completed"
    np.testing.assert_array_equal(law["q"], torques["q"])
    np.testing.assert_array_equal(law["motor_torque"][1:], torques["torque"][:-1])
    assert hp.measure(law).joint_power_w == pytest.approx(
        hp.measure(torques).joint_power_w, rel=1e-2
    )
    assert np.ptp(law["q"][:, 1]) > 1e-3  # it was pushed
    assert law["motor_law"].shape == (len(law["t"]), 4, 12)
    assert (law["motor_law"][:, 2] == STIFFNESS).all()
    assert not law["torque"].any()


@needs_robots
def test_a_slow_controller_may_have_stiff_motors():
    """Damping that is unstable when a controller gives it every 20 ms is none in the motors."""
    law, torques = (
        stand(hp.Simulator, law=by_law, period=0.02, damping=4.0) for by_law in (True, False)
    )
    assert np.abs(law["v"][-5:]).max() < 0.5
    assert torques.ending != "completed" or np.abs(torques["v"][-5:]).max() > 5.0


def driven(law: np.ndarray, q: np.ndarray, v: np.ndarray, **motors: object) -> np.ndarray:
    record = motors_record(Actuators(), np.full(2, 8.0), **motors)
    record["law"][0], record["has_law"] = law, 1
    drive_motors(record[0], np.array([1.0, -1.0]), q, v, STEP)
    return record["mean_torque"][0]


numbers = st.floats(-3.0, 3.0)


@given(st.lists(numbers, min_size=8, max_size=8), st.lists(numbers, min_size=4, max_size=4))
def test_the_law_is_the_formula_within_the_peak_torque(law, state):
    law = np.array(law).reshape(4, 2)
    law[2:] = np.abs(law[2:])
    q, v = np.r_[np.zeros(7), state[:2]], np.r_[np.zeros(6), state[2:]]
    torque = np.array([1.0, -1.0]) + law[2] * (law[0] - q[7:]) + law[3] * (law[1] - v[6:])
    np.testing.assert_allclose(
        driven(law, q, v), np.clip(torque, -8.0, 8.0), rtol=1e-12, atol=1e-12
    )


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_a_joint_without_bounds_goes_the_short_way_round(target, angle):
    q = np.r_[np.zeros(7), np.cos(angle), np.sin(angle), 0.0]
    law = np.array([[target, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    off = np.angle(np.exp(1j * (target - angle)))
    given = driven(law, q, np.zeros(8), place=np.array([7, 9]), unbounded=np.array([1, 0]))[0] - 1.0
    assert min(abs(given - off), abs(abs(given - off) - 2.0 * np.pi)) < 1e-9


def test_a_command_for_motors():
    command = hp.Command(np.zeros(3), q=(1.0, 2.0, 3.0), v=np.ones(3), k_p=2.0, k_d=(0.1, 0.2, 0.3))
    assert command.thrust.shape == (0, 3)
    assert command.law is not None
    np.testing.assert_array_equal(command.law, [[1, 2, 3], [1, 1, 1], [2, 2, 2], [0.1, 0.2, 0.3]])
    for twin in (copy.copy(command), copy.deepcopy(command), pickle.loads(pickle.dumps(command))):
        np.testing.assert_array_equal(twin.law, command.law)
        assert not np.shares_memory(twin.law, command.law)
    assert "k_p up to 2 N·m/rad" in repr(command)
    assert hp.Command(np.zeros(3)).law is None


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"k_p": 1.0}, "needs joint targets q"),
        ({"q": np.zeros(3)}, "need a stiffness k_p or a damping k_d"),
        ({"q": np.zeros(2), "k_p": 1.0}, r"q must have shape \(3,\)"),
        ({"q": [0.0, np.nan, 0.0], "k_p": 1.0}, "q must be finite"),
        ({"q": np.zeros(3), "k_p": [1.0, -1.0, 1.0]}, "must not be negative"),
        ({"q": np.zeros(3), "k_p": 1.0, "k_d": np.ones(4)}, r"k_d must have shape \(3,\)"),
        ({"v": "fast", "k_d": 1.0}, "v must"),
    ],
)
def test_a_law_that_cannot_be_is_refused(law, message):
    with pytest.raises(hp.InputError, match=message):
        hp.Command(np.zeros(3), **law)


def test_what_corrects_torques_refuses_a_law(gait, robot):
    simulator = hp.Simulator(robot)
    simulator.reset(*gait.initial_state())
    command = hp.Command(np.zeros(6), np.zeros((2, 3)), q=np.zeros(6), k_p=1.0)
    for update in (Shield(robot, mu=0.4), ContactForceFilter(robot).update):
        with pytest.raises(hp.InputError, match="torques alone"):
            update(simulator.state, command)


def test_a_law_that_was_changed_for_the_worse_reaches_no_motor(robot):
    """A command is the controller's: what it wrote since is looked at, too."""
    simulator = hp.Simulator(robot)
    simulator.reset(*hp.make_gait(robot).initial_state())
    command = hp.Command(np.zeros(6), np.zeros((2, 3)), q=np.zeros(6), k_p=1.0)
    command.law[0, 2] = np.nan
    before = simulator.q.copy()
    with pytest.raises(hp.InputError, match=r"command.law must be finite"):
        simulator.advance(command)
    np.testing.assert_array_equal(simulator.q, before)
