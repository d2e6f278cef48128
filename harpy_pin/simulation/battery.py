"""A battery behind thrusters and motors: its voltage falls with charge and current, and with it the largest thrust.

**Voltage.** With the charge s, a share of the capacity, a lithium-polymer cell has the open-circuit voltage

    U₀(s) = −1.031 e^(−35 s) + 3.685 + 0.2156 s − 0.1178 s² + 0.3201 s³

(Chen & Rincón-Mora, *Accurate electrical battery model capable of predicting runtime and I–V performance*, IEEE
Transactions on Energy Conversion 21(2), 2006; their resistance and capacitances of a small cell are left out). Under
the power P the current I solves P = (n U₀ − R I) I. More than (n U₀)²/(4 R) is not to be had. An empty battery has no
voltage.

**Thrust.** At full throttle the speed of a fan is proportional to its voltage, as long as losses in the winding are
small, and by momentum theory the thrust of a disk at rest is proportional to the speed squared. So the largest thrust
is that at full charge times (U/U_full)². Torques of the joints do not fall: their motors are far from full voltage.

Chemical power is that of shafts and joints, and heat, in every step: see :data:`ENERGIES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.log.power import Motors, Propulsion
from harpy_pin.model.record import Record, RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.simulation.actuators import MotorsRecord
    from harpy_pin.simulation.thrusters import ThrustersRecord

__all__ = ["ENERGIES", "Battery"]

ENERGIES = ("chemical", "missing", "inner heat", "thrust shaft", "thrust heat", "joint mechanical", "joint heat")
"""Of a plant's battery since its reset, J: the sum of the first two is that of the others.

