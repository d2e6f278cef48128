"""Ctrl-C and SIGTERM at random moments of every long command, compiling included.

Each has the exit code that is documented, leaves no process and no temporary file behind, prints no
traceback, and cuts no result: a file is there whole, or not at all. ``--fuzz 20`` sends some 200
signals.
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
import typer
from processes import living, needs_proc

import harpy_pin as hp
from harpy_pin.cli.ending import stopping
from harpy_pin.files import Shield, journal_path

ROOT = Path(__file__).resolve().parents[2]
MARK = "HARPY_PIN_SIGNALLED"
PATIENCE = 600.0
"""For a command and its processes to end, s; nothing measures it."""
SOON = 3.0
"""Until which moment commands are signalled without ``--fuzz``, s."""

pytestmark = needs_proc


class Case(NamedTuple):
    """A long command."""

    words: str  # of the command; OUT stands for a folder of its own, RUN for a log
    lasts: float  # until which moment it is signalled, s
    cold: bool = False  # whether nothing was compiled before
    codes: tuple[int, ...] = (0,)  # with which it may end by itself before the signal
    needs: tuple[str, ...] = ()  # programs


CASES = {
    "walk": Case("harpy_pin walk --duration 500 --save OUT/run.npz --json OUT/numbers.json", 3.0),
    "short walk": Case(
        "harpy_pin walk --duration 1 --save OUT/run.npz --json OUT/numbers.json", 2.0
    ),
    "walk, compiling": Case("harpy_pin walk --duration 1 --save OUT/run.npz", 12.0, cold=True),
    "compile": Case("harpy_pin compile", 15.0, cold=True),
    "view": Case("harpy_pin view RUN", 3.0),
    "view --html": Case("harpy_pin view RUN --html OUT/page.html", 2.0),
    "view --gif": Case(
        "harpy_pin view RUN --gif OUT/film.gif --size 160x100", 6.0, needs=("chromium",)
    ),
    "live": Case(
        "harpy_pin live --no-browser --save OUT/run.npz --json OUT/numbers.json --speed 0.2", 6.0
    ),
    "live, compiling": Case("harpy_pin live --no-browser --save OUT/run.npz", 12.0, cold=True),
    "gait": Case("reproduction gait --search paper --budget 500 --out OUT/gait.toml", 5.0),
    "comparison": Case("comparison --quick --json OUT/numbers.json", 25.0),
    "steering": Case("comparison steering --quick --json OUT/numbers.json", 12.0),
    "campaign": Case("comparison campaign --quick --out OUT/walks.jsonl", 15.0),
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log to look at."""
    path = tmp_path_factory.mktemp("log") / "run.npz"
    hp.walk(hp.Scenario(duration=0.3)).save(path)
    return path


def is_ready(process: subprocess.Popen[str]) -> bool:
    """Whether Python has started and come to the command's first line, where SIGTERM gets a
    handler.
    """
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (signal.SIGTERM - 1) & 1) or process.poll() is not None


def shown_by_shells(code: int) -> int:
    """The exit code; Python itself is ended by a signal that comes when it is almost gone."""
    return 128 - code if code < 0 else code


def check_whole(folder: Path) -> None:
    """Every file in it can be read to its end."""
    for path in folder.rglob("*"):
        assert not path.name.endswith(".part"), path
        if path.suffix == ".npz":
            assert len(hp.Run.load(path)) > 0
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".toml":
            assert "gait" in tomllib.loads(path.read_text())
        elif path.suffix == ".gif":
            assert path.read_bytes().endswith(b";")
        elif path.suffix == ".html":
            assert path.read_text().rstrip().endswith("</html>")


