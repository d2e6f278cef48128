"""Every study in small: its document makes its tables, and they say what was walked."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from needs import needs_robots
from PIL import Image

import harpy_pin as hp
from comparison.cli.studies import STUDIES
from comparison.contenders import OWN
from comparison.measure.walking import Rows
from comparison.studies import contacts, ice, limits, steering, thrusters, walking
from comparison.studies.crossings import CROSSINGS
from comparison.studies.flights import FLIGHTS
from comparison.studies.slopes import static_bound, what_happens
from comparison.tables import Table
from harpy_pin.files import finite

TINY: dict[str, dict[str, Any]] = {
    "built": {"walkers": ("governed/none", "condensed"), "frictions": (0.5,), "duration": 0.5},
    "assumption": {
        "walkers": ("governed/none", "condensed"),
        "errors": (0.0, 1.5),
        "duration": 3.0,
    },
    "grounds": {"walkers": ("governed/none", "governed/paper"), "duration": 0.1},
    "contacts": {
        "walkers": ("governed/none", "condensed", contacts.GENTLE),
        "starts": 2,
        "duration": 1.0,
    },
    "crossings": {},
    "delay": {"delays": (0, 2), "noises": (0.5,), "duration": 0.5},
    "flights": {"names": ("walk", "jump 0.4 m")},
    "ice": {"duration": 2.5},
    "limits": {
        "torque": (0.5,),
        "damping": (50.0,),
        "bandwidth": (),
        "viscous": (),
        "duration": 0.2,
    },
    "plants": {
        "walkers": ("governed/none", "condensed"),
        "duration": 0.1,
        "repetitions": 1,
        "laps": 4,
    },
    "optima": {"states": 2, "absurd": 5, "rounds": 2},
    "pushes": {"plants": ("compliant",)},
    "robots": {"robots": ("solo12", "solo8"), "duration": 1.0},
    "speed": {"duration": 0.3, "pushes": 0},
    "slopes": {
        "degrees": (0.0, 30.0),
        "frictions": (0.1, 0.8),
        "walkers": ("no_thrust", "go2"),
        "duration": 0.2,
    },
    "steering": {"course": 1.0, "duration": 3.0, "pushes": ()},
    "thrusters": {"lags": (0.1,), "duration": 0.2},
    "walking": {"course": 1.0, "duration": 2.0},
    "rates": {"size": 16, "rounds": 1},
    "senses": {"course": 3.0},
    "slip": {"frictions": (0.2,), "duration": 0.3},
}
"""Settings of a look, with even less."""
ELSEWHERE = {"cassie", "causes", "embedded", "identification", "recorded", "worlds"}
"""Studies with tests of their own."""
OF_ROBOTS = ("crossings", "optima", "pushes", "robots", "slopes", "speed", "walking")
_found: dict[str, Rows] = {}


def rows_of(name: str) -> Rows:
    """The study's rows, measured once."""
    if name not in _found:
        _found[name] = STUDIES[name].run(quick=True, **TINY[name])
    return _found[name]


def tables_of(name: str, rows: Rows | None = None) -> dict[str, Table]:
    return {
        table.name: table for table in STUDIES[name].tables(rows_of(name) if rows is None else rows)
    }


def test_every_study_is_looked_at():
    assert STUDIES.keys() == TINY.keys() | ELSEWHERE


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=needs_robots if n in OF_ROBOTS else ()) for n in TINY]
)
def test_a_document_makes_the_tables(name):
    """Its rows are told apart by their jobs, JSON holds them, and the tables made of them fit a
    terminal.
    """
    study, rows = STUDIES[name], rows_of(name)
    settings = study.settings(quick=True, **TINY[name])
    jobs = [*study.jobs(settings), *study.timed(settings)]
    assert len({str(job) for job in jobs}) == len(jobs) == len(rows)
    assert all(row.items() >= finite(job).items() for row, job in zip(rows, jobs, strict=True))
    read = json.loads(json.dumps(rows, allow_nan=False))
    texts = [table.to_string(80) for table in study.tables(read)]
    assert texts == [table.to_string(80) for table in study.tables(rows)] != []
    for text in texts:
        assert max(map(len, text.splitlines())) <= 80
        assert len(text.splitlines()) > 2


