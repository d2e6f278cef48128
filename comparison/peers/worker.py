"""Runs a peer's worker in its own environment; whatever goes wrong there becomes a sentence, never an exception."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

from comparison.peers.environment import last_line

NOT_INSTALLED = "not installed: run python -m comparison peers --install"

TIMEOUT = 300.0
"""After which a worker is given up, s."""


class WorkerError(Exception):
    """The worker gave no result; the message says why."""


def run_worker(python: Path, worker: Path, problem: Path, result: Path, *, timeout: float = TIMEOUT) -> None:
    """Run a worker to its end, for at most so many seconds.

    Raises:
        WorkerError: there is no such interpreter, the worker crashed, or it wrote nothing.
    """
    if not python.exists():
        raise WorkerError(NOT_INSTALLED)
    # -I: neither this folder's modules nor PYTHONPATH come before those of the environment.
    command = [str(python), "-I", str(worker), str(problem), str(result)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=timeout)
    except subprocess.TimeoutExpired as error:
        raise WorkerError(f"no result after {timeout:g} s") from error
    except OSError as error:
        raise WorkerError(f"cannot be started: {error.strerror or error}") from error
    if done.returncode < 0:
        names = {int(known): known.name for known in signal.Signals}
        name = names.get(-done.returncode, f"signal {-done.returncode}")
        raise WorkerError(f"ended by {name}: {last_line(done.stderr)}")
    if done.returncode > 0:
        raise WorkerError(last_line(done.stderr))
    if not result.exists():
        raise WorkerError("ended without a result")
