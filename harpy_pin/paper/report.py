"""The reproduction in one self-contained HTML page, with its figures and numbers beside it."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harpy_pin.errors import RunFileError
from harpy_pin.files import check_writable, replacing, write_json
from harpy_pin.model.robot import Robot
from harpy_pin.paper import figures
from harpy_pin.paper.claims import Finding, Verdict
from harpy_pin.paper.cost import study_cost
from harpy_pin.paper.departures import DEPARTURES
from harpy_pin.paper.planar import study_gait
from harpy_pin.paper.vlip import VlipCase, VlipStudy, study_vlip
from harpy_pin.paper.walk import MU, WALKS, WalkStudy, study_walk
from harpy_pin.plant.measures import Measures
from harpy_pin.plant.run import describe_versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Reproduction", "prepare_folder", "reproduce", "write_report"]

SETTINGS = ("paper-curves", "optimised", "hand")
"""Gaits of the 3D walks; the first is what the paper prints."""
VLIP_SHOWN = VlipCase("tracked", "polar")
"""The run the paper describes: governed in (θ, φ, l), constraints at the reference, started on the target."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """Everything the report shows.

    Attributes:
        vlip: first simulation.
        walks: second simulation, by gait; the first is as the paper prints it.
        findings: Q1 to Q8; Q4 to Q7 once for each gait.
        gait: what the optimised gait does in the plane.
    """

    vlip: VlipStudy
    walks: Mapping[str, WalkStudy]
    findings: tuple[Finding, ...]
    gait: Mapping[str, str]


def reproduce(
    robot: Robot,
    *,
    duration: float = 10.0,
    on_stage: Callable[[str], None] | None = None,
) -> Reproduction:
    """Run both simulations and judge every claim.

    Args:
        robot: Harpy.
        duration: of each 3D walk, s.
        on_stage: called with what is about to be done.
    """
    tell = on_stage if on_stage is not None else lambda _: None
    tell("VLIP simulation")
    vlip = study_vlip()
    walks = {}
    for name in SETTINGS:
        tell(f"3D walks, gait {name}")
        walks[name] = study_walk(name, duration=duration)
    tell("planar gait")
    gait = study_gait(robot)
    tell("cost")
    cost = study_cost(walks["optimised"].runs["measured"], robot, "optimised", mu=MU)
    by_claim = zip(*(walk.findings for walk in walks.values()), strict=True)
    return Reproduction(vlip, walks, (*vlip.findings, *(f for group in by_claim for f in group), cost), gait)


def write_report(result: Reproduction, folder: Path) -> Path:
    """Write ``report.html``, ``numbers.json`` and ``figures/*.pdf``.

    Args:
        result: of :func:`reproduce`.
        folder: made if it is not there.

    Returns:
        Path of the page.

    Raises:
        RunFileError: the folder cannot be written.
    """
    plates = prepare_folder(folder)
    parts = []
    for name, caption, draw in _plates(result):
        figure = draw()
        with replacing(plates / f"{name}.pdf") as file:
            figure.savefig(file, format="pdf", metadata={"CreationDate": None})
        picture = io.BytesIO()
        figure.savefig(picture, format="png", dpi=170, metadata={"Software": None})
        data = base64.b64encode(picture.getvalue()).decode()
        parts.append(
            f'<figure id="{name}"><img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
        )
    page = _page(result, "\n".join(parts))
    target = folder / "report.html"
    with replacing(target) as file:
        file.write(page.encode())
    write_json(folder / "numbers.json", _numbers(result))
    return target


def prepare_folder(folder: Path) -> Path:
    """Make the report's folders, before the work that fills them.

    Returns:
        The folder of the figures.

    Raises:
        RunFileError: they cannot be made or written.
    """
    plates = folder / "figures"
    try:
        plates.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(f"cannot write '{folder}': {error.strerror or error}", path=folder) from error
    check_writable(folder / "report.html")
    check_writable(plates / "any.pdf")
    return plates


def _plates(result: Reproduction) -> list[tuple[str, str, Callable[[], Figure]]]:
    """Name, caption and drawing of each figure, in the paper's order."""
    runs = result.vlip.runs
    shown, free = runs[VLIP_SHOWN], runs[VlipCase(None)]
    turns = {
        f"VLIP, {case.reading}, {case.coordinates}": {
            d: x for (c, d), (x, _) in result.vlip.chattering.items() if c == case
        }
        for case in runs
        if case.reading is not None and case.start == "paper"
    }
    turns |= {
        f"walk, {setting}, {name}": {d: x for (n, d), (x, _) in walk.chattering.items() if n == name}
        for setting, walk in result.walks.items()
        for name in WALKS[2:]
    }
    plates: list[tuple[str, str, Callable[[], Figure]]] = [
        (
            "vlip_states",
            "States of the VLIP: target, applied reference and model (tracked reading, reference in θ, φ, l).",
            lambda: figures.vlip_states(shown),
        ),
        (
            "vlip_forces",
            "Contact force of the VLIP with the applied reference, and what the target would cause at the same states.",
            lambda: figures.vlip_forces(shown),
        ),
        (
            "vlip_constraints",
            "Constraints of the VLIP: a run on the target reference, and the governed run.",
            lambda: figures.vlip_constraints(shown, free),
        ),
    ]
    for setting, walk in result.walks.items():
        run = walk.runs["measured"]
        plates += [
            (
                f"walk_{setting}_states",
                f"Full robot, gait {setting}: body position, target and applied reference (measured reading).",
                partial(figures.walk_states, run),
            ),
            (
                f"walk_{setting}_forces",
                f"Full robot, gait {setting}: force of the simulated ground on both feet, and the force that the "
                "reduced-order model expects. The paper shows the second; the feet feel the first.",
                partial(figures.walk_forces, run, mu=MU),
            ),
            (
                f"walk_{setting}_constraints",
                f"Full robot, gait {setting}: the model's constraints at the target and at the applied reference.",
                partial(figures.walk_constraints, run, mu=MU),
            ),
        ]
    plates.append(
        (
            "chattering",
            "Reversals of the applied reference per second as the step is divided. Level is smooth; rising chatters.",
            lambda: figures.chattering_figure(turns),
        )
    )
    return plates


def _numbers(result: Reproduction) -> dict[str, Any]:
    return {
        "claims": [
            {
                "claim": f.claim.key,
                "gait": f.setting,
                "verdict": str(f.verdict),
                "number": f.number,
                "command": f.command,
                "values": f.values,
            }
            for f in result.findings
        ],
        "gait": dict(result.gait),
        "vlip": {case.command: run.summary().as_dict() for case, run in result.vlip.runs.items()},
        "walk": {
            setting: {name: measures.as_dict() for name, measures in walk.measures.items()}
            for setting, walk in result.walks.items()
        },
        "chattering": [
            {
                "case": case.command,
                "divisor": d,
                "x_w": vars(x),
                "normal_force": vars(f),
            }
            for (case, d), (x, f) in result.vlip.chattering.items()
        ]
        + [
            {"case": f"walk, {setting}, {name}", "divisor": d, "x_w": vars(x), "normal_force": vars(f)}
            for setting, walk in result.walks.items()
            for (name, d), (x, f) in walk.chattering.items()
        ],
        "versions": describe_versions(),
    }


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], *, kind: str = "") -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "\n".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>'


def _page(result: Reproduction, plates: str) -> str:
    marks = {Verdict.HOLDS: "holds", Verdict.IN_PART: "part", Verdict.NOT: "not"}
    claims = [
        (
            f"<b>{f.claim.key}</b>",
            f"{escape(f.claim.text)}<br><small>{escape(f.claim.where)}</small>"
            + (f"<br><i>gait: {escape(f.setting)}</i>" if f.setting else ""),
            f'<span class="{marks[f.verdict]}">{escape(f.verdict)}</span>',
            f"{escape(f.number)}<br><small>{escape(f.claim.criterion)}</small>",
            f"<code>{escape(f.command)}</code>",
        )
        for f in result.findings
    ]
    vlip = [
        (
            escape(f"{case.reading or 'none'}, {case.coordinates if case.reading else '–'}, start {case.start}"),
            f"{100 * s.violation_share:.1f}",
            f"{s.worst_violation_n:.2f}",
            f"{s.reversals_per_s:.1f}",
            f"{1e3 * s.deviation_rms_m:.0f}",
            f"<code>{escape(case.command)}</code>",
        )
        for case, s in ((case, run.summary()) for case, run in result.vlip.runs.items())
    ]
    chatter = [
        (
            escape(name),
            f"dt/{d}" if d > 1 else "dt",
            f"{x.variation_per_s:.3f}",
            f"{x.reversals_per_s:.1f}",
            f"{f.variation_per_s:.0f}",
            f"{f.reversals_per_s:.1f}",
        )
        for name, d, x, f in [
            *(
                (f"VLIP, {case.reading or 'no governor'}, {case.coordinates}", d, x, f)
                for (case, d), (x, f) in result.vlip.chattering.items()
            ),
            *(
                (f"walk, {setting}, {name}", d, x, f)
                for setting, walk in result.walks.items()
                for (name, d), (x, f) in walk.chattering.items()
            ),
        ]
    ]
    departures = [(escape(d.printed), escape(d.here), escape(d.row)) for d in DEPARTURES]
    versions = ", ".join(f"{escape(k)} {escape(v)}" for k, v in describe_versions().items())
    gait = [(escape(name), escape(value)) for name, value in result.gait.items()]
    walks = "\n".join(
        f"<h3>Gait: {escape(setting)}</h3>\n{_table(('measure', *WALKS), _walk_rows(walk.measures))}"
        for setting, walk in result.walks.items()
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Unilateral ground contact force regulation, reproduced</title><style>{_STYLE}</style></head><body>
<h1>Unilateral ground contact force regulation in thruster-assisted legged locomotion, reproduced</h1>
<p>Both simulations of E. Sihite, P. Dangol and A. Ramezani (2021), claim by claim. A verdict follows from its number
and the criterion printed beside it; a claim that does not hold is a result like any other. The criteria of Q1 to
Q3 were written with numbers of the VLIP runs already known, and Q2 is judged on the best of four readings: read the
numbers.</p>
<h2>Claims</h2>
{_table(("", "the paper says", "verdict", "number, and criterion", "command"), claims, kind="claims")}
<p>The claims on the full robot are judged on three gaits. <b>paper-curves</b> is the simulation as printed: foot curves
with P1 = P0 and P3 = P4, feet at ±0.15 m, the body's target at constant speed and height. <b>optimised</b> is the
planar gait that was found to walk without thrust and then refined for little slip with the governor on, so its
ungoverned walk is no neutral baseline. <b>hand</b> has few parameters, picked from a search over slip with and without
the governor, then rounded.</p>
<h2>The optimised gait in the plane</h2>
{_table(("", "value"), gait)}
<h2>Figures</h2>
{plates}
<h2>VLIP, every reading</h2>
{_table(_VLIP_COLUMNS, vlip)}
<h2>3D walks, μ_s = {MU:g}</h2>
{walks}
<h2>Chattering</h2>
<p>Total variation and reversals per second at divided steps. In the walks the control period is divided and the
physics step is 0.25 ms throughout.</p>
{_table(_CHATTERING_COLUMNS, chatter)}
<h2>Departures from the print</h2>
{_table(("printed", "here", "equations.md"), departures)}
<p><small>{versions}. Made by <code>harpy paper</code>; every number again in <code>numbers.json</code>,
every figure as PDF in <code>figures/</code>.</small></p>
</body></html>
"""


def _walk_rows(measures: Mapping[str, Measures]) -> list[tuple[str, ...]]:
    columns = [measures[name].as_dict() for name in WALKS]
    rows = []
    for key in columns[0]:
        cells = [f"{v:.4g}" if isinstance(v := column[key], float) else escape(str(v)) for column in columns]
        rows.append((escape(key), *cells))
    return rows


_VLIP_COLUMNS = (
    "governor, reference, start",
    "ticks violated, %",
    "worst, N",
    "reversals of u_gz, 1/s",
    "x_w − x_r, rms mm",
    "command",
)
_CHATTERING_COLUMNS = (
    "run",
    "step",
    "x_w: variation, m/s",
    "x_w: reversals, 1/s",
    "u_gz: variation, N/s",
    "u_gz: reversals, 1/s",
)
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1c2430; max-width: 66rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #d5dce4; }
table { border-collapse: collapse; font-size: .85rem; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .35rem .5rem; border-bottom: 1px solid #e3e8ee; }
small { color: #5a6675; } code { font-size: .8rem; }
figure { margin: 1.6rem 0; break-inside: avoid; } img { max-width: 46rem; width: 100%; }
figcaption { color: #3c4654; font-size: .9rem; }
.claims td:nth-child(3) { white-space: nowrap; } .claims td:nth-child(2), .claims td:nth-child(4) { width: 30%; }
.holds { background: #d5efdf; } .part { background: #fbeac6; } .not { background: #f8d6d2; }
.holds, .part, .not { padding: .1rem .45rem; border-radius: .6rem; }
"""
