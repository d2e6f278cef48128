"""The commands ``harpy identify`` and ``harpy excite``: joints from a log, and the motion that such
a log needs.
"""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from harpy_pin.cli import walk_options as options
from harpy_pin.cli.output import console, say_next
from harpy_pin.files import check_outputs, replacing

COLUMNS = {
    "armature": ("armature", "kg·m²", 4),
    "damping": ("damping", "N·m·s", 3),
    "friction": ("friction", "N·m", 3),
    "delay": ("delay", "ms", 2),
    "torque_scale": ("scale", "", 3),
    "bias": ("offset", "N·m", 3),
}
"""What is printed of each joint: heading, unit, and digits after the point."""


def identify(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="t, q, torque: .csv, .npz or .mcap (extra: mcap).")
    ],
    robot: options.RobotOption = "go2",
    feet: options.FeetOption = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="What was found, for load_robot(..., joints=)."),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Predicted beside measured torque: .png, .pdf or .svg."),
    ] = None,
) -> None:
    """Find armature, friction and delay of each joint in a log.

    The log has t, q (or joint_position) and torque (or joint_torque), or targets and gains of the
    motors; docs/identification.md says all. A number in brackets is not known within a tenth; a
    dash is not known at all.

    \b
    harpy excite --robot go2 --out motion.npz
    harpy identify log.npz --robot go2 --out go2_joints.json --figure torques.png
    """
    check_outputs({"--out": out, "--figure": figure}, inputs={"LOG": log})
    from harpy_pin.contrib.bag import read_signals
    from harpy_pin.contrib.identify.identification import identify as identified
    from harpy_pin.model.source import loaded_robot

    known = loaded_robot(options.read_robot_options(robot, feet, None))
    found = identified(known, read_signals(log, known))
    names = [joint.removesuffix("_joint") for joint in found.names]
    wide = max(map(len, names)) + 2
    for k in range(2):
        headings = (f"{part[k]:>11}" for part in COLUMNS.values())
        console.print(" " * wide, *headings, f"{('left', '%')[k]:>5}", sep="", soft_wrap=True)
    for k, joint in enumerate(names):
        line = f"{joint:<{wide}}"
        for name, (*_, digits) in COLUMNS.items():
            value = getattr(found, name)[k] * (1e3 if name == "delay" else 1.0)
            text = f"{value:.{digits}f}" if found.excited[name][k] else f"({value:.{digits}f})"
            line += f"{'–' if np.isnan(value) else text:>11}"
        left = 100.0 * found.left[k]
        console.print(f"{line}{'–' if np.isnan(left) else f'{left:.0f}':>5}", soft_wrap=True)
    excited = sum(int(found.excited[name].sum()) for name in COLUMNS)
    many = len(COLUMNS) * len(found.names)
    console.print(f"the log excites {excited} of {many} numbers; (in brackets): not within a tenth")
    if found.payload is not None:
        mass, error = (float(part[0]) for part in found.payload)
        console.print(f"on the base: {mass:.2f} kg, standard error {error:.2f} kg")
    for line in found.status:
        console.print(f"log: {line}", soft_wrap=True)
    if out is not None:
        found.save(out)
    if figure is not None:
        with replacing(figure) as file:
            found.figure().savefig(file, format=figure.suffix[1:].lower())
    say_next(
        f"harpy identify {log} --robot {robot} --out joints.json"
        if out is None
        else f'hp.load_robot({robot!r}, joints="{out}")'
    )


def excite(
    robot: options.RobotOption = "go2",
    feet: options.FeetOption = None,
    duration: Annotated[float, typer.Option(help="s.")] = 60.0,
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="Targets and gains, a row each tick: .npz or .csv.")
    ] = Path("motion.npz"),
) -> None:
    """Write a motion that makes a hung-up robot's joints known.

    Arrays t, target_q, target_v, torque (feedforward), k_p and k_d. With q as the encoders say it,
    they are a log for harpy identify. Watch the first seconds: whether links touch is not checked.
    """
    check_outputs({"--out": out})
    from harpy_pin.contrib.identify.motion import excitation
    from harpy_pin.model.source import loaded_robot

    known = loaded_robot(options.read_robot_options(robot, feet, None))
    plan = excitation(known, duration=duration)
    sent: dict[str, Any] = plan.signals()
    with replacing(out) as file:
        if out.suffix == ".csv":
            t, *rest = sent.items()
            names = [f"{name}/{joint}" for name, _ in rest for joint in known.joints]
            table = np.column_stack([column for _, column in (t, *rest)])
            np.savetxt(file, table, "%.6g", ",", header=",".join(["t", *names]), comments="")
        else:
            np.savez(file, **sent)
    console.print(f"{out}: {len(plan.t)} rows of {plan.t[1]:g} s, for {', '.join(known.joints)}")
    console.print(f"condition of the regressor: {plan.condition:.1f}")
    say_next(f"harpy identify LOG{out.suffix} --robot {robot}")
