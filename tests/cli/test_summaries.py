"""The lists of commands: every summary is whole on a terminal of 80 columns, and says what the
command is.
"""

import pytest
from typer.testing import CliRunner

from comparison.cli import app as comparison
from comparison.studies.robots import CONTROLLERS
from harpy_pin.cli.app import app as harpy
from harpy_pin.cli.walk import NAME_WIDTH
from harpy_pin.ground.ground import Ground
from harpy_pin.view import identity

LONGEST = 60


@pytest.mark.parametrize("app", [harpy, comparison])
@pytest.mark.parametrize("option", ["-h", "--help"])
def test_no_summary_is_cut(app, option):
    printed = CliRunner().invoke(app, [option], env={"COLUMNS": "80"})
    assert printed.exit_code == 0
    _, _, commands = printed.output.partition("Commands:\n")
    lines = [line for line in commands.partition("\n\n")[0].splitlines() if line]
    assert len(lines) >= 9
    for line in lines:
        name, summary = line.split(maxsplit=1)
        assert summary.endswith("."), name
        assert not summary.endswith("..."), name
        assert len(summary) <= LONGEST, name


@pytest.mark.parametrize("command", ["embedded", "delay", "robots"])
def test_the_condensed_controller_has_one_name(command):
    printed = CliRunner().invoke(comparison, [command, "--help"]).output
    assert "condensed" in printed
    assert " law" not in printed
    assert "law's" not in printed
    assert set(CONTROLLERS) == {"QP, own search", "condensed"}


def test_every_name_fits_its_column_of_the_demo():
    longest = max(len(controller.label) for controller in identity.CONTROLLERS.values())
    assert max(longest, len("Whole-body QP, ProxQP")) <= NAME_WIDTH


def test_the_help_of_walk_says_how_settings_are_set_and_the_default_of_friction():
    printed = " ".join(CliRunner().invoke(harpy, ["walk", "--help"]).output.split())
    assert "harpy settings" in printed.partition("--set ")[2]
    friction = printed.partition("Options:")[2].partition("--friction ")[2].partition("--speed")[0]
    assert f"default: {Ground().mu_s:g}]" in friction
