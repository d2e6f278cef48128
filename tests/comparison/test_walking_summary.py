"""A row for each robot: medians of its slip, and how many of its walks fell."""

from comparison.walking_summary import summary_tables

WALK = {"robot": "go2", "controller": "condensed", "plant": "compliant", "fell": False, "path_rms_mm": 12.0}


def walk(what, slip, **other):
    return {**WALK, "what": what, "slip_mm_per_step": slip, "speed_m_s": 1.0, **other}


def test_slip_and_falls_of_every_kind_of_walk():
    rows = [
        walk("course", 0.5, speed_m_s=1.6),
        walk("course", 0.25, plant="mujoco", path_rms_mm=99.0),
        walk("friction 0.1", 9.0, fell=True),
        walk("crawl", 0.125),
        walk("pace", 1.0, fell=True),
        *(walk("random", slip, fell=slip > 2.0) for slip in (1.0, 2.0, 3.0)),
    ]
    (table,) = summary_tables(rows)
    told = {column: table.get("go2", column).value for column in table.columns}
    assert told == {
        "speed": 1.6,
        "course": "0.50 / 0.25",
        "friction 0.3": "– / –",
        "off path": 12.0,
        "friction 0.1": "falls",
        "crawl, pace, bound": "0.12, falls",
        "random": "2.00, 1 of 3 falls",
    }
