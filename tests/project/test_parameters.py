"""Parameters of everything: numbers out of their domain are refused by name."""

import math
import re
from dataclasses import MISSING, dataclass, field, fields
from functools import partial

import numpy as np
import pytest
from public_calls import Silent

import harpy_pin as hp
from harpy_pin import checks
from harpy_pin.contrib.battery import Battery
from harpy_pin.contrib.power import Motors
from harpy_pin.contrib.thrusters import SecondOrderThrusters
from harpy_pin.controllers import GovernedParameters, JointGains, WholeBodyParameters
from harpy_pin.controllers.parameters import FeedforwardGains
from harpy_pin.estimation import EstimatorSettings
from harpy_pin.governors import ContactForceFilterParameters, ForceRows
from harpy_pin.governors.thrust import AttitudeGains, CentreGains
from harpy_pin.ground import HeightField, Plane, Ramp, Rough, Stairs
from harpy_pin.ground.ground import MAX_STRIPS
from harpy_pin.log import Propulsion
from harpy_pin.simulation.mujoco import SoftContact
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights
from reproduction.gait.planar_gait import PlanarGait
from reproduction.margin import MarginGovernor
from reproduction.vlip_model import AngleRow
from reproduction.vlip_simulation import VlipParameters, vlip_governor, vlip_setting

ROBOT = hp.load_harpy()
PUSH = partial(hp.Push, time=0.0, impulse=(0.0, 1.0, 0.0))
FORCES = partial(ForceRows, mass=4.0, mu=0.3)
STRIPS = (
    *(
        "ice",
        5,
        (0.6, 1.2, 0.15),
        ((0.6, 1.2),),
        ((0.6, 1.2, 0.1, 0.1),),
        ((1.2, 0.6, 0.15),),
        ((0.6, 0.6, 0.15),),
    ),
    *(
        ((0.6, 1.2, -0.1),),
        ((0.6, 1.2, math.nan),),
        ((math.nan, 1.2, 0.1),),
        ((0.6, math.inf, 0.1),),
    ),
    *(((0.6, 1.2, "x"),), ((0.6, 1.2, 0.1), (1.1, 1.5, 0.2)), ((1.5, 2.0, 0.1), (0.5, 1.0, 0.2))),
    tuple((i, i + 0.5, 0.1) for i in range(MAX_STRIPS + 1)),
)
SCRIPTS = (
    "0.3 0 0",
    [(0.0, 0.3, 0.0)],
    [(0.0, 0.3, 0.0, math.nan)],
    [(0.0, 1e9, 0.0, 0.0)],
    [(-1.0, 0.3, 0.0, 0.0)],
)
HIGHER = hp.make_gait(ROBOT).initial_state()[0][7:] + 0.3 * (np.arange(6) == 1)
"""A posture with one foot higher than the other."""
TWICE = [(1.0, 0.3, 0.0, 0.0), (1.0, 0.2, 0.0, 0.0)]

