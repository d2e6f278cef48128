"""Fixtures shared by the tests: the robot, a sled, and random states for hypothesis."""

from __future__ import annotations

import os

os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # before NumPy: its threads cost small matrices ten times the time

import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pinocchio as pin
import pytest
from needs import CHECKS, chromium, missing, needed

import harpy_pin as hp
from harpy_pin.kernels import kernels
from harpy_pin.view.page.film import SWITCHES

if (
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):  # as in a job that a shell runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)

hypothesis.settings.register_profile(
    "harpy",
    deadline=None,
    derandomize=True,
    max_examples=100,
    suppress_health_check=[hypothesis.HealthCheck.too_slow, hypothesis.HealthCheck.filter_too_much],
)
hypothesis.settings.load_profile("harpy")


SLED = """<robot name="sled">
  <link name="base"><inertial><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial></link>
  <link name="skid"/>
  <joint name="skid_fixed" type="fixed"><parent link="base"/><child link="skid"/></joint>
</robot>"""
"""One rigid body of 2 kg that touches the ground at its centre of mass: contact never turns it."""


_OF_THE_COMPARISON = ("campaign", "comparison", "report", "sections")
"""Files whose tests share ``whole_document``, or run the comparison in processes of their own."""
_NEEDS = "needs "
"""How the reason begins for which a test is skipped, before the names of what it lacks."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The comparison first, which takes longest; with ``--needing`` only tests that need what it
    names.

    Tests marked ``long`` run only with ``--long``.
    """
    long, demanded = config.getoption("--long"), set(config.getoption("--needing"))

    def left(item: pytest.Item) -> bool:
        runs = long or not item.get_closest_marker("long")
        return runs and (not demanded or bool(demanded & needed(item)))

    config.hook.pytest_deselected(items=[item for item in items if not left(item)])
    items[:] = filter(left, items)
    items.sort(key=lambda item: item.path.stem.removeprefix("test_") not in _OF_THE_COMPARISON)