``missing`` is what was drawn beyond what can be had: zero where the battery suffices."""
MAX_CELLS = 1000


@dataclass(frozen=True, kw_only=True)
class Battery:
    """Lithium-polymer cells in series, and what draws on them.

    Attributes:
        cells: how many.
        capacity: A·h.
        resistance: inner, of all cells together, Ω.
        charge: at the start, as a share of the capacity.
        propulsion: power of each thruster, also as a mapping.
        motors: of the joints, also as a mapping; None: they take nothing.

    Raises:
        InputError: a value out of its domain.
    """

    cells: int = 6
    capacity: float = 5.0
    resistance: float = 0.03
    charge: float = 1.0
    propulsion: Propulsion = field(default_factory=lambda: Propulsion(thrust=18.0, power=1000.0))
    motors: Motors | None = None

    def __post_init__(self) -> None:
        motors = None if self.motors is None else read_part("battery's motors", self.motors, Motors)
        checks.keep(
            self,
            cells=checks.whole("battery's cells", self.cells, low=1, high=MAX_CELLS),
            capacity=checks.number("battery's capacity", self.capacity, low=0.0, strict=True),
            resistance=checks.number("battery's resistance", self.resistance, low=0.0),
            charge=checks.number("battery's charge", self.charge, low=0.0, high=1.0),
            propulsion=read_part("battery's propulsion", self.propulsion, Propulsion),
            motors=motors,
        )


def read_part(name: str, value: Any, kind: type[Any]) -> Any:
    """A part of a setting, from itself or from a mapping of its attributes.

    Raises:
        InputError: unknown names, or values out of their domains.
    """
    if not isinstance(value, Mapping):
        return checks.instance(name, value, kind)
    for given in value:
        checks.one_of(f"setting of {name}", given, [entry.name for entry in fields(kind)])
    return kind(**value)


class BatteryRecord(RecordOf):
    """The battery.

    Attributes:
        on: 0 where there is none.
        cells: in series.
        capacity: C.
        resistance: Ω.
        full_voltage: at full charge without current, V.
        thrust_power: of a thruster at 1 N, W.
        efficiency: of its motor and controller.
        copper: heat of a joint's motor at 1 N·m, W.
        lost: share of the power of braking joints that is heat.
        charge: share of the capacity.
        voltage: at the terminals in the last step, V.
        energy: (7,) :data:`ENERGIES`, J.
    """

    on: int
    cells: float
    capacity: float
    resistance: float
    full_voltage: float
    thrust_power: float
    efficiency: float
    copper: float
    lost: float
    charge: float
    voltage: float
    energy: Vector = sized(7)


def battery_record(battery: Battery | None) -> Records[BatteryRecord]:
    """The battery, for kernels."""
    b = Battery() if battery is None else battery
    motors = b.motors
    record = make_record(
        BatteryRecord,
        on=np.int64(battery is not None),
        cells=float(b.cells),
        capacity=3600.0 * b.capacity,
        resistance=b.resistance,
        full_voltage=0.0,
        thrust_power=float(b.propulsion.electrical(np.ones(1))[0]),
        efficiency=b.propulsion.efficiency,
        copper=0.0 if motors is None else motors.constant**-2,
        lost=0.0 if motors is None else 1.0 - motors.recovered,
        charge=1.0,
        voltage=0.0,
    )
    record["full_voltage"] = open_voltage(record[0])
    reset_battery(record, battery)
    return record


def reset_battery(record: Record, battery: Battery | None) -> None:
    """Charge it as at the start."""
    record["charge"] = 1.0 if battery is None else battery.charge
    record["energy"] = 0.0
    record["voltage"] = open_voltage(record[0])


@kernel
def open_voltage(b: BatteryRecord) -> float:
    """Voltage without current, V."""
    s = b.charge
    if s <= 0.0:
        return 0.0
    volts: float = b.cells * (-1.031 * np.exp(-35.0 * s) + 3.685 + s * (0.2156 + s * (-0.1178 + s * 0.3201)))
    return volts


@kernel
def share_of_thrust(b: BatteryRecord) -> float:
    """Largest thrust over that at full charge."""
    return (b.voltage / b.full_voltage) ** 2 if b.on else 1.0


@kernel
def draw(b: BatteryRecord, motors: MotorsRecord, thrusters: ThrustersRecord, v: Vector, dt: float) -> None:
    """Take the power of a step.

    Args:
        b: element of the record.
        motors: with the torques of the step.
        thrusters: with its thrusts.
        v: (6 + joints,) generalised velocity.
        dt: step, s.
    """
    if not b.on:
        return
    electrical = 0.0
    count = thrusters.goal.shape[0]
    free = (thrusters.mean_thrust.shape[0] - count) // 2
    u = thrusters.mean_thrust
    for k in range(count):
        size = abs(u[2 * free + k]) if k >= free else 0.0
        if k < free:
            size = np.sqrt(u[3 * k] ** 2 + u[3 * k + 1] ** 2 + u[3 * k + 2] ** 2)
        electrical += b.thrust_power * size * np.sqrt(size)
    mechanical, heat = 0.0, 0.0
    if b.copper > 0.0:
        for j in range(motors.mean_torque.shape[0]):
            torque = motors.mean_torque[j]
            power = torque * v[6 + j]
            mechanical += power
            heat += b.copper * torque * torque + b.lost * max(-power, 0.0)
    voltage = open_voltage(b)
    wanted = electrical + mechanical + heat
    root = voltage * voltage - 4.0 * b.resistance * wanted
    # Of (U₀ − √(U₀² − 4 R P))/(2 R), in a form that holds without resistance, too.
    whole = voltage + np.sqrt(max(root, 0.0))
    current = 0.0
    if whole > 0.0:
        current = 2.0 * wanted / whole if root >= 0.0 else voltage / (2.0 * b.resistance)
    b.voltage = voltage - b.resistance * current
    b.charge -= current * dt / b.capacity
    b.energy[0] += voltage * current * dt
    b.energy[1] += (wanted - b.voltage * current) * dt
    b.energy[2] += b.resistance * current * current * dt
    b.energy[3] += b.efficiency * electrical * dt
    b.energy[4] += (1.0 - b.efficiency) * electrical * dt
    b.energy[5] += mechanical * dt
    b.energy[6] += heat * dt


@kernel
def draw_power(
    b: Records[BatteryRecord], motors: Records[MotorsRecord], thrusters: Records[ThrustersRecord], v: Vector, dt: float
) -> None:
    """:func:`draw`, and the share of the largest thrust that is left, for plants of other engines."""
    draw(b[0], motors[0], thrusters[0], v, dt)
    thrusters[0].available = share_of_thrust(b[0])
