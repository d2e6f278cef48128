"""Scenarios as files hold them, with entries replaced, removed and added: a scenario, or one line
of ours.

``--fuzz 20`` is 10,000 mappings.
"""

import numpy as np
import pytest
from hostile import outcome, spoil_mapping

import harpy_pin as hp
from harpy_pin.scenario import Commanded, Condensed, Disturbances, Governed, Scenario

MAPPINGS = 500
ICE = hp.Ground(mu_s=0.3, friction_strips=((0.01, 0.1, 0.05),))
PUSHED = Disturbances(pushes=(hp.Push(0.01, (0.0, 1.0, 0.0)),))
PARAMETERS = {"estimate_friction": True, "limits": {"faces": 6}, "weights": {"swing": 0.5}}
HONEST = (
    Scenario(
        controller=Condensed(parameters=PARAMETERS), ground=ICE, disturbances=PUSHED
    ).to_dict(),
    Scenario(controller=Governed(governor="none")).to_dict(),
    Scenario(controller="wbc", gait=Commanded()).to_dict(),
    Scenario(robot="go2").to_dict(),
)


def test_hostile_mappings(fuzz):
    rng = np.random.default_rng(1)
    made = 0
    for k in range(MAPPINGS * fuzz):
        scenario, _ = outcome(Scenario.from_dict, spoil_mapping(rng, HONEST[k % len(HONEST)]))
        if scenario is not None:
            made += 1
            assert Scenario.from_dict(scenario.to_dict()) == scenario
    assert made > 0.05 * MAPPINGS * fuzz


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({"duration": 1e-320, "period": 1e-300}, "period"),
        ({"urdf": [1]}, "urdf"),
        ({"robot": [1]}, "robot"),
        ({"disturbances": {"start_velocity": [[1, 2], 3]}}, "start_velocity"),
        ({"disturbances": {"start_velocity": [10**400] * 6}}, "start_velocity"),
        ({"gait": {"name": "commanded", "velocity": [10**400, 0, 0]}}, "velocity"),
        *(
            (
                {"robot": "go2", "gait": {"name": "walking", "velocity": velocity}},
                "row of the velocity",
            )
            for velocity in (
                [[]],
                [{}],
                [[0.0]],
                [[0.0, 0.1, 0.0, 0.0], 5],
                [[0.0, 0.1, 0.0, 0.0], {}],
            )
        ),
        ({"robot": "go2", "gait": {"name": "walking", "velocity": {"x": 1}}}, "velocity"),
        ({"plant": "a" * 10_000}, "unknown plant 'aaa"),
        ({"ground": {"mu_s": "0.3"}}, "mu_s"),
    ],
    ids=lambda value: str(value)[:50],
)
def test_are_refused_in_one_line(data, says):
    scenario, error = outcome(Scenario.from_dict, data)
    assert scenario is None
    assert says in str(error)


def test_no_parameters_are_default_ones():
    hp.walk(Scenario(robot="harpy", controller={"name": "wbc", "parameters": None}, duration=1e-3))