BAD = {
    hp.Ground: {
        **{
            "stiffness": (0.0, -1.0),
            "damping": (-1.0,),
            "mu_s": (-0.1, math.nan, "slippery"),
            "mu_c": (-0.1,),
        },
        **{
            "mu_v": (math.inf, -1.0),
            "stribeck_velocity": (0.0,),
            "cone": ("square", None, ["circular"]),
        },
        **{"slope": (2.0, "steep"), "friction_strips": STRIPS, "stiffness_strips": STRIPS},
    },
    partial(hp.Ground, mu_s=0.2): {"mu_c": (0.3,), "friction_strips": (((0.6, 1.2, 10.1),),)},
    partial(hp.load_robot, ROBOT.urdf, feet=ROBOT.feet): {"thrust_limit": (0.0, -1.0, math.nan)},
    Plane: {"slope": (math.nan,)},
    Stairs: {"steps": (33,), "depth": (0.0,)},
    Ramp: {"length": (0.0,)},
    Rough: {"seed": (-1,)},
    HeightField: {
        "heights": (
            ((1.0,),),
            ((0.0, 1.0), (2.0,)),
            ((0.0, math.inf), (0.0, 0.0)),
            10**400,
            [[10**400, 0], [0, 0]],
        )
    },
    partial(hp.model.LegGeometry, hip=(0.0, 0.1, 0.0), offset=0.05, upper=0.3, lower=0.3): {
        **{"upper": (0.0, -0.3, math.nan), "lower": (0.0,)}
    },
    ROBOT.with_joints: dict.fromkeys(
        ("armature", "damping", "friction"),
        (-0.1, math.nan, math.inf, [0.1, 0.2], "stiff", [[0.1] * 6]),
    ),
    partial(hp.Rotor, "a"): {
        **{
            "axis": ((0.0, 0.0, 0.0), (0.0, 1.0)),
            "limit": ((2.0, 1.0), (-math.inf, 1.0), 3.0),
            "drag": (math.nan,),
        }
    },
    PUSH: {
        "time": (-0.1, math.nan),
        "impulse": ((1.0, 2.0), (1.0, 2.0, math.inf)),
        "duration": (0.0,),
    },
    hp.Noise: {"joint_velocity": (-1.0,)},
    hp.Noise.typical: {"scale": (math.nan,)},
    partial(hp.simulation.Sensors, ROBOT): {"delay": (-1, 0.5), "seed": (-1,)},
    hp.Actuators: {
        **{
            "bandwidth": (0.0,),
            "torque_share": (-1.0,),
            "coulomb_friction": (-0.1,),
            "viscous_friction": (math.nan,),
        },
        **{
            "thrusters": ({"lag": -1.0}, {"lags": 0.1}, 0.1),
            "stall_share": (0.5,),
            "no_load_share": (0.0, -1.0),
        },
    },
    hp.Thrusters: {
        **{"lag": (-1.0, math.nan), "rate": (0.0,), "least": (-1.0,), "turning_lag": (math.inf,)},
        "failing": ((0, 1.0), (-1, 1.0, 0.5), (0, -1.0, 0.5), (0, 1.0, 1.5), "soon"),
    },
    SecondOrderThrusters: {"lag": (0.0,), "damping_ratio": (0.0,)},
    hp.Disturbances: {"mass_error": (-1.0,), "delay": (-1e-3,), "seed": (-1, 0.5, True)},
    hp.Scenario: {"duration": (0.0, "1", 10**400), "dt": (math.nan,), "period": (0.0,)},
    hp.Governed: {"mu": (-0.1,)},
    hp.Straight: {"speed": (math.inf,), "stiffness": (0.0,)},
    EstimatorSettings: {"height_noise": (-1.0,)},
    hp.Imu: {"orientation": ((0.0, 1.0),), "gyroscope_density": (-1.0,)},
    partial(hp.Thrusters, least=5.0): {"largest": (4.0,)},
    SoftContact: {"solref": ((-1.0, 1.0),), "cone": ("disc",), "impratio": (0.0,)},
    hp.Mujoco: {"foot_radius": (-1.0,)},
    hp.Pinocchio: {"stiction_tolerance": (0.0, math.nan, "small")},
    partial(Propulsion, thrust=1.0, power=1.0): {
        "thrust": (0.0,),
        "power": (-1.0,),
        "efficiency": (1.1,),
    },
    partial(Motors, constant=1.0): {"constant": (0.0,), "recovered": (2.0,)},
    Battery: {
        **{
            "cells": (0,),
            "capacity": (0.0,),
            "resistance": (-1.0,),
            "charge": (1.1,),
            "propulsion": (1.0,),
        },
        **{"motors": (3.0,)},
    },
    FORCES: {
        "mass": (-1.0,),
        "mu": (math.nan,),
        "evaluate_at": ("guessed",),
        "min_normal_force": (-5.0,),
    },
    AngleRow: {"min_angle": (-0.1,)},
    partial(hp.ExplicitReferenceGovernor, AngleRow()): {
        "alpha_r": (-1.0,),
        "conditions": ("mine",),
    },
    ContactForceFilterParameters: {
        "mu": (-0.1,),
        "friction_share": (0.0,),
        "thrust": (0.0,),
        "lag": (math.nan,),
    },
    partial(ContactForceFilterParameters.robust, mu=0.2): {"friction_error": (1.5,)},
    partial(hp.ContactForceFilter, ROBOT): {"period": (0.0,)},
    partial(MarginGovernor, mass=4.0, mu=0.3, k_p=100.0): {"k_d": (0.0,)},
    partial(MarginGovernor, mass=1.0, mu=0.9, k_p=100.0, k_d=10.0): {"min_normal_force": (20.0,)},
    vlip_setting: {"name": ("mine",)},
    vlip_governor: {"name": ("mine",)},
    VlipParameters: {
        **{
            "mass": (0.0, math.nan),
            "mu": (-1.0,),
            "dt": (0.0,),
            "duration": (0.0,),
            "start": ("elsewhere",),
        },
        **{"coordinates": ("log",)},
    },
    partial(hp.gaits.CommandedGait, ROBOT): {"velocity": (*SCRIPTS, TWICE, 3.0)},
    partial(hp.WalkingGait, ROBOT): {"velocity": (3.0,), "max_speed": (0.0,), "clearance": (-0.1,)},
    partial(hp.Standing, ROBOT): {
        "posture": (np.zeros(3), np.full(6, math.nan), HIGHER),
        "shift": ((0.0, 0.0),),
        "shift_period": (0.0,),
        "penetration_offset": (-0.001,),
    },
    partial(hp.Standing(ROBOT).move, offset=np.zeros(3), t=1.0): {
        "offset": ((0.0, 0.0),),
        "t": (-1.0,),
        "duration": (0.0,),
    },
    partial(hp.PlannedGait, ROBOT, Silent()): {
        "rate": (0.0, math.inf),
        "clearance": (-1.0,),
        "executor": (3,),
    },
    partial(hp.gaits.swing, np.zeros(3), np.zeros(3), 0.1, left=0.2, apex=1.0): {
        "left": (math.nan,),
        "rise": (0.3,),
        "apex": ("high",),
        "early": (-0.1, math.nan),
        "descent": (math.inf,),
    },
    hp.make_gait(ROBOT).update: {"t": (math.nan, math.inf, -math.inf, 1e10)},
    hp.Standing(ROBOT).update: {"t": (math.nan, math.inf, 1e10)},
    hp.gaits.CommandedGait(ROBOT).update: {"t": (math.nan, math.inf, 1e10, 5000.0)},
    hp.gaits.CommandedParameters: dict.fromkeys(
        ("max_turn", "feet_apart", "frozen", "settled", "spare"), (-1.0,)
    ),
    hp.gaits.GaitParameters: {
        **{
            "speed": (math.nan, "fast"),
            "step_duration": (0.0, -1.0),
            "double_support": (-0.1, 1.0),
            "height": (0.0,),
        },
        **{
            "width": (-0.1,),
            "sway": (math.inf,),
            "clearance": (-0.01,),
            "penetration_offset": (-0.01,),
        },
    },
    PlanarGait: {
        **{"half_step": (0.0, "far"), "end_height": (math.nan,), "double_support": (0.95,)}
    },
    CentreGains: {"k_pt": (-1.0,), "k_dt": ((1.0, 2.0),), "k_pr": (math.nan,), "k_dr": (-0.1,)},
    AttitudeGains: {"k_p": (-1.0,)},
    JointGains: {"k_p": ((1.0, -1.0, 1.0),)},
    GovernedParameters: {"period": (0.0,), "legs": ("stiff",)},
    FeedforwardGains: {"swing_p": ((-1.0, 0.0, 0.0),)},
    partial(WholeBodyWeights.for_robot, ROBOT): {"body": (-1.0, 1e7), "thrust": (0.0,)},
    WholeBodyLimits: {
        **{
            "mu": (-0.1, 1e300, 10.1),
            "faces": (2, 4.5, 65),
            "friction_share": (0.0,),
            "lateral_thrust": (0.9,),
        },
        **{"torque_scale": (0.0, 1e7)},
    },
    partial(WholeBodyParameters.for_gait, hp.make_gait(ROBOT)): {
        **{
            "solver": ("gurobi",),
            "formulation": ("sparse",),
            "swing": ((1e7, 1.0),),
            "contact_damping": (1e7,),
        },
        **{
            "min_normal_force": (1e7,),
            "max_normal_force": (1e7, 10.0),
            "contact_threshold": (1e7,),
        },
        **{"hold_ticks": (10_000,), "body": ((1.0, -2.0),), "thrust_lag": (-0.1, math.nan, 1e9)},
        **dict.fromkeys(
            ("joint_stiffness", "joint_damping", "joint_leak"),
            (math.nan, math.inf, -1.0, "stiff", 1e9),
        ),
    },
}
"""By class and argument, values that each of them refuses."""
WORDS = {
    "friction_strips": "strip",
    "stiffness_strips": "strip",
    "limit": "limit|thrust_of_rotor",
    "scale": "noise",
}
WORDS |= {
    "min_normal_force": "normal_force",
    "name": "governor",
    "legs": "leg_control_law",
    "t": "time|t_must",
    "heights": "height",
}
WORDS |= dict.fromkeys(("upper", "lower"), "link")
"""What a message says instead of an argument."""


