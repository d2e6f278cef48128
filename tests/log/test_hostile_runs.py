"""Run files from strangers, as every command reads them: an answer, or one line of ours.

``--fuzz 40`` is 2,400 files.
"""

import numpy as np
import pytest
from entrances import again, page, use_figure, use_run
from hostile import outcome, spoil_mapping, spoil_signals, write_log

import harpy_pin as hp
from harpy_pin.scenario import Commanded, Condensed, Disturbances, Governed, Scenario
from harpy_pin.view.identity import robot_of

FILES = 60
ICE = hp.Ground(mu_s=0.3, friction_strips=((0.01, 0.1, 0.05),))
PUSHED = Disturbances(pushes=(hp.Push(0.01, (0.0, 1.0, 0.0)),))
SCENARIOS = (
    Scenario(
        controller=Condensed(parameters={"estimate_friction": True}),
        ground=ICE,
        disturbances=PUSHED,
        duration=0.06,
    ),
    Scenario(controller=Governed(governor="paper"), duration=0.06),
    Scenario(controller="condensed", gait=Commanded(), duration=0.06),
)


@pytest.fixture(scope="module")
def runs():
    """Signals and metadata of honest walks."""
    logs = [hp.walk(scenario) for scenario in SCENARIOS]
    return [(log.signals, {**log.metadata, "format": 1}) for log in logs]


@pytest.mark.filterwarnings(
    "ignore::RuntimeWarning", "ignore::UserWarning", "ignore::DeprecationWarning"
)
def test_hostile_files(runs, tmp_path, fuzz):
    rng = np.random.default_rng(1)
    read = 0
    for k in range(FILES * fuzz):
        signals, metadata = runs[k % len(runs)]
        if k % 3 != 1:
            signals = spoil_signals(rng, signals)
        if k % 3 != 2:
            metadata = spoil_mapping(rng, metadata)
        path = write_log(tmp_path / "run.npz", signals, metadata)
        read += use_run(path, walk=k % 5 == 0)
        if k % 10 == 0:
            use_figure(path)
    assert 0.5 * FILES * fuzz < read < 0.99 * FILES * fuzz  # most of them come past the first check


def test_an_endless_ending_makes_no_endless_message(runs, tmp_path):
    signals, metadata = runs[0]
    none = {name: values[:0] for name, values in signals.items()}
    run = hp.Run.load(write_log(tmp_path / "run.npz", none, {**metadata, "ending": "a" * 5000}))
    assert len(repr(run)) < 400
    with pytest.raises(hp.InputError, match="holds no tick") as caught:
        hp.view.replay_html([(run, hp.load_harpy())])
    assert len(str(caught.value)) < 400


ROWS = 60


@pytest.mark.parametrize(
    ("name", "signal", "says"),
    [
        ("x_r", np.zeros(ROWS), "x_r"),
        ("x_r", np.zeros((ROWS, 2)), "x_r"),
        ("slip_path", np.zeros((ROWS, 3)), "slip_path"),
        ("slip_path", np.zeros((ROWS, 2), dtype=bool), "slip_path"),
        ("slip_net", np.zeros(ROWS), "slip_net"),
        ("qp_status", np.zeros((ROWS, 2)), "qp_status"),
        ("bad_samples", np.full(ROWS, np.nan), "bad_samples"),
        ("bad_samples", np.full(ROWS, np.inf), "bad_samples"),
        ("bad_samples", np.full(ROWS, -1.0), "bad_samples"),
        ("bad_samples", np.zeros((ROWS, 2)), "bad_samples"),
    ],
)
def test_optional_signals_are_named(runs, name, signal, says):
    signals, metadata = runs[0]
    with pytest.raises(hp.InputError, match=says):
        hp.measure(hp.Run({**signals, name: signal}, metadata))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"control_period": 10**400}, "control_period"),
        ({"control_period": 0.0}, "control_period"),
        ({"control_period": "1 ms"}, "control_period"),
        ({"parameters": 5}, "parameters"),
        ({"parameters": {"gait": 5}}, "gait"),
        ({"parameters": {"gait": {"step_duration": 0}}}, "step_duration"),
        ({"parameters": {"gait": {"step_duration": 10**400}}}, "step_duration"),
        ({"parameters": {"gait": {"step_duration": None}}}, "step_duration"),
    ],
)
def test_optional_settings_are_named(runs, changes, says):
    signals, metadata = runs[0]
    with pytest.raises(hp.InputError, match=says):
        hp.measure(hp.Run(signals, {**metadata, **changes}))


@pytest.mark.parametrize("urdf", ["a" * 5000, "a\nb", "a\x00b"])
def test_paths_in_a_log_are_told_in_one_short_line(runs, urdf):
    signals, metadata = runs[2]
    run = hp.Run(signals, {**metadata, "scenario": {**metadata["scenario"], "urdf": urdf}})
    for answer in (robot_of, again):
        made, error = outcome(answer, run)
        assert made is None
        assert isinstance(error, hp.RobotError | hp.InputError)


@pytest.mark.parametrize("strips", [[1], [[1]], ["x"], [[0, 1, None]], {"x": 1}])
def test_pages_refuse_strips_that_are_none(runs, robot, strips):
    signals, metadata = runs[0]
    run = hp.Run(signals, {**metadata, "ground": {**metadata["ground"], "friction_strips": strips}})
    with pytest.raises(hp.InputError, match="strip"):
        page(run, robot)


@pytest.mark.parametrize("place", ["mu_s", "speed"])
def test_pages_leave_out_numbers_that_no_float_holds(runs, robot, place):
    signals, metadata = runs[1]
    if place == "mu_s":
        metadata = {**metadata, "ground": {**metadata["ground"], "mu_s": 10**400}}
    else:
        metadata = {**metadata, "parameters": {"gait": {"speed": 10**400}}}
    page(hp.Run(signals, metadata), robot)


def test_pages_take_ticks_that_were_never_timed(runs, robot):
    signals, metadata = runs[0]
    page(
        hp.Run({**signals, "tick_ns": np.where(np.arange(ROWS) == 0, np.inf, np.nan)}, metadata),
        robot,
    )
