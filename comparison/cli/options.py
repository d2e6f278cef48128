"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["Kept", "NumbersFile", "Only", "QuickLook", "QuickWalks", "WalksFile"]

NumbersFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
]
Kept = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help="Keep every finished walk here; the same command goes on with it."),
]
WalksFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write every walk to this file, as JSON.")
]
QuickLook = Annotated[bool, typer.Option("--quick", help="Walks of 1.5 s: a look, not to quote.")]
QuickWalks = Annotated[bool, typer.Option("--quick", help="A few short walks: to see whether it works.")]
Only = Annotated[
    list[str] | None, typer.Option("--only", metavar="ROBOT", help="This robot; may be given several times.")
]
