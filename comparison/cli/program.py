"""The whole command line: the comparison itself and every further command."""

import sys
from collections.abc import Callable
from functools import wraps
from importlib.util import find_spec
from typing import Any

import typer

from comparison.cli.commands import campaign, peers, tune, whole
from comparison.cli.results import results
from comparison.cli.studies import STUDIES, command_of
from harpy_pin.cli.ending import one_line_errors, stopping
from harpy_pin.errors import HarpyError, install_line

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
_NEEDED = ("pandas", "mujoco", "daqp", "piqp", "osqp", "clarabel", "quadprog")
_MISSING = " and ".join(repr(name) for name in _NEEDED if find_spec(name) is None)
_HINT = f"the comparison needs {_MISSING}: {install_line('compare')}" if _MISSING else ""


def _complete(command: Callable[..., None]) -> Callable[..., None]:
    """A command that says what is not installed before it does anything; its help needs nothing."""

    @wraps(command)
    def run(**options: Any) -> None:
        if _HINT and getattr(options.get("context"), "invoked_subcommand", None) is None:
            raise HarpyError(_HINT)
        command(**options)

    return stopping(run)


_EXAMPLE = "Example:  python -m comparison"
app.callback(invoke_without_command=True, epilog=_HINT or f"{_EXAMPLE} --quick --out out/quick")(
    _complete(whole)
)

_COMMANDS: dict[Callable[..., None], str] = {
    campaign: "campaign --quick --out campaign.jsonl",
    peers: "peers --install && python -m comparison peers --json peers.json",
    **{
        command_of(study): f"{name} {study.example or f'--json {name}.json'}"
        for name, study in STUDIES.items()
    },
    tune: "tune --budget 20 --train 12 --judge 24 --json tuned.json",
    results: "results wide harsh --data out/results",
}
"""Commands, and an example of each."""

for _command, _example in _COMMANDS.items():
    app.command(epilog=f"{_EXAMPLE} {_example}")(_complete(_command))


def main() -> None:
    """Run the command line; errors of the library become one line on stderr."""
    with one_line_errors("error", 1):
        sys.exit(app(prog_name="python -m comparison", standalone_mode=False))
