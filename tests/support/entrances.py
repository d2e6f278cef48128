"""Where data from strangers enters: a URDF, a run file, a scenario, a command line; used as the
programs use them.

Each function takes the path of one file. It returns where the answer is a result or one line of
ours; what is a defect passes as the exception that it is.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path

from hostile import outcome
from hostile_lines import run_line

import harpy_pin as hp
from harpy_pin.scenario import Scenario, build
from harpy_pin.view.figures import figures_of
from harpy_pin.view.identity import robot_of
from harpy_pin.view.page.replay import replay_html

CONTROLLERS = ("condensed", "wbc", "governed")


def use_urdf(path: Path) -> None:
    """Read a robot: as Harpy, and with the link that is named last as its foot. A Harpy walks for
    three ticks.
    """
    made, _ = outcome(hp.load_harpy, path)
    if made is not None:
        outcome(few_ticks, path, CONTROLLERS[path.stat().st_size % 3])
    links = re.findall(rb'<link name="(\w+)"', path.read_bytes())
    outcome(hp.load_robot, path, feet=[name.decode() for name in links[-1:]])


def few_ticks(path: Path, controller: str) -> hp.Run:
    """The first steps of a variant of Harpy."""
    return build(Scenario(urdf=path, controller=controller, duration=0.003)).run()


def use_run(path: Path, walk: bool = True) -> bool:
    """Read, measure and view a log, and walk the first ticks of its scenario again; whether it was
    read.
    """
    run, _ = outcome(hp.Run.load, path)
    if run is None:
        return False
    outcome(hp.measure, run)
    robot, _ = outcome(robot_of, run)
    if robot is not None:
        outcome(page, run, robot)
    if walk:
        outcome(again, run)
    return True


def use_figure(path: Path) -> None:
    """Draw the figures of a log."""
    run, _ = outcome(hp.Run.load, path)
    if run is not None:
        outcome(figures_of, run)


def page(run: hp.Run, robot: hp.Robot) -> bytes:
    """The replay as a file."""
    return replay_html([(run, robot)]).encode("utf-8", errors="xmlcharrefreplace")


def again(run: hp.Run) -> hp.Run:
    """The first ticks of the walk that a log asks for."""
    scenario = Scenario.from_dict({**Scenario.of(run).to_dict(), "duration": 0.002})
    return build(scenario).run()


def use_scenario(path: Path) -> None:
    """Read a scenario, and write it: it says what was read."""
    scenario, _ = outcome(Scenario.from_dict, json.loads(path.read_text(encoding="utf-8")))
    if scenario is not None:
        assert Scenario.from_dict(scenario.to_dict()) == scenario
        assert Scenario.from_dict(json.loads(json.dumps(scenario.to_dict()))) == scenario


def use_command(path: Path) -> None:
    """Run a command line, a list of its words, within :func:`hostile_lines.nothing_works`."""
    run_line(json.loads(path.read_text(encoding="utf-8")))


ENTRANCES: dict[str, Callable[[Path], None]] = {
    "urdf": use_urdf,
    "run": use_run,
    "figure": use_figure,
    "scenario": use_scenario,
    "command": use_command,
}
"""By kind of data, which is also the name of a folder in ``tests/project/corpus``."""
