"""Planners for tests: a trot without any optimisation, and what may go wrong with one."""

import numpy as np
import pinocchio as pin

import harpy_pin as hp

N, DT, STEP = 16, 0.02, 0.25  # intervals and their length, s; duration of a step, s
PAIR = np.array([0, 1, 1, 0])  # feet that step together
RELAX = 0.3  # time in which the body comes to the velocity that is wanted, s


class Trot:
    """The body goes on as it does and comes to what is wanted; feet land below the hips."""

    def __init__(self, robot: hp.Robot, velocity: tuple[float, float]) -> None:
        dynamics, (q, v) = hp.Dynamics(robot), hp.Standing(robot).initial_state()
        dynamics.update(q, v)
        self.height, self.velocity = q[2], np.array([*velocity, 0.0])
        self.hips = dynamics.foot_position - [*dynamics.foot_position.mean(axis=0)[:2], 0.0]

    def plan(self, state: hp.State) -> hp.Plan:
        turn = pin.Quaternion(state.q[3:7]).matrix()
        place, motion = state.q[:3], turn @ state.v[:3]
        ahead = DT * np.arange(N + 1)[:, None]
        fades = np.exp(-ahead / RELAX)
        rest = np.concatenate((place[:2], [self.height])) - place
        off = motion - self.velocity
        clock = (state.t + ahead[:-1] + 1e-6) / STEP + PAIR
        contact, step = clock % 2 < 1, clock // 2
        middle = (2 * step - PAIR + 0.5) * STEP - state.t
        feet = place + middle[..., None] * self.velocity + 0.15 * off + self.hips
        feet[..., 2] = 0.0
        stays = contact[0] & (step == step[0])
        return hp.Plan(
            times=state.t + ahead[:, 0],
            position=place
            + ahead * self.velocity
            + RELAX * (1.0 - fades) * off
            + (1.0 - fades) * rest * [0, 0, 1],
            velocity=self.velocity + fades * off + fades / RELAX * rest * [0, 0, 1],
            contact=contact,
            foothold=np.where(stays[..., None], state.foot_position, feet),
        )
