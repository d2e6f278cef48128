"""Contact models that are not ours: what is walked, what of the slip is creep, and the tables."""

from __future__ import annotations

import pytest

import comparison.contacts as study
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
    (table,) = contact_tables(rows)
    cell = table.get("MuJoCo default: condensed WBC", "path")
    paths = sorted(row["path_mm"] for row in of(rows, "MuJoCo default", "condensed"))
    assert (cell.low, cell.high) == tuple(paths)
    assert cell.value == pytest.approx(0.5 * sum(paths))
    fallen = [{**row, "ending": "fell"} if row["start"] else row for row in rows]
    (table,) = contact_tables(fallen)
    assert table.get("ours: gentle", "fell").value == "1 of 2"
    assert table.get("ours: gentle", "path").value == "fell"


def test_engines_that_are_not_installed_are_left_out(monkeypatch):
    monkeypatch.setattr(study, "installed_version", lambda: None)
    monkeypatch.setattr(study, "find_spec", lambda name: None)
    assert study._installed(study.CONTACTS, tuple(study.CONTACTS)) == ["ours"]


def test_settings_out_of_their_domain():
    with pytest.raises(InputError, match="contact"):
        ContactsSettings(contacts=("bullet",))
    with pytest.raises(InputError, match="frictions"):
        ContactsSettings(frictions=(0.0,))
