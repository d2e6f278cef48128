"""Walks of a few ticks, one log each in a folder: in whatever way $HARPY_PIN_KERNELS says."""

import sys
from pathlib import Path

import numpy as np

import harpy_pin as hp
from harpy_pin.scenario import Commanded, Condensed, Disturbances, Governed, Scenario, WholeBody, build

folder, ticks, names = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
PUSH = (hp.Push(time=0.002, impulse=(0.5, 2.0, 0.0), duration=0.01),)
COMMAND = ((0.0, 0.3, 0.0, 0.0), (0.005, 0.1, 0.05, 0.4))
DISTURBANCES = Disturbances(start_velocity=(0.3, 0.2, 0.0, 0.0, 0.0, 0.5), pushes=PUSH)
SLIPPERY = {"ground": hp.Ground(mu_s=0.1), "disturbances": DISTURBANCES}
SCENARIOS = {
    "condensed": Scenario(controller="condensed", **SLIPPERY),
    "condensed, friction estimated": Scenario(controller=Condensed(parameters={"estimate_friction": True}), **SLIPPERY),
    "condensed, commanded": Scenario(controller="condensed", gait=Commanded(velocity=COMMAND), **SLIPPERY),
    "QP": Scenario(controller="wbc", **SLIPPERY),
    "QP, full": Scenario(controller=WholeBody(parameters={"formulation": "full"}), **SLIPPERY),
    "QP, forces": Scenario(controller=WholeBody(parameters={"formulation": "contact_force"}), **SLIPPERY),
    "no governor": Scenario(controller=Governed(governor="none"), **SLIPPERY),
    "paper's governor": Scenario(controller=Governed(governor="paper"), **SLIPPERY),
    "contact-force filter": Scenario(controller=Governed(governor="filter"), **SLIPPERY),
    "MuJoCo": Scenario(controller="condensed", plant="mujoco"),
}


def standing(name):
    """A robot of the catalogue that stands or hovers under the condensed controller, pushed."""
    robot = hp.load_robot(name)
    gait = hp.Standing(robot, shift=(0.0, 0.02, 0.0)) if robot.feet else hp.Hovering(robot)
    parameters = hp.controllers.make_parameters("condensed", mu=0.5, changes=getattr(gait, "parameters", None))
    controller = hp.controllers.CondensedController(gait, parameters)
    simulator = hp.Simulator(robot)
    q, v = gait.initial_state(penetration=simulator.static_penetration)
    v[:3] = 0.1
    simulator.reset(q, v)
    return simulator.run(controller, ticks * 1e-3)


for name in names or [*SCENARIOS, "g1", "iris"]:
    if name in SCENARIOS:
        scenario = SCENARIOS[name]
        run = build(Scenario.from_dict({**scenario.to_dict(), "duration": ticks * scenario.period})).run()
    else:
        run = standing(name)
    np.savez(folder / f"{name}.npz", **{k: v for k, v in run.signals.items() if k != "tick_ns"})
