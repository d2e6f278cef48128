"""Walks on the workers of a Dask cluster: the rows are this machine's own, whatever dies
meanwhile.
"""

import os
import signal
import socket
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from comparison.campaign import cluster, walks
from comparison.campaign.cluster import workers
from comparison.campaign.plan import CampaignSettings
from comparison.campaign.store import Store, do_missing, read_rows
from comparison.campaign.walks import run_campaign
from comparison.measure.walking import Progress, silent
from comparison.study import Job, Study
from harpy_pin.errors import HarpyError, InputError

LocalCluster = pytest.importorskip(
    "distributed", reason="clusters are the extra cluster"
).LocalCluster
SETTINGS = CampaignSettings(walks=12, duration=1.5, contenders=("governed/none", "condensed"))
MANY = range(40)


def started(count: int, threads: int = 1, *, processes: bool) -> Any:
    return LocalCluster(
        n_workers=count,
        threads_per_worker=threads,
        processes=processes,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    )


@pytest.fixture(scope="module")
def two_workers() -> Iterator[Any]:
    """A cluster of two processes."""
    with started(2, processes=True) as local:
        yield local


@pytest.fixture(scope="module")
def local_rows(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The file of the campaign as this process writes it."""
    path = tmp_path_factory.mktemp("local") / "rows"
    run_campaign(SETTINGS, path)
    return path.read_bytes()


def nobody_walks_here(*_: object) -> Any:
    raise AssertionError("a walk was begun in this process")


def slowly(number: int) -> dict[str, Any]:
    time.sleep(0.05)
    return {"square": number**2}


def squares(path: Path, progress: Progress = silent) -> None:
    """Many short jobs whose rows are kept in a file."""
    with Store(path) as store:
        do_missing(store, {str(number): number for number in MANY}, slowly, progress)


def test_rows_are_the_same_to_the_bit(
    two_workers: Any, local_rows: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(walks, "walk_task", nobody_walks_here)
    seen: list[tuple[int, int]] = []
    with workers(two_workers.scheduler_address):
        run_campaign(
            SETTINGS, tmp_path / "rows", progress=lambda done, total: seen.append((done, total))
        )
    assert (tmp_path / "rows").read_bytes() == local_rows
    assert seen == [(done, 12) for done in range(13)]


def test_a_worker_that_is_killed_loses_its_walks_only(
    two_workers: Any, local_rows: bytes, tmp_path: Path
) -> None:
    victim = two_workers.workers[0].pid

    def kill(done: int, total: int) -> None:
        if done == 3:
            os.kill(victim, signal.SIGKILL)

    with workers(two_workers.scheduler_address):
        run_campaign(SETTINGS, tmp_path / "rows", progress=kill)
    assert (tmp_path / "rows").read_bytes() == local_rows
    assert two_workers.workers[0].pid != victim


def deadly(number: int) -> dict[str, Any]:
    os.kill(os.getpid(), signal.SIGKILL)
    return {}


def test_a_walk_that_kills_its_workers_is_one_line(
    two_workers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(two_workers.scheduler, "allowed_failures", 0)
    with (
        Store(tmp_path / "rows") as store,
        pytest.raises(
            HarpyError,
            match=r"workers died of the same walk, the last one was tcp://127.0.0.1:\d+; the same",
        ),
        workers(two_workers.scheduler_address),
    ):
        do_missing(store, {"": 1}, deadly, silent)


def process_of(job: Job) -> dict[str, Any]:
    return {"process": os.getpid()}


def test_what_is_timed_stays_here(two_workers: Any) -> None:
    study = Study(
        name="places",
        help=None,
        defaults={},
        quick={},
        jobs=lambda _: [{"number": 1}, {"number": 2}],
        timed=lambda _: [{"number": 3}],
        measure=process_of,
        views=[],
    )
    with workers(two_workers.scheduler_address):
        first, second, timed = (row["process"] for row in study.run())
    assert timed == os.getpid()
    assert os.getpid() not in (first, second)


def test_ctrl_c_cancels_what_waits_and_keeps_what_is_done(two_workers: Any, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 3:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt), workers(two_workers.scheduler_address):
        squares(tmp_path / "rows", interrupt)
    assert [row["square"] for row in read_rows(tmp_path / "rows")[0].values()] == [0, 1, 4]
    end = time.monotonic() + 30.0
    while two_workers.scheduler.tasks and time.monotonic() < end:
        time.sleep(0.01)
    assert not two_workers.scheduler.tasks


def test_a_worker_with_other_code_is_refused_before_any_walk(
    two_workers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = cluster.code_digest()
    monkeypatch.setattr(cluster, "code_digest", lambda: "newer")
    refused = rf"the worker tcp://127.0.0.1:\d+ is refused for its code {theirs} \(here newer\)"
    with pytest.raises(HarpyError, match=refused), workers(two_workers.scheduler_address):
        nobody_walks_here()
    monkeypatch.setattr(
        cluster, "_require_same_everywhere", lambda client: None
    )  # as of one that comes later
    with pytest.raises(HarpyError, match=refused), workers(two_workers.scheduler_address):
        squares(tmp_path / "rows")
    assert read_rows(tmp_path / "rows")[0] == {}


def test_a_worker_that_cannot_import_the_code_is_named() -> None:
    with pytest.raises(
        HarpyError, match="the worker tcp://there:1 cannot walk: ModuleNotFoundError: comparison"
    ):
        cluster.require_same(
            cluster.identity(), {"tcp://there:1": ModuleNotFoundError("comparison")}
        )


def test_walks_do_not_share_a_process() -> None:
    with (
        started(1, threads=2, processes=False) as threads,
        pytest.raises(HarpyError, match=r"is refused for its threads 2 \(here 1\)"),
        workers(threads.scheduler_address),
    ):
        nobody_walks_here()


def test_a_scheduler_that_goes_away_leaves_what_is_done(tmp_path: Path) -> None:
    path, vanishing = tmp_path / "rows", started(1, processes=False)

    def close(done: int, total: int) -> None:
        if done == 3:
            vanishing.close()

    with (
        pytest.raises(HarpyError, match="is gone; the same command goes on"),
        workers(vanishing.scheduler_address),
    ):
        squares(path, close)
    kept = path.read_bytes()
    assert 3 <= kept.count(b"\n") < len(MANY)
    squares(path)
    assert path.read_bytes().startswith(kept)
    assert [row["square"] for row in read_rows(path)[0].values()] == [number**2 for number in MANY]


def test_the_library_is_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        HarpyError, match=r"--scheduler needs 'distributed': pip install .*\[cluster\]"
    ):
        workers("tcp://127.0.0.1:1").__enter__()


def test_nobody_listens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "SECONDS", 0.2)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(HarpyError, match=f"no Dask scheduler answers at tcp://127.0.0.1:{port}"):
        workers(f"tcp://127.0.0.1:{port}").__enter__()
    with pytest.raises(
        InputError, match=r"the address of a scheduler is like tcp://.*, not 'localhost'"
    ):
        workers("localhost").__enter__()
    with (
        started(0, processes=False) as empty,
        pytest.raises(HarpyError, match="has no workers: install the same checkout"),
    ):
        workers(empty.scheduler_address).__enter__()
