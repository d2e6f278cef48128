"""The commands ``harpy identify`` and ``harpy excite``: joints from a log, and the motion that such
a log needs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

import harpy_pin as hp
from harpy_pin.cli.output import console, say_next
from harpy_pin.cli.walk_options import ROBOTS, FeetOption, read_robot_options
from harpy_pin.errors import RunFileError, reason
from harpy_pin.files import check_outputs, replacing

RobotOption = Annotated[str, typer.Option("--robot", help=ROBOTS)]


def identify(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG.npz", help="Arrays t, q, torque; see docs/identification.md."),
    ],
    robot: RobotOption = "harpy",
    feet: FeetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE.json", help="What was found, for load_robot(..., joints=)."
        ),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Predicted beside measured torque: .png, .pdf or .svg."),
    ] = None,
) -> None:
    """Identify armature, damping, dry friction, bias and delay of each joint from a log.

    A number in brackets is not known within a tenth, and a dash is not known at all.

    \b
    harpy excite --robot go2 --out motion.npz
    harpy identify log.npz --robot go2 --out go2_joints.json --figure torques.png
    """
    check_outputs({"--out": out, "--figure": figure}, inputs={"LOG": log})
    known = _robot(robot, feet)
    found = hp.identify(known, _read(log))
    columns = {
        "torque_scale": 1.0,
        "bias": 1.0,
        "armature": 1.0,
        "damping": 1.0,
        "friction": 1.0,
        "delay": 1e3,
    }
    table = Table(
        "joint",
        "scale",
        "bias N·m",
        "armature kg·m²",
        "damping N·m·s/rad",
        "friction N·m",
        "delay ms",
    )
    for k, name in enumerate(found.names):
        cells = []
        for number, unit in columns.items():
            value = unit * float(getattr(found, number)[k])
            text = f"{value:.3g}" if found.excited[number][k] else f"({value:.2g})"
            cells.append("–" if np.isnan(value) else text)
        table.add_row(name, *cells)
    console.print(table)
    if found.payload is not None and found.payload_error is not None:
        console.print(
            f"on the base: {found.payload[0]:.2f} kg, standard error {found.payload_error[0]:.2f} kg"
        )
    for line in found.status:
        console.print(f"log: {line}", soft_wrap=True)
    if out is not None:
        found.save(out)
        console.print(f"wrote {out}")
    if figure is not None:
        with replacing(figure) as file:
            found.figure().savefig(file, format=figure.suffix[1:].lower())
        console.print(f"wrote {figure}")
    say_next(
        f'hp.load_robot({robot!r}, joints="{out}")'
        if out
        else f"harpy identify {log} --robot {robot} --out joints.json"
    )


def excite(
    robot: RobotOption = "harpy",
    feet: FeetOption = None,
    duration: Annotated[float, typer.Option(help="s.")] = 60.0,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.npz", help="Arrays t, q, v, torque, k_p, k_d.")
    ] = Path("motion.npz"),
) -> None:
    """Write a motion that makes the joints of a robot observable that hangs by its base."""
    check_outputs({"--out": out})
    plan = hp.excitation(_robot(robot, feet), duration=duration)
    with replacing(out) as file:
        np.savez(
            file, **{name: getattr(plan, name) for name in ("t", "q", "v", "torque", "k_p", "k_d")}
        )
    console.print(f"wrote {out}: {len(plan.t)} rows, condition {plan.condition:.1f}")
    say_next(f"harpy identify LOG.npz --robot {robot}")


def _robot(name: str, feet: str | None) -> Any:
    from harpy_pin.model.source import loaded_robot

    return loaded_robot(read_robot_options(name, feet, None))


def _read(path: Path) -> Any:
    """A log of this library, or a file of plain arrays."""
    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files if file[name].dtype.kind in "fiu"}
    except (OSError, ValueError) as error:
        raise RunFileError(f"cannot read '{path}': {reason(error)}", path=path) from error
    return arrays if "foot_position" not in arrays else hp.Run.load(path)
