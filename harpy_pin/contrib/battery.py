"""A battery behind thrusters and motors: its voltage falls with charge and current, and with it the
largest thrust.

**Voltage.** With the charge s, a share of the capacity, a lithium-polymer cell has the open-circuit
voltage

    U₀(s) = −1.031 e^(−35 s) + 3.685 + 0.2156 s − 0.1178 s² + 0.3201 s³

(Chen & Rincón-Mora, *Accurate electrical battery model capable of predicting runtime and I–V
performance*, IEEE Transactions on Energy Conversion 21(2), 2006; their resistance and capacitances
of a small cell are left out). Under the power P the current I solves P = (n U₀ − R I) I. More than
(n U₀)²/(4 R) is not to be had. An empty battery has no voltage.

**Thrust.** At full throttle the speed of a fan is proportional to its voltage, as long as losses in
the winding are small, and by momentum theory the thrust of a disk at rest is proportional to the
speed squared. So the largest thrust is that at full charge times (U/U_full)². Torques of the joints
do not fall: their motors are far from full voltage.

Chemical power is that of shafts and joints, and heat, in every step: see :data:`ENERGIES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.contrib.power import Motors
from harpy_pin.kernels import kernel
from harpy_pin.log.power import PRESETS, Propulsion
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.simulation.plant import Plant
from harpy_pin.simulation.step import PlantRecord

ENERGIES = (
    "chemical",
    "missing",
    "inner heat",
    "thrust shaft",
    "thrust heat",
    "joint mechanical",
    "joint heat",
)
"""Energies of a plant's battery since its reset, J: the sum of the first two is that of the others.

``missing`` is what was drawn beyond what can be had: zero where the battery suffices."""
MAX_CELLS = 1000
FULL = 4.1029  # voltage of a full cell without current, V


class BatteryRecord(RecordOf):
    """The battery."""

    cells: float  # in series
    capacity: float  # C
    resistance: float  # Ω
    thrust_power: float  # of a thruster at 1 N, W
    efficiency: float  # of its motor and controller
    copper: float  # heat of a joint's motor at 1 N·m, W; zero where joints take nothing
    lost: float  # share of the power of braking joints that is heat
    charge: float  # share of the capacity
    voltage: float  # at the terminals in the last step, V
    energy: Vector = sized(7)  # ENERGIES, J


@fixed_arrays("record")
class Battery(KeepsViews):
    """Lithium-polymer cells in series, to be attached to a plant; the thrusters' ``largest`` is
    that at full charge.

    Runs log ``battery_charge``, ``battery_voltage`` and ``battery_energy`` (:data:`ENERGIES`).

    Args:
        cells: how many.
        capacity: A·h.
        resistance: inner, of all cells together, Ω.
        charge: at the start, as a share of the capacity.
        propulsion: power of each thruster; a fan of 18 N from 1 kW by default.
        motors: of the joints; None: they take nothing.

    Attributes:
        record: what the kernel of a step reads and writes.

    Raises:
        InputError: a value out of its domain; when attached, the plant's thrusters have no
            ``largest``.
    """

    def __init__(
        self,
        *,
        cells: int = 6,
        capacity: float = 5.0,
        resistance: float = 0.03,
        charge: float = 1.0,
        propulsion: Propulsion = PRESETS["fan"],
        motors: Motors | None = None,
    ) -> None:
        fans = checks.instance("battery's propulsion", propulsion, Propulsion)
        if motors is not None:
            checks.instance("battery's motors", motors, Motors)
        self._charge = checks.number("battery's charge", charge, low=0.0, high=1.0)
        self.record = make_record(
            BatteryRecord,
            cells=float(checks.whole("battery's cells", cells, low=1, high=MAX_CELLS)),
            capacity=3600.0 * checks.number("battery's capacity", capacity, low=0.0, strict=True),
            resistance=checks.number("battery's resistance", resistance, low=0.0),
            thrust_power=float(fans.electrical(np.ones(1))[0]),
            efficiency=fans.efficiency,
            copper=0.0 if motors is None else motors.constant**-2,
            lost=0.0 if motors is None else 1.0 - motors.recovered,
            charge=1.0,
            voltage=0.0,
        )

    @property
    def signals(self) -> Mapping[str, NDArray[Any]]:
        """For the log, by name."""
        return {
            f"battery_{name}": field(self.record, name) for name in ("charge", "voltage", "energy")
        }

    def reset(self, plant: Plant) -> None:
        """Charge it as at the start.

        Args:
            plant: that it is attached to.
        """
        checks.instance("plant", plant, Plant)
        checks.number(
            "thrusters' largest, the thrust at full charge", plant.actuators.thrusters.largest
        )
        self.record["charge"], self.record["energy"] = self._charge, 0.0
        self.record["voltage"] = open_voltage(self.record)

    def after_step(self, plant: Plant) -> None:
        """Take the power of a step, and lower the largest thrust of the next one.

        Args:
            plant: that it is attached to.
        """
        checks.instance("plant", plant, Plant)
        draw(self.record, plant.record, plant.v, plant.dt)


@kernel
def open_voltage(b: BatteryRecord) -> float:
    """Voltage without current, V."""
    s = b.charge
    if s <= 0.0:
        return 0.0
    volts: float = b.cells * (
        -1.031 * np.exp(-35.0 * s) + 3.685 + s * (0.2156 + s * (-0.1178 + s * 0.3201))
    )
    return volts


@kernel
def draw(b: BatteryRecord, plant: PlantRecord, v: Vector, dt: float) -> None:
    """Take the power of a step of ``dt`` seconds, at whose end the velocity is v, and bound the
    next one's thrusts.
    """
    thrusters, motors = plant.thrusters, plant.motors
    u, size = thrusters.mean_thrust, np.empty(thrusters.goal.shape[0])
    free = (u.shape[0] - size.shape[0]) // 2
    size[:free] = np.sqrt(np.sum(u[: 3 * free].reshape((free, 3)) ** 2, axis=1))
    size[free:] = abs(u[3 * free :])
    electrical = np.sum(b.thrust_power * size * np.sqrt(size))
    mechanical, heat = 0.0, 0.0
    if b.copper > 0.0:
        torque = motors.mean_torque
        power = torque * v[6:]
        mechanical = np.sum(power)
        heat = np.sum(b.copper * torque * torque + b.lost * np.maximum(-power, 0.0))
    voltage = open_voltage(b)
    power_drawn = electrical + mechanical + heat
    root = voltage * voltage - 4.0 * b.resistance * power_drawn
    # Of (U₀ − √(U₀² − 4 R P))/(2 R), in a form that holds without resistance, too.
    whole = voltage + np.sqrt(max(root, 0.0))
    current = 0.0
    if whole > 0.0:
        current = 2.0 * power_drawn / whole if root >= 0.0 else voltage / (2.0 * b.resistance)
    b.voltage = voltage - b.resistance * current
    b.charge -= current * dt / b.capacity
    chemical, missing = voltage * current, power_drawn - b.voltage * current
    shaft, inside = b.efficiency * electrical, b.resistance * current * current
    powers = np.array([chemical, missing, inside, shaft, electrical - shaft, mechanical, heat])
    b.energy += powers * dt
    thrusters.available = (b.voltage / (FULL * b.cells)) ** 2
