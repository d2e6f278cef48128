"""The command ``harpy info``: what the robot is made of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from harpy_pin import __version__
from harpy_pin.cli.output import UrdfOption, console

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot

__all__ = ["info"]


def info(urdf: UrdfOption = None) -> None:
    """Print the robot's numbers, versions, and where examples are.

    The numbers are masses, joints and limits; versions are those in use; tutorials are beside the examples.
    """
    from harpy_pin.log.run import describe_versions
    from harpy_pin.model.robot import load_harpy

    robot = load_harpy(urdf)
    console.print(_robot_table(robot))
    table = Table("package", "version")
    for name, version in {**describe_versions(), "harpy-pin": __version__}.items():
        table.add_row(name, version)
    console.print(table)
    for path in ("examples", "docs/tutorials"):
        if folder := _folder(path):
            print(f"{folder.name}: {folder}")


def _folder(path: str) -> Path | None:
    """A folder of the repository that comes with the package: inside it once installed, beside it in a checkout."""
    package = Path(__file__).parents[1]
    checkout = (package.parent / "urdf" / "harpy.urdf").is_file()
    found = package.parent / path if checkout else package / Path(path).name
    return found if found.is_dir() else None


def _robot_table(robot: Robot) -> Table:
    model = robot.model
    table = Table(
        "joint",
        "lower rad",
        "upper rad",
        "torque N·m",
        "armature kg·m²",
        title=f"{robot.name}: {robot.mass:.3f} kg, nq {model.nq}, nv {model.nv}",
        caption=f"feet {', '.join(robot.feet)}\nthrusters {', '.join(robot.thrusters)}, {robot.thrust_limit:g} N each",
    )
    rows = zip(robot.joints, robot.joint_lower, robot.joint_upper, robot.torque_limit, model.armature[6:], strict=True)
    for name, lower, upper, torque, armature in rows:
        table.add_row(name, f"{lower:.2f}", f"{upper:.2f}", f"{torque:.1f}", f"{armature:g}")
    return table
