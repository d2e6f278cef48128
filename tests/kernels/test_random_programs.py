"""Kernels that nobody wrote: what C gives is what plain Python gives, in every bit."""

import numpy as np
import pytest
from needs import needs_compiler
from oracle import same

pytestmark = needs_compiler


class Writer:
    """Random kernels: numbers, arrays, loops, branches, in whatever order they come."""

    def __init__(self, rng):
        self.rng, self.lines, self.names = rng, [], ["x", "y"]
        self.shapes = self.pick(["", "(a=(4,), m=(2, 3))"])

    def pick(self, items):
        return items[self.rng.integers(len(items))]

    def number(self, depth=2):
        kind = self.rng.integers(9 if depth else 3)
        if kind == 0:
            return self.pick(self.names)
        if kind == 1:
            return f"a[{self.index(depth - 1)}]"
        if kind == 2:
            return self.pick(["0.5", "-1.5", "2", "m[1, 0]", "n", "m[i % 2, n % 3]"])
        if kind < 6:
            return f"({self.number(depth - 1)} {self.pick('+-*')} {self.number(depth - 1)})"
        if kind == 6:
            return (
                f"{self.pick(['min', 'max'])}({self.number(depth - 1)}, {self.number(depth - 1)})"
            )
        if kind == 7:
            return (
                f"({self.number(depth - 1)} if {self.condition(depth - 1)} else "
                f"{self.number(depth - 1)})"
            )
        return f"-abs(0.5 * {self.number(depth - 1)})"

    def index(self, depth):
        return self.pick(["i % 4", "n % 4", "3", "(i + n) % 4", "(2 * n + 1) % 4", "i // 2 % 4"])

    def condition(self, depth):
        return f"{self.number(max(depth, 0))} {self.pick(['<', '>=', '!='])} {self.number(0)}"

    def array(self, depth=2):
        """An array that counts for all of ``m`` (2, 3)."""
        kind = self.rng.integers(6 if depth else 3)
        if kind < 2:
            return self.pick(
                ["m", "a[1:]", "a[:2, None]", "m[1]", "m[:, 2:]", "np.repeat(a[:1], 3)"]
            )
        if kind == 2:
            return self.number(1)
        if kind == 3:
            return f"np.sum(m * {self.array(0)}, axis=0)"
        if kind == 4:
            other = self.array(depth - 1)
            return f"np.where(m < {other}, {self.array(depth - 1)}, {self.array(depth - 1)})"
        return f"({self.array(depth - 1)} {self.pick('+-*')} {self.array(depth - 1)})"

    def statement(self, indent, depth):
        kind = self.rng.integers(10 if self.shapes else 8)

        def add(line):
            self.lines.append("    " * indent + line)

        if kind == 0:
            add(f"a[{self.index(1)}], a[{self.index(1)}] = {self.number(1)}, {self.number(1)}")
        elif kind == 1:
            add(f"a[{self.index(1)}] {self.pick(['+=', '-=', '*=', '='])} {self.number()}")
        elif kind == 2 and depth:
            add(f"if {self.condition(1)}:")
            self.block(indent + 1, depth - 1)
            if self.rng.integers(2):
                add("else:")
                self.block(indent + 1, depth - 1)
        elif kind == 3 and depth:
            add(
                f"for k{indent} in "
                f"range({self.pick(['3', 'n', 'a.shape[0]', '1, i + 2', 'n, -1, -1'])}):"
            )
            self.names.append(f"k{indent}")
            self.block(indent + 1, depth - 1)
            if self.rng.integers(2):
                self.lines.append("    " * (indent + 1) + f"if {self.condition(1)}:")
                self.lines.append(
                    "    " * (indent + 2)
                    + self.pick(["break", "continue", f"return {self.number(1)}, n"])
                )
                self.block(indent + 1, 0)
            self.names.remove(f"k{indent}")
        elif kind == 4:
            add(f"x, y = {self.number(1)}, {self.number(1)}")
        elif kind == 5:
            add(
                f"m[{self.pick(['0', '1', 'i % 2'])}, :]"
                f" = {self.pick(['a[1:4]', 'a[0:3]', self.number(1), 'm[n % 2]'])}"
            )
        elif kind == 8:
            add(f"m[:] {self.pick(['=', '+=', '*='])} {self.array()}")
            add("m[:] = 0.0 + np.clip(m, -1e3, 1e3)")
        elif kind == 9:
            add(
                f"diagonal(m[:, {self.pick(['1:', ':2'])}])[:] += {self.pick(['a[2:]', 'm[:, 2]'])}"
            )
            add("a[:2] = 0.5 * a[:2] - np.max(abs(m), axis=1)")
        elif kind == 6:
            add(f"i = {self.pick(['(i + 1) % 5', 'n', '2 * n % 3', 'i + 1 if i < 3 else 0'])}")
        else:
            add(f"{self.pick('xy')} {self.pick(['=', '+=', '-='])} {self.number()}")
        if self.rng.integers(3) == 0:
            add("x = min(max(x, -1e3), 1e3)")

    def block(self, indent, depth):
        for _ in range(self.rng.integers(1, 4)):
            self.statement(indent, depth)

    def program(self, name):
        self.lines = [f"@kernel{self.shapes}", f"def {name}(a, m, x, y, n):", "    i = n"]
        for _ in range(6):
            self.statement(1, 3)
        return "\n".join([*self.lines, "    return x, y + i", ""])


@pytest.mark.usefixtures("compiled_ahead")
@pytest.mark.parametrize("seed", range(4))
def test_programs_that_nobody_wrote(seed, fuzz, tmp_path, monkeypatch):
    rng, count = np.random.default_rng(seed), 15 * fuzz
    texts = [Writer(rng).program(f"program_{n}") for n in range(count)]
    name = f"programs_{seed}"
    (tmp_path / f"{name}.py").write_text(
        "import numpy as np\n\nfrom harpy_pin.kernels import diagonal, kernel\n\n\n"
        + "\n\n".join(texts)
    )
    monkeypatch.syspath_prepend(tmp_path)
    made = __import__(name)
    programs = [getattr(made, f"program_{n}") for n in range(count)]
    for waited in [
        program.prepare(np.zeros(4), np.zeros((2, 3)), 0.0, 0.0, 0) for program in programs
    ]:
        waited.result()
    for program in programs:
        for _ in range(20):
            a, m = rng.normal(size=4), rng.normal(size=(2, 3))
            same(program, a, m, float(rng.normal()), float(rng.normal()), int(rng.integers(0, 4)))
