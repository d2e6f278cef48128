"""Contact models that are not ours: what is walked, what of the slip is creep, and the tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import comparison.contacts as study
import harpy_pin as hp
from comparison import landing
from comparison.contacts import ContactsSettings, contact_tables, walk_contacts
from harpy_pin import InputError


@pytest.fixture(scope="module")
def rows():
    patch = pytest.MonkeyPatch()
    patch.setattr(study, "WALKERS", ("governed/none", "condensed", study.GENTLE))
    settings = ContactsSettings(
        robots=("harpy",), contacts=("ours", "MuJoCo default"), frictions=(0.25,), starts=2, duration=1.5
    )
    yield walk_contacts(settings)
    patch.undo()


def of(rows, contact, walker):
    return [row for row in rows if (row["contact"], row["walker"]) == (contact, walker)]


def test_everyone_walks_on_every_contact_from_every_start(rows):
    assert len({(row["contact"], row["walker"], row["start"]) for row in rows}) == len(rows) == 2 * 3 * 2
    one, other = of(rows, "ours", "condensed")
    assert one["path_mm"] != other["path_mm"]


def test_creep_is_taken_apart(rows):
    """Ours does not creep. On MuJoCo's own contact all that the law slips is creep, and assuming less makes less."""
    assert all(row["creep_mm"] == 0.0 for row in rows if row["contact"] == "ours")
    for full, gentle in zip(*(of(rows, "MuJoCo default", w) for w in ("condensed", study.GENTLE)), strict=True):
        assert full["creep_mm"] == pytest.approx(full["path_mm"], rel=0.03)
        assert gentle["creep_mm"] < 0.6 * full["creep_mm"]
    for row in of(rows, "MuJoCo default", "governed/none"):
        assert row["path_mm"] > 1.2 * row["creep_mm"]
        assert row["sliding"] > 3.0 * max(row["sliding"] for row in of(rows, "MuJoCo default", "condensed"))


def test_tables_say_what_the_rows_say(rows):
    table, brief = contact_tables(rows)
    cell = table.get("MuJoCo default: condensed WBC", "path")
    paths = sorted(row["path_mm"] for row in of(rows, "MuJoCo default", "condensed"))
    assert (cell.low, cell.high) == tuple(paths)
    assert cell.value == pytest.approx(0.5 * sum(paths))
    nets = [row["net_mm"] for row in of(rows, "MuJoCo default", "condensed")]
    shown = brief.get("MuJoCo default", "condensed WBC").value.split(" / ")
    assert list(map(float, shown)) == pytest.approx([0.5 * sum(paths), 0.5 * sum(nets)], rel=5e-3)
    fallen = [{**row, "ending": "fell"} if row["start"] else row for row in rows]
    table, brief = contact_tables(fallen)
    assert brief.get("ours", "gentle").value == "fell / fell"
    assert table.get("ours: gentle", "fell").value == "1 of 2"
    assert table.get("ours: gentle", "path").value == "fell"


def test_engines_that_are_not_installed_are_left_out(monkeypatch):
    monkeypatch.setattr(study, "installed_version", lambda: None)
    monkeypatch.setattr(study, "find_spec", lambda name: None)
    assert study._installed(study.CONTACTS, tuple(study.CONTACTS)) == ["ours"]
    assert {case["robot"] for case in study._cases(ContactsSettings())} == {"harpy", "go2"}
    monkeypatch.setattr(study, "installed_data", lambda: None)
    assert {case["robot"] for case in study._cases(ContactsSettings())} == {"harpy"}


def test_finished_walks_are_kept(tmp_path, monkeypatch):
    walked = []

    def walk(job):
        walked.append(job)
        return {**job[0], "ending": "completed"}

    monkeypatch.setattr(study, "_walked", walk)
    settings, path = ContactsSettings(contacts=("ours",), starts=1, duration=1.5), tmp_path / "contacts.jsonl"
    first = walk_contacts(settings, None, path)
    done = len(walked)
    assert done == len(first) > 2
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-2]) + lines[-1][:10])  # it was stopped in the middle of a line
    assert walk_contacts(settings, None, path) == first
    assert len(walked) == done + 2
    walk_contacts(replace(settings, duration=1.0), None, path)
    assert len(walked) == 2 * done + 2, "walks of other settings are others"


class Log(dict):
    """Two feet, seven ticks of 25 ms; the slip of every tick is another power of two, mm."""

    ending = "completed"

    def __init__(self):
        self.metadata = {"control_period": 0.025}
        way = 1e-3 * 2.0 ** np.arange(6)
        path = np.concatenate(([0.0], np.cumsum(way)))
        stance = np.array([0, 0, 1, 1, 1, 1, 0])
        depth, load = np.array([0, 1, 2, 3, 4, 5, 6]) * 1e-3, np.array([0.0, 1, 1, 1, 1, 1, 1])
        feet = np.ones(2)
        super().__init__(
            slip_path=np.outer(path, (1.0, 0.0)),
            stance=np.outer(stance, feet),
            foot_force=np.multiply.outer(load, np.outer(feet, (0.0, 0.0, 5.0))),
            foot_position=-np.multiply.outer(depth, np.outer(feet, (0.0, 0.0, 1.0))),
            steps=np.array([0, 0, 0, 1, 1, 2, 2]),
        )


def test_slip_is_told_by_the_part_of_a_stance():
    row = landing.landing_row(Log(), np.full((6, 2), 1e-3))
    assert row["air_mm"] == pytest.approx((1 + 32) / 2)  # before the stance and after it
    assert row["landing_mm"] == pytest.approx((2 + 4) / 2)  # its first 50 ms
    assert row["stance_mm"] == pytest.approx((8 + 16) / 2)
    assert row["path_mm"] == pytest.approx(63 / 2)
    assert row["creep_mm"] == pytest.approx(1e3 * 1e-3 * 0.025 * 12 / 2)
    assert row["sinks_mm"] == pytest.approx(3.5)
    table = landing.landing_table([{"contact": "ours", "friction": 0.6, "walker": "wbc", **row}])
    assert table.get("ours, friction 0.6: WBC QP", "landing").value == pytest.approx(3.0)


def test_the_soft_ground_is_as_stiff_as_menagerie_contact():
    """Two parts of one settings file: the stiffness that Go2's weight finds, by the closed form of the contact."""
    pytest.importorskip("mujoco")
    made = hp.build(landing.landing_scenario(landing.MENAGERIE, 0.6, "condensed", 0.1)).simulator
    load = made.robot.mass * 9.81 / 4.0
    inverse = float(made.inverse_mass.mean())
    depth = load / landing.landing_scenario(landing.SOFT, 0.6, "condensed", 0.1).ground.stiffness
    rests = made.contact.normal_force(depth, inverse_mass=inverse, friction=0.6)
    assert rests == pytest.approx(load, rel=0.01)


def test_settings_out_of_their_domain():
    with pytest.raises(InputError, match="contact"):
        ContactsSettings(contacts=("bullet",))
    with pytest.raises(InputError, match="frictions"):
        ContactsSettings(frictions=(0.0,))
