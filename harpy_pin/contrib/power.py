"""Power that the thrusters (:mod:`harpy_pin.log.power`) and motors of a run take from a battery.

The joint's mechanical power is τ q̇. A motor with the constant k_m turns (τ / k_m)² into heat. Of
the power of braking joints a share goes back into the battery; the rest is heat.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.log import optional
from harpy_pin.log.power import Propulsion
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector


@dataclass(frozen=True, kw_only=True)
class Motors(checks.Checked):
    """What the joints' motors take.

    Attributes:
        constant: k_m of every motor at the joint, after the gear, N·m/√W.
        recovered: share of the power of braking joints that the battery gets back.

    Raises:
        InputError: a value out of its domain.
    """

    constant: float = field(metadata=checks.rule(low=0.0, strict=True))
    recovered: float = checks.setting(0.0, low=0.0, high=1.0)


@dataclass(frozen=True)
class Power:
    """Powers of a run, a row for each tick, W. What the battery gives is the sum of the others.

    Attributes:
        thrust_shaft: of the thrusters' shafts, all together.
        thrust_heat: in their motors and controllers.
        joint_mechanical: τ q̇ of all joints, negative where they brake.
        joint_heat: in their motors, with the power of braking that is not recovered.
        battery: given by the battery.
        period: between ticks, s.
        weight: of the robot, N.
        path: horizontal way of the body, m.
    """

    thrust_shaft: Vector
    thrust_heat: Vector
    joint_mechanical: Vector
    joint_heat: Vector
    battery: Vector
    period: float
    weight: float
    path: float

    @property
    def watts(self) -> float:
        """Mean power of the battery, W."""
        return float(self.battery.mean())

    @property
    def energy(self) -> float:
        """Energy that the battery gave, J."""
        return float(self.battery.sum() * self.period)

    @property
    def cost_of_transport(self) -> float:
        """Energy of the battery over weight times path; NaN for a path under 0.1 m, or without
        weight.
        """
        return (
            self.energy / (self.weight * self.path)
            if self.path >= 0.1 and self.weight > 0.0
            else float("nan")
        )


@checked
def power(run: Run, *, motors: Motors, propulsion: Propulsion | None = None) -> Power:
    """Power that a run took.

    Args:
        run: any; of thrusters that lag, with the thrusts that they had.
        motors: of the joints.
        propulsion: of each thruster; None where the robot has none.

    Raises:
        InputError: the run has thrusts, and no propulsion is given.
    """
    thrust = np.linalg.norm(optional.given_thrust(run), axis=2)
    if propulsion is None:
        checks.number(
            "thrust without propulsion", float(np.max(thrust, initial=0.0)), low=0.0, high=0.0
        )
        electrical = shaft = np.zeros(len(run))
    else:
        electrical = propulsion.electrical(thrust).sum(axis=1)
        shaft = propulsion.efficiency * electrical
    torque = optional.given_torque(run)
    mechanical = torque * run["v"][:, run["v"].shape[1] - torque.shape[1] :]
    lost = (1.0 - motors.recovered) * np.maximum(-mechanical, 0.0)
    heat = ((torque / motors.constant) ** 2 + lost).sum(axis=1)
    place = run["q"][:, :2]
    return Power(
        thrust_shaft=shaft,
        thrust_heat=electrical - shaft,
        joint_mechanical=mechanical.sum(axis=1),
        joint_heat=heat,
        battery=electrical + mechanical.sum(axis=1) + heat,
        period=optional.control_period(run),
        weight=float(run.metadata["mass"]) * float(np.linalg.norm(run.metadata["gravity"])),
        path=float(np.linalg.norm(np.diff(place, axis=0), axis=1).sum()),
    )
