"""The command ``harpy estimate``: the state estimator on a log of one's own robot."""

from pathlib import Path
from typing import Annotated

import typer

from harpy_pin.cli import walk_options as options
from harpy_pin.cli.output import console, say_next, values_table
from harpy_pin.files import check_outputs


def estimate(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="Sensors: .csv, .npz or .mcap (extra: mcap).")
    ],
    robot: options.RobotOption = "go2",
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.npz", help="Write the estimate as a run.")
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Write it for Foxglove (extra: mcap).")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Charts: .png, .pdf or .svg.")
    ] = None,
) -> None:
    """Estimate a robot's state from a log, and its drift.

    The log has t, gyroscope, accelerometer, joint_position, and joint_torque or foot_force;
    joint_velocity if there is one, and the truth as q and v. Harpy's own logs with sensors are such
    logs.

    \b
    harpy walk --robot go2 --set state=estimated --save walk.npz
    harpy estimate walk.npz --robot go2 --save estimate.npz
    harpy view estimate.npz
    """
    outputs = {"--save": save, "--mcap": mcap, "--figures": figures}
    check_outputs(outputs, inputs={"LOG": log})
    from harpy_pin.contrib.bag import estimate_log, read_log
    from harpy_pin.model.source import loaded_robot

    known = loaded_robot(options.read_robot_options(robot, feet, None, flat_feet, loops))
    run, measures = estimate_log(read_log(log, known), known)
    console.print(values_table(f"{known.name}: {log}", measures))
    if save is not None:
        run.save(save)
    if mcap is not None:
        from harpy_pin.contrib.foxglove import write_mcap

        write_mcap(run, mcap, known)
    if figures is not None:
        from harpy_pin.cli.view import draw_figures

        draw_figures(run, known, figures)
    say_next(
        f"harpy estimate {log} --robot {robot} --save estimate.npz"
        if save is None
        else f"harpy view {save}"
    )
