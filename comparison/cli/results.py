"""The command that measures what README and docs show, records it, and fills their tables."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer

from comparison.campaign.summary import summary_tables, variants_table
from comparison.campaign.walks import exceptions_table
from comparison.cli.studies import STUDIES
from comparison.peers.compare import peer_tables
from comparison.report.claims import paper_tables
from comparison.report.pages import filled
from comparison.report.record import FOLDER, ROOT, Record
from comparison.report.report import tables_of
from comparison.tables import Table
from harpy_pin import checks
from harpy_pin.errors import HarpyError, RunFileError
from harpy_pin.files import replacing

PAGES = ("README.md", "docs/*.md")
"""Pages whose tables are filled."""

CAMPAIGNS: Mapping[str, str] = {
    **{kind: f"campaign {kind}" for kind in ("wide", "variants", "harsh")},
    "damped": "campaign variants --walks 960 --joint-damping 5",
}
DRAWN: Mapping[str, str] = {
    "assumption": "assumption",
    "causes": "causes",
    "optima": "optima",
    "pushes": "pushes",
    "slip": "governors",
    "slopes": "slopes",
    "worlds": "falls",
}
"""Figures of docs/images, by the study that draws them."""

_COMPARED: Mapping[str, str] = {
    "comparison": "--figure docs/images/pareto.png",
    "peers": "peers",
    **CAMPAIGNS,
    **{
        name: f"{name} --figure docs/images/{DRAWN[name]}.png" if name in DRAWN else name
        for name in STUDIES
    },
    "recorded": "recorded --data out/clones",
    "worlds": f"worlds --clones out/clones --figure docs/images/{DRAWN['worlds']}.png",
}
SOURCES: Mapping[str, str] = {
    **{name: f"comparison {words}" for name, words in _COMPARED.items()},
    "paper": "reproduction paper",
}
"""For each source the words of its command after ``python -m``."""

FOLDERS = ("comparison", "paper")
"""Sources whose ``--out`` is a folder; of the others it is a file of what is finished."""


def tables_from(source: str, document: Mapping[str, Any]) -> list[Table]:
    """The tables of what the command of a source writes."""
    if source in STUDIES:
        return STUDIES[source].tables(document["walks"])
    if source in CAMPAIGNS:
        return [variants_table(document), exceptions_table(document), *summary_tables(document)]
    if source == "peers":
        return peer_tables(document["peers"])
    make = {"comparison": tables_of, "paper": paper_tables}[source]
    return make(document)


def results(
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SOURCE", help=f"Measure this one first; any of {', '.join(SOURCES)}."
        ),
    ] = None,
    data: Annotated[
        Path,
        typer.Option(
            "--data", metavar="DIR", help="Folder of all measurements; what it has is not repeated."
        ),
    ] = Path("out/results"),
) -> None:
    """Fill the tables of README and docs from docs/results.

    Above each table a comment says from which command it comes, and which rows and columns it
    shows. A source that is named is measured, and its tables are recorded in docs/results. Without
    one, pages are filled from what is recorded. All together take some hours; "embedded", "peers"
    and "worlds" need what their own help says, "recorded" and "worlds" clones in out/clones.
    """
    for source in sources or ():
        checks.one_of("source", source, SOURCES)
    failed = [source for source in sources or () if not measured(source, data)]
    fill_pages(ROOT, FOLDER)
    if failed:
        raise HarpyError(
            f"these commands failed, and their tables are as before: {', '.join(failed)}"
        )


def fill_pages(root: Path, folder: Path) -> None:
    """Fill the tables of every page below a folder from the records."""
    for path, text in pages(root).items():
        new = filled(text, recorded(folder))
        if new != text:
            with replacing(path) as file:
                file.write(new.encode())


def pages(root: Path) -> dict[Path, str]:
    """Texts of the pages."""
    paths: Sequence[Path] = [path for pattern in PAGES for path in sorted(root.glob(pattern))]
    return {path: path.read_text(encoding="utf-8") for path in paths}


def recorded(folder: Path) -> Any:
    """What gives the table of a source by the two names, from the records in a folder."""
    record = cache(lambda source: Record.load(source, folder))

    def table_of(source: str, name: str) -> Table:
        tables = record(source).tables
        checks.one_of(f"table of '{source}'", name, tables)
        return tables[name]

    return table_of


def measured(source: str, data: Path, folder: Path = FOLDER) -> bool:
    """Run the command of a source, unless the folder of data has what it writes, and record its
    tables.
    """
    try:
        data.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFileError(
            f"cannot make the folder '{data}': {error.strerror}", path=data
        ) from error
    path, words = data.resolve() / f"{source}.json", SOURCES[source].split()
    if not path.exists():
        kept = path.with_suffix("" if source in FOLDERS else ".jsonl")
        out = [] if source == "peers" else ["--out", str(kept)]
        typer.echo(f"python -m {' '.join(words)}", err=True)
        how = [sys.executable, "-m", *words, *out, "--json", str(path)]
        if subprocess.run(how, stdout=subprocess.DEVNULL, cwd=ROOT, check=False).returncode != 0:
            return False
    document = json.loads(path.read_text(encoding="utf-8"))
    command = f"python -m {' '.join(words)}"
    Record.of(command, document, tables_from(source, document)).save(source, folder)
    return True
