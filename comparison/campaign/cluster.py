"""Walks on the workers of a Dask cluster, instead of a process for each core of this machine.

A worker has the code, versions and arithmetic of this process, so that rows are the same to the
bit; one that has others is refused. Walks of a worker that dies are done again by the others.
"""

from __future__ import annotations

import hashlib
import logging
import math
import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from comparison.campaign.plan import code_digest
from comparison.measure.walking import PLACE
from harpy_pin.errors import HarpyError, InputError, install_line, reason, shown
from harpy_pin.log.run import describe_versions
from harpy_pin.simulation.mujoco import installed_version

if TYPE_CHECKING:
    from distributed import Client, Worker

SECONDS = 5.0
"""How long a scheduler may take to answer, and to have a worker."""
START = (
    "install the same checkout there, and start workers by: dask worker ADDRESS --nworkers=-1 "
    "--nthreads=1"
)
GOES_ON = "the same command goes on with what is kept"


@contextmanager
def workers(scheduler: str | None) -> Iterator[None]:
    """Within the block, the workers of a Dask scheduler walk; with None this machine does.

    Args:
        scheduler: its address, such as ``tcp://10.0.0.1:8786``.

    Raises:
        HarpyError: nobody answers there, it has no workers, or one is refused.
    """
    if scheduler is None:
        yield
        return
    if not re.fullmatch(r"(tcp|tls)://\S+:\d{1,5}", scheduler):
        raise InputError(
            f"the address of a scheduler is like tcp://10.0.0.1:8786, not {shown(scheduler)}",
            name="scheduler",
            value=scheduler,
        )
    with _connected(scheduler):
        pass  # what is wrong with it is said before anything else is done
    before = PLACE.set(partial(_on_workers, scheduler))
    try:
        yield
    finally:
        PLACE.reset(before)


def _on_workers(
    scheduler: str, walk: Callable[[Any], dict[str, Any]], jobs: Sequence[Any]
) -> Generator[dict[str, Any]]:
    """A row for each job, in their order.

    The connection ends with the walks: its thread would wake up while ticks are timed.
    """
    if not jobs:
        return
    with _connected(scheduler) as client:
        work = partial(_walked, walk, identity())
        yield from client.get_executor(pure=False).map(work, jobs)


def _walked(
    walk: Callable[[Any], dict[str, Any]], here: Mapping[str, str], job: Any
) -> dict[str, Any]:
    """A row, on a worker, which may have come after the others were compared."""
    from distributed import get_worker

    require_same(here, {get_worker().address: identity(get_worker())})
    return walk(job)


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    """A client of a scheduler whose workers are as this process is."""
    try:
        from distributed import Client, KilledWorker
        from distributed.comm.core import CommClosedError
    except ImportError as error:
        raise HarpyError(f"--scheduler needs 'distributed': {install_line('cluster')}") from error
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # errors are raised here
    try:
        client = Client(scheduler, timeout=SECONDS, set_as_default=False)
    except OSError as error:
        raise HarpyError(f"no Dask scheduler answers at {scheduler}") from error
    with client:
        try:
            _require_same_everywhere(client)
            yield client
        except (CommClosedError, CancelledError) as error:
            raise HarpyError(f"the scheduler {scheduler} is gone; {GOES_ON}") from error
        except KilledWorker as error:
            last = error.last_worker.address
            raise HarpyError(
                f"workers died of the same walk, the last one was {last}; {GOES_ON}"
            ) from error


def _require_same_everywhere(client: Client) -> None:
    try:
        client.wait_for_workers(1, timeout=SECONDS)
        client.run_on_scheduler(arithmetic)
    except TimeoutError as error:
        raise HarpyError(f"the scheduler has no workers: {START}") from error
    except ImportError as error:
        raise HarpyError(
            f"the scheduler cannot read what is to be walked: {error}; {START}"
        ) from error
    require_same(identity(), client.run(identity, on_error="return"))


def require_same(here: Mapping[str, str], workers: Mapping[str, Any]) -> None:
    """Refuse workers that would find other rows.

    Args:
        here: :func:`identity` of this process.
        workers: that of each worker, or the error that asking it ended with, by its address.

    Raises:
        HarpyError: names the worker, and what differs.
    """
    for address, there in workers.items():
        if isinstance(there, Exception):
            raise HarpyError(f"the worker {address} cannot walk: {reason(there)}; {START}")
        other = [
            f"{name} {there[name]} (here {here[name]})"
            for name in here
            if there[name] != here[name]
        ]
        if other:
            raise HarpyError(f"the worker {address} is refused for its {', '.join(other)}; {START}")


def identity(dask_worker: Worker | None = None) -> dict[str, str]:
    """What decides the rows of this process: versions, code, arithmetic, and threads that walk in
    it.

    Args:
        dask_worker: the worker that this process is; it passes itself.
    """
    threads = 1 if dask_worker is None else dask_worker.state.nthreads
    return describe_versions() | {
        "mujoco": str(installed_version()),
        "code": code_digest(),
        "arithmetic": arithmetic(),
        "threads": str(threads),
    }


@cache
def arithmetic() -> str:
    """Hash of results whose last digits depend on the processor.

    BLAS and the C library choose their kernels by it; rows of the same code then differ in
    them.
    """
    a = np.random.default_rng(0).standard_normal((32, 32))
    functions = (math.sin, math.cos, math.exp, math.atan)
    found = (
        a @ a,
        a @ a[0],
        np.linalg.solve(a, a[0]),
        np.linalg.cholesky(a @ a.T),
        np.sin(a),
        np.array([function(x) for function in functions for x in a.flat]),
    )
    return hashlib.sha256(b"".join(one.tobytes() for one in found)).hexdigest()[:24]
