"""Commands that run one study of the comparison and print its tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.cli.options import Kept, NumbersFile, Only, QuickLook, QuickWalks, WalksFile
from comparison.cli.output import one_stage, print_tables, stages, writing
from comparison.contacts import ContactsSettings, contact_tables, walk_contacts
from comparison.crossings import CrossingSettings, cross, crossing_tables
from comparison.delay import DelaySettings, delay_tables, walk_delays
from comparison.edge import EdgeSettings, edge_tables, walk_edge
from comparison.embedded import EmbeddedSettings, count_embedded, embedded_tables
from comparison.engines import engine_table, walk_engines
from comparison.flight_tables import flight_tables
from comparison.flights import FlightSettings, fly
from comparison.ice import IceSettings, ice_tables, walk_ice
from comparison.jitter import JitterSettings, jitter_tables, measure_jitter
from comparison.limits import LimitsSettings, limit_tables, walk_limits
from comparison.measure.walking import Rows
from comparison.peers.environment import default_folder
from comparison.rates import RatesSettings, measure_rates, rates_tables
from comparison.report.flight_films import FILMS, film_flights
from comparison.report.slopes_figure import slopes_figure
from comparison.robots import RobotsSettings, robot_tables, stand_robots
from comparison.sections.grounds import GroundsSettings, ground_tables, walk_grounds
from comparison.slopes import SlopeSettings, slope_tables, stand_on_slopes
from comparison.steering import SteeringSettings, steering_tables, walk_steering
from comparison.tables import Table
from comparison.thruster_tables import thruster_tables
from comparison.thrusters import ThrusterSettings, walk_with_lag
from comparison.walkers.study import WalkersSettings, walk_walkers, walkers_tables
from comparison.walking import WalkingSettings, walk_robots, walking_tables
from harpy_pin.files import check_writable

__all__ = ["STUDIES", "engines", "grounds"]


def _study(
    settings: Any,
    quick: bool,
    measure: Callable[..., Rows],
    tables: Callable[[Rows], list[Table]],
    json: Path | None,
    robots: list[str] | None = None,
    stage: str = "walks",
) -> Rows:
    """Measure under a bar, keep every row, and print the tables; returns the rows."""
    chosen = settings.quick() if quick else settings()
    if robots:
        chosen = replace(chosen, robots=tuple(robots))
    with writing(json) as document, one_stage(stage) as progress:
        document["walks"] = rows = measure(chosen, progress)
    print_tables(tables(rows))
    return rows


def grounds(quick: QuickLook = False, json: WalksFile = None) -> None:
    """Walk every controller on soft and stiff ground.

    Stiffness is 4 to 80 kN/m, or MuJoCo's. Friction is 0.25 and 0.15. The tables show how far the feet slip, or when
    the robot fell. This takes some minutes.
    """
    _study(GroundsSettings, quick, walk_grounds, ground_tables, json, stage="grounds")


def engines(quick: QuickLook = False) -> None:
    """Walk every controller in both engines, and compare.

    Motion and forces are compared tick by tick.
    """
    print_tables([engine_table(walk_engines(duration=1.5 if quick else 6.0))])


def contacts(quick: QuickWalks = False, out: Kept = None, json: WalksFile = None) -> None:
    """Walk on contact models that are not ours.

    MuJoCo's own contact and what is advised against its slip, spheres as feet, and Drake's, beside ours. The tables
    take the creep that a contact has by itself from the rest of the slip, and show in which part of a stance Go2 slips.
    What is not installed is left out. With both engines this takes many minutes.
    """
    _study(ContactsSettings, quick, partial(walk_contacts, path=out), contact_tables, json)


def edge(
    quick: Annotated[bool, typer.Option("--quick", help="A dozen short walks: to see whether it works.")] = False,
    json: WalksFile = None,
) -> None:
    """Walk where falls begin, with and without --govern-command.

    Slippery ground at two speeds, and pushes from four sides, for the condensed controller and the whole-body QP.
    """
    _study(EdgeSettings, quick, walk_edge, edge_tables, json)


def delay(quick: QuickWalks = False, json: WalksFile = None) -> None:
    """Walk with late and noisy measurements.

    The paper's joint PID, legs with feedforward, the condensed controller and the whole-body QP, beside the delays that
    a linear argument allows.
    """
    _study(DelaySettings, quick, walk_delays, delay_tables, json)


def ice(quick: QuickWalks = False, json: WalksFile = None) -> None:
    """Walk over ice with and without estimated friction.

    The condensed controller, the whole-body QP, the paper's governor and the contact-force filter, in both engines,
    with exact measurements and with noise and delay.
    """
    _study(IceSettings, quick, walk_ice, ice_tables, json)


def limits(quick: QuickWalks = False, out: Kept = None, json: WalksFile = None) -> None:
    """Walk with damped joints, weak motors and joint friction.

    Damping is strong, motors are also slow, and no model has the joint friction. The ungoverned and the paper's
    controller, the contact-force filter, the condensed controller with and without tasks that give way, and the
    whole-body QP. This takes many minutes.
    """
    _study(LimitsSettings, quick, partial(walk_limits, path=out), limit_tables, json)


def robots(
    quick: Annotated[bool, typer.Option("--quick", help="Two robots and one push: to see whether it works.")] = False,
    only: Only = None,
    json: NumbersFile = None,
) -> None:
    """Stand the robots that are known by name, and push them.

    They also shift their weight. Under the whole-body QP and the condensed controller, on compliant ground. Needs the
    extra "robots".
    """
    _study(RobotsSettings, quick, stand_robots, robot_tables, json, only)


def slopes(
    quick: QuickWalks = False,
    out: Kept = None,
    json: WalksFile = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", metavar="FILE", help="Also draw the map to this file, such as map.png.")
    ] = None,
) -> None:
    """Stand robots on slopes, angle by friction.

    From 0 to 45 degrees, at friction 0.1 to 1.0, beside the bound of statics: Harpy under a joint PID without thrust,
    the paper's governor, the contact-force filter, the condensed controller and the whole-body QP, and Go2 and G1 under
    the condensed controller. Needs the extra "robots". This takes many minutes.
    """
    if figure is not None:
        check_writable(figure)
    walks = _study(SlopeSettings, quick, partial(stand_on_slopes, path=out), slope_tables, json)
    if figure is not None:
        slopes_figure(walks).savefig(figure)


def crossings(quick: QuickWalks = False, out: Kept = None, json: WalksFile = None) -> None:
    """Let robots cross stairs, stones, rough ground and ramps.

    Harpy, Go2 and G1 under the condensed controller, in both engines: steps up and down, stones, rough ground that the
    gait knows or does not know, ramps, and normals that are told wrong by 5 degrees. Needs the extra "robots". This
    takes some minutes.
    """
    _study(CrossingSettings, quick, partial(cross, path=out), crossing_tables, json)


def steering(quick: QuickWalks = False, json: WalksFile = None) -> None:
    """Walk Harpy where commands say.

    A course, 200 random sequences, pushes, slippery ground and absurd commands, under the condensed controller and the
    whole-body QP; the course and some of the sequences in MuJoCo, too. This takes many
    minutes.
    """
    _study(SteeringSettings, quick, walk_steering, steering_tables, json)


def thrusters(quick: QuickWalks = False, out: Kept = None, json: WalksFile = None) -> None:
    """Walk Harpy with thrusters as they are.

    Their magnitudes lag by up to 1 s, their directions by up to 0.2 s, or one of them fails; also with slow motors, and
    in both engines: the ungoverned and the paper's controller, the contact-force filter, the condensed controller and
    the whole-body QP, and these two where they know the lags. This takes many minutes.
    """
    _study(ThrusterSettings, quick, partial(walk_with_lag, path=out), thruster_tables, json)


def flights(
    quick: QuickWalks = False,
    json: WalksFile = None,
    films: Annotated[
        Path | None,
        typer.Option(
            "--films", metavar="FILE.html", help="Film each manoeuvre once instead, on this page. Needs Chromium."
        ),
    ] = None,
) -> None:
    """Let Harpy jump, hover and fly.

    Under the condensed controller and the whole-body QP, in both engines, with noise: a hop, a jump of 0.4 m, hovering
    for 10 s, 2 m through the air to level ground and to slopes of 15 degrees, half a fan lost in the air, fans that
    lag, and what walks, jumps and flights cost on slopes. This takes many minutes.
    """
    if films is None:
        _study(FlightSettings, quick, fly, flight_tables, json, stage="flights")
        return
    with one_stage("films") as progress:
        film_flights(films, ("jump 0.4 m",) if quick else tuple(FILMS), progress)
    typer.echo(f"wrote {films}")


def walking(
    quick: Annotated[bool, typer.Option("--quick", help="Solo12 and few walks: to see whether it works.")] = False,
    only: Only = None,
    out: Kept = None,
    json: WalksFile = None,
) -> None:
    """Walk the robots that are known by name.

    Courses that commands describe, in both engines under the condensed controller, the whole-body QP and joint PD;
    slippery ground, other schedules, random commands without and with noise and delay, and pushes from eight sides.
    Needs the extra "robots", and an hour.
    """
    _study(WalkingSettings, quick, partial(walk_robots, path=out), walking_tables, json, only)


def walkers(
    quick: QuickWalks = False,
    out: Kept = None,
    json: WalksFile = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder", metavar="DIR", help="Folder of the peers.  [default: in the user's cache]", show_default=False
        ),
    ] = None,
) -> None:
    """Walk other people's walkers beside ours.

    MuJoCo Playground's policy for Go1 and the condensed WBC in the policy's own model of the robot: a course, random
    commands, slippery ground and pushes. placo's walk pattern generator and the condensed WBC walk Talos straight.
    "peers --install" installs both. Needs the extra "robots". This takes many minutes.
    """
    measure = partial(walk_walkers, path=out, folder=default_folder() if folder is None else folder)
    _study(WalkersSettings, quick, measure, walkers_tables, json)


def embedded(
    quick: Annotated[bool, typer.Option("--quick", help="Harpy on one chip: to see whether it works.")] = False,
    only: Only = None,
    json: NumbersFile = None,
) -> None:
    """Count what a tick costs on a microcontroller.

    Instructions, flash, memory and stack on a Cortex-M4F, M7 and M33 in QEMU: the paper's governor, the contact-force
    filter, the condensed controller, and the whole-body QP by its last active set and by DAQP's own C, for Harpy,
    Solo12 and Bolt on the same recorded states. Needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm;
    DAQP's source is fetched from its package.
    """
    _study(EmbeddedSettings, quick, count_embedded, embedded_tables, json, only)


def rates(
    quick: Annotated[bool, typer.Option("--quick", help="Harpy alone, a few rounds.")] = False, json: NumbersFile = None
) -> None:
    """Measure how much this machine does in a second.

    Walks, environment steps and whole-body optima, and the condensed controller's tick inside C.
    """
    _study(RatesSettings, quick, measure_rates, rates_tables, json)


def jitter(
    seconds: Annotated[float, typer.Option(help="Of each loop.")] = 600.0,
    priority: Annotated[int, typer.Option(help="Of the loops under SCHED_FIFO, 1 to 99; 0 for the usual one.")] = 0,
    json: NumbersFile = None,
) -> None:
    """Measure how late the ticks of a loop at 1 kHz begin.

    And how long they take, as a histogram. The condensed controller and the whole-body QP, each in a loop of its own
    beside the simulator.
    """
    settings = JitterSettings(seconds=seconds, priority=priority)
    with writing(json) as document, stages() as progress:
        document["jitter"] = measure_jitter(settings, partial(progress, "loops"))
    print_tables(jitter_tables(document["jitter"]))


STUDIES: dict[Callable[..., None], str] = {
    contacts: "contacts --out contacts.jsonl",
    crossings: "crossings --out crossings.jsonl",
    edge: "edge --json edge.json",
    delay: "delay --json delay.json",
    flights: "flights --json flights.json",
    ice: "ice --json ice.json",
    limits: "limits --out limits.jsonl",
    robots: "robots --only g1 --json g1.json",
    slopes: "slopes --out slopes.jsonl --figure slopes.png",
    steering: "steering --json steering.json",
    thrusters: "thrusters --out thrusters.jsonl",
    walking: "walking --only go2 --out go2.jsonl",
    walkers: "peers --install && python -m comparison walkers --out walkers.jsonl",
    embedded: "embedded --json embedded.json",
    rates: "rates --json rates.json",
    jitter: "jitter --seconds 60",
}
"""Studies of one question, and an example of each command."""
