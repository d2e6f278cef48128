"""Walks of any robot, and what is measured of them."""

import numpy as np

import harpy_pin as hp


def walk(gait, *, mu=0.6, duration=3.0, plant="compliant", terrain=None, pushes=(), on_tick=None, **disturbances):
    """A walk on ground into which the robot sinks by 2 mm; pushes are (time, velocity that they would give)."""
    mass = gait.robot.mass
    shoves = tuple(hp.Push(t, tuple(mass * np.array(velocity))) for t, velocity in pushes)
    scenario = hp.Scenario(
        controller=hp.Condensed(),
        ground=hp.Ground(mu_s=mu, stiffness=mass * 9.81 / 2e-3, terrain=terrain),
        duration=duration,
        plant=plant,
        disturbances=hp.Disturbances(pushes=shoves, **disturbances),
    )
    return hp.walk(scenario, gait=gait, on_tick=on_tick)


def slip_per_step(run):
    """Path of all feet along the ground, mm per step."""
    return 1e3 * run["slip_path"][-1].sum() / max(run["steps"][-1], 1)


def path_error(run):
    """Root mean square distance of the centre of mass from the path, m."""
    return np.sqrt(np.mean(np.sum((run["centre"][:, :2] - run["path"][:, :2]) ** 2, axis=1)))


def made_state(gait, *, force=0.0, height=0.0):
    """The posture with a force on every foot, N, and the body higher than it stands, m."""
    q, v = gait.initial_state()
    q[2] += height
    feet = np.zeros((len(gait.robot.feet), 3))
    load = feet.copy()
    load[:, 2] = force
    return hp.State(0.0, q, v, feet, feet, load)