def test_grounds_show_slip_or_when_a_walk_fell():
    rows = [dict(row) for row in rows_of("grounds")]
    assert all(row["ending"] == "completed" and 20.0 < row["normal_n"] < 60.0 for row in rows)
    assert len({row["path_mm"] for row in rows if row["walker"] == "governed/paper"}) > 8
    rows[0] |= {"ending": "fell", "end_time_s": 1.5}
    tables = tables_of("grounds", rows)
    assert tables["grounds_0.25_path"].get("no governor", "4 kN/m").value == "fell at 1.50 s"
    fine = [row for row in rows if (row["ground"], row["walker"]) == ("40 kN/m", "governed/paper")][
        -1
    ]
    found = tables["grounds_engines"].number("paper's governor, 0.25, 40 kN/m", "half the step")
    assert found == fine["path_mm"]


def test_plants_show_slip_or_how_many_fell():
    rows = [dict(row) for row in rows_of("plants")]
    walks = [
        row for row in rows if row.get("plant") == "pinocchio" and row["walker"] == "condensed"
    ]
    assert {row["friction"] for row in walks} == {0.8, 0.25}
    (slick,) = (row for row in walks if row["friction"] == 0.25)
    tables = tables_of("plants", rows)
    assert (
        tables["plants_0.25_path"].get("condensed", "pinocchio").value == f"{slick['path_mm']:.2f}"
    )
    slick["ending"] = "fell"
    assert (
        tables_of("plants", rows)["plants_0.25_net"].get("condensed", "pinocchio").value
        == "fell 1/1"
    )
    (times,) = (row for row in rows if row.get("robot") == "harpy")
    assert tables["plants_times"].number("harpy", "pin.aba") == times["aba"]["p50"] > 0.0


def on(contact: str, walker: str) -> Rows:
    return [
        row for row in rows_of("contacts") if (row["contact"], row["walker"]) == (contact, walker)
    ]


def test_creep_is_taken_apart():
    """Ours does not creep. On MuJoCo's own contact all that the law slips is creep, and assuming
    less makes less.
    """
    assert all(row["creep_mm"] == 0.0 for row in rows_of("contacts") if row["contact"] == "ours")
    for full, gentle in zip(
        *(on("MuJoCo default", w) for w in ("condensed", contacts.GENTLE)), strict=True
    ):
        assert full["creep_mm"] == pytest.approx(full["path_mm"], rel=0.03)
        assert gentle["creep_mm"] < 0.6 * full["creep_mm"]
    for row in on("MuJoCo default", "governed/none"):
        assert row["path_mm"] > 1.2 * row["creep_mm"]
        assert row["sliding"] > 3.0 * max(
            row["sliding"] for row in on("MuJoCo default", "condensed")
        )


def test_tables_of_contacts_have_median_least_and_largest():
    walks = on("MuJoCo default", "condensed")
    assert walks[0]["path_mm"] != walks[1]["path_mm"]  # of two starts
    table, brief = tables_of("contacts").values()
    cell = table.get("MuJoCo default: condensed WBC", "path")
    paths, nets = (sorted(row[name] for row in walks) for name in ("path_mm", "net_mm"))
    assert (cell.low, cell.high, cell.unit) == (*paths, "mm")
    assert cell.value == pytest.approx(0.5 * sum(paths))
    shown = brief.get("MuJoCo default", "condensed WBC").value.split(" / ")
    assert list(map(float, shown)) == pytest.approx([0.5 * sum(paths), 0.5 * sum(nets)], rel=5e-3)
    fallen = [{**row, "ending": "fell"} if row["start"] else row for row in rows_of("contacts")]
    table, brief = tables_of("contacts", fallen).values()
    assert brief.get("ours", "gentle").value == "fell / fell"
    assert table.get("ours: gentle", "fell").value == "1 of 2"
    assert table.get("ours: gentle", "path").value == "fell"


