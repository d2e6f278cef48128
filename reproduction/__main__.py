"""Runs the command line."""

from harpy_pin.cli.signals import leave_at_signals

if __name__ == "__main__":
    leave_at_signals()
    from reproduction.cli import main

    main()
