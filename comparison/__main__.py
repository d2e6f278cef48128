"""Runs the command line."""

from harpy_pin.cli.signals import leave_at_signals


def main() -> None:
    """Run the command line."""
    leave_at_signals()
    from harpy_pin.cli.ending import one_line_errors

    with one_line_errors("error", 1):
        from comparison.cli import main as run
    run()


if __name__ == "__main__":
    main()