@needs_robots
def test_a_look_comes_through_and_goals_are_behind_the_last_step():
    assert [row["through"] for row in rows_of("crossings")] == [True, True]
    assert all(0.0 <= row["slip_mm_per_step"] < 5.0 for row in rows_of("crossings"))
    assert tables_of("crossings")["crossings"].get("Go2, 20° up", "compliant").value == "1 of 1"
    for one in CROSSINGS.values():
        begin, end = one.ground(one.tries).height((0.0, one.goal), (0.0, 0.0))
        if "steps" in one.name:
            assert abs(end - begin) > 0.35


def test_those_who_fall_late_are_those_whose_margin_is_less():
    rows = rows_of("delay")
    fallen = {row["walker"] for row in rows if row["fell_s"] is not None}
    assert fallen == {"PID, none", "PID, paper", "PID, filter"}
    joints, tasks, walks = tables_of("delay").values()
    assert walks.columns == ["0 ms", "2 ms", "0.5 × noise"]
    # What the tables predict is what happened.
    whole = [row for row in joints.rows if row.startswith("all")]
    assert max(joints.number(row, "margin, PID") for row in whole) < 2.0
    assert min(joints.number(row, "margin, feedforward") for row in whole) > 2.0
    assert min(tasks.number(row, "margin") for row in tasks.rows) > 2.0


def test_the_estimate_of_friction_keeps_slip_on_ice_small():
    rows = rows_of("ice")
    assert len(rows) == 2 * len(ice.WALKERS) * len(ice.SENSORS)
    for off, estimated in zip(rows[::2], rows[1::2], strict=True):
        assert (off["estimate"], estimated["estimate"]) == (False, True)
        assert off["lowest_estimate"] is None
        assert estimated["lowest_estimate"] < 0.8
        if off["walker"] == "condensed":
            assert max(off["ice_mm"]) > 10.0 * max(estimated["ice_mm"])
    (table,) = tables_of("ice").values()
    assert table.get("condensed WBC, exact, estimate on", "fell").value == "0 of 1"


def test_slip_belongs_to_the_step_it_happens_in():
    """Three steps: on good ground, on ice, and behind it, with 1, 20 and 3 mm."""
    t = np.arange(2250) * 1e-3
    step = np.floor(t / 0.75 + 1e-9)
    position, force, path = np.zeros((2250, 2, 3)), np.zeros((2250, 2, 3)), np.zeros((2250, 2))
    position[:, 0, 0], force[:, 0, 2] = np.array([0.1, 0.7, 1.5])[step.astype(int)], 30.0
    path[:, 0] = np.cumsum(np.array([1.0, 20.0, 3.0])[step.astype(int)] * 1e-3 / 750)
    run = hp.Run(
        {"t": t, "foot_position": position, "foot_force": force, "slip_path": path},
        {"ending": "completed"},
    )
    slips = ice.slips(run, 0.6, 1.2)
    assert slips["ice_mm"] == pytest.approx([20.0])
    assert slips["after_mm"] == pytest.approx([3.0])
    assert not slips["fell"]


def test_at_limits_controllers_and_robot_get_what_the_job_says():
    for job in STUDIES["limits"].jobs(STUDIES["limits"].settings(quick=True, **TINY["limits"])):
        scenario, share = limits.scenario(job), 0.5 if job["kind"] == "torque" else 1.0
        actuators = scenario.disturbances.actuators
        assert actuators.torque_share == share
        assert actuators.coulomb_friction == (0.3 if job["kind"] == "coulomb" else 0.0)
        if scenario.controller.name == "condensed":
            assert (
                scenario.controller.parameters.get("limits", {}).get("torque_scale", 1.0) == share
            )
        if job["kind"] == "damping":
            with open(scenario.urdf) as file:
                assert file.read().count('damping="5"') == 6


