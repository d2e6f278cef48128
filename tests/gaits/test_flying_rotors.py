"""A quadrotor on four legs flies and jumps by the same code as Harpy: it leans to go sideways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.gaits.flight.flying_gait import PHASES

LEGS = {"fl": (1, 1), "fr": (1, -1), "hl": (-1, 1), "hr": (-1, -1)}
WEIGHT = 1.52 * 9.81


def link(name, mass=0.0, inertia=1e-5, below=0.0):
    if mass == 0.0:
        return f'<link name="{name}"/>'
    moments = f'<inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {-below}"/><mass value="{mass}"/>{moments}</inertial></link>'
    )


def joint(name, parent, child, place, axis=None):
    turns = "" if axis is None else f'<axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="3" velocity="20"/>'
    kind = "fixed" if axis is None else "revolute"
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{turns}</joint>'


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    parts = [link("base", 1.2, 0.012)]
    for leg, (x, y) in LEGS.items():
        parts += [
            link(f"{leg}_rotor"),
            joint(f"{leg}_mount", "base", f"{leg}_rotor", f"{0.15 * x} {0.15 * y} 0.03"),
            link(f"{leg}_thigh", 0.05, 1e-4, 0.05),
            joint(f"{leg}_hip", "base", f"{leg}_thigh", f"{0.1 * x} {0.1 * y} 0", "0 1 0"),
            link(f"{leg}_side", 0.01),
            joint(f"{leg}_roll", f"{leg}_thigh", f"{leg}_side", "0 0 0", "1 0 0"),
            link(f"{leg}_shank", 0.02, 2e-5, 0.05),
            joint(f"{leg}_knee", f"{leg}_side", f"{leg}_shank", "0 0 -0.1", "0 1 0"),
            link(f"{leg}_foot"),
            joint(f"{leg}_tip", f"{leg}_shank", f"{leg}_foot", "0 0 -0.1"),
        ]
    path = tmp_path_factory.mktemp("urdf") / "quad.urdf"
    path.write_text(f'<robot name="quad">{"".join(parts)}</robot>')
    turns = dict(zip(LEGS, (1, -1, -1, 1), strict=True))
    rotors = [hp.Rotor(f"{leg}_rotor", limit=(0.0, 9.0), drag=0.02 * turn) for leg, turn in turns.items()]
    return hp.load_robot(path, feet=[f"{leg}_foot" for leg in LEGS], rotors=rotors)


def flown(robot, flight, duration):
    gait = hp.FlyingGait(hp.Standing(robot, [0.7, 0.0, -1.4] * 4), flight)
    scenario = hp.Scenario(
        ground=hp.Ground(mu_s=0.6, stiffness=4000.0),
        duration=duration,
        disturbances=hp.Disturbances(noise=hp.Noise.typical()),
    )

    def make(gait):
        return hp.make_controller("condensed", gait, mu=0.6, parameters=gait.parameters)

    return hp.walk(scenario, gait=gait, controller=make)


def test_a_rotorcraft_with_legs_flies_to_a_place_and_stands(robot):
    run = flown(robot, hp.Fly(height=0.3, forward=0.5, hover=0.5), 7.0)
    phase = run["flight_phase"].ravel()
    air, land = (np.flatnonzero(phase == PHASES.index(name)) for name in ("air", "land"))
    assert run.ending == "completed"
    assert run["foot_position"][-1].mean(axis=0)[:2] == pytest.approx((0.5, 0.0), abs=0.02)
    assert run["foot_position"][air, :, 2].min(axis=1).max() == pytest.approx(0.3, abs=0.03)
    assert 0.05 < 2.0 * np.abs(run["q"][air, 4]).max() < 0.3
    assert np.linalg.norm(run["foot_force"][land], axis=2).sum(axis=1).max() <= 2.0 * WEIGHT
    assert 2.0 * np.hypot(run["q"][-1, 3], run["q"][-1, 4]) < 0.02


def test_it_jumps(robot):
    run = flown(robot, hp.Jump(height=0.1), 3.2)
    air = np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("air"))
    assert run.ending == "completed"
    assert run["q"][air, 2].max() - run["q"][air[0], 2] == pytest.approx(0.1, abs=0.015)
    assert run["foot_position"][-1].mean(axis=0)[:2] == pytest.approx((0.0, 0.0), abs=0.02)


def test_rotors_that_do_not_carry_the_robot_are_refused(robot):
    weak = replace(robot, rotors=tuple(hp.Rotor(r.frame, limit=(0.0, 3.0), drag=r.drag) for r in robot.rotors))
    with pytest.raises(hp.InputError, match="to spare"):
        hp.FlyingGait(hp.Standing(weak, [0.7, 0.0, -1.4] * 4), hp.Jump())
