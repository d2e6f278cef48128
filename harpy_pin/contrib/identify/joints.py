"""What a log says of joints, and how it is written down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.regression import NUMBERS
from harpy_pin.files import write_json
from harpy_pin.model.robot import KnownJoints
from harpy_pin.model.state import Vector

SHOWN = 5.0  # seconds of the log that are drawn


@dataclass(frozen=True, eq=False, repr=False)
class Joints(KnownJoints):
    """What a log says of joints: the torque at a joint is

        torque_scale · τ(t − delay) + bias − armature · a − damping · v − friction · sign(v),

    with τ what the log has as torque. A number is NaN where the log does not say it within a fifth,
    by three standard errors. Only ``excited`` ones are known well.

    Attributes:
        names: of the joints.
        torque_scale: (joints,) true torque over the log's.
        bias: (joints,) N·m.
        armature: (joints,) kg·m².
        damping: (joints,) N·m·s/rad.
        friction: (joints,) dry friction, N·m.
        delay: (joints,) of torques, or of the motors' targets, behind positions, s. A command that
            is held for a period comes half a period later.
        error: standard errors of each, (joints,) by these names.
        excited: (joints,) by these names, whether the log excites a number enough to know it within
            a tenth.
        left: (joints,) rms of the torque that is not explained, as a share of the log's.
        payload: (4,) mass on the base, kg, and mass times place in the base's axes, kg·m, beyond
            the model's, and (4,) standard errors; None for a robot that hangs by its base, whose
            joints do not feel it, or has thrusters.
        status: what is wrong with the log, a line each; empty where nothing is.
        rows: times, s, torques of the log, and what these numbers predict, N·m, of each joint.
    """

    torque_scale: Vector
    bias: Vector
    delay: Vector
    error: Mapping[str, Vector]
    excited: Mapping[str, NDArray[np.bool_]]
    left: Vector
    payload: tuple[Vector, Vector] | None = None
    status: tuple[str, ...] = ()
    rows: tuple[tuple[Vector, Vector, Vector], ...] = field(default=())

    def __repr__(self) -> str:
        said = "; ".join(self.status) or "nothing wrong with the log"
        return f"Joints({len(self.names)} joints, {said})"

    def as_dict(self) -> dict[str, Any]:
        """For JSON: null for what is not known."""
        joints = {
            joint: {
                **{name: float(getattr(self, name)[k]) for name in NUMBERS},
                "standard_error": {name: float(self.error[name][k]) for name in NUMBERS},
                "excited": [name for name in NUMBERS if self.excited[name][k]],
                "left": float(self.left[k]),
            }
            for k, joint in enumerate(self.names)
        }
        found: dict[str, Any] = {"joints": joints, "status": list(self.status)}
        if self.payload is not None:
            value, error = (part.tolist() for part in self.payload)
            found["payload"] = {"value": value, "standard_error": error}
        return found

    @checked
    def save(self, path: str | Path) -> None:
        """Write :meth:`as_dict`, which ``load_robot(..., joints=path)`` reads.

        Raises:
            RunFileError: the file cannot be written.
        """
        write_json(path, self.as_dict())

    def figure(self) -> Any:
        """Torques of the log beside what the numbers predict, a panel a joint.

        A ``matplotlib.figure.Figure``.
        """
        from matplotlib.figure import Figure

        wide = min(len(self.rows), 4)
        high = -(-len(self.rows) // wide)
        figure = Figure(figsize=(2.6 * wide, 1.6 * high), layout="constrained")
        for k, (t, known, predicted) in enumerate(self.rows):
            panel = figure.add_subplot(high, wide, k + 1)
            part = t < t[0] + SHOWN if len(t) else slice(0)
            panel.plot(t[part], known[part], ".", ms=2.0, color="#0b3c5d", label="log")
            panel.plot(t[part], predicted[part], ".", ms=1.0, color="#c8553d", label="predicted")
            panel.set_title(f"{self.names[k]}, {100.0 * self.left[k]:.1f} % left", fontsize=7)
            panel.tick_params(labelsize=6)
        figure.axes[0].legend(fontsize=6, frameon=False)
        figure.supxlabel("s", fontsize=7)
        figure.supylabel("N·m", fontsize=7)
        return figure
