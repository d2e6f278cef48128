"""The reproduction in one self-contained HTML page, with its figures and numbers beside it."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from harpy_pin.files import OwnFolder, json_text
from harpy_pin.log.measures import Measures
from harpy_pin.log.run import describe_versions
from harpy_pin.model.robot import Robot
from reproduction import figures
from reproduction.chattering import Chattering
from reproduction.claims import DEPARTURES, Finding, Verdict
from reproduction.vlip_claims import VlipCase, VlipStudy, study_vlip
from reproduction.walk_claims import MU, WALKS, WalkStudy, study_cost, study_gait, study_walk

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETTINGS = ("paper-curves", "optimised", "hand")
"""Gaits of the 3D walks; the first is what the paper prints."""
VLIP_SHOWN = VlipCase("tracked", "polar")
"""The run the paper describes: governed in (θ, φ, l), constraints at the reference, started on the
target.
"""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """Everything the report shows."""

    vlip: VlipStudy  # first simulation
    walks: Mapping[
        str, WalkStudy
    ]  # second simulation, by gait; the first is as the paper prints it
    findings: tuple[Finding, ...]  # Q1 to Q8; Q4 to Q7 once for each gait
    gait: Mapping[str, str]  # what the optimised gait does in the plane


def reproduce(
    robot: Robot, *, duration: float = 10.0, on_stage: Callable[[str], None] = lambda stage: None
) -> Reproduction:
    """Run both simulations and judge every claim.

    Args:
        robot: Harpy.
        duration: of each 3D walk, s.
        on_stage: called with what is about to be done.
    """
    on_stage("VLIP simulation")
    vlip = study_vlip()
    walks = {}
    for name in SETTINGS:
        on_stage(f"3D walks, gait {name}")
        walks[name] = study_walk(name, duration=duration)
    on_stage("planar gait")
    gait = study_gait(robot)
    on_stage("cost")
    cost = study_cost(walks["optimised"].runs["measured"], robot, "optimised", mu=MU)
    by_claim = zip(*(walk.findings for walk in walks.values()), strict=True)
    return Reproduction(
        vlip, walks, (*vlip.findings, *(f for group in by_claim for f in group), cost), gait
    )


def write_report(result: Reproduction, folder: OwnFolder) -> Path:
    """Write ``report.html``, ``numbers.json`` and ``figures/*.pdf``.

    Args:
        result: of :func:`reproduce`.
        folder: where to.

    Returns:
        Path of the page.

    Raises:
        RunFileError: the folder cannot be written.
    """
    parts, files = [], {}
    for name, caption, figure in _plates(result):
        plate, picture = io.BytesIO(), io.BytesIO()
        figure.savefig(plate, format="pdf", metadata={"CreationDate": None})
        files[f"figures/{name}.pdf"] = plate.getvalue()
        figure.savefig(picture, format="png", dpi=170, metadata={"Software": None})
        source = f"data:image/png;base64,{base64.b64encode(picture.getvalue()).decode()}"
        parts.append({"name": name, "caption": caption, "source": source})
    folder.write(
        {
            **files,
            "report.html": _page(result, parts),
            "numbers.json": json_text(numbers_of(result)),
        }
    )
    return folder.path / "report.html"


def _plates(result: Reproduction) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and drawing of each figure, in the paper's order."""
    runs = result.vlip.runs
    shown, free = runs[VLIP_SHOWN], runs[VlipCase(None)]
    yield (
        "vlip_states",
        "States of the VLIP: target, applied reference and model (constraints at the tracked "
        "state, reference in θ, φ, "
        "l).",
        figures.vlip_states(shown),
    )
    yield (
        "vlip_forces",
        "Contact force of the VLIP with the applied reference, and what the target would cause at "
        "the same states.",
        figures.vlip_forces(shown),
    )
    yield (
        "vlip_constraints",
        "Constraints of the VLIP: a run on the target reference, and the governed run.",
        figures.vlip_constraints(shown, free),
    )
    for setting, walk in result.walks.items():
        run, robot = walk.runs["measured"], f"Full robot, gait {setting}"
        yield (
            f"walk_{setting}_states",
            f"{robot}: body position, target and applied reference (measured evaluate_at).",
            figures.walk_states(run),
        )
        yield (
            f"walk_{setting}_forces",
            f"{robot}: force of the simulated ground on both feet, and the force that the "
            f"reduced-order model expects. "
            "The paper shows the second; the feet feel the first.",
            figures.walk_forces(run, mu=MU),
        )
        yield (
            f"walk_{setting}_constraints",
            f"{robot}: the model's constraints at the target and at the applied reference.",
            figures.walk_constraints(run, mu=MU),
        )
    chattering: dict[str, dict[int, Chattering]] = {}
    for _, name, divisor, applied, _ in _chattering(result):
        if "no governor" not in name:
            chattering.setdefault(name, {})[divisor] = applied
    yield (
        "chattering",
        "Reversals of the applied reference per second as the step is divided. Level is smooth; "
        "rising chatters.",
        figures.chattering_figure(chattering),
    )


def numbers_of(result: Reproduction) -> dict[str, Any]:
    """Every number, ready for JSON."""
    return {
        "claims": [
            {
                "claim": f.claim.key,
                "text": f.claim.text,
                "gait": f.setting,
                "verdict": str(f.verdict),
                "number": f.number,
                "command": f.command,
                "values": f.values,
            }
            for f in result.findings
        ],
        "gait": dict(result.gait),
        "vlip": {case.command: vars(run.summary()) for case, run in result.vlip.runs.items()},
        "vlip_inside": result.vlip.inside,
        "walk": {
            setting: {name: measures.as_dict() for name, measures in walk.measures.items()}
            for setting, walk in result.walks.items()
        },
        "chattering": [
            {"case": case, "divisor": d, "x_w": x._asdict(), "normal_force": f._asdict()}
            for case, _, d, x, f in _chattering(result)
        ],
        "versions": describe_versions(),
    }


def _chattering(result: Reproduction) -> Iterator[tuple[str, str, int, Chattering, Chattering]]:
    """Command, name, divisor of the step, and chattering of x_w and of the normal force, of each
    run.
    """
    for (case, d), (x, f) in result.vlip.chattering.items():
        yield (
            case.command,
            f"VLIP, {case.evaluate_at or 'no governor'}, {case.coordinates}",
            d,
            x,
            f,
        )
    for setting, walk in result.walks.items():
        for (name, d), (x, f) in walk.chattering.items():
            yield f"walk, {setting}, {name}", f"walk, {setting}, {name}", d, x, f


def _page(result: Reproduction, plates: Sequence[Mapping[str, str]]) -> str:
    """The page; everything that is put into its template is escaped."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    vlip = [
        (
            f"{case.evaluate_at or 'none'}, {case.coordinates if case.evaluate_at else '–'}, start "
            f"{case.start}",
            f"{100 * s.violation_share:.1f}",
            f"{s.worst_violation_n:.2f}",
            f"{s.reversals_per_s:.1f}",
            f"{1e3 * s.deviation_rms_m:.0f}",
            case.command,
        )
        for case, s in ((case, run.summary()) for case, run in result.vlip.runs.items())
    ]
    chatter = [
        (
            name,
            f"dt/{d}" if d > 1 else "dt",
            f"{x.variation_per_s:.3f}",
            f"{x.reversals_per_s:.1f}",
            f"{f.variation_per_s:.0f}",
            f"{f.reversals_per_s:.1f}",
        )
        for _, name, d, x, f in _chattering(result)
    ]
    return environment.get_template("report.html.j2").render(
        findings=result.findings,
        marks={Verdict.HOLDS: "holds", Verdict.IN_PART: "part", Verdict.NOT: "not"},
        gait=result.gait.items(),
        plates=plates,
        vlip=vlip,
        cases=WALKS,
        walks={setting: _walk_rows(walk.measures) for setting, walk in result.walks.items()},
        chatter=chatter,
        departures=[(d.printed, d.here, d.row) for d in DEPARTURES],
        versions=", ".join(f"{name} {value}" for name, value in describe_versions().items()),
        mu=MU,
    )


def _walk_rows(measures: Mapping[str, Measures]) -> list[tuple[str, ...]]:
    columns = [measures[name].as_dict() for name in WALKS]
    return [
        (
            key,
            *(f"{v:.4g}" if isinstance(v := column[key], float) else str(v) for column in columns),
        )
        for key in columns[0]
    ]
