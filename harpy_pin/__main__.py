"""The ``harpy`` command: it imports next to nothing at first, so that a signal meets no
half-imported module.
"""

from harpy_pin.cli.signals import leave_at_signals

__all__ = ["main"]


def main() -> None:
    """Run the command."""
    leave_at_signals()
    from harpy_pin.cli.ending import one_line_errors

    with one_line_errors("harpy", 2):
        from harpy_pin.cli.app import main as run

        run()


if __name__ == "__main__":
    main()
