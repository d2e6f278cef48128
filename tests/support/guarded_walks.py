"""Controllers and governors by name, and what is given to them."""

import numpy as np

import harpy_pin as hp
from harpy_pin.controllers.named_controllers import GOVERNORS, make_controller, make_governor
from harpy_pin.governors import ForceRows, StackedRows
from reproduction.margin import MarginGovernor

CONTROLLERS = {
    **{name: ("governed", {"governor": name}) for name in GOVERNORS},
    "wbc": ("wbc", {"solver": "active_set"}),
    "wbc, full": ("wbc", {"solver": "active_set", "formulation": "full"}),
    "condensed": ("condensed", {}),
}
NAMES = ("none", "paper", "filter", "wbc")
REFERENCE = ("paper", "paper, tracked", "margin", "own rows")
X = np.array([0.0, 0.0, 0.6, 0.3, 0.0, 0.0, 0.02, 0.0, 0.0])
X_R = np.array([0.01, 0.0, 0.6, 0.3, 0.0, 0.0])


class Row:
    """A row given as a function of x and w that returns h and its Jacobian."""

    names = ("forward speed",)

    def __init__(self, function):
        self.function = function

    def evaluate(self, x, w, h, jacobian):
        h[0], jacobian[0] = self.function(x, w)


def controller_of(name, gait):
    kind, options = CONTROLLERS[name]
    return make_controller(kind, gait, mu=0.25, **options)


def governor_of(name, robot):
    if name == "own rows":
        return hp.ExplicitReferenceGovernor(
            StackedRows(
                [
                    ForceRows(mass=robot.mass, mu=0.25),
                    Row(lambda x, w: (0.4 - w[3], (0, 0, 0, -1, 0, 0))),
                ]
            )
        )
    if name == "margin":
        return MarginGovernor(mass=4.6, mu=0.25, k_p=100.0, k_d=20.0)
    kind, _, evaluate_at = name.partition(", ")
    return make_governor(kind, robot, mu=0.25, evaluate_at=evaluate_at or "measured")


def command_of(robot, torque=1.0, thrust=10.0):
    return hp.Command(
        np.full(len(robot.joints), torque), np.full((len(robot.thrusters), 3), thrust)
    )


def equal(a, b):
    return np.array_equal(a.torque, b.torque) and np.array_equal(a.thrust, b.thrust)


def copy(command):
    return hp.Command(command.torque.copy(), command.thrust.copy())
