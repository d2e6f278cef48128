"""Every number on the command line, found by looking at the commands: a new option is tried by
itself.

Nothing is walked here: where a command would begin to, its numbers have been accepted.
"""

from typing import get_args

import pytest
from command_lines import commands, run_line, stop_before_work

import harpy_pin as hp
from harpy_pin.cli.walk_options import read_settings

HUGE = "9" * 40
VALUES = (
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "1e-300",
    "1e308",
    "-1e308",
    "1e999",
    HUGE,
    "x",
    "1,5",
    "",
    "0x10",
)
ZERO = {"0", "1e-300"}
SEED = {"0", HUGE}
ACCEPTED: dict[tuple[str, ...], set[str]] = {
    ("harpy", "walk", "--friction"): ZERO,
    ("harpy", "walk", "--speed"): ZERO,
    ("harpy", "walk", "--duration"): {"1e-300"},  # the first tick
    ("harpy", "view", "--port"): {"0"},
    ("harpy", "film", "--friction"): ZERO,
    ("harpy", "film", "--speed"): {*ZERO, "-1"},
    ("harpy", "live", "--port"): {"0"},
    ("harpy", "live", "--speed"): ZERO,
    ("reproduction", "gait", "--from-walk"): ZERO,
    ("reproduction", "gait", "--in-space"): ZERO,
    ("reproduction", "gait", "--friction"): ZERO,
    ("reproduction", "gait", "--slip-weight"): ZERO,
    ("reproduction", "gait", "--seed"): {"0"},
    ("reproduction", "vlip", "--friction"): ZERO,
    ("comparison", "speed", "--walks"): {"0"},
    ("comparison", "speed", "--starts"): {"0"},
    ("comparison", "--seed"): SEED,
    ("comparison", "--friction"): ZERO,
    ("comparison", "campaign", "--seed"): SEED,
    ("comparison", "campaign", "--joint-damping"): ZERO,
    ("comparison", "tune", "--seed"): SEED,
    ("comparison", "tune", "--joint-damping"): ZERO,
    ("comparison", "peers", "--friction"): ZERO,
    **{
        ("comparison", "worlds", name): {"0"}
        for name in ("--sequences", "--noisy", "--pushes", "--lasting")
    },
    **{("comparison", "causes", name): {"0"} for name in ("--sequences", "--lasting")},
    ("comparison", "senses", "--walks"): {"0"},
    ("comparison", "identification", "--logs"): {"0"},
}
"""What an option takes of the values above. One that is not here takes none of them."""
SAYS = {
    ("harpy", "walk", "--speed"): ("speed", "reach"),
    ("harpy", "film", "--speed"): ("velocity", "--speed"),
    ("reproduction", "vlip", "--dt"): ("dt", "duration"),
    ("comparison", "campaign", "--joint-damping"): ("joint damping", "joint-damping"),
    ("comparison", "tune", "--joint-damping"): ("joint damping", "joint-damping"),
}
"""Words of which the message has one, where the option's own name need not be there."""
OPTIONS = [
    (program, *command, option.names[0])
    for program, command, options, _ in commands()
    for option in options
    if {float, int} & {option.kind, *get_args(option.kind)}
]
"""Program, command and name of every option that is a number."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "a.npz"
    hp.walk(hp.Scenario(controller=hp.Governed(governor="none"), duration=0.01), save=path)
    return path


@pytest.fixture
def run(monkeypatch, tmp_path, log):
    """Runs a command up to its work: exit code (None where it was reached) and standard error."""
    others = {
        ("harpy", "view"): (log,),
        ("harpy", "film"): (tmp_path / "walk.gif",),
        ("reproduction", "paper"): ("--out", tmp_path / "paper"),
        ("comparison",): ("--out", tmp_path / "out"),
        ("comparison", "campaign"): ("--out", tmp_path / "campaign.jsonl"),
        ("comparison", "tune"): ("--out", tmp_path / "tune.jsonl"),
    }

    stop_before_work(monkeypatch)

    def run(program, *arguments):
        command = (program, *arguments[:-1])
        code, _, err = run_line(list(map(str, (*command, *others.get(command, ()), arguments[-1]))))
        return code, err

    return run


def test_all_commands_are_tried():
    """Both programs, and whatever has been written down here."""
    assert ACCEPTED.keys() | SAYS.keys() <= set(OPTIONS)
    assert len(OPTIONS) == len(set(OPTIONS)) > 25
    assert {option[:-1] for option in OPTIONS} >= {
        ("harpy", "walk"),
        ("reproduction", "gait"),
        ("comparison",),
    }


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


def test_a_value_may_be_written_as_it_is_printed():
    texts = ("a=(1.0, 20.0)", "b=((0.0, 0.3),)", "c=.5", "d=None", "e=True", "state=true")
    found = read_settings(texts)
    assert found == {
        "a": [1.0, 20.0],
        "b": [[0.0, 0.3]],
        "c": 0.5,
        "d": None,
        "e": True,
        "state": "true",
    }


SETTINGS = {
    **{
        "dt": set(),
        "period": set(),
        "duration": {"1e-300"},
        "gait.speed": ZERO,
        "gait.stiffness": set(),
    },
    **{"controller.mu": ZERO, "controller.weights.swing": ZERO, "controller.hold_ticks": {"0"}},
    **{"ground.mu_s": ZERO, "ground.stiffness": set(), "ground.slope": {*ZERO, "-1"}},
    **{"disturbances.noise": ZERO, "disturbances.delay": ZERO, "disturbances.mass_error": ZERO},
    **{
        "disturbances.seed": SEED,
        "disturbances.normal_error": {*ZERO, "-1"},
        "plant.foot_radius": ZERO,
    },
}
"""Numbers among the settings, and what they take of the values above."""


@pytest.mark.parametrize("name", SETTINGS)
def test_numbers_among_the_settings_are_accepted_or_refused_by_name(run, name):
    for value in VALUES:
        code, err = run("harpy", "walk", f"--set={name}={value}")
        if value in SETTINGS[name]:
            assert code is None, (value, err)
            continue
        assert code == 2, (value, err)
        assert len(err.strip().splitlines()) == 1, (value, err)
        words = (
            name.rpartition(".")[2].replace("_", " "),
            "reach",
            "physics step",
            "number",
            "multiple",
        )
        assert any(word in err.replace("_", " ") for word in words), (value, err)


@pytest.mark.parametrize(
    "push", ["nan:0,1,0", "inf:0,1,0", "1e308:0,1,0", "-1:0,1,0", "0.1:nan,0,0", "0.1:0,1e308,0"]
)
def test_pushes_are_refused_by_name(run, push):
    code, err = run("harpy", "walk", f"--push={push}")
    assert code == 2
    assert len(err.strip().splitlines()) == 1
    assert "push" in err or "impulse" in err
