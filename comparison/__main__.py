"""Runs the command line, or says what is not installed."""

from __future__ import annotations

try:
    from comparison.cli import main
except ModuleNotFoundError as error:
    if error.name is None or error.name.startswith(("comparison", "harpy_pin")):
        raise
    raise SystemExit(f"error: the comparison needs '{error.name}': pip install -e '.[compare]'") from None

if __name__ == "__main__":
    main()
