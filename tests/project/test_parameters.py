"""Parameters of everything: numbers out of their domain are refused by name."""

import math

import pytest

import harpy_pin as hp
from harpy_pin.controllers import GovernedParameters, JointGains, WholeBodyParameters
from harpy_pin.governors.thrust import AttitudeGains, CentreGains
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights
from reproduction.gait.planar_gait import PlanarGait

BAD = {
    hp.gaits.GaitParameters: {
        **{"speed": (math.nan, "fast"), "step_duration": (0.0, -1.0), "double_support": (-0.1, 1.0), "height": (0.0,)},
        **{"width": (-0.1,), "sway": (math.inf,), "clearance": (-0.01,), "penetration_offset": (-0.01,)},
    },
    PlanarGait: {**{"half_step": (0.0, "far"), "end_height": (math.nan,), "double_support": (0.95,)}},
    CentreGains: {"k_pt": (-1.0,), "k_dt": ((1.0, 2.0),), "k_pr": (math.nan,), "k_dr": (-0.1,)},
    AttitudeGains: {"k_p": (-1.0,)},
    JointGains: {"k_p": ((1.0, -1.0, 1.0),)},
    GovernedParameters: {"period": (0.0,)},
    WholeBodyWeights: {"body": (-1.0, 1e7), "thrust": (0.0,)},
    WholeBodyLimits: {
        **{"mu": (-0.1, 1e300, 10.1), "faces": (2, 4.5, 65), "friction_share": (0.0,), "lateral_thrust": (0.9,)},
        **{"torque_scale": (0.0, 1e7)},
    },
    WholeBodyParameters: {
        **{"solver": ("gurobi",), "formulation": ("sparse",), "swing": ((1e7, 1.0),), "contact_damping": (1e7,)},
        **{"min_normal_force": (1e7,), "max_normal_force": (1e7, 10.0), "contact_threshold": (1e7,)},
        **{"hold_ticks": (10_000,), "body": ((1.0, -2.0),)},
        **dict.fromkeys(("joint_stiffness", "joint_damping", "joint_leak"), (math.nan, math.inf, -1.0, "stiff", 1e9)),
    },
}
"""By class and argument, values that each of them refuses."""


@pytest.mark.parametrize("kind", BAD)
def test_numbers_out_of_their_domain_are_refused_by_name(kind):
    for name, values in BAD[kind].items():
        for value in values:
            with pytest.raises(hp.InputError) as caught:
                kind(**{name: value})
            assert name in str(caught.value).replace(" ", "_"), caught.value