def test_tables_show_falls_or_the_median():
    row = {"gait": "straight", "friction": 0.8, "kind": "damping", "value": 50.0, "walker": "none"}
    rows = [{**row, "fell": fell, "slip_mm_per_step": 0.25} for fell in (True, False)]
    summary, table = tables_of("limits", rows).values()
    assert table.get("damping 5 N·m·s/rad", "none").value == "fell 1/2"
    assert summary.get("none", "limits: fell").value == "1 of 2"
    assert (
        tables_of("limits", rows[1:])["limits_straight_0.8"]
        .get("damping 5 N·m·s/rad", "none")
        .value
        == "0.25"
    )
    row = {"plant": "ours", "friction": 0.25, "bandwidth": 50.0, "lag": 0.1, "walker": "QP"}
    row |= {"turning_lag": 0.0, "failing": None, "thrust_n": 8.0, "thrust_w": 300.0}
    rows = [{**row, "fell": fell, "slip_mm_per_step": 0.25} for fell in (True, False)]
    place = ("100 ms, motors of 50 Hz", "QP")
    _, *found = tables_of("thrusters", rows).values()
    assert [table.get(*place).value for table in found] == ["fell 1/2", "", ""]
    _, *found = tables_of("thrusters", rows[1:]).values()
    assert [table.get(*place).value for table in found] == ["0.25", "8", "300"]
    for change, named in (
        ({"turning_lag": 0.05}, "directions 50 ms"),
        ({"failing": 0.5}, "50 % of one left"),
    ):
        found = tables_of("thrusters", [{**rows[1], "lag": 0.0, "bandwidth": None, **change}])
        assert found["thrusters_slip_ours_0.25"].get(named, "QP").value == "0.25"


def test_thrusters_and_those_who_know_them_get_what_the_job_says():
    more = {"lags": (0.0, 0.1), "bandwidths": (None, 50.0), "plants": ("ours", "MuJoCo")}
    for job in STUDIES["thrusters"].jobs(STUDIES["thrusters"].settings(quick=True, **more)):
        scenario = thrusters.scenario(job)
        actuators, known = scenario.disturbances.actuators, dict(scenario.controller.parameters)
        assert known.pop("solver", None) == ("active_set" if "QP" in job["walker"] else None)
        assert actuators.bandwidth == job["bandwidth"]
        assert (actuators.thrusters.lag, actuators.thrusters.turning_lag) == (
            job["lag"],
            job["turning_lag"],
        )
        assert (actuators.thrusters.failing or (0, 0, None))[2] == job["failing"]
        if "knows" in job["walker"]:
            assert known == {"thrust_lag": job["lag"], "thrust_turning_lag": job["turning_lag"]}
            assert job["lag"] + job["turning_lag"] > 0.0
        else:
            assert not known


def steered(**changes: Any) -> hp.Scenario:
    job = {
        "what": "pushed",
        "controller": "condensed",
        "plant": "compliant",
        "number": 5,
        "impulse": 10.0,
    }
    return steering.scenario(job | {"duration": 7.0, "seed": 3, **changes})


def test_steering_of_one_number_has_one_command_friction_and_push():
    scenario = steered()
    for same in (steered(controller=OWN), steered(plant="mujoco")):
        for name in ("gait", "ground", "disturbances"):
            assert getattr(same, name) == getattr(scenario, name)
    assert np.linalg.norm(scenario.disturbances.pushes[0].impulse) == pytest.approx(10.0)
    harder = steered(impulse=12.0)
    assert harder.gait == scenario.gait
    assert harder.disturbances.pushes[0].time == scenario.disturbances.pushes[0].time
    assert steered(number=6).gait != scenario.gait != steered(seed=4).gait


@pytest.mark.parametrize("what", steering.FRICTIONS)
def test_commands_are_drawn_within_the_walk(what):
    low, high = steering.FRICTIONS[what]
    for number in range(20):
        scenario = steered(what=what, duration=6.0, seed=0, number=number, impulse=0.0)
        assert low <= scenario.ground.mu_s <= high
        assert 0.3 <= scenario.gait.velocity[-1][0] < 5.0


def test_a_look_at_steering_walks_every_kind_and_counts_falls_apart():
    rows = rows_of("steering")
    assert {row["what"] for row in rows} == {"course", "random", "slippery", "absurd"}
    assert not any(row["fell"] for row in rows)
    assert (
        tables_of("steering")["steering_commands"].get("course, compliant, condensed", "fell").value
        == "0 of 1"
    )
    rows = [{**rows[0], "what": "pushed", "impulse": 12.0, "fell": k < 2} for k in range(3)]
    pushes = tables_of("steering", rows)["steering_pushes"]
    assert pushes.get("12 N·s, condensed", "fell").value == "2 of 3"


