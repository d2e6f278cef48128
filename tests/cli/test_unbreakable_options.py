"""Every number on the command line, found by looking at the commands: a new option is tried by itself.

Nothing is walked here: where a command would begin to, its numbers have been accepted.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

import pytest
import typer
from typer.models import OptionInfo

import harpy_pin as hp
from comparison import cli as comparison
from harpy_pin.cli import app as harpy
from reproduction.cli import app as reproduction

HUGE = "9" * 40
VALUES = ("nan", "inf", "-inf", "-1", "0", "1e-300", "1e308", "-1e308", "1e999", HUGE, "x", "1,5", "", "0x10")
ZERO = {"0", "1e-300"}
SEED = {"0", HUGE}
ACCEPTED: dict[tuple[str, ...], set[str]] = {
    ("harpy", "walk", "--friction"): ZERO,
    ("harpy", "walk", "--assumed-friction"): ZERO,
    ("harpy", "walk", "--speed"): ZERO,
    ("harpy", "walk", "--duration"): {"1e-300"},  # the first tick
    ("harpy", "walk", "--mass-error"): ZERO,
    ("harpy", "walk", "--noise"): ZERO,
    ("harpy", "walk", "--delay"): ZERO,
    ("harpy", "walk", "--perturbation"): ZERO,
    ("harpy", "walk", "--seed"): SEED,
    ("harpy", "view", "--port"): {"0"},
    ("harpy", "film", "--friction"): ZERO,
    ("harpy", "live", "--port"): {"0"},
    ("harpy", "live", "--speed"): ZERO,
    ("reproduction", "gait", "--from-walk"): ZERO,
    ("reproduction", "gait", "--in-space"): ZERO,
    ("reproduction", "gait", "--friction"): ZERO,
    ("reproduction", "gait", "--slip-weight"): ZERO,
    ("reproduction", "gait", "--seed"): {"0"},
    ("reproduction", "governors", "--friction"): ZERO,
    ("reproduction", "vlip", "--friction"): ZERO,
    ("comparison", "--seed"): SEED,
    ("comparison", "--friction"): ZERO,
    ("comparison", "campaign", "--seed"): SEED,
    ("comparison", "peers", "--friction"): ZERO,
}
"""What an option takes of the values above. One that is not here takes none of them."""
SAYS = {
    ("harpy", "walk", "--speed"): ("speed", "reach"),
    ("harpy", "walk", "--dt"): ("dt", "physics step"),
    ("harpy", "walk", "--assumed-stiffness"): ("stiffness",),
    ("reproduction", "vlip", "--dt"): ("dt", "duration"),
}
"""Words of which the message has one, where the option's own name need not be there."""
WORK = (
    "harpy_pin.simulation.simulator.Simulator.run",
    "harpy_pin.gaits.planar.planar_walk.PlanarWalk.run",
    "reproduction.vlip_simulation.simulate_vlip",
    "reproduction.report.reproduce",
    "harpy_pin.view.page.replay.serve",
    "harpy_pin.view.live.drive.listen",
    "comparison.cli.whole.compare",
    "comparison.cli.walks.run_campaign",
    "comparison.cli.peers.compare_peers",
)


class Accepted(BaseException):
    """The command has begun its work."""


def numeric_options(program: str, app: typer.Typer) -> Iterator[tuple[str, ...]]:
    """Program, command and name of every option that is a number."""
    commands = [((command.callback.__name__,), command.callback) for command in app.registered_commands]
    if app.registered_callback is not None:
        commands.append(((), app.registered_callback.callback))
    for command, function in commands:
        for name, hint in get_type_hints(function, include_extras=True).items():
            kind, *more = get_args(hint) or (hint,)
            option = next((entry for entry in more if isinstance(entry, OptionInfo)), None)
            if option is not None and {float, int} & {kind, *get_args(kind)}:
                names = [text for text in option.param_decls or () if text.startswith("--")]
                yield program, *command, (names or [f"--{name.replace('_', '-')}"])[0]


APPS = {"harpy": harpy, "comparison": comparison, "reproduction": reproduction}
OPTIONS = [option for program, module in APPS.items() for option in numeric_options(program, module.app)]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "a.npz"
    hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01), save=path)
    return path


@pytest.fixture
def run(monkeypatch, capsys, tmp_path, log):
    """Runs a command up to its work: exit code (None where it was reached) and standard error."""
    others = {
        ("harpy", "view"): (log,),
        ("harpy", "film"): (tmp_path / "walk.gif",),
        ("reproduction", "paper"): ("--out", tmp_path / "paper"),
        ("comparison",): ("--out", tmp_path / "out"),
        ("comparison", "campaign"): ("--out", tmp_path / "campaign.jsonl"),
    }

    def work(*arguments: Any, **options: Any) -> None:
        raise Accepted

    for place in WORK:
        monkeypatch.setattr(place, work)

    def run(program, *arguments):
        command = (program, *arguments[:-1])
        monkeypatch.setattr(sys, "argv", list(map(str, (*command, *others.get(command, ()), arguments[-1]))))
        try:
            APPS[program].main()
        except SystemExit as ending:
            return ending.code or 0, capsys.readouterr().err
        except Accepted:
            return None, capsys.readouterr().err
        raise AssertionError("a command that does not end")

    return run


def test_all_commands_are_tried():
    """Both programs, and whatever has been written down here."""
    assert ACCEPTED.keys() | SAYS.keys() <= set(OPTIONS)
    assert len(OPTIONS) == len(set(OPTIONS)) > 25
    assert {option[:-1] for option in OPTIONS} >= {("harpy", "walk"), ("reproduction", "gait"), ("comparison",)}


@pytest.mark.parametrize("option", OPTIONS, ids=" ".join)
def test_numbers_are_accepted_or_refused_by_name(run, option):
    *command, name = option
    for value in VALUES:
        code, err = run(*command, f"{name}={value}")
        if value in ACCEPTED.get(option, ()):
            assert code is None, (value, err)
            continue
        assert code in ((2,) if command[0] == "harpy" else (1, 2)), (value, err)
        assert len(err.strip().splitlines()) == 1, (value, err)
        assert err.startswith("error: " if command[0] == "comparison" else f"{command[0]}: "), err
        words = SAYS.get(option, (name.lstrip("-"),))
        assert any(word in err.replace("_", "-") for word in words), (value, err)


@pytest.mark.parametrize("push", ["nan:0,1,0", "inf:0,1,0", "1e308:0,1,0", "-1:0,1,0", "0.1:nan,0,0", "0.1:0,1e308,0"])
def test_pushes_are_refused_by_name(run, push):
    code, err = run("harpy", "walk", f"--push={push}")
    assert code == 2
    assert len(err.strip().splitlines()) == 1
    assert "push" in err or "impulse" in err