def pytest_configure(config: pytest.Config) -> None:
    """What ``--needing`` names must be there."""
    if names := missing(config.getoption("--needing")):
        raise pytest.UsageError(f"--needing: no {' and no '.join(names)} on this machine")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """A test that needs what is missing is skipped."""
    if names := missing(needed(item)):
        pytest.skip(_NEEDS + " and ".join(names))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """What was missing, and how many tests did not run for want of it."""
    reasons = [report.longrepr[2] for report in terminalreporter.stats.get("skipped", [])]
    counted = Counter(reason.partition(_NEEDS)[2] for reason in reasons if _NEEDS in reason)
    if counted:
        told = ", ".join(f"{names} ({count})" for names, count in counted.most_common())
        terminalreporter.write_line(f"tests not run for want of: {told}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With ``-n 2`` (pytest-xdist) a file stays in one process, and the files of the comparison
    stay together.

    The files are begun in the order of :func:`pytest_collection_modifyitems`.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::", 1)[0]
            name = Path(file).stem.removeprefix("test_")
            return "comparison" if name in _OF_THE_COMPARISON else file

    config.option.loadscopereorder = False
    return ByFile(config, log)


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--long``, ``--fuzz N`` and ``--needing NAME,NAME``."""
    parser.addoption(
        "--long",
        action="store_true",
        help="also run the tests marked long, most of which compile much",
    )
    parser.addoption(
        "--fuzz", type=int, default=1, metavar="N", help="multiply the number of random cases by N"
    )
    told = "only the tests that need this, which must be there; may be repeated"
    parser.addoption("--needing", action="append", default=[], choices=CHECKS, help=told)


class _Waiting:
    """In the place of the threads that compile: the turn of what is begun never comes, so that
    calls compile.
    """

    def __call__(self) -> _Waiting:
        return self

    def submit(self, *_: object) -> Future[None]:
        return Future()

    def shutdown(self, **_: object) -> None:
        """Nothing is under way."""

    cache_clear = shutdown


@pytest.fixture(scope="session", autouse=True)
def compiled_when_called() -> Iterator[Callable[[], object]]:
    """Kernels are compiled when they are called, not ahead: most that are prepared are called by no
    test.

    Returns:
        The function that has the threads, for tests of what is compiled in the background.
    """
    threads = kernels._workers
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "_workers", _Waiting())
        yield threads


@pytest.fixture
def compiled_ahead(
    compiled_when_called: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernels are compiled in the background, as users have it."""
    monkeypatch.setattr(kernels, "_workers", compiled_when_called)


@pytest.fixture(scope="session")
def fuzz(request: pytest.FixtureRequest) -> int:
    """How many times as many random cases as usual."""
    return int(request.config.getoption("--fuzz"))


@pytest.fixture(scope="session")
def robot() -> hp.Robot:
    """Harpy, from the packaged URDF."""
    return hp.load_harpy()


@pytest.fixture
def gait(robot: hp.Robot) -> hp.Gait:
    """Harpy's straight walk."""
    return hp.make_gait(robot)


@pytest.fixture(scope="session")
def go2() -> hp.Robot:
    """Go2, of a test that needs the catalogue's robots."""
    return hp.load_robot("go2")


@pytest.fixture(scope="session")
def g1() -> hp.Robot:
    """G1 on its soles, of a test that needs the catalogue's robots."""
    return hp.load_robot("g1")


@pytest.fixture(scope="session")
def solo12() -> hp.Robot:
    """Solo12, of a test that needs the catalogue's robots."""
    return hp.load_robot("solo12")


@pytest.fixture(scope="session")
def undamped(robot: hp.Robot) -> hp.Robot:
    """Harpy without joint damping: it conserves energy in free flight."""
    model = robot.model.copy()
    model.damping = np.zeros(model.nv)
    return replace(robot, model=model)


@pytest.fixture(scope="session")
def sled(tmp_path_factory: pytest.TempPathFactory) -> hp.Robot:
    """A point mass with a foot, for closed forms."""
    path = tmp_path_factory.mktemp("sled") / "sled.urdf"
    path.write_text(SLED)
    return hp.load_robot(path, feet=("skid",))


@pytest.fixture(scope="session")
def draw_state(robot: hp.Robot):  # type: ignore[no-untyped-def]
    """A function of a random generator: configuration (joints within limits) and velocity of
    Harpy.
    """

    def draw(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        q = np.empty(13)
        q[:3] = rng.uniform(-1.0, 1.0, 3)
        q[3:7] = pin.Quaternion(pin.exp3(rng.uniform(-2.0, 2.0, 3))).coeffs()
        q[7:] = rng.uniform(robot.joint_lower, robot.joint_upper)
        return q, rng.uniform(-3.0, 3.0, 12)

    return draw


@pytest.fixture
def urdf_with(robot: hp.Robot, tmp_path: Path):  # type: ignore[no-untyped-def]
    """A function that writes Harpy's URDF with one piece of text replaced, and returns the path."""
    text = robot.urdf.read_text()

    def write(old: str, new: str) -> Path:
        assert old in text
        path = tmp_path / "changed.urdf"
        path.write_text(text.replace(old, new, 1))
        return path

    return write


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    root = str(Path(__file__).resolve().parents[1])
    build = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(folder),
        root,
    ]
    subprocess.run(build, check=True, capture_output=True, timeout=600)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Playwright's headless Chromium, which reaches this machine only; while it is open, an event
    loop runs.
    """
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium(), args=SWITCHES)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def whole_document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """A result of the comparison, as small as it gets."""
    root = str(Path(__file__).resolve().parents[1])
    if root not in sys.path:
        sys.path.insert(0, root)  # the comparison lives in the checkout, not in the wheel
    from comparison.benchmark import Settings, compare
    from comparison.campaign.plan import CampaignSettings, code_digest, plan
    from comparison.campaign.store import Store
    from comparison.campaign.walks import walk_task
    from comparison.measure.timing import TimingSettings

    timing = TimingSettings(repetitions=2, warm_up=10, block=60, settle=5, programs=40, samples=5)
    campaign = CampaignSettings(walks=1, duration=1.5)
    rows, code = tmp_path_factory.mktemp("campaign") / "rows.jsonl", code_digest()
    with Store(rows) as store:
        for task in plan(campaign):
            store.append(task.key(code), {"measures": walk_task(task)})
    settings = Settings(duration=0.25, timing=timing, campaign=campaign)
    return compare(settings, rows=rows)