def test_jumps_are_measured():
    walk, jump = rows_of("flights")
    assert walk["stands"]
    assert jump["stands"]
    assert jump["distance_m"] == pytest.approx(0.42, abs=0.03)
    assert jump["place_mm"] == pytest.approx(1e3 * abs(jump["distance_m"] - 0.42), abs=5.0)
    assert 1.0 < jump["peak"] <= 2.0
    assert jump["cost"] == pytest.approx(jump["energy_j"] / (4.02 * 9.81 * 0.42))
    assert walk["power_w"] == pytest.approx(walk["energy_j"] / 6.0)
    assert jump["cost"] > walk["cost"] > 0.0


def test_tables_of_flights_have_the_worst_of_all_and_slopes_side_by_side():
    def rows(flight: str, stands: bool, **measures: float) -> Rows:
        who = {"flight": flight, "controller": "condensed", "seed": 200, "stands": stands}
        worse = {name: 2.0 * value for name, value in measures.items()}
        return [
            {**who, "plant": plant, **found}
            for plant, found in (("compliant", measures), ("mujoco", worse))
        ]

    walks = (
        rows("walk", True, cost=30.0)
        + rows("walk, 20° up", True, cost=90.0)
        + rows("jump 0.4 m, 20° up", False)
    )
    tables = tables_of(
        "flights", walks + rows("fly 2 m to 15° up, walk on", True, cost=1.0, slip_mm=0.5)
    )
    uphill, everything = tables["flights_uphill"], tables["flights_all"]
    assert [uphill.get("walk", f"{angle}°").value for angle in (0, 20)] == ["60", "180"]
    assert uphill.get("jump 0.4 m", "20°").value == "2 of 2 fall"
    assert "fly 2 m to 15° up" not in uphill.rows
    assert everything.get("fly 2 m to 15° up, walk on", "slip, mm").value == "1"
    assert everything.get("walk", "stands").value == "2 of 2"


@pytest.mark.parametrize("name", list(FLIGHTS))
def test_every_flight_is_as_its_row_says(name):
    one = FLIGHTS[name]
    scenario = one.scenario("QP", "mujoco", 7)
    fans = scenario.disturbances.actuators.thrusters
    lag = next((k for k in (30, 100, 300) if f"{k} ms" in name), 0)
    assert fans.lag == one.lag == pytest.approx(1e-3 * lag)
    assert scenario.controller.parameters.get("thrust_lag", 0.0) == (
        one.lag if "known" in name else 0.0
    )
    assert (fans.failing is not None) == ("half" in name)
    assert (scenario.plant.name, scenario.disturbances.seed) == ("mujoco", 7)
    slope = next((k for k in (10, 15, 20) if f"{k}°" in name), 0) * (-1 if "down" in name else 1)
    terrain = scenario.ground.terrain
    rise = (
        0.0
        if terrain is None
        else float(np.diff(terrain.height(np.array([2.0, 2.1]), np.zeros(2)))[0])
    )
    assert np.degrees(np.arctan(rise / 0.1)) == pytest.approx(slope, abs=1e-6)


@needs_robots
def test_robots_stand_or_say_why_they_do_not():
    standing, times = tables_of("robots").values()
    assert standing.number("solo12", "mass") == pytest.approx(2.5, abs=0.01)
    assert standing.get("solo8", "stands, condensed").value == "yes"
    assert times.rows[:2] == ["solo12, QP, own search", "solo12, condensed"]


@needs_robots
def test_a_look_at_walking_falls_nowhere_and_times_the_ticks():
    rows = rows_of("walking")
    assert [row["what"] for row in rows if "fell" not in row] == ["ticks"]
    assert not any(row.get("fell") for row in rows)
    tables = tables_of("walking")
    assert (
        len(tables) == len(rows) + 1
    )  # one for each kind of walk, one for the robot, one of ticks
    assert tables["walking_course_compliant_condensed"].get("solo12", "fell").value == "0 of 1"
    assert tables["walking_ticks"].number("solo12", "over 2 ms") == rows[-1]["late"]


