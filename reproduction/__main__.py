"""Runs the command line, or says what is not installed."""

from harpy_pin.cli.signals import leave_at_signals
from harpy_pin.errors import install_line

if __name__ == "__main__":
    leave_at_signals()
    from reproduction.cli import main

    try:
        main()
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith(("reproduction", "harpy_pin")):
            raise
        raise SystemExit(
            f"error: the report needs '{error.name}': {install_line('compare')}"
        ) from None
