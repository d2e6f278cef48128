"""Runs the command line, or says what is not installed."""

from __future__ import annotations

from harpy_pin.cli.signals import leave_at_signals
from harpy_pin.errors import install_line


def main() -> None:
    """Run the command line."""
    leave_at_signals()
    from harpy_pin.cli.ending import one_line_errors

    try:
        with one_line_errors("error", 1):
            from comparison.cli import main as run
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith(("comparison", "harpy_pin")):
            raise
        raise SystemExit(f"error: the comparison needs '{error.name}': {install_line('compare')}") from None
    run()


if __name__ == "__main__":
    main()