def walked(**changes: Any) -> hp.Scenario:
    return walking.scenario(
        walking.job_of(
            **{"robot": "solo12", "what": "random", "duration": 4.0, "seed": 3} | changes
        )
    )


@needs_robots
def test_walks_of_one_number_have_one_command_and_friction_and_pushes_come_from_every_side():
    scenario = walked(number=5)
    for same in (walked(number=5, controller=OWN), walked(number=5, plant="mujoco")):
        for name in ("gait", "ground", "disturbances"):
            assert getattr(same, name) == getattr(scenario, name)
    assert walking.DRAWN[0] <= scenario.ground.mu_s <= walking.DRAWN[1]
    assert walked(number=6).gait != scenario.gait
    late = walked(number=5, what="random, noise and delay")
    assert late.gait == scenario.gait
    assert late.disturbances.delay > 0.0
    fastest = hp.WalkingGait(hp.load_robot("solo12")).describe()["max_speed"]
    assert np.abs(np.array(scenario.gait.velocity)[:, 1:3]).max() <= fastest
    pushes = [
        walked(robot="g1", what="pushed", number=k).disturbances.pushes[0].impulse
        for k in range(walking.SIDES)
    ]
    np.testing.assert_allclose(np.linalg.norm(pushes, axis=1), 0.15 * hp.load_robot("g1").mass)
    np.testing.assert_allclose(np.sum(pushes, axis=0), 0.0, atol=1e-9)


def jobs_of(**changes: Any) -> list[SimpleNamespace]:
    return [
        SimpleNamespace(**job)
        for job in STUDIES["walking"].jobs(STUDIES["walking"].settings(**changes))
    ]


@needs_robots
def test_robots_on_soles_walk_ten_metres_and_turn_by_a_right_angle():
    jobs = [job for job in jobs_of(robots=("go2", "icub")) if job.what == "ten metres"]
    assert [(job.robot, job.plant) for job in jobs] == [("icub", "compliant"), ("icub", "mujoco")]
    rows = walking.scenario(vars(jobs[0])).gait.velocity
    ends = [row[0] for row in rows[1:]] + [jobs[0].duration]
    spans = np.array([end - row[0] for row, end in zip(rows, ends, strict=True)])
    assert spans[0] * rows[0][1] > 10.0
    assert rows[0][1] >= 0.2
    assert np.sum(spans * [row[3] for row in rows]) >= np.pi / 2
    assert not any(rows[-1][1:])


def test_courses_are_walked_by_all_controllers_in_both_engines():
    """Joint PD walks legs of three joints, and all that the law walks."""
    jobs = jobs_of(robots=("go2", "g1"), walks=1, walks_on_four=1, pushes=1)
    courses = [job for job in jobs if job.what == "course"]
    assert len({(job.robot, job.controller, job.plant) for job in courses}) == len(courses) == 10
    assert not any(job.what == "crawl" and job.robot == "g1" for job in jobs)
    by = {
        who: {
            (job.what, job.plant, job.number)
            for job in jobs
            if job.robot == "go2" and job.controller == who
        }
        for who in ("condensed", "joint_pd")
    }
    assert by["joint_pd"] == by["condensed"]
    assert not any(job.controller == "joint_pd" and job.robot == "g1" for job in jobs)