@pytest.mark.parametrize("kind", BAD)
def test_numbers_out_of_their_domain_are_refused_by_name(kind):
    for name, values in BAD[kind].items():
        for value in values:
            with pytest.raises(hp.InputError) as caught:
                kind(**{name: value})
            assert re.search(WORDS.get(name, name), str(caught.value).replace(" ", "_")), (
                caught.value
            )


def test_settings_keep_what_their_check_makes_of_them():
    """Also those of a subclass; None where it is the default, and only there."""

    @dataclass(frozen=True)
    class Wheel(checks.Checked):
        whose = "wheel's "
        radius: float = field(metadata=checks.rule(low=0.0, strict=True))
        width: float | None = checks.setting(None, low=0.0, called="width of the tyre")
        axis: tuple[float, ...] = checks.setting((0, 1, 0), lambda name, value: tuple(value))

    @dataclass(frozen=True)
    class Hub(Wheel):
        spokes: int = checks.setting(3, checks.whole, high=9)

    hub = Hub(radius=1, axis=[1, 0, 0])
    assert repr(hub.radius) == "1.0"
    assert (hub.width, hub.axis, hub.spokes) == (None, (1, 0, 0), 3)
    for given, says in (
        ({"radius": None}, "wheel's radius must be a number"),
        ({"radius": 1.0, "width": -1.0}, "width of the tyre must be finite and ≥ 0, got -1.0"),
        ({"radius": 1.0, "spokes": 10}, "wheel's spokes must be a whole number ≥ 0 and ≤ 9"),
    ):
        with pytest.raises(hp.InputError, match=re.escape(says)):
            Hub(**given)


def kinds_of(kind):
    return [kind, *(below for one in kind.__subclasses__() for below in kinds_of(one))]


def test_defaults_are_what_their_checks_make_of_them():
    """A default is not checked where it is taken; one of None stands for itself."""
    found = {
        (kind.__name__, entry.name): (entry.metadata["check"]("", entry.default), entry.default)
        for kind in kinds_of(checks.Checked)[1:]
        for entry in fields(kind)
        if "check" in entry.metadata and entry.default not in (None, MISSING)
    }
    assert len(found) > 300
    assert {name: pair for name, pair in found.items() if repr(pair[0]) != repr(pair[1])} == {}
