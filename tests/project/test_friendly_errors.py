"""What a newcomer tries first and the library has under another name: the message says what to
write instead.
"""

import pickle
from collections.abc import Callable
from pathlib import Path

import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin import errors


class Failing:
    """A controller that looks for what is not there."""

    def __init__(self, gait: hp.Gait | None = None) -> None:
        self.gait = gait

    def step(self, state: hp.State) -> hp.Command:
        return {}["swing"]


def refused(call: Callable[[], object], *says: str) -> None:
    with pytest.raises((hp.InputError, TypeError)) as error:
        call()
    assert "\n" not in str(error.value)
    assert all(words in str(error.value) for words in says)


@pytest.mark.parametrize("walk", [hp.walk, hp.scenario.build])
def test_a_controller_where_its_maker_is_expected(walk: Callable[..., object]) -> None:
    made = "a function or a class that makes the controller from the gait"
    refused(lambda: walk(hp.Scenario(), controller=Failing()), made)


@needs_robots
def test_parts_that_a_robot_has_not() -> None:
    refused(
        lambda: hp.Scenario(robot="solo8", gait="walking"),
        "'solo8' has a leg of fewer than three joints",
    )
    wrong = hp.Walking(schedule="walk")
    refused(lambda: hp.Scenario(robot="go2", gait=wrong), "valid names: bound, crawl, pace, stand")


def test_install_lines_fit_how_it_was_installed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        errors.install_line("live")
        == f'pip install -e "{Path(__file__).resolve().parents[2]}[live]"'
    )
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "harpy_pin" / "errors.py"))
    monkeypatch.setattr(
        errors,
        "requires",
        lambda name: ["numpy>=2.0", "a<2,>=1; extra == 'live'", "b; extra == 'x'"],
    )
    assert errors.install_line("live") == 'pip install "a<2,>=1"'
    monkeypatch.setattr(errors, "PUBLISHED", True)
    assert errors.install_line("live") == 'pip install "harpy-pin[live]"'


def test_errors_come_whole_from_another_process():
    raised = (
        errors.ControlError("fell", time=0.5, run="log"),
        errors.InputError("no", name="mu", value=-1.0),
    )
    for error in raised:
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
