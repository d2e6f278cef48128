"""Coverage-guided fuzzing of everything that reads data from strangers, by Atheris (``pip install atheris``).

    python tests/support/fuzzing.py scenario -max_total_time=900

The first argument is one of ``urdf``, ``run``, ``figure``, ``scenario`` and ``command``; the others are libFuzzer's.
What breaks something is printed, and its input is written to ``tests/project/corpus``, where
``tests/project/test_corpus.py`` replays it. The fuzzer goes on after a defect: one input is kept for each line of code
that raises.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import pkgutil
import re
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import atheris
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
CORPUS = ROOT / "tests" / "project" / "corpus"
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]
PACKAGES = ("harpy_pin", "comparison.cli", "reproduction.cli")
with atheris.instrument_imports(include=[*PACKAGES, "typer", "click"]):
    for package in map(importlib.import_module, PACKAGES):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith("__main__"):
                importlib.import_module(found.name)

import command_lines  # noqa: E402
import hostile  # noqa: E402
import hostile_lines  # noqa: E402
from entrances import ENTRANCES  # noqa: E402
from hostile import choose  # noqa: E402

import harpy_pin as hp  # noqa: E402
from harpy_pin.scenario import Commanded, Condensed, Governed, Scenario  # noqa: E402

SLOW = 10.0
"""Seconds after which an answer is reported; nothing fails by it."""
ANY = "any value whatever"
"""Stands in tables of values for what the fuzzer makes up."""
WORDS = sorted(
    {
        word
        for folder in ("scenario", "controllers", "gaits", "log", "view", "model", "simulation", "cli")
        for file in (ROOT / "harpy_pin" / folder).rglob("*.py")
        for word in re.findall(r'"([\w.-]{2,25})"', file.read_text())
    }
)
"""Texts of the library's code: names that it looks for."""


class Choices:
    """Draws as NumPy's generator does, from the fuzzer's bytes."""

    def __init__(self, data: bytes) -> None:
        self.provider = atheris.FuzzedDataProvider(data)

    def integers(self, low: int, high: int | None = None, size: int | None = None) -> Any:
        low, high = (0, int(low)) if high is None else (int(low), int(high))
        if size is None:
            return self.provider.ConsumeIntInRange(low, high - 1)
        return np.array([self.integers(low, high) for _ in range(int(size))], dtype=int)

    def standard_normal(self, shape: tuple[int, ...]) -> Any:
        return np.full(shape, self.provider.ConsumeFloat())

    def value(self, depth: int = 2) -> Any:
        """Whatever JSON can hold."""
        kind = self.integers(9 if depth else 7)
        if kind < 3:
            return (None, bool(self.integers(2)), self.provider.ConsumeInt(9))[kind]
        if kind < 5:
            return self.provider.ConsumeFloat() if kind == 3 else self.provider.ConsumeFloatInRange(-2.0, 2.0)
        if kind < 7:
            return self.word() if kind == 5 else self.provider.ConsumeUnicode(12)
        entries = range(self.integers(5))
        if kind == 7:
            return [self.value(depth - 1) for _ in entries]
        return {self.word(): self.value(depth - 1) for _ in entries}

    def word(self) -> str:
        return str(choose(self, WORDS))  # type: ignore[arg-type]

    def filled(self, data: Any) -> Any:
        """Nested data with something made up wherever :data:`ANY` stands."""
        if isinstance(data, dict):
            return {key: self.filled(value) for key, value in data.items()}
        if isinstance(data, list):
            return [self.filled(value) for value in data]
        return self.value() if data == ANY else data

    def text(self, text: str) -> str:
        """Text with something made up wherever :data:`ANY` stands in it."""
        while ANY in text:
            made = self.provider.ConsumeUnicode(12).encode(errors="replace").decode()
            text = text.replace(ANY, made or str(self.value(0)).encode(errors="replace").decode(), 1)
        return text