def test_a_row_of_each_robot_has_slip_and_falls_of_every_kind_of_walk():
    def walk(what: str, slip: float, **other: Any) -> dict[str, Any]:
        same = {
            "robot": "go2",
            "controller": "condensed",
            "plant": "compliant",
            "fell": False,
            "path_rms_mm": 12.0,
        }
        return {
            **same,
            "what": what,
            "slip_mm_per_step": slip,
            "speed_m_s": 1.0,
            "joint_power_w": 1.0,
            **other,
        }

    rows = [
        walk("course", 0.5, speed_m_s=1.6),
        walk("course", 0.25, plant="mujoco", path_rms_mm=99.0),
        walk("friction 0.1", 9.0, fell=True),
        walk("crawl", 0.125),
        walk("pace", 1.0, fell=True),
        *(walk("random", slip, fell=slip > 2.0) for slip in (1.0, 2.0, 3.0)),
    ]
    table = tables_of("walking", rows)["walks_condensed"]
    assert {column: table.get("go2", column).value for column in table.columns} == {
        **{
            "speed": 1.6,
            "course": "0.50 / 0.25",
            "friction 0.3": "– / –",
            "off path": 12.0,
            "friction 0.1": "falls",
        },
        **{"crawl, pace, bound": "0.12, falls", "random": "2.00, 1 of 3 falls"},
    }


@needs_robots
def test_torques_of_a_heavy_robot_are_those_of_the_qp():
    """Of 87 kg forces weigh so little that a multiplier of 1e-7 is worth newtons."""
    row = walking.ticks_of(walked(robot="hyq", duration=3.0, seed=1000, number=4))
    assert row["apart_worst"] < 1e-5
    assert 0.0 < row["apart"] < 1e-6


def test_a_wrong_friction_makes_feet_slip_beyond_the_margin():
    """The margin of 0.4 covers an error of 150 %; an estimate brings most of what is beyond it
    back.
    """
    rows = STUDIES["assumption"].run(
        quick=True, walkers=("governed/none", "condensed"), errors=(0.0, 1.5, 4.0)
    )
    slip = {(row["walker"], row["estimate"], row["error"]): row["slip_mm_per_step"] for row in rows}
    right, within, wrong = (slip["condensed", False, error] for error in (0.0, 1.5, 4.0))
    estimated = slip["condensed", True, 4.0]
    assert within < 3.0 * right < wrong
    assert estimated < 0.5 * wrong
    assert (
        slip["governed/none", False, 0.0] == slip["governed/none", False, 4.0]
    )  # it assumes nothing


@pytest.mark.parametrize(
    ("degrees", "friction"), [(15.0, 0.29), (15.0, 0.25), (30.0, 0.6), (30.0, 0.55)]
)
def test_without_thrust_it_stands_up_to_the_angle_of_friction(degrees, friction):
    without, least = static_bound(degrees, friction)
    assert without == (np.tan(np.radians(degrees)) <= friction)
    assert least is not None
    assert (least < 1e-6) == without


def test_little_thrust_is_what_friction_lacks():
    """Thrust along x at the feet's line alone would be W (tan θ − μ) / (1 + μ tan θ); the bound
    needs no less.
    """
    least = static_bound(15.0, 0.2)[1]
    tangent = np.tan(np.radians(15.0))
    assert least is not None
    assert 4.02 * 9.81 * (tangent - 0.2) / (1.0 + 0.2 * tangent) == pytest.approx(least, rel=0.02)


@needs_robots
@pytest.mark.parametrize(("name", "degrees"), [("go2", 10.0), ("go2", 30.0), ("g1", 10.0)])
def test_robots_without_thrusters_stand_up_to_the_angle_of_friction(name, degrees):
    tangent = np.tan(np.radians(degrees))
    assert static_bound(degrees, 0.98 * tangent, name) == (False, None)
    assert static_bound(degrees, 1.02 * tangent, name) == (True, 0.0)


@needs_robots
def test_go2_topples_on_steep_ground():
    """However rough that is: no place that its legs reach is above its feet."""
    assert static_bound(65.0, 10.0, "go2") == (False, None)


@needs_robots
def test_the_map_is_drawn(tmp_path):
    rows = rows_of("slopes")
    happens = {(row["walker"], row["degrees"], row["friction"]): what_happens(row) for row in rows}
    assert happens["no_thrust", 0.0, 0.8] == happens["go2", 0.0, 0.8] == "stands"
    assert happens["go2", 30.0, 0.1] in (
        "not possible",
        "stands",
    )  # within 0.2 s it may slide little
    STUDIES["slopes"].figure(rows).savefig(tmp_path / "map.png")
    assert Image.open(tmp_path / "map.png").size[0] > 400
