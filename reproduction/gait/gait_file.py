"""The text file of a found gait (TOML), and the gaits that come with the reproduction."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from harpy_pin.arguments import checked
from harpy_pin.errors import HarpyError, RunFileError
from harpy_pin.files import replacing
from reproduction.gait.planar_gait import PlanarGait

__all__ = ["PACKAGED_GAIT", "PAPER_CURVES_GAIT", "SPACE_GAIT", "OptimisedGait", "load_gait"]

DATA = Path(__file__).parent
PACKAGED_GAIT = DATA / "planar_gait.toml"
"""The gait that walks best in the plane, with a planned double support; friction 0.25."""
SPACE_GAIT = DATA / "space_gait.toml"
"""The same, refined for the walk in space under the paper's governor, friction 0.25."""
PAPER_CURVES_GAIT = DATA / "paper_curves_gait.toml"
"""A gait with the paper's curves, P1 = P0 and P3 = P4 and no double support; friction 0.8."""
FORMAT = 1


@dataclass(frozen=True)
class OptimisedGait:
    """A found gait and where it came from.

    Attributes:
        gait: the walk.
        record: how it was found, plain values: command, search, seed, evaluations, cost, ending, versions, ...
    """

    gait: PlanarGait
    record: dict[str, Any] = field(default_factory=dict)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the text file; one of that name is replaced only once the new one is whole.

        Args:
            path: of the TOML file.

        Raises:
            RunFileError: the file cannot be written.
        """
        lines = [f"format = {FORMAT}", "", "[gait]"]
        lines += [f"{name} = {value!r}" for name, value in self.gait.as_dict().items()]
        lines += ["", "[record]", *(f"{name} = {_toml(value)}" for name, value in self.record.items())]
        with replacing(path) as file:
            file.write(("\n".join(lines) + "\n").encode())


@checked
def load_gait(path: str | Path | None = None) -> OptimisedGait:
    """Read a found gait; the packaged one by default.

    Args:
        path: of a file that :meth:`OptimisedGait.save` has written; the packaged gait by default.

    Raises:
        RunFileError: the file is missing, not TOML, or holds no planar gait; the message says which number is bad.
    """
    source = PACKAGED_GAIT if path is None else Path(path)
    try:
        content = tomllib.loads(source.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFileError(f"cannot read the gait '{source}': {error.strerror or error}", path=source) from error
    except (ValueError, RecursionError) as error:  # of TOML, of its encoding, of numbers and lists beyond measure
        raise RunFileError(f"'{source}' is not a TOML file: {error}", path=source) from error
    numbers, record = content.get("gait"), content.get("record", {})
    if content.get("format") != FORMAT or not isinstance(numbers, dict) or not isinstance(record, dict):
        raise RunFileError(f"'{source}' is no gait of format {FORMAT}: it needs 'format' and [gait]", path=source)
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunFileError(f"'{source}': {name} must be a number, got {ascii(value)[:60]}", path=source)
    try:
        gait = PlanarGait.from_dict(numbers)
    except HarpyError as error:
        raise RunFileError(f"'{source}': {error}", path=source) from error
    return OptimisedGait(gait, record)


def _toml(value: object) -> str:
    """One value as TOML: a boolean, a number, text, or a list of them."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text) + '"'