class Fuzzer:
    """Makes inputs of one kind from bytes, uses them, and keeps what breaks something."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.kind, self.folder, self.seen = kind, folder, set[str]()
        self.urdf = hp.load_harpy().urdf.read_text()
        scenarios = (
            Scenario(controller=Condensed(parameters={"estimate_friction": True}), duration=0.006),
            Scenario(controller=Governed(governor="paper"), duration=0.006),
            Scenario(controller="wbc", gait=Commanded(), duration=0.006),
        )
        logs = [hp.walk(scenario) for scenario in scenarios]
        self.runs = [(log.signals, {**log.metadata, "format": 1}) for log in logs]
        self.scenarios = [scenario.to_dict() for scenario in (*scenarios, Scenario(robot="go2"))]
        self.commands = list(command_lines.commands())

    def content(self, choices: Any) -> bytes:
        """A file of the kind with some of its elements, entries, words or bytes changed."""
        if self.kind == "urdf":
            text = hostile.spoil_urdf(choices, self.urdf, 4).decode(errors="surrogateescape")
            return choices.text(text).encode(errors="surrogateescape")
        if self.kind in ("run", "figure"):
            return self.log(choices)
        if self.kind == "scenario":
            return json.dumps(
                choices.filled(hostile.spoil_mapping(choices, choose(choices, self.scenarios), 5))
            ).encode()
        line = hostile_lines.draw(choices, choose(choices, self.commands))
        return json.dumps([choices.text(word).replace("\0", "") for word in line]).encode()

    def log(self, choices: Any) -> bytes:
        """A run file with some signals and entries changed."""
        signals, metadata = choose(choices, self.runs)
        if choices.integers(3):
            signals = hostile.spoil_signals(choices, signals, 3)
        if choices.integers(3):
            metadata = choices.filled(hostile.spoil_mapping(choices, metadata, 4))
        return hostile.write_log(self.folder / "made", signals, metadata).read_bytes()

    def __call__(self, data: bytes) -> None:
        """Use one input."""
        content = self.content(Choices(data))
        path = self.folder / f"input.{self.kind}"
        path.write_bytes(content)
        begin, where, said = time.process_time(), "", ""
        try:
            ENTRANCES[self.kind](path)
        except Exception as error:
            where, said = place(error), traceback.format_exc()[-3000:]
        took = time.process_time() - begin
        if not where and took > SLOW:
            where, said = "slow", f"{took:.1f} s"
        if where and where not in self.seen:
            self.seen.add(where)
            kept = CORPUS / self.kind / hashlib.sha256(content).hexdigest()[:12]
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(content)
            print(f"DEFECT {where}, kept as {kept.relative_to(ROOT)}\n{said}", flush=True)


def place(error: BaseException) -> str:
    """The error's type, and the last line of this project that it came through."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if str(ROOT) in frame.filename]
    return f"{type(error).__name__} in {Path(frames[-1].filename).name}:{frames[-1].lineno}"


def main(kind: str, options: list[str]) -> None:
    """Search until libFuzzer's options end it."""
    warnings.simplefilter("ignore")
    hostile.VALUES += (ANY,) * len(hostile.VALUES)
    hostile.NUMBERS += (ANY,) * len(hostile.NUMBERS)
    hostile_lines.VALUES += (ANY,) * (len(hostile_lines.VALUES) // 2) + tuple(WORDS)
    folder, seeds = (Path(tempfile.mkdtemp(prefix="fuzz")) for _ in range(2))
    for k in range(100):
        (seeds / str(k)).write_bytes(np.random.default_rng(k).bytes(200))
    fuzzer = Fuzzer(kind, folder)
    atheris.Setup([sys.argv[0], *options, "-max_len=500", "-len_control=0", str(seeds)], fuzzer)
    with hostile_lines.nothing_works(folder) if kind == "command" else contextlib.nullcontext():
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