def signalled(
    case: Case, folder: Path, log: Path, moment: float, number: int, *, to_all: bool
) -> None:
    """Run a command, and end it by a signal.

    Args:
        case: the command.
        folder: empty, for its files.
        log: to look at.
        moment: of the signal, s after the command's first line.
        number: of the signal.
        to_all: to all of its processes, as Ctrl-C in a terminal, or to the first one only.
    """
    (folder / "out").mkdir(parents=True)
    temporary = Path(tempfile.mkdtemp(prefix="s"))  # short: names of sockets in it have an end
    words = case.words.replace("OUT", str(folder / "out")).replace("RUN", str(log)).split()
    mark = f"{os.getpid()}-{time.monotonic_ns()}"
    environment = {**os.environ, MARK: mark, "TMPDIR": str(temporary), "BROWSER": "true"}
    if case.cold:
        environment["HARPY_PIN_CACHE"] = str(folder / "cache")
    process = subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        while not is_ready(process):
            time.sleep(0.005)
        time.sleep(moment)
        ended = process.poll() is not None
        if not ended:
            (os.killpg if to_all else os.kill)(process.pid, number)
        out, err = process.communicate(timeout=PATIENCE)
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    told = f"{words} at {moment:.3f} s\n{out[-1000:]}\n{err[-4000:]}"
    assert "Traceback" not in out + err, told
    code = shown_by_shells(process.returncode)
    assert code in (case.codes if ended else (128 + number, *case.codes)), (code, told)
    deadline = time.monotonic() + PATIENCE
    while (left := list(living(f"{MARK}={mark}", file="environ"))) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not left, (left, told)
    check_whole(folder / "out")
    assert not journal_path(folder / "out" / "run.npz").exists()
    assert not [path for path in temporary.iterdir() if path.name.startswith("harpy")], told
    shutil.rmtree(temporary, ignore_errors=True)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.needs(*CASES[name].needs)) for name in CASES]
)
def test_signals_at_random_moments(name: str, log: Path, tmp_path: Path, fuzz: int) -> None:
    rng = random.Random(name)
    case = CASES[name]
    lasts = case.lasts if fuzz > 1 else min(case.lasts, SOON)
    for k in range(max(1, fuzz)):
        number, to_all = rng.choice((signal.SIGINT, signal.SIGTERM)), rng.random() < 0.5
        signalled(case, tmp_path / str(k), log, rng.uniform(0.0, lasts), number, to_all=to_all)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_that_waited_decides_the_exit_code(number: int, code: int) -> None:
    """It came while results were written, and the command ended with them, as runs do."""

    def command() -> None:
        with Shield(saving=True) as shield:
            signal.raise_signal(number)
            shield.late = None
        raise hp.Interrupted("written", run=None)

    with pytest.raises(typer.Exit) as caught:
        stopping(command)()
    assert caught.value.exit_code == code


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_a_class_is_made(number: int, code: int, capsys) -> None:
    class Signals:
        def __set_name__(self, owner: type, name: str) -> None:
            signal.raise_signal(number)

    def command() -> None:
        type("Made", (), {"member": Signals()})

    with pytest.raises(typer.Exit) as caught:
        stopping(command)()
    assert caught.value.exit_code == code
    assert capsys.readouterr().err == "harpy: interrupted; nothing more was written\n"


def test_errors_of_other_kinds_stay() -> None:
    def command() -> None:
        raise RuntimeError("no signal")

    with pytest.raises(RuntimeError, match="no signal"):
        stopping(command)()


@pytest.mark.parametrize("moment", [0.02, 0.1, 0.3])
def test_a_signal_while_compiling_leaves_no_folder(
    moment: float, log: Path, tmp_path: Path
) -> None:
    signalled(CASES["walk, compiling"], tmp_path, log, moment, signal.SIGTERM, to_all=False)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signals_while_modules_are_imported(
    number: int, code: int, tmp_path: Path, log: Path
) -> None:
    """Without a word, and with the exit code that shells expect."""
    for moment in (0.0, 0.05, 0.1):
        process = subprocess.Popen(
            [sys.executable, "-m", "harpy_pin", "info"], cwd=ROOT, stderr=subprocess.PIPE
        )
        while not is_ready(process):  # type: ignore[arg-type]
            time.sleep(0.001)
        time.sleep(moment)
        process.send_signal(number)
        said = process.communicate(timeout=PATIENCE)[1]
        assert b"Traceback" not in said
        assert shown_by_shells(process.returncode) in ((code,) if moment == 0.0 else (code, 0))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_page_ends_with_the_code_of_the_signal(number: int, log: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "harpy_pin", "view", str(log)],
        cwd=ROOT,
        env={**os.environ, "BROWSER": "true"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    lines = iter(process.stdout.readline, "")
    assert any(line.startswith("replay of harpy: http") for line in lines)
    process.send_signal(number)
    said = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 128 + number
    assert said in ("", "harpy: interrupted; nothing more was written\n")
